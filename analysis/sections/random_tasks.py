"""Section on gaps of methods on random tasks."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, looks_in, name_in_figure, spoken
from coartic.analysis.method_frame import without_settings
from coartic.analysis.standings import compared_runs, reference, runs_by_method
from coartic.analysis.statistics.instances import Scores, other_tasks
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, run_ids, table
from coartic.estimates import Estimate


@cached
def _instances(study: Study) -> dict[str, list[str]]:
    """Return, by family, the names of its instances (random tasks) with a best known reward."""
    families: dict[str, list[str]] = {}
    for name in study.optima:
        if (family := study.tasks[name].family) is not None:
            families.setdefault(family, []).append(name)
    return families


@cached
def on_instances(study: Study) -> pd.DataFrame:
    """Return the runs of methods on those instances with a best known reward on which the method
    solved every run, sorted by family and instance as in :func:`_instances`. Column ``method`` has
    the label of the method's row in the ranking. Do not change the frame: it is kept."""
    runs = compared_runs(study)
    names = [*itertools.chain.from_iterable(_instances(study).values())]
    failed = runs.reward.isna().groupby([runs.ranked_as, runs.task]).transform("any")
    runs = runs[runs.task.isin(names) & ~failed]
    place = pd.Categorical(runs.task, names)
    runs = runs.assign(place=place, method=runs.ranked_as)
    return runs.sort_values("place", kind="stable")


def _by_family(study: Study, runs: pd.DataFrame) -> Scores:
    """Return, by family, the gaps of a method's runs on each instance of the family, a list of
    arrays of shape ``(n,)``. ``runs`` are the method's rows of :func:`on_instances`; a family is
    left out if one of its instances has no run there."""
    return {
        str(family): [
            part.gap.to_numpy(np.float64) for _, part in of_family.groupby("task", sort=False)
        ]
        for family, of_family in runs.groupby("family", sort=False)
        if of_family.task.nunique() == len(_instances(study)[str(family)])
    }


@table(
    "Gap to the {reference}, in per cent of it: mean over instances",
    "method; instances; missing; gap[]: gap (%) .1; in [*]: {} (%) .1",
)
def list_family_gaps(study: Study) -> Rows:
    """Yield a row for each method that ran on instances: its gap to the best known reward, over
    families with two arms and in each family, with intervals for other tasks of the families.

    A method that did not solve every run of every instance of a family has gap NaN in the family,
    and over families with two arms if the family has two. ``instances`` is the number of instances
    on which it solved every run, ``missing`` the number of other instances, of families with two
    arms, or, for a method that ran on families with one arm alone, of families on which it ran.
    """
    every, rows, families = on_instances(study), list[tuple[str, Row]](), _instances(study)
    two_armed = {each for each in families if len(study.tasks[families[each][0]].hands) > 1}
    for method, of_method in runs_by_method(study).items():
        runs, ran = every[every.method == method], {*of_method.family.dropna()}
        scores, over = _by_family(study, runs), two_armed if two_armed & ran else ran
        solved = runs[runs.family.isin(over)].task.nunique()
        missing = sum(len(families[family]) for family in over) - solved
        row: Row = {"method": method, "instances": solved, "missing": missing, "gap": math.nan}
        if two_armed and two_armed <= scores.keys():
            of_two_arms = {family: scores[family] for family in scores if family in two_armed}
            row |= other_tasks(of_two_arms).columns("gap")
        row |= {f"in {family}": math.nan for family in families}
        for family, part in scores.items():
            row |= other_tasks({family: part}).columns(f"in {family}")
        if ran:
            rows.append((method, row | run_ids(runs)))
    yield from sorted(rows, key=lambda item: (math.isnan(item[1]["gap"]), item[1]["gap"]))


@figure(
    "Gap by family",
    "Dots: instances (mean over runs), on an axis that is linear up to 2 % and logarithmic beyond. "
    "Diamonds: mean over instances with its "
    f"{style.COVERAGE} interval about other tasks of the family (bootstrap over instances and "
    "runs), for methods that solved every run.",
)
def draw_gaps_by_family(study: Study) -> Parts | None:
    """Draw the gap to the best known reward, mean over runs, of each instance that a method solved
    in every run, a panel for each family and a row for each method, without settings whose method
    is there; None without such runs."""
    runs, rows = on_instances(study), study.methods
    methods = without_settings(rows[rows.index.isin(runs.method)])
    runs = runs[runs.method.isin(methods.index)]
    if not len(runs):
        return None
    parts = []
    for (method, family), part in runs.groupby(["method", "family"], sort=False):
        scores = _by_family(study, part)
        mean = (other_tasks(scores) if scores else Estimate(math.nan)).columns("mean")
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
            dot: Any = {"color": looks[label]["color"], "markersize": size / 2, "alpha": 0.5}
            gaps = rows.gap.clip(upper=1.0)
            axes.plot(gaps, heights, "o", linestyle="", markeredgewidth=0, **dot)
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
    style.name_rows(panels[0], [name_in_figure(study, label) for label in order])
    for label, method in zip(panels[0].get_yticklabels(), order, strict=True):
        label.set_fontweight("normal" if methods.built_in[method] else "bold")
    panels[len(panels) // 2].set_xlabel(f"gap to the {reference(study, study.optima)} (%)")
    style.letters(panels)
    first = data.drop_duplicates(["method", "family"]).dropna(subset="mean")
    means = spoken(study, first, "{title}, {family}: {mean:.1%}")
    words = f" {means}." if means else ""
    alt = f"Gaps of instances by method and family.{words}"
    return drawing, data, alt, " Gaps above 100 % stand at the right end." * any(data.gap > 1)
