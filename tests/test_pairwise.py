"""Methods against each other: planted cells, by hand and by enumeration."""

import itertools
import math

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis.comparisons.overall import WITHIN, everywhere, over_tasks, profiles
from coartic.analysis.comparisons.pairs import pairs
from coartic.analysis.report.document import Estimate
from coartic.analysis.report.formats.markdown import markdown
from coartic.analysis.report.pages.comparisons import (
    comparisons_document,
    cost_table,
    pairwise_table,
)
from coartic.analysis.results.folder import Results
from coartic.analysis.statistics.estimates import SEED, difference_of_means
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.statistics.power import power, runs_needed
from coartic.analysis.study import Study
from coartic.benchmarks.registry import registry
from coartic.benchmarks.suites import Cell
from tests.support.made_up import MadeUp, made_up_optima, manifest_for, row
from tests.support.reports import shown
from tests.support.suites import run_and_write

T1, T2 = "two-armed-1", "two-armed-2"
EC4 = [-484, -482, -486, -483, -485, -487, -481, -484]
EC3 = [-506, -503, -507, -504, -506, -508, -502, -505]
PLANNER = "goals, kinematic model, reward as a formula"


def cell(method, rewards, task=T1, **more):
    """Runs of one cell that share seeds with those of the others; None failed."""
    return [
        row(
            method, reward, task=task, run=k, seed=1000 + k,
            **{"status": "infeasible" if reward is None else "ok", **more},
        )
        for k, reward in enumerate(rewards)
    ]  # fmt: skip


def study(tmp_path, *cells, tasks=None):
    runs = pd.DataFrame([r for c in cells for r in c])
    runs = runs.astype({"reward": "Int64", "proven_bound": "Int64"})
    tasks = tasks or {name: load_task(name) for name in runs.task.unique()}
    initial = pd.DataFrame(
        {
            "task": [T1, T2, "ascending"],
            "hands": ["RRRR", "RRRR", "RRR"],
            "reward": pd.array([-671, -357, -319], "Int64"),
        }
    )
    results = Results(tmp_path, manifest_for(tasks.values(), runs), runs, initial)
    return MadeUp(results, optima=made_up_optima(*{T1, T2, "ascending"}.intersection(tasks)))


def page(of):
    return markdown(comparisons_document(of), tables="")


def test_who_is_compared_with_whom(tmp_path):
    """By kind and by what is told; all rewards are equal."""
    same = [-500] * 4
    found = study(
        tmp_path,
        cell("dual-process/EC1", same),
        cell("dual-process/EC3", same),
        cell("dual-process/EC4", same, travel=1.0),
        cell("dual-process/EC4-nullspace", same, travel=1.0, told="reward by trial, goals"),
        cell("dual-process/EC4", same, travel=1.0, variant="epsilon=0.5"),
        cell("moving", same, travel=1.0),
        cell("still", same, told="reward by trial"),
        cell("planner", same[:1], told=PLANNER),
        cell("optimum/multistart", same[:1], told=PLANNER),
        cell("dual-process/EC1", same, task="ascending"),
        cell("still", same, task="ascending", told="reward by trial"),
        cell("still", same, task=T2),  # no learner there
    )
    learner = "dual-process/"
    assert [
        (p.first.task, p.kind, p.first.label.removeprefix(learner), p.second.label)
        for p in pairs(found)
    ] == [
        (T1, "conditions", "EC3", "dual-process/EC1"),
        (T1, "conditions", "EC4", "dual-process/EC1"),
        (T1, "conditions", "EC4", "dual-process/EC3"),
        (T1, "variant", "EC4", "dual-process/EC4-nullspace"),
        (T1, "variant", "EC4", "dual-process/EC4 epsilon=0.5"),
        (T1, "method", "EC4", "moving"),
        (T1, "method", "EC4", "still"),
        (T1, "method", "EC3", "still"),
        (T1, "method", "EC4", "planner"),
        (T1, "method", "EC3", "planner"),
        ("ascending", "method", "EC1", "still"),
    ]
    frame = found.pairs
    planned = frame[frame.second == "planner"].iloc[0]
    assert (planned.told_more, planned.told_less) == ("GKR", "AT")


