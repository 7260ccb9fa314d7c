"""The main tables of a made-up folder, with every cell worked out by hand.

With its best hands the corrective process alone has -319 and -532, from which targets go to -292
and -465: in 20 targets, 1.35 and 3.35 ticks apart. The learner's runs on ascending differ, all else
has no spread.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from coartic import CoarticError, corrective_trial
from coartic.analysis import FIGURES, TABLES, runtimes
from coartic.analysis.figures.drawings import learning_curves
from coartic.analysis.methods import BY_FORMULA, BY_TRIAL, LEARNERS, WITHOUT_REWARD
from coartic.analysis.report.player import player
from coartic.analysis.study import Study, solved
from tests.support.made_up import MadeUp, made_up_optima, row, runs_of, study_of

ONE, TWO = "ascending", "two-armed-1"
EC1, EC4, CMA = "dual-process/EC1", "dual-process/EC4", "cma-es/bandit"
PLAN, BOTH = "trajectory-optimisation/path-length", "learner"
NONE = math.nan


STEPS = {
    (ONE, EC1): ({1: -319, 100: -312, 500: -305, 1000: -300}, {1: -319, 101: -310, 1000: -301},
                 {1: -319, 20: -312, 50: -305, 1000: NONE}),
    (TWO, EC4): ({1: -675, 200: -570, 1000: -480},) * 3,
    (ONE, CMA): ({1: -319, 10: -293, 100: NONE},) * 2 + ({1: -319, 10: -293, 1000: NONE},),
    (TWO, CMA): ({1: -675, 10: -470, 100: NONE},) * 3,
}  # fmt: skip


@pytest.fixture(scope="module")
def study():
    """Runs whose trials are below all others but in those of ``STEPS``; each trial takes 1,000
    evaluations."""
    rows, rewards = [], {}
    for (task, method), runs in STEPS.items():
        for run, steps in enumerate(runs):
            of_trials = np.full(max(steps), -700.0)
            of_trials[np.array([*steps]) - 1] = [*steps.values()]
            more = {"trials": len(of_trials), "forward_kinematics": 1_000 * len(of_trials)}
            rows.append(row(method, int(np.nanmax(of_trials)), task=task, run=run, **more))
            rewards[rows[-1]["run_id"]] = of_trials
    rows += [
        row(PLAN, reward, task=task, information="kinematic model, reward as a formula", trials=0,
            forward_kinematics=500, movement_ticks=ticks)
        for task, reward, ticks in ((ONE, -296, 0), (TWO, -500, 100))
    ]  # fmt: skip
    return study_of(rows, optima=made_up_optima(ONE, TWO), rewards=lambda: iter(rewards.items()))


def same(table, names, cells):
    """These columns of the table are these, row by row, in this order."""
    frame = pd.DataFrame.from_dict(cells, orient="index", columns=names).rename_axis("row")
    pd.testing.assert_frame_equal(table[names], frame, check_dtype=False)


LEARNED = 10 / 292, 15 / 465
"""Gaps of the learner on both tasks."""


def test_ranking(study):
    table = TABLES["ranking"](study)
    cells = {
        name: (name, information, sum(gaps) / 2, *gaps, runs)
        for name, information, gaps, runs in (
            (CMA, BY_TRIAL, (1 / 292, 5 / 465), 6),
            (BOTH, BY_TRIAL, LEARNED, 6),
            (PLAN, BY_FORMULA, (4 / 292, 35 / 465), 2),
        )
    }
    names = ["method", "information", "gap", f"on {ONE}", f"on {TWO}", "runs"]
    same(table, names, cells)
    assert len(TABLES["not-ranked"](study)) == 0
    assert table.gap_low.isna().all()  # three runs, and one of the plan, are too few


def test_methods(study):
    names = ["runs", "solved", "reward", "reward_sd", "gap", "hands", "trials",
             "forward_kinematics"]  # fmt: skip
    sd = math.sqrt((2**2 + 1**2 + 3**2) / 2)
    cells = {
        f"{ONE} {CMA}": (3, 3, -293.0, 0.0, 1 / 292, "LRLR 3", 100, 1e5),
        f"{ONE} {PLAN}": (1, 1, -296.0, NONE, 4 / 292, "LRLR", 0, 500),
        f"{ONE} {EC1}": (3, 3, -302.0, sd, 10 / 292, "LRLR 3", 1000, 1e6),
        f"{TWO} {CMA}": (3, 3, -470.0, 0.0, 5 / 465, "LRLR 3", 100, 1e5),
        f"{TWO} {EC4}": (3, 3, -480.0, 0.0, 15 / 465, "LRLR 3", 1000, 1e6),
        f"{TWO} {PLAN}": (1, 1, -500.0, NONE, 35 / 465, "LRLR", 0, 500),
    }
    same(TABLES["methods"](study), names, cells)


def test_the_median_run_is_nearest_to_the_median():
    """-309, from which the mean, -324, is far."""
    rows = runs_of(ONE, EC1, [-400, -300, -309, -301, -310], run_id=[*"abcde"])
    table = TABLES["methods"](study_of(rows, optima=made_up_optima(ONE)))
    assert table.median_run.tolist() == ["c"]


def test_runtimes(study):
    """Within 20, 50, 100, 101, 500 and 1000 trials the learner has 5, 10, 15, 21, 26 and 82 of 120
    pairs: 45 of two-armed 1 at trial 1000.

    Three runs are too few for an interval.
    """
    names = ["reached", "trials_to_quarter", "trials_to_quarter_low", "trials_to_quarter_high",
             "trials_to_half", "trials_to_half_low", "trials_to_half_high",
             "forward_kinematics_to_half", "forward_kinematics_to_half_low",
             "forward_kinematics_to_half_high", "seconds_to_half", "seconds_to_half_low",
             f"half on {ONE}", f"half on {TWO}"]  # fmt: skip
    # The first run is cold: the time of the other two.
    cells = {
        BOTH: (41 / 60, 1e3, NONE, NONE, 1e3, NONE, NONE, 1e6, NONE, NONE, 0.25, NONE, 500, 1e3),
        CMA: (37 / 40, 10, NONE, NONE, 10, NONE, NONE, 1e4, NONE, NONE, 0.025, NONE, 10, 10),
        PLAN: (26 / 40, 0, NONE, NONE, 0, NONE, NONE, 500, NONE, NONE, 0.25, NONE, NONE, NONE),
    }
    table = TABLES["runtimes"](study)
    same(table.loc[list(cells)], names, cells)
    assert len(table) == 3


def test_running_times_of_chosen_targets(study):
    """-306 and -499 halfway, and -292 and -465, which no run of the learner reaches."""
    curves = runtimes(study, targets=[0.5, 1.0])
    assert {*curves.method} == {BOTH, CMA, PLAN}  # each condition ran on one of the two tasks
    for spend, each in (("trials", 1), ("forward_kinematics", 1_000)):
        curve = curves[(curves.method == BOTH) & (curves.spend == spend)]
        assert curve.budget.tolist() == [50 * each, 500 * each, 1_000 * each]
        assert curve.share.tolist() == pytest.approx([1 / 12, 2 / 12, 6 / 12])
    assert runtimes(study).equals(runtimes(study, targets=[n / 20 for n in range(1, 21)]))


def test_running_times_that_cannot_be_shown(study):
    for targets in ([], [0.0], [1.01]):
        with pytest.raises(CoarticError, match="must be numbers above 0 and up to 1"):
            runtimes(study, targets=targets)
    with pytest.raises(CoarticError, match="has no task whose best known reward is above"):
        runtimes(MadeUp(study, optima={}))


def test_learning(study):
    names = ["runs", "corrective_best", "after_100", "after_1000", "after_10000"]
    cells = {
        f"{ONE} {EC1}": (3, -319.0, -312.0, -302.0, NONE),
        f"{TWO} {EC4}": (3, -532.0, -675.0, -480.0, NONE),
        f"{ONE} {CMA}": (3, -319.0, -293.0, NONE, NONE),
        f"{TWO} {CMA}": (3, -532.0, -470.0, NONE, NONE),
    }
    same(TABLES["learning"](study), names, cells)
    curves = learning_curves(study)
    curve = curves[(curves.task == ONE) & (curves.method == EC1)].set_index("trial")
    # -305, -301 and -300 in the end; quartiles lie halfway to the inner one.
    ends = {1: [-319, -319, -319], 1000: [-302, -303, -300.5]}
    curve = curve[["best", "best_low", "best_high"]].iloc[[0, -1]]
    assert dict(zip(curve.index, curve.to_numpy().tolist(), strict=True)) == ends


def test_learning_is_shown_of_individual_tasks_and_of_no_search():
    instances = [f"one-armed/v1/i{number:03}" for number in range(9)]  # fewer are individual
    rows = [run for task in (ONE, *instances) for run in runs_of(task, EC1, [-300], trials=100)]
    rows += runs_of(ONE, "optimum/search", [-300], trials=100)
    rewards = {run["run_id"]: np.full(100, -300.0) for run in rows}
    study = study_of(rows, optima={}, rewards=lambda: iter(rewards.items()))
    assert [*TABLES["learning"](study).index] == [f"{ONE} {EC1}"]


def test_tasks(study):
    """The corrective process alone as the paper has it: -319; -675 initially and -532 at best."""
    table = TABLES["tasks"](study)
    columns = ["initial", "best_hands", "optimum", "source", "bound"]
    assert table.loc[ONE, columns].tolist() == [-319, -319, -292, "shipped", -292]
    assert table.loc[TWO, columns].tolist() == [-675, -532, -465, "shipped", -465]


def test_ticks_saved_are_those_of_the_movements_less_those_of_the_corrective_process(traced):
    table = TABLES["saved"](traced)
    assert len(table) > 5
    row = table.loc["ascending dual-process/EC1"]
    runs = solved(traced.cells["ascending", "dual-process/EC1"])
    solutions = traced.solutions.astype({"ticks": float})
    by_goal = solutions.pivot_table("ticks", "run_id", "goal", aggfunc="sum")
    reference = corrective_trial(traced.tasks["ascending"], runs.hands.iloc[0]).ticks_by_goal()
    expected = by_goal.loc[runs.run_id, [1, 2, 3]].mean() - np.array(reference)
    assert [row[f"by_goal_{goal}"] for goal in (1, 2, 3)] == pytest.approx([*expected])
    assert row["sum"] == pytest.approx(expected.sum())
    drawn = FIGURES["saved"](traced).data.set_index(["task", "method"])
    assert drawn.by_goal_1["ascending", "dual-process/EC1"] == row.by_goal_1
    learners = dict.fromkeys(LEARNERS, "learner")
    orders = [[learners.get(method, method) for _, method in of_task.index]
              for _, of_task in drawn.groupby("task", sort=False)]  # fmt: skip
    methods = [*dict.fromkeys(itertools.chain(*orders))]
    assert all(order == [method for method in methods if method in order] for order in orders)
    plans = traced.runs[traced.runs.label.map(traced.methods.information) == WITHOUT_REWARD]
    assert len(plans) > 0
    alone = Study(traced.folder, traced.plan, traced.made_with, plans)
    assert FIGURES["saved"](alone) is None


@pytest.mark.parametrize(("task", "learner"), [(ONE, EC1), (TWO, EC4)])
def test_the_film_begins_with_the_learner_for_the_arms_of_the_task(traced, task, learner):
    """As the page of `coartic play` does, also where another condition ran before it (EC3)."""
    alone = replace(traced, stored=traced.stored[traced.stored.task == task])
    assert f'"first":{{"who":"{learner}"}}' in player(alone)
