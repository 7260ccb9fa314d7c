"""Resistance and aggression of goals: planted slopes, and a small suite."""

from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from coartic import load_task
from coartic.analysis.report import build
from coartic.analysis.report.contents import TABLES
from coartic.analysis.topics import resist
from tests.support.suites import run_and_write, suite_of

RNG = np.random.default_rng(54)


@pytest.mark.parametrize("law", ["yields", "imposes", "neither"])
def test_correlations_are_those_of_the_law(law):
    """A goal follows by how weak it is, and pulls by how strong; or pulls by how weak it is."""
    beyond = []
    for _ in range(200):
        strong, pull = RNG.lognormal(size=(2, 6))
        pull = {"imposes": strong, "yields": 1 / strong, "neither": pull}[law]
        weak = np.ones(6) if law == "neither" else 1 / strong
        sizes = weak[:, None] * pull * RNG.lognormal(0, 1 if law == "neither" else 0.1, (6, 6))
        sizes = RNG.lognormal(size=(6, 6)) if law == "neither" else sizes
        slopes = np.diagonal(sizes, -1), np.diagonal(sizes, 1)
        resistance, aggression = resist.resistance_and_aggression(*slopes)
        for number, goal in enumerate(range(1, 5)):
            around = [goal - 1, goal + 1]
            assert resistance[number] == pytest.approx(-np.mean(sizes[goal, around]))
            assert aggression[number] == pytest.approx(np.mean(sizes[around, goal]))
        rho = float(resist.correlations(*slopes))
        assert rho == pytest.approx(stats.spearmanr(resistance, aggression)[0])
        beyond.append(rho - resist.correlation_by_chance(*slopes))
    mean, error = np.mean(beyond), stats.sem(beyond)
    assert {"yields": mean < -0.3, "imposes": mean > 0.3, "neither": abs(mean) < 3 * error}[law]


def test_chance_is_above_zero():
    """A slope that is large by itself makes one goal weak and the other strong."""
    assert resist.correlation_by_chance(*RNG.lognormal(size=(2, 5))) > 0.1


def test_size_of_a_slope_is_that_of_the_regression():
    slope, places = RNG.normal(size=(2, 4, 3)), RNG.normal(size=(5, 2))
    postures = np.tensordot(places, slope, axes=1) + 7.0
    expected = np.linalg.norm(slope, axis=(0, 2))
    np.testing.assert_allclose(resist.slope_size(postures, places), expected)


def test_a_small_study(tmp_path):
    """The corrective process follows the goal before it, and never the next one."""
    blocks = [
        f"""tasks = ["neighbours/v1/d000", "neighbours/v1/d003"]
move = {{ goal = {goal}, by = [[0.25, 0], [-0.125, 0.217], [-0.125, -0.217]] }}
methods = ["corrective-alone/given", "dual-process/EC1"]
"""
        for goal in range(1, 7)
    ]
    study = run_and_write(tmp_path / "results", suite_of(tmp_path, *blocks), runs=2)
    table = TABLES["resist"](study)
    alone = table.loc["all corrective-alone/given"]
    assert alone.tasks == 2
    assert alone.ahead < 1e-9 < 0.1 < alone.carried < 10
    assert table.ahead["all dual-process/EC1"] > 0.01
    assert alone.beyond == pytest.approx(alone.rho - alone.chance)
    assert set(table.group) == {"all", "4 links", "base locked"}
    values = resist.resist_values(study)
    assert list(values.chance) == list(resist.resist_values(study).chance)
    (first,) = values[(values.task == "neighbours/v1/d000") & (values.label.str[0] == "c")].carried
    before = []
    for goal, after in pairwise(range(6)):
        places, hits = [], []
        for name in study.tasks:
            if name.startswith(f"neighbours/v1/d000.goal{goal + 1}_"):
                places.append(study.tasks[name].goals[goal])
                hits.append(study.trajectories(name, "corrective-alone/given").runs[0])
        postures = np.array([run.execution.configurations[after] for run in hits])
        design = np.column_stack([np.ones(3), places])
        before.append(np.linalg.norm(np.linalg.lstsq(design, postures, rcond=None)[0][1:]))
    assert first == pytest.approx(np.mean(before))
    assert build.draw_figure(study, "resist")
    assert len(load_task("neighbours/v1/d000").goals) == 6
