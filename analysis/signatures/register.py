"""All signatures of coarticulation of a study, of every method and task.

To add one: a row of ``register.toml``, which says what it is; a function that computes it, in the
file of its concept; and in :mod:`~.within` (one method's runs on one task) or :mod:`~.between`
(tasks) a line that yields it, at the same place.
"""

from __future__ import annotations

import math
from itertools import chain, product

import numpy as np
import pandas as pd

from coartic.analysis.methods import CONDITIONS, PLACEBO, main_methods
from coartic.analysis.signatures.between import TwoContexts, between_contexts, slopes
from coartic.analysis.signatures.context import beyond_p, context_pairs
from coartic.analysis.signatures.locus import LEAST, families, variants
from coartic.analysis.signatures.rows import (
    COLUMNS,
    CONTEXTS,
    FAMILIES,
    PLACE,
    REGISTER,
    WITHIN,
    Rows,
    without,
)
from coartic.analysis.signatures.within import measured_within
from coartic.analysis.statistics.estimates import SEED
from coartic.analysis.study import Study, cached, one_by_one
from coartic.analysis.topics.comparison.scores import BY_TRIAL, group_of
from coartic.analysis.trajectories import Trajectories, postures
from coartic.robot import HANDS, Array, Hand

__all__ = ["CONTEXTS", "FAMILIES", "REGISTER", "WITHIN", "signatures"]
NO_CONTEXT = "the method did no other task that shares the start and the first goals"
IN_FAMILY = "the tasks that share its first goals are variants of it: see the locus slopes"
NO_FAMILY = f"fewer than {LEAST} tasks of the folder are the same but for one goal"


@cached
def signatures(study: Study) -> pd.DataFrame:
    """Every signature of every method and task of a study, a value a row.

    Columns ``task``, ``method``, ``variant``, those of :data:`~.rows.COLUMNS` (``where``: the place
    in words) and of :data:`~.rows.PLACE`, and ``label``. Signatures over runs are means with
    Student's interval, shares of runs have Wilson's.
    """
    frame = pd.DataFrame(
        rows_of_cells(study), columns=["task", "method", "variant", *COLUMNS, *PLACE, "label"]
    )
    return frame.astype(dict.fromkeys(("goal", "moving", "longest"), "Int64"))


def rows_of_cells(study: Study) -> Rows:
    """Every signature of every method and task of a study.

    Differences between contexts stand with the first task of the pair and name the other; tasks
    that locus families join are no pairs, their slopes say how each depends on the others.
    """
    alone = one_by_one(study)
    trajectories = {key: study.trajectories(*key) for key in study.cells if key[0] in alone}
    groups, pairs = families(study.tasks), pairs_of_contexts(study)
    for (task, label), cell in trajectories.items():
        of_method = {name: its for (name, whose), its in trajectories.items() if whose == label}
        moving = [group for group in groups if task in group[1]]
        rows = [measured_within(cell)]
        partners = [p for p in pairs if task in p[:2] and {*p[:2]} <= of_method.keys()]
        for first, second, shared in partners:
            if first == task:
                rows.append(of_pair(cell, of_method[second], shared))
        if not partners:
            rows.append(without(CONTEXTS, IN_FAMILY if moving else NO_CONTEXT))
        for group in moving:
            cells = {name: of_method[name] for name in group[1] if name in of_method}
            if task == next(iter(cells)):
                rows.append(slopes(group, cells))
        if not moving:
            rows.append(without(FAMILIES, NO_FAMILY))
        identity = {"task": task, "method": cell.method, "variant": cell.variant, "label": label}
        yield from ({**row, **identity} for row in chain(*rows))


def of_pair(first: Trajectories, second: Trajectories, shared: int) -> Rows:
    """Rows for every shared goal and every hand that hit it in both contexts."""
    for goal in range(1, shared + 1):
        by_hand = [TwoContexts(first, second, goal, hand) for hand in HANDS]
        in_both = [contexts for contexts in by_hand if all(contexts.runs)]
        for contexts in in_both:
            yield from between_contexts(contexts)
        if not in_both:
            place = {"goal": goal, "against": second.task.name}
            yield from without(CONTEXTS, "no hand hit the goal in both contexts", place)


def pairs_of_contexts(study: Study) -> list[tuple[str, str, int]]:
    """Pairs of tasks that differ only after their first goals, and how many they share.

    Tasks that differ in one moved goal only are left out: slopes say how postures follow it.
    """
    moved = variants(families(study.tasks))
    pairs = context_pairs(study.tasks)
    return [pair for pair in pairs if not any({*pair[:2]} <= names for names in moved)]


def selects(study: Study, label: str) -> bool:
    """Whether a method's solution may be one of many trials, selected by its reward.

    Then it shows signs that selection alone shows, and has to exceed the placebo's.
    """
    method = label.partition(" ")[0]
    return method != PLACEBO and group_of(study, label) == BY_TRIAL


def placebo_of(study: Study, contexts: TwoContexts) -> TwoContexts | None:
    """The placebo in the same two contexts; None without one that made as many trials."""
    keys = [(task.name, PLACEBO) for task in contexts.tasks]
    if not all(key in study.cells and len(study.cells[key].good) for key in keys):
        return None
    for name, label in keys:
        method = study.cells[name, contexts.method].runs.trials.max()
        if study.cells[name, label].runs.trials.max() < method:
            return None
    first, second = (study.trajectories(*key) for key in keys)
    placebo = TwoContexts(first, second, contexts.goal, contexts.hand)
    return placebo if all(placebo.runs) else None


def slope_beyond_p(
    study: Study, label: str, task: str, goal: int, moving: int, hand: Hand
) -> float:
    """P of the test that postures at a goal follow a moving one more than the placebo's do.

    ``task``: one of those that differ in goal ``moving``. NaN for a method that selects nothing,
    and without runs of the placebo at all places.
    """
    if not selects(study, label):
        return math.nan
    (positions,) = (
        tasks for number, tasks in families(study.tasks) if number == moving and task in tasks
    )
    runs: dict[str, list[Array]] = {label: [], PLACEBO: []}
    places = np.unique(list(positions.values()))
    for place, method in product(places, runs):
        at = [name for name, where in positions.items() if where == place]
        cells = [study.cells[name, method] for name in at if (name, method) in study.cells]
        with_hand = [
            run
            for cell in cells
            for run in study.trajectories(cell.task, method).with_hand(hand, goal)
        ]
        if len(with_hand) < 2:
            return math.nan
        runs[method].append(postures(tuple(with_hand), goal))
    x = places - places.mean()
    rng = np.random.default_rng([SEED, goal, moving])
    return beyond_p(runs[label], runs[PLACEBO], rng, contrast=x / (x**2).sum())


@cached
def shared_goal(study: Study) -> TwoContexts | None:
    """The first goal that two tasks share before they differ, by the paper's learner if it ran.

    None where no method has solved runs on two such tasks.
    """
    labels = [label for _, label in study.cells]
    for label in dict.fromkeys([*CONDITIONS, *main_methods(labels), *labels]):
        for *names, _ in pairs_of_contexts(study):
            keys = [(name, label) for name in names]
            if all(key in study.cells and len(study.cells[key].good) for key in keys):
                first, second = (study.trajectories(*key) for key in keys)
                both = [TwoContexts(first, second, 1, hand) for hand in HANDS]
                for contexts in both:
                    if all(contexts.runs):
                        return contexts
    return None
