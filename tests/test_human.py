"""Models beside people: measures of planted paths and postures, verdicts, a small suite."""

import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from coartic.analysis import tables
from coartic.analysis.human import judge, measures
from coartic.analysis.human.judge import (
    AGREES,
    DISAGREES,
    FINDINGS,
    NO_CASES,
    SILENT,
    UNDECIDED,
    bootstrapped,
    judged,
    verdict_of,
    verdict_of_test,
)
from coartic.analysis.human.measures import MODELS, Values
from tests.support.suites import run_and_write, suite_of

ABOVE, BETWEEN, RATIO = (
    FINDINGS[name] for name in ("other-hand-early", "few-are-enough", "stop-separates")
)


@pytest.mark.parametrize(
    ("finding", "ends", "tasks", "verdict"),
    [
        (ABOVE, [(0.06, 0.2)], 10, AGREES),
        (ABOVE, [(0.04, 0.2)], 10, UNDECIDED),
        (ABOVE, [(-0.02, 0.04)], 10, DISAGREES),
        (ABOVE, [(0.05, 0.2)], 10, UNDECIDED),  # may be at the bound, which is not above it
        (ABOVE, [(0.06, 0.2)], 9, UNDECIDED),
        (ABOVE, [(math.nan, math.nan)], 0, NO_CASES),
        (BETWEEN, [(1.2, 2.5)] * 2, 10, AGREES),
        (BETWEEN, [(1.2, 3.5)] * 2, 10, UNDECIDED),  # above 3, and not yet above 4
        (BETWEEN, [(4.2, 4.5)] * 2, 10, DISAGREES),
        (BETWEEN, [(0.2, 0.5)] * 2, 10, DISAGREES),
        (RATIO, [(0.5, 0.8)], 10, AGREES),
        (RATIO, [(0.92, 0.98)], 10, UNDECIDED),  # less than 1, but within a tenth of it
        (RATIO, [(0.95, 1.2)], 10, DISAGREES),
        (RATIO, [(0.85, 1.2)], 10, UNDECIDED),
    ],
)
def test_verdicts(finding, ends, tasks, verdict):
    of_tests = [
        verdict_of_test(test, (math.nan, *end), tasks)
        for test, end in zip(finding.tests, ends, strict=True)
    ]
    assert verdict_of(of_tests) == verdict


def test_a_test_without_cases_does_not_hide_one_on_the_wrong_side():
    assert verdict_of([NO_CASES, DISAGREES]) == verdict_of([AGREES, DISAGREES]) == DISAGREES
    assert verdict_of([NO_CASES, AGREES]) == NO_CASES


def test_an_interval_covers_as_often_as_it_says(monkeypatch):
    """Means of 15 tasks: about 95 of 100 intervals hold the truth, 0; a few less with so few."""
    monkeypatch.setattr(judge, "RESAMPLES", 499)
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(300):
        tasks = [np.array([[value]]) for value in rng.standard_normal(15)]
        _, low, high = bootstrapped(Values(tasks, lambda rows: float(rows.mean())), 0.05)
        held += low <= 0 <= high
    assert 0.88 <= held / 300 <= 0.985


def test_rank_correlation_is_kendalls():
    pairs = np.random.default_rng(2).integers(6, size=(14, 2)).astype(float)
    expected = stats.kendalltau(*pairs.T).statistic
    assert measures.rank_correlation(pairs) == pytest.approx(expected)
    assert measures.rank_correlation(np.column_stack([np.zeros(14), np.arange(14)])) == 0


def moving(slopes, noise, rng, runs=4):
    """Runs in which the posture at goal 1 follows the place of goal 2, with noise."""
    group = []
    for place in (-1.0, -0.5, 0.0, 0.5, 1.0):
        solved = tuple(
            SimpleNamespace(
                execution=SimpleNamespace(
                    configurations=[np.array(slopes) * place + noise * rng.standard_normal(3)]
                )
            )
            for _ in range(runs)
        )
        task = SimpleNamespace(goals=[(0.0, 0.0), (3.0, 2.0 + place)])
        group.append(SimpleNamespace(runs=solved, task=task))
    return group


