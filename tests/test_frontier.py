"""Reward against spend on constructed runs: curves, areas, targets, Pareto sets."""

import json
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import bootstrap

from coartic import load_task
from coartic.analysis.comparisons.anytime import anytime_curves
from coartic.analysis.comparisons.areas import areas
from coartic.analysis.comparisons.pareto import dominated, pareto_sets
from coartic.analysis.comparisons.progress import SPENDS, by_trial
from coartic.analysis.comparisons.targets import targets
from coartic.analysis.report.document import Estimate
from coartic.analysis.report.formats.markdown import markdown
from coartic.analysis.report.pages.frontier import (
    areas_table,
    frontier_document,
    pareto_table,
    targets_table,
)
from coartic.analysis.report.text import parts
from coartic.analysis.results.folder import Results
from coartic.analysis.study import Study
from coartic.tables import PlanLimits
from tests.support.made_up import MadeUp, made_up_optima, manifest_for, replanned
from tests.support.reports import shown
from tests.support.strategies import tiny_task

BEST = -465  # made-up optimum of two-armed 1; -490 with the other arm kept still
NAN = math.nan


def run(method, rewards=None, *, reward=None, number=0, **more):
    """A row of runs.parquet; ``rewards`` by trial, NaN where it failed."""
    learned = [] if rewards is None else rewards
    done = [value for value in learned if not math.isnan(value)]
    reward = max(done, default=None) if reward is None else reward
    return {
        "rewards": learned, "task": "two-armed-1", "method": method, "variant": "",
        "run": number, "run_id": f"{method}-{number}", "status": "ok" if reward else "infeasible",
        "reason": "", "reward": reward, "hands": "LRLR",
        "parameters": json.dumps({"trials": len(learned)} if learned else {}),
        "told": "corrective process, reward by trial", "trials": len(learned),
        "movement_ticks": -sum(done), "forward_kinematics": 100 * max(1, len(learned)),
        "jacobians": 10 * max(1, len(learned)), "solver_iterations": 0, "build_s": 0.0,
        "solve_s": 0.5, "wall_s": 1.0, "warm": True, "together": 1, "solution_corrections": 0,
        "other_arm_travel": 0.0, "proven_bound": None, **more,
    }  # fmt: skip


def study(rows, tmp_path):
    learning = pd.DataFrame(
        [
            {"run_id": row["run_id"], "trial": trial, "reward": reward}
            for row in rows
            for trial, reward in enumerate(row["rewards"])
        ],
        columns=["run_id", "trial", "reward"],
    ).astype({"reward": "Int32"})
    learning.to_parquet(tmp_path / "learning.parquet")
    counts = ("reward", "proven_bound", "trials", "movement_ticks", "forward_kinematics")
    runs = pd.DataFrame(rows).drop(columns="rewards").astype(dict.fromkeys(counts, "Int64"))
    task = load_task("two-armed-1")
    results = Results(tmp_path, manifest_for([task], runs), runs, pd.DataFrame())
    return MadeUp(results, optima=made_up_optima(task.name))


def of(frame, method, spend="trials", other_arm="free"):
    found = frame[(frame.method == method) & (frame.spend == spend)]
    return found[found.other_arm == other_arm] if "other_arm" in frame else found


def share(frame, method, spend, column="front_share"):
    return of(frame, method, spend)[column].item()


def totals(ticks, trials):
    return {
        "trials": trials, "movement_ticks": ticks, "forward_kinematics": 50.0, "solve_s": 1.0,
    }  # fmt: skip


# Progress


def test_steps_of_a_run_with_failed_trials():
    """The failed trials share the ticks that the others leave: (62 - 38) / 2 each."""
    found = by_trial(np.array([NAN, -10, NAN, -12, -8, -8]), totals(62.0, 6.0))
    assert found.rewards.tolist() == [-10, -8]
    assert found.spent["trials"].tolist() == [2, 5]
    assert found.spent["movement_ticks"].tolist() == [22, 54]
    assert found.spent["forward_kinematics"] == pytest.approx([50 * 2 / 6, 50 * 5 / 6])


