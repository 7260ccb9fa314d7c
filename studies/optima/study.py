"""Count how many shipped best known rewards are proven to be the optimum, or nearly.

    python studies/optima/study.py

Writes results.csv, figure.svg and the page, README.md, of the shipped data.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import shipped

from coartic.analysis import figures, write_study

BOUNDS = {
    "proven": "proven optimal", "within_1": "bound within 1 %", "within_5": "within 5 %",
    "within_20": "within 20 %", "bounded": "farther",
}  # fmt: skip
"""Columns of the table that the figure shows, each with its label."""


def count(distances):
    """Return how many instances have a bound at each distance from their reward, per cent."""
    return {
        "instances": len(distances),
        "proven": (distances == 0).sum(),
        **{f"within_{most}": (distances <= most).sum() for most in (1, 5, 20)},
        "bounded": np.isfinite(distances).sum(),
        "median": distances.median(),
    }


def tabulate():
    """Return the counts of the paper's tasks, of each family and of all families.

    The distance of an instance without a bound is infinite.
    """
    entries = [entry for key, entry in shipped.read().items() if key[1:] == shipped.FREE]
    known = pd.DataFrame(entries)
    distance = (100 * (known.bound - known.reward) / -known.reward).fillna(np.inf)
    family = known.task.str.extract("(.*)/", expand=False)
    groups = {"the paper's tasks": distance[family.isna()]}
    groups |= dict([*distance.groupby(family)])
    groups["all families"] = distance[family.notna()]
    rows = {name: count(distances) for name, distances in groups.items()}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


@figures.styled
def draw(table):
    """Share of instances by the distance of their bounds, a bar for each family."""
    figure, (axes,) = figures.panels((1, 1), (figures.TWO, 2.2))
    shares = 100 * table[[*BOUNDS]].div(table.instances, axis=0).iloc[::-1]
    shades = "0.9", "0.8", "0.7", "0.5", "0.2"
    for shade, (column, label) in zip(shades, reversed(BOUNDS.items()), strict=True):
        axes.barh(shares.index, shares[column], color=shade, label=label)
    axes.set_xlabel("instances (%)")
    axes.set_xlim(0, 100)
    figures.legend(figure, axes.get_legend_handles_labels()[0][::-1], len(BOUNDS))
    return figure


if __name__ == "__main__":
    write_study(Path(__file__).parent, {"results": tabulate()}, draw)
