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
from coartic.analysis.frames import ranking
from coartic.analysis.method_frame import GROUPS, without_settings
from coartic.analysis.methods import EC1, EC4
from coartic.analysis.sections.costs import best_after, improvements
from coartic.analysis.standings import (
    board,
    cells_of,
    common_runs,
    common_tasks,
    compared,
    own_methods,
    reference,
    runs_on,
    shown_name,
    solved_tasks,
)
from coartic.analysis.statistics.hypotheses import (
    bootstrap_test,
    exchange_test,
    holm,
    stratified_test,
)
from coartic.analysis.study import Study, one_by_one, solved
from coartic.analysis.table import Row, Rows, run_ids, table
from coartic.analysis.words import capital, interval, listed, marked, number
from coartic.estimates import FEWER_RESAMPLES, LEVEL, Estimate, mean_of_means
from coartic.internal.text import counted
from coartic.robot import Array

_EARLY = 1_000
"""Number of trials after which the ranking has a further gap, ``gap_early``."""


@table(
    "Mean rewards of methods and of the learner that explores most, by task",
    "task; method; runs; reward .1; learner: learner's reward .1; p_holm: p (corrected) .p; "
    "least_p: -",
)
def list_against_learner(study: Study) -> Rows:
    """Yield a row for each method, except searches and this learner, and each task of
    :func:`.one_by_one`: mean rewards, negative ticks, of the method and of the learner (EC1, with
    two arms EC4), and p of their difference.

    Only for tasks on which both solved every run. p is two-sided, of the exchange test, or, for a
    deterministic method, whose reward counts as exact, of the bootstrap test, and is corrected over
    the tasks of a method (Holm). Runs with the same seed are not compared as pairs.
    """
    for label, method in study.methods[~study.methods.is_search].iterrows():
        cells, tests = [], []
        for name, task in one_by_one(study).items():
            runs = study.cells.get((name, str(label)))
            learner = study.cells.get((name, EC4 if len(task.hands) > 1 else EC1))
            if runs is None or learner is None or runs is learner:
                continue
            rewards, learned = (
                solved(each).reward.to_numpy(np.float64) for each in (runs, learner)
            )
            if len(rewards) == len(runs) and len(learned) == len(learner):
                tests.append(
                    exchange_test(learned, rewards, "two-sided")
                    if method.stochastic
                    else bootstrap_test(learned, float(rewards[0]), "two-sided")
                )
                row: Row = {"task": marked(task), "method": label, "runs": len(runs)}
                row |= {"reward": rewards.mean(), "learner": learned.mean()}
                cells.append((name, row | run_ids(runs, learner)))
        p = holm([test.p for test in tests])
        for (name, row), test, adjusted in zip(cells, tests, p, strict=True):
            yield f"{name} {label}", row | {"p_holm": adjusted, "least_p": test.least_p}


def _after(study: Study, runs: pd.DataFrame, trials: int) -> pd.DataFrame:
    """Return a copy of runs, without their status, whose ``reward`` is the best of their first
    ``trials`` trials, NaN if none of these succeeded or the run failed; runs without rewards of
    trials keep their reward. Column ``gap`` stays as it is."""
    learned, best = improvements(study), list[float]()
    rewards = runs.reward.to_numpy(np.float64, na_value=math.nan)
    for run_id, reward in zip(runs.run_id, rewards, strict=True):
        steps = None if math.isnan(reward) else learned.get(run_id)
        best.append(float(best_after(steps, trials)) if steps and len(steps[0]) else reward)
    return runs.drop(columns="status").assign(reward=best)


