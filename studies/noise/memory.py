"""Answer whether search should keep targets or postures if movements are noisy."""

import numpy as np
import pandas as pd
from rules import RESAMPLES, judge_levels

from coartic.analysis.statistics import other_tasks

MAX_STAGES = 1_000


def read_memory(rows, hands):
    """Return ticks by task, number of stages, content of memory (``keep``) and noise.

    Random search has a value for each hand sequence in which the learner's runs end. The value of a
    task is their mean, weighted by the numbers of these runs. ``rows`` has the executions of random
    search, and ``hands`` the number of the learner's runs (``count``) by task and hand sequence.
    """
    family = rows.task.str.partition("/")[0].where(rows.task.str.contains("/"))
    rows = rows.assign(family=family, group=np.where(family.isna(), "paper", "families"))
    rows["hands"] = rows.setting.str.extract(r"hands=(\w+)")[0]
    rows["stages"] = rows.setting.str.extract(r"stages=(\d+)")[0].fillna("1").astype(int)
    rows["keep"] = rows.setting.str.extract(r"keep=(\w+)")[0].fillna("postures")
    counts = hands.reset_index().set_index(["task", "hands"])["count"]
    shares = (counts / counts.groupby("task").sum()).rename("weight")
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
    random = difference[(difference.group == "families") & (difference.stages == MAX_STAGES)]
    by_level = {level: of.ticks.to_numpy() for level, of in random.groupby("motor_noise")}
    return pd.DataFrame(rows), judge_levels(by_level, resamples).rename_axis("motor_noise")
