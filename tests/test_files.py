"""Nothing that is not ours is touched, whatever a folder holds and whenever we are killed."""

import errno
import fcntl
import hashlib
import json
import os
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import CoarticError
from coartic.analysis.report.write import check_report_folder
from coartic.files import (
    LISTING,
    check_folder,
    check_outputs,
    clear_leftovers,
    publish,
    write_atomically,
    write_outputs,
)

ROOT = Path(__file__).parent.parent
PART = f".coartic-{'0123abcd' * 4}.part"
OLD = {"report.html": b"old page", "tables/a.csv": b"old", "tables/deep/b.csv": b"b", "same": b"s"}
NEW = {"report.html": b"new page", "tables/a.csv": b"new", "figures/c.svg": b"c", "same": b"s"}
LATER = {"report.html": b"later", "figures/c.svg": b"c"}
LINK, FOLDER = "a link to somebody's file", "a folder"


def everything(folder):
    """What there is in and below a folder: contents, targets of links."""
    return {
        path.relative_to(folder).as_posix(): os.readlink(path)
        if path.is_symlink()
        else FOLDER
        if path.is_dir()
        else path.read_bytes()
        for path in folder.rglob("*")
    }


def contents(folder):
    """Our files: all but the listing."""
    found = everything(folder)
    return {n: data for n, data in found.items() if n != LISTING and isinstance(data, bytes)}


def sha256(data):
    return hashlib.sha256(data).hexdigest()


def put(home, tree):
    """Make what a tree says, as far as it fits together; somebody's file lies beside."""
    home.mkdir(exist_ok=True)
    (home / "somebody's").write_bytes(b"years of work")
    for name, what in tree.items():
        path = home / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if what == FOLDER:
                path.mkdir()
            elif what == LINK:
                path.symlink_to(home / "somebody's")
            else:
                path.write_bytes(what)
        except (FileExistsError, NotADirectoryError, IsADirectoryError):
            continue


