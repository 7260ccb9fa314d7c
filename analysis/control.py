"""Compare signatures of coarticulation with those of random search, their control.

Selection by reward is enough to produce signatures of coarticulation. Therefore signatures of a
method that selects its solution from trials are compared with those of random search
(:mod:`coartic.baselines.random_search`), which is the paper's learner without its memory. The
compared runs have

- the same hand sequence. Signature ``hand``, the choice of hands itself, is compared with random
  search that tries all hand sequences, and all its runs count;
- the same treatment of the idle arm, if possible. A learner adds noise to the idle arm if its
  condition has ``modify_other`` (EC2 and EC4). If there is no random search without this noise,
  random search with it is used;
- the same number of trials;
- a solution. A solved run that does not improve counts with its value, often 0.

The test is the one-tailed exchange test of the difference of means over runs.
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
from coartic.analysis.signatures import SIGNATURES, Part, TwoContexts, context_pairs
from coartic.analysis.study import MAX_EXECUTED, Study, solved
from coartic.learner.conditions import EVERY_CONDITION, METHOD_PREFIX
from coartic.robot import HANDS, Array

MIN_SHARE = 0.1
"""Smallest share of a method's solved runs on a task that a compared hand sequence must have."""


def with_control(
    study: Study, signature: str, task: str, label: str
) -> dict[str, tuple[Array, Array]]:
    """Return a signature of the runs of a method and of random search, by hand sequence.

    Parameters
    ----------
    study : Study
        Results with runs of the method and of random search.
    signature : str
        Name in ``coartic.analysis.SIGNATURES``.
    task, label : str
        Task, and method with its setting, as in ``study.runs``.

    Returns
    -------
    dict
        For each hand sequence, the values of the method's runs and of the runs of random search
        (:func:`control_of`) with these hands and the same number of trials, shape ``(n,)`` each.

        - A hand sequence is included if at least a tenth of the method's solved runs have these
          hands and the signature. The most frequent sequence comes first.
        - Runs without the signature are left out.
        - The second array is empty if there is no such random search.
        - For signature ``hand`` there is at most one entry, ``""``, for all hands.
        - Only the first 500 solved runs of each method count.

    Examples
    --------
    >>> values, control = with_control(study, "first", "ascending", "dual-process/EC1")["RRR"]
    ... # doctest: +SKIP
    """
    of_method = signature_by_hands(study, signature, task, label)
    total = min(len(solved(study.cells[task, label])), MAX_EXECUTED)
    pairs = {}
    for hands, values in sorted(of_method.items(), key=lambda item: -len(item[1])):
        if len(values) >= MIN_SHARE * total:
            control = control_of(study, task, label, hands)
            of_control = signature_by_hands(study, signature, task, control) if control else {}
            pairs[hands] = values, of_control.get(hands, np.empty(0))
    return pairs


@lru_cache(maxsize=4_096)
def signature_by_hands(study: Study, signature: str, task: str, label: str) -> dict[str, Array]:
    """Return a signature of a method's runs on a task, by hand sequence in alphabetical order.

    Arrays have shape ``(n,)``, with a number for each of the first 500 solved runs that has the
    signature. Signature ``hand``, which measures the choice of hands itself, has one entry ``""``
    for all hand sequences together, or none if no run has it. The result is cached: do not change
    it.
    """
    values = study.signature(signature, task, label).to_numpy(np.float64)
    hands = np.array(study.cells[task, label].hands.fillna("").tolist(), dtype=object)
    if not SIGNATURES[signature].by_hands:
        hands[:] = ""
    has_value = np.isfinite(values)
    sequences = sorted({*hands[has_value]})
    return {sequence: values[has_value & (hands == sequence)] for sequence in sequences}


def control_of(study: Study, task: str, label: str, hands: str, *, alike: bool = False) -> str:
    """Return the label of the random search that controls a method on a task.

    This random search has the hand sequence ``hands`` (if ``hands`` is empty, it tries all hand
    sequences) and the same number of trials. The result is empty if there are no such runs.

    Random search that treats the idle arm as the method does is preferred. If there is none, random
    search that explores both arms is used, unless ``alike`` is True.
    """
    controls, trials = _controls(study, task), _most_trials(study, task, label)
    explored = explores_idle_arm(study, task, label)
    other = "" if alike else controls.get((hands, trials, True), "")
    return controls.get((hands, trials, explored), other)


@lru_cache(maxsize=4_096)
def explores_idle_arm(study: Study, task: str, label: str) -> bool:
    """Return True if a method adds exploration noise to the idle arm.

    - On tasks for one arm, the result is always True.
    - For the learner, its condition decides.
    - For other methods, such as random search, their parameter ``idle_arm`` decides. If a method
      does not have this parameter, the result is True.
    """
    run = study.cells[task, label].iloc[0]
    if len(study.tasks[task].hands) == 1:
        return True
    if not run.method.startswith(METHOD_PREFIX):
        return bool(run.get("idle_arm", True))
    name = study.methods.condition[label] or run.base  # the base of a user's condition
    changed = run.get("modify_other")
    return EVERY_CONDITION[name].modify_other if pd.isna(changed) else bool(changed)


