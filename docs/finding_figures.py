"""Draw the figures of ``docs/findings.md`` from stored tables, one figure for each finding.

``python docs/make_findings.py`` writes them into ``docs/stored/findings``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from coartic.analysis import mean
from coartic.analysis.figures import dots, look_of, panels, style, styled
from coartic.analysis.methods import BY_FORMULA, BY_TRIAL, COLORS, KINDS

Table = Callable[..., pd.DataFrame]
"""Function that returns a stored table. Its arguments are the name of a suite or a study, the name
of the table, and optionally the world."""
FAMILIES = ("one-armed", "two-armed", "aligned", "redundancy", "long")
BLUE = look_of("dual-process/EC4")["color"]
LEARNER, RANDOM = "dual-process (EC1, EC4)", "random-search"
METHODS = {
    "cma-es/bandit": ("CMA-ES", "cma-es/bandit"),
    "hill-climbing": ("hill climbing", "hill-climbing"),
    LEARNER: ("the paper's learner", "dual-process/EC4"),
    RANDOM: ("random search", RANDOM),
}
"""Maps the label of each method of finding 4 to its name in the figure, and to the id of the method
whose look it has."""
INFORMED = "dual-process (EC1-informed, EC4-informed)"
NOISE = "motor_noise=0.01"
"""The world of the second ranking, as it stands in the names of stored tables."""
FORMULA, REWARDS = (COLORS[KINDS[kind][0]] for kind in (BY_FORMULA, BY_TRIAL))
"""Colours of methods that use the reward as a formula, and of methods that use the reward of each
trial."""
RANKED = {
    "trajectory-optimisation/path-length": ("shortest-path plan", FORMULA),
    "posture-qp/goals-ahead": ("posture QP, goals ahead", FORMULA),
    "policy-gradient": ("policy gradient", REWARDS),
    "cma-es/bandit": ("CMA-ES", REWARDS),
    INFORMED: ("informed learner", REWARDS),
    "hill-climbing spread=learned": ("hill climbing, learned spread", REWARDS),
    "hill-climbing": ("hill climbing", REWARDS),
    LEARNER: ("the paper's learner", REWARDS),
    RANDOM: ("random search", REWARDS),
}
"""Maps the label of each method that is shown in two worlds to its name and its colour in the
figure."""
NOTHING = (math.nan, math.nan, math.nan)
_NUMBER = r"(−?\d+(?:\.\d+)?)"


def estimate(row: Any, column: str, scale: float = 1) -> tuple[float, float, float]:
    """Return a value of a stored table's row, and the ends of its interval.

    The ends are NaN if the table has no interval for the column. All three numbers are multiplied
    by ``scale``.
    """
    low, high = row.get(f"{column}_low", math.nan), row.get(f"{column}_high", math.nan)
    return scale * row[column], scale * low, scale * high


def written(evidence: str, words: str) -> tuple[float, float, float]:
    """Return the number with its interval that follows some words in a claim's evidence.

    The result has the number and the lower and upper end of its interval. All three numbers are NaN
    if the evidence does not have these words with such a number.
    """
    found = re.search(rf"{re.escape(words)}: {_NUMBER} \[{_NUMBER}, {_NUMBER}\]", evidence)
    if found is None:
        return NOTHING
    value, low, high = (float(number.replace("−", "-")) for number in found.groups())
    return value, low, high


def draw(
    names: Sequence[str],
    quantities: dict[str, Sequence[tuple[float, float, float]]],
    looks: Sequence[tuple[str, str]] = (),
    dashed: Mapping[str, Sequence[float]] = MappingProxyType({}),
) -> Figure:
    """Draw a dot plot: a row for each name, a panel for each quantity.

    Parameters
    ----------
    names : sequence of str
        Names of the rows, from top to bottom.
    quantities : dict of str to sequence of (float, float, float)
        Maps the label of each quantity to an estimate for each name: value, and lower and upper end
        of its interval.
    looks : sequence of (str, str), optional
        Colour and marker of each row; by default blue diamonds.
    dashed : mapping of str to sequence of float, optional
        Maps labels of quantities to the values at which their panels have dashed lines.
    """
    rows = pd.DataFrame({"name": names, "bold": False})
    rows[["color", "marker"]] = looks or [(BLUE, "D")] * len(rows)
    for label, estimates in quantities.items():
        rows[[label, f"{label}_low", f"{label}_high"]] = estimates
    return dots(rows, {label: label for label in quantities}, dashed)


@styled
def first_movement(table: Table) -> Figure:
    """Draw finding 2: first movements are slower, and whole tasks are faster."""
    runs, equal = table("comparison", "signatures"), table("memory", "one_selection")
    scales = table("memory", "scales")
    names, first, whole = [], [], []
    for task in ("ascending", "descending"):
        names += [f"{task}, 10,000 trials", f"{task}, at equal gain"]
        row = runs.loc[f"{task} dual-process/EC1 RRR"]
        first += [estimate(row, "first_difference"), estimate(equal.loc[f"{task} first"], "equal")]
        whole += [estimate(row, "whole_difference"), estimate(equal.loc[f"{task} gain"], "equal")]
    for family in FAMILIES:
        names.append(f"40 random tasks, {family}")
        first.append(estimate(scales.loc[f"{family} postures first"], "beyond_one"))
        whole.append(estimate(scales.loc[f"{family} postures gain"], "beyond_one"))
    return draw(
        names,
        {
            "first movement slower than in\nrandom search (ticks)": first,
            "whole task faster than in\nrandom search (ticks)": whole,
        },
    )


@styled
def early_gain(table: Table, early_less_late: Callable[[str], dict[str, float]]) -> Figure:
    """Draw finding 3: gains of the informed learner and of the paper's learner.

    The informed learner has 100 trials, and the paper's learner 10,000. There is a row for each
    family. ``early_less_late`` is the function :func:`make_findings.early_less_late`.
    """
    rows = table("dial", "results")
    drift = [estimate(rows.loc[f"{name} 1 0.01 next-goal"], "gain_100") for name in FAMILIES]
    paper = [estimate(rows.loc[f"{name} 0 0.05"], "gain_10000") for name in FAMILIES]
    more = [estimate(early_less_late(name), "more") for name in FAMILIES]
    return draw(
        FAMILIES,
        {
            "gain, informed learner,\n100 trials (%)": drift,
            "gain, paper's learner,\n10,000 trials (%)": paper,
            "a less b\n(percentage points)": more,
        },
    )


@styled
def gaps(table: Table) -> Figure:
    """Draw finding 4: gaps on the paper's tasks and in each family of random tasks."""
    ranking, families = table("comparison", "ranking"), table("families", "family-gaps")
    names = ["the paper's four tasks", *FAMILIES, "fourteen goals"]
    columns = [f"in {family}/v1" for family in (*FAMILIES, "many-goals")]
    figure, (axes,) = panels((1, 1), (style.TWO, 3.2))
    for place, (method, (name, of_method)) in enumerate(METHODS.items()):
        row = families.loc[method]
        estimates = [estimate(ranking.loc[method], "gap", 100)]
        estimates += [estimate(row, column, 100) for column in columns]
        values, lows, highs = zip(*estimates, strict=True)
        look: dict[str, Any] = {"color": look_of(of_method)["color"], "marker": "^osD"[place]}
        heights = -np.arange(len(names)) + 0.15 * (1.5 - place)
        axes.hlines(heights, lows, highs, linewidth=1.5, alpha=0.6, color=look["color"])
        axes.plot(values, heights, label=name, linestyle="", markersize=4.5, **look)
    axes.set_xscale("log")
    axes.set_xticks(ticks := [1, 2, 5, 10, 20, 50, 100], [str(tick) for tick in ticks])
    axes.minorticks_off()
    axes.set_xlabel("gap (%), logarithmic axis")
    axes.grid(axis="x", color=style.GREY, alpha=0.3, linewidth=0.5)
    for height in range(1, len(names)):
        axes.axhline(0.5 - height, color=style.GREY, alpha=0.3, linewidth=0.5)
    style.name_rows(axes, names)
    style.legend(figure, axes.get_legend_handles_labels()[0], len(METHODS))
    return figure


