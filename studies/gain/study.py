"""Measure how much coarticulation belongs to a gain, and whether it matters who gains.

    coartic run studies/gain/suite.toml --out results/gain
    python studies/gain/study.py results/gain

The *gain* of a run is the number of ticks by which it is faster than the corrective process alone
with its best hands. At equal gain: on each task a method's signature, less the learner's signature
where the learner has this gain, interpolated over the learner's numbers of trials.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from coartic.analysis import all_of, figures, judge, load, mean, mean_beyond, means, write_study
from coartic.analysis.judging import Finding

SIGNATURES = {"arm": "next goal nearer", "other arm": "idle hand nearer", "first": "first slower"}
BELOW, BEYOND = "gain below 0", "beyond the learner"
NAMES = {
    "dual-process/EC": "learner",
    "random-search": "random search",
    "hill-climbing": "hill climbing",
    "cma-es/bandit": "CMA-ES",
    "posture-qp/goals-ahead": "posture QP",
    "posture-based/two-goals": "posture planning",
    "trajectory-optimisation/path-length": "shortest path",
    "trajectory-optimisation/jerk": "minimum jerk",
    "trajectory-optimisation/acceleration": "minimum acceleration",
}
SAME_TICKS, SAME_SHARE, LEAST_CORRELATION = 1.0, 0.1, 0.6
"""Differences that count as none, in ticks and in shares of the distance, and the rank correlation
that counts as one curve; set before the test instances were run."""


def measure_cells(study):
    """Measure gain and signatures, means over runs, a row for each method, setting and task."""
    runs = study.runs[study.runs.status == "ok"]
    runs = runs.assign(
        name=[next(name for key, name in NAMES.items() if method.startswith(key))
              for method in runs.method],
        group=runs.family.str.partition("/")[0],
        gain=runs.reward.astype(float) - runs.corrective_best,
        whole=study.signature("whole"),
        **{name: study.signature(name) for name in SIGNATURES},
    )  # fmt: skip
    # A method without a grid of trials has one setting, whatever trials it makes.
    runs["trials"] *= runs.groupby("name").setting.transform("nunique") > 1
    keys = ["group", "task", "name", "trials"]
    return runs.groupby(keys, sort=False)[["gain", "whole", *SIGNATURES]].mean().reset_index()


def at_equal_gain(cells, how="linear"):
    """Return differences to the learner at equal gain, a row for each method, setting and task.

    ``how``: ``linear`` between numbers of trials, with 0 at gain 0; ``nearest`` number of trials;
    or ``same hands``, linear, from the corrective process with each run's own hands.
    """
    gain = "whole" if how == "same hands" else "gain"
    rows = []
    for _, of_task in cells.groupby("task", sort=False):
        learner = of_task[(of_task.name == "learner") & (of_task[gain] > 0)].sort_values(gain)
        curves = {name: np.vstack([[0.0, 0.0], learner[[gain, name]].dropna()]).T
                  for name in SIGNATURES}  # fmt: skip
        most = learner[gain].max() if len(learner) else -np.inf
        for row in of_task[of_task.name != "learner"].to_dict("records"):
            status = BELOW if row[gain] < 0 else BEYOND if row[gain] > most else "compared"
            out = {key: row[key] for key in ("group", "task", "name", "trials")}
            for name, (gains, values) in curves.items():
                covered = status == "compared" and len(gains) > 1 and gains[-1] >= row[gain]
                nearest = values[np.abs(gains - row[gain]).argmin()]
                at = nearest if how == "nearest" else np.interp(row[gain], gains, values)
                out[name] = row[name] - at if covered else np.nan
            rows.append(out | {"status": status})
    return pd.DataFrame(rows)


def by_task(equal, name, column):
    """Return a method's differences in ``column``, a value for each task: means over its numbers of
    trials; tasks without a value are left out."""
    of_method = equal[equal.name == name]
    return of_method.groupby("task", sort=False)[column].mean().dropna()


def correlations(cells):
    """Return the rank correlation of method means between gain and next goal nearer, by family."""
    table = cells.groupby(["group", "name", "trials"])[["gain", "arm"]].mean().reset_index()
    return {group: float(stats.spearmanr(rows.gain, rows.arm).statistic)
            for group, rows in table.groupby("group", sort=False)}  # fmt: skip


def judge_claims(cells, equal):
    """The predictions, as they were registered before any test instance was run."""

    def same(name, column, bound, unit):
        values = by_task(equal, name, column)
        sentence = f"{name} {SIGNATURES[column]} by {{}} {unit} more than the learner"
        return all_of(mean_beyond(sentence, values, -bound),
                      mean_beyond(sentence, values, bound, "less"))  # fmt: skip

    found = correlations(cells)
    words = ", ".join(f"{group} {value:.2f}" for group, value in found.items())
    test = "one-tailed bootstrap tests over random tasks of differences at equal gain"
    return judge({
        "climbing-prepares-arms-alike": (
            "At equal gain hill climbing leaves the next goal as near as the learner, to a tick.",
            f"{test}: above −{SAME_TICKS:g} and below {SAME_TICKS:g} tick",
            same("hill climbing", "arm", SAME_TICKS, "ticks"),
        ),
        "climbing-prepares-idle-hands-alike": (
            "At equal gain hill climbing brings the idle hand as near as the learner, to a tenth "
            "of the distance.",
            f"{test}: above −{SAME_SHARE:g} and below {SAME_SHARE:g}",
            same("hill climbing", "other arm", SAME_SHARE, "of the distance"),
        ),
        "random-search-prepares-less": (
            "At equal gain random search leaves the next goal less near than the learner.",
            f"{test}: below 0",
            mean_beyond("random search next goal nearer by {} ticks more than the learner",
                        by_task(equal, "random search", "arm"), 0.0, "less"),
        ),
        "cma-es-sacrifices-more": (
            "At equal gain CMA-ES slows the first movement more than the learner, by a tick.",
            f"{test}: above {SAME_TICKS:g} tick",
            mean_beyond("CMA-ES first slower by {} ticks more than the learner",
                        by_task(equal, "CMA-ES", "first"), SAME_TICKS),
        ),
        "one-curve": (
            f"In every family the rank correlation of method means between gain and next goal "
            f"nearer is at least {LEAST_CORRELATION:g}.",
            "counted, not tested",
            Finding(min(found.values()) >= LEAST_CORRELATION, f"rank correlations: {words}"),
        ),
    })  # fmt: skip


def tabulate(cells):
    """Tabulate means over tasks of each method and number of trials, by family and over all."""
    every = pd.concat([cells.assign(group="all"), cells])
    table = means(every, ["group", "name", "trials"], ["gain", *SIGNATURES])
    table.index = table.group + " " + table["name"] + " " + table.trials.astype(int).astype(str)
    return table.rename_axis("row").rename(columns={"rows": "tasks"})


def tabulate_equal(equal, how):
    """Tabulate differences at equal gain: means and medians over tasks, with what is left out."""
    rows = {}
    for group, of_group in (("all", equal), *equal.groupby("group", sort=False)):
        for name, of_method in of_group.groupby("name", sort=False):
            counts = of_method.status.value_counts()
            row = {"group": group, "name": name, "how": how, "cells": len(of_method)}
            row |= {name: counts.get(name, 0) for name in (BELOW, BEYOND)}
            for column in SIGNATURES:
                values = by_task(of_method, name, column)
                if len(values):
                    row |= {f"{column}_tasks": len(values), f"{column}_median": values.median()}
                    row |= mean(values).columns(column)
            rows[f"{group} {name} {how}"] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


@figures.styled
def draw(table):
    """Signatures against gain: a line for each method over its numbers of trials, all tasks."""
    figure, panels = figures.panels((1, len(SIGNATURES)), (figures.TWO, 3.0))
    rows = table[table.group == "all"]
    colors = [*figures.PALETTE, figures.GREY, "black", "saddlebrown"]
    looks = dict(zip(NAMES.values(), zip("os^Dv<>pP", colors, strict=False), strict=False))
    for axes, column in zip(panels, SIGNATURES, strict=True):
        for name, of_method in rows.groupby("name", sort=False):
            mark, color = looks[name]
            axes.plot(of_method.gain, of_method[column], marker=mark, color=color, label=name)
        axes.axhline(0, color=figures.GREY, linewidth=0.5)
        axes.set_xlabel("gain (ticks)")
        axes.set_title(SIGNATURES[column])
    figures.legend(figure, panels[0].get_legend_handles_labels()[0], 3)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    cells = measure_cells(study)
    equal = {how: at_equal_gain(cells, how) for how in ("linear", "nearest", "same hands")}
    return {
        "results": tabulate(cells),
        "equal": pd.concat([tabulate_equal(each, how) for how, each in equal.items()]),
        "claims": judge_claims(cells, equal["linear"]),
        "cells": cells.set_index("task"),
    }


if __name__ == "__main__":
    write_study(Path(__file__).parent, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)
