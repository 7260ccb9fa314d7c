"""Count how many shipped best known rewards are proven to be the optimum, or nearly.

    PYTHONPATH=studies python studies/optima/study.py results/optima

Tables are made from the shipped data, and from the log of ``prove.py`` in the folder (the effort).
"""

import sys
from pathlib import Path

import pandas as pd
import shipped

from coartic.analysis import figures
from stored import stored_picture, write_tables

BOUNDS = {
    "proven": "proven optimal", "within_1": "bound within 1 %", "within_5": "within 5 %",
    "within_20": "within 20 %", "instances": "farther",
}  # fmt: skip
"""Columns of the table that the figure shows, with their labels."""


def distances(folder):
    """Return a table with the distance of each bound from the best known reward, by task.

    Distances are in per cent of the reward. ``seconds`` is the CPU time in the log of ``folder``.
    """
    entries = [entry for key, entry in shipped.read().items() if key[1:] == shipped.FREE]
    bounds = pd.DataFrame(entries).set_index("task")[["hands", "reward", "bound"]]
    bounds["distance"] = 100 * (bounds.bound - bounds.reward) / -bounds.reward
    bounds["family"] = bounds.index.str.extract("(.*)/", expand=False)
    log = pd.DataFrame(shipped.read_log(folder), columns=["task", "seconds", "base", "other_arm"])
    log = log.query("base == 'task' and other_arm == 'free'")
    return bounds.assign(
        goals=bounds.pop("hands").str.len(), seconds=log.groupby("task").seconds.sum()
    )


def count(bounds):
    """Return the numbers of bounds within each distance, and the CPU time spent on them.

    Rows are for the paper's tasks, for each family and number of goals, and for all families.
    """
    drawn = bounds[bounds.family.notna()]
    groups = {"the paper's tasks": bounds[bounds.family.isna()]}
    for (family, goals), group in drawn.groupby(["family", "goals"]):
        groups[f"{family}, {goals} goals"] = group
    groups["all families"] = drawn
    table = pd.DataFrame({name: pd.Series({
        "instances": len(group),
        "proven": (group.distance == 0).sum(),
        **{f"within_{most}": (group.distance <= most).sum() for most in (1, 5, 20)},
        "seconds": group.seconds.sum(),
    }) for name, group in groups.items()}).T  # fmt: skip
    return table.rename_axis("row")


def tabulate(folder):
    """Return the tables by name: ``results`` has counts, and ``open`` the open tasks.

    A task is open if its bound is farther than 5 % from the best known reward, or if it has none.
    """
    bounds = distances(folder)
    return {
        "results": count(bounds),
        "open": bounds[~(bounds.distance <= 5)].drop(columns="seconds"),
    }


@figures.styled
def draw(table):
    """Draw a bar for each row: the shares of instances by the distance of their bounds."""
    figure, (axes,) = figures.panels((1, 1), (figures.TWO, 4.2))
    shares = 100 * table[[*BOUNDS]].div(table.instances, axis=0).iloc[::-1]
    shades = "0.9", "0.8", "0.7", "0.5", "0.2"
    for shade, (column, label) in zip(shades, reversed(BOUNDS.items()), strict=True):
        axes.barh(shares.index, shares[column], color=shade, label=label)
    axes.set(xlabel="instances (%)", xlim=(0, 100))
    figures.legend(figure, axes.get_legend_handles_labels()[0][::-1], len(BOUNDS))
    return figure


if __name__ == "__main__":
    here = Path(__file__).parent
    write_tables(here, tabulate(Path(sys.argv[1])) if sys.argv[1:] else {})
    results = pd.read_csv(here / "results.csv", index_col=0)
    (here / "figure.svg").write_bytes(stored_picture(draw, results))
