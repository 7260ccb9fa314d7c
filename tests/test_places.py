"""Places that may not be read or written, or that cannot be: each command says a sentence."""

import contextlib
import ctypes
import io
import os
import shutil
import sys

import pytest
from typer.main import get_command

from coartic import cli
from coartic.analysis.figures import plot
from coartic.runs import store
from tests.support.bad_inputs import GOOD
from tests.support.processes import apart
from tests.support.suites import paper_cells, run_and_write

LONG = "/".join(["long" * 30] * 5)  # SQLite takes no path of more than 512 letters
COMMANDS = {
    "run": "run quick --tasks ascending --methods corrective-alone/given --jobs 1 --out {}",
    "include": "run paper --tasks ascending --methods EC1 --include {} --out new",
    "report": "report {}",
    "verify": "verify {}",
    "draw": "draw ascending --out {}/tasks.svg",
    "new": "new my-search --out {}/mine.py",
    "task": "list {}/task.toml",
    "method": "list --method-file {}/mine.py",
}
READ, WRITE = ("include", "report", "verify", "task", "method"), ("run", "draw", "new")
PLACES = {
    "file": READ,
    "locked": (*READ, *WRITE),
    "under": ("report", "new"),
    "unreadable": READ,
    "closed": (*WRITE, "report"),
    "empty": WRITE,
    "folder": ("report", "run"),
    LONG: ("report",),
    "missing": (*READ, "draw"),
}
"""Places, and the commands that cannot use them."""


def give_up_rights():
    """Root may read and write everything: give that up, which no process gets back."""
    if not os.geteuid():
        version_3, nothing = (ctypes.c_uint32 * 2)(0x20080522, 0), (ctypes.c_uint32 * 6)()
        assert ctypes.CDLL(None).capset(version_3, nothing) == 0


def answers(here, calls):
    """What commands say in a process of their own: exit code and output, by key."""
    os.chdir(here)
    give_up_rights()
    cli.app, plot.picture = get_command(cli.app), lambda *_: b""  # put together once; takes long
    said = {}
    for key, words in calls.items():
        out, sys.argv = io.StringIO(), ["coartic", *words]
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            try:
                code = cli.main() or 0
            except SystemExit as stop:
                code = stop.code or 0
            except BaseException as error:
                code = repr(error)
        said[key] = code, out.getvalue()
    return said


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """What each command says of each place."""
    here = tmp_path_factory.mktemp("places")
    run_and_write(here / "good", paper_cells(tasks=["ascending"]), runs=1, trials=5)
    (here / "file").write_text("no folder")
    (here / "empty").mkdir()
    (here / "folder" / store.RUNS_FILE).mkdir(parents=True)
    (here / LONG).mkdir(parents=True)
    for name in ("locked", "unreadable", "closed", "over/under", LONG):
        shutil.copytree(here / "good", here / name, dirs_exist_ok=True)
        (here / name / "report").mkdir(exist_ok=True)
        (here / name / "report" / ".coartic-files").write_text("report.html\n")
        for file in ("task.toml", "mine.py"):
            (here / name / file).write_text(GOOD)
            (here / name / file).chmod(0)
    os.symlink("over/under", here / "under")
    for path in (here / "unreadable" / store.RUNS_FILE, here / "locked", here / "over"):
        path.chmod(0)
    for path in (*(here / "closed").rglob("*"), here / "closed", here / "empty"):
        path.chmod(0o555 if path.is_dir() else 0o444)
    calls = {
        f"{command} {place}": COMMANDS[command].format(place).split()
        for place, chosen in PLACES.items()
        for command in chosen
    }
    said = apart(answers, here, calls)
    for path in (here / "over", here / "locked", here / "closed", here / "empty"):
        path.chmod(0o755)
    return said


@pytest.mark.process
@pytest.mark.parametrize("place", PLACES, ids=lambda place: place[:12])
def test_a_place_that_cannot_be_used_gets_a_sentence(said, place):
    for command in PLACES[place]:
        code, words = said[f"{command} {place}"]
        assert code == 2, (command, words)
        assert words.startswith("Error: "), command
        assert len(words.splitlines()) == 1, words
        assert len(words) < 1200, command
    assert place != "locked" or "Permission denied" in said["report locked"][1]