trial_rewards = st.lists(st.one_of(st.just(NAN), st.integers(-30, -1)), min_size=1, max_size=30)


@given(trial_rewards)
def test_the_best_within_a_budget_is_that_of_the_trials_it_pays(rewards):
    """Failed trials took 7 ticks each, and every trial its share of 50 evaluations."""
    cost = [7 if math.isnan(r) else -r for r in rewards]
    found = by_trial(np.array(rewards, dtype=float), totals(float(sum(cost)), len(rewards)))
    for budget in range(len(rewards) + 1):
        best = max((r for r in rewards[:budget] if not math.isnan(r)), default=-math.inf)
        paid = {
            "trials": budget,
            "movement_ticks": sum(cost[:budget]),
            "forward_kinematics": 50 * budget / len(rewards),
        }
        for spend, amount in paid.items():
            assert found.best(spend, np.array([amount + 1e-6])) == best
    assert (np.diff(found.rewards) > 0).all()


# Anytime curves


def test_a_mean_waits_for_the_slowest_run(tmp_path):
    rows = [
        run("m", [-600.0, -500.0, -500.0, -480.0], number=0),
        run("m", [NAN, NAN, -520.0, -500.0], number=1),
    ]
    curve = of(anytime_curves(study(rows, tmp_path)), "m").set_index("budget")
    assert curve.index.tolist() == [1, 2, 3, 4]
    assert curve.solved.tolist() == [1, 1, 2, 2]
    assert curve["mean"].isna().tolist() == [True, True, False, False]
    assert curve.loc[[3, 4], "mean"].tolist() == [-510, -490]
    assert curve.loc[4, ["low", "high"]].tolist() == [-500, -480]
    assert curve["median"].isna().tolist() == [True, True, False, False]


def test_a_curve_ends_with_the_first_run_that_does(tmp_path):
    rows = [
        run("m", [-500.0] * 10, number=0),
        run("m", [-490.0] * 10, number=1),
    ]
    curve = of(anytime_curves(study(rows, tmp_path)), "m", "movement_ticks")
    assert curve.budget.iloc[[0, -1]].tolist() == [490, 4900]
    assert curve["mean"].isna().sum() == (curve.budget < 500).sum() > 0
    assert (curve["mean"].dropna() == -495).all()


def test_planners_are_points(tmp_path):
    rows = [
        run("planner", reward=-480, number=0, forward_kinematics=300),
        run("planner", reward=-470, number=1, forward_kinematics=500),
        run("sometimes", reward=-470, number=0),
        run("sometimes", number=1),
    ]
    frame = anytime_curves(study(rows, tmp_path))
    assert set(frame.kind) == {"point"}
    point = of(frame, "planner", "forward_kinematics").squeeze()
    assert (point.budget, point["mean"], point["median"]) == (400, -475, -475)
    assert of(frame, "planner").budget.tolist() == [0]
    half = of(frame, "sometimes").squeeze()
    assert (half.runs, half.solved) == (2, 1)
    assert math.isnan(half["mean"])


def test_intervals_are_those_of_the_percentile_bootstrap(tmp_path):
    rng = np.random.default_rng(0)
    last = rng.integers(-600, -470, size=20).astype(float)
    rows = [run("m", [-700.0, value], number=i) for i, value in enumerate(last)]
    results = study([*rows, run("other", [-500.0])], tmp_path)
    frame = anytime_curves(results)
    found = of(frame, "m").iloc[-1]
    expected = bootstrap(
        (last,), np.mean, method="percentile", n_resamples=20_000, rng=rng
    ).confidence_interval
    assert (found.low, found.high) == pytest.approx(tuple(expected), abs=0.1 * last.std())
    alone = anytime_curves(study(rows, tmp_path))
    pd.testing.assert_frame_equal(alone, frame[frame.method == "m"])
    assert of(frame, "other")[["low", "high"]].isna().all(axis=None)


def test_cold_runs_have_no_part_in_times_alone(tmp_path):
    rows = [run("m", [-500.0], number=0, warm=False), run("m", [-480.0], number=1)]
    frame = anytime_curves(study(rows, tmp_path))
    assert of(frame, "m").runs.tolist() == [2]
    assert set(of(frame, "m", "solve_s").runs) == {1}


