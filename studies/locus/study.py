"""Measure how the first movement depends on where later goals are.

    coartic run studies/locus/suite.toml
    python studies/locus/study.py results/locus

writes results.csv, figure.svg and the page, README.md; without a folder figure and page, of the
stored table.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from coartic.analysis import figures, load, write_study
from coartic.analysis.statistics.hypotheses import bootstrap_test

RANDOM_SEARCH = "random-search"  # which methods that select one of their trials have to exceed
SELECTS = ["dual-process/EC1", "cma-es/bandit"]
DRAWN = {  # methods in the figure, and their names
    "dual-process/EC1": "learner",
    "random-search": "random search",
    "cma-es/bandit": "CMA-ES",
    "posture-qp/goals-ahead": "posture QP",
    "posture-based/two-goals": "postures for two goals",
    "trajectory-optimisation/squared-displacement": "minimum squared displacement",
}


def measure_runs(study):
    """Return the runs in the order of the suite, with the goal that is ``moving`` and ``by`` how
    much upwards (length unit)."""
    moved = study.runs.task.str.extract(r"goal(?P<moving>\d)_0_(?P<by>.+)")
    runs = study.runs.assign(moving=moved.moving.astype(int), by=moved.by.astype(float))
    runs = runs.assign(first=study.signature("first"), total=0 - study.signature("whole"))
    cells = dict(list(runs[runs.status == "ok"].groupby(["task", "method"])))
    return pd.concat([cells[key] for key in study.cells])


def tabulate(runs):
    """Means over runs of a method on a task, ticks more than the corrective process takes.

    ``first``: for the first movement. ``total``: for all of them. ``first_p``: of the two-sided
    bootstrap test of ``first`` against random search, for methods that select a trial.
    """
    groups = runs.assign(row=runs.task + " " + runs.method).groupby("row", sort=False)
    table = groups[["method", "moving", "by"]].first().assign(runs=groups.size())
    first = dict(list(groups["first"]))
    table["first"] = groups["first"].mean()
    table["first_p"] = [
        bootstrap_test(first[row], first[row.replace(method, RANDOM_SEARCH)], "two-sided").p
        if method in SELECTS else np.nan for row, method in table.method.items()
    ]  # fmt: skip
    return table.assign(total=groups.total.mean())


@figures.styled
def draw(table):
    """First movement by the height of goal 2 (a) and of goal 3 (b), a line for each method."""
    figure, panels = figures.panels((1, 2), (figures.TWO, 2.8), sharey=True)
    shown = table.assign(name=table.method.map(DRAWN)).dropna(subset="name")
    for axes, moving in zip(panels, (2, 3), strict=True):
        figures.means(axes, shown[shown.moving == moving], x="by", y="first", by="name")
        axes.set_xlabel(f"goal {moving} moved upwards (length unit)")
    panels[0].set_ylabel("first movement slower (ticks)")
    figures.legend(figure, panels[0].get_legend_handles_labels()[0], 3)
    figures.letters(panels)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    return {"results": tabulate(measure_runs(study))}


if __name__ == "__main__":
    write_study(Path(__file__).parent, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)
