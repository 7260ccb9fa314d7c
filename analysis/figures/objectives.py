"""Wrong objectives: regret under the true reward by how wrong a planner's is."""

from __future__ import annotations

from typing import Any

import numpy as np

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.study import Study
from coartic.analysis.tables.objectives import crossings as crossings_table
from coartic.analysis.tables.objectives import objectives as objectives_table

TITLES = {"joints": "costly joints", "region": "costly disc", "distinct": "postures alike"}
LOOKS: dict[str, tuple[str, Any, str]] = {
    "told": (style.INK, style.SOLID, "planner, told of the penalty"),
    "ticks": (style.VERMILLION, style.SOLID, "planner of ticks"),
    "smooth": (style.ORANGE, style.DASHED, "planner of smoothness"),
    "learner": (style.BLUE, style.SOLID, "learner"),
    "from plan": (style.SKY, style.DASHED, "learner from the plan of ticks"),
    "cma-es": (style.GREEN, style.SOLID, "CMA-ES"),
}
"""Colour, dash and words of each line."""


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
    drawing, panels = style.figure_of((1, len(TITLES)), (style.TWO, 2.8), sharey=True)
    weights = sorted(data.weight.unique())
    edge = 1.05 * weights[-1]
    crossings = crossings_table(study)
    for axes, (term, title) in zip(panels, TITLES.items(), strict=True):
        axes.set_title(title)
        axes.set_xscale("function", functions=(np.sqrt, np.square))
        axes.set_xticks(weights, [f"{weight:g}" for weight in weights])
        axes.set_xlim(0, edge)
        axes.set_xlabel("weight (ticks)")
        for at in crossings[crossings.term == term].to_dict("records"):
            band: Any = {"color": LOOKS[at["who"]][0], "alpha": 0.15, "linewidth": 0}
            axes.axvspan(*np.minimum([at["crossing_low"], at["crossing_high"]], edge), **band)
        for who, (color, dash, words) in LOOKS.items():
            rows = data[(data.term == term) & (data.who == who)]
            line: Any = {"color": color, "linestyle": dash, "marker": "o", "markersize": 3}
            axes.vlines(rows.weight, rows.regret_low, rows.regret_high, color, linewidth=0.8)
            axes.plot(rows.weight, rows.regret, **line, label=words)
        axes.set_ylim(bottom=0)
    panels[0].set_ylabel("regret (%)")
    style.letters(panels)
    style.legend(drawing, panels[0].get_legend_handles_labels()[0], 3)
    each = (f"{name}: {value:.1f} %" for name, value in data.regret.items())
    return drawing, data, f"Regret by penalty, weight and who. {'; '.join(each)}.", ()
