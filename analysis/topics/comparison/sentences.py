"""What was found about methods beside each other, in sentences."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd

from coartic.analysis import methods, words
from coartic.analysis.section import Section
from coartic.analysis.settings import compares_settings, name_in
from coartic.analysis.statistics.estimates import LEVEL, Estimate
from coartic.analysis.study import CellKey, Study, cached, one_by_one
from coartic.analysis.topics.comparison import running_times, scores, tables
from coartic.analysis.topics.failed import failed_runs
from coartic.analysis.words import marked, number, plural, two_figures

ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth")
TRIES = methods.PLACEBO, "corrective-alone/every"
"""Methods that take the best of their trials: they learn nothing from one for the next."""
LEVELS = {"trials_to_quarter": "a quarter", "trials_to_half": "half"}
"""Columns of the table of costs, and in words the share of targets that each is about."""


@cached
def leaders_by_group(study: Study) -> dict[str, list[Any]]:
    """Rows of :func:`.scores.leaders` by group, with their names and gaps in per cent."""
    by_group = {}
    for group in scores.GROUPS:
        rows = scores.leaders(study, group)
        percent = {column: 100 * rows[column] for column in ("gap", "low", "high")}
        names = [name_in(study, method) for method in rows.method]
        named = rows.assign(name=names, **percent)
        by_group[group] = list(named.itertuples())
    return by_group


def gap_in_words(row: Any, *, interval: bool = False) -> str:
    """Gap of a leader, ``7.3 %``, or with its ``interval``, ``7.3 % [6.9, 7.8]``."""
    ends = (row.low, row.high) if interval else ()
    return words.estimate(Estimate(row.gap, *ends), 1, " %")


def as_declared(row: Any) -> str:
    """That what a leader is told is its author's word, where the method is not built in."""
    return "" if methods.is_built_in(row.method) else "; what it is told is as its author declares"


def finding_of_ranking(study: Study) -> str:
    """Who comes nearest to the optimum, among methods that know as much of the reward."""
    by_trial, by_formula, others = leaders_by_group(study).values()
    if not (by_trial or by_formula or others):
        return ""
    if compares_settings(study):
        return words.capital(settings_in_words(by_trial or by_formula or others))
    sentences = nearest_by_trial(by_trial)
    without = "best method that does not use the reward"
    if by_formula:
        away = f"{gap_in_words(by_formula[0])} away{as_declared(by_formula[0])}"
        beside = f", the {without} {gap_in_words(others[0])}" if others else ""
        sentences.append(
            f"The best planner that knows the reward as a formula ends {away}{beside}."
        )
    elif others:
        sentences.append(f"The {without} ends {gap_in_words(others[0])} away.")
    if optima := study.optima.values():
        proven = sum(best.proven for best in optima)
        elsewhere = "; elsewhere the best known reward takes its place" * (proven < len(optima))
        sentences.append(
            f"The optimum is proven on {proven} of {plural(len(optima), 'task')}{elsewhere}."
        )
    labels = {label for _, label in study.cells if not methods.is_search(label)}
    if settings := sum(map(methods.is_variant, labels)):
        are = "is" if settings == 1 else "are"
        sentences.append(
            f"{plural(settings, 'more setting')} of methods {are} in tables/methods.csv."
        )
    return " ".join(sentences)


def settings_in_words(rows: list[Any]) -> str:
    """A sentence on settings: the nearest to the optimum with its interval, then the others."""
    best, *others = rows
    text = f"{best.name} ends nearest to the optimum: {gap_in_words(best, interval=True)} away"
    if others:
        rest = ", ".join(f"{row.name} {gap_in_words(row)}" for row in others)
        text += f"; then {rest}"
        if not others[0].least_p <= LEVEL:
            text += f". Too few runs to tell it from {others[0].name}"
        elif not others[0].p < LEVEL:
            text += f". No significant difference from {others[0].name}"
    return f"{text}."


def that_learn(by_trial: list[Any]) -> list[Any]:
    """Those of the methods that see only rewards of trials that learn from them."""
    return [row for row in by_trial if row.method not in TRIES]