# Areas


def test_areas_in_closed_form(tmp_path):
    """16 trials: a step at trial 4 comes halfway through the logarithm."""
    half = [-930.0] * 3 + [-465.0] * 13  # a gap of 1, then of 0
    rows = [
        run("half", half),
        run("constant", [1.2 * BEST] * 16),
        run("worse than none", [4.0 * BEST] * 16),
        run("planner", reward=BEST),
        run("nothing"),
        run("ended", [1.2 * BEST] * 4),
        run("late", [NAN] * 7 + [BEST] * 9),
    ]
    frame = areas(study(rows, tmp_path))
    frame = frame[frame.other_arm == "free"]
    found = frame[frame.spend == "trials"].set_index("method").area
    assert found["half"] == pytest.approx(0.5)
    assert found["constant"] == found["ended"] == pytest.approx(0.2)
    assert found["worse than none"] == found["nothing"] == 1
    assert found["planner"] == 0
    assert found["late"] == pytest.approx(0.75)
    assert frame.area.between(0, 1).all()


@settings(max_examples=12)
@given(st.lists(st.integers(-1200, BEST), min_size=2, max_size=12))
def test_areas_are_integrals(tmp_path_factory, rewards):
    results = study([run("m", [float(r) for r in rewards])], tmp_path_factory.mktemp("area"))
    logs = np.linspace(0, math.log(len(rewards)), 20_001)
    middle = np.exp((logs[1:] + logs[:-1]) / 2)
    gaps = np.minimum(1, (BEST - results.best_so_far["m-0"].best("trials", middle)) / -BEST)
    found = of(areas(results), "m").area.item()
    assert found == pytest.approx(gaps.mean(), abs=2e-3)


# Targets


def test_runs_that_never_reach_a_target_count(tmp_path):
    """Within 5 % of -465 is -488: three of four reach it, the last one is censored."""
    rows = [
        run("m", [-500.0, -488.0, -488.0, -488.0], number=0),
        run("m", [-500.0, -489.0, -488.0, -465.0], number=1),
        run("m", [-500.0, -489.0, -489.0, -488.0], number=2),
        run("m", [-500.0, -489.0, -489.0, -489.0], number=3),
    ]
    found = of(targets(study(rows, tmp_path)), "m").set_index("share")
    assert found.target.tolist() == [-488, -474, -469]
    assert found.reached.tolist() == [3, 1, 1]
    assert found["median"].tolist() == [3, math.inf, math.inf]
    assert found.horizon.tolist() == [4, 4, 4]
    # Clopper & Pearson's limits for 3 of 4: 0.194 and 0.994.
    assert found.loc[0.05, ["reached_low", "reached_high"]].tolist() == pytest.approx(
        [0.1941, 0.9937], abs=1e-4
    )


def test_ends_that_depend_on_rewards_do_not_make_medians(tmp_path):
    """Nine runs end without the target before one that reaches it: no median of it alone."""
    rows = [run("m", [-500.0] * 10, number=i) for i in range(9)]
    rows.append(run("m", [-900.0] * 9 + [-470.0], number=9))
    results = study(rows, tmp_path)
    for spend in ("movement_ticks", "trials"):
        found = of(targets(results), "m", spend).iloc[0]
        assert (found.reached, found["median"]) == (1, math.inf)
    found = of(targets(results), "m", "movement_ticks").iloc[0]
    assert (found.low, found.horizon) == (math.inf, 5000)


def test_planners_that_miss_never_reach_it(tmp_path):
    """Those that missed were quicker: dropped from the runs at risk, half of the runs
    would look like all of them."""
    rows = [run("p", reward=-470, number=i, forward_kinematics=500) for i in range(4)]
    rows += [run("p", reward=-600, number=4 + i, forward_kinematics=100) for i in range(5)]
    rows += [run("p", number=9, forward_kinematics=None)]
    found = of(targets(study(rows, tmp_path)), "p", "forward_kinematics").iloc[0]
    assert (found.runs, found.reached, found["median"]) == (10, 4, math.inf)
    rows[4]["reward"] = -480
    found = of(targets(study(rows, tmp_path)), "p", "forward_kinematics").iloc[0]
    assert (found.reached, found["median"]) == (5, 500)


