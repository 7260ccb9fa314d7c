"""Claims under every choice that the paper leaves open: verdicts, and effects sorted."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Plot
from coartic.text import counted

_COLORS = {
    "supported": style.BLUE,
    "undecided": style.GREY,
    "not supported": style.VERMILLION,
}
_MARKS = {"supported": "o", "undecided": ".", "not supported": "X"}
_COLUMNS = 3
_HEIGHT = 1.9  # of a panel, inches
_LEAST = 2  # specifications that make a curve


@style.styled
def verdicts(table: pd.DataFrame) -> Plot:
    """The verdict of each claim under each set of readings, and its shares over members.

    ``table`` is that of
    :func:`~coartic.analysis.reconstruction.specifications.judged_specifications`.
    """
    plain = table[table.member == ""]
    sets = sorted(dict.fromkeys(plain.readings), key=lambda words: (words != "", words))
    tasks = sorted({task for task in table.task if task})
    claims = list(dict.fromkeys(table.claim))
    widths = [max(0.14 * len(sets), 0.4), *(0.9 for _ in tasks)]
    size = style.TWO, 1.1 + 0.14 * len(claims)
    figure, panels = style.figure_of((1, len(widths)), size, sharey=True, width_ratios=widths)
    height = {claim: -number for number, claim in enumerate(claims)}
    for number, words in enumerate(sets):
        own = plain[plain.readings == words]
        for verdict, color in _COLORS.items():
            rows = [height[claim] for claim in own.claim[own.verdict == verdict]]
            panels[0].plot([number] * len(rows), rows, _MARKS[verdict], color=color, markersize=4)
    panels[0].set_xticks(range(len(sets)), [words or "default" for words in sets], rotation=90)
    panels[0].set_yticks(list(height.values()), claims)
    panels[0].set_title("readings")
    for axes, task in zip(panels[1:], tasks, strict=True):
        counts = pd.crosstab(table.claim[table.task == task], table.verdict[table.task == task])
        shares = counts.div(counts.sum(axis=1), axis=0).reindex(columns=list(_COLORS)).fillna(0.0)
        left = np.zeros(len(shares))
        for verdict, color in _COLORS.items():
            width = shares[verdict].to_numpy()
            rows = [height[claim] for claim in shares.index]
            hatch = "////" * (verdict == "not supported")
            axes.barh(rows, width, 0.7, left, color=color, hatch=hatch)
            left += width
        axes.set(xlim=(0, 1), xticks=[0, 1], xticklabels=["0", "all"])
        axes.set_title(f"members of\n{task}")
        axes.tick_params(left=False)
    _legend(figure)
    members = counted(len(table[table.member != ""].member.unique()), "member")
    return Plot(
        "verdicts",
        "Verdicts under every choice that the paper leaves open",
        f"Verdict of each claim with the default goals, one column a reading, and its shares over "
        f"{members} of the ensembles. They are no sample: a share is no probability.",
        "; ".join(_shared(table, claim) for claim in claims),
        figure,
        table,
    )


def _shared(table: pd.DataFrame, claim: str) -> str:
    counts = table.verdict[table.claim == claim].value_counts()
    return f"{claim}: " + ", ".join(f"{verdict} {count}" for verdict, count in counts.items())


@style.styled
def specification_curve(table: pd.DataFrame) -> Plot:
    """The effect of each claim, sorted over specifications, and the choices below.

    ``table`` is that of
    :func:`~coartic.analysis.reconstruction.specifications.judged_specifications`;
    claims without a test have no effect, and no panel.
    """
    data = table[table.effect.notna()]
    sizes = data.claim.value_counts()
    claims = [claim for claim in dict.fromkeys(data.claim) if sizes[claim] >= _LEAST]
    rows = max(1, -(-len(claims) // _COLUMNS))
    choices = _choices(data)
    deep = 0.12 * max(len(choices), 1)
    figure = Figure(figsize=(style.TWO, rows * (_HEIGHT + deep)), layout="constrained")
    grid = figure.add_gridspec(2 * rows, _COLUMNS, height_ratios=[_HEIGHT, deep + 0.1] * rows)
    for number, claim in enumerate(claims):
        row, column = divmod(number, _COLUMNS)
        above = figure.add_subplot(grid[2 * row, column])
        below = figure.add_subplot(grid[2 * row + 1, column], sharex=above)
        own = data[data.claim == claim].sort_values("effect", kind="stable")
        _effects(above, own, claim)
        _matrix(below, own, choices, named=column == 0)
    _legend(figure)
    said = counted(len(table.groupby(["readings", "member"])), "specification")
    return Plot(
        "specification-curve",
        "Claims under every choice that the paper leaves open",
        f"Effect of the first test of each claim, positive as claimed, with its "
        f"{style.CONFIDENCE} interval where that test has one, sorted over {said}; below, what "
        "differs from the default, which the upright line marks. Specifications are no sample: "
        "how many of them agree is no probability.",
        "Sorted effects: " + "; ".join(_spoken(data, claim) for claim in claims),
        figure,
        data,
    )


def _choices(data: pd.DataFrame) -> list[str]:
    readings = sorted({word for words in data.readings for word in words.split()})
    return [*(["goals"] if (data.member != "").any() else []), *readings]


def _effects(axes: Axes, own: pd.DataFrame, claim: str) -> None:
    x = np.arange(len(own))
    for verdict, color in _COLORS.items():
        chosen = (own.verdict == verdict).to_numpy()
        low, high = own.low.to_numpy()[chosen], own.high.to_numpy()[chosen]
        axes.vlines(x[chosen], low, high, color=color, alpha=0.45, linewidth=0.7)
        axes.plot(x[chosen], own.effect.to_numpy()[chosen], ".", color=color, markersize=2.5)
    default = np.flatnonzero(((own.readings == "") & (own.member == "")).to_numpy())
    for k in default:
        axes.axvline(float(k), color=style.INK, linewidth=0.6, zorder=0)
    axes.axhline(0.0, color=style.INK, linewidth=0.5)
    axes.set_title(claim)
    axes.tick_params(labelbottom=False, bottom=False)


def _matrix(axes: Axes, own: pd.DataFrame, choices: list[str], *, named: bool) -> None:
    for height, choice in enumerate(reversed(choices)):
        if choice == "goals":
            there = (own.member != "").to_numpy()
        else:
            there = np.array([choice in words.split() for words in own.readings])
        x = np.flatnonzero(there)
        axes.plot(x, np.full(len(x), height), "|", color=style.INK, markersize=3, mew=0.6)
    axes.set_ylim(-0.7, len(choices) - 0.3)
    axes.set_yticks(range(len(choices)), list(reversed(choices)) if named else [])
    axes.set_xticks([])


def _legend(figure: Figure) -> None:
    handles = [
        style.entry(verdict, linestyle="", marker=_MARKS[verdict], color=color)
        for verdict, color in _COLORS.items()
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))


def _spoken(data: pd.DataFrame, claim: str) -> str:
    own = data[data.claim == claim]
    held = int((own.verdict == "supported").sum())
    return (
        f"{claim}: {own.effect.min():.3g} to {own.effect.max():.3g}, "
        f"supported in {held} of {len(own)}"
    )