def test_a_planted_difference_and_what_pairing_does(tmp_path):
    """The second is the first less 10, seed by seed: pairs know it, the tests do not."""
    found = study(
        tmp_path,
        cell("dual-process/EC4", EC4, travel=1.0),
        cell("worse", [reward - 10 for reward in EC4], travel=1.0, trials=5, jacobians=0),
    )
    (made,) = found.pairs.to_dict("records")
    assert (made["difference"], made["low"], made["high"]) == (10, 10, 10)
    assert made["interval"] == "paired by seed"
    assert made["pairs"] == made["n_first"] == made["n_second"] == 8
    assert made["correlation"] == pytest.approx(1)
    assert made["independent_low"] < 9 < 11 < made["independent_high"]
    assert made["improvement"] == made["delta"] == made["improvement_high"] == 1
    # 8 and 8 runs: all 12 870 assignments are more than are drawn.
    assert made["p"] == made["p_holm"] == 0.0002
    sd = np.std(EC4, ddof=1)
    assert made["runs_2"] == runs_needed(9.3, sd, sd)
    assert power(made["smallest"], sd, sd, 8) == pytest.approx(0.8)
    assert made["smallest_share"] == pytest.approx(made["smallest"] / 465)
    assert made["trials"] == 0.5
    assert made["evaluations"] == pytest.approx(1_234_567 / (1_234_567 + 950))
    assert shown(pairwise_table(found, T1)) == {
        "dual-process/EC4 - worse": {
            "first": "dual-process/EC4", "second": "worse", "n_first": 8, "n_second": 8,
            "difference": Estimate(10, None, 10, 10),
            **{name: made[name] for name in ("test", "p", "p_holm")},
            "delta": Estimate(1, None, made["delta_low"], 1),
            "improvement": Estimate(1, None, made["improvement_low"], 1),
        }
    }  # fmt: skip
    costs = shown(cost_table(found, T1))["dual-process/EC4 - worse"]
    assert costs["smallest_share"] == made["smallest_share"]
    assert (costs["runs_2"], costs["told_more"], costs["sd_first"]) == (made["runs_2"], None, sd)


def test_the_order_of_the_tables_and_what_they_rest_on(tmp_path):
    """Conditions, methods, variants; the best second first. Shares are of the optimum."""
    found = study(
        tmp_path,
        cell("dual-process/EC4", EC4, travel=1.0, variant="epsilon=0.5"),
        cell("low", [-600] * 8, travel=1.0),
        cell("high", [-470] * 8, travel=1.0),
        cell("failing", [None] * 8, travel=1.0),
        cell("dual-process/EC4", EC4, travel=1.0),
        cell("dual-process/EC3", EC3),
    )
    table = cost_table(found, T1)
    assert [row["second"] for row in shown(table).values()] == [
        "dual-process/EC3", "high", "low", "failing", "dual-process/EC4 epsilon=0.5",
    ]  # fmt: skip
    of_optimum = {column.name for column in table.columns if "optimum" in column.rests_on}
    assert of_optimum == {"runs_5", "runs_2", "runs_1", "smallest_share"}
    for column in (*table.columns, *pairwise_table(found, T1).columns):
        assert "runs" in column.rests_on or column.kind == "text"


def test_effects_by_enumeration(tmp_path):
    second = [-484, -500, -481, -490, -488, -484, -483, -470]
    found = study(
        tmp_path,
        cell("dual-process/EC4", EC4, travel=1.0),
        cell("other", second, travel=1.0),
        cell("planner", [-484], travel=1.0, told=PLANNER),
    )
    other, planner = found.pairs.to_dict("records")
    signs = [np.sign(a - b) for a in EC4 for b in second]
    assert other["delta"] == pytest.approx(np.mean(signs))
    assert other["improvement"] == pytest.approx(np.mean([(s + 1) / 2 for s in signs]))
    assert other["difference"] == pytest.approx(np.mean(EC4) - np.mean(second))
    assert other["correlation"] == pytest.approx(np.corrcoef(EC4, second)[0, 1])
    # Against a known reward: the learner's spread alone, and all 2^8 signs.
    apart = np.array(EC4) + 484
    flips = np.array(list(itertools.product([1, -1], repeat=8))) @ apart
    expected = min(1.0, 2 * min((flips >= apart.sum()).mean(), (flips <= apart.sum()).mean()))
    assert planner["p"] == pytest.approx(expected)
    assert planner["interval"] == "against a known value"
    assert (planner["sd_second"], planner["pairs"]) == (0, 0)
    assert planner["runs_1"] == runs_needed(4.65, np.std(EC4, ddof=1), 0)


