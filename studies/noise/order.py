"""Tabulate and judge gaps of methods that practised without noise or with it."""

import numpy as np
import pandas as pd
from rules import RESAMPLES, judge

from coartic.analysis import other_tasks

NOISE = 0.01
"""Motor noise, in rad and length units."""
WORLD = "motor_noise=0.01"
LABELS = {
    "policy-gradient": "policy gradient",
    "cma-es/bandit": "CMA-ES",
    "dual-process/EC1-informed": "informed learner",
    "dual-process/EC4-informed": "informed learner",
    "hill-climbing": "hill climbing",
    "hill-climbing spread=learned": "hill climbing, learned spread",
    "dual-process/EC1": "learner",
    "dual-process/EC4": "learner",
    "random-search": "random search",
}
"""Methods that learn, by their labels in suite families (EC1 on one-armed tasks, else EC4)."""
LEARNER = "learner"
JUDGED = ("policy gradient", "CMA-ES", "informed learner", "hill climbing", "random search")
"""Methods that are judged against the learner; the other one is described."""
CASES = {
    "exact": "without noise",
    "aims": "as it aims",
    "hits": "at its hits",
    "practised": "practised in noise",
}
"""Gaps of a method: three after practice without noise, and one after practice in noise."""
JUDGED_CASES = ("hits", "practised")


def read(rows):
    """Return the gap of each run in each case, in per cent of the best known ticks.

    ``rows`` has the executions of questions *practised* and *answers*. The best known solution is
    that of the world in which the run practised. ``error`` is the standard error of the gap from
    the random noise of executions.
    """
    rows = rows[rows.question.isin(["practised", "answers"])]
    label = (rows.method + " " + rows.setting.fillna("")).str.strip()
    case = np.select(
        [
            rows.question == "answers",
            (rows.target == "T") & (rows.motor_noise == 0),
            (rows.target == "T") & (rows.motor_noise > 0),
            (rows.target == "P") & (rows.motor_noise > 0),
        ],
        ["practised", "exact", "aims", "hits"],
        "",
    )
    table = rows.assign(
        name=label.map(LABELS),
        case=case,
        family=rows.task.str.partition("/")[0],
        gap=100 * (rows.ticks + rows.best_known) / -rows.best_known,
        error=100 * rows.error / -rows.best_known,
    )
    return table[table.name.notna() & (table.case != "")]


def _mean_gap(rows):
    """Return the mean gap over families, tasks and runs with its interval for other tasks."""
    by_family = {
        family: [of_task.to_numpy() for _, of_task in of_family.groupby("task").gap]
        for family, of_family in rows.groupby("family", sort=False)
    }
    return other_tasks(by_family)


def tabulate(gaps):
    """Return the mean gap of each method in each case, over all families and in each one.

    There is a row for each group of tasks (``all`` or a family) and method. For each case it has
    the mean gap with its interval for other tasks, the standard error from executions
    (``_error``), and the number of failed executions.
    """
    table = []
    groups = [("all", gaps), *gaps.groupby("family", sort=False)]
    for group, of_group in groups:
        for name in dict.fromkeys(LABELS.values()):
            row = {"group": group, "name": name}
            of_name = of_group[of_group.name == name]
            for case in CASES:
                of_case = of_name[of_name.case == case]
                if of_case.empty:
                    continue
                row |= _mean_gap(of_case).columns(case)
                row[f"{case}_error"] = float(np.sqrt((of_case.error**2).sum()) / len(of_case))
                row[f"{case}_failures"] = int(of_case.failures.sum())
                row[f"{case}_runs"] = len(of_case)
            table.append(row)
    return pd.DataFrame(table)


def differences(gaps, case):
    """Return gaps of the judged methods less those of the learner, by family and task."""
    means = gaps[gaps.case == case].pivot_table("gap", ["family", "task"], "name", sort=False)
    assert means[[*JUDGED, LEARNER]].notna().all(axis=None)
    return {name: means[name] - means[LEARNER] for name in JUDGED}


def tabulate_verdicts(gaps, resamples=RESAMPLES):
    """Return the verdicts on the judged methods after practice without noise and in noise."""
    values = {
        (case, name): of_method
        for case in JUDGED_CASES
        for name, of_method in differences(gaps, case).items()
    }
    table = judge(values, resamples)
    return table.rename_axis(["case", "name"]).reset_index().set_index("case")


def tabulate_families(gaps):
    """Return by how many points of gap each judged method is behind the learner, by family.

    Differences have intervals for other tasks, and the number of tasks on which the method is
    ahead. This is a description: verdicts are over all families.
    """
    table = []
    for case in JUDGED_CASES:
        for name, values in differences(gaps, case).items():
            for family, of_family in values.groupby("family", sort=False):
                difference = other_tasks({family: [*of_family.to_numpy()[:, None]]})
                row = {"case": case, "name": name, "family": family}
                row |= difference.columns("difference") | {"median": of_family.median()}
                table.append(row | {"ahead": int((of_family < 0).sum()), "tasks": len(of_family)})
    return pd.DataFrame(table)
