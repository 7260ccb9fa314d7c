"""Shared by all tests."""

import gc
import os
import signal
import subprocess
import sys

import pytest
from filelock import FileLock
from hypothesis import settings

from coartic.benchmarks.guard import THREADS

# While modules are imported and tests collected, nothing is garbage: see the end of this file.
gc.disable()

# What the fixtures need is imported in them: the process that hands out the tests to
# workers reads this file, too, and runs none.

# One worker, one core, as in a sandbox: BLAS threads wait for each other by spinning. NumPy reads
# this when it is first imported.
for _name, _number in THREADS.items():
    os.environ.setdefault(_name, _number)

# The same examples every time: a run that fails says something of the code, not of its luck.
# Others are tried with --hypothesis-profile=new.
settings.register_profile("same", derandomize=True, max_examples=30, deadline=None)
settings.register_profile("new", deadline=None)
settings.load_profile("same")

# Tests that interrupt themselves or others do so in the background as well.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def session_folder(tmp_path_factory):
    """The temporary folder of all workers of the session."""
    own = tmp_path_factory.getbasetemp()
    return own.parent if "PYTEST_XDIST_WORKER" in os.environ else own


@pytest.fixture(scope="session", autouse=True)
def _kernels():
    """Compiled or loaded before the first test, on no test's clock; workers share the work."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        from coartic import load_task
        from coartic.learner.learning import warm_up

        warm_up(load_task("ascending"))


@pytest.fixture(scope="session", autouse=True)
def _unsynced():
    """Nobody cuts the power: nothing waits for the disk. That files are synced, and when, is
    for the tests of coartic.files and of the store, which look at the calls, and what other
    processes write is."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda number: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def _nursery():
    """Sandboxes begin as forks, on Linux: imports and kernels take a hundred times as long.

    That they can begin by themselves is for some tests of sandboxes, and for all that run a
    suite in a process of its own.
    """
    from coartic.benchmarks import sandbox
    from tests.support.nursery import Nursery

    if sys.platform != "linux":
        yield
        return
    nursery = Nursery()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sandbox, "subprocess", nursery)
        yield
    sandbox.close_all()
    nursery.close()


@pytest.fixture
def sandboxes_by_themselves(monkeypatch):
    """No nursery, and no sandbox of earlier tests."""
    from coartic.benchmarks import sandbox

    sandbox.close_all()
    monkeypatch.setattr(sandbox, "subprocess", subprocess)


@pytest.fixture(autouse=True)
def _plain_width(monkeypatch):
    """Output as wide as it is without a terminal, whatever started the tests."""
    monkeypatch.delenv("COLUMNS", raising=False)


@pytest.fixture
def in_this_process(monkeypatch):
    """Runs without processes of their own, which take long and have tests of their own."""
    import coartic.benchmarks.executors
    import coartic.benchmarks.reproduce
    from tests.support.suites import InProcess, performed

    monkeypatch.setattr(coartic.benchmarks.executors, "Local", InProcess)
    monkeypatch.setattr(coartic.benchmarks.reproduce, "supervise", performed)


@pytest.fixture
def one_by_one(monkeypatch):
    """Runs that are performed each by a job of its own, whatever their method would have."""
    from coartic.benchmarks.registry import Entry

    monkeypatch.setattr(Entry, "most_together", lambda entry, parameters: 1)


@pytest.fixture(scope="session")
def traced(session_folder):
    """A results folder that nobody writes into: the paper's cells beside other methods.

    The first worker makes it for all.
    """
    from coartic.analysis import load
    from tests.support.suites import run_and_write, traced_cells, with_environment

    folder = session_folder / "traced" / "results"
    with FileLock(session_folder / "traced.lock"):
        if not (session_folder / "traced.made").exists():
            run_and_write(folder, traced_cells(), runs=4, trials=150)
            with_environment(folder)
            (session_folder / "traced.made").touch()
    return load(folder)


LONGEST = (
    "tests/attacks/test_attacks.py",
    "tests/test_attack_inputs.py",
    "tests/test_conformance.py",
    "tests/test_sandbox.py",
)
"""Modules that begin, so that no worker is left with one of them alone at the end."""


def pytest_collection_modifyitems(items):
    """The modules that take longest, then the others."""
    rank = {name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.nodeid.partition("::")[0], len(LONGEST)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """One a core that this process may use: each more imports and draws the same once more."""
    from joblib import cpu_count

    return cpu_count()


def pytest_collection_finish():
    """What is imported and collected stays: looking through it again and again takes long."""
    gc.freeze()
    gc.set_threshold(100_000, 50, 1_000)
    gc.enable()


def pytest_unconfigure():
    """pytest looks five times for garbage that says something when it goes: once is enough."""
    gc.collect()
    gc.freeze()
