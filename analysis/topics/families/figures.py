"""Random tasks: gaps by method, and more exploration against less, instance by instance."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, looks_in, missing, spoken
from coartic.analysis.methods import name_of
from coartic.analysis.study import Study
from coartic.analysis.topics.families.tables import instance_gaps

_FARTHEST = 1.0  # gap at the right end; larger ones stand there too
_MEANS = (
    f"Diamonds: mean over instances with its {style.COVERAGE} interval about other tasks of the "
    "family (bootstrap over instances and runs)."
)


@figure(
    "gaps-by-family",
    "Gap to the best known reward, by family",
    "Dots: instances (mean over runs), on an axis that is linear up to 2 % and logarithmic beyond; "
    f"gaps above 100 % stand at the right end. {_MEANS}",
)
def gaps_by_family(study: Study) -> Parts:
    """Gap to the best known reward of each instance, by method and family."""
    data = instance_gaps(study)
    if not len(data):
        raise missing(study, "no solved runs on instances of a family of tasks")
    order = data.groupby("method").gap.mean().sort_values().index.tolist()
    looks = looks_in(study, order)
    families = list(dict.fromkeys(data.family))
    size = style.TWO, 0.9 + 0.19 * len(order)
    drawing, panels = style.panels((1, len(families)), size, sharey=True)
    for axes, family in zip(panels, families, strict=True):
        for place, label in enumerate(order):
            rows = data[(data.method == label) & (data.family == family)]
            rows = rows.assign(gap=rows.gap.clip(upper=_FARTHEST))
            draw_instances(axes, -place, rows, "gap", looks[label]["color"])
        axes.set_xscale("symlog", linthresh=0.02, linscale=0.5)
        axes.set_xlim(-0.004, _FARTHEST * 1.15)
        axes.set_xticks([0, 0.02, 0.1, 0.5], ["0", "2", "10", "50"])
        axes.minorticks_off()
        axes.set_title(family.partition("/")[0])
    style.name_rows(panels[0], [name_of(label) for label in order])
    panels[len(panels) // 2].set_xlabel("gap to the best known reward (%)")
    style.letters(panels)
    return drawing, data, f"Gaps of instances by method and family. {means_of(data)}.", ()


def draw_instances(axes: Axes, y: float, rows: pd.DataFrame, name: str, color: str) -> None:
    """A dot for each instance about a height, and on it their mean with its interval."""
    if not len(rows):
        return
    heights = y + 0.11 * (np.arange(len(rows)) % 3 - 1)
    dot: Any = {"color": color, "markersize": 2.5, "alpha": 0.5, "markeredgewidth": 0}
    axes.plot(rows[name], heights, "o", linestyle="", **dot)
    first = rows.iloc[0]
    axes.plot([first.mean_low, first.mean_high], [y, y], color=style.INK, linewidth=1)
    diamond: Any = {"markersize": 4, "markerfacecolor": style.BACKGROUND, "zorder": 4}
    axes.plot(first["mean"], y, "D", color=style.INK, **diamond)


def means_of(data: pd.DataFrame) -> str:
    """Means over instances in words."""
    ends = data.drop_duplicates(["method", "family"])
    return spoken(ends, "{method}, {family}: {mean:.1%}")
