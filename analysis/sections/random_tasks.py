"""Section on gaps of methods on random tasks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, looks_in, spoken
from coartic.analysis.standings import compared
from coartic.analysis.statistics.instances import Scores, other_tasks
from coartic.analysis.study import Study, cached, solved
from coartic.analysis.table import Row, Rows, run_ids, table


@cached
def on_instances(study: Study) -> pd.DataFrame:
    """Return the solved runs of compared methods on instances of families, with the label of the
    row of the method in column ``method``, by ``place``, the number of the instance from 0."""
    parts = [solved(runs).assign(method=method) for method, runs in compared(study).items()]
    every = pd.concat([*parts, study.runs[:0]], ignore_index=True)
    instances = [name for name in study.optima if study.tasks[name].family is not None]
    place = every.task.map({name: number for number, name in enumerate(instances)})
    return every[place.notna()].assign(place=place).sort_values("place", kind="stable")


def _by_family(runs: pd.DataFrame) -> Scores:
    """Return the gaps of the runs on each instance, by family; runs as of :func:`on_instances`."""
    return {
        str(family): [part.gap.to_numpy(np.float64) for _, part in of_family.groupby("place")]
        for family, of_family in runs.groupby("family", sort=False)
    }


@table(
    "Gap to the best known reward, in per cent of it: mean over instances",
    "method; instances; gap[]: gap (%) .1; in [*]: {} (%) .1",
)
def list_family_gaps(study: Study) -> Rows:
    """List gaps to the best known reward over families with two arms, and in each family, with
    intervals about other tasks."""
    every, rows = on_instances(study), list[tuple[str, Row]]()
    families = every.family.unique()
    two_armed = {*every.family[every.arms > 1]}
    for method in compared(study):
        runs = every[every.method == method]
        if not len(runs):
            continue
        of_two_arms = runs[runs.family.isin(two_armed)]
        counted = of_two_arms if len(of_two_arms) else runs  # the gap is a mean over these
        row: Row = {"method": method, "instances": counted.task.nunique(), "gap": math.nan}
        scores = _by_family(runs)
        if two_armed and two_armed <= scores.keys():
            row |= other_tasks(_by_family(of_two_arms)).columns("gap")
        row |= {f"in {family}": math.nan for family in families}
        for family, part in scores.items():
            row |= other_tasks({family: part}).columns(f"in {family}")
        rows.append((method, row | run_ids(runs)))
    yield from sorted(rows, key=lambda item: (math.isnan(item[1]["gap"]), item[1]["gap"]))


@figure(
    "Gap to the best known reward, by family",
    "Dots: instances (mean over runs), on an axis that is linear up to 2 % and logarithmic beyond; "
    "gaps above 100 % stand at the right end. Diamonds: mean over instances with its "
    f"{style.COVERAGE} interval about other tasks of the family (bootstrap over instances and "
    "runs).",
)
def draw_gaps_by_family(study: Study) -> Parts | None:
    """Draw gaps to the best known rewards of instances, by method and family."""
    runs, single = on_instances(study), study.methods.parts.map(len) == 1
    methods = study.methods[~study.methods.under.isin(runs.method) & single]
    runs = runs[runs.method.isin(methods.index)]
    if not len(runs):
        return None
    parts = []
    for (method, family), part in runs.groupby(["method", "family"], sort=False):
        mean = other_tasks(_by_family(part)).columns("mean")
        dots = part.groupby("task", sort=False).gap.mean().reset_index()
        dots = dots.assign(method=str(method), family=str(family), **mean, instances=len(dots))
        parts.append(dots)
    data = pd.concat(parts, ignore_index=True).astype({"gap": float})
    order = data.groupby("method").gap.mean().sort_values().index.tolist()
    looks = looks_in(study, order)
    families = list(dict.fromkeys(data.family))
    size = style.TWO, 0.9 + 0.19 * len(order)
    drawing, panels = style.panels((1, len(families)), size, sharey=True)
    for axes, family in zip(panels, families, strict=True):
        for label, rows in data[data.family == family].groupby("method"):
            place = order.index(label)
            heights = -place + 0.11 * (np.arange(len(rows)) % 3 - 1)
            size = looks[label]["markersize"]
            dot: Any = {
                "color": looks[label]["color"],
                "markersize": size / 2,
                "markeredgewidth": 0,
            }
            gaps = rows.gap.clip(upper=1.0)
            axes.plot(gaps, heights, "o", linestyle="", alpha=0.5, **dot)
            mean = rows.iloc[0]
            ends = [mean.mean_low, mean.mean_high]
            axes.plot(ends, [-place, -place], color=style.INK, linewidth=1)
            diamond: Any = {"markersize": size, "markerfacecolor": style.BACKGROUND, "zorder": 4}
            axes.plot(mean["mean"], -place, "D", color=style.INK, **diamond)
        axes.set_xscale("symlog", linthresh=0.02, linscale=0.5)
        axes.set_xlim(-0.004, 1.15)
        axes.set_xticks([0, 0.02, 0.1, 0.5], ["0", "2", "10", "50"])
        axes.minorticks_off()
        axes.set_title(family.partition("/")[0])
    style.name_rows(panels[0], [*methods.title[order]])
    for label, method in zip(panels[0].get_yticklabels(), order, strict=True):
        label.set_fontweight("normal" if methods.built_in[method] else "bold")
    panels[len(panels) // 2].set_xlabel("gap to the best known reward (%)")
    style.letters(panels)
    first = data.drop_duplicates(["method", "family"])
    means = spoken(study, first, "{title}, {family}: {mean:.1%}")
    return drawing, data, f"Gaps of instances by method and family. {means}.", ()
