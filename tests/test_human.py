"""Models beside people: measures of planted paths and postures, verdicts, a small suite."""

import json
import math
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from coartic import corrective_trial, load_task
from coartic.analysis.report.contents import TABLES
from coartic.analysis.statistics.estimates import Estimate
from coartic.analysis.topics.human import findings, measures
from coartic.analysis.topics.human.findings import FINDINGS, bootstrap
from coartic.analysis.topics.human.measures import MEASURES, MODELS, Model, mean_of_rows
from coartic.runs.plan import label_of
from tests.support.made_up import MadeUp, made, row, study_of
from tests.support.strategies import tiny_task
from tests.support.suites import run_and_write, suite_of

ABOVE = [{"above": 1}]
BETWEEN = [{"above": 1}, {"below": 3, "disagree": 4}]
RATIO = [{"below": 1, "disagree": 0.9}]


@pytest.mark.parametrize(
    ("tests", "ends", "tasks", "verdict"),
    [
        (ABOVE, [(1.5, 9)], 10, "agrees"),
        (ABOVE, [(0.5, 9)], 10, "undecided"),
        (ABOVE, [(-2, 0.5)], 10, "disagrees"),
        (ABOVE, [(1, 9)], 10, "undecided"),  # may be at the bound, which is not above it
        (ABOVE, [(1.5, 9)], 9, "undecided"),
        (BETWEEN, [(1.2, 2.5)] * 2, 10, "agrees"),
        (BETWEEN, [(1.2, 3.5)] * 2, 10, "undecided"),  # above 3, and not yet above 4
        (BETWEEN, [(4.2, 4.5)] * 2, 10, "disagrees"),
        (BETWEEN, [(0.2, 0.5)] * 2, 10, "disagrees"),
        (RATIO, [(0.5, 0.8)], 10, "agrees"),
        (RATIO, [(0.92, 0.98)], 10, "undecided"),  # less than 1, but within a tenth of it
        (RATIO, [(0.95, 1.2)], 10, "disagrees"),
        (RATIO, [(0.85, 1.2)], 10, "undecided"),
    ],
)
def test_verdicts(tests, ends, tasks, verdict):
    of_tests = [
        findings.verdict_of_test(Estimate(math.nan, *end, n=(tasks,)), **bounds)
        for bounds, end in zip(tests, ends, strict=True)
    ]
    assert findings.verdict_of(of_tests) == verdict
    assert findings.verdict_of_test(Estimate(math.nan), **tests[0]) == "no cases"


@pytest.mark.parametrize(
    ("of_tests", "verdict"),
    [
        (["no cases", "disagrees"], "disagrees"),
        (["agrees", "disagrees"], "disagrees"),
        (["agrees", "no cases"], "no cases"),
        (["agrees", "undecided"], "undecided"),
    ],
)
def test_one_test_on_the_wrong_side_disagrees(of_tests, verdict):
    assert findings.verdict_of(of_tests) == verdict


def by_task(numbers):
    """One number a task."""
    return {f"t{k}": float(number) for k, number in enumerate(numbers)}


def test_an_interval_covers_as_often_as_it_says():
    """Means of 15 tasks: about 95 of 100 intervals hold the truth, 0; a few less with so few."""
    rng = np.random.default_rng(5)
    seen = [
        bootstrap(by_task(rng.standard_normal(15)), mean_of_rows, 0.05, resamples=499)
        for _ in range(300)
    ]
    assert 0.88 <= np.mean([each.low <= 0 <= each.high for each in seen]) <= 0.985


def test_a_difference_is_paired_by_task():
    """Tasks differ by tens, the sides by 1: only pairs can see it. A task of one side is out."""
    rng = np.random.default_rng(6)
    tasks = 20 * rng.standard_normal(21)
    tasks[20] = 1e6
    ours = by_task(tasks + 1 + 0.1 * rng.standard_normal(21))
    seen = bootstrap(ours, mean_of_rows, 0.05, by_task(tasks[:20]))
    assert 0.9 < seen.low < seen.value < seen.high < 1.1
    assert seen.n == (20,)
    assert math.isnan(bootstrap(by_task([1]), mean_of_rows, 0.05).low)