@pytest.fixture(autouse=True, scope="module")
def undelayed():
    """Nothing here depends on when the disk has it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda number: None)
        yield


LISTED = json.dumps({"report": {name: [sha256(data)] for name, data in OLD.items()}}).encode()
PLACES = [
    *(f"target/{name}" for name in (*OLD, *NEW, "tables", "figures", "notes.txt", "a/b/c.txt")),
    *("target", ".target.part", ".target.old", ".target.part/x", ".target.old/y", "beside.txt"),
    *("target/report.html/x", f"target/{LISTING}", f"target/a/{LISTING}", f"target/{PART}.txt"),
]
THINGS = st.sampled_from([b"mine", LINK, FOLDER, LISTED, *OLD.values(), *NEW.values()])


@settings(max_examples=150)
@given(st.dictionaries(st.sampled_from(PLACES), THINGS, max_size=6), st.booleans())
def test_what_is_not_listed_as_ours_stays(tree, alone):
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        put(home, tree)
        before = everything(home)
        listed = before.get(f"target/{LISTING}") == LISTED
        ours = {f"target/{name}": data for name, data in OLD.items() if listed}
        try:
            publish(home / "target", NEW, owner="report", alone=alone)
        except CoarticError:
            assert everything(home) == before
            return
        after = everything(home)
        for path, what in before.items():
            if path != f"target/{LISTING}" and ours.get(path) != what:
                assert after.get(path) == what or (what == FOLDER and listed), path
        assert {name: after[f"target/{name}"] for name in NEW} == NEW
        if alone:
            assert contents(home / "target") == NEW


ACTS = st.tuples(st.sampled_from([*OLD, *NEW, "notes.txt"]), st.sampled_from([None, b"mine"]))


@settings(max_examples=60)
@given(
    st.lists(st.sampled_from([OLD, NEW, LATER, {}]), max_size=3),
    st.lists(ACTS, max_size=2),
    st.booleans(),
)
def test_what_somebody_changed_stays(versions, acts, alone):
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "target")
        for files in versions:
            publish(target, files, owner="report", alone=alone)
            if alone:
                assert contents(target) == files
        for name, what in acts:
            if what is None:
                (target / name).unlink(missing_ok=True)
            else:
                (target / name).parent.mkdir(parents=True, exist_ok=True)
                (target / name).write_bytes(what)
        mine = {name for name, data in everything(target).items() if data == b"mine"}
        before = everything(target)
        try:
            publish(target, NEW, owner="report", alone=alone)
        except CoarticError:
            hollow = [
                path for path in target.rglob("*") if path.is_dir() and not any(path.iterdir())
            ]
            assert mine or hollow  # a folder that somebody made is in the way, too
            assert everything(target) == before
            return
        assert not mine & NEW.keys()
        assert all((target / name).read_bytes() == b"mine" for name in mine)
        assert not (mine and alone)


class Killed(BaseException):
    """Not to be caught; what would clean up does nothing any more."""


class Kill:
    """Ends every use of the disk from step ``last`` on, as if the process were gone."""

    CALLS = ("replace", "unlink", "rmdir", "mkdir", "fsync")

    def __init__(self, monkeypatch, last):
        self.steps, self.last = 0, last
        for name in self.CALLS:
            monkeypatch.setattr(os, name, self._counted(getattr(os, name)))

    def _counted(self, real):
        def call(*arguments, **options):
            self.steps += 1
            if self.steps > self.last:
                raise Killed
            return real(*arguments, **options)

        return call


@pytest.mark.parametrize("first", [{}, OLD], ids=["new", "replaced"])
@pytest.mark.parametrize("alone", [True, False])
def test_a_kill_at_any_step_is_overcome(first, alone, tmp_path):
    last, done = 0, False
    while not done:
        home = tmp_path / str(last)
        target = home / "target"
        if first:
            publish(target, first, owner="report", alone=alone)
        put(home, {".target.part/x": b"mine", ".target.old": b"mine"})
        foreign = {} if alone else {"notes.txt": b"mine", "tables/own.csv": b"mine"}
        if foreign:
            put(home, {f"target/{name}": data for name, data in foreign.items()})
        before = everything(home)
        with pytest.MonkeyPatch.context() as patch:
            Kill(patch, last)
            try:
                publish(target, NEW, owner="report", alone=alone)
                done = True
            except Killed:
                last += 1
        for path, what in before.items():
            name = path.removeprefix("target/")
            if name not in first and name != LISTING and what != FOLDER:
                assert everything(home)[path] == what
        for name in {*first, *NEW}:  # whole: the old file or the new one
            found = (target / name).read_bytes() if (target / name).exists() else None
            assert found in (first.get(name), NEW.get(name))
        if last % 2:
            publish(target, NEW, owner="report", alone=alone)
            again = everything(target)
            assert {n: again[n] for n in NEW} == NEW
        publish(target, LATER, owner="report", alone=alone)
        assert {name: (target / name).read_bytes() for name in LATER} == LATER
        if alone:
            assert contents(target) == LATER
            assert set(everything(target)) == {LISTING, "figures", *LATER}
        else:
            assert not list(target.glob(".coartic-*.part"))
            assert {name: (target / name).read_bytes() for name in foreign} == foreign
    assert last > 10


def test_leftovers_are_those_of_the_dead(tmp_path):
    stay = {
        f"x{PART}": b"mine", f"{PART}.txt": b"mine", ".coartic-1.part": b"mine",
        ".a.part": b"mine", f"below/{PART}": b"mine",
        PART.replace("0", "1"): LINK, PART.replace("0", "2"): FOLDER,
        PART.replace("0", "3"): b"of a writer at work",
    }  # fmt: skip
    put(tmp_path, stay)
    before = everything(tmp_path)
    put(tmp_path, {PART: b"half a fi", PART.replace("0", "4"): b""})
    with (tmp_path / PART.replace("0", "3")).open("r+b") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        clear_leftovers(tmp_path)
        assert everything(tmp_path) == before
    with pytest.raises(FileNotFoundError):
        clear_leftovers(tmp_path / "nowhere")


def test_a_writer_at_work_keeps_its_file(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", lambda number: clear_leftovers(tmp_path))
    write_atomically(tmp_path / "a", b"1")
    publish(tmp_path, {"b": b"2"}, owner="analyse", alone=False)
    assert contents(tmp_path) == {"a": b"1", "b": b"2"}


def test_the_lock_is_no_link(tmp_path):
    (tmp_path / "t").mkdir()
    (tmp_path / "t" / f".coartic-{'0' * 32}.part").symlink_to(tmp_path / "new")
    with pytest.raises(CoarticError, match="cannot write"):
        publish(tmp_path / "t", NEW, owner="report", alone=True)
    assert not (tmp_path / "new").exists()


def test_a_write_that_fails_leaves_nothing(tmp_path, monkeypatch):
    write_atomically(tmp_path / "a", b"before")

    def full(number):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_atomically(tmp_path / "a", b"after")
    with pytest.raises(CoarticError, match=r"cannot write .*t: No space left on device"):
        publish(tmp_path / "t", NEW, owner="report", alone=True)
    with pytest.raises(CoarticError, match=r"cannot write .*b: No space left on device"):
        write_outputs({tmp_path / "b": b""}, replace=False)
    assert everything(tmp_path) == {"a": b"before", "t": FOLDER}


@pytest.mark.parametrize(
    "content",
    [
        b"", b"\xff\xfe", b"[]", b"1", b'{"report": []}', b'{"report": {"a": "b"}}',
        b'{"report": {"a": [1]}}', b'{"report": {"a": [null]}}', b"1" * 5000, b"[" * 100_000,
        LINK, FOLDER, b" " * (16 * 2**20 + 1),
    ],
    ids=range(13),
)  # fmt: skip
def test_a_listing_that_is_none_is_refused(content, tmp_path):
    put(tmp_path, {f"t/{LISTING}": content, "t/report.html": b"old page"})
    before = everything(tmp_path)
    for alone in (True, False):
        with pytest.raises(CoarticError, match="is no list of the files that coartic wrote"):
            publish(tmp_path / "t", NEW, owner="report", alone=alone)
        with pytest.raises(CoarticError, match="is no list of the files that coartic wrote"):
            check_folder(tmp_path / "t", owner="report", alone=alone)
    assert everything(tmp_path) == before


def test_a_listing_leads_nowhere(tmp_path):
    """Names outside the folder, through links, of folders, too long, or no text at all."""
    mine = sha256(b"mine")
    put(tmp_path, {"outside/a.txt": b"mine", "beside.txt": b"mine", "b.txt": b"mine"})
    names = [
        "../beside.txt", str(tmp_path / "b.txt"), "in/../../beside.txt", "/".join("x" * 5000), "",
        "link/a.txt", "\udc80\udfff", "\0", "y" * 5000, "/", "..", "link", "folder", LISTING,
    ]  # fmt: skip
    listing = json.dumps({"report": {name: [mine] for name in names}}).encode()
    for alone in (True, False):
        target = tmp_path / str(alone)
        put(tmp_path, {f"{alone}/{LISTING}": listing})
        before = everything(tmp_path)
        publish(target, NEW, owner="report", alone=alone)
        assert before.items() - {(f"{alone}/{LISTING}", listing)} <= everything(tmp_path).items()
    target = tmp_path / "linked"
    put(tmp_path, {f"linked/{LISTING}": listing})
    (target / "link").symlink_to(tmp_path / "outside")
    before = everything(tmp_path)
    with pytest.raises(CoarticError, match="linked holds link, not listed"):
        publish(target, NEW, owner="report", alone=True)
    assert everything(tmp_path) == before
    publish(target, NEW, owner="analyse", alone=False)
    assert (target / "link" / "a.txt").read_bytes() == b"mine"


def test_no_link_is_followed(tmp_path):
    put(tmp_path, {"outside/a.csv": b"mine"})
    target = tmp_path / "target"
    publish(target, OLD, owner="report", alone=True)
    for name, to in (("tables", "outside"), ("report.html", "somebody's"), ("same", "nowhere")):
        (target / name).rename(tmp_path / f"was-{name}")
        (target / name).symlink_to(tmp_path / to)
        before = everything(tmp_path)
        for alone in (True, False):
            with pytest.raises(CoarticError, match=f"target holds {name}, not listed"):
                publish(target, OLD, owner="report", alone=alone)
        assert everything(tmp_path) == before
        (target / name).unlink()
        (tmp_path / f"was-{name}").rename(target / name)
    (tmp_path / "link").symlink_to(target)
    with pytest.raises(CoarticError, match="link is a link; name the folder"):
        publish(tmp_path / "link", NEW, owner="report", alone=True)
    publish(tmp_path / "link", {"more": b"1"}, owner="analyse", alone=False)  # results elsewhere
    assert (target / "more").read_bytes() == b"1"
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    with pytest.raises(CoarticError, match="dangling: what is there is no folder"):
        publish(tmp_path / "dangling", NEW, owner="analyse", alone=False)


def test_commands_share_a_results_folder(tmp_path):
    publish(tmp_path, {"a": b"1", "b": b"1"}, owner="run", alone=False)
    publish(tmp_path, {"c": b"1"}, owner="analyse", alone=False)
    with pytest.raises(CoarticError, match=r"holds a, not listed there as written by `coartic an"):
        publish(tmp_path, {"c": b"2", "a": b"2"}, owner="analyse", alone=False)
    assert contents(tmp_path) == {"a": b"1", "b": b"1", "c": b"1"}
    publish(tmp_path, {"c": b"2"}, owner="analyse", alone=False)
    publish(tmp_path, {"a": b"2"}, owner="run", alone=False)
    publish(tmp_path, {"b": b"2"}, owner="run", alone=False)  # still its own
    assert contents(tmp_path) == {"a": b"2", "b": b"2", "c": b"2"}
    with pytest.raises(CoarticError, match="holds a, b, c, not listed"):
        publish(tmp_path, {}, owner="report", alone=True)


def test_the_same_files_again_touch_nothing(tmp_path):
    for alone in (True, False):
        target = tmp_path / str(alone)
        publish(target, OLD, owner="report", alone=alone)
        before = {path: path.stat().st_ino for path in target.rglob("*")}
        publish(target, OLD, owner="report", alone=alone)
        assert before == {path: path.stat().st_ino for path in target.rglob("*")}


def test_a_file_of_these_very_bytes_is_in_nobodys_way(tmp_path):
    """A folder of an older version, which kept no listing."""
    put(tmp_path, {f"t/{name}": data for name, data in OLD.items()})
    with pytest.raises(CoarticError, match="not listed"):
        check_folder(tmp_path / "t", owner="report", alone=False, names=OLD)
    publish(tmp_path / "t", OLD, owner="report", alone=True)
    publish(tmp_path / "t", NEW, owner="report", alone=True)
    assert contents(tmp_path / "t") == NEW


def test_names_in_sentences_are_plain(tmp_path):
    put(tmp_path, {f"t/{name}": b"" for name in ("a\x1b[2Jb\nc", "d\u202ee", "f", "g", "h")})
    (tmp_path / "t" / os.fsdecode(b"\x80")).touch()
    with pytest.raises(CoarticError) as error:
        publish(tmp_path / "t", NEW, owner="report", alone=True)
    assert str(error.value) == (
        f"{tmp_path / 't'} holds a\\x1b[2Jb | c, d\\u202ee, f and 3 more, not listed there as "
        "written by `coartic report`; move them away, or choose another folder"
    )


@pytest.mark.parametrize(
    "name", ["", "/a", "../a", "a/../b", "a//b", "a/", ".", "a\0", LISTING, f"a/{PART}"]
)
def test_names_that_no_file_of_ours_has(name, tmp_path):
    with pytest.raises(ValueError, match="no names for files"):
        publish(tmp_path / "t", {name: b""}, owner="report", alone=True)
    assert not everything(tmp_path)


def test_writers_at_the_same_time_wait_for_each_other(tmp_path):
    versions = [{"page": b"%d" % k, f"only/{k}": b"x"} for k in range(12)]
    with ThreadPoolExecutor(6) as pool:
        for done in [
            pool.submit(publish, tmp_path / "t", files, owner="report", alone=True)
            for files in versions
        ]:
            done.result()
    assert contents(tmp_path / "t") in versions
    publish(tmp_path / "t", NEW, owner="report", alone=True)
    assert contents(tmp_path / "t") == NEW


def test_a_folder_that_is_read_only(tmp_path, monkeypatch):
    publish(tmp_path / "t", OLD, owner="report", alone=True)
    before = everything(tmp_path)

    def denied(*_, **__):
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(os, "open", denied)
    for use in (publish, lambda folder, files, **options: check_folder(folder, **options)):
        with pytest.raises(CoarticError, match="cannot write .*t: Read-only file system"):
            use(tmp_path / "t", NEW, owner="report", alone=True)
    monkeypatch.setattr(os, "mkdir", denied)
    with pytest.raises(CoarticError, match="cannot write .*other: Read-only file system"):
        publish(tmp_path / "other", NEW, owner="report", alone=True)
    assert everything(tmp_path) == before


def test_records_and_results_are_out_of_bounds(tmp_path):
    results = tmp_path / "results"
    put(
        tmp_path, {"results/records/.lock": b"", "results/records/a.json": b"1", "records/b": b"2"}
    )
    (tmp_path / "link").symlink_to(results / "records")
    before = everything(tmp_path)
    for place in (results / "records", results / "records" / "deep" / "er", tmp_path / "link"):
        for alone in (True, False):
            with pytest.raises(CoarticError, match="is among the records of"):
                publish(place, NEW, owner="report", alone=alone)
        with pytest.raises(CoarticError, match="is among the records of"):
            write_outputs({place / "a.md": b""}, replace=True)
    for place in (results, tmp_path, results / ".." / "results", results / "records" / ".."):
        with pytest.raises(CoarticError, match="a report has a folder of its own"):
            check_report_folder(place, results)
    check_report_folder(results / "report", results)
    assert everything(tmp_path) == before
    write_outputs({tmp_path / "records" / "mine.md": b"3"}, replace=False)  # of something else


def test_single_files(tmp_path):
    put(tmp_path, {"file.md": b"mine", "link.md": LINK, "folder.md": FOLDER})
    (tmp_path / "dangling.md").symlink_to(tmp_path / "new")
    os.mkfifo(tmp_path / "pipe.md")
    expected = {
        "link.md": "it is a link", "dangling.md": "it is a link", "folder.md": "is no file",
        "pipe.md": "is no file", "no/a.md": "there is no folder", "file.md/a.md": "is no folder",
    }  # fmt: skip
    names = sorted(path.name for path in tmp_path.iterdir())
    for name, words in expected.items():
        for replace in (True, False):
            with pytest.raises(CoarticError, match=f"cannot write .*{name}: .*{words}"):
                write_outputs({tmp_path / "new.md": b"", tmp_path / name: b""}, replace=replace)
    for use in (write_outputs, check_outputs):
        with pytest.raises(CoarticError, match=r"file.md is there already; add --replace to"):
            use({tmp_path / "new.md": b"", tmp_path / "file.md": b""}, replace=False)
    assert names == sorted(path.name for path in tmp_path.iterdir())
    assert (tmp_path / "file.md").read_bytes() == b"mine"
    (tmp_path / PART).write_bytes(b"half a fi")
    write_outputs({tmp_path / "new.md": b"1", tmp_path / "file.md": b"2"}, replace=True)
    assert not (tmp_path / PART).exists()
    assert (tmp_path / "file.md").read_bytes() == b"2"
    assert (tmp_path / "somebody's").read_bytes() == b"years of work"


def test_the_example_is_what_a_report_wrote():
    check_folder(ROOT / "benchmarks" / "example", owner="report", alone=True)
