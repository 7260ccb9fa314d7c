"""Answer questions 3 and 4: memory with noise, and learning in noise."""

from itertools import combinations

import numpy as np
import pandas as pd
from rules import RESAMPLES, Pair, judge, judge_levels, test_mean

from coartic.analysis.statistics import other_tasks, task_mean

AFTER = 0.01
MOST = 1_000
METHODS = {
    "dual-process/EC1": "learner",
    "dual-process/EC4": "learner",
    "hill-climbing": "hill climbing",
    "random-search": "random search, 1 stage",
    "random-search 100": "random search, 100 stages",
    "random-search 1000": "random search, 1,000 stages",
    "cma-es/in-noise": "CMA-ES",
    "cma-es/noise-handler": "CMA-ES with a noise handler",
}
JUDGED = (
    *("learner", "hill climbing", "random search, 1 stage", "random search, 1,000 stages"),
    "CMA-ES",
)


def _rows(folder):
    """Return the executions of a folder, with columns for family and group of tasks."""
    rows = pd.concat([pd.read_csv(path) for path in sorted(folder.glob("*.csv"))])
    family = rows.task.str.partition("/")[0].where(rows.task.str.contains("/"))
    group = np.where(family.isna(), "paper", "families")
    return rows.assign(setting=rows.setting.fillna(""), family=family, group=group)


def _worst_for_failures(rows, column, keys):
    """Return a column in which runs with failed executions have the worst value.

    It is the largest value among the runs with the same values of ``keys``.
    """
    values = rows[column].where(rows.failures == 0)
    return values.fillna(values.groupby([rows[key] for key in keys]).transform("max"))


def read_memory(folder, learner):
    """Return ticks by task, number of stages, content of memory (``keep``) and noise (question 3).

    Random search has a value for each hand sequence in which the learner's runs end. The value of a
    task is their mean, weighted by the numbers of these runs. ``learner`` has the learner's runs.
    """
    rows = _rows(folder)
    rows["ticks"] = _worst_for_failures(rows, "ticks", ["task", "motor_noise"])
    rows["hands"] = rows.setting.str.extract(r"hands=(\w+)")[0]
    rows["stages"] = rows.setting.str.extract(r"stages=(\d+)")[0].fillna("1").astype(int)
    rows["keep"] = rows.setting.str.extract(r"keep=(\w+)")[0].fillna("postures")
    shares = learner.groupby("task").hands.value_counts(normalize=True).rename("weight")
    rows = rows.join(shares, on=["task", "hands"])
    keys = ["group", "family", "task", "motor_noise", "stages", "keep", "hands"]
    by_hands = rows.groupby(keys, dropna=False)[["ticks", "weight"]].mean()
    weighted = by_hands.ticks * by_hands.weight
    values = weighted.groupby(level=keys[:-1], dropna=False).sum().rename("ticks").reset_index()
    both = values[values.stages == 1].assign(keep="targets")
    return pd.concat([values, both], ignore_index=True)


def tabulate_memory(values, resamples=RESAMPLES):
    """Return ticks with targets less ticks with postures, and verdicts on this difference.

    Differences are by group, number of stages and noise. Verdicts are for 1,000 stages on the
    random tasks.
    """
    wide = values.pivot_table(
        "ticks", ["group", "family", "task", "stages", "motor_noise"], "keep", dropna=False
    ).dropna()
    difference = (wide.targets - wide.postures).rename("ticks").reset_index()
    rows = []
    for (group, stages, level), of in difference.groupby(["group", "stages", "motor_noise"]):
        if group == "paper":
            for task, of_task in of.groupby("task"):
                row = {"group": task, "difference": float(of_task.ticks.mean())}
                rows.append(row | {"stages": stages, "motor_noise": level})
            continue
        families = {
            family: [np.array([tick]) for tick in of_family.ticks]
            for family, of_family in of.groupby("family")
        }
        row = {"group": "random tasks", "stages": stages, "motor_noise": level}
        rows.append(row | other_tasks(families).columns("difference"))
    random = difference[(difference.group == "families") & (difference.stages == MOST)]
    by_level = {level: of.ticks.to_numpy() for level, of in random.groupby("motor_noise")}
    return pd.DataFrame(rows), judge_levels(by_level, resamples).rename_axis("motor_noise")


