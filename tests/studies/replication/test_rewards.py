"""Rewards, spreads and solutions against planted runs and known tests."""

import math

import numpy as np
import pytest
from scipy import stats

from coartic import corrective_trial, initial_hands, load_task
from coartic.analysis.study import solved
from coartic.estimates import Estimate
from tests.support.made_up import runs_of, study_of
from tests.support.processes import programs

REWARDS, STUDY = programs("replication", "rewards", "study")


def test_solutions_are_of_the_run_with_the_median_reward(study, tables):
    data = tables["solutions"]
    ticks = -data.groupby(["task", "condition"], sort=False).reward.sum()
    for (name, condition), of_run in ticks.items():
        if condition == "initial":
            assert of_run == corrective_trial(name, initial_hands(name)).ticks
        else:
            rewards = solved(study.cells[name, f"dual-process/{condition}"]).reward.astype(float)
            assert -of_run in rewards.to_list()
            assert (rewards < -of_run).sum() <= len(rewards) / 2 >= (rewards > -of_run).sum()
    for hit in data.to_dict("records"):
        task = load_task(hit["task"])
        q = [hit[joint] for joint in task.robot.joint_names]
        hand = task.robot.forward_kinematics(q, {"L": "left", "R": "right"}[hit["hand"]])
        assert np.hypot(*(hand - task.goals[hit["goal"] - 1])) <= task.radius


def test_published_differences():
    planted = runs_of("two-armed-1", "dual-process/EC2", [-610, -606, -500], trials=10_000,
                      hands=["RRRR", "RRRR", "LRLR"], initial_reward=-671)  # fmt: skip
    rewards = REWARDS.compare_rewards(study_of(planted))
    data = rewards.set_index("hands")
    assert data.difference[""] == pytest.approx(-572 - (11 * -520 + 9 * -609) / 20)
    assert data.verdict[""] == "undecided"  # also of a mean over sequences
    assert data.difference["RRRR"] == pytest.approx(1.0)
    assert (data.ours["RRRR"], data.ours_sd["RRRR"]) == pytest.approx((-608, math.sqrt(8)))
    assert data.run_ids["LRLR"] == planted[2]["run_id"]
    assert np.isnan(data.difference["RRLR"])
    assert data.runs.to_dict() == {"": 3, "RRLR": 0, "RRRR": 2, "LRLR": 1}


def test_the_page_of_a_folder_has_verdicts_evidence_and_what_is_missing(tables, tmp_path):
    few = tables["solutions"].query("task == 'ascending'")  # each run has panels of its own
    for name, table in (tables | {"solutions": few}).items():
        table.to_csv(tmp_path / f"{name}.csv")
    STUDY.write(tmp_path)
    page = (tmp_path / "page.html").read_text("utf-8")
    assert "Not judged, for lack of runs: " in page
    assert page.count("<p>Test: ") == (tables["claims"].suite != "").sum() > 0
    assert (tmp_path / "solutions.svg").read_bytes().count(b"<path") > 20


def test_spreads_against_normal_samples():
    """Of normal values the SD of n runs has a chi-square distribution."""
    values = np.random.default_rng(1).normal(0, 3, 4000)
    for runs, published in ((20, 2.0), (9, 4.2)):
        below = stats.chi2.cdf((runs - 1) * (published / values.std(ddof=1)) ** 2, runs - 1)
        due = 2 * min(below, 1 - below)
        assert REWARDS.spread_p(values, published, runs) == pytest.approx(due, abs=0.03)
        of_mean = REWARDS.spread_p(values, published / np.sqrt(runs), runs, of_mean=True)
        assert of_mean == pytest.approx(due, abs=0.03)
    assert REWARDS.spread_p(values, 0.5, 20) < 0.001
    assert np.isnan(REWARDS.spread_p(values[:9], 3.0, 20))


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (-5.0, 5.0, "equivalent"),
        (-5.1, 5.0, "undecided"),
        (5.0, 9.0, "undecided"),  # it may be at the margin
        (5.1, 9.0, "different"),
        (-9.0, -5.1, "different"),
        (math.nan, math.nan, "undecided"),
    ],
)
def test_verdicts(low, high, expected):
    assert REWARDS.equivalence(Estimate(0.0, low, high), 5.0) == expected


def test_interval_is_welchs_and_against_an_exact_value_students():
    rng = np.random.default_rng(15)
    ours, theirs = rng.normal(-503, 5, 20), rng.normal(-502, 3, 15)

    def ends(sd, runs):
        difference = REWARDS.difference_to_published(ours, theirs.mean(), sd, runs)
        return difference.low, difference.high

    welchs = stats.ttest_ind(ours, theirs, equal_var=False).confidence_interval(0.95)
    assert ends(theirs.std(ddof=1), 15) == pytest.approx((welchs.low, welchs.high))
    students = stats.ttest_1samp(ours - theirs.mean(), 0.0).confidence_interval(0.95)
    assert ends(None, 20) == ends(3.0, 1) == pytest.approx((students.low, students.high))
    assert REWARDS.difference_to_published(ours, 0.0, 1.0, 15).n == (20, 15)
    assert math.isnan(REWARDS.difference_to_published([1.0], 2.0, 1.0, 3).low)
    point = REWARDS.difference_to_published(np.ones(5), 3.0, 0.0, 5)
    assert (point.low, point.high) == (-2.0, -2.0)
