"""Tests against the placebo: random guesses, of which the best of many is selected.

A method that selects its solution from trials by their rewards shows signs that selection alone
shows, and has to exceed the placebo's.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from coartic.analysis.methods import PLACEBO
from coartic.analysis.signatures.context_tests import smallest_p
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.signatures.two_contexts import TwoContexts
from coartic.analysis.statistics.estimates import LEVEL
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.study import Study, cached
from coartic.analysis.topics.coarticulation.shared_goals import shared_goal
from coartic.analysis.topics.scores import BY_TRIAL, groups


def selects(study: Study, label: str) -> bool:
    """Whether a method's solution may be one of many trials, selected by its reward."""
    method = label.partition(" ")[0]
    return method != PLACEBO and groups(study)[label] == BY_TRIAL


def placebo_of(study: Study, contexts: TwoContexts) -> TwoContexts | None:
    """The placebo in the same two contexts; None without one that made as many trials."""
    keys = [(task.name, PLACEBO) for task in contexts.tasks]
    if not all(key in study.cells and len(study.cells[key].good) for key in keys):
        return None
    for name, label in keys:
        method = study.cells[name, contexts.method].runs.trials.max()
        if study.cells[name, label].runs.trials.max() < method:
            return None
    first, second = (study.executed(*key) for key in keys)
    placebo = TwoContexts(first, second, contexts.goal, contexts.hand)
    return placebo if placebo.in_both else None


def context_beyond_p(study: Study, contexts: TwoContexts) -> float:
    """P of the test that a method's postures lie further apart than the placebo's.

    NaN for a method that selects nothing, and without a placebo that made as many trials.
    """
    if not selects(study, contexts.method):
        return math.nan
    placebo = placebo_of(study, contexts)
    return math.nan if placebo is None else contexts.p_beyond(placebo)


def sign_beyond_p(study: Study, task: str, label: str, sign: str) -> float:
    """Two-tailed p of the bootstrap test of a sign of coarticulation against the placebo's.

    NaN for a method that selects nothing, and where one of both has fewer than two values.
    """
    if not selects(study, label) or (task, PLACEBO) not in study.cells:
        return math.nan
    ours, guesses = (SIGNS[sign].of(study.executed(task, who)) for who in (label, PLACEBO))
    several = min(len(ours), len(guesses)) > 1
    return bootstrap_test(ours, guesses, "two-sided").p if several else math.nan


class Difference(NamedTuple):
    """Postures at the shared goal before two successors, beside those of the placebo."""

    contexts: TwoContexts
    placebo: TwoContexts | None
    selects: bool
    """Whether the placebo is needed."""
    beyond_p: float
    """P of the test that they lie further apart than the placebo's; NaN without it."""
    differ: bool
    """Whether the postures differ, more than by chance."""
    seen: bool
    """Whether they also differ by more than the placebo's, where that is needed."""
    too_few: bool
    """Whether so few runs could not show a difference."""


@cached
def difference(study: Study) -> Difference | None:
    """How postures at the first shared goal depend on the next goal; None without two tasks."""
    contexts = shared_goal(study)
    if contexts is None:
        return None
    cell = study.cells[contexts.tasks[0].name, contexts.method]
    # A method whose runs differ by chance takes a test.
    tested = study.plan.methods[cell.method].stochastic
    differ = contexts.p < LEVEL if tested else contexts.apart > 0
    needed = selects(study, contexts.method)
    placebo = placebo_of(study, contexts) if needed else None
    beyond = math.nan if placebo is None else contexts.p_beyond(placebo)
    seen = differ and (not needed or beyond < LEVEL)
    too_few = tested and not smallest_p(*map(len, contexts.postures)) < LEVEL
    return Difference(contexts, placebo, needed, beyond, differ, seen, too_few)
