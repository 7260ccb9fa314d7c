"""Resistance and aggressiveness of goals: are they correlated?

    coartic run studies/resist/suite.toml --family-file studies/resist/neighbours.v1.toml
    python studies/resist/study.py results/resist

writes results.csv, claims.csv, figure.svg and the page, README.md; without a folder figure and
page, of the stored tables.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from coartic.analysis import all_of, figures, judge, load, mean_beyond, means, write_study

LEARNER, ALONE = "dual-process/EC1", "corrective-alone/given"
METHODS = {
    LEARNER: "learner EC1",
    ALONE: "corrective process alone",
    "posture-qp/current-goal": "posture QP, current goal",
    "posture-qp/goals-ahead": "posture QP, goals ahead",
    "trajectory-optimisation/path-length": "shortest-path plan",
}
"""Names of the methods: the learner, reactive control, and the planner of the shortest path."""
PLACES = 3
"""Places to which each goal is moved."""
SHUFFLES = 999
"""Orders of the slopes of a task by which chance is estimated."""
TONGUES = 0.5
"""Bound on rank correlations. Resistance and aggressiveness of tongue movements are said to be
highly positively correlated, without a number in the abstract; half of a perfect correlation is a
low bound for that."""


def measure_tasks(study):
    """Resistance against aggressiveness: a row for each method on each task whose goals were moved.

    ``carried`` and ``ahead``: mean slopes of postures on the goals before and after them. ``rho``:
    rank correlation over inner goals. ``chance``: its mean where the slopes are in any order.
    """
    runs = study.runs[study.runs.reward.notna()]
    moved = runs.task.str.extract(r"(?P<base>.+)\.goal(?P<goal>\d+)_")
    moved = runs[["task", "method", "goals"]].join(moved.astype({"goal": int})).drop_duplicates()
    rows = []
    for (_, method), of_method in moved.groupby(["base", "method"], sort=False):
        if len(of_method) < PLACES * of_method.goals.iloc[0]:
            continue  # a goal was not moved, or a run failed
        task = study.tasks[of_method.task.iloc[0]]
        carried, ahead = measure_slopes(study, method, of_method)
        rows.append({
            "method": method,
            "links": f"{len(task.robot.right_links)} links",
            "base": "base locked" if task.locked_base else "base free",
            "carried": carried.mean(),
            "ahead": ahead.mean(),
            "rho": correlate(carried[None], ahead[None]).iloc[0],
            "chance": correlate_by_chance(carried, ahead),
        })  # fmt: skip
    frame = pd.DataFrame(rows)
    return frame.assign(beyond=frame.rho - frame.chance)


def measure_slopes(study, method, moved):
    """How far postures of a method follow neighbouring goals, per length unit, each ``(G - 1,)``.

    Of the posture at goals 2 to G on the place of the goal before, and of that at goals 1 to G - 1
    on the place of the next goal; of the learner by its noiseless replays.
    """
    sizes = []
    for goal, of_goal in moved.groupby("goal"):
        postures = [study.configurations(name, method, replay=method == LEARNER).mean(axis=0)
                    for name in of_goal.task]  # fmt: skip
        places = [study.tasks[name].goals[goal - 1] for name in of_goal.task]
        sizes.append(slope_sizes(np.array(postures), np.array(places)))
    by_place = np.array(sizes).T  # posture at the goal of the row, place of the goal of the column
    return by_place.diagonal(-1), by_place.diagonal(1)


def slope_sizes(postures, places):
    """Sizes of the regression of postures ``(n, G, dof)`` on places ``(n, 2)`` of a goal, ``(G,)``.

    By least squares: at each goal the root of the sum of squared slopes over joints and both
    coordinates, length unit and rad mixed, per length unit.
    """
    weights = np.linalg.pinv(places - places.mean(axis=0))
    return np.sqrt((np.tensordot(weights, postures, axes=1) ** 2).sum(axis=(0, 2)))


def correlate(carried, ahead):
    """Rank correlation of resistance and aggressiveness over the inner goals, of rows of slopes.

    A goal's resistance is minus the mean slope of its posture on its neighbours' places, its
    aggressiveness the mean slope of its neighbours' postures on its own.
    """
    resistance = pd.DataFrame(-(carried[:, :-1] + ahead[:, 1:]) / 2)
    aggressiveness = pd.DataFrame((carried[:, 1:] + ahead[:, :-1]) / 2)
    return resistance.rank(axis=1).corrwith(aggressiveness.rank(axis=1), axis=1)


def correlate_by_chance(carried, ahead):
    """Mean of that of a task's slopes in many orders, each direction by itself."""
    rng = np.random.default_rng(0)
    shuffled = [rng.permuted(np.tile(slopes, (SHUFFLES, 1)), axis=1) for slopes in (carried, ahead)]
    return correlate(*shuffled).mean()