def test_targets_of_the_restricted_optimum(tmp_path):
    rows = [run("still", [-490.0]), run("moving", [-490.0], other_arm_travel=0.1)]
    results = study(rows, tmp_path)
    frame = targets(results)
    assert of(frame, "still").reached.tolist() == [0, 0, 0]
    assert of(frame, "still", other_arm="still").reached.tolist() == [1, 1, 1]
    assert of(frame, "still", other_arm="still").target.tolist() == [-514, -499, -494]
    assert not len(of(frame, "moving", other_arm="still"))


@settings(max_examples=12)
@given(trial_rewards, st.sampled_from(SPENDS))
def test_nearer_targets_take_longer(tmp_path_factory, rewards, spend):
    rewards = [BEST + 10 * value for value in rewards]
    results = study([run("m", rewards)], tmp_path_factory.mktemp("near"))
    found = of(targets(results, shares=[0.5, 0.2, 0.1, 0.05, 0.01]), "m", spend)
    assert (np.diff(found.reached) <= 0).all()
    times = found["median"].to_numpy()
    assert (times[1:] >= times[:-1]).all()


def test_what_the_target_table_shows(tmp_path):
    rows = [run("m", [-600.0] * 9 + [-470.0], number=i) for i in range(8)]
    rows += [run("m", [-600.0] * 10, number=8), run("p", reward=-470)]
    rows += [run("never", [-600.0] * 10), run("optimum/x", reward=BEST)]
    table = targets_table(study(rows, tmp_path), "two-armed-1")
    heads = [column.header for column in table.columns if column.name.endswith("_reached")]
    assert heads == ["within 5 %: −488", "within 2 %: −474", "within 1 %: −469"]
    assert list(shown(table)) == ["p", "m"]  # the larger share first
    found = shown(table)["m"]
    assert (found["within_5_reached"], found["within_1_reached"]) == ("8/9", "0/9")
    assert found["within_5"] == Estimate(10, low=10, high=10, beyond=10)
    assert found["within_1"] is None
    assert found["horizon"] == 10
    assert shown(table)["p"]["within_2"] == 0.0  # one run, no interval
    assert shown(table)["p"]["horizon"] is None
    assert "Never within 5 %: never." in table.notes[0]
    rows = [run("m", [-600.0, -470.0 if i < 2 else -600.0], number=i) for i in range(20)]
    table = targets_table(study(rows, tmp_path), "two-armed-1")
    found = shown(table)["m"]
    assert (found["within_5_reached"], found["horizon"]) == ("2/20", 2)
    assert found["within_5"] == Estimate(math.inf, beyond=2)
    assert parts(table)[2].text(found["within_5"]) == ">2"  # all that is known of it
    assert "Never" not in table.notes[0]


def test_known_times(tmp_path):
    """The target falls at trial 3 of 4: 900 + 700 + 488 ticks, 3/4 of what comes as a total."""
    rows = [
        run("m", [-900.0, -700.0, -488.0, -480.0], solve_s=2.0),
        run("m", [-900.0, -700.0, -600.0, -500.0], number=1, solve_s=3.0),
    ]
    frame = targets(study(rows, tmp_path), shares=[0.05])
    times = {"trials": 3, "movement_ticks": 2088, "forward_kinematics": 300, "solve_s": 1.5}
    ends = {"trials": 4, "movement_ticks": 2568, "forward_kinematics": 400, "solve_s": 2.0}
    for spend in SPENDS:
        found = of(frame, "m", spend).squeeze()
        assert (found["median"], found.horizon) == (times[spend], ends[spend])
        assert found.reached == 1