@table(
    "Gap and share of the possible gain, means over {tasks}, and gap on each",
    "method; gap[]: gap (%) .1; share[]: share of the gain (%) .0; information: use of the reward; "
    "better: better than the learner on (tasks); worse: worse on (tasks); "
    "gap_early: -; ranked: -; on *: {} (%) .1; tasks; missing: -; without_gain: -; "
    "forward_kinematics: -; cpu_s: -; runs; failed: -",
)
def list_ranking(study: Study) -> Rows:
    """Yield a row for each method: its gap and share of the gain over tasks, and its gap on each
    task that is not random; in the order of :func:`_ranked`, settings after their method.

    ``gap`` is over the tasks of :func:`.common_tasks`; for a method from a file that lacks some of
    them, which is not ``ranked``, over the ``tasks`` that it solved. Also the gap after a thousand
    trials, and means of what a run costs.
    """
    tested, runs = list_against_learner(study), common_runs(study)
    scores = [f"{score}{end}" for score in ("gap", "share") for end in ("", "_low", "_high")]
    wide = board(study).reindex(columns=[*scores, "tasks", "without_gain", "ranked"])
    if len(runs):
        wide["gap_early"] = ranking(_after(study, runs, _EARLY)).gap
    wide = wide.join(runs.groupby("method")[["forward_kinematics", "cpu_s"]].mean())
    over: dict[Any, Any] = wide.to_dict("index")
    single = [t for t in study.tasks if t in study.optima and study.tasks[t].family is None]
    for method in _ranked(study):
        of_method = compared(study)[method]
        gaps = {task: solved(runs).gap.mean() for task, runs in of_method.groupby("task")}
        row: Row = {"method": method, "information": study.methods.information[method]}
        row |= {f"on {task}": gaps.get(task, math.nan) for task in single}
        row |= {"runs": len(of_method), "failed": len(of_method) - len(solved(of_method))}
        row |= over.get(method, {})
        on = {*solved_tasks(study, method)}
        row |= {"missing": sum(task not in on for task in common_tasks(study))}
        tests = tested[tested.index.isin([" ".join(cell) for cell in cells_of(of_method)])]
        # With Holm's correction over its tasks: could any of its tests have distinguished them?
        if tests.least_p.count() * tests.least_p.min() < LEVEL:
            sure = tests[tests.p_holm < LEVEL]
            row |= {"better": sum(sure.reward > sure.learner)}
            row |= {"worse": sum(sure.reward < sure.learner)}
        yield method, row | run_ids(of_method)


def _ranked(study: Study) -> list[str]:
    """Return the labels of :func:`.board` in its order, then of other compared methods, without
    joined learners, in the order of :attr:`.Study.methods`; each setting or ablation is moved to
    after its method, if that method is in the list."""
    single = [method for method in compared(study) if len(study.methods.parts[method]) == 1]
    names = [*dict.fromkeys((*board(study).index, *single))]

    def places(method: str) -> list[int]:  # of the methods above it, and its own
        above = study.methods.under[method]
        return [*(places(above) if above in names else ()), names.index(method)]

    return sorted(names, key=places)


@table(
    "Gaps of methods less the gap of the method against which they are compared, on the tasks that "
    "this method solved (positive: this method is better)",
    "method; against: compared with; difference[]: difference of gaps (%) .1; "
    "p_holm: p (corrected) .p; tasks; runs",
)
def list_differences(study: Study) -> Rows:
    """Yield a row for each other method: its gap less the gap of :attr:`.Study.against`, on the
    tasks on which the latter solved every run; the smallest difference first.

    If :attr:`.Study.against` is empty, the compared method is the first of :func:`.board` where one
    parameter is varied; otherwise each method from a file is compared with the built-in methods
    with the same use of the reward. Methods that lack or failed a run there, and settings and
    ablations of methods that ran (:attr:`.Study.methods`, ``under``), are left out. Intervals are
    for other runs on the same tasks; p is two-sided (:func:`.stratified_test`), corrected over the
    rows of the compared method (Holm).
    """
    methods = study.methods
    chosen = [study.against] if study.against in compared(study) else []
    if study.varied[0] and not study.against:
        rows = board(study)
        chosen = [*rows.index[rows.ranked][:1]]
    for against in chosen if study.against or chosen else own_methods(study):
        tasks, found = solved_tasks(study, against), list[tuple[Estimate, str]]()
        alike = methods.built_in & (methods.information == methods.information[against])
        if chosen:
            alike = methods.index != against
        for name in methods.index[alike & (methods.under == "")].intersection([*compared(study)]):
            runs = runs_on(study, name, tasks)
            if len(runs) and runs.reward.notna().all():
                found.append((_difference_of_gaps(study, name, against, tasks), name))
        adjusted = holm([each.p for each, _ in found]) if found else []
        in_order = sorted(zip(found, adjusted, strict=True), key=lambda each: each[0][0].value)
        for (difference, name), p in in_order:
            runs = runs_on(study, name, tasks)
            row: Row = {"method": name, "against": against, "tasks": len(tasks), "runs": len(runs)}
            row |= {**difference.columns("difference"), "p_holm": p}
            yield f"{against} {name}", row | run_ids(runs, runs_on(study, against, tasks))


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
    or else, also with fewer than two gaps of values, gaps of methods (:func:`.board`); None without
    a gap. ``how``: see :data:`.DrawsFigure`."""
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
    rows = board(study)
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
    tasks = common_tasks(study)
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
    """Draw the gap of each method of :func:`.board`, a mean over tasks, with interval and name,
    without settings whose method is there; None if no method has a gap."""
    rows, tasks = board(study), common_tasks(study)
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
        name = shown_name(study, row["method"])
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