@pytest.mark.parametrize(
    ("learner", "guesses", "expected"),
    [
        (0.5, 12 * [0.0], ("agrees", "")),
        (0.5, 12 * [0.5], ("undecided", findings.NOT_BEYOND)),
        (0.5, 9 * [0.0], ("undecided", findings.NOT_BEYOND)),  # nine tasks of both
        (-0.5, 12 * [0.0], ("disagrees", "")),
    ],
)
def test_models_picked_from_trials_agree_only_beyond_random_guesses(
    learner, guesses, expected, monkeypatch
):
    noise = 0.02 * np.random.default_rng(7).standard_normal((2, 12))
    planted = {
        "learner": learner + noise[0],
        "two goals ahead": 0.5 + noise[0],
        "random guesses": guesses + noise[1][: len(guesses)],
    }
    of_model = {id(MODELS[name]): by_task(numbers) for name, numbers in planted.items()}
    measure = "slope norm at distance 2", (lambda _, m: of_model.get(id(m), {}), mean_of_rows)
    monkeypatch.setitem(MEASURES, *measure)
    runs = pd.DataFrame([row("random-search/climbing", -300, task="ascending")])
    study = study_of(runs, [load_task("ascending")], suite="human")
    rows = findings.verdicts(study).set_index(["finding", "model"]).loc["two-ahead"]
    assert tuple(rows.loc["learner", ["verdict", "because"]]) == expected
    assert rows.verdict["two goals ahead"] == "agrees"  # no trials to pick from
    over = rows.over_guesses["learner"]
    assert over == pytest.approx(learner - guesses[0], abs=0.03)
    assert rows.over_guesses.isna().sum() == len(rows) - 1


def test_where_the_learner_could_differ_from_planners():
    verdicts = {
        "differs": {"learner": "disagrees", "one goal ahead": "agrees", "least jerk": "agrees"},
        "a-like": {"learner": "agrees", "one goal ahead": "agrees", "no goal ahead": "disagrees"},
        "split": {"learner": "agrees", "one goal ahead": "agrees", "least jerk": "disagrees"},
        "undecided": {"learner": "undecided", "one goal ahead": "agrees"},
        "alone": {"learner": "disagrees", "one goal ahead": "silent", "least jerk": "undecided"},
    }
    rows = [
        (finding, model, of_model.get(model, "no cases"))
        for finding, of_model in verdicts.items()
        for model in MODELS
    ]
    cells = pd.DataFrame(rows, columns=["finding", "model", "verdict"])
    possible, apart, look_ahead = findings.where_models_differ(cells)
    assert possible == ["differs", "a-like", "split"]
    assert apart == ["differs"]
    assert look_ahead == ["a-like"]


def test_findings_and_measures_are_of_one_another():
    tests = [test for finding in FINDINGS.values() for test in finding["tests"]]
    assert {test["measure"] for test in tests} == set(MEASURES)
    assert all(len(test.keys() & {"above", "below"}) == 1 for test in tests)
    for finding in FINDINGS.values():
        named = findings.by_model(finding.get("silent", {}) | finding.get("built_in", {}))
        assert named.keys() <= MODELS.keys()


def test_tau_is_kendalls():
    pairs = np.random.default_rng(2).integers(6, size=(14, 2)).astype(float)
    expected = stats.kendalltau(*pairs.T).statistic
    assert measures.kendalls_tau(pairs) == pytest.approx(expected)
    assert measures.kendalls_tau(np.column_stack([np.zeros(14), np.arange(14)])) == 0


def test_statistics_of_all_tasks():
    # Slope norms at distances 1 and 2 after practice and before.
    norms = np.array([[1.0, 0.5, 1.0, 0.2], [3.0, 1.5, 1.0, 0.4]])
    assert measures.horizon_rise(norms) == pytest.approx(0.7)
    assert measures.ratio_rise(norms) == pytest.approx(0.5 - 0.3)
    assert measures.ratio_of_means(norms[:, :2]) == pytest.approx(2.0)
    turns = np.random.default_rng(4).uniform(-2, 2, size=(2, 30))
    bow = 0.1 - 0.3 * turns[0] + 0.2 * turns[1]
    assert measures.slope_of_bows(np.column_stack([bow, *turns])) == pytest.approx(-0.3)