def over_random_tasks(tasks: pd.DataFrame) -> pd.DataFrame:
    """Return the mean gap of each method over random tasks of up to eight goals.

    ``tasks`` is a stored table ``by-task``. The result has a row for each method, with the columns
    ``gap``, ``gap_low`` and ``gap_high`` (fractions).
    """
    drawn = tasks[~tasks.index.str.startswith("many-goals/")]
    labels = drawn.method.replace(
        {r"^dual-process/EC[14]$": LEARNER, r"^dual-process/.*-informed$": INFORMED}, regex=True
    )
    means = {label: mean(gaps).columns("gap") for label, gaps in drawn.gap.groupby(labels)}
    return pd.DataFrame.from_dict(means, orient="index")


@styled
def two_worlds(table: Table) -> Figure:
    """Draw the gap of each method in worlds without and with motor noise.

    In each world, methods practised and were judged in this world.
    """
    worlds = {
        "the paper's four tasks": [table("comparison", "ranking", world) for world in ("", NOISE)],
        "200 random tasks": [
            over_random_tasks(table("families", "by-task", world)) for world in ("", NOISE)
        ],
    }
    figure, both = panels((1, 2), (style.TWO, 3.4))
    labels = {"without noise": {}, "with motor noise 0.01": {"markerfacecolor": "white"}}
    for axes, (title, tables) in zip(both, worlds.items(), strict=True):
        for (label, more), gaps_of, shift in zip(
            labels.items(), tables, (0.14, -0.14), strict=True
        ):
            for place, (method, (_, color)) in enumerate(RANKED.items()):
                if method not in gaps_of.index:
                    continue
                value, low, high = estimate(gaps_of.loc[method], "gap", 100)
                axes.hlines(shift - place, low, high, color=color, linewidth=1.2)
                axes.plot(value, shift - place, marker="o", color=color, markersize=4.5, **more)
            axes.plot([], [], marker="o", linestyle="", color=style.GREY, label=label, **more)
        axes.set(title=title, xlabel="gap (%)", xlim=(0, None))
        axes.grid(axis="x", color=style.GREY, alpha=0.3, linewidth=0.5)
        style.name_rows(axes, [name if axes is both[0] else "" for name, _ in RANKED.values()])
    style.legend(figure, both[0].get_legend_handles_labels()[0], 2)
    return figure