@lru_cache(maxsize=4_096)
def _controls(study: Study, task: str) -> dict[tuple[str, float, bool], str]:
    """Return the labels of the forms of random search on a task.

    A form is a method ``random-search...`` with its setting. The keys are the hand sequence (empty
    if the form tries all hand sequences), the number of trials, and whether the idle arm is
    explored. If several forms have the same key, the first is used. A form is left out if

    - it has more than one stage (parameter ``stages``);
    - it has no solved run on the task;
    - its solved runs have different hand sequences, although it does not try all by design.
    """
    labels = dict[tuple[str, float, bool], str]()
    of_search = study.methods[study.methods.algorithm == "random search"]
    for label in map(str, of_search.index):
        cell = study.cells.get((task, label))
        if cell is None or cell.iloc[0].get("stages", 1) > 1:
            continue
        hands = {*solved(cell).hands}
        sequences = (
            {""} if hands and of_search.method_id[label] == f"{RANDOM_SEARCH}/hands" else hands
        )
        if len(sequences) == 1:
            explored = explores_idle_arm(study, task, label)
            key = sequences.pop(), _most_trials(study, task, label), explored
            labels.setdefault(key, label)
    return labels


@lru_cache(maxsize=4_096)
def _most_trials(study: Study, task: str, label: str) -> float:
    """Return the largest number of trials of a method's runs on a task; 0 without trials."""
    return float(study.cells[task, label].trials.fillna(0).max())


def mean_excess(study: Study, signature: str, task: str, label: str) -> float:
    """Return by how much a method's signature exceeds that of random search on average.

    Each run is compared with the mean of random search with the same hands (for signature ``hand``,
    with any hands). Only runs count for which :func:`with_control` has random search. The result is
    in the unit of the signature, and NaN if no run counts.
    """
    pairs = with_control(study, signature, task, label).values()
    excess = [values - control.mean() for values, control in pairs if len(control)]
    return float(np.concatenate(excess).mean()) if excess else math.nan


def selects(study: Study, label: str) -> bool:
    """Return True if a method can select its solution from trials, and is not random search.

    A method can select if it declares that it uses the reward of each trial, and if one of its runs
    made more than one trial.
    """
    method = study.methods.loc[label]
    return bool(method.algorithm != "random search" and method.information == BY_TRIAL)


def contexts_of_control(study: Study, contexts: TwoContexts) -> TwoContexts | None:
    """Return the runs of random search that are the control of ``contexts``, or None.

    They are runs on the same two tasks, for the same goal, hand and part of the posture, with the
    same number of trials as the method. On each task, they have the hand sequence that is most
    frequent in the method's runs. Only the first 500 solved runs on each task count.

    The result is None if

    - the method is random search, or does not select its solution from trials (:func:`selects`);
    - there is no such random search on both tasks;
    - on one of the tasks, no run of random search hits the goal with the hand.
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
    pair = TwoContexts(first, second, contexts.goal, contexts.hand, part=contexts.part)
    return pair if pair.in_both else None


def shared_goals(study: Study, label: str, *, part: Part = "all") -> Iterator[TwoContexts]:
    """Yield a method's runs on two tasks, for each goal that the tasks share.

    Two tasks share goals if they begin with the same goals (:func:`.context_pairs`). There is an
    item for each pair of tasks, each shared goal, and each hand that hits this goal on both tasks.
    Only the first 500 solved runs on each task count. ``part`` is the part of the posture that is
    compared.
    """
    for first, second, shared in context_pairs(study.individual_tasks):
        keys = (first, label), (second, label)
        if study.cells.keys() >= {*keys}:
            runs = study.executed(first, label), study.executed(second, label)
            for goal in range(1, shared + 1):
                for hand in HANDS:
                    contexts = TwoContexts(*runs, goal, hand, part=part)
                    if contexts.in_both:
                        yield contexts


@lru_cache(maxsize=4)
def shared_goal(study: Study, *, part: Part = "all") -> TwoContexts | None:
    """Return the first item of :func:`shared_goals` of the first method that has one, or None.

    Methods are tried in this order: the paper's learner, methods from files, methods that represent
    their algorithms, other methods.
    """
    rows = study.methods
    subjects = rows.index[rows.is_learner], rows.index[~rows.built_in]
    order = [*LEARNERS, *itertools.chain(*subjects), *headline_methods(rows), *rows.index]
    of_methods = (shared_goals(study, label, part=part) for label in dict.fromkeys(order))
    return next(itertools.chain.from_iterable(of_methods), None)
