"""Tests against guesses: random targets, of which the best of many is selected.

A method that selects its solution from trials by their rewards shows signatures that selection
alone shows, and has to exceed those of guesses. A folder may have guesses of several widths, and
with every hand sequence. On each task, or in each family, the one that shows most of a signature
counts.
"""

from __future__ import annotations

import math

import numpy as np

from coartic.analysis.methods import ALL_GUESSES
from coartic.analysis.signatures.measures import SIGNATURES
from coartic.analysis.signatures.two_contexts import TwoContexts
from coartic.analysis.study import Study
from coartic.analysis.topics.scores import BY_TRIAL, groups
from coartic.robot import Array


def guesses_on(study: Study, task: str) -> list[str]:
    """Labels of the guesses that solved a task."""
    return [
        label
        for (name, label), cell in study.cells.items()
        if name == task and cell.method in ALL_GUESSES and len(cell.good)
    ]


def most_guessed(study: Study, task: str, signature: str) -> Array:
    """A signature of the guesses whose runs show most of it in the mean, shape ``(n,)``; empty
    where none has a value."""
    signatures = [
        SIGNATURES[signature].of(study.executed(task, each)) for each in guesses_on(study, task)
    ]
    return max((values for values in signatures if len(values)), key=np.mean, default=np.empty(0))


def selects(study: Study, label: str) -> bool:
    """Whether a method's solution may be one of many trials, selected by its reward."""
    return label.partition(" ")[0] not in ALL_GUESSES and groups(study)[label] == BY_TRIAL


def guesses_beside(study: Study, contexts: TwoContexts) -> TwoContexts | None:
    """The guesses whose postures lie farthest apart in the same two contexts; None without one
    that made as many trials."""
    names, pairs = [task.name for task in contexts.tasks], []
    for label in (
        each for each in guesses_on(study, names[0]) if each in guesses_on(study, names[1])
    ):
        most, wanted = (
            [study.cells[name, who].runs.trials.max() for name in names]
            for who in (label, contexts.method)
        )
        if all(m >= w for m, w in zip(most, wanted, strict=True)):
            first, second = (study.executed(name, label) for name in names)
            pairs.append(TwoContexts(first, second, contexts.goal, contexts.hand))
    return max((pair for pair in pairs if pair.in_both), key=lambda p: p.apart, default=None)


def context_beyond_p(study: Study, contexts: TwoContexts) -> float:
    """P of the test that a method's postures lie further apart than those of guesses.

    NaN for a method that selects nothing, and without guesses that made as many trials.
    """
    if not selects(study, contexts.method):
        return math.nan
    guesses = guesses_beside(study, contexts)
    return math.nan if guesses is None else contexts.p_beyond(guesses)