def nearest_by_trial(by_trial: list[Any]) -> list[str]:
    """Sentences on methods that learn from the rewards of trials, and the learner among them."""
    rows = that_learn(by_trial)
    if not rows:
        return []
    best, second = rows[0], rows[1] if len(rows) > 1 else None
    if second:
        beginning = (
            f"Among the {len(rows)} algorithms that learn only from the rewards of trials (each "
            f"with its best setting), {best.name} comes nearest"
        )
    else:
        beginning = f"The only algorithm here that learns from the rewards of trials is {best.name}"
    beside = ""
    if second and not second.least_p <= LEVEL:
        beside = f"; too few runs to tell it from {second.name}"
    elif second:
        sure = "significantly" if second.p < LEVEL else "not significantly"
        beside = f", {sure} better than {second.name} ({words.p_value(second.p)})"
    away = gap_in_words(best, interval=True)
    sentences = [f"{beginning}: {away} from the optimum{beside}{as_declared(best)}."]
    if place := place_of_learner(by_trial, interval=True):
        sentences.append(place)
    return sentences


def place_of_learner(by_trial: list[Any], *, interval: bool = False) -> str:
    """A sentence on where the learner ends among methods that learn, and beside random guesses.

    Nothing where it comes nearest, or did not run.
    """
    rows = that_learn(by_trial)
    ranks = [rank for rank, row in enumerate(rows) if methods.is_learner(row.method)]
    if not ranks or ranks[0] == 0:
        return ""
    rank, count, learner = ranks[0], len(rows), rows[ranks[0]]
    place = "last" if rank == count - 1 else ORDINALS[rank]
    text = f"The paper's learner is {place} of the {count} that learn, at "
    text += gap_in_words(learner, interval=interval)
    for row in by_trial:
        if row.method == methods.PLACEBO:
            beside = "ahead of" if learner.gap < row.gap else "behind"
            text += f", {beside} random guesses ({gap_in_words(row)})"
    return f"{text}."


def answer_nearest(study: Study) -> str:
    """Who comes nearest to the optimum, in a dozen words."""
    by_trial, *others = leaders_by_group(study).values()
    if not any((by_trial, *others)):
        return ""
    if compares_settings(study):
        return settings_in_words(next(rows for rows in (by_trial, *others) if rows))
    learn = that_learn(by_trial)
    best = next(row for rows in (learn, *others, by_trial) for row in rows)
    who = (
        f"Among methods that learn from rewards alone: {best.name}"
        if learn
        else words.capital(best.name)
    )
    text = f"{who}, {gap_in_words(best)} away{as_declared(best)}."
    if place := place_of_learner(by_trial):
        text += f" {place}"
    foreign = from_files(study)
    text += "".join(map(foreign_in_words, foreign[:3]))
    if len(foreign) > 3:
        text += f" And {len(foreign) - 3} more in the ranking."
    return text + failed_compared(study, ", which bars a method from the ranking")


def from_files(study: Study) -> list[Any]:
    """Rows of the ranking of methods that are not built in; ``beside``: whether the learner ran."""
    labels = {label for _, label in study.cells if not methods.is_built_in(label)}
    rows = tables.ranking(study) if labels else pd.DataFrame(columns=["method", "gap"])
    rows = rows[rows.method.isin(labels) & rows.gap.notna()]
    beside = any(methods.is_learner(label) for _, label in study.cells)
    return list(rows.assign(beside=beside).itertuples())


def foreign_in_words(row: Any) -> str:
    """A sentence about a method from a file, beginning with a space."""
    gap = number(100 * row.gap, 1)
    text = f" Method {row.method}, from outside this project, ends {gap} % away"
    if not row.beside:
        return f"{text}."
    if math.isnan(row.better):
        return f"{text}; the runs are too few, or too alike, to tell it from the learner."
    if row.better or row.worse:
        better = plural(row.better, "task")
        return (
            f"{text}; it is better than the learner on {better} and worse on {number(row.worse)}."
        )
    return f"{text}; no significant difference from the learner."


def failed_compared(study: Study, consequence: str, *groups: str) -> str:
    """A sentence about failed runs of methods compared on tasks with a known optimum.

    ``groups``: of methods; all without any. ``consequence``: how the sentence ends.
    """
    cells = [
        (task, label)
        for task, label in study.cells
        if task in scores.initial_and_optimum(study) and scores.is_compared(study, label)
        if not groups or scores.group_of(study, label) in groups
    ]
    return failed_runs(study, cells, consequence)


@cached
def learner_and_rival(study: Study) -> tuple[Any, Any]:
    """Rows of the table of costs: of the learner, and of its rival.

    The rival learns from the reward of trials too and reaches most targets. None without them.
    """
    rows = tables.runtimes(study)
    learners = [label for label in methods.main_methods(rows.index) if methods.is_learner(label)]
    others = [label for label in rivals(study) if is_by_trial(study, label)]
    reached = rows.reached[others]
    return (
        rows.loc[learners[0]] if learners else None,
        rows.loc[str(reached.idxmax())] if learners and others else None,
    )


