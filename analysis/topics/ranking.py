"""Ranking: gaps of methods to the optimum, or to the best of the folder, over all tasks."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis import frames, methods
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, looks_in, spoken
from coartic.analysis.optima import gap_share
from coartic.analysis.settings import compares_settings, name_in
from coartic.analysis.statistics.hypotheses import bootstrap_test, holm, sign_flip_test
from coartic.analysis.study import Study, cached, one_by_one
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics import scores
from coartic.analysis.words import (
    capital,
    in_brackets,
    interval,
    listed,
    marked,
    number,
    p_value,
    spelled,
)
from coartic.estimates import (
    FEWER_RESAMPLES,
    LEVEL,
    NEGLIGIBLE,
    Estimate,
    bootstrap_estimate,
)
from coartic.robot import Array

LONGEST = 36
"""Letters of a name in the figure."""


@cached
def gaps_on(study: Study, tasks: tuple[str, ...]) -> pd.DataFrame:
    """Mean gap over some tasks of each method that solved every run on all of them, nearest first.

    Columns as of :func:`coartic.analysis.ranking`, ``method``, ``information`` (its group) and
    ``algorithm``.
    """
    frame = scores.scores(study)
    frame = frame[frame.task.isin(tasks)]
    if not len(frame):
        return pd.DataFrame(
            columns=["method", "information", "gap", "gap_low", "gap_high", "tasks"]
        )
    rows = frames.ranking(frame)
    rows = rows[rows.gap.notna() & (rows.failed == 0)].reset_index()
    compared = scores.compared(study)
    # The learner's conditions together are left out where one of them alone ran.
    forms = [{compared[method][task].label for task in tasks} for method in rows.method]
    together = rows.method.str.startswith(methods.TOGETHER)
    rows = rows[~together | np.array([len(labels) > 1 for labels in forms], dtype=bool)]
    return rows.assign(
        information=rows.method.map(scores.groups(study)),
        algorithm=list(map(methods.algorithm_of, rows.method)),
    )


def main_gaps(study: Study) -> pd.DataFrame:
    """:func:`gaps_on` the tasks that a mean is over, :func:`.scores.common_tasks`."""
    return gaps_on(study, tuple(scores.common_tasks(study)))


@cached
def shown_gaps(study: Study) -> pd.DataFrame:
    """:func:`main_gaps` with methods from files that lack some of these tasks: of each its gap on
    the ``tasks`` that it solved."""
    rows = main_gaps(study)
    foreign = [method for method in scores.compared(study) if not methods.is_built_in(method)]
    lacking = [method for method in foreign if method not in {*rows.method}]
    parts = (gaps_on(study, scores.solved_tasks(study, m)) for m in lacking)
    more = [part[part.method == m] for m, part in zip(lacking, parts, strict=True)]
    return pd.concat([rows, *more], ignore_index=True).sort_values("gap", kind="stable")


@table("task, method, runs, reward, learner, p_holm, least_p")
def list_against_learner(study: Study) -> Rows:
    """Mean reward of every method and of the paper's learner that explores most, by task.

    Of methods that solved every run; p is corrected over the tasks of a method (Holm). A method
    that draws nothing has one reward, which is exact. The test takes samples as independent, though
    runs have the same seeds (:func:`paired_difference` pairs them): where the learner has 100 runs
    and the other method 20, pairs would leave out 80.
    """
    for label in dict.fromkeys(label for _, label in study.cells):
        cells, tests = [], []
        for name, task in one_by_one(study).items():
            cell = study.cells.get((name, label))
            learner = study.cells.get((name, methods.most_exploring(task)))
            if cell is None or learner is None or cell is learner:
                continue
            solved = all(len(each.good) == len(each.runs) for each in (cell, learner))
            if solved and scores.is_compared(study, label):
                drawn = study.declared[cell.method].stochastic
                rewards = cell.rewards if drawn else float(cell.rewards[0])
                tests.append(bootstrap_test(learner.rewards, rewards, "two-sided"))
                cells.append((cell, learner))
        p = holm([test.p for test in tests])
        for (cell, learner), test, adjusted in zip(cells, tests, p, strict=True):
            row: Row = {
                "task": marked(study.tasks[cell.task]),
                "method": label,
                "runs": len(cell.runs),
                "reward": cell.rewards.mean(),
                "learner": learner.rewards.mean(),
                "p_holm": adjusted,
                "least_p": test.least_p,
            }
            yield f"{cell.task} {label}", row | runs_of(cell, learner)


@table("method, gap[], tasks, information, better, worse, on *, runs")
def list_ranking(study: Study) -> Rows:
    """Gap over all tasks and on each, methods from files first.

    ``gap`` is over the tasks of :func:`.scores.common_tasks`, of a method from a file that lacks
    some of them over the ``tasks`` that it solved.
    """
    over, tested = shown_gaps(study).set_index("method"), list_against_learner(study)
    single = [t for t in study.tasks if t in study.optima and study.tasks[t].family is None]
    # Methods without a mean gap that solved every run on some task, by their gaps on the first.
    others = [
        (place, scores.cell_gap(study, cell), method)
        for method, cells in scores.compared(study).items()
        if method not in over.index and not method.startswith(methods.TOGETHER)
        for place, task in enumerate(study.tasks)
        if (cell := cells.get(task)) is not None and len(cell.good) == len(cell.runs)
    ]
    others.sort(key=lambda other: other[:2])
    names = dict.fromkeys([*over.index, *(method for *_, method in others)])
    for method in sorted(names, key=methods.is_built_in):
        cells = scores.compared(study)[method]
        row: Row = {"method": method, "information": scores.groups(study)[method], "gap": math.nan}
        for t in single:
            row[f"on {t}"] = scores.cell_gap(study, cells[t]) if t in cells else math.nan
        if method in over.index:
            row |= over.loc[method, ["gap", "gap_low", "gap_high", "tasks"]].to_dict()
        tests = tested[tested.index.isin([f"{task} {cell.label}" for task, cell in cells.items()])]
        # With Holm's correction over its tasks: could any of its tests have distinguished them?
        if tests.least_p.count() * tests.least_p.min() < LEVEL:
            sure = tests[tests.p_holm < LEVEL]
            row |= {"better": sum(sure.reward > sure.learner)}
            row |= {"worse": sum(sure.reward < sure.learner)}
        row |= {"runs": sum(len(cell.runs) for cell in cells.values()), **runs_of(*cells.values())}
        yield method, row


def leaders(study: Study, group: str, rows: pd.DataFrame | None = None) -> pd.DataFrame:
    """The best form of each algorithm of a group in :func:`main_gaps`, or in other rows of
    :func:`gaps_on`, nearest first.

    The learner is there by the form that explores most.
    """
    rows = main_gaps(study) if rows is None else rows
    rows = rows[rows.information == group]
    learners = rows.method.map(methods.is_learner).astype(bool)
    most = learners & rows.method.str.contains("EC4")
    best = rows[~learners | (most if most.any() else learners)]
    one = "method" if compares_settings(study) else "algorithm"
    return best.drop_duplicates(one).reset_index(drop=True)


def paired_difference(study: Study, first: str, second: str) -> Estimate:
    """Two-tailed test of the difference of mean gaps of two methods of :func:`main_gaps`.

    A sign-flip test of runs paired by seed within their task; a method that is run once is compared
    with every run of the other. All tasks count the same; NaN without pairs on one of them. Runs
    that only one of them has do not count, unlike in the table ``against-learner``.
    """
    frame = scores.scores(study)
    frame = frame.assign(gap=gap_share(frame.reward, frame.best_known))
    differences = []
    for task in scores.common_tasks(study):
        of_task = frame[frame.task == task]
        a, b = (of_task[of_task.method == method] for method in (first, second))
        once = min(len(a), len(b)) == 1
        pairs = a.merge(b, "cross") if once else a.merge(b, on="seed")
        differences.append((pairs.gap_x - pairs.gap_y).to_numpy())
    if not differences or not all(map(len, differences)):
        return Estimate(math.nan)
    return sign_flip_test(np.concatenate([of_task / len(of_task) for of_task in differences]))


def difference_of_gaps(study: Study, first: str, second: str) -> Estimate:
    """Mean gap of one method less that of another, both of :func:`main_gaps`.

    Its interval is for other runs of both on the same tasks, as those of the ranking; what a method
    that draws nothing does is exact.
    """
    tasks, exact = scores.common_tasks(study), 0.0
    signs, drawn = [], []
    for sign, method in ((1, first), (-1, second)):
        for task in tasks:
            cell = scores.compared(study)[method][task]
            values = gap_share(cell.rewards, study.optima[task].reward)
            if study.declared[cell.method].stochastic:
                signs.append(sign)
                drawn.append(values)
            else:
                exact += sign * values.mean()

    def difference(*samples: Array, axis: int) -> Array:
        parts = zip(signs, samples, strict=True)
        return np.asarray(
            (exact + sum(sign * each.mean(axis) for sign, each in parts)) / len(tasks)
        )

    if not drawn:
        return Estimate(exact / len(tasks))
    return bootstrap_estimate(tuple(drawn), difference, FEWER_RESAMPLES)


def differences(study: Study) -> dict[str, dict[str, str]]:
    """Differences of the mean gaps of any two of the nearest methods in words, by their names."""
    names = {method: name_in(study, method) for method in main_gaps(study).method[:24]}
    texts: dict[str, dict[str, str]] = {name: {} for name in names.values()}
    for first, second in itertools.combinations(names, 2):
        difference = difference_of_gaps(study, first, second)
        ends = 100 * np.array([difference.value, difference.low, difference.high])
        for one, other, (value, low, high) in (
            (first, second, ends), (second, first, -ends[[0, 2, 1]])
        ):  # fmt: skip
            text = f"{number(value, 1)} percentage points {in_brackets(low, high, 1)}"
            texts[names[one]][names[other]] = text.strip()
    return texts


@figure(
    "Gap to the best reward",
    "Gap from the mean reward to the optimum, as a share of it, with its "
    f"{style.COVERAGE} bootstrap interval over runs; to the best known reward where no optimum is "
    "proven, to the best of this folder where none is known. Means over all tasks where there are "
    "several. The axis is logarithmic from 0.1 % on. Methods that are run once have no interval. "
    "Diamonds: the paper's learner. Bold names: the learner and methods from files.",
)
def draw_ranking(study: Study) -> Parts | None:
    """Draw the gap of every method, a mean over tasks, with its name beside it."""
    rows, tasks = shown_gaps(study), scores.common_tasks(study)
    if not len(rows):
        return None
    percent = rows.assign(**{name: 100 * rows[name] for name in ("gap", "gap_low", "gap_high")})
    looks, line, of_groups = looks_in(study, rows.method), 0.0, percent.groupby("information")
    size = style.ONE, 0.45 + 0.155 * (len(rows) + 1.4 * of_groups.ngroups)
    drawing, (axes,) = style.panels((1, 1), size)
    gaps = percent[["gap", "gap_low", "gap_high"]]
    nearest, farthest = gaps.min().min(), max(gaps.max().max(), 0.5)
    left = min(nearest, 0) if nearest < 0.15 else nearest / 1.3
    axes.set_xscale("symlog", linthresh=0.1, linscale=0.4)
    steps = (1, 2, 5) if farthest < 100 else (1,)
    ticks = [0, *(n * 10.0**k for k in range(-1, 5) for n in steps)]
    ticks = [tick for tick in ticks if left <= tick <= 1.1 * farthest]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlim(left, 1.1 * farthest)
    axes.axvline(0, **style.OPTIMUM)
    across = axes.transData - axes.transAxes  # how far to the right: 0 to 1
    for group in [group for group in scores.GROUPS if group in of_groups.groups]:
        at = axes.get_yaxis_transform()
        axes.text(0.01, line, capital(group), color=style.GREY, va="center", transform=at)
        for row in of_groups.get_group(group).to_dict("records"):
            line += 1
            learner, low, high = methods.is_learner(row["method"]), row["gap"], row["gap"]
            look: Any = {"color": looks[row["method"]]["color"], "clip_on": False}
            if row["gap_low"] < row["gap_high"]:
                low, high = row["gap_low"], row["gap_high"]
                axes.plot([low, high], [line, line], "|-", markersize=6, linewidth=1, **look)
            mark = "D" if learner else "o"
            (dot,) = axes.plot(row["gap"], line, mark, markersize=2.6, markeredgewidth=0, **look)
            name, gap = scores.shown_name(study, row["method"]), number(row["gap"], 1)
            style.tip(dot, f"{name}: {interval(row, 'gap', unit=' %')}, {row['runs']} runs")
            ends = across.transform([(low, 0), (high, 0)])[:, 0]
            right = ends[1] < 1 - ends[0]  # there is more room
            beside: Any = {"textcoords": "offset points", "va": "center_baseline"}
            beside |= {"ha": "left"} if right else {"ha": "right"}
            foreign = not methods.is_built_in(row["method"])
            beside |= {"weight": "bold"} if learner or foreign else {}
            if len(name) > LONGEST:  # its end may say on how many tasks
                name = f"{name[: LONGEST - 20]}…{name[-19:]}"
            text, place = (f"{gap}  {name}", (high, 6)) if right else (f"{name}  {gap}", (low, -6))
            axes.annotate(text, (place[0], line), (place[1], 0), **beside)
        line += 1.4
    axes.set_ylim(line - 0.8, -0.6)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    to = scores.reference(study, tasks)
    where = "" if len(tasks) > 1 else f"{study.tasks[tasks[0]].label}: "
    short = to.removesuffix(" reward").replace("this ", "").replace("optimum", "the optimum")
    axes.set_xlabel(f"{where}gap to {short} (%)")
    alt = f"Gap to the {to} by method: {spoken(percent, '{method} {gap:.1f} %')}."
    return drawing, rows, alt, study.tasks.values()


def nearest(study: Study) -> str:
    """The method with the smallest gap and whether surely so, the learner's place, the best
    planner, and failed runs: a sentence for each that there is."""
    by_trial, by_formula, others = (leaders(study, group) for group in scores.GROUPS)
    learn = by_trial[~by_trial.method.map(methods.learns_nothing).astype(bool)]
    learn = learn.reset_index(drop=True)
    rows = next((rows for rows in (learn, by_formula, others, by_trial) if len(rows)), learn)
    if not len(rows):
        return ""
    by_settings = compares_settings(study)

    def gap(row: Any) -> str:
        return interval(row, "gap", scale=100, unit=" %")

    def declared(method: str) -> str:
        built_in = methods.is_built_in(method)
        return "" if built_in else "; its information is as its author declares"

    def named(method: str) -> str:
        by_name = by_settings or not methods.is_learner(method)
        return name_in(study, method) if by_name else "the learner"

    first = rows.gap <= rows.gap[0] + NEGLIGIBLE
    who, following = listed(map(named, rows.method[first])), rows.method[~first].tolist()
    gaps = [f"{number(100 * value, 1)} %" for value in rows.gap]
    to = scores.reference(study, scores.common_tasks(study))
    things = "settings" if by_settings else "that learn"
    of = f" of the {spelled(len(learn))} {things}" if len(learn) > 1 else ""
    behind = [n for n, method in enumerate(learn.method) if named(method) == "the learner"]
    behind = [n for n in behind if rows is learn and not first[n]]
    text = f"{who} came within {gaps[0]} of the {to}"  # one alone is not nearest
    if first.sum() > 1:
        text = f"{who} have the same gap to the {to} ({gaps[0]})"
        text += f", the smallest{of}" * bool(following)
    elif following:
        text = f"{who} comes nearest{f' to the {to}' if 'folder' in to else of} ({gaps[0]})"
    for place in behind if "folder" not in to else ():
        nearer = int((learn.gap < learn.gap[place] - NEGLIGIBLE).sum())
        standing = "last" if nearer == len(learn) - 1 else f"number {nearer + 1}"
        text += f"; the learner is {standing} ({gaps[place]})"
    text = f"{capital(text)}.\nGap of {who} to the {to}: {gap(rows.iloc[0])}"
    if following and first.sum() == 1:
        next_one, test = named(following[0]), paired_difference(study, *rows.method[:2])
        surely = "significantly" if test.p < LEVEL else "not significantly"
        beside = f", {surely} less than that of {next_one} ({p_value(test.p)})"
        if not test.least_p <= LEVEL:
            beside = f" (too few runs to tell it from {next_one})"
        text += beside
    text += f"{declared(rows.method[0])}."
    for place in behind:
        text += f" Gap of the learner: {gap(learn.iloc[place])}."
    learners = learn.gap[[named(method) == "the learner" for method in learn.method]]
    for of_random_search in (
        by_trial.gap[by_trial.method == methods.RANDOM_SEARCH] if len(learn) else ()
    ):
        text += f" Gap of random search: {number(100 * of_random_search, 1)} %"
        for learned in learners:
            size = "larger than" if learned < of_random_search - NEGLIGIBLE else "smaller than"
            size = "the same as" if abs(learned - of_random_search) <= NEGLIGIBLE else size
            text += f", {size} the learner's"
        text += "."
    if len(learn) and len(by_formula):
        best = by_formula.iloc[0]
        text += f" The best planner that uses the reward as a formula has a gap of {gap(best)}"
        text += f"{declared(best.method)}."
    cells = (cell for by_task in scores.compared(study).values() for cell in by_task.values())
    failed = scores.failed_runs(cells, ", which bars a method from the ranking")
    return text + failed