def test_an_exhaustive_search_never_reaches_what_it_missed(tmp_path):
    """Two methods with the same trials: one had no more to try, one was stopped."""
    trials = [-600.0, -500.0]
    rows = [
        run("exhaustive", trials, parameters="{}"),
        run("early", trials, parameters='{"trials": 3}'),
        run("stopped", trials),
    ]
    results = study(rows, tmp_path)
    horizons = targets(results).query("spend == 'trials'").groupby("method").horizon.max()
    assert horizons.to_dict() == {"exhaustive": math.inf, "early": math.inf, "stopped": 2}
    assert targets_table(results, "two-armed-1") is None
    limits = {"limits": PlanLimits(time_s=None, trials=2)}
    limited = Study(
        replace(results.results, manifest=results.results.manifest.model_copy(update=limits))
    )
    assert {run_id: run.stopped for run_id, run in limited.best_so_far.items()} == {
        "exhaustive-0": True, "early-0": True, "stopped-0": True,
    }  # fmt: skip


def test_a_locked_base_is_another_problem(tmp_path):
    rows = [
        run("locked", reward=BEST, parameters='{"base": "y"}'),
        run("free", reward=BEST - 1, parameters='{"base": "task"}'),
        run("learner", [-600.0, -500.0]),
    ]
    results = study(rows, tmp_path)
    for frame in (targets, areas, anytime_curves, pareto_sets):
        assert set(frame(results).method) == {"free", "learner"}
    assert of(pareto_sets(results), "free", "information").front.item()


def test_both_optima_in_one_frame(tmp_path):
    rows = [run("still", [-490.0, -490.0]), run("moving", [-490.0, -480.0], other_arm_travel=0.1)]
    results = study(rows, tmp_path)
    frame = areas(results)
    frame = frame[frame.spend == "trials"].set_index(["method", "other_arm"])
    assert set(frame.index) == {("still", "free"), ("still", "still"), ("moving", "free")}
    assert frame.area["still", "still"] == 0
    assert frame.area["still", "free"] == pytest.approx(25 / 465)


def test_what_the_area_table_shows(tmp_path):
    rows = [run("b", [-930.0, -930.0], solve_s=0.0), run("a", [BEST, BEST])]
    rows += [run("a", [BEST, BEST], number=1), run("optimum/x", reward=BEST)]
    table = areas_table(study(rows, tmp_path), "two-armed-1")
    assert [row.key for row in table.rows] == ["a", "b"]
    heads = {column.name: column for column in table.columns}
    assert list(heads) == ["method", *SPENDS, *(f"{spend}_still" for spend in SPENDS)]
    assert heads["solve_s"].header == "over solve s"
    assert {heads[f"{name}_still"].other_arm for name in SPENDS} == {"still"}
    assert shown(table)["a"]["trials"] == Estimate(0, None, 0, 0)
    assert shown(table)["b"]["trials"] == Estimate(1)


def test_the_page(tmp_path):
    rows = [run("m", [-600.0, -470.0], number=i) for i in range(3)]
    rows += [run("p", reward=-466), run("none", [-900.0, -900.0])]
    document = frontier_document(study(rows, tmp_path))
    of_targets = [f"targets-two-armed-1{spend}{arm}"
                  for spend in ("", "-kinematics") for arm in ("", "-still")]  # fmt: skip
    names = [table.id for table in document.tables()]
    assert names == [*of_targets, "areas-two-armed-1", "pareto-two-armed-1"]
    page = markdown(document, tables="")
    assert page.count("Never within 5 %: none.") == 4
    assert "within 10 % of each other count as ties" in page
    assert "Optimum: −465 with the other arm free (proven); " in page


def test_a_page_has_no_empty_tables(tmp_path):
    """No method keeps the other arm still: nothing is said of that optimum."""
    rows = [run("m", [-600.0, -470.0], number=i, other_arm_travel=0.5) for i in range(3)]
    document = frontier_document(study(rows, tmp_path))
    assert all(table.rows for table in document.tables())
    assert not any(table.id.endswith("still") for table in document.tables())
    areas_shown = next(table for table in document.tables() if table.id.startswith("areas"))
    assert [column.name for column in areas_shown.columns] == ["method", *SPENDS]
    far = study([run("m", [-900.0, -900.0], number=i) for i in range(3)], tmp_path)
    page = markdown(frontier_document(far), tables="")
    assert "to come near the optimum" not in page
    assert "−465 with the other arm free (proven), which no run came near: m;" in page