def rivals(study: Study) -> list[str]:
    """Labels of methods in the table of costs other than the learner."""
    return [label for label in tables.runtimes(study).index if not methods.is_learner(label)]


def is_by_trial(study: Study, label: str) -> bool:
    """Whether a method learns from the reward of each trial."""
    return scores.group_of(study, label) == scores.BY_TRIAL


def ratios(study: Study) -> dict[str, float]:
    """Trials of the learner over those of its rival, by column of :data:`LEVELS`.

    Where both reach that share of the targets.
    """
    learner, rival = learner_and_rival(study)
    if rival is None:
        return {}
    both = {column: (learner[column], rival[column]) for column in LEVELS}
    return {
        column: a / b for column, (a, b) in both.items() if math.isfinite(a) and math.isfinite(b)
    }


def finding_of_costs(study: Study) -> str:
    """What the learner pays for half of the targets, beside its rival and the best planner."""
    learner, rival = learner_and_rival(study)
    if learner is None:
        return ""
    who = "" if rival is None else methods.name_of(rival.method)
    ends = f"{number(100 * learner.reached, 0)} %"
    ends_of_rival = "" if rival is None else f"{number(100 * rival.reached, 0)} %"
    if at := ratios(study):
        column, *more = reversed(at)
        ours, theirs = (
            Estimate(row[column], row[f"{column}_low"], row[f"{column}_high"])
            for row in (learner, rival)
        )
        text = (
            f"To reach {LEVELS[column]} of the reward targets between the initial solution and the "
            f"optimum, the learner needs {words.estimate(ours, unit=' trials')} and {who} "
            f"{words.estimate(theirs)}, a ratio of {two_figures(at[column])}."
        )
        for column in more:
            text += f" For {LEVELS[column]} of them the ratio is {two_figures(at[column])}."
        text += f" The learner ends at {ends} of the targets, {who} at {ends_of_rival}."
        text += costs_by_task(study, learner.method, rival.method)
    else:
        text = (
            f"In all its trials the learner reaches {ends} of the reward targets between the "
            f"initial solution and the optimum{f', {who} {ends_of_rival}' if who else ''}."
        )
    return text + costs_of_planner(study, learner)


def costs_by_task(study: Study, learner: str, rival: str) -> str:
    """A sentence about trials of the median run on each of several tasks, or nothing."""
    ours, theirs = (running_times.trials_to_half(study, label) for label in (learner, rival))
    by_task = [
        f"{number(trials)} trials ({methods.name_of(rival)} {number(theirs[task])}) on "
        f"{marked(study.tasks[task])}"
        for task, trials in ours.items()
        if task in theirs and task in one_by_one(study)
    ]
    if len(by_task) < 2:
        return ""
    never = "; ∞ means never" if math.inf in (*ours.values(), *theirs.values()) else ""
    return (
        " Tasks and runs are pooled in these numbers. By task, the median run has gone half of the "
        f"way after {', '.join(by_task)}{never}."
    )


def costs_of_planner(study: Study, learner: Any) -> str:
    """A sentence about the planner that reaches half of the targets with the fewest evaluations."""
    rows = tables.runtimes(study)
    planners = rows.loc[[label for label in rivals(study) if not is_by_trial(study, label)]]
    planners = planners[planners.reached >= 0.5]
    if not len(planners):
        return ""
    planner: Any = planners.loc[str(planners.kinematics_to_half.idxmin())]
    beside = f" (the learner: {evaluations(learner)})" * math.isfinite(learner.kinematics_to_half)
    return (
        f" {words.capital(methods.name_of(planner.method))} makes no trials: it reaches half of "
        f"the targets with {evaluations(planner, ' forward-kinematics evaluations')}{beside}."
    )


def evaluations(row: Any, unit: str = "") -> str:
    """Forward-kinematics evaluations and seconds to half of the targets."""
    return f"{two_figures(row.kinematics_to_half)}{unit} in {two_figures(row.seconds_to_half)} s"