@styled
def rewards(table: Table) -> Figure:
    """Draw finding 5: our mean rewards minus the published rewards, in per cent of these."""
    cells = table("replication", "rewards")
    cells = cells[cells.hands.isna() & cells.difference.notna()]
    label = "our mean reward less the published one (% of it; dashed: ± 1 %)"
    values = [estimate(row, "difference", -100 / row.published) for _, row in cells.iterrows()]
    names = [f"{name} †" if "two-armed" in name else name for name in cells.index]
    return draw(names, {label: values}, dashed={label: (-1, 1)})


@styled
def idle_arms(table: Table) -> Figure:
    """Draw finding 7: how much nearer to the next goal both arms come."""
    runs, claims = table("comparison", "signatures"), table("replication", "claims")
    moving = claims.loc["arm-coarticulation-in-general"]
    idle = claims.loc["other-arm-coarticulation-in-general"]
    names, nearer, more, other = [], [], [], []
    for condition in ("EC3", "EC4"):
        row = runs.loc[f"two-armed-1 dual-process/{condition} LRLR"]
        names.append(f"two-armed task 1 †, {condition}")
        nearer.append(estimate(row, "arm"))
        more.append(estimate(row, "arm_difference"))
        other.append(estimate(row, "other_arm") if condition == "EC4" else NOTHING)
    for family in FAMILIES:
        names.append(f"random tasks, {family}")
        nearer.append(written(moving.evidence, f"{family}/v1"))
        more.append(written(moving.evidence_beyond, f"{family}/v1, more than random search"))
        other.append(written(idle.evidence, f"{family}/v1"))
    return draw(
        names,
        {
            "next goal nearer\n(ticks)": nearer,
            "more than in random\nsearch (ticks)": more,
            "idle hand nearer\n(share of its path)": other,
        },
    )


@styled
def goals_ahead(table: Table) -> Figure:
    """Draw finding 8: how much a planner gains from each further goal that it considers."""
    whole, movement = table("horizon", "results"), table("horizon", "movements")
    ahead = range(5)
    name = "goals 6 or more h={}"
    many = [whole.loc[name.format(h)] for h in ahead]
    of_movement = [estimate(movement.loc[name.format(h)], "gain") for h in ahead[1:]]
    return draw(
        [f"{h or 'no'} goal{'s' * (h != 1)} ahead" for h in ahead],
        {
            "gap (%)": [estimate(row, "gap", 100) for row in many],
            "gain of the last goal seen,\n% of the whole task": [
                estimate(row, "gain", 100) for row in many
            ],
            "gain of the last goal seen,\n% of a movement": [NOTHING, *of_movement],
        },
    )


FIGURES: dict[str, Any] = {
    "two-worlds": two_worlds,
    "first-movement": first_movement,
    "early-gain": early_gain,
    "gaps": gaps,
    "rewards": rewards,
    "arms": idle_arms,
    "goals-ahead": goals_ahead,
}
"""Maps the name of each figure's file to the function that draws the figure."""
