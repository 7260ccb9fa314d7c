"""Count how many shipped best known rewards are proven to be the optimum, or nearly.

    python studies/optima/study.py results/optima

Writes results.csv, open.csv, figure.svg and the pages README.md and open.md, of the shipped data
and of the effort that the log of ``prove.py`` has; without a folder figure and pages alone.
"""

import sys
from pathlib import Path

import pandas as pd
import shipped

from coartic.analysis import figures, fill_page, write_study

FOLDER = Path(__file__).parent
BOUNDS = {
    "proven": "proven optimal", "within_1": "bound within 1 %", "within_5": "within 5 %",
    "within_20": "within 20 %", "instances": "farther",
}  # fmt: skip
"""Columns of the table that the figure shows, each with its label."""
EFFORT = ["seconds", "nodes"]


def distances():
    """Return the distance of each bound from the best known reward, per cent of it, by task."""
    entries = [entry for key, entry in shipped.read().items() if key[1:] == shipped.FREE]
    known = pd.DataFrame(entries).set_index("task")[["hands", "reward", "bound"]]
    known["distance"] = 100 * (known.bound - known.reward) / -known.reward
    known["family"] = known.index.str.extract("(.*)/", expand=False)
    return known.assign(goals=known.hands.str.len())


def count(known):
    """Return how many bounds are at each distance: of the paper's tasks, of each family and number
    of goals, and of all families."""
    drawn = known[known.family.notna()]
    groups = {"the paper's tasks": known[known.family.isna()]}
    for (family, goals), group in drawn.groupby(["family", "goals"]):
        groups[f"{family}, {goals} goals"] = group
    groups["all families"] = drawn
    table = pd.DataFrame({name: pd.Series({
        "instances": len(group),
        "proven": (group.distance == 0).sum(),
        **{f"within_{most}": (group.distance <= most).sum() for most in (1, 5, 20)},
        "median": group.distance.median(),
    }) for name, group in groups.items()}).T  # fmt: skip
    return table.rename_axis("row"), groups


def tabulate(folder):
    """Return the tables: counts with the effort of a folder, and the tasks that are open."""
    known = distances()
    table, groups = count(known)
    log = pd.DataFrame(shipped.read_log(folder), columns=["task", *EFFORT, "base", "other_arm"])
    log = log.query("base == 'task' and other_arm == 'free'")
    effort = log.groupby("task")[EFFORT].sum()
    for name, group in groups.items():
        seconds, nodes = effort.reindex(group.index).sum()
        table.loc[name, ["seconds", "per_second"]] = seconds, nodes / max(seconds, 1.0)
    return {"results": table, "open": known[~(known.distance <= 5)].drop(columns="hands")}


@figures.styled
def draw(table):
    """Share of instances by the distance of their bounds, a bar for each family."""
    figure, (axes,) = figures.panels((1, 1), (figures.TWO, 4.2))
    shares = 100 * table[[*BOUNDS]].div(table.instances, axis=0).iloc[::-1]
    shades = "0.9", "0.8", "0.7", "0.5", "0.2"
    for shade, (column, label) in zip(shades, reversed(BOUNDS.items()), strict=True):
        axes.barh(shares.index, shares[column], color=shade, label=label)
    axes.set_xlabel("instances (%)")
    axes.set_xlim(0, 100)
    figures.legend(figure, axes.get_legend_handles_labels()[0][::-1], len(BOUNDS))
    return figure


if __name__ == "__main__":
    write_study(FOLDER, tabulate(Path(sys.argv[1])) if sys.argv[1:] else {}, draw)
    stored = {
        name: pd.read_csv(FOLDER / f"{name}.csv", index_col=0) for name in ("results", "open")
    }
    (FOLDER / "open.md").write_text(fill_page(FOLDER / "open.md.jinja", **stored), encoding="utf-8")
