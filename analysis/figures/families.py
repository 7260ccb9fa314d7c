"""What holds over instances of families: gaps by method, and more exploration, pair by pair."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from coartic.analysis.figures import style
from coartic.analysis.figures.choice import missing
from coartic.analysis.figures.plot import Plot, spoken, worded
from coartic.analysis.generality.exploration import CONTRASTS, gains
from coartic.analysis.generality.sample import Sample, sample
from coartic.analysis.methods import INITIAL, name_of
from coartic.analysis.statistics.instances import RESAMPLES, Runs, other_tasks, value
from coartic.analysis.study import Study

_FARTHEST = 1.0
"""Gap at the right end; what is beyond stands at the end."""


def _sample(study: Study) -> Sample:
    found = sample(study)
    if found is None:
        raise missing(study, "no instances of a family of tasks")
    return found


@style.styled
def gaps_by_family(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """Gap to the best known reward of each instance, by method and family.

    By default of methods without variants. Raises CoarticError where the folder has no instances.
    """
    instances = _sample(study)
    labels = [label for label in methods or instances.labels if methods or " " not in label]
    data = pd.DataFrame(
        [
            {"method": label, "family": family, "task": name, "gap": float(np.mean(gap))}
            for family, names in instances.families.items()
            for label in labels
            for name in names
            if (gap := instances.gap(name, label)) is not None
        ]
    )
    if data.empty:
        raise missing(study, f"no solved runs of {', '.join(labels)} on instances of families")
    ends = _means(instances, labels)
    order = data.groupby("method").gap.mean().sort_values().index.tolist()
    looks = style.looks(order)
    families = list(instances.families)
    rows, columns = style.grid(len(families), len(families))
    size = style.TWO, (0.9 + 0.19 * len(order)) * rows
    figure, panels = style.figure_of((rows, columns), size, sharey=True)
    for axes, family in zip(panels, families, strict=True):
        for place, label in enumerate(order):
            own = data[(data.method == label) & (data.family == family)].gap.to_numpy()
            if not len(own):
                continue
            row = ends[(ends.method == label) & (ends.family == family)].iloc[0]
            dot = {"color": looks[label].color, "markersize": 2.4, "alpha": 0.5}
            heights = -place + 0.12 * (np.arange(len(own)) % 3 - 1)
            _instances(axes, -place, row, (np.minimum(own, _FARTHEST), heights), dot)
        axes.set_xscale("symlog", linthresh=0.02, linscale=0.5)
        axes.set_xlim(-0.004, _FARTHEST * 1.15)
        axes.set_xticks([0, 0.02, 0.1, 0.5], ["0", "2", "10", "50"], minor=False)
        axes.minorticks_off()
        axes.set_title(family.partition("/")[0])
    style.name_rows(panels[0], [name_of(label) for label in order])
    panels[len(panels) // 2 if columns > 1 else -1].set_xlabel("gap to the best known reward (%)")
    style.letters(panels)
    joined = data.merge(ends, on=["method", "family"])
    told = spoken(ends, "{method}, {family}: {mean:.1%}")
    return worded("gaps-by-family", figure, joined, resamples=RESAMPLES, means=told)


def _instances(
    axes: Axes, y: float, row: pd.Series, places: tuple[ArrayLike, ArrayLike], dot: dict[str, Any]
) -> None:
    """Dots at their places about a height, and on it their mean with its interval."""
    axes.plot(*places, "o", markeredgewidth=0, linestyle="", **dot)
    axes.plot([row.low, row.high], [y, y], color=style.INK, linewidth=1)
    mean: Any = {"markersize": 4, "markerfacecolor": style.PAPER, "zorder": 4}
    axes.plot(row["mean"], y, "D", color=style.INK, **mean)


def _mean(family: str, own: Sequence[Runs]) -> dict[str, float]:
    """Over the instances of a family, with its interval."""
    found = other_tasks({family: own})
    return {"mean": found.estimate, "low": found.low, "high": found.high}


def _means(sample: Sample, labels: Sequence[str]) -> pd.DataFrame:
    return pd.DataFrame(
        [
            {"method": label, "family": family, **_mean(family, own), "instances": len(own)}
            for label in labels
            for family, own in sample.gaps(label).items()
        ]
    )


@style.styled
def exploration_by_family(study: Study, *, methods: Sequence[str] | None = None) -> Plot:
    """What one condition gains over another on each instance, by family.

    ``methods`` chooses nothing here: pairs of the paper's conditions are shown, without those
    against the initial solution. Raises CoarticError where the folder has no such pairs.
    """
    instances = _sample(study)
    rows = []
    for first, second in (pair for pair in CONTRASTS if pair[1] != INITIAL):
        names = instances.shared(first, second)
        scores = gains(instances, first, second, names)
        for family, own in scores.items():
            pair = f"{name_of(first)} over {name_of(second)}"
            found = _mean(family, own)
            rows += [
                {"method": pair, "family": family, "task": name, "gain": value(runs), **found}
                for name, runs in zip(names[family], own, strict=True)
            ]
    if not rows:
        raise missing(study, "no two of the paper's conditions on an instance of a family")
    data = pd.DataFrame(rows)
    families = list(dict.fromkeys(data.family))
    order = list(dict.fromkeys(data.method))
    shape = style.grid(len(order), len(order))
    size = style.TWO, 2.0 * shape[0]
    figure, panels = style.figure_of(shape, size, sharey=True, sharex=True)
    for axes, pair in zip(panels, order, strict=True):
        axes.axvline(0, **style.INITIAL)
        for place, family in enumerate(families):
            own = data[(data.method == pair) & (data.family == family)]
            if not len(own):
                continue
            color = style.PALETTE[place % len(style.PALETTE)]
            heights = -place + 0.1 * (np.arange(len(own)) % 5 - 2)
            dot = {"color": color, "markersize": 2.6, "alpha": 0.55}
            _instances(axes, -place, own.iloc[0], (own.gain.to_numpy(), heights), dot)
        axes.set_xscale("symlog", linthresh=0.05, linscale=1.0)
        axes.minorticks_off()
        axes.set_xticks([-0.5, -0.1, 0, 0.1, 0.5], ["−50", "−10", "0", "10", "50"])
        axes.set_title(pair)
    style.name_rows(panels[0], [family.partition("/")[0] for family in families])
    panels[len(panels) // 2].set_xlabel("gain (% of the best known reward)")
    style.letters(panels)
    ends = data.drop_duplicates(["method", "family"])
    told = spoken(ends, "{method}, {family}: {mean:+.1%}")
    return worded("exploration-by-family", figure, data, resamples=RESAMPLES, means=told)
