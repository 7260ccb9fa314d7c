"""Section on the ranking: gaps and shares of methods, over tasks and on each task."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, Plot, figure, looks_in, name_in_figure, spoken
from coartic.analysis.method_frame import GROUPS, without_settings
from coartic.analysis.methods import EC1, EC4
from coartic.analysis.optima import gap_share
from coartic.analysis.sections.costs import best_after, improvements
from coartic.analysis.standings import (
    compared_runs,
    ranked_tasks,
    ranking_budget,
    reference,
    runs_by_method,
    runs_on,
    solved_tasks,
    standings,
)
from coartic.analysis.statistics.hypotheses import (
    bootstrap_test,
    exchange_test,
    holm,
    stratified_test,
)
from coartic.analysis.study import Study, cached, one_by_one, solved
from coartic.analysis.table import Row, Rows, run_ids, table
from coartic.analysis.words import capital, interval, listed, marked, number
from coartic.estimates import FEWER_RESAMPLES, LEVEL, Estimate, mean_of_means
from coartic.internal.text import counted
from coartic.robot import Array

_EARLY = 1_000
"""Number of trials after which the ranking has a further gap, ``gap_early``."""


@cached
def _counts_against_learner(study: Study) -> dict[str, dict[str, int]]:
    """Return, by label, on how many tasks of :func:`.one_by_one` the mean reward of a method is
    ``better`` and ``worse`` than that of the learner that explores most (EC1, with two arms EC4).

    A task counts if both solved every run and the rewards differ significantly: by the two-sided
    exchange test, or for a deterministic method, whose reward counts as exact, by the bootstrap
    test, corrected over the tasks of the method (Holm). Runs with the same seed are not compared as
    pairs. A method is left out if no test could have found a difference.
    """
    counts = dict[str, dict[str, int]]()
    for label, stochastic in study.methods.stochastic.items():
        ahead, tests = list[bool](), list[Estimate]()
        for name, task in one_by_one(study).items():
            runs = study.cells.get((name, str(label)))
            learner = study.cells.get((name, EC4 if len(task.hands) > 1 else EC1))
            if runs is None or learner is None or runs is learner:
                continue
            rewards, learned = (
                solved(each).reward.to_numpy(np.float64) for each in (runs, learner)
            )
            if len(rewards) == len(runs) and len(learned) == len(learner):
                ahead.append(bool(rewards.mean() > learned.mean()))
                tests.append(
                    exchange_test(learned, rewards, "two-sided")
                    if stochastic
                    else bootstrap_test(learned, float(rewards[0]), "two-sided")
                )
        least = [test.least_p for test in tests if not math.isnan(test.least_p)]
        if least and len(least) * min(least) < LEVEL:
            sure = [
                better
                for better, p in zip(ahead, holm([test.p for test in tests]), strict=True)
                if p < LEVEL
            ]
            counts[str(label)] = {"better": sum(sure), "worse": len(sure) - sum(sure)}
    return counts


def _gaps_after(study: Study, trials: int) -> pd.Series:
    """Return the mean gap over tasks of the best of the first ``trials`` trials of each ranked
    method, by label: NaN if a run had no solution by then. Runs without rewards of trials keep
    their gap."""
    learned, runs = improvements(study), compared_runs(study)
    best = [
        float(best_after(learned[run_id], trials))
        if not math.isnan(reward) and len(learned.get(run_id, ((),))[0])
        else reward
        for run_id, reward in zip(runs.run_id, runs.reward.astype(float), strict=True)
    ]
    gaps = pd.Series(gap_share(best, runs.best_known.astype(float)), runs.index)
    by_task = gaps.groupby([runs.ranked_as, runs.task]).agg(pd.Series.mean, skipna=False)
    return by_task.groupby(level=0).agg(pd.Series.mean, skipna=False)


def _standing_rows(study: Study, *, ranked: bool) -> Rows:
    """Yield a row for each method of :func:`.standings` that is ``ranked``, or for the others."""
    rows = standings(study)
    rows = rows[(rows.why == "") == ranked]
    single = [task for task in ranked_tasks(study) if study.tasks[task].family is None]
    early = _gaps_after(study, _EARLY).to_dict() if len(rows) else {}
    for label, row in rows.iterrows():
        runs = runs_by_method(study)[str(label)]
        gaps = runs.groupby("task").gap.mean()
        counts = [
            counts
            for each in runs.label.unique()
            if (counts := _counts_against_learner(study).get(each))
        ]
        entries: Row = {
            **{str(name): value for name, value in row.items()},
            "method": label,
            **{f"on {task}": gaps.get(task, math.nan) for task in single},
            "gap_early": early[label] if ranked else math.nan,
            "forward_kinematics": runs.forward_kinematics.mean(),
            "cpu_s": runs.cpu_s.mean(),
        }
        if counts:
            entries |= {name: sum(of[name] for of in counts) for name in ("better", "worse")}
        yield str(label), entries | run_ids(runs)


@table(
    "Gap and share of the possible gain, means over {tasks}, and gap on each",
    "method; gap[]: gap (%) .1; share[]: share of the gain (%) .0; information: use of the reward; "
    "better: better than the learner on (tasks); worse: worse on (tasks); "
    "gap_early: -; on *: {} (%) .1; note; without_gain: -; "
    "forward_kinematics: -; cpu_s: -; runs",
)
def list_ranking(study: Study) -> Rows:
    """Yield a row for each ranked method (:func:`.standings`), the smallest gap first: its gap and
    share of the gain over tasks, its gap on each task that is not random, its gap after a thousand
    trials, and means of what a run costs."""
    return _standing_rows(study, ranked=True)


@table(
    "Methods that are not ranked",
    "method; why: why not; gap[]: gap (%) .1; information: use of the reward; "
    "better: better than the learner on (tasks); worse: worse on (tasks); on *: {} (%) .1; note; "
    "tasks: solved tasks; runs; failed: failed runs",
)
def list_not_ranked(study: Study) -> Rows:
    """Yield a row for each method that is not ranked (:func:`.standings`), with the reason, the gap
    if it solved all tasks in another number of trials, and its gap on each task that is not
    random."""
    return _standing_rows(study, ranked=False)


@table(
    "Gaps of methods less the gap of the method against which they are compared, on the tasks that "
    "this method solved (positive: this method is better)",
    "method; against: compared with; difference[]: difference of gaps (%) .1; "
    "p_holm: p (corrected) .p; tasks; runs",
)
def list_differences(study: Study) -> Rows:
    """Yield a row for each other method: its gap less the gap of :attr:`.Study.against`, on the
    tasks on which the latter solved every run; the smallest difference first.

    If :attr:`.Study.against` is empty, the compared method is the first of the ranking where one
    parameter is varied; otherwise each method from a file is compared with the built-in methods
    with the same use of the reward. Methods that lack or failed a run there or were asked for
    another number of trials, and settings and ablations of methods that ran
    (:attr:`.Study.methods`, ``under``), are left out. Intervals are for other runs on the same
    tasks; p is two-sided (:func:`.stratified_test`), corrected over the rows of the compared method
    (Holm).
    """
    methods, rows = study.methods, standings(study)
    solved_some = [label for label in rows.index if solved_tasks(study, str(label))]
    chosen = [study.against] if study.against else []
    if study.varied[0] and not study.against:
        chosen = [*rows.index[rows.why == ""][:1]]
    own = [label for label in solved_some if not methods.built_in[label]]
    for against in chosen or own:
        tasks, found = solved_tasks(study, against), list[tuple[Estimate, str]]()
        asked = {*runs_on(study, against, tasks).budget.dropna()}
        alike = methods.built_in & (methods.information == methods.information[against])
        if chosen:
            alike = methods.index != against
        for row in methods.index[alike & (methods.under == "")].intersection(rows.index):
            runs = runs_on(study, row, tasks) if tasks else compared_runs(study)[:0]
            names = runs.label.unique()
            name = names[0] if len(names) == 1 else row
            budgets = {*runs.budget.dropna()}
            is_fair = budgets == asked or not (budgets and asked) or ranking_budget(study) is None
            if len(runs) and runs.reward.notna().all() and is_fair and name != against:
                found.append((_difference_of_gaps(study, name, against, tasks), name))
        adjusted = holm([each.p for each, _ in found]) if found else []
        in_order = sorted(zip(found, adjusted, strict=True), key=lambda each: each[0][0].value)
        for (difference, name), p in in_order:
            runs = runs_on(study, name, tasks)
            entries: Row = {"method": name, "against": against}
            entries |= {"tasks": len(tasks), "runs": len(runs)}
            entries |= {**difference.columns("difference"), "p_holm": p}
            yield f"{against} {name}", entries | run_ids(runs, runs_on(study, against, tasks))


def _difference_of_gaps(study: Study, first: str, second: str, tasks: Sequence[str]) -> Estimate:
    """Return the mean gap of the ``first`` method (a label) less the mean gap of the ``second``,
    each a mean over ``tasks``.

    Gaps of deterministic methods are taken as exact. The interval is for other runs on these tasks;
    two exact gaps have no interval and no p-value.
    """
    exact, weights, drawn = 0.0, list[float](), list[Array]()
    pairs: dict[Any, list[Array | float]] = {task: [] for task in tasks}
    for sign, method in ((1, first), (-1, second)):
        for task, of_task in runs_on(study, method, tasks).groupby("task").gap:
            weight, gaps = sign / len(tasks), of_task.to_numpy(np.float64)
            if study.methods.stochastic[method]:
                weights.append(weight)
                drawn.append(gaps)
                pairs[task].append(gaps)
            else:
                exact += weight * gaps.mean()
                pairs[task].append(float(gaps.mean()))
    if not drawn:
        return Estimate(exact)
    sampled = mean_of_means(drawn, weights, FEWER_RESAMPLES)
    ends = sampled.value + exact, sampled.low + exact, sampled.high + exact
    return Estimate(*ends, p=stratified_test([(one, other) for one, other in pairs.values()]))


def draw_ranking(study: Study, /, **how: Any) -> Plot | None:
    """Draw the gap against the values of the only parameter that is varied (:attr:`.Study.varied`),
    or else, also with fewer than two gaps of values, gaps of ranked methods; None without a gap.
    ``how``: see :data:`.DrawsFigure`."""
    plot = _draw_varied(study, **how) or _draw_gaps(study, **how)
    return plot and replace(plot, id="ranking")


@figure(
    "Gap by value of a parameter",
    "Gap from the mean reward to the {reference}, as a share of it, with its "
    f"{style.COVERAGE} bootstrap interval over runs, by the value of the only parameter that is "
    "varied. n = {n} runs of a value.",
)
def _draw_varied(study: Study) -> Parts | None:
    """Draw gaps against the values of the only parameter that is varied; None with fewer than two
    values that have a gap."""
    name, values = study.varied
    rows = standings(study).query("why == ''")
    rows = rows.loc[[label for label in values if label in rows.index]]
    if len(rows) < 2:
        return None
    rows = rows.assign(value=[values[label] for label in rows.index]).reset_index(names="method")
    is_number = all(type(value) in (int, float) for value in rows.value)
    places = rows.value.to_numpy(np.float64) if is_number else np.arange(len(rows), dtype=float)
    drawing, (axes,) = style.panels((1, 1), (style.TWO, 2.6))
    if is_number and places[0] > 0 and places[-1] >= 5 * places[0]:
        axes.set_xscale("log")
    texts = [f"{value:g}" if is_number else str(value) for value in rows.value]
    papers = rows.is_learner & (rows.setting == "")
    axes.set_xticks(places, [text + "\n(the paper's)" * paper
                             for text, paper in zip(texts, papers, strict=True)])  # fmt: skip
    axes.set_xticks([], minor=True)
    mean: Any = {"color": style.BLUE, "marker": "o", "markersize": 5, "linewidth": 1.6}
    shown = rows.assign(place=places)
    tasks = ranked_tasks(study)
    on = [runs_on(study, method, tasks).groupby("task").gap.mean() for method in rows.method]
    each_task = tasks if 1 < len(tasks) <= 8 else ()
    for task in each_task:
        gaps = [100 * each[task] for each in on]
        axes.plot(places, gaps, color=style.GREY, linewidth=0.8)
        at: Any = {"xytext": (6, 0), "textcoords": "offset points", "va": "center"}
        axes.annotate(marked(study.tasks[task]), (places[-1], gaps[-1]), color=style.GREY, **at)
        shown[f"on {task}"] = gaps
    style.means(axes, shown, x="place", y="gap", scale=100, bars=1.6, **mean)
    axes.set_ylim(bottom=min(0, 100 * shown.gap_low.min()))
    axes.set_xlabel(name)
    axes.set_ylabel(f"gap to the {reference(study, tasks)} (%)")
    words = (f"{row['value']}: {interval(row, 'gap', scale=100, unit=' %')}"
             for row in rows.to_dict("records"))  # fmt: skip
    alt = f"Gap to the {reference(study, tasks)} by {name}: {'; '.join(words)}."
    thin = "; thin: the gap on each" * bool(each_task)
    return drawing, shown, alt, f" Means over all tasks{thin}." * (len(tasks) > 1)


@figure(
    "Gap to the best reward",
    "Gap from the mean reward to the {reference}, as a share of it, with its "
    f"{style.COVERAGE} bootstrap interval over runs. The axis is logarithmic from 0.1 % on.",
)
def _draw_gaps(study: Study) -> Parts | None:
    """Draw the gap of each ranked method, a mean over tasks, with interval and name, without
    settings whose method is there; None if no method is ranked."""
    rows, tasks = standings(study).query("why == ''"), ranked_tasks(study)
    rows = without_settings(rows).reset_index(names="method")
    if not len(rows):
        return None
    shown = rows.assign(**{name: 100 * rows[name] for name in ("gap", "gap_low", "gap_high")})
    looks, by_group = looks_in(study, rows.method), shown.groupby("information")
    lines: list[Any] = []  # headings of groups, and rows
    for group in [group for group in GROUPS if group in by_group.groups]:
        lines += [capital(group), *by_group.get_group(group).to_dict("records")]
    narrow = style.is_narrow()
    names = [line if isinstance(line, str) else name_in_figure(study, line["method"])
             for line in lines]  # fmt: skip
    deep = max(name.count("\n") for name in names)
    height = (0.145 if narrow else 0.165) + 0.1 * deep  # inches of a line
    drawing, (axes,) = style.panels((1, 1), (style.TWO, 0.6 + height * len(lines)))
    gaps = shown[["gap", "gap_low", "gap_high"]]
    nearest, farthest = gaps.min().min(), max(gaps.max().max(), 0.5)
    left = min(nearest, 0) if nearest < 0.15 else nearest / 1.3
    axes.set_xscale("symlog", linthresh=0.1, linscale=0.4)
    steps = (1, 2, 5) if farthest < 100 and not narrow else (1,)
    ticks = [0, *(n * 10.0**k for k in range(-1, 5) for n in steps)]
    ticks = [tick for tick in ticks if left <= tick <= 1.1 * farthest]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlim(left, 1.1 * farthest)
    axes.grid(axis="x", color=style.GREY, alpha=0.3, linewidth=0.5)
    axes.axvline(0, **style.OPTIMUM)
    # In a narrow figure headings, which are longer than names, stand on the right.
    style.name_rows(axes, [name * (isinstance(line, dict) or not narrow)
                           for name, line in zip(names, lines, strict=True)])  # fmt: skip
    places: Any = {"xycoords": axes.get_yaxis_transform(), "textcoords": "offset points"}
    places |= {"va": "center_baseline"}

    def write_right(y: int, gap: str, n: str, color: str) -> None:
        axes.annotate(gap, (1, y), (8, 0), color=color, **places)
        axes.annotate(n, (1, y), (96, 0), color=color, ha="right", **places)

    if not narrow:
        write_right(1, f"gap (%) [{style.COVERAGE}]", "runs", style.GREY)
    for place, (row, label) in enumerate(zip(lines, axes.get_yticklabels(), strict=True)):
        if isinstance(row, str):
            label.set_color(style.GREY)
            if narrow:
                axes.annotate(row, (0, -place), (2, 0), color=style.GREY, **places)
            continue
        learner, y = row["is_learner"], -place
        size = looks[row["method"]]["markersize"] + learner  # a diamond of equal width is smaller
        look: Any = {"color": looks[row["method"]]["color"], "clip_on": False}
        axes.hlines(y, row["gap_low"], row["gap_high"], linewidth=2.5, alpha=0.6, **look)
        mark = looks[row["method"]]["marker"]
        (dot,) = axes.plot(row["gap"], y, mark, markersize=size, markeredgewidth=0, **look)
        name = row["title"]
        style.tip(dot, f"{name}: {interval(row, 'gap', unit=' %')}, {counted(row['runs'], 'run')}")
        label.set_fontweight("bold" if learner or not row["built_in"] else "normal")
        if not narrow:
            write_right(y, interval(row, "gap"), number(row["runs"]), style.INK)
    axes.spines["left"].set_visible(False)
    to = reference(study, tasks)
    where = "" if len(tasks) > 1 else marked(study.tasks[tasks[0]]) + (":\n" if narrow else ": ")
    axes.set_xlabel(f"{where}gap to the {to} (%)")
    alt = f"Gap to the {to} by method: {spoken(study, shown, '{title} {gap:.1f} %')}."
    bold = ["the paper's learner (diamonds)"] * any(rows.is_learner)
    bold += ["methods from files (larger marks)"] * (not all(rows.built_in))
    more = " Means over all tasks." * (len(tasks) > 1)
    more += " Methods that are run once have no interval." * (not all(rows.stochastic))
    return drawing, rows, alt, more + (f" Bold: {listed(bold)}." if bold else "")