def test_horizon_that_is_enough():
    """Within 1 % of all goals in view, on tasks with six goals or more."""
    tasks = [load_task(name) for name in ("long/v1/i003", "one-armed/v1/i005")]
    assert [len(task.goals) for task in tasks] == [6, 5]
    rows = [
        row("receding-horizon", -ticks, task=task.name, variant=f"horizon={h}",
            parameters=json.dumps({"horizon": h}))
        for task in tasks
        for h, ticks in {0: 150, 1: 102, 2: 101, 3: 110, 99: 100}.items()
    ]  # fmt: skip
    study = study_of(pd.DataFrame(rows), tasks, suite="human")
    assert measures.sufficient_horizon(study, MODELS["all goals ahead"]) == {tasks[0].name: 2}
    assert measures.sufficient_horizon(study, MODELS["one goal ahead"]) == {}


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


def planted(*cells):
    """A study of runs by task, method and parameters."""
    rows, runs = [], {}
    for task, method, parameters, of_cell in cells:
        variant = ", ".join(f"{name}={value}" for name, value in parameters.items())
        asked = {"task": task.name, "variant": variant, "parameters": json.dumps(parameters)}
        rows.append(row(method, -100, **asked))
        runs[task.name, label_of(method, variant)] = SimpleNamespace(task=task, runs=of_cell)
    tasks = {task.name: task for task, *_ in cells}
    study = study_of(pd.DataFrame(rows), list(tasks.values()), suite="human")
    return MadeUp(study, trajectories=made(runs))


ALONE = load_task("ascending")


def moved_goal(by):
    first, second, third = ALONE.goals
    goals = first, (second[0], second[1] + by), third
    return ALONE.model_copy(update={"name": f"ascending.goal2_0_{by}", "goals": goals})


