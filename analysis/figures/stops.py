"""Stops at goals: what of coarticulation is posture, and what was smoothness."""

from __future__ import annotations

from typing import Any

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.study import Study
from coartic.analysis.tables.studies import SMOOTH
from coartic.analysis.tables.studies import stops as stops_table

COLORS = {"jerk": style.BLUE, "acceleration": style.VERMILLION}
TIMES = {"free": ("free times", style.SOLID), "fixed": ("equal times", style.DASHED)}
MARKS = {"ascending, descending": "o", "random, one arm": "D", "random, two arms": "s"}
"""Of the tasks that are drawn: those for which means over tasks are known."""


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
    drawn = data[data.group.isin(list(MARKS)) & (data.goals_per_stop == 1) & data.stop.notna()]
    drawing, panels = style.figure_of((1, 2), (style.TWO, 2.6))
    shift = 0.0
    for (group, method, timing), part in drawn.groupby(["group", "method", "timing"], sort=False):
        cost = str(method).removeprefix(SMOOTH)
        words, dash = TIMES[str(timing)]
        line: Any = {"color": COLORS[cost], "linestyle": dash, "marker": MARKS[str(group)]}
        shift += 0.012
        for axes, name in zip(panels, ("nearer", "turn"), strict=True):
            ends = part[f"{name}_low"], part[f"{name}_high"]
            axes.vlines(part.stop + shift, *ends, color=COLORS[cost], linewidth=0.8)
            label = f"{group}: {cost}, {words}"
            axes.plot(part.stop + shift, part[name], markersize=3.5, **line, label=label)
    panels[0].set_ylabel("next goal nearer (ticks)")
    panels[1].set_ylabel("turn at goals (rad)")
    for axes, title in zip(panels, ("posture", "velocity"), strict=True):
        axes.set_title(title)
        axes.set_xlabel("stop")
        axes.set_ylim(bottom=0)
    style.letters(panels)
    style.legend(drawing, panels[0].get_legend_handles_labels()[0], 2)
    rows = drawn.reset_index().to_dict("records")
    each = (f"{row['row']}: {row['nearer']:.1f} ticks, {row['turn']:.2f} rad" for row in rows)
    return drawing, drawn, f"Posture and velocity by stop. {'; '.join(each)}.", ()
