"""Shared by the tests of study replication."""

import importlib

import pytest

from coartic import load_task
from coartic.analysis import load
from tests.support.made_up import change_runs
from tests.support.processes import programs
from tests.support.suites import KNOWN, InProcess, cell_on, made_once, run_and_write

(STUDY,) = programs("replication", "study")


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    """The paper's cells as far as its claims need them, with random search."""
    methods = {
        "ascending descending": "dual-process/EC1 dual-process/EC1-subtask random-search",
        "two-armed-1": "dual-process/EC2 dual-process/EC3 dual-process/EC4",
        "two-armed-2": "dual-process/EC3 dual-process/EC4",
    }
    cells = [cell_on(load_task(task), KNOWN[name]) for tasks, names in methods.items()
             for task in tasks.split() for name in names.split()]  # fmt: skip

    def make(folder):
        run_and_write(folder, cells, runs=5, trials=150, executor=InProcess())

    study = load(made_once(tmp_path_factory, "replication", make))
    change_runs(study, "trials", study.runs.trials.replace(150, 10_000))  # as long as the paper's
    return study


@pytest.fixture(scope="session")
def tables(study):
    """Tables of these runs by name."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(STUDY, "load", lambda _: study)
        return STUDY.measure([study.folder])


@pytest.fixture(scope="session", autouse=True)
def _fewer_resamples_of_claims():
    """On which no verdict of a test depends."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(importlib.import_module("judging"), "RESAMPLES_OF_CLAIMS", 4_999)
        yield
