"""Answer question 1: does the order of methods survive motor noise?"""

from itertools import combinations

import numpy as np
import pandas as pd
from rules import RESAMPLES, Pair, common, judge

from coartic.analysis.statistics import other_tasks, task_mean

AFTER = 0.01
"""Motor noise of the verdicts, in rad and length units."""
NAMES = {
    "dual-process/EC1": "learner",
    "dual-process/EC4": "learner",
    "dual-process/EC1-informed": "informed learner",
    "dual-process/EC4-informed": "informed learner",
    "hill-climbing": "hill climbing",
    "random-search": "random search",
    "cma-es/bandit": "CMA-ES",
    "corrective-alone/given": "corrective process",
    "posture-based/two-goals": "posture planning",
    "posture-qp/goals-ahead": "posture QP",
}
"""Methods with shipped runs on all 200 random tasks (EC1 on one-armed tasks, EC4 on the others)."""
OPEN_LOOP = "posture QP"
HEADLINE = ("CMA-ES", "learner")


def is_paper_condition(rows):
    """Return False for rows of the learner whose condition is for another number of arms.

    EC1 is for one-armed tasks, EC4 for the others. The result is True for all other rows.
    """
    one_arm = rows.task.isin(["ascending", "descending"]) | rows.task.str.startswith("one-armed/")
    return ~(rows.method.str.contains("EC4") & one_arm | rows.method.str.contains("EC1") & ~one_arm)


def read(folder):
    """Return the executions of the methods in :data:`NAMES`, with the gap of each run.

    Gaps are in per cent of the best known ticks without noise. A run with failed executions has no
    mean. Its gap is that of the worst run of any method on any task of the same group with the same
    noise, so that a method does not win by failing.
    """
    rows = pd.concat([pd.read_csv(path) for path in sorted(folder.glob("*.csv"))])
    rows = rows[rows.setting.isna() & rows.method.isin(NAMES)].copy()
    rows["name"] = rows.method.map(NAMES)
    rows["family"] = rows.task.str.partition("/")[0].where(rows.task.str.contains("/"))
    rows["group"] = np.where(rows.family.isna(), "paper", "families")
    rows = rows[is_paper_condition(rows)].copy()
    gap = 100 * (rows.ticks + rows.best_known) / -rows.best_known
    rows["gap"] = gap.where(rows.failures == 0)
    noise = ["group", "motor_noise", "signal_dependent"]
    rows["gap"] = rows.gap.fillna(rows.groupby(noise).gap.transform("max"))
    return rows


def tabulate_gaps(rows):
    """Return mean gaps with intervals, and failures, by group of tasks, method and noise.

    Intervals are for other tasks on random tasks, and for other runs on the paper's tasks. On the
    paper's tasks, methods with one run have no interval.
    """
    keys, table = ["group", "name", "signal_dependent", "motor_noise"], []
    for key, of_level in rows.groupby(keys, sort=False):
        by_task = of_level.groupby(["family", "task"], sort=False, dropna=False).gap
        runs = [(family, gaps.to_numpy()) for (family, _), gaps in by_task]
        if key[0] == "paper":
            estimate = task_mean([gaps for _, gaps in runs])
        else:
            families = dict.fromkeys(family for family, _ in runs)
            estimate = other_tasks(
                {family: [gaps for each, gaps in runs if each == family] for family in families}
            )
        row = dict(zip(keys, key, strict=True)) | estimate.columns("gap")
        table.append(row | {"failures": int(of_level.failures.sum())})
    return pd.DataFrame(table)


def tabulate_pairs(rows, resamples=RESAMPLES):
    """Return a row for each pair of methods on the random tasks, with its verdict.

    CMA-ES against the learner is judged first and by itself. The tests of all other pairs are
    corrected together. The final verdict on a pair is what the verdicts for constant and for
    signal-dependent noise have in common.
    """
    rows = rows[rows.group == "families"]
    tables = {}
    for dependent in (False, True):
        of_kind = rows[(rows.signal_dependent == dependent) | (rows.motor_noise == 0)]
        before, after = (
            of_kind[of_kind.motor_noise == level].pivot_table("gap", "task", "name")
            for level in (0.0, AFTER)
        )
        assert before.notna().all(axis=None)
        assert after.notna().all(axis=None)
        pairs = {
            f"{first}, {second}": Pair(
                *((each[first] - each[second]).to_numpy() for each in (before, after))
            )
            for first, second in combinations(dict.fromkeys(NAMES.values()), 2)
        }
        headline = next(name for name in pairs if {*name.split(", ")} == {*HEADLINE})
        others = {name: pair for name, pair in pairs.items() if name != headline}
        parts = {headline: pairs[headline]}, others
        tables[dependent] = pd.concat([judge(part, resamples) for part in parts])
    table = tables[False].rename(columns={"verdict": "constant"})
    table["dependent"] = tables[True].verdict
    table["verdict"] = [*map(common, table.constant, table.dependent)]
    table["open_loop"] = table.index.str.contains(OPEN_LOOP)
    return table


def tabulate_families(rows):
    """Return by how much CMA-ES is ahead of the learner, by family and level of constant noise.

    The table has the lead in percentage points of gap with an interval for other tasks, its median
    over tasks, and the number of tasks on which CMA-ES is ahead. This is a description: the rules
    judge all families together.
    """
    rows, table = rows[(rows.group == "families") & ~rows.signal_dependent], []
    for level, of_level in rows.groupby("motor_noise"):
        gaps = of_level.pivot_table("gap", ["family", "task"], "name")
        for family, of_family in (gaps["learner"] - gaps["CMA-ES"]).groupby("family", sort=False):
            lead = other_tasks({family: [np.array([value]) for value in of_family]})
            row = {"family": family, "motor_noise": level} | lead.columns("lead")
            ahead = int((of_family > 0).sum())
            table.append(row | {"median": of_family.median(), "ahead": ahead, "tasks": lead.n[0]})
    return pd.DataFrame(table)
