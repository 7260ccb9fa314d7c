"""The figures of our own studies: how far ahead a planner looks, stops at goals, wrong objectives,
and models beside people."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.claims.studies import ALL_GOALS, HORIZONS
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.human import judge
from coartic.analysis.human.measures import MODELS
from coartic.analysis.studies.objectives import TERMS, WHO
from coartic.analysis.study import Study
from coartic.analysis.tables.studies import BEYOND, SMOOTH
from coartic.analysis.tables.studies import crossings as crossings_table
from coartic.analysis.tables.studies import horizon as horizon_table
from coartic.analysis.tables.studies import human as human_table
from coartic.analysis.tables.studies import objectives as objectives_table
from coartic.analysis.tables.studies import stops as stops_table

PLACES = [str(h) for h in HORIZONS]
COLORS = (style.INK, style.BLUE, style.VERMILLION, style.GREEN)
"""Colours of the lines of a panel."""


@figure(
    "horizon",
    "Gap of a planner by how far it looks ahead",
    f"Gap to the best known solution, mean over random tasks with its {style.CONFIDENCE} interval "
    "(bootstrap over tasks), linear below 1 %, at horizons that all of a line's tasks have. By "
    "goals of the task: a line ends where all goals are in view. Given hands: hands chosen by each "
    "plan, or those of the plan with all goals. Dear joints cost three times as much, by weighted "
    "path length.",
)
def horizon(study: Study) -> Parts:
    """The curves by number of goals, with given hands, and with dear joints."""
    data = horizon_table(study)
    if not len(data):
        raise missing(study, "no runs of the planner on instances of a family of tasks")
    titles = {"goals": "goals of the task", "hands": "given hands", "costs": "dear joints"}
    groups = [group for group in titles if (data.group == group).any()]
    drawing, panels = style.figure_of((1, len(groups)), (style.TWO, 2.6), sharey=True)
    for axes, group in zip(panels, groups, strict=True):
        parts = data[data.group == group].groupby("value", sort=False)
        for number, (color, (name, rows)) in enumerate(zip(style.PALETTE, parts, strict=False)):
            if group == "goals" and BEYOND not in set(rows.h):
                rows = rows[rows.h != ALL_GOALS]  # that is its last horizon
            rows = rows[rows.h.isin(PLACES) & (rows.tasks == rows.tasks.max())]
            curve(axes, rows, color, 0.08 * number, str(name))
        axes.set_xticks(range(len(PLACES)), PLACES)
        axes.set_xlabel("goals ahead")
        axes.set_title(titles[group])
        axes.legend(loc="upper right")
    first = panels[0]
    first.set_yscale("symlog", linthresh=1, linscale=0.6)
    first.set_yticks([0, 0.5, 1, 2, 5, 10, 20, 50], ["0", "0.5", "1", "2", "5", "10", "20", "50"])
    first.set_ylim(bottom=-0.1)
    first.set_ylabel("gap (%)")
    style.letters(panels)
    gained = data[(data.group == "all") & data.gain.notna()]
    each = (f"{h} ahead: {gain:.1%}" for h, gain in zip(gained.h, gained.gain, strict=True))
    return drawing, data, f"Gain of each goal ahead where it exists. {'; '.join(each)}.", ()


def curve(axes: Axes, rows: pd.DataFrame, color: str, shift: float, name: str) -> None:
    """Means by horizon with their intervals."""
    places = rows.h.map(PLACES.index) + shift
    line: Any = {"color": color, "marker": "o", "markersize": 3, "linewidth": 1.2}
    axes.vlines(places, 100 * rows.gap_low, 100 * rows.gap_high, color=color, linewidth=0.9)
    axes.plot(places, 100 * rows.gap, **line, label=name)


STOP_LOOKS = {
    ("ascending, descending", "jerk"): (style.BLUE, "o"),
    ("ascending, descending", "acceleration"): (style.VERMILLION, "o"),
    ("random, one arm", "jerk"): (style.GREEN, "D"),
    ("random, two arms", "jerk"): (style.PURPLE, "s"),
}
"""Colour and mark by tasks and cost, of what is drawn."""
TIMES = {"free": ("free times", style.SOLID), "fixed": ("equal times", style.DASHED)}


@figure(
    "stops",
    "What a stop at the goals leaves of coarticulation",
    "Smooth plans from passing through the goals (0) to a full stop at each (1), means over tasks, "
    f"of random ones with their {style.CONFIDENCE} interval. a: ticks by which postures leave the "
    "next goal nearer, against the corrective process's. b: the angle by "
    "which the path turns at goals, which passing makes 0. Movements have a constant speed here, "
    "so that the direction is all that is left of a plan's velocity.",
)
def stops(study: Study) -> Parts:
    """Posture and velocity by how much a plan stops."""
    data = stops_table(study)
    if not len(data):
        raise missing(study, "no runs that stop at goals")
    costs = data.method.str.removeprefix(SMOOTH)
    shown = np.array([pair in STOP_LOOKS for pair in zip(data.group, costs, strict=True)])
    drawn = data.assign(cost=costs)[shown & (data.goals_per_stop == 1)]
    drawing, panels = style.figure_of((1, 2), (style.TWO, 3.0))
    for number, ((group, cost, timing), part) in enumerate(
        drawn.groupby(["group", "cost", "timing"], sort=False)
    ):
        color, marker = STOP_LOOKS[str(group), str(cost)]
        words, dash = TIMES[str(timing)]
        line: Any = {"color": color, "linestyle": dash, "marker": marker, "markersize": 3.5}
        places = part.stop + 0.008 * number
        for axes, name in zip(panels, ("nearer", "turn"), strict=True):
            axes.vlines(places, part[f"{name}_low"], part[f"{name}_high"], color, linewidth=0.8)
            axes.plot(places, part[name], **line, label=f"{group}: {cost}, {words}")
    panels[0].set_ylabel("next goal nearer (ticks)")
    panels[1].set_ylabel("turn at goals (rad)")
    for axes, title in zip(panels, ("posture", "velocity"), strict=True):
        axes.set_title(title)
        axes.set_xlabel("stop")
        axes.set_xticks([0, 0.25, 0.5, 0.75, 1], ["0", "¼", "½", "¾", "1"])
        axes.set_ylim(bottom=0)
    style.letters(panels)
    style.legend(drawing, panels[0].get_legend_handles_labels()[0], 2)
    rows = drawn.reset_index().to_dict("records")
    each = (f"{row['row']}: {row['nearer']:.1f} ticks, {row['turn']:.2f} rad" for row in rows)
    return drawing, drawn, f"Posture and velocity by stop. {'; '.join(each)}.", ()


WHO_LOOKS: dict[str, tuple[str, Any]] = {
    "told": (style.INK, style.SOLID),
    "ticks": (style.VERMILLION, style.SOLID),
    "smooth": (style.ORANGE, style.DASHED),
    "learner": (style.BLUE, style.SOLID),
    "from plan": (style.SKY, style.DASHED),
    "cma-es": (style.GREEN, style.SOLID),
}
"""Colour and dash of each line."""


@figure(
    "objectives",
    "Regret by how wrong a planner's objective is",
    "Regret under the true reward, which loses a penalty of this weight beside 1 a tick: mean over "
    f"random tasks with its {style.CONFIDENCE} interval (bootstrap over tasks), in per cent of the "
    "best known reward. Bands: the interval of the weight at which the learner (blue) and CMA-ES "
    "(green), which are told nothing, overtake the planner of ticks. Horizontally by the square "
    "root.",
)
def objectives(study: Study) -> Parts:
    """A panel for each penalty, a line for each who."""
    data = objectives_table(study)
    if not len(data):
        raise missing(study, "no random tasks with a penalty")
    drawing, panels = style.figure_of((1, len(TERMS)), (style.TWO, 2.8), sharey=True)
    weights = sorted(data.weight.unique())
    edge = 1.05 * weights[-1]
    crossings = crossings_table(study)
    for axes, (term, title) in zip(panels, TERMS.items(), strict=True):
        axes.set_title(title)
        axes.set_xscale("function", functions=(np.sqrt, np.square))
        axes.set_xticks(weights, [f"{weight:g}" for weight in weights])
        axes.set_xlim(0, edge)
        axes.set_xlabel("weight (ticks)")
        for at in crossings[crossings.term == term].to_dict("records"):
            band: Any = {"color": WHO_LOOKS[at["who"]][0], "alpha": 0.15, "linewidth": 0}
            axes.axvspan(*np.minimum([at["crossing_low"], at["crossing_high"]], edge), **band)
        for who, (color, dash) in WHO_LOOKS.items():
            rows = data[(data.term == term) & (data.who == who)]
            line: Any = {"color": color, "linestyle": dash, "marker": "o", "markersize": 3}
            axes.vlines(rows.weight, rows.regret_low, rows.regret_high, color, linewidth=0.8)
            axes.plot(rows.weight, rows.regret, **line, label=WHO[who].removeprefix("the "))
        axes.set_ylim(bottom=0)
    panels[0].set_ylabel("regret (%)")
    style.letters(panels)
    style.legend(drawing, panels[0].get_legend_handles_labels()[0], 3)
    each = (f"{name}: {value:.1f} %" for name, value in data.regret.items())
    return drawing, data, f"Regret by penalty, weight and who. {'; '.join(each)}.", ()


MARKS = {
    judge.AGREES: ("+", style.BLUE),
    judge.DISAGREES: ("−", style.VERMILLION),
    judge.UNDECIDED: ("?", style.GREY),
    judge.SILENT: ("·", style.GREY),
}


@figure(
    "human",
    "Which models agree with which findings about people",
    "+ agrees, − disagrees, ? undecided, · silent: nothing follows for the model; empty: no cases. "
    "In a circle: the verdict follows from how the model is built.",
)
def human(study: Study) -> Parts:
    """A grid with a mark for each verdict."""
    verdicts = judge.judged(study).drop_duplicates(["finding", "model"])
    if not len(verdicts):
        raise missing(study, f"only suite {judge.SUITE!r} is put to findings about people")
    drawing, (axes,) = style.figure_of((1, 1), (style.TWO, 4.6))
    findings, models = list(judge.FINDINGS), list(MODELS)
    effects = human_table(study)
    for row in verdicts.itertuples():
        finding, model = str(row.finding), str(row.model)
        place = models.index(model), -findings.index(finding)
        mark, color = MARKS.get(str(row.verdict), ("", style.GREY))
        text: Any = {"color": color, "ha": "center", "va": "center", "fontsize": style.NORMAL + 2}
        label = axes.text(*place, mark, **text)
        style.tip(label, f"{finding}, {model}: {effects[f'of {model}'][finding]}")
        if row.built_in:
            axes.plot(*place, "o", markersize=11, markerfacecolor="none", markeredgecolor=color,
                      markeredgewidth=0.6)  # fmt: skip
    style.name_rows(axes, [name.replace("-", " ") for name in findings])
    axes.set_xticks(range(len(models)), models, rotation=50, ha="left", rotation_mode="anchor")
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.set_xlim(-0.6, len(models) - 0.4)
    axes.grid(visible=True, linewidth=0.3)
    axes.spines[:].set_visible(False)
    counts = verdicts.verdict.value_counts()
    words = ", ".join(f"{verdict} {count}" for verdict, count in counts.items())
    return drawing, effects, f"{len(findings)} findings by {len(models)} models: {words}.", ()