def read_learning(folder):
    """Return the executions of question 4 with the gap of each run, in per cent.

    Gaps are to the best reward of any run of the study without noise on random tasks, and to the
    best known reward on the paper's tasks. A run with failed executions has the largest gap of its
    group.
    """
    rows = pd.concat([_rows(folder / part) for part in ("learning-executed", "handler-executed")])
    stages = rows.setting.str.extract(r"stages=(\d+)")[0].fillna("")
    rows["name"] = (rows.method + " " + stages).str.strip().map(METHODS)
    noisy = rows.setting.str.contains(r"noise_sd|sigma")
    by_cma = rows.method.str.startswith("cma-es/") & ~rows.setting.str.contains("motor_noise=0.0")
    rows["practice"] = np.where(noisy | by_cma, AFTER, 0.0)
    exact = rows[(rows.motor_noise == 0) & (rows.failures == 0)]
    best = exact.groupby("task").ticks.min()
    rows["best"] = rows.task.map(best).where(rows.group == "families", -rows.best_known)
    rows["gap"] = 100 * (rows.ticks - rows.best) / rows.best
    rows["gap"] = _worst_for_failures(rows, "gap", ["group", "motor_noise", "action"])
    return rows


def _over_tasks(rows, column):
    """Return the mean of a column over tasks with its interval.

    The interval is for other tasks if the tasks are random, and otherwise for other runs.
    """
    if rows.group.iloc[0] == "paper":
        return task_mean([of_task.to_numpy() for _, of_task in rows.groupby("task")[column]])
    return other_tasks(
        {
            family: [of_task.to_numpy() for _, of_task in of_family.groupby("task")[column]]
            for family, of_family in rows.groupby("family")
        }
    )


def tabulate_learning(rows):
    """Return mean gaps and failures by group of tasks, method, practice, action and noise."""
    keys, table = ["group", "name", "action", "practice", "motor_noise"], []
    for key, of in rows.groupby(keys, sort=False):
        row = dict(zip(keys, key, strict=True)) | _over_tasks(of, "gap").columns("gap")
        table.append(row | {"failures": int(of.failures.sum()), "runs": of.run_id.nunique()})
    return pd.DataFrame(table)


def tabulate_practice(rows, resamples=RESAMPLES):
    """Return how practice in noise changes the gap of each method.

    The change is the gap after practice with noise less the gap after practice without noise, both
    executed with noise 0.01. The p-value is for the mean over random tasks.
    """
    rows, table = rows[rows.motor_noise == AFTER], []
    for (group, action, name), of in rows.groupby(["group", "action", "name"], sort=False):
        wide = of.pivot_table("gap", ["family", "task", "run"], "practice", dropna=False)
        if wide.shape[1] < 2:
            continue
        change = (wide[AFTER] - wide[0.0]).dropna().rename("change").reset_index()
        row = {"group": group, "action": action, "name": name}
        row |= _over_tasks(change.assign(group=group), "change").columns("change")
        if group == "families":
            row["p"] = test_mean(change.groupby("task").change.mean().to_numpy(), resamples).p
        table.append(row)
    return pd.DataFrame(table)


def tabulate_learning_pairs(rows, resamples=RESAMPLES):
    """Return the verdict on each pair of :data:`JUDGED` methods on the random tasks, by action.

    *Before* is practice and execution without noise; *after* is both with noise 0.01.
    """
    tables = []
    for action, of_action in rows[rows.group == "families"].groupby("action"):
        ends = [
            of_action[(of_action.practice == level) & (of_action.motor_noise == level)].pivot_table(
                "gap", "task", "name"
            )
            for level in (0.0, AFTER)
        ]
        pairs = {
            f"{first}; {second}": Pair(*((end[first] - end[second]).to_numpy() for end in ends))
            for first, second in combinations(JUDGED, 2)
        }
        tables.append(judge(pairs, resamples).assign(action=action))
    return pd.concat(tables)