def test_an_optimum_by_search_alone_is_marked(tmp_path):
    task = tiny_task(name="two-armed-1")  # not a shipped task: its optimum is the folder's own
    search = run("optimum/multistart", reward=-100)
    for bound, words in (
        (None, "−100 with the other arm free (**not proven**: the best that was found, by search"),
        (-90, "−100 with the other arm free (**not proven**: the best that was found; none ex"),
        (-100, "−100 with the other arm free (proven)"),
    ):
        rows = [run("m", [-120.0, -101.0]), search | {"proven_bound": bound}]
        results = study(rows, tmp_path).results
        content = {task.name: task.model_dump(mode="json")}
        results = replace(results, manifest=replanned(results.manifest, tasks=content))
        assert words in markdown(frontier_document(Study(results)), tables="")


def test_medians_are_censored_at_the_least_end(tmp_path):
    """Two of three runs reach it, one of them behind the least end: no median before that."""
    rows = [
        run("m", [-466.0, -466.0], number=0),
        run("m", [-900.0, -900.0, -900.0, -466.0], number=1),
        run("m", [-900.0, -900.0, -900.0, -900.0], number=2),
    ]
    results = study(rows, tmp_path)
    frame = targets(results, shares=(0.05,))
    row = of(frame, "m").iloc[0]
    assert (row.reached, row.horizon, row["median"]) == (2, 2, math.inf)
    found = shown(targets_table(results, "two-armed-1"))["m"]
    assert (found["within_5_reached"], found["within_5"].value) == ("2/3", math.inf)


# Pareto sets


def test_a_front_is_as_sure_as_its_runs(tmp_path):
    """Two runs of 6: the mean of six draws from {0, 12} exceeds 6 in 22 of 64 cases, is at
    least 6 in 42 of 64; ties are on the front."""
    rows = [run("noisy", reward=-500 + 12 * (i % 2), number=i) for i in range(6)]
    rows += [run("sure", reward=-494), run("worse", reward=-501)]
    noisy = study(rows, tmp_path)
    frame = pareto_sets(noisy)
    kept = of(frame, "noisy", "information")
    assert kept.front.item()
    assert of(frame, "sure", "information").front.item()
    assert share(frame, "noisy", "information") == pytest.approx(42 / 64, abs=0.04)
    assert share(frame, "sure", "information") == pytest.approx(42 / 64, abs=0.04)
    assert share(frame, "worse", "information") == 0
    found = shown(pareto_table(noisy, "two-armed-1"))
    assert list(found) == ["noisy", "sure"]
    assert found["noisy"]["information"] == 2
    assert found["noisy"]["information_front"] == pytest.approx(42 / 64, abs=0.04)


def test_reward_and_spend_are_resampled_together(tmp_path):
    """Runs of one method trade ticks for reward along a line that the other one lies on, so
    that a resample of both at once is never better in both."""
    rows = [
        run("line", reward=-500 + 10 * i, number=i, forward_kinematics=100 + 10 * i)
        for i in range(3)
    ]
    rows += [run("point", reward=-490, forward_kinematics=110)]
    frame = pareto_sets(study(rows, tmp_path))
    found = share(frame, "point", "forward_kinematics")
    draws = np.stack(np.meshgrid(*[range(3)] * 3), axis=-1).reshape(-1, 3)  # all 27 resamples
    mean, middle = draws.mean(axis=1), np.median(draws, axis=1)
    beaten = (mean >= 1) & (middle <= 1) & ((mean > 1) | (middle < 1))
    assert found == pytest.approx(1 - beaten.mean(), abs=0.03)


def test_twins_stay_tied(tmp_path):
    """Methods that did the same with the same seeds are on the front together or not at all."""
    rows = [
        run(name, reward=-500 + 7 * (i % 3), number=i, forward_kinematics=50 + i)
        for name in ("a", "b")
        for i in range(8)
    ]
    frame = pareto_sets(study(rows, tmp_path))
    assert (frame.front_share == 1).all()


