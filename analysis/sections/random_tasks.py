"""Section on gaps of methods on random tasks."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, looks_in, spoken
from coartic.analysis.method_frame import headline_methods
from coartic.analysis.optima import gap_share
from coartic.analysis.standings import best_of_instances, called, compared, is_learner, reference
from coartic.analysis.statistics.instances import Scores, other_tasks
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.words import listed, number, percent


@cached
def solved(study: Study) -> pd.DataFrame:
    """Return a row for each compared method on each instance with a solved run, by family.

    Columns ``method``, ``family``, ``task``, ``cell``, and ``gap``: the gaps of the solved runs to
    the best known reward, as shares of it, shape ``(n,)``.
    """
    instances = best_of_instances(study)
    families = dict.fromkeys(str(study.tasks[name].family) for name in instances)
    rows = []
    for family, (method, cells) in itertools.product(families, compared(study).items()):
        for name in instances:
            cell = cells.get(name)
            if study.tasks[name].family == family and cell is not None and len(cell.good):
                rows.append((method, family, name, cell, cell.gaps))
    return pd.DataFrame(rows, columns=["method", "family", "task", "cell", "gap"])


def by_family(rows: pd.DataFrame) -> Scores:
    """Return the gaps of instances by family."""
    return {
        str(family): [*of_family.gap] for family, of_family in rows.groupby("family", sort=False)
    }


@table("method; instances; gap[]: gap (%) .1; in *: {} (%) .1")
def list_family_gaps(study: Study) -> Rows:
    """List gaps to the best known reward over families with two arms, and in each family, with
    intervals about other tasks."""
    every, rows = solved(study), list[tuple[str, Row]]()
    families = every.family.unique()
    hands = every.task.map({name: len(task.hands) for name, task in study.tasks.items()})
    two_armed = {*every.family[hands > 1]}
    for method, of_method in every.groupby("method", sort=False):
        row: Row = {"method": method, "instances": len(of_method), "gap": math.nan}
        if (of_two_arms := of_method.family.isin(two_armed)).any():
            row["instances"] = int(of_two_arms.sum())  # the gap is a mean over these
        scores = by_family(of_method)
        if two_armed and two_armed <= scores.keys():
            both = {family: part for family, part in scores.items() if family in two_armed}
            row |= other_tasks(both).columns("gap")
        row |= {f"in {family}": math.nan for family in families}
        for family, part in scores.items():
            row |= other_tasks({family: part}).columns(f"in {family}")
        rows.append((str(method), row | runs_of(*of_method.cell)))
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
    methods = study.methods[(study.methods.under == "") & (study.methods.parts.map(len) == 1)]
    rows = solved(study)
    rows = rows[rows.method.isin(methods.index)]
    if not len(rows):
        return None
    columns = ["method", "family", "task", "gap", "mean", "mean_low", "mean_high", "instances"]
    parts = []
    for _, part in rows.groupby(["method", "family"], sort=False):
        mean = other_tasks(by_family(part)).columns("mean")
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
    style.name_rows(panels[0], [*methods.title[order]])
    panels[len(panels) // 2].set_xlabel("gap to the best known reward (%)")
    style.letters(panels)
    first = data.drop_duplicates(["method", "family"]).join(methods.title, on="method")
    means = spoken(first, "{title}, {family}: {mean:.1%}")
    return drawing, data, f"Gaps of instances by method and family. {means}.", ()


def on_random_tasks(study: Study) -> str:
    """Say the gaps of the nearest methods to the best known reward, over families with two arms."""
    best = best_of_instances(study)
    gaps = list_family_gaps(study).dropna(subset="gap")
    gaps = gaps[gaps.index.isin(headline_methods(study.methods.loc[gaps.index]))].head(4)
    if not len(gaps):
        return ""
    rows = study.methods.loc[gaps.index].to_dict("records")
    families = gaps.filter(regex="^in .*/v[0-9]+$")
    ranges = [
        f" ({number(100 * least, 1)} to {percent(most)} by family)" if least < most else ""
        for least, most in zip(families.min(axis=1), families.max(axis=1), strict=True)
    ]
    ends = [
        f"{called(row)} {percent(gap)}{by}"
        for row, gap, by in zip(rows, gaps.gap, ranges, strict=True)
    ]
    first, *others = ends
    learner = [end for row, end in zip(rows[1:], others, strict=True) if is_learner(row)]
    second = learner or others[:1]
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
        f"Nearest to the {to}: {'; '.join([first, *second])}.\n"
        f"Gaps to the {to} on {len(best)} random tasks (means over families with two "
        f"arms): {', '.join(ends)}. On {proven or 'none'} of them this reward is the proven "
        f"optimum{elsewhere + listed(medians) if medians else ''}."
    )