def test_turns_are_saved_against_the_corrective_process():
    """Turns of a quarter and an eighth, which one of two runs has too."""
    corners = walk((0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (3, 3), (4, 4))
    straight = walk(*((x, 0) for x in range(7)))
    study = planted(
        (ALONE, "corrective-alone/given", {}, (corners,)),
        (ALONE, "trajectory-optimisation/path-length", {}, (corners, straight)),
    )
    saved = measures.turn_saved(study, MODELS["shortest path"])
    assert saved == pytest.approx({"ascending": 3 * math.pi / 16})


def test_slopes_that_chance_turns_are_negative_and_what_preparing_saves():
    """Postures of two runs follow the next goal by 0.3 in opposite directions."""
    cells = [
        (moved_goal(by), "receding-horizon", {"horizon": 1}, tuple(
            SimpleNamespace(execution=SimpleNamespace(configurations=[np.array([slope * by])]))
            for slope in (0.3, -0.3)
        ))
        for by in (-1.0, 0.0, 1.0)
    ]  # fmt: skip
    alone = (ALONE, "receding-horizon", {"horizon": 0}, (SimpleNamespace(ticks=120),))
    study = planted(*cells, alone)
    model = MODELS["one goal ahead"]
    assert measures.slope_norms(study, model, 1) == {"ascending": -0.3}
    assert measures.norms_and_benefits(study, model) == {"ascending": [-0.3, 20.0]}


def test_paths_before_two_places_of_a_goal():
    """Stopping, paths to goal 1 lie 0.2 apart between the outer places; passing, twice that."""
    cells = [
        (moved_goal(by), "trajectory-optimisation/jerk", {"stop": stop},
         (walk((0, apart * by), (1, apart * by), (2, apart * by)),))
        for stop, apart in ((1, 0.1), (0, 0.2))
        for by in (-1.0, 0.0, 1.0)
    ]  # fmt: skip
    by_task = measures.apart_by_stop(planted(*cells), MODELS["least jerk"])
    assert by_task["ascending"] == pytest.approx([0.2, 0.4])


def test_the_first_movement_is_longer_than_alone():
    """Where the other hand hits goal 2: by 7 ticks and by 1."""
    task = load_task("two-armed-1")
    runs = [
        SimpleNamespace(
            task=task,
            hands=[{"L": "left", "R": "right"}[hand] for hand in hands],
            execution=SimpleNamespace(
                ticks_by_goal=lambda hands=hands, more=more: (
                    corrective_trial(task, hands[0] * 4).ticks_by_goal()[0] + more, 0, 0, 0
                )
            ),
        )
        for hands, more in (("RLRL", 7), ("LRLR", 1), ("RRLL", 99))
    ]  # fmt: skip
    study = planted((task, "receding-horizon", {"horizon": 1}, runs))
    assert measures.excess_of_first(study, MODELS["one goal ahead"]) == {"two-armed-1": 4.0}


@pytest.mark.parametrize(("hands", "repeats"), [("RRL", 1.0), ("LRL", 0.0)])
def test_near_ties(hands, repeats):
    """A body that is its own mirror image: goal 2 lies on its axis, goal 3 beside a hand."""
    start = {"base": [0.0, 0.0], "left": [math.pi - 0.5, 0, 0, 0], "right": [0.5, 0, 0, 0]}
    goals = [[3.0, 3.0], [0.0, 4.5], [4.0, 2.5]]
    task = tiny_task(goals=goals, initial_hands="RLR", start=start)
    ends = [task.robot.forward_kinematics(task.q0, hand) for hand in ("left", "right")]
    assert ends[0] == pytest.approx(ends[1] * [-1, 1])
    run = SimpleNamespace(
        task=task,
        hands=[{"L": "left", "R": "right"}[hand] for hand in hands],
        execution=SimpleNamespace(configurations=[task.q0] * 3),
    )
    ties = measures.near_ties(SimpleNamespace(task=task, runs=[run]))
    assert ties[0, 1:].tolist() == [True, False]
    of_30, of_29 = (
        measures.near_tie_repeats(
            planted((task, "receding-horizon", {"horizon": 1}, (run,) * count)),
            MODELS["one goal ahead"],
        )["tiny"]
        for count in (30, 29)
    )
    assert of_30.tolist() == [[repeats]] * 30
    assert np.isnan(of_29).all()  # fewer than thirty


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


def test_a_small_study(small):
    assert (small.runs.status == "ok").all()
    near, far = (
        {name: measures.slope_norms(small, model, distance) for name, model in MODELS.items()}
        for distance in (1, 2)
    )
    # What is planned for one goal at a time does not follow the next; one ahead, not the third.
    for model in ("corrective process alone", "no goal ahead", "null-space control, current goal"):
        assert list(near[model].values()) == pytest.approx([0, 0], abs=1e-9)
    assert np.mean(list(near["one goal ahead"].values())) > 0.01
    assert list(far["one goal ahead"].values()) == pytest.approx([0, 0], abs=1e-9)
    # Runs of the best trial and of the replay are not the same; these have 150 trials.
    assert not near["learner"]
    best, replay = (
        measures.slope_norms(small, Model("", {"trials": 150}, replayed), 1)
        for replayed in (False, True)
    )
    assert best.keys() == replay.keys() == near["no goal ahead"].keys()
    assert best != replay
    rows = TABLES["human-effects"](small)
    row = rows.loc["two-ahead one goal ahead slope norm at distance 2"]
    assert (row.tasks, row.of_test, row.bound) == (2, "undecided", "above 0.01")
    assert set(row.run_ids.split()) <= set(small.runs.run_id)
    silent = rows.loc["two-ahead learner EC2 slope norm at distance 2"]
    assert (silent.verdict, silent.tasks) == ("silent", 0)
    assert silent.because.startswith("they are for two arms")
    table = TABLES["human"](small)
    assert table["of one goal ahead"]["two-ahead"].startswith("undecided: 0.00")
    assert table["of no goal ahead"]["few-are-enough"] == "silent"
