"""How much coarticulation belongs to a gain, and does it matter who gains?

    coartic run studies/gain/suite.toml --out results/gain
    python studies/gain/study.py results/gain

writes results.csv (method means by family), equal.csv (differences to the learner at equal gain, a
row for each method and task), claims.csv, figure.svg and the page, README.md; without a folder
figure and page, of the stored tables.

The *gain* of a run is the number of ticks by which it is faster than the corrective process alone
with its best hands. At equal gain: on each task a method's signature, less the learner's signature
where the learner has this gain, interpolated over the learner's numbers of trials.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from coartic.analysis import all_of, figures, judge, load, mean_beyond, means, write_study
from coartic.analysis.judging import Finding

SIGNATURES = {"arm": "next goal nearer", "other arm": "idle hand nearer", "first": "first slower"}
LEARNER = "dual-process/EC"
NAMES = {
    LEARNER: "learner",
    "random-search": "random search",
    "hill-climbing": "hill climbing",
    "cma-es/bandit": "CMA-ES",
    "posture-qp/goals-ahead": "posture QP",
    "posture-based/two-goals": "posture planning",
    "trajectory-optimisation/path-length": "shortest path",
    "trajectory-optimisation/jerk": "minimum jerk",
    "trajectory-optimisation/acceleration": "minimum acceleration",
}
SAME_TICKS, SAME_SHARE = 1.0, 0.1
"""Differences within which signatures are the same, ticks and share of the distance; set before the
test instances were run."""
LEAST_CORRELATION = 0.6
"""Rank correlation of method means that counts as one curve, set before the runs."""


def measure_cells(study):
    """Measure gain and signatures, means over runs, a row for each method, setting and task."""
    runs = study.runs[study.runs.status == "ok"]
    runs = runs.assign(
        name=[next(name for key, name in NAMES.items() if method.startswith(key))
              for method in runs.method],
        group=runs.family.str.partition("/")[0],
        gain=runs.reward.astype(float) - runs.corrective_best,
        **{name: study.signature(name) for name in SIGNATURES},
    )  # fmt: skip
    # A method without a grid of trials has one setting, whatever trials it makes.
    settled = runs.groupby("name").setting.transform("nunique") == 1
    runs["trials"] = runs.trials.where(~settled, 0)
    keys = ["group", "task", "name", "trials"]
    return runs.groupby(keys, sort=False)[["gain", *SIGNATURES]].mean().reset_index()


def at_equal_gain(cells, how="linear"):
    """Return differences to the learner at equal gain, a row for each method, setting and task.

    ``status``: ``compared``, ``gain below 0`` or ``beyond the learner`` (no number of its trials
    gains as much). ``how``: ``linear`` between numbers of trials, with 0 at gain 0, or ``nearest``.
    """
    rows = []
    for task, of_task in cells.groupby("task", sort=False):
        learner = of_task[of_task.name == "learner"].sort_values("gain")
        learner = learner[learner.gain > 0]
        for row in of_task[of_task.name != "learner"].to_dict("records"):
            most = learner.gain.max() if len(learner) else 0.0
            status = "gain below 0" if row["gain"] < 0 else "compared"
            status = "beyond the learner" if row["gain"] > most else status
            out = {key: row[key] for key in ("group", "task", "name", "trials", "gain")}
            for name in SIGNATURES:
                known = learner.dropna(subset=name)
                there = status == "compared" and len(known) and known.gain.max() >= row["gain"]
                gains = np.append(0.0, known.gain)
                values = np.append(0.0, known[name])
                at = (np.interp(row["gain"], gains, values) if how == "linear"
                      else values[np.abs(gains - row["gain"]).argmin()])  # fmt: skip
                out[name] = row[name] - at if there else np.nan
            rows.append(out | {"status": status})
    return pd.DataFrame(rows)


def by_task(equal, name, column):
    """Return a method's differences, a value for each task: means over its numbers of trials."""
    of_method = equal[(equal.name == name) & (equal.status == "compared")]
    return of_method.groupby("task", sort=False)[column].mean().dropna()


def correlations(cells):
    """Return the rank correlation of method means between gain and the next goal nearer, by
    family, over the methods of the family with each number of trials."""
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
            "At equal gain CMA-ES has a slower first movement than the learner, by more than a "
            "tick.",
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
            row = {"group": group, "name": name, "how": how, "cells": len(of_method),
                   "below_0": counts.get("gain below 0", 0),
                   "beyond": counts.get("beyond the learner", 0)}  # fmt: skip
            for column in SIGNATURES:
                values = by_task(of_method, name, column)
                if len(values):
                    mean = means(values.to_frame().assign(all=0), ["all"], [column]).iloc[0]
                    row |= {f"{column}_tasks": len(values), f"{column}_median": values.median()}
                    row |= {
                        f"{column}{end}": mean[f"{column}{end}"] for end in ("", "_low", "_high")
                    }
            rows[f"{group} {name} {how}"] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


@figures.styled
def draw(table):
    """Signatures against gain: a line for each method over its numbers of trials, all tasks."""
    figure, panels = figures.panels((1, len(SIGNATURES)), (figures.TWO, 3.0))
    rows = table[table.group == "all"]
    for axes, column in zip(panels, SIGNATURES, strict=True):
        for mark, color, (name, of_method) in zip(
            "os^Dv<>pP", [*figures.PALETTE, figures.GREY, "black", "#8c564b"],
            rows.groupby("name", sort=False), strict=False,
        ):  # fmt: skip
            axes.plot(of_method.gain, of_method[column], marker=mark, markersize=4, linewidth=1,
                      color=color, label=name)  # fmt: skip
        axes.axhline(0, color=figures.GREY, linewidth=0.5)
        axes.set_xlabel("gain (ticks)")
        axes.set_title(SIGNATURES[column])
    figures.letters(panels)
    figures.legend(figure, panels[0].get_legend_handles_labels()[0], 5)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    cells = measure_cells(study)
    linear, nearest = (at_equal_gain(cells, how) for how in ("linear", "nearest"))
    equal = pd.concat([tabulate_equal(linear, "linear"), tabulate_equal(nearest, "nearest")])
    return {"results": tabulate(cells), "equal": equal, "claims": judge_claims(cells, linear),
            "cells": cells.set_index("task")}  # fmt: skip


if __name__ == "__main__":
    write_study(Path(__file__).parent, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)
