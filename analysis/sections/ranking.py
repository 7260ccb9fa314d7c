"""Section on the ranking: gaps of methods to the optimum, or to the best of the folder."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis import standings
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, looks_in, spoken
from coartic.analysis.method_frame import GROUPS
from coartic.analysis.methods import RANDOM_SEARCH, most_exploring
from coartic.analysis.statistics.hypotheses import bootstrap_test, holm
from coartic.analysis.study import Study, cached, one_by_one
from coartic.analysis.table import Row, Rows, row_of_cell, runs_of, table
from coartic.analysis.words import (
    capital,
    in_brackets,
    interval,
    listed,
    number,
    p_value,
    percent,
    spelled,
)
from coartic.estimates import FEWER_RESAMPLES, LEVEL, NEGLIGIBLE, Estimate, bootstrap_estimate
from coartic.robot import Array

LONGEST = 44
"""Letters of a name in the figure."""


@cached
def shown_gaps(study: Study) -> pd.DataFrame:
    """Return :func:`.main_gaps`, with methods from files on the ``tasks`` that they solved."""
    rows = standings.main_gaps(study)
    for method in standings.compared(study):
        if not study.methods.built_in[method] and method not in {*rows.method}:
            solved = standings.gaps_on(study, standings.solved_tasks(study, method))
            rows = pd.concat([rows, solved[solved.method == method]], ignore_index=True)
    return rows.sort_values("gap", kind="stable")


@table(
    "task; method; runs; reward .1; learner: learner's reward .1; p_holm: p (corrected) .p; "
    "least_p: -"
)
def list_against_learner(study: Study) -> Rows:
    """List the mean rewards of every method and of the learner that explores most, by task.

    For methods that solved every run; p is corrected over the tasks of a method (Holm). The reward
    of a deterministic method counts as exact. The test takes samples as independent, though runs
    have the same seeds (:func:`.paired_difference` pairs them): with 100 runs of the learner and 20
    of the other method, pairs would leave out 80.
    """
    for label, method in study.methods[study.methods.kind != "optimum search"].iterrows():
        cells, tests = [], []
        for name, task in one_by_one(study).items():
            cell = study.cells.get((name, str(label)))
            learner = study.cells.get((name, most_exploring(task)))
            if cell is None or learner is None or cell is learner:
                continue
            if cell.all_good and learner.all_good:
                rewards = cell.rewards if method.stochastic else float(cell.rewards[0])
                tests.append(bootstrap_test(learner.rewards, rewards, "two-sided"))
                cells.append((cell, learner))
        p = holm([test.p for test in tests])
        for (cell, learner), test, adjusted in zip(cells, tests, p, strict=True):
            row = row_of_cell(study, cell) | {
                "learner": learner.rewards.mean(),
                "p_holm": adjusted,
                "least_p": test.least_p,
            }
            yield f"{cell.task} {label}", row | runs_of(cell, learner)


@table(
    "method; gap[]: gap (%) .1; tasks: number of tasks; information: use of the reward; "
    "better: better than the learner on (tasks); worse: worse on (tasks); on *: {} (%) .1; runs"
)
def list_ranking(study: Study) -> Rows:
    """List gaps over all tasks and on each, methods from files first, settings after their method.

    ``gap`` is over the tasks of :func:`.common_tasks`; for a method from a file that lacks some of
    them, over the ``tasks`` that it solved.
    """
    over, tested = shown_gaps(study).set_index("method"), list_against_learner(study)
    single = [t for t in study.tasks if t in study.optima and study.tasks[t].family is None]
    for method in ranked(study):
        cells = standings.compared(study)[method]
        row: Row = {"method": method, "information": study.methods.information[method]}
        row |= {f"on {t}": cells[t].gap if t in cells else math.nan for t in single}
        if method in over.index:
            row |= {name: over[name][method] for name in ("gap", "gap_low", "gap_high", "tasks")}
        tests = tested[tested.index.isin([f"{task} {cell.label}" for task, cell in cells.items()])]
        # With Holm's correction over its tasks: could any of its tests have distinguished them?
        if tests.least_p.count() * tests.least_p.min() < LEVEL:
            sure = tests[tests.p_holm < LEVEL]
            row |= {"better": sum(sure.reward > sure.learner)}
            row |= {"worse": sum(sure.reward < sure.learner)}
        row |= {"runs": sum(len(cell.runs) for cell in cells.values()), **runs_of(*cells.values())}
        yield method, row


def ranked(study: Study) -> list[str]:
    """Return the methods of the ranking in their order.

    By mean gap; then methods without a mean gap that solved every run on some task, by the gap on
    the first such task. Methods from files come first, and settings after their method.
    """
    over, rest = [*shown_gaps(study).method], []
    for method, cells in standings.compared(study).items():
        solved = [(place, cells[task].gap) for place, task in enumerate(study.tasks)
                  if task in cells and cells[task].all_good]  # fmt: skip
        if solved and method not in over and len(study.methods.parts[method]) == 1:
            rest.append((solved[0], method))
    names = [*over, *(method for _, method in sorted(rest, key=lambda each: each[0]))]
    names.sort(key=lambda method: bool(study.methods.built_in[method]))
    under = study.methods.under
    of_method = {first: [m for m in names if under[m] == first] for first in names}
    return [m for first in names if under[first] not in names for m in (first, *of_method[first])]


def difference_of_gaps(study: Study, first: str, second: str) -> Estimate:
    """Return the difference of the mean gaps of two methods of :func:`.main_gaps`.

    The interval is for other runs of both methods on the same tasks; gaps of deterministic methods
    are exact.
    """
    tasks, exact = standings.common_tasks(study), 0.0
    signs, drawn = [], []
    for sign, method in ((1, first), (-1, second)):
        for cell in standings.cells_on(study, method, tasks):
            if study.methods.stochastic[method]:
                signs.append(sign)
                drawn.append(cell.gaps)
            else:
                exact += sign * cell.gaps.mean()

    def difference(*samples: Array, axis: int) -> Array:
        parts = zip(signs, samples, strict=True)
        return np.asarray(
            (exact + sum(sign * each.mean(axis) for sign, each in parts)) / len(tasks)
        )

    if not drawn:
        return Estimate(exact / len(tasks))
    return bootstrap_estimate(tuple(drawn), difference, FEWER_RESAMPLES)


def differences(study: Study) -> dict[str, dict[str, str]]:
    """Write the differences of the mean gaps of any two of the nearest methods, by their names."""
    titles = study.methods.title
    names = {str(method): titles[method] for method in standings.main_gaps(study).method[:24]}
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
    "several. The axis is logarithmic from 0.1 % on. Bars: intervals; methods that are run once "
    "have none. n: runs. Diamonds: the paper's learner. Bold names: the learner and methods from "
    "files.",
)
def draw_ranking(study: Study) -> Parts | None:
    """Draw the gap of every method, a mean over tasks, with its name."""
    rows, tasks = shown_gaps(study), standings.common_tasks(study)
    rows = rows[rows.under == ""]
    if not len(rows):
        return None
    shown = rows.assign(**{name: 100 * rows[name] for name in ("gap", "gap_low", "gap_high")})
    looks, by_group = looks_in(study, rows.method), shown.groupby("information")
    lines: list[Any] = []  # headings of groups, and rows
    for group in [group for group in GROUPS if group in by_group.groups]:
        lines += [capital(group), *by_group.get_group(group).to_dict("records")]
    drawing, (axes,) = style.panels((1, 1), (style.TWO, 0.6 + 0.165 * len(lines)))
    gaps = shown[["gap", "gap_low", "gap_high"]]
    nearest, farthest = gaps.min().min(), max(gaps.max().max(), 0.5)
    left = min(nearest, 0) if nearest < 0.15 else nearest / 1.3
    axes.set_xscale("symlog", linthresh=0.1, linscale=0.4)
    steps = (1, 2, 5) if farthest < 100 else (1,)
    ticks = [0, *(n * 10.0**k for k in range(-1, 5) for n in steps)]
    ticks = [tick for tick in ticks if left <= tick <= 1.1 * farthest]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.set_xlim(left, 1.1 * farthest)
    axes.grid(axis="x", color=style.GREY, alpha=0.3, linewidth=0.5)
    axes.axvline(0, **style.OPTIMUM)
    style.name_rows(axes, [name_in_figure(study, line) for line in lines])
    beside: Any = {"xycoords": axes.get_yaxis_transform(), "textcoords": "offset points"}
    beside |= {"va": "center_baseline"}

    def write_right(y: int, gap: str, n: str, color: str) -> None:
        axes.annotate(gap, (1, y), (8, 0), color=color, **beside)
        axes.annotate(n, (1, y), (96, 0), color=color, ha="right", **beside)

    write_right(1, f"gap (%) [{style.COVERAGE}]", "n", style.GREY)
    for place, (row, label) in enumerate(zip(lines, axes.get_yticklabels(), strict=True)):
        if isinstance(row, str):
            label.set_color(style.GREY)
            continue
        learner, y = row["kind"] == "learner", -place
        look: Any = {"color": looks[row["method"]]["color"], "clip_on": False}
        axes.hlines(y, row["gap_low"], row["gap_high"], linewidth=4, alpha=0.5, **look)
        mark = "D" if learner else "o"
        (dot,) = axes.plot(row["gap"], y, mark, markersize=2.6, markeredgewidth=0, **look)
        name = standings.shown_name(study, row["method"])
        style.tip(dot, f"{name}: {interval(row, 'gap', unit=' %')}, {row['runs']} runs")
        label.set_fontweight("bold" if learner or not row["built_in"] else "normal")
        write_right(y, interval(row, "gap"), number(row["runs"]), style.INK)
    axes.spines["left"].set_visible(False)
    to = standings.reference(study, tasks)
    where = "" if len(tasks) > 1 else f"{study.tasks[tasks[0]].label}: "
    short = to.removesuffix(" reward").replace("this ", "").replace("optimum", "the optimum")
    axes.set_xlabel(f"{where}gap to {short} (%)")
    alt = f"Gap to the {to} by method: {spoken(shown, '{title} {gap:.1f} %')}."
    return drawing, rows, alt, study.tasks.values()


def name_in_figure(study: Study, line: Any) -> str:
    """Return the name left of a line of the figure: a heading, or a row with a method."""
    name = line if isinstance(line, str) else standings.shown_name(study, line["method"])
    if len(name) > LONGEST:  # its end may say on how many tasks
        name = f"{name[: LONGEST - 20]}…{name[-19:]}"
    return name


CARDS = {
    "one": "{who} came within {gap} of the {to}",  # a single method is not nearest
    "tied": "{who} have the same gap to the {to} ({gap})",
    "first of some": "{who} have the same gap to the {to} ({gap}), the smallest{of}",
    "first": "{who} comes nearest{of} ({gap})",
}
"""Sentences on the smallest gap, for a single method, for equal gaps, and with others behind."""
SENTENCES = {
    "interval": "Gap of {who} to the {to}: {interval}{to_next}{declared}.",
    "learner": "Gap of the learner: {learner}.",
    "random_search": "Gap of random search: {random_search}{to_learner}.",
    "planner": "The best planner that uses the reward as a formula has a gap of {planner}.",
}
"""Further sentences, by the word of the finding that each needs."""
DECLARED = "; its information is as its author declares"


def nearest(study: Study) -> str:
    """Say which method has the smallest gap, and whether significantly so, the learner's place, the
    gap of the best planner, and failed runs."""
    finding = who_is_nearest(study)
    if not finding:
        return ""
    card = CARDS[finding["case"]].format(**finding) + finding["standing"]
    texts = [text.format(**finding) for needed, text in SENTENCES.items() if finding[needed]]
    cells = (cell for of in standings.compared(study).values() for cell in of.values())
    failed = standings.failed_runs(study, cells, ", which bars a method from the ranking")
    return f"{capital(card)}.\n{' '.join(texts)}{failed}"


def who_is_nearest(study: Study) -> dict[str, str]:
    """Return the words for :data:`CARDS` and :data:`SENTENCES`, by their places.

    Empty words for sentences without content; no words at all without a method of
    :func:`.main_gaps`.
    """
    tasks = standings.common_tasks(study)
    every = (standings.leaders(standings.main_gaps(study), group) for group in GROUPS)
    by_trial, by_formula, others = every
    learn = by_trial[by_trial.kind != "no learning"].reset_index(drop=True)
    rows = next((rows for rows in (learn, by_formula, others, by_trial) if len(rows)), learn)
    if not len(rows):
        return {}
    names = [standings.called(row) for row in rows.to_dict("records")]
    tied = int((rows.gap <= rows.gap[0] + NEGLIGIBLE).sum())
    to, of_some = standings.reference(study, tasks), len(learn) > 1
    of = f" of the {spelled(len(learn))} that learn" * of_some
    case = "one" if len(rows) == 1 else "tied" if tied == len(rows) else "first of some"
    if case == "first of some" and tied == 1:
        case, of = "first", f" to the {to}" if "folder" in to else of
    best = by_formula.to_dict("records")[:1] if len(learn) else []
    is_random = (by_trial.method == RANDOM_SEARCH) & bool(len(learn))
    random_search = by_trial.gap[is_random].to_list()
    return {
        "case": case,
        "who": listed(names[:tied]),
        "gap": percent(rows.gap[0]),
        "to": to,
        "of": of,
        "interval": gap_in_words(rows.iloc[0]),
        "to_next": compared_with_next(study, rows, names) if case == "first" else "",
        "declared": DECLARED * (not rows.built_in[0]),
        "planner": "".join(gap_in_words(row) + DECLARED * (not row["built_in"]) for row in best),
        "random_search": "".join(map(percent, random_search)),
        **place_of_learner(learn, tied if rows is learn else len(learn), to),
        "to_learner": "".join(
            f", {compared_with(gap, learned)} the learner's"
            for gap in random_search for learned in learn.gap[standings.is_learner(learn)]
        ),
    }  # fmt: skip


def gap_in_words(row: Any) -> str:
    """Write the gap of a row with its interval in per cent."""
    return interval(row, "gap", scale=100, unit=" %")


def compared_with_next(study: Study, rows: pd.DataFrame, names: list[str]) -> str:
    """Say whether the gap of the first row is significantly smaller than the gap of the second."""
    first, second = rows.method[:2]
    test = standings.paired_difference(study, first, second, standings.common_tasks(study))
    if not test.least_p <= LEVEL:
        return f" (too few runs to tell it from {names[1]})"
    surely = "significantly" if test.p < LEVEL else "not significantly"
    return f", {surely} less than that of {names[1]} ({p_value(test.p)})"


def compared_with(gap: float, other: float) -> str:
    """Say whether a gap is larger or smaller than another gap."""
    if abs(gap - other) <= NEGLIGIBLE:
        return "the same as"
    return "larger than" if gap > other else "smaller than"


def place_of_learner(learn: pd.DataFrame, tied: int, to: str) -> dict[str, str]:
    """Return the gap of the learner in words, and its ``standing`` among methods that learn, if an
    optimum is known; empty if the learner is among the ``tied`` nearest."""
    behind = learn[standings.is_learner(learn) & (learn.index >= tied)]
    if behind.empty:
        return {"learner": "", "standing": ""}
    nearer = int((learn.gap < behind.gap.iloc[0] - NEGLIGIBLE).sum())
    place = "last" if nearer == len(learn) - 1 else f"number {nearer + 1}"
    standing = f"; the learner is {place} ({percent(behind.gap.iloc[0])})"
    return {"learner": gap_in_words(behind.iloc[0]), "standing": standing * ("folder" not in to)}
