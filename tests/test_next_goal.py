"""The report's first figure, in which a goal moves: its runs."""

import pandas as pd
import pytest

from coartic import CoarticError
from coartic.analysis.report import next_goal
from coartic.analysis.study import load
from coartic.benchmarks.run import perform, plan_suite
from coartic.benchmarks.suites import load_suite, select_cells
from tests.support.suites import KNOWN, InProcess


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    """Both ends of the way of each goal in the figure, from suite ``locus``: the first runs."""
    cells = select_cells(load_suite("locus"), KNOWN, methods=list(next_goal.METHODS))
    ends = [f".goal{goal}_0_{by}" for goal in next_goal.MOVED for by in ("-1.5", "1")]
    cells = [cell for cell in cells if cell.task.name.endswith(tuple(ends))]
    plan = plan_suite("locus", cells=cells, runs=1, trials=10_000)
    folder = tmp_path_factory.mktemp("locus")
    perform(plan, folder, executor=InProcess())
    return load(folder)


def test_the_stored_postures_are_those_of_the_suite(moved):
    ours, stored = next_goal.locus_postures(moved), pd.read_csv(next_goal.STORED)
    place = ["moved", "x", "y", "method"]
    kept = stored.groupby(place).head(1).merge(ours[place])  # each cell's first run
    pd.testing.assert_frame_equal(
        ours.drop(columns=["run_id", "version"]).sort_values(place, ignore_index=True),
        kept.drop(columns=["run_id", "version"]).sort_values(place, ignore_index=True),
        rtol=0,
        atol=1e-4,
    )
    assert stored.run_id.is_unique


def test_a_folder_shows_its_own_runs_or_else_the_stored_ones(moved, traced):
    assert "4 runs of learner EC1" in next_goal.next_goal(moved)
    assert "240 runs of learner EC1" in next_goal.next_goal(traced) == next_goal.next_goal()
    with pytest.raises(CoarticError, match="goals moved"):
        next_goal.store(traced)
