"""Stops at goals: what of coarticulation is posture, and what was smoothness."""

from __future__ import annotations

from typing import Any

import numpy as np

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.study import Study
from coartic.analysis.tables.studies import SMOOTH
from coartic.analysis.tables.studies import stops as stops_table

LOOKS = {
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
    "next goal nearer, against the corrective process's; they come of redundancy. b: the angle by "
    "which the path turns at goals, which passing makes 0. Movements have a constant speed here, "
    "so that the direction is all that is left of a plan's velocity.",
)
def stops(study: Study) -> Parts:
    """Posture and velocity by how much a plan stops."""
    data = stops_table(study)
    if not len(data):
        raise missing(study, "no runs that stop at goals")
    costs = data.method.str.removeprefix(SMOOTH)
    shown = np.array([pair in LOOKS for pair in zip(data.group, costs, strict=True)])
    drawn = data.assign(cost=costs)[shown & (data.goals_per_stop == 1)]
    drawing, panels = style.figure_of((1, 2), (style.TWO, 3.0))
    for number, ((group, cost, timing), part) in enumerate(
        drawn.groupby(["group", "cost", "timing"], sort=False)
    ):
        color, marker = LOOKS[str(group), str(cost)]
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
