"""Files for users: written whole, and never over what is not ours."""

import os

import pytest

from coartic import CoarticError
from coartic.files import LISTING, check_folder, publish, write_atomically, write_output


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
    publish(folder, {"a.txt": b"4", "d.txt": b"5"})
    mine = {"mine.txt": b"mine", "tables/mine.csv": b"mine"}
    assert content(folder) == {"a.txt": b"4", "d.txt": b"5", **mine}
    assert not (folder / "figures").exists()


def test_what_is_not_ours_is_in_the_way_before_anything_is_written(tmp_path):
    (tmp_path / "b.txt").write_text("mine")
    for what in (publish, check_folder):
        with pytest.raises(CoarticError, match=r"b.txt, which coartic did not write.*another"):
            what(tmp_path, {"a.txt": b"1", "b.txt": b"2"})
    assert content(tmp_path) == {"b.txt": b"mine"}
    with pytest.raises(CoarticError, match="is no folder"):
        publish(tmp_path / "b.txt", {"a.txt": b"1"})


def test_a_list_that_was_tampered_with_leads_nowhere(tmp_path):
    outside, folder = tmp_path / "outside.txt", tmp_path / "folder"
    outside.write_text("mine")
    publish(folder, {"a.txt": b"1"})
    (folder / LISTING).write_text(f"../outside.txt\n{outside}\na.txt\n")
    publish(folder, {"b.txt": b"2"})
    assert outside.read_text() == "mine"
    assert content(folder) == {"b.txt": b"2"}


def test_what_fails_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    publish(tmp_path, {"a.txt": b"old"})
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left")))
        with pytest.raises(OSError, match="No space"):
            write_atomically(path, b"new")
        with pytest.raises(CoarticError, match=r"cannot write .*No space left"):
            write_output(path, b"new", replace=True)
    assert content(tmp_path) == {"a.txt": b"old"}


def test_single_files_are_replaced_only_where_that_is_asked_for(tmp_path):
    path = tmp_path / "b.txt"
    write_output(path, b"1", replace=False)
    with pytest.raises(CoarticError, match="b.txt is there already; add --replace"):
        write_output(path, b"2", replace=False)
    assert content(tmp_path) == {"b.txt": b"1"}
    write_output(path, b"2", replace=True)
    assert content(tmp_path) == {"b.txt": b"2"}
    (tmp_path / "link").symlink_to(path)
    for path, words in (
        (tmp_path / "none" / "a.txt", "there is no folder"),
        (tmp_path, "no file"),
        (tmp_path / "link", "it is a link"),
    ):
        with pytest.raises(CoarticError, match=words):
            write_output(path, b"3", replace=True)
