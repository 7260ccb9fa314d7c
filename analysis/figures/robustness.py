"""Claims under every choice that the paper leaves open: verdicts, and effects sorted.

Tables are those of :func:`~coartic.analysis.reconstruction.robustness.judged_specifications`.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Plot
from coartic.text import counted

LOOKS = {
    "supported": (style.BLUE, "o"),
    "undecided": (style.GREY, "."),
    "not supported": (style.VERMILLION, "X"),
}
"""Colour and mark of each verdict."""
COLUMNS = 3
HEIGHT = 1.9
"""Of a panel, inches."""
FEWEST = 2
"""Specifications that make a curve."""


@style.styled
def verdicts(table: pd.DataFrame) -> Plot:
    """The verdict of each claim under each set of readings, and its shares over members."""
    plain, members = table[table.member == ""], table[table.member != ""]
    sets = sorted(plain.readings.unique(), key=lambda words: (words != "", words))
    tasks, claims = sorted(members.task.unique()), list(table.claim.unique())
    widths = [max(0.14 * len(sets), 0.4), *(0.9 for _ in tasks)]
    size = style.TWO, 1.1 + 0.14 * len(claims)
    figure, panels = style.figure_of((1, len(widths)), size, sharey=True, width_ratios=widths)
    height = {claim: -number for number, claim in enumerate(claims)}
    for verdict, (color, mark) in LOOKS.items():
        rows = plain[plain.verdict == verdict]
        places = [sets.index(words) for words in rows.readings]
        panels[0].plot(places, rows.claim.map(height), mark, color=color, markersize=4)
    panels[0].set_xticks(range(len(sets)), [words or "default" for words in sets], rotation=90)
    panels[0].set_yticks(list(height.values()), claims)
    panels[0].set_title("readings")
    for axes, task in zip(panels[1:], tasks, strict=True):
        rows = members[members.task == task]
        shares = pd.crosstab(rows.claim, rows.verdict, normalize="index")
        left = np.zeros(len(shares))
        for verdict, (color, _) in LOOKS.items():
            width = shares.get(verdict, pd.Series(0.0, shares.index)).to_numpy()
            hatch = "////" * (verdict == "not supported")
            axes.barh(shares.index.map(height), width, 0.7, left, color=color, hatch=hatch)
            left += width
        axes.set(xlim=(0, 1), xticks=[0, 1], xticklabels=["0", "all"])
        axes.set_title(f"members of\n{task}")
        axes.tick_params(left=False)
    add_legend(figure)
    words = []
    for claim in claims:
        counts = table.verdict[table.claim == claim].value_counts()
        words.append(f"{claim}: " + ", ".join(f"{verdict} {n}" for verdict, n in counts.items()))
    return Plot(
        "verdicts",
        "Verdicts under every choice that the paper leaves open",
        f"Verdict of each claim with the default goals, one column a reading, and its shares over "
        f"{counted(members.member.nunique(), 'member')} of the ensembles. They are no sample: a "
        "share is no probability.",
        "; ".join(words),
        figure,
        table,
    )


@style.styled
def specification_curve(table: pd.DataFrame) -> Plot:
    """The effect of each claim, sorted over specifications, and the choices below.

    Claims without a test have no effect, and no panel.
    """
    data = table[table.effect.notna()]
    sizes = data.claim.value_counts()
    claims = [claim for claim in data.claim.unique() if sizes[claim] >= FEWEST]
    readings = sorted({word for words in data.readings for word in words.split()})
    choices = [*(["goals"] if (data.member != "").any() else []), *readings]
    rows, deep = max(1, -(-len(claims) // COLUMNS)), 0.12 * max(len(choices), 1)
    figure = Figure(figsize=(style.TWO, rows * (HEIGHT + deep)), layout="constrained")
    grid = figure.add_gridspec(2 * rows, COLUMNS, height_ratios=[HEIGHT, deep + 0.1] * rows)
    for number, claim in enumerate(claims):
        row, column = divmod(number, COLUMNS)
        above = figure.add_subplot(grid[2 * row, column], title=claim)
        below = figure.add_subplot(grid[2 * row + 1, column], sharex=above)
        of_claim = data[data.claim == claim].sort_values("effect", kind="stable")
        draw_effects(above, of_claim)
        draw_choices(below, of_claim, choices)
        below.set_yticks(range(len(choices)), choices[::-1] if column == 0 else [])
    add_legend(figure)
    words = [
        f"{claim}: {rows.effect.min():.3g} to {rows.effect.max():.3g}, "
        f"supported in {(rows.verdict == 'supported').sum()} of {len(rows)}"
        for claim, rows in data[data.claim.isin(claims)].groupby("claim", sort=False)
    ]
    specifications = counted(len(table.groupby(["readings", "member"])), "specification")
    return Plot(
        "specification-curve",
        "Claims under every choice that the paper leaves open",
        f"Effect of the first test of each claim, positive as claimed, with its "
        f"{style.CONFIDENCE} interval where that test has one, sorted over {specifications}; "
        "below, what differs from the default, which the upright line marks. Specifications are "
        "no sample: how many of them agree is no probability.",
        f"Sorted effects: {'; '.join(words)}",
        figure,
        data,
    )


def draw_effects(axes: Axes, rows: pd.DataFrame) -> None:
    """Effects of a claim with their intervals, and a line at the default."""
    places = pd.Series(np.arange(len(rows)), rows.index)
    for verdict, (color, _) in LOOKS.items():
        alike = rows[rows.verdict == verdict]
        axes.vlines(
            places[alike.index], alike.low, alike.high, color=color, alpha=0.45, linewidth=0.7
        )
        axes.plot(places[alike.index], alike.effect, ".", color=color, markersize=2.5)
    for place in places[(rows.readings == "") & (rows.member == "")]:
        axes.axvline(float(place), color=style.INK, linewidth=0.6, zorder=0)
    axes.axhline(0.0, color=style.INK, linewidth=0.5)
    axes.tick_params(labelbottom=False, bottom=False)


def draw_choices(axes: Axes, rows: pd.DataFrame, choices: list[str]) -> None:
    """Marks where a specification differs from the default, a line a choice."""
    for height, choice in enumerate(reversed(choices)):
        if choice == "goals":
            there = rows.member != ""
        else:
            there = rows.readings.map(lambda words, choice=choice: choice in words.split())
        places = np.flatnonzero(there)
        axes.plot(places, np.full(len(places), height), "|", color=style.INK, markersize=3, mew=0.6)
    axes.set_ylim(-0.7, len(choices) - 0.3)
    axes.set_xticks([])


def add_legend(figure: Figure) -> None:
    """What colours and marks mean."""
    handles = [
        style.entry(verdict, linestyle="", marker=mark, color=color)
        for verdict, (color, mark) in LOOKS.items()
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