def test_conditions_have_the_claims_test_and_the_others_two_tails(tmp_path):
    """One p-value a pair: conditions as in the register, and whatever else was run beside."""
    better = [reward + 10 for reward in EC4[::-1]]
    conditions = cell("dual-process/EC4", EC4, travel=1.0), cell("dual-process/EC3", EC3)
    found = study(tmp_path, *conditions, cell("better", better, travel=1.0))
    (pair,) = study(tmp_path, *conditions).pairs.to_dict("records")
    first, second = found.pairs.to_dict("records")
    assert pair["second"] == first["second"] == "dual-process/EC3"
    for column in ("p", "difference", "low", "high", "test"):
        assert first[column] == pair[column]
    assert np.isnan(first["p_holm"])  # the claims register corrects for their number
    assert second["p_holm"] == second["p"]
    claimed = bootstrap_test(EC4, EC3, seed=SEED)
    interval = difference_of_means(EC4, EC3, seed=SEED)
    assert (pair["p"], pair["test"]) == (claimed.p, claimed.method)
    assert (pair["low"], pair["high"]) == (interval.low, interval.high)
    assert first["interval"] == "independent"
    assert first["pairs"] == 8
    # Lower by as much as is seen: two tails say so, one tail upwards would be near 1.
    assert second["difference"] < 0
    assert second["p"] < 0.01
    assert second["test"].startswith("two-tailed")


def test_a_condition_that_explores_more_may_be_lower(tmp_path):
    """Its p is near 1, which the page turns."""
    conditions = cell("dual-process/EC4", EC3, travel=1.0), cell("dual-process/EC3", EC4)
    found = study(tmp_path, *conditions)
    assert found.pairs.p.tolist() == [1.0]
    assert "dual-process/EC4 and other conditions: lower than dual-process/EC3" in page(found)


def test_holm_over_the_rows_of_a_task(tmp_path):
    """By hand: the smallest p times the number of tests, the next times one less, rising."""
    shifts = {"a": 20, "b": 2, "c": 1, "d": 0}
    rng = np.random.default_rng(3)
    drawn = {name: rng.integers(-4, 5, 8) for name in shifts}

    def task(name):
        return [
            cell("dual-process/EC4", EC4, name, travel=1.0),
            *(
                cell(m, [int(r - s + e) for r, e in zip(EC4, drawn[m], strict=True)], name,
                     travel=1.0)
                for m, s in shifts.items()
            ),
        ]  # fmt: skip

    frame = study(tmp_path, *task(T1), *task(T2)).pairs
    for _, rows in frame.groupby("task"):
        assert len(rows) == 4  # the family: not the eight of the page
        largest = 0.0
        for place, (p, adjusted) in enumerate(sorted(zip(rows.p, rows.p_holm, strict=True))):
            largest = max(largest, p * (4 - place))
            assert adjusted == pytest.approx(min(1.0, largest))


def test_few_failed_and_missing_runs(tmp_path):
    """One run each; none with a solution; a task of one's own: said, and no number made up."""
    one = study(
        tmp_path,
        cell("dual-process/EC3", [-500]),
        cell("dual-process/EC4", [-490], travel=1.0),
        cell("planner", [-480], told=PLANNER),
    )
    frame = one.pairs
    assert frame.difference.tolist() == [10, -10, -20]
    nothing = ["low", "high", "p", "delta_low", "runs_1", "smallest"]
    assert frame[nothing].isna().all(axis=None)
    assert (frame.interval != "against a known value").all()
    assert "not tested (too few runs) against dual-process/EC3" in page(one)

    own = load_task(T1).model_copy(update={"name": "own", "radius": 0.2})
    failed = study(
        tmp_path,
        cell("dual-process/EC4", [*EC4[:-1], None], "own", travel=1.0),
        cell("never", [None] * 3, "own"),
        cell("sometimes", [-490, None, -491, -495], "own", travel=1.0),
        tasks={"own": own},
    )
    never, sometimes = failed.pairs.to_dict("records")
    assert math.isnan(never["difference"])
    assert never["note"] == "no run with a solution"
    assert (sometimes["n_first"], sometimes["n_second"], sometimes["pairs"]) == (7, 3, 3)
    assert sometimes["difference"] == pytest.approx((6 + 5 + 12) / 3)
    assert math.isnan(sometimes["runs_1"])  # no optimum is known
    assert sometimes["smallest"] > 0
    text = page(failed)
    note = pairwise_table(failed, "own").notes[1]
    assert "dual-process/EC4 solved 7 of 8, sometimes solved 3 of 4, never solved 0 of 3" in note
    assert "Needs at least two tasks" in text


