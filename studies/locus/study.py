"""Does the way to a goal depend on where the goal before was, and where the next will be?

    coartic run studies/locus/suite.toml
    python studies/locus/study.py results/locus

writes results.csv, slopes.csv, figure.svg and the page, README.md; without a folder figure and
page, of the stored tables.

Postures at a goal are regressed on the height of its neighbour, as a locus equation of speech
regresses a consonant's formant on the vowel that follows (Lindblom 1963; Sussman et al. 1991).
"""

import sys
from itertools import permutations, product
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from coartic import load_task
from coartic.analysis import beyond_p, figures, load, write_study
from coartic.analysis.statistics.hypotheses import bootstrap_test, holm

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
HEIGHTS = np.array([-1.5, -1.0, -0.5, 0.0, 0.5, 1.0])
WEIGHTS = (HEIGHTS - HEIGHTS.mean()) / ((HEIGHTS - HEIGHTS.mean()) ** 2).sum()
"""Weights of values at these heights; the weighted sum is the least-squares slope."""
BESIDE = [(1, 2), (3, 2), (2, 3), (2, 1)]  # a goal, and its neighbour that moves


def measure_runs(study):
    """Runs in the order of the suite, with the goal that is ``moving``, ``by`` how much upwards,
    and the postures at all goals, ``q``."""
    moved = study.runs.task.str.extract(r"goal(?P<moving>\d)_0_(?P<by>.+)")
    runs = study.runs.assign(moving=moved.moving.astype(int), by=moved.by.astype(float))
    runs = runs.assign(first=study.signature("first"), total=0 - study.signature("whole"))
    cells = dict(list(runs[runs.status == "ok"].groupby(["task", "method"])))
    return pd.concat([cells[key].assign(q=[*study.configurations(*key)]) for key in study.cells])


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


def configurations_at(runs, method, goal, moving):
    """Postures of a method at a goal, ``(runs, dof)`` for each height of its neighbour; tasks in
    which a goal is moved by 0 are all the same."""
    there = runs[(runs.method == method) & ((runs.moving == moving) | (runs.by == 0))]
    return [np.array([q[goal - 1] for q in there.q[there.by == height]]) for height in HEIGHTS]


def regress(postures):
    """Slopes of mean postures, as runs of one task are no independent evidence of a line.

    ``norm``: length of the vector of all joints' slopes (length unit and rad mixed, per length
    unit; biased upwards), with ``p_holm``, yet uncorrected, of the test that permutes postures: at
    least 2/6!. ``joint``: the one that changes most, with its ``slope`` and Student's interval.
    """
    means = np.array([at_height.mean(axis=0) for at_height in postures])
    means = np.where(np.ptp(means, axis=0) > 1e-9, means - means.mean(axis=0), 0)  # rounding
    slopes = WEIGHTS @ means
    norm = np.linalg.norm(slopes)
    permuted = np.linalg.norm(np.array([*permutations(WEIGHTS)]) @ means, axis=1)
    joint = len(slopes) - 1 - np.abs(slopes[::-1]).argmax()
    error = np.nan_to_num(stats.linregress(HEIGHTS, means[:, joint]).stderr)  # NaN without change
    low, high = slopes[joint] + stats.t.ppf([0.025, 0.975], len(HEIGHTS) - 2) * error
    row = {"norm": norm, "p_holm": (permuted >= norm * (1 - 1e-9)).mean(), "joint": joint}
    return row | {"slope": slopes[joint], "slope_low": low, "slope_high": high}


def tabulate_slopes(runs):
    """Tabulate how the posture at a goal follows a neighbouring goal that moves, as :func:`regress`
    measures it.

    ``p_holm`` is corrected over the tests of a method; ``p_random_search`` is p of the test that
    postures follow the neighbour more than in random search.
    """
    rows = {}
    for (goal, moving), method in product(BESIDE, runs.method.unique()):
        kind = "anticipatory" if goal < moving else "carry-over"
        row = {"method": method, "goal": goal, "moving": moving, "kind": kind}
        ours, random_search = (
            configurations_at(runs, who, goal, moving) for who in (method, RANDOM_SEARCH)
        )
        row |= {"runs": sum(map(len, ours)), **regress(ours)}
        if method in SELECTS:
            rng = np.random.default_rng([0, goal, moving])
            row["p_random_search"] = beyond_p(ours, random_search, rng, contrast=WEIGHTS)
        rows[f"ascending {method} goal {goal} of {moving} right"] = row
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")
    names, p_holm = load_task("ascending").robot.joint_names, table.groupby("method").p_holm
    return table.assign(joint=[names[k] for k in table.joint], p_holm=p_holm.transform(holm))


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
    runs = measure_runs(study)
    return {"results": tabulate(runs), "slopes": tabulate_slopes(runs)}


if __name__ == "__main__":
    write_study(Path(__file__).parent, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)
