"""The attacks that are quick: edits and hostile methods of every kind, and all forgeries.

``python -m tests.attacks`` tries them all, through the command line.
"""

import os
import shutil
from dataclasses import replace

import pytest
from filelock import FileLock

import coartic.benchmarks.executors
import coartic.cli
from coartic import PAPER, CoarticError
from coartic.analysis.results.folder import load_results
from coartic.analysis.results.laws import read_manifest
from coartic.benchmarks.store import Store
from coartic.benchmarks.tables import write_tables
from coartic.scores import solved
from tests.support.commands import ready
from tests.support.suites import InProcess

from .checkout import PART_OF_A_FOLDER, Ended, in_process
from .edits import SUITE, accepted, edits
from .forgeries import FORGERIES, forge_in, says
from .methods import ATTACKS
from .trial import in_a_fork

COMMANDS = (
    "runs/reward",
    "manifest/seed of another",
    "learning/a better trial",
    "records/deleted",
)
"""Edits that every command is tried on, not only what all of them read a folder with."""
ALL_OF = ("records/", "together/")
"""Edits of which none is like another."""
TOGETHER = (
    "neighbour/answers-twice",
    "exhaust/errors",
    "score/model",
    "solution/array",
    "told/mutated",
    "details/surrogate",
    "bound/text",
    "end/foreign",
    "left/daemon",
)
"""The first two end their processes; the others share one, which is ended once it has left what is
to end with it."""
REFUSED = ("import/exit-0", "name/learner", "name/escape", "told/none")


@pytest.fixture(scope="module", autouse=True)
def _ready():
    """The command line, put together once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(coartic.cli, "app", ready())
        yield


@pytest.fixture(scope="module")
def whole(session_folder):
    """Made by the first worker for all."""
    folder = session_folder / "attacks"
    with FileLock(session_folder / "attacks.lock"):
        if not (folder / "made").exists():
            folder.mkdir()
            (folder / "small.toml").write_text(SUITE)
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(coartic.benchmarks.executors, "Local", InProcess)
                code, said = in_process(["run", folder / "small.toml", "--out", folder / "whole"])
            assert code == 0, said
            (folder / "made").touch()
    return folder / "whole"


@pytest.fixture
def copied(whole, tmp_path):
    """A fresh copy of the finished folder, as often as one is asked for.

    Again, only what is not as it was is copied: what was written since is not as old.
    """
    folder = tmp_path / "results"
    entries = [path.relative_to(whole) for path in whole.rglob("*")]

    def is_there(name):
        path = folder / name
        if path.is_symlink() or not path.exists():
            return False
        return path.is_dir() if (whole / name).is_dir() else path.stat().st_mtime_ns == 0

    def copy():
        folder.mkdir(exist_ok=True)
        missing = [name for name in entries if not is_there(name)]
        others = {path.relative_to(folder) for path in folder.rglob("*")} - {*entries}
        for name in (*missing, *sorted(others, reverse=True)):
            path = folder / name
            if path.is_dir() and not path.is_symlink():
                path.rmdir()
            else:
                path.unlink(missing_ok=True)
        for name in missing:
            if (whole / name).is_dir():
                (folder / name).mkdir()
            else:
                shutil.copyfile(whole / name, folder / name)
                os.utime(folder / name, (0, 0))
        return folder

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


def test_edits_are_seen(whole, copied):
    """Of those of a kind, every fourth: a column or a key is what they differ in."""
    got = {}
    every = edits(whole)
    chosen = {n for number, n in enumerate(every) if number % 4 == 0 or n.startswith(ALL_OF)}
    for name, edit in every.items():
        if name not in chosen:
            continue
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


@pytest.mark.parametrize("name", ["manifest.json", "runs.parquet"])
def test_nobody_waits_for_a_pipe(name, copied):
    folder = copied()
    (folder / name).unlink()
    os.mkfifo(folder / name)
    with pytest.raises(CoarticError, match=f"{name}: is not a regular file"):
        load_results(folder)


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


def test_a_forger_who_makes_ids_anew_is_seen(whole, copied):
    """Other constants, and everything that a record says made to fit them."""
    folder = copied()
    manifest, store = read_manifest(folder), Store(folder)
    (cell,) = [c for c in manifest.specification.cells if c.method == "dual-process/EC1"]
    giant = PAPER._replace(step=0.02)
    planned = manifest.run_ids(cell)
    forged = []
    for record in map(store.read, planned):
        scored = {
            name: solved(record.task, [m.movement() for m in old.movements], giant)
            for name in ("solution", "initial", "replay")
            if (old := getattr(record, name)) is not None
        }
        scored["initial"] = scored["solution"]
        specification = record.specification.model_copy(update={"model": giant._asdict()})
        rewards = [scored["initial"].reward] * 40
        update = {
            **scored,
            "specification": specification,
            "run_id": f"{specification.key()}-{record.code}",
            "rewards": tuple(rewards),
            "meter": replace(record.meter, movement_ticks=-sum(rewards)),
        }
        forged.append(record.model_copy(update=update))
        forged[-1].check()  # by itself it is right
    store.write(forged)
    load_results(folder)  # under their own ids they are nobody's
    store.write([f.model_copy(update={"run_id": i}) for f, i in zip(forged, planned, strict=True)])
    with pytest.raises(CoarticError, match=f"run {planned[0]} contradicts itself: its id is not"):
        load_results(folder)


def test_hostile_methods_forge_nothing_and_leave_nothing(tmp_path):
    assert in_a_fork(TOGETHER, tmp_path) == []


@pytest.mark.parametrize("name", REFUSED)
def test_methods_that_are_none_are_refused_with_a_sentence(name, tmp_path):
    path = tmp_path / "hostile.py"
    path.write_text(ATTACKS[name].source, encoding="utf-8")
    command = ["run", "paper", "--methods", ATTACKS[name].method, "--method-file", path]
    ended = Ended(*in_process([*command, "--out", tmp_path / "out", "--jobs", "1"]))
    assert ended.refused
    assert "hostile.py" in ended.text
    assert "\x1b" not in ended.text