@pytest.mark.parametrize("slopes", [(0.0, 0.0, 0.0), (0.3, -0.4, 0.0)])
def test_slopes_are_those_that_were_planted_however_much_runs_differ(slopes):
    rng = np.random.default_rng(3)
    squares = [measures.squared_slopes(moving(slopes, 0.5, rng), 2, 1).sum() for _ in range(300)]
    error = np.std(squares) / math.sqrt(len(squares))
    assert np.mean(squares) == pytest.approx(np.dot(slopes, slopes), abs=3 * error)
    exact = measures.squared_slopes(moving(slopes, 0.0, rng, runs=1), 2, 1)
    assert exact == pytest.approx(np.square(slopes))


def walk(*points):
    """A run whose hand goes straight from point to point, of which every second is a goal."""
    path = np.vstack([np.linspace(a, b, 50, endpoint=False) for a, b in pairwise(points)])
    path = np.vstack([path, points[-1]])
    goals = points[2::2]
    robot = SimpleNamespace(forward_kinematics=lambda q, hand: np.asarray(q))
    task = SimpleNamespace(robot=robot, q0=points[0], goals=goals, goal_array=np.array(goals))
    return SimpleNamespace(
        task=task,
        hands=("right",) * len(goals),
        subtask=lambda goal: path[100 * (goal - 1) : 100 * goal + 1],
    )


def test_bow_and_excess_of_paths_with_one_corner():
    """Ways of 2 with a corner 0.5 to the side: the mean distance from the chord is half of it."""
    run = walk((-2, 0), (-1, 0), (0, 0), (1, 0.5), (2, 0), (2, 1), (2, 2))
    ((bow, to_next, from_last),) = measures.bows(run)
    assert bow == pytest.approx(0.25, abs=0.01)  # left of the way is positive
    assert to_next == pytest.approx(math.pi / 2)
    assert from_last == pytest.approx(0)
    lengths = 2 + 2 * math.hypot(1, 0.5) + 2
    assert measures.path_excess(run) == pytest.approx(lengths / 6 - 1)


def test_the_hand_turns_at_goals():
    run = walk((0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (3, 3), (4, 4))
    assert measures.turn_at_goals(run) == pytest.approx((math.pi / 2 + math.pi / 4) / 2)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The suite on two tasks, with little search."""
    folder = tmp_path_factory.mktemp("human")
    tasks = 'tasks = ["one-armed/v1/d009", "one-armed/v1/d010"]'
    methods = 'methods = ["corrective-alone/given", "dual-process/EC1", "nullspace-qp/none"]'
    planner = """methods = ["receding-horizon"]
parameters = { nodes = 40, graphs = 1, chains = 2 }
grid = { horizon = [0, 1, 7] }
"""
    moves = [
        f"{tasks}\nmove = {{ goal = {goal}, by = [[0, -0.3], [0, 0], [0, 0.3]] }}\n"
        for goal in (2, 3)
    ]
    blocks = [start + rest for start in (f"{tasks}\n", *moves) for rest in (methods, planner)]
    study = run_and_write(folder / "runs", suite_of(folder, *blocks), runs=2)
    object.__setattr__(study, "plan", replace(study.plan, suite="human"))
    return study


def test_a_small_study(small, monkeypatch):
    assert (small.runs.status == "ok").all()
    monkeypatch.setattr("coartic.analysis.human.judge.FEWEST_TASKS", 2)
    monkeypatch.setitem(MODELS["learner"].parameters, "trials", 150)
    rows = judged(small).set_index(["finding", "model", "measure"])
    near = rows.xs("slope norm at distance 1", level="measure").loc["both-directions"]
    far = rows.xs("slope norm at distance 2", level="measure").loc["two-ahead"]
    # What is planned for one goal at a time does not follow the next; one ahead, not the third.
    for model in ("corrective process", "no goal ahead", "null-space control, this goal"):
        assert near.value[model] == pytest.approx(0, abs=1e-9)
    assert near.value["one goal ahead"] > 0.01
    assert far.value["one goal ahead"] == pytest.approx(0, abs=1e-9)
    assert far.built_in["one goal ahead"]
    assert far.verdict["one goal ahead"] == DISAGREES
    assert far.verdict["learner EC2"] == SILENT
    assert far.because["learner EC2"]
    table = tables.TABLES["human"](small)
    assert table["of one goal ahead"]["two-ahead"].startswith("disagrees *: 0.00")
    assert set(table.run_ids["two-ahead"].split()) <= set(small.runs.run_id)