def answer_runtimes(study: Study) -> str:
    """What the learner pays beside its rival, in a dozen words."""
    learner, rival = learner_and_rival(study)
    if learner is None:
        return ""
    who = "" if rival is None else methods.name_of(rival.method)
    targets = "of the reward targets between initial solution and optimum"
    if at := ratios(study).get("trials_to_half"):
        ours, theirs = number(learner.trials_to_half), number(rival.trials_to_half)
        more = f", {two_figures(at)} times fewer" if at > 1 else ""
        text = (
            f"For half {targets} the learner needs {ours} trials, {who} {theirs}{more} (tasks and "
            "runs pooled)."
        )
    else:
        beside = f", {who} {number(100 * rival.reached, 0)} %" if who else ""
        text = f"The learner reaches {number(100 * learner.reached, 0)} % {targets}{beside}."
    return text + failed_compared(study, " and count as reaching nothing", scores.BY_TRIAL)


def finding_of_learning(study: Study) -> str:
    """When half of the gain of the learner that explores most is there, by task."""
    half = tables.learning(study).half_gain
    rows = {f"{name} {methods.most_exploring(task)}": task for name, task in study.tasks.items()}
    tasks = {row: task for row, task in rows.items() if half.get(row, math.inf) < math.inf}
    if not tasks:
        return ""
    two_armed = any(len(task.hands) > 1 for task in tasks.values())
    conditions = " (EC1 with one arm, EC4 with two)" if two_armed else ""
    after = [f"{two_figures(half[row])} trials on {marked(task)}" for row, task in tasks.items()]
    return (
        f"The learner{conditions} has made half of its own gain after about {', '.join(after)} "
        "(median run)."
    )


@cached
def most_improved(study: Study) -> tuple[CellKey, float, float] | None:
    """The cell of the learner that gains the largest share of its initial reward.

    With its initial and its learned reward, means over runs. Of each task's best condition.
    """
    gains: dict[float, tuple[CellKey, float, float]] = {}
    for name in study.tasks:
        label = scores.best_condition(study, name)
        if label is not None:
            good = study.cells[name, label].good
            initial, learned = float(good.initial_reward.mean()), float(good.reward.mean())
            if initial < 0:
                gains.setdefault((learned - initial) / -initial, ((name, label), initial, learned))
    return gains[max(gains)] if gains else None


def answer_gain(study: Study) -> str:
    """The learner on the task on which it improves most, in a dozen words."""
    if (best := most_improved(study)) is None:
        return ""
    (task, label), initial, learned = best
    # Ticks by which the first movement is slower than the corrective process's.
    changes = study.trajectories(task, label).against_same_hands
    slower = len(changes) and changes[:, 0].mean() > 1
    first = ", with a slower first movement" if slower else ""
    return (
        "Not tested here: it takes two tasks with the same first goals. "
        f"On {marked(study.tasks[task])} the {methods.name_of(label)} gets from a "
        f"reward of {number(initial, 0)} to {number(learned, 0)} ticks{first}."
        + failed_runs(study, [(task, label)], " and are not counted")
    )


NEAREST = Section(
    "nearest",
    short="Ranking",
    title="Who comes nearest to the optimum?",
    caption=(
        "Gap to the optimum or, where it is not proven, to the best known reward, in per cent of it"
    ),
    finding=finding_of_ranking,
    figure="ranking",
    table="ranking",
    note=(
        "Methods are grouped by what they know about the reward: the value after each trial, its "
        "formula, or nothing. Intervals describe new runs on the same tasks. Better on, worse on: "
        "number of tasks on which the mean reward differs significantly from that of the paper's "
        "learner (EC1 with one arm, EC4 with two), by two-tailed bootstrap tests, corrected for "
        "the tasks of the method (table against-learner). Empty: the runs are too few, or too "
        "alike, to tell."
    ),
    single=True,
)

RUNTIMES = Section(
    "runtimes",
    short="Cost",
    title="What does it cost?",
    caption="What it takes to reach a quarter and half of the targets",
    finding=finding_of_costs,
    figure="runtimes",
    table="runtimes",
    note=(
        "Kinematics: number of forward-kinematics evaluations, a cost that is the same on every "
        "machine. ∞: not reached within the budget of trials."
    ),
    single=True,
)

LEARNING = Section(
    "learning",
    short="Learning",
    title="How fast is it learned?",
    caption="Best reward so far, mean over runs (ticks)",
    finding=finding_of_learning,
    figure="learning-curves",
    table="learning",
    note="Gain: improvement over the initial solution. ∞: never improved.",
    single=True,
)

METHODS = Section(
    "methods",
    short="All methods",
    title="What did every method do on every task?",
    caption="Reward, gap to the optimum, hands and what a run spends (medians)",
    table="methods",
    note=(
        "Every method works on the same robot. Its movements are scored by a function hidden from "
        "the method. Times are seconds of solving."
    ),
    single=True,
)