def test_times_that_are_about_the_same_are_ties(tmp_path):
    rows = [
        run("best", reward=-470, solve_s=1.09),
        run("quicker by noise", reward=-480, solve_s=1.0),
        run("quicker", reward=-480, solve_s=0.98),
        run("slower twin", reward=-470, solve_s=1.19),
        run("much slower twin", reward=-470, solve_s=1.3),
    ]
    for row, ticks in zip(rows, (109, 100, 98, 119, 130), strict=True):
        row["forward_kinematics"] = ticks
    frame = pareto_sets(study(rows, tmp_path))
    times = frame[frame.spend == "solve_s"].set_index("method").front
    assert set(times.index[times]) == {"best", "quicker", "slower twin"}
    counts = frame[frame.spend == "forward_kinematics"].set_index("method").front
    assert set(counts.index[counts]) == {"best", "quicker"}


def test_cold_runs_count_for_reward_but_not_for_time(tmp_path):
    rows = [
        run("m", reward=-480, number=i, warm=i > 0, solve_s=5.0 if i == 0 else 0.5)
        for i in range(4)
    ]
    frame = pareto_sets(study(rows, tmp_path))
    assert of(frame, "m", "solve_s").amount.item() == 0.5
    # Where only the cold run is drawn there is no time: 1 of 256 resamples.
    assert 0.98 < share(frame, "m", "solve_s") < 1


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=1, max_size=12))
def test_domination_by_brute_force(points):
    reward, amount = np.array(points, dtype=float).T
    for i, (reward_i, amount_i) in enumerate(points):
        for j, (reward_j, amount_j) in enumerate(points):
            better = reward_j >= reward_i and amount_j <= amount_i and points[i] != points[j]
            assert dominated(reward, amount)[i, j] == better


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 9)), min_size=1, max_size=12))
def test_no_tolerance_empties_a_front(points):
    reward, amount = np.array(points, dtype=float).T
    worse = dominated(reward, amount, 0.5)
    assert not worse.any(axis=1).all()
    assert not np.diag(worse).any()
    batch = dominated(np.stack([reward, -reward]), np.stack([amount, amount]), 0.5)
    np.testing.assert_array_equal(batch[0], worse)


def test_fronts(tmp_path):
    rows = [
        run("cheap", reward=-600, told="goals", forward_kinematics=10),
        run("twin", reward=-600, told="goals", forward_kinematics=10),
        run("good", reward=-470, told="goals, Jacobian", forward_kinematics=90),
        run("wasteful", reward=-480, told="goals", forward_kinematics=95),
        run("beaten", reward=-610, told="goals, Jacobian", forward_kinematics=12),
        run("lucky", reward=-465, told="goals", forward_kinematics=1),
        run("lucky", told="goals", number=1, forward_kinematics=1),
    ]
    made = study(rows, tmp_path)
    frame = pareto_sets(made)
    assert "lucky" not in set(frame.method)
    found = frame[frame.spend == "forward_kinematics"].set_index("method")
    assert set(found.index[found.front]) == {"cheap", "twin", "good"}
    assert set(found.index[found.front_told]) == {"cheap", "twin", "good", "wasteful"}
    kinds = frame[frame.spend == "information"].set_index("method")
    assert kinds.amount.to_dict() == {
        "good": 2, "wasteful": 1, "cheap": 1, "twin": 1, "beaten": 2,
    }  # fmt: skip
    assert set(kinds.index[kinds.front]) == {"good", "wasteful"}
    table = shown(pareto_table(made, "two-armed-1"))
    assert set(table) == {"good", "wasteful", "cheap", "twin"}
    fronts = ("forward_kinematics", "forward_kinematics_front", "forward_kinematics_told")
    assert [table["wasteful"][name] for name in fronts] == [95, 0, 1]
    assert [table["good"][name] for name in fronts] == [90, 1, 1]


def test_an_empty_folder_gives_empty_frames(tmp_path):
    results = study([run("nothing")], tmp_path).results
    results = Results(
        tmp_path,
        replanned(results.manifest, cells=()),
        results.runs[:0],
        results.sequences,
    )
    empty = Study(results)
    for frame in (empty.anytime, empty.areas, empty.targets):
        assert not len(frame)
        assert {"task", "method", "spend"} <= set(frame.columns)
