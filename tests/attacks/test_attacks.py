"""The attacks that are quick: all edits and forgeries, and a hostile method of every kind.

``python -m tests.attacks`` tries them all, through the command line.
"""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.integrity import read_manifest
from analysis.results import load_results
from benchmarks.store import Store
from benchmarks.tables import write_tables
from coartic import CoarticError

from .checkout import PART_OF_A_FOLDER, Ended, in_process
from .edits import accepted, edits, finished
from .forgeries import FORGERIES, forge_in, says
from .methods import ATTACKS

ROOT = Path(__file__).parent.parent.parent
COMMANDS = (
    "runs/reward",
    "manifest/seed of another",
    "learning/a better trial",
    "records/deleted",
)
"""Edits that every command is tried on, not only what all of them read a folder with."""
TOGETHER = (
    "score/model",
    "score/later",
    "solution/array",
    "neighbour/import-execute",
    "neighbour/answers-twice",
    "told/mutated",
    "details/surrogate",
    "details/large",
    "bound/text",
    "end/foreign",
    "exhaust/errors",
    "left/daemon",
)
REFUSED = ("import/exit-0", "name/learner", "name/escape", "told/none")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return finished(ROOT, tmp_path_factory.mktemp("attacks"))


@pytest.fixture
def copied(whole, tmp_path):
    """A fresh copy of the finished folder, as often as one is asked for."""

    def copy():
        folder = tmp_path / "results"
        shutil.rmtree(folder, ignore_errors=True)
        return shutil.copytree(whole, folder)

    return copy


def through(folder, read=load_results):
    """How a folder that is not right gets through; None where it is refused as it should be."""
    try:
        read(folder)
    except CoarticError as error:
        return None if PART_OF_A_FOLDER.search(str(error)) else f"names nothing: {error}"
    except Exception as error:
        return repr(error)
    return "accepted"


def test_the_folder_is_right(whole):
    load_results(whole)


def test_every_edit_is_seen(whole, copied):
    got = {}
    for name, edit in edits(whole).items():
        folder = copied()
        edit(folder)
        if how := through(folder):
            got[name] = how
    assert got == {}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_refuses_an_edited_folder(name, whole, copied):
    folder = copied()
    edits(whole)[name](folder)
    assert accepted(lambda *words: Ended(*in_process(words)), whole, folder, name) == []
    assert in_process(["report", folder])[0] == 2


def test_every_forgery_is_seen_once_its_tables_are_made_again(whole, copied):
    manifest = read_manifest(whole)

    def made_again(folder):
        write_tables(Store(folder), manifest)
        load_results(folder)

    folder = copied()
    made_again(folder)
    assert says(folder) == says(whole)
    got = {}
    for name, forgery in FORGERIES.items():
        if forgery.unseen_by_design:
            continue
        folder = copied()
        forge_in(folder, forgery)
        if how := through(folder, made_again):
            got[name] = how
    assert got == {}


def test_hostile_methods_forge_nothing_and_leave_nothing(tmp_path):
    said = subprocess.run(
        [sys.executable, "-m", "tests.attacks.trial", ROOT, tmp_path, *TOGETHER],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        check=True,
    )
    assert json.loads(said.stdout) == []


@pytest.mark.parametrize("name", REFUSED)
def test_methods_that_are_none_are_refused_with_a_sentence(name, tmp_path):
    path = tmp_path / "hostile.py"
    path.write_text(ATTACKS[name].source, encoding="utf-8")
    command = ["run", "paper", "--methods", ATTACKS[name].method, "--method-file", path]
    ended = Ended(*in_process([*command, "--out", tmp_path / "out", "--jobs", "1"]))
    assert ended.refused
    assert "hostile.py" in ended.text
    assert "\x1b" not in ended.text
