"""Answer question 2: does noise cost ticks because of the aim (at the rim) or of the postures?"""

import numpy as np
import pandas as pd
from order import NAMES, is_paper_condition
from rules import fragile

from coartic.estimates import Estimate

RESAMPLES = 9_999
TENTH = 0.1
"""Largest distance of an aim from the goal's centre (in radii) that counts as at the centre."""


def read(folder):
    """Return the executions of question 2, with a row for each run.

    Columns ``T0``, ``T1``, ``P0``, ... have the ticks for each kind of target (T, P, C) without
    noise (0) and with noise 0.01 (1). They are NaN if an execution failed.
    """
    rows = pd.concat([pd.read_csv(path) for path in sorted(folder.glob("*.csv"))])
    rows = rows[rows.setting.isna() & is_paper_condition(rows)]
    ticks = rows.ticks.where(rows.failures == 0)
    column = rows.target + np.where(rows.motor_noise > 0, "1", "0")
    table = rows.assign(ticks=ticks, column=column).pivot(  # noqa: PD010
        index=["run_id", "task", "method", "off"], columns="column", values="ticks"
    )
    return table.reset_index().assign(
        name=lambda of: of.method.map(NAMES), family=lambda of: of.task.str.partition("/")[0]
    )


def interval_of(families, number):
    """Return a function of the means of columns over tasks, with its 95 % interval.

    ``families`` has an array for each family, with a row for each task. ``number`` is a function of
    the means of the columns. For the interval, tasks are resampled within families. All families
    have the same weight.
    """
    rng, parts = np.random.default_rng(0), []
    for of_family in families:
        drawn = rng.integers(len(of_family), size=(RESAMPLES, len(of_family)))
        parts.append(of_family[drawn].mean(axis=1))
    low, high = np.percentile(number(np.mean(parts, axis=0).T), [2.5, 97.5])
    value = number(np.mean([of_family.mean(axis=0) for of_family in families], axis=0))
    return Estimate(float(value), float(low), float(high))


def tabulate_why(rows):
    """Return a table of the cost of noise by method.

    - ``cost``: cost of noise, in ticks per task;
    - ``share``: share of this cost that is saved by aiming at the centre; ``share_posture``: share
      that is saved by aiming at the posture of the hit;
    - ``centre`` and ``posture``: what these aims cost without noise;
    - ``cost_centre``: cost of noise if all movements aim at the centre;
    - ``verdict``: see :func:`rules.fragile`.
    """
    columns, table = ["T0", "T1", "P0", "P1", "C0", "C1"], {}
    for name, of_method in rows.groupby("name", sort=False):
        made = of_method.dropna(subset=columns)
        tasks = made.groupby(["family", "task"])[columns].mean()
        families = [of_family.to_numpy() for _, of_family in tasks.groupby("family")]

        def estimate(number, families=families):
            return interval_of(families, number)

        cost = estimate(lambda of: of[1] - of[0])
        share = estimate(lambda of: (of[1] - of[5]) / (of[1] - of[0]))
        row = cost.columns("cost") | share.columns("share")
        row |= estimate(lambda of: (of[1] - of[3]) / (of[1] - of[0])).columns("share_posture")
        row |= estimate(lambda of: of[4] - of[0]).columns("centre")
        row |= estimate(lambda of: of[2] - of[0]).columns("posture")
        row |= estimate(lambda of: of[5] - of[4]).columns("cost_centre")
        off = float(of_method.groupby("task").off.median().median())
        row |= {"off": off, "at_centre": off <= TENTH, "runs": len(made)}
        row |= {"left_out": len(of_method) - len(made), "verdict": fragile(share, cost)}
        table[name] = row
    return pd.DataFrame.from_dict(table, orient="index").rename_axis("name")
