"""Shared by all tests."""

import gc
import os
import signal

import pytest
from filelock import FileLock
from hypothesis import settings

import benchmarks.executors
import benchmarks.reproduce
from analysis import load
from tests.support import reports
from tests.support.suites import (
    InProcess,
    performed,
    run_and_write,
    traced_cells,
    with_environment,
)

# Continuous integration tries the same examples every time; people, new ones.
settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("people", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "people")

# Tests that interrupt themselves or others do so in the background as well.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture
def undrawn():
    """Reports without figures, which take long and have tests of their own."""
    with reports.undrawn():
        yield


@pytest.fixture
def in_this_process(monkeypatch):
    """Runs without processes of their own, which take long and have tests of their own."""
    monkeypatch.setattr(benchmarks.executors, "Local", InProcess)
    monkeypatch.setattr(benchmarks.reproduce, "supervise", performed)


@pytest.fixture(scope="session")
def traced(tmp_path_factory):
    """A results folder that nobody writes into: the paper's cells beside other methods."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:  # the first worker makes it for all
        shared = shared.parent
    folder = shared / "traced" / "results"
    with FileLock(shared / "traced.lock"):
        if not (shared / "traced.made").exists():
            run_and_write(folder, traced_cells(), runs=4, trials=150)
            with_environment(folder)
            (shared / "traced.made").touch()
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
    gc.freeze()  # what is imported stays: looking through it again and again takes long
