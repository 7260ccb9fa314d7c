"""Which code the results of a method come from."""

import importlib
import inspect
from pathlib import Path

import pytest

from coartic.benchmarks.code_identity import code_of, files_of
from coartic.benchmarks.registry import MODULES
from coartic.motion.sources import PACKAGE

FILES = {name.split(".")[-1]: Path(inspect.getfile(importlib.import_module(name)))
         for name in MODULES}  # fmt: skip
LEARNER, PLANNERS = "method", {"trajectory_optimisation", "receding_horizon", "optimum"}
WITH_TRIALS = {LEARNER, "random_search", "cma_es"}
"""Methods that take the number of trials from the learner."""


def codes():
    return {name: code_of(file) for name, file in FILES.items()}


@pytest.fixture(scope="module")
def before():
    return codes()


@pytest.fixture
def after(before, monkeypatch):
    """The methods whose code is another after a change in a file of the package."""

    def change(place, old, new):
        read, changed = Path.read_bytes, (PACKAGE / place).resolve()
        assert old in read(changed)
        with monkeypatch.context() as patch:
            patch.setattr(
                Path,
                "read_bytes",
                lambda path: (
                    read(path).replace(old, new) if path.resolve() == changed else read(path)
                ),
            )
            return {name for name, code in codes().items() if code != before[name]}

    return change


def test_what_plans_stores_reads_and_shows_runs_does_not_count():
    """No sentence of these makes results those of other code."""
    for file in FILES.values():
        rooms = {path.relative_to(PACKAGE).parts[0] for path in files_of(file)}
        assert not rooms & {"__init__.py", "analysis", "benchmarks", "cli", "play", "runs"}
        assert not rooms & {"drawing.py", "film.py", "gym.py"}


@pytest.mark.parametrize(
    ("place", "methods"),
    [
        ("__init__.py", set()),
        ("baselines/evolution.py", {"cma_es"}),
        ("baselines/trajectory_problem.py", PLANNERS),
        ("learner/kernel.py", WITH_TRIALS),
        ("motion/reach.py", {*FILES}),
        ("robot.py", {*FILES}),
        ("benchmarks/worker.py", {*FILES}),
    ],
)
def test_a_number_counts_where_it_is_executed(after, place, methods):
    line = b"from __future__ import annotations\n" if "__init__" not in place else b"import "
    assert after(place, line, b"STEP = 3\n" + line) == methods


def test_words_for_readers_and_type_checkers_do_not_count(after):
    assert not after("motion/reach.py", b"Nothing is checked.", b"No check is made.")
    type_checking, imports = b"if TYPE_CHECKING:\n", b"if TYPE_CHECKING:\n    import this\n"
    assert not after("learner/conditions.py", type_checking, imports)


def test_names_of_the_package_count_where_they_are_at_home(tmp_path):
    (tmp_path / "mine.py").write_text("import coartic\n\nprint(coartic.learn('ascending', 'EC1'))")
    assert PACKAGE / "learner" / "kernel.py" in files_of(tmp_path / "mine.py")
    (tmp_path / "mine.py").write_text("from coartic import load_task")
    assert PACKAGE / "learner" / "kernel.py" not in files_of(tmp_path / "mine.py")