def test_without_the_learner_there_is_nothing_to_compare(tmp_path):
    alone = study(tmp_path, cell("m", EC4))
    assert {"task", "first", "second", "p_holm", "note"} <= set(alone.pairs.columns)
    assert alone.pairs.empty
    assert "no runs of the learner" in page(alone)


def test_few_runs_that_cannot_differ_are_said_to_be_few(tmp_path):
    """3 and 3 runs: 2 of 20 assignments are as extreme as the most extreme one."""
    few = study(
        tmp_path,
        cell("dual-process/EC4", EC4[:3], travel=1.0),
        cell("other", EC3[:3]),
    )
    assert few.pairs.p.tolist() == [0.1]
    assert "Too few runs to tell anything apart: 1 permutation tests" in page(few)
    enough = study(
        tmp_path, cell("dual-process/EC4", EC4, travel=1.0), cell("dual-process/EC3", EC3)
    )
    assert "Too few runs" not in page(enough)
    assert "dual-process/EC4 and other conditions: higher than dual-process/EC3" in page(enough)


def test_one_row_over_one_and_two_armed_tasks(tmp_path):
    made = study(
        tmp_path,
        cell("dual-process/EC1", [-292, -294, -300, -319], "ascending"),
        cell("dual-process/EC1", [-671] * 4),  # where EC4 ran it is EC4's that count
        cell("dual-process/EC4", [-465, -466, -500, -671], travel=1.0),
        cell("dual-process/EC4", [-306] * 4, T2, travel=1.0, variant="epsilon=0.5"),
        cell("failing", [-292, None], "ascending"),
        cell("failing", [-465, -465]),
    )
    scores = made.scores[made.scores.task != T2]
    best = made.optima
    assert (best["ascending", "free"].reward, best[T1, "free"].reward) == (-292, -465)
    name = "dual-process (EC1, EC4)"
    assert sorted(everywhere(scores)) == sorted([name, "dual-process/EC1", "failing"])
    overall = over_tasks(scores).set_index("method")
    gaps = [0, 2 / 292, 8 / 292, 27 / 292, 0, 1 / 465, 35 / 465, 206 / 465]
    assert overall.loc[name, "gap"] == pytest.approx(np.mean(gaps))
    for column, near in WITHIN.items():
        assert overall.loc[name, column] == np.mean([gap <= near for gap in gaps])
    middle = sorted([1, 25 / 27, 19 / 27, 0, 1, 205 / 206, 171 / 206, 0])[2:6]
    assert overall.loc[name, "score"] == pytest.approx(np.mean(middle))
    assert math.isnan(overall.loc["failing", "gap"])
    assert overall.loc["failing", "gap_note"] == "1 runs without a solution"
    assert overall.loc["failing", "within_1"] == 0.75  # the failed run reaches nothing
    shares = profiles(scores).set_index(["method", "kind", "threshold"]).share
    assert shares[name, "gap", 0.01] == overall.loc[name, "within_1"]
    assert shares[name, "gap", 0.1] == 7 / 8
    assert shares[name, "score", 0.8] == 5 / 8


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    known = registry()
    cells = [
        Cell(load_task(task), known[method])
        for task, conditions in (("ascending", ["EC1"]), (T1, ["EC3", "EC4"]))
        for method in [
            *(f"dual-process/{condition}" for condition in conditions),
            "corrective-alone/given",
            "random-search/pure",
        ]
    ]
    return run_and_write(tmp_path_factory.mktemp("pairwise"), cells, runs=4, trials=200)


def test_the_page_of_a_folder(folder):
    made = Study(folder)
    text = page(made)
    assert text == page(Study(folder))
    frame = made.pairs
    # Two of the one-armed task, two conditions, each method once, and again with condition 3 if it
    # keeps the other arm still: the corrective process alone does.
    own = folder.runs[folder.runs.task == T1].groupby("method").other_arm_travel.max()
    still = [own[method] == 0 for method in ("corrective-alone/given", "random-search/pure")]
    assert still[0]
    assert len(frame) == 2 + 1 + 2 + sum(still)
    assert frame.pairs[frame.second != "corrective-alone/given"].eq(4).all()
    for name in ("## ascending", f"## {T1} †", "## Across tasks", "dual-process (EC1, EC4)"):
        assert name in text
    # Its trial 0 is the corrective process alone, so a learned reward cannot be below it.
    alone = frame[frame.second == "corrective-alone/given"]
    assert (alone.difference >= 0).all()
    assert (alone.interval == "against a known value").all()