def tabulate(tasks):
    """Correlation of resistance and aggressiveness: means over tasks, of all and by links and
    base."""
    tasks = tasks.sort_values(
        "method", key=lambda names: names.map([*METHODS].index), kind="stable"
    )
    parts = [tasks.assign(group=group).sort_values("group", kind="stable")
             for group in ("all", tasks.links, tasks.base)]  # fmt: skip
    columns = ["carried", "ahead", "rho", "chance", "beyond"]
    table = means(pd.concat(parts), ["group", "method"], columns)
    table = table.rename(columns={"rows": "tasks"}).drop(columns=["chance_low", "chance_high"])
    return table.set_index((table.group + " " + table.method).rename("row"))


def judge_claims(tasks):
    """The claims, as they were registered before the random tasks were run."""

    def below(method, bound=0.0):
        sentence = f"{METHODS[method]}: {{}} beyond chance"
        return mean_beyond(sentence, tasks.beyond[tasks.method == method], bound, "less")

    test = (
        "one-tailed bootstrap tests over random tasks of the rank correlation of resistance and "
        "aggressiveness over inner goals, less that of the same slopes in any order: below "
    )
    return judge({
        "learner-aggressiveness-without-resistance": (
            "In the learner, resistance and aggressiveness are less correlated than by chance.",
            f"{test}0 for the learner, by replays",
            below(LEARNER),
        ),
        "reaction-aggressiveness-without-resistance": (
            "The same holds where nothing is learned or planned, in the corrective process alone.",
            f"{test}0 for the corrective process",
            below(ALONE),
        ),
        "not-as-in-tongues": (
            "In no method does the correlation exceed chance by 0.5, our low bound for tongues.",
            f"{test}{TONGUES:g} for every method",
            all_of(*(below(method, TONGUES) for method in METHODS)),
        ),
    })  # fmt: skip


@figures.styled
def draw(table):
    """Correlations beyond chance by method: of all tasks, and by links."""
    figure, panels = figures.panels((1, 2), (figures.TWO, 2.8), sharey=True)
    table = table.assign(name=table.method.map(METHODS))
    sizes = [group for group in table.group.unique() if group.endswith("links")]
    for axes, groups in zip(panels, (["all"], sizes), strict=True):
        rows = table[table.group.isin(groups)]
        rows = rows.assign(place=rows.group.map(groups.index) - 0.11 * len(METHODS) / 2)
        figures.means(axes, rows, x="place", y="beyond", by="name", shift=0.11, bars=None,
                      linestyle="", markersize=4)  # fmt: skip
        axes.axhline(0, color=figures.GREY, linewidth=0.8)
        axes.set_xlim(-0.5, len(groups) - 0.5)
        axes.set_xticks(range(len(groups)), [group.replace("all", "all tasks") for group in groups])
    panels[0].set_ylabel("correlation beyond chance")
    figures.letters(panels)
    figures.legend(figure, panels[0].get_legend_handles_labels()[0], 3)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    tasks = measure_tasks(study)
    return {"results": tabulate(tasks), "claims": judge_claims(tasks)}


if __name__ == "__main__":
    write_study(Path(__file__).parent, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)
