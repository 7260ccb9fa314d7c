"""Files for users: written whole, and never over what is not ours."""

import os
from functools import partial

import pytest

from coartic import CoarticError
from coartic.internal import files
from coartic.internal.files import LISTING, make_folder, write_atomically, write_output

publish = partial(files.publish, ours=".*")


def content(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name != LISTING
    }


def test_a_folder_holds_what_was_published_last(tmp_path):
    folder = tmp_path / "deep" / "er"
    publish(folder, {"a.txt": b"1", "tables/b.csv": b"2", "figures/c.svg": b"3"})
    (folder / "mine.txt").write_text("mine")
    (folder / "tables" / "mine.csv").write_text("mine")
    for left in (folder / ".coartic-123-a.txt", folder / "tables" / ".coartic-9-b.csv"):
        left.write_text("of a command that was killed")
    publish(folder, {"a.txt": b"4", "of..dots.txt": b"3"})
    publish(folder, {"a.txt": b"4", "d.txt": b"5"})
    mine = {"mine.txt": b"mine", "tables/mine.csv": b"mine"}
    assert content(folder) == {"a.txt": b"4", "d.txt": b"5", **mine}
    assert not (folder / "figures").exists()


def test_what_is_not_ours_is_in_the_way_before_anything_is_written(tmp_path):
    (tmp_path / "b.txt").write_text("mine")
    for what in (publish, make_folder):
        with pytest.raises(CoarticError, match=r"b.txt, which coartic has not listed in .*another"):
            what(tmp_path, {"a.txt": b"1", "b.txt": b"2"})
    assert content(tmp_path) == {"b.txt": b"mine"}
    with pytest.raises(CoarticError, match="b.txt cannot be written: File exists"):
        publish(tmp_path / "b.txt", {"a.txt": b"1"})


def test_a_listing_that_leads_elsewhere_is_refused(tmp_path):
    (tmp_path / ".coartic-9-mine").write_text("mine")
    (tmp_path / "report").mkdir()
    for name in (".", "..", "../.coartic-9-mine", str(tmp_path / ".coartic-9-mine")):
        (tmp_path / "report" / LISTING).write_text(f"{name}\n")
        with pytest.raises(CoarticError, match="leads out of"):
            publish(tmp_path / "report", {"a.txt": b"1"})
    assert (tmp_path / ".coartic-9-mine").read_text() == "mine"


def test_a_list_of_somebody_else_removes_no_file_with_another_name(tmp_path):
    """Their list names files that a user has put there: nothing of these can be made again."""
    for name in ("mine.txt", "notes/mine.csv", "old.csv"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
    (tmp_path / LISTING).write_text("mine.txt\nnotes/mine.csv\nold.csv\n")
    files.publish(tmp_path, {"a.csv": b"1"}, r"[a-z]+\.csv")
    assert {*content(tmp_path)} == {"a.csv", "mine.txt", "notes/mine.csv"}
    assert (tmp_path / LISTING).read_text() == "a.csv\nmine.txt\nnotes/mine.csv\n"


@pytest.mark.parametrize("listing", [None, b"", b"a.txt\n\0\0\0\0", b"\0" * 4096, b"\x1b\xff\xfe"])
def test_a_list_that_is_missing_or_damaged_is_said(listing, tmp_path):
    publish(tmp_path, {"a.txt": b"1"})
    (tmp_path / LISTING).unlink()
    if listing is not None:
        (tmp_path / LISTING).write_bytes(listing)
    with pytest.raises(CoarticError, match="a.txt, which .* copy this hidden file, too"):
        publish(tmp_path, {"a.txt": b"2"})
    publish(tmp_path, {"b.txt": b"2"})
    assert content(tmp_path) == {"a.txt": b"1", "b.txt": b"2"}


def test_what_fails_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    publish(tmp_path, {"a.txt": b"old"})
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left")))
        with pytest.raises(OSError, match="No space"):
            write_atomically(path, b"new")
        with pytest.raises(CoarticError, match=r"cannot be written.*No space left"):
            write_output(path, b"new", replace=True)
    assert content(tmp_path) == {"a.txt": b"old"}


def test_single_files_are_replaced_only_where_that_is_asked_for(tmp_path):
    path = tmp_path / "b.txt"
    write_output(path, b"1", replace=False)
    with pytest.raises(CoarticError, match="b.txt exists: add --replace"):
        write_output(path, b"2", replace=False)
    assert content(tmp_path) == {"b.txt": b"1"}
    write_output(path, b"2", replace=True)
    assert content(tmp_path) == {"b.txt": b"2"}
    with pytest.raises(CoarticError, match="the folder .* does not exist"):
        write_output(tmp_path / "none" / "a.txt", b"3", replace=True)
    with pytest.raises(CoarticError, match="cannot be written"):
        write_output(tmp_path, b"3", replace=True)
