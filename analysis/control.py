"""Comparisons of signatures of coarticulation with random search, their control.

Selection by reward alone produces signatures of coarticulation. So the signatures of a method that
selects its solution from trials are compared with the signatures of random search
(:mod:`coartic.baselines.random_search`), which is the paper's learner without its memory. Like is
compared with like:

- runs with the same hand sequence. The choice of hands itself, signature ``hand``, is compared with
  random search that tries every hand sequence, whatever the hands;
- the idle arm has noise in random search if it has noise under the learner's condition
  (``modify_other``: not under EC1 and EC3), or if there is no random search without this noise;
- as many trials;
- solved runs of both: a run that does not improve counts with what it shows, often 0.

The test is the one-tailed test of the difference of means over runs by exchange of labels.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from functools import lru_cache
from statistics import mode

import numpy as np
import pandas as pd

from coartic.analysis.methods import BY_TRIAL, LEARNERS, RANDOM_SEARCH, headline_methods
from coartic.analysis.signatures import TwoContexts, context_pairs
from coartic.analysis.study import MOST_EXECUTED, Study, solved
from coartic.learner.conditions import EVERY_CONDITION, METHOD_PREFIX
from coartic.robot import HANDS, Array

LEAST_SHARE = 0.1
"""Least share of a method's runs on a task that a compared hand sequence has."""


def with_control(
    study: Study, signature: str, task: str, label: str
) -> dict[str, tuple[Array, Array]]:
    """Return a signature of the runs of a method and of random search, by hand sequence.

    Parameters
    ----------
    study : Study
        Results that have both.
    signature : str
        Name in ``coartic.analysis.SIGNATURES``.
    task, label : str
        Task, and method with its setting, as in ``study.runs``.

    Returns
    -------
    dict
        For each hand sequence with which at least a tenth of the method's solved runs end and have
        the signature, the commonest first: the values of these runs and of the runs of random
        search (:func:`control_of`) with these hands and as many trials, shape ``(n,)`` each,
        without runs that lack the signature; the second empty if there is no such random search.
        For signature ``hand`` at most one entry, ``""``, whatever the hands. Of each method only
        the first 500 solved runs count.

    Examples
    --------
    >>> values, control = with_control(study, "first", "ascending", "dual-process/EC1")["RRR"]
    ... # doctest: +SKIP
    """
    of_method = signature_by_hands(study, signature, task, label)
    total = min(len(solved(study.cells[task, label])), MOST_EXECUTED)
    pairs = {}
    for hands, values in sorted(of_method.items(), key=lambda item: -len(item[1])):
        if len(values) >= LEAST_SHARE * total:
            control = control_of(study, task, label, hands)
            of_control = signature_by_hands(study, signature, task, control) if control else {}
            pairs[hands] = values, of_control.get(hands, np.empty(0))
    return pairs


@lru_cache(maxsize=4_096)
def signature_by_hands(study: Study, signature: str, task: str, label: str) -> dict[str, Array]:
    """Return a signature, a number for each run, of a method's runs on a task, by their hand
    sequence in alphabetical order.

    Arrays have shape ``(n,)``, of the first 500 solved runs on the task; runs without the signature
    are left out. Signature ``hand``, a measure of the choice of hands itself, has one entry ``""``
    for all hand sequences together, or none if no run has it. It is cached: do not change it.
    """
    values = study.signature(signature, task, label).to_numpy(np.float64)
    hands = np.array(study.cells[task, label].hands.tolist(), dtype=object)
    if signature == "hand":
        hands[:] = ""
    there = np.isfinite(values)
    return {each: values[there & (hands == each)] for each in sorted({*hands[there]})}


def control_of(study: Study, task: str, label: str, hands: str, *, alike: bool = False) -> str:
    """Return the label of the control of a method on a task: random search with the hand sequence
    ``hands`` (empty: with every hand sequence) and as many trials. Empty without such runs.

    Random search that explores the idle arm as the method does comes before random search that
    explores both arms; with ``alike`` only the former is a control.
    """
    controls, trials = _controls(study, task), _most_trials(study, task, label)
    explored = explores_idle_arm(study, task, label)
    other = "" if alike else controls.get((hands, trials, True), "")
    return controls.get((hands, trials, explored), other)


@lru_cache(maxsize=4_096)
def explores_idle_arm(study: Study, task: str, label: str) -> bool:
    """Return True if a method adds exploration noise to the arm that is not to hit: the learner by
    its condition, others, such as random search, by their parameter ``idle_arm``, True without it.
    Always True on tasks for one arm."""
    run = study.cells[task, label].iloc[0]
    if len(study.tasks[task].hands) == 1:
        return True
    if not run.method.startswith(METHOD_PREFIX):
        return bool(run.get("idle_arm", True))
    name = study.methods.condition[label] or run.base  # of the learner with an own condition
    changed = run.get("modify_other")
    return EVERY_CONDITION[name].modify_other if pd.isna(changed) else bool(changed)


