"""Compare the signatures of each method with the learner's at the same gain."""

import numpy as np
import pandas as pd
from cells import MEASURES
from scales import drawn, weights_of

from coartic.estimates import Estimate


def at_equal_gain(cells):
    """Return the signatures of each cell, and those of the learner at the same gain.

    The learner's signatures are interpolated between its numbers of trials, and are 0 at gain 0.
    There is a row for each cell of another method. The learner's signatures are in columns that
    begin with ``learner``. Column ``status`` is ``compared``, ``gain below 0`` or ``beyond the
    learner``.
    """
    signatures = [name for name in MEASURES if name != "gain"]
    rows = []
    for _, of_task in cells.groupby("task", sort=False):
        learner = of_task[(of_task.name == "learner") & (of_task.gain > 0)].sort_values("gain")
        gains = np.append(0.0, learner.gain)
        for row in of_task[~of_task.name.isin(["learner", "compared"])].to_dict("records"):
            below, beyond = row["gain"] < 0, row["gain"] > gains[-1]
            row["status"] = (
                "gain below 0" if below else "beyond the learner" if beyond else "compared"
            )
            for name in signatures:
                at = np.interp(row["gain"], gains, np.append(0.0, learner[name]))
                row[f"learner {name}"] = at if row["status"] == "compared" else np.nan
            rows.append(row)
    return pd.DataFrame(rows)


def tabulate_equal(cells):
    """Tabulate how each method's signatures differ from the learner's at the same gain.

    The table has the difference and the ratio of means, and the numbers of cells that could not be
    compared. Intervals resample tasks within families. All families have the same weight.
    """
    equal, rows = at_equal_gain(cells[cells.task.str.contains("/")]), {}
    keys = ["name", "stages"]
    for group, of_group in (("all", equal), *equal.groupby("group", sort=False)):
        for (name, stages), of in of_group.groupby(keys, sort=False):
            row = {"group": group, "name": name, "stages": stages, "cells": len(of)}
            row |= of.status.value_counts().to_dict()
            for measure in MEASURES:
                if measure == "gain":
                    continue
                pairs = of[["group", measure, f"learner {measure}"]].dropna().sort_values("group")
                if len(pairs) < 3 or not pairs[measure].any():
                    continue
                weights = weights_of(pairs.group).to_numpy()
                both = pairs[[measure, f"learner {measure}"]].to_numpy()
                mine, learner = weights * both.T
                places = drawn(pairs.group)
                differences = (mine - learner)[places].sum(axis=1)
                with np.errstate(invalid="ignore"):  # 0 / 0 if no drawn task has the signature
                    ratios = mine[places].sum(axis=1) / learner[places].sum(axis=1)
                for word, value, each in (
                    ("difference", (mine - learner).sum(), differences),
                    ("ratio", mine.sum() / learner.sum(), ratios),
                ):
                    ends = np.quantile(each, [0.025, 0.975])
                    row |= Estimate(value, *ends).columns(f"{measure}_{word}")
                row[f"{measure}_tasks"] = len(pairs)
            rows[f"{group} {name} {stages}"] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")
