"""Gaps of methods on random tasks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, looks_in, spoken
from coartic.analysis.methods import LEARNERS, is_setting, most_exploring, name_of
from coartic.analysis.optima import gap_share
from coartic.analysis.statistics.instances import other_tasks
from coartic.analysis.study import Study
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics.instances import best_of_instances, by_family, solved
from coartic.analysis.topics.scores import reference
from coartic.analysis.words import listed, number


@table("method, instances, gap[], to_bound[], in *")
def list_family_gaps(study: Study) -> Rows:
    """Gap to the best known reward over families with two arms, and in each family."""
    every = solved(study)
    drawn = [study.tasks[name] for name in best_of_instances(study)]
    two_armed = {str(task.family) for task in drawn if len(task.hands) > 1}
    rows: list[tuple[str, Row]] = []
    for label in (name for name in every.label.unique() if not is_setting(name)):
        of_label = every[every.label == label]
        row: Row = {"method": label, "instances": len(of_label), "gap": math.nan}
        for column in ("gap", "to_bound"):
            scores = by_family(of_label, column)
            if two_armed and two_armed <= scores.keys():
                both = {family: part for family, part in scores.items() if family in two_armed}
                row |= other_tasks(both).columns(column)
        row |= {f"in {family}": math.nan for family in every.family.unique()}
        for family, part in by_family(of_label, "gap").items():
            row[f"in {family}"] = other_tasks({family: part}).value
        cells = [
            cell
            for (task, name), cell in study.cells.items()
            if study.tasks[task].family is not None
            and name == (most_exploring(study.tasks[task]) if label == "learner" else label)
        ]
        rows.append((label, row | runs_of(*cells)))
    yield from sorted(rows, key=lambda item: (math.isnan(item[1]["gap"]), item[1]["gap"]))


@figure(
    "Gap to the best known reward, by family",
    "Dots: instances (mean over runs), on an axis that is linear up to 2 % and logarithmic beyond; "
    "gaps above 100 % stand at the right end. Diamonds: mean over instances with its "
    f"{style.COVERAGE} interval about other tasks of the family (bootstrap over instances and "
    "runs).",
)
def draw_gaps_by_family(study: Study) -> Parts | None:
    """Gap to the best known reward of each instance, by method and family."""
    rows = solved(study).rename(columns={"label": "method"})
    rows = rows[~rows.method.str.contains(" ") & (rows.method != "learner")]
    if not len(rows):
        return None
    columns = ["method", "family", "task", "gap", "mean", "mean_low", "mean_high", "instances"]
    parts = []
    for _, part in rows.groupby(["method", "family"], sort=False):
        mean = other_tasks(by_family(part, "gap")).columns("mean")
        parts.append(part.assign(gap=part.gap.map(np.mean), **mean, instances=len(part))[columns])
    data = pd.concat(parts, ignore_index=True)
    order = data.groupby("method").gap.mean().sort_values().index.tolist()
    looks = looks_in(study, order)
    families = list(dict.fromkeys(data.family))
    size = style.TWO, 0.9 + 0.19 * len(order)
    drawing, panels = style.panels((1, len(families)), size, sharey=True)
    for axes, family in zip(panels, families, strict=True):
        for label, rows in data[data.family == family].groupby("method"):
            place = order.index(label)
            heights = -place + 0.11 * (np.arange(len(rows)) % 3 - 1)
            dot: Any = {"color": looks[label]["color"], "markersize": 2.5, "markeredgewidth": 0}
            gaps = rows.gap.clip(upper=1.0)
            axes.plot(gaps, heights, "o", linestyle="", alpha=0.5, **dot)
            mean = rows.iloc[0]
            ends = [mean.mean_low, mean.mean_high]
            axes.plot(ends, [-place, -place], color=style.INK, linewidth=1)
            diamond: Any = {"markersize": 4, "markerfacecolor": style.BACKGROUND, "zorder": 4}
            axes.plot(mean["mean"], -place, "D", color=style.INK, **diamond)
        axes.set_xscale("symlog", linthresh=0.02, linscale=0.5)
        axes.set_xlim(-0.004, 1.15)
        axes.set_xticks([0, 0.02, 0.1, 0.5], ["0", "2", "10", "50"])
        axes.minorticks_off()
        axes.set_title(family.partition("/")[0])
    style.name_rows(panels[0], [name_of(label) for label in order])
    panels[len(panels) // 2].set_xlabel("gap to the best known reward (%)")
    style.letters(panels)
    means = spoken(data.drop_duplicates(["method", "family"]), "{method}, {family}: {mean:.1%}")
    return drawing, data, f"Gaps of instances by method and family. {means}.", ()


def on_random_tasks(study: Study) -> str:
    """Gaps of the nearest methods to the best known reward, over families with two arms."""
    best = best_of_instances(study)
    gaps = list_family_gaps(study).dropna(subset="gap")
    gaps = gaps[~gaps.method.isin(LEARNERS)].head(4)  # "learner" is these together
    if not len(gaps):
        return ""
    ends = [
        f"{'the learner' if label == 'learner' else name_of(label)} {number(100 * gap, 1)} %"
        for label, gap in zip(gaps.method, gaps.gap, strict=True)
    ]
    first, *others = ends
    beside = [end for end in others if end.startswith("the learner")] or others[:1]
    unproven = [
        (str(study.tasks[name].family).partition("/")[0], 100 * gap_share(each.reward, each.bound))
        for name, each in best.items()
        if each.bound is not None and not each.proven
    ]
    loose = pd.DataFrame(unproven, columns=["family", "gap"]).groupby("family", sort=False).median()
    medians = [f"{family} {number(gap, 0)} %" for family, gap in loose.gap.items()]
    elsewhere = "; elsewhere its median distance to the proven bound is "
    proven = sum(each.proven for each in best.values())
    to = reference(study, best)
    return (
        f"Nearest to the {to}: {'; '.join([first, *beside])}.\n"
        f"Gaps to the {to} on {len(best)} random tasks (means over families with two "
        f"arms): {', '.join(ends)}. On {proven or 'none'} of them this reward is the proven "
        f"optimum{elsewhere + listed(medians) if medians else ''}."
    )