@lru_cache(maxsize=4_096)
def _controls(study: Study, task: str) -> dict[tuple[str, float, bool], str]:
    """Return the labels of forms of random search on a task, by hand sequence of all solved runs
    (empty if every hand sequence is tried), number of trials, and True if the idle arm is explored,
    too; of forms alike in these the first. Left out are random search in several ``stages``, with
    several given hand sequences, and without a solved run."""
    labels = dict[tuple[str, float, bool], str]()
    of_search = study.methods[study.methods.algorithm == "random search"]
    for label in map(str, of_search.index):
        cell = study.cells.get((task, label))
        if cell is None or cell.iloc[0].get("stages", 1) > 1:
            continue
        hands = {*solved(cell).hands}
        every = {""} if hands and of_search.base[label] == f"{RANDOM_SEARCH}/hands" else hands
        if len(every) == 1:
            explored = explores_idle_arm(study, task, label)
            labels.setdefault((every.pop(), _most_trials(study, task, label), explored), label)
    return labels


@lru_cache(maxsize=4_096)
def _most_trials(study: Study, task: str, label: str) -> float:
    """Return the most trials that a run of a method on a task made, 0 if no run made trials."""
    return float(study.cells[task, label].trials.fillna(0).max())


def mean_excess(study: Study, signature: str, task: str, label: str) -> float:
    """Return by how much a method's signature exceeds the mean signature of random search with the
    same hands (``hand``: with any), in the unit of the signature: a mean over the runs for which
    :func:`with_control` has random search; NaN without such runs."""
    pairs = with_control(study, signature, task, label).values()
    excess = [values - control.mean() for values, control in pairs if len(control)]
    return float(np.concatenate(excess).mean()) if excess else math.nan


def selects(study: Study, label: str) -> bool:
    """Return True if a method, ``label``, declares that it gets the reward of each trial, by which
    it can select its solution, and is not random search."""
    method = study.methods.loc[label]
    return bool(method.algorithm != "random search" and method.information == BY_TRIAL)


def contexts_of_control(study: Study, contexts: TwoContexts) -> TwoContexts | None:
    """Return the runs of random search, the control of ``contexts``, on the same two tasks (the
    first 500 solved on each) for the same goal and hand; runs with the other hand do not count.

    Random search makes as many trials as the method, with the commonest hand sequence of the
    method's runs on each task. None for random search itself, for a method that does not select its
    solution by rewards of trials, and if there is no such random search on both tasks, or none of
    its runs on one of them hits the goal with the hand.
    """
    if not selects(study, contexts.method):
        return None
    both = contexts.first, contexts.second
    commonest = (mode(run.hands for run in runs.runs) for runs in both)
    labels = [
        control_of(study, runs.task.name, contexts.method, hands)
        for runs, hands in zip(both, commonest, strict=True)
    ]
    if not all(labels):
        return None
    first, second = (
        study.executed(runs.task.name, label) for runs, label in zip(both, labels, strict=True)
    )
    pair = TwoContexts(first, second, contexts.goal, contexts.hand)
    return pair if pair.in_both else None


def shared_goals(study: Study, label: str) -> Iterator[TwoContexts]:
    """Yield the first 500 solved runs of a method (label) on two tasks at each first goal that the
    tasks share (:func:`.context_pairs`), for each hand that hits this goal on both tasks."""
    for first, second, shared in context_pairs(study.individual_tasks):
        keys = (first, label), (second, label)
        if study.cells.keys() >= {*keys}:
            runs = study.executed(first, label), study.executed(second, label)
            for goal in range(1, shared + 1):
                for hand in HANDS:
                    contexts = TwoContexts(*runs, goal, hand)
                    if contexts.in_both:
                        yield contexts


@lru_cache(maxsize=4)
def shared_goal(study: Study) -> TwoContexts | None:
    """Return the runs at the first goal that two tasks share and that runs on both hit with the
    same hand, of the first method with such runs, in this order: the paper's learner, methods from
    files, methods that represent their algorithms, other methods.

    None if no method has such runs.
    """
    rows = study.methods
    subjects = rows.index[rows.is_learner], rows.index[~rows.built_in]
    order = [*LEARNERS, *itertools.chain(*subjects), *headline_methods(rows), *rows.index]
    every = (shared_goals(study, label) for label in dict.fromkeys(order))
    return next(itertools.chain.from_iterable(every), None)
