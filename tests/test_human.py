"""Models beside people: measures of planted paths and postures, verdicts, a small suite."""

import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError
from scipy import stats

from coartic.analysis.report.contents import TABLES
from coartic.analysis.topics.human import judge, measures
from coartic.analysis.topics.human.judge import (
    AGREES,
    DISAGREES,
    FINDINGS,
    NO_CASES,
    NOT_BEYOND,
    SILENT,
    UNDECIDED,
    Finding,
    bootstrapped,
    judged,
    separating,
    verdict_of,
    verdict_of_test,
)
from coartic.analysis.topics.human.measures import MODELS, Values
from tests.support.suites import run_and_write, suite_of

ABOVE, BETWEEN, RATIO = (
    FINDINGS[name] for name in ("first-slower", "few-are-enough", "stop-separates")
)


@pytest.mark.parametrize(
    ("finding", "ends", "tasks", "verdict"),
    [
        (ABOVE, [(1.5, 9)], 10, AGREES),
        (ABOVE, [(0.5, 9)], 10, UNDECIDED),
        (ABOVE, [(-2, 0.5)], 10, DISAGREES),
        (ABOVE, [(1, 9)], 10, UNDECIDED),  # may be at the bound, which is not above it
        (ABOVE, [(1.5, 9)], 9, UNDECIDED),
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


def values_of(numbers):
    """One number a task, and their mean."""
    by_task = {f"t{k}": np.array([[float(number)]]) for k, number in enumerate(numbers)}
    return Values(by_task, lambda rows: float(rows.mean()))


def test_an_interval_covers_as_often_as_it_says(monkeypatch):
    """Means of 15 tasks: about 95 of 100 intervals hold the truth, 0; a few less with so few."""
    monkeypatch.setattr(judge, "RESAMPLES", 499)
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(300):
        _, low, high = bootstrapped(values_of(rng.standard_normal(15)), 0.05)
        held += low <= 0 <= high
    assert 0.88 <= held / 300 <= 0.985


def test_a_difference_is_paired_by_task():
    """Tasks differ by tens, the sides by 1: only pairs can see it. A task of one side is out."""
    rng = np.random.default_rng(6)
    tasks = 20 * rng.standard_normal(21)
    tasks[20] = 1e6
    ours = values_of(tasks + 1 + 0.1 * rng.standard_normal(21))
    theirs = values_of(tasks[:20])
    value, low, high = bootstrapped(ours, 0.05, beside=theirs)
    assert 0.9 < low < value < high < 1.1


def planted(monkeypatch, **by_model):
    """A study in which every measure finds of each model what is planted, and else nothing."""
    models = {id(MODELS[name.replace("_", " ")]): numbers for name, numbers in by_model.items()}
    monkeypatch.setattr(
        judge,
        "MEASURES",
        dict.fromkeys(measures.MEASURES, lambda _, model: values_of(models.get(id(model), []))),
    )
    monkeypatch.setattr(judge, "RESAMPLES", 499)
    return SimpleNamespace(suite="human", _computed={})


def verdict_on_two_ahead(study, model):
    rows = judged(study).set_index(["finding", "model"])
    return tuple(rows.loc[("two-ahead", model), ["verdict", "because"]])


def test_what_is_picked_from_trials_agrees_only_beyond_random_guesses(monkeypatch):
    noise = 0.02 * np.random.default_rng(7).standard_normal((3, 12))
    shows = 0.5 + noise[0]
    study = planted(monkeypatch, learner=shows, two_goals_ahead=shows, random_guesses=noise[1])
    assert verdict_on_two_ahead(study, "learner") == (AGREES, "")
    study = planted(
        monkeypatch, learner=shows, two_goals_ahead=shows, random_guesses=0.5 + noise[2]
    )
    assert verdict_on_two_ahead(study, "learner") == (UNDECIDED, NOT_BEYOND)
    assert verdict_on_two_ahead(study, "two goals ahead") == (AGREES, "")  # no trials to pick from
    study = planted(monkeypatch, learner=shows, random_guesses=noise[1][:9])
    assert verdict_on_two_ahead(study, "learner") == (UNDECIDED, NOT_BEYOND)  # nine tasks of both
    study = planted(monkeypatch, learner=noise[0] - 0.5, random_guesses=noise[1])
    assert verdict_on_two_ahead(study, "learner") == (DISAGREES, "")


def test_where_the_learner_could_differ_from_planners(monkeypatch):
    verdicts = {
        "differs": {"learner": DISAGREES, "one goal ahead": AGREES, "least jerk": AGREES},
        "alike": {"learner": AGREES, "one goal ahead": AGREES, "no goal ahead": DISAGREES},
        "split": {"learner": AGREES, "one goal ahead": AGREES, "least jerk": DISAGREES},
        "undecided": {"learner": UNDECIDED, "one goal ahead": AGREES},
        "alone": {"learner": DISAGREES, "one goal ahead": SILENT, "least jerk": UNDECIDED},
    }
    rows = [
        (finding, model, of_model.get(model, NO_CASES))
        for finding, of_model in verdicts.items()
        for model in MODELS
    ]
    frame = pd.DataFrame(rows, columns=["finding", "model", "verdict"])
    monkeypatch.setattr(judge, "judged", lambda study: frame)
    found = separating(None)
    assert found["possible"] == ["differs", "alike", "split"]
    assert found["apart"] == ["differs"]
    assert found["look_ahead"] == ["alike"]


def test_a_finding_can_be_cited():
    fields = FINDINGS["two-ahead"].model_dump()
    for wrong in ({"doi": ""}, {"doi": "from memory"}, {"authors": ""}, {"year": None}):
        with pytest.raises(ValidationError):
            Finding.model_validate(fields | wrong)


def test_every_measure_serves_a_finding():
    used = {test.measure for finding in FINDINGS.values() for test in finding.tests}
    assert used == set(measures.MEASURES)


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


def test_bow_of_paths_with_one_corner():
    """Ways of 2 with a corner 0.5 to the side: the mean distance from the chord is half of it."""
    run = walk((-2, 0), (-1, 0), (0, 0), (1, 0.5), (2, 0), (2, 1), (2, 2))
    ((bow, to_next, from_last),) = measures.bows(run)
    assert bow == pytest.approx(0.25, abs=0.01)  # left of the way is positive
    assert to_next == pytest.approx(math.pi / 2)
    assert from_last == pytest.approx(0)


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
    monkeypatch.setattr("coartic.analysis.topics.human.judge.FEWEST_TASKS", 2)
    for model in ("learner", "learner, replayed"):
        monkeypatch.setitem(MODELS[model].parameters, "trials", 150)
    rows = judged(small).set_index(["finding", "model", "measure"])
    near = rows.xs("slope norm at distance 1", level="measure").loc["both-directions"]
    far = rows.xs("slope norm at distance 2", level="measure").loc["two-ahead"]
    # What is planned for one goal at a time does not follow the next; one ahead, not the third.
    for model in ("corrective process", "no goal ahead", "null-space control, this goal"):
        assert near.value[model] == pytest.approx(0, abs=1e-9)
    assert near.value["one goal ahead"] > 0.01
    # Runs of the best trial and of the replay are not the same.
    assert near.tasks["learner"] == near.tasks["learner, replayed"] == 2
    assert near.value["learner"] != near.value["learner, replayed"]
    assert far.value["one goal ahead"] == pytest.approx(0, abs=1e-9)
    assert far.built_in["one goal ahead"]
    assert far.verdict["one goal ahead"] == DISAGREES
    assert far.verdict["learner EC2"] == SILENT
    assert far.because["learner EC2"]
    table = TABLES["human"](small)
    assert table["of one goal ahead"]["two-ahead"].startswith("disagrees *: 0.00")
    assert set(table.run_ids["two-ahead"].split()) <= set(small.runs.run_id)
