"""Two results folders beside each other: on runs of our own and on planted differences."""

from dataclasses import replace

import numpy as np
import pytest

from coartic import CoarticError, load_task
from coartic.analysis.folders import compared_cells, differences, load_pair
from coartic.benchmarks.suites import Cell
from tests.support.commands import call
from tests.support.suites import KNOWN, run_and_write

LEARNED, ALONE = "dual-process/EC1", "corrective-alone/given"
CELLS = [Cell(load_task("ascending"), KNOWN[name]) for name in (LEARNED, ALONE)]


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    return run_and_write(tmp_path_factory.mktemp("first"), CELLS, runs=6, trials=40)


def shifted(study, by):
    """The same runs with other rewards of the learner."""
    runs = study.runs.copy()
    of_learner = runs.method == LEARNED
    runs.loc[of_learner, "reward"] += np.array(by)
    runs.loc[of_learner, "result"] += "-other"
    return replace(study, runs=runs)


def of_learner(first, second):
    frame = compared_cells(first, second).set_index("method")
    assert frame.verdict[ALONE] == "identical"
    return frame.loc[LEARNED]


def test_the_same_runs_are_identical(first, tmp_path):
    again = run_and_write(tmp_path, CELLS, runs=6, trials=40)
    row = of_learner(first, again)
    assert (row.verdict, row.identical, row.shared, row.difference) == ("identical", 6, 6, 0)
    assert differences(first, again).empty


def test_other_seeds_and_trials_are_named(first, tmp_path):
    other = run_and_write(tmp_path, CELLS, runs=6, trials=30, seed=3)
    named = differences(first, other).set_index("what")
    assert tuple(named.loc["seed"]) == ("0", "3")
    assert tuple(named.loc["trials"]) == ("40", "30")
    assert of_learner(first, other).shared == 0


@pytest.mark.parametrize(
    ("by", "verdict"),
    [
        ([0, 1, 0, -1, 0, 0], "equivalent"),
        ([30, 31, 30, 29, 30, 30], "different"),
        ([30, -28, 9, -30, 28, 3], "undecided"),
    ],
)
def test_planted_differences_get_their_verdict(first, by, verdict):
    row = of_learner(first, shifted(first, by))
    assert row.verdict == verdict
    assert row.difference == pytest.approx(np.mean(by))
    assert row.difference_low <= row.difference <= row.difference_high


def test_the_command_prints_what_differs(first, tmp_path, monkeypatch, capsys):
    run_and_write(tmp_path / "b", CELLS, runs=6, trials=40, seed=1)
    table = tmp_path / "cells.csv"
    folders = (first.folder, tmp_path / "b")
    code, text, _ = call(monkeypatch, capsys, "compare", *folders, "--out", table)
    assert code == 0
    assert "seed" in text
    assert "2 cells in both" in text
    assert len(table.read_text().splitlines()) == 3
    with pytest.raises(CoarticError, match="same folder"):
        load_pair(tmp_path / "b", tmp_path / "b")
