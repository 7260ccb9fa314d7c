"""Compare signatures of coarticulation with those of random search, which is the control.

Selection by reward is enough to produce signatures of coarticulation. Therefore the signatures of a
method that selects its solution from trials are compared with those of random search
(:mod:`coartic.baselines.random_search`), which is the paper's learner without its memory. The
compared runs of the method and of random search

- have the same hand sequence. There is one exception: the signature ``hand`` measures the choice of
  hands itself. For this signature, the control is the form of random search that tries all hand
  sequences;
- treat the idle arm in the same way, if possible. A learner adds exploration noise to the idle arm
  if its condition has ``modify_other`` (EC2 and EC4). If the method adds no such noise, and the
  folder contains no random search without such noise, random search with the noise is used;
- make the same number of trials;
- are solved. Solved runs that are no better than the corrective process alone are included.

Table ``signatures`` (:func:`.list_signatures`) has the p-values of the one-tailed exchange test of
the difference between the means over runs.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from functools import lru_cache
from statistics import mode
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.methods import BY_TRIAL, LEARNERS, RANDOM_SEARCH, headline_methods
from coartic.analysis.signatures import SIGNATURES, Part, TwoContexts, context_pairs
from coartic.analysis.study import MAX_EXECUTED, Study, shared_cells, solved
from coartic.learner.conditions import EVERY_CONDITION, METHOD_PREFIX
from coartic.robot import HANDS, Array

MIN_SHARE = 0.1
"""Smallest fraction of a method's solved runs on a task for which a hand sequence is compared with
random search. Counted are the runs that have this hand sequence and a value of the signature."""


def with_control(
    study: Study, signature: str, task: str, label: str
) -> dict[str, tuple[Array, Array]]:
    """Return a signature of a method and of random search, for each hand sequence.

    Parameters
    ----------
    study : Study
        Results with runs of the method and of random search.
    signature : str
        Name of the signature: a key of ``coartic.analysis.SIGNATURES``.
    task : str
        Name of the task.
    label : str
        Label of the method: its id with its setting, as in column ``label`` of ``study.runs``.

    Returns
    -------
    dict of str to (ndarray, ndarray)
        Maps each hand sequence, such as ``"RRLR"``, to two arrays of values in the unit of the
        signature: one for the method's runs, shape ``(n,)``, and one for the runs of random search
        (:func:`control_of`), shape ``(m,)``. All these runs have this hand sequence, and both
        methods make the same number of trials.

        - A hand sequence is included if at least a tenth of the method's solved runs have both this
          sequence and a value of the signature. The most frequent sequence comes first.
        - Runs in which the signature is NaN are left out of both arrays.
        - The second array is empty if the folder contains no such runs of random search.
        - For signature ``hand``, the only key is the empty string, which stands for all hand
          sequences together. On a task for one arm, the dict is then empty.
        - Only the first 500 solved runs of the method, and of random search, are used.

    Raises
    ------
    CoarticError
        The signature is unknown, the study has several worlds, the folder has no runs of the method
        on the task, or runs cannot be executed again (:meth:`.Study.executed`).

    Examples
    --------
    >>> study = coartic.analysis.load("shipped").worlds[""]  # doctest: +SKIP
    >>> values, control = with_control(study, "first", "ascending", "dual-process/EC1")["RRR"]
    ... # doctest: +SKIP
    """
    of_method = signature_by_hands(study, signature, task, label)
    total = min(len(solved(shared_cells(study)[task, label])), MAX_EXECUTED)
    pairs = {}
    for hands, values in sorted(of_method.items(), key=lambda item: -len(item[1])):
        if len(values) >= MIN_SHARE * total:
            control = control_of(study, task, label, hands)
            of_control = signature_by_hands(study, signature, task, control) if control else {}
            pairs[hands] = values, of_control.get(hands, np.empty(0))
    return pairs


@lru_cache(maxsize=4_096)
def signature_by_hands(study: Study, signature: str, task: str, label: str) -> dict[str, Array]:
    """Return a dict that maps each hand sequence to the signature of its runs.

    The keys are in alphabetical order. Each value is an array of shape ``(n,)``, in the unit of the
    signature, with an entry for each run that has this hand sequence. Runs in which the signature
    is NaN are left out. Only the first 500 solved runs of the method on the task are used. For
    signature ``hand``, the only key is the empty string, which stands for all hand sequences
    together. The dict is empty if no run has the signature. It is cached: do not change it.
    """
    values = study.signature(signature, task, label).to_numpy(np.float64)
    hands = np.array(shared_cells(study)[task, label].hands.fillna("").tolist(), dtype=object)
    if not SIGNATURES[signature].by_hands:
        hands[:] = ""
    has_value = np.isfinite(values)
    sequences = sorted({*hands[has_value]})
    return {sequence: values[has_value & (hands == sequence)] for sequence in sequences}


def control_of(study: Study, task: str, label: str, hands: str, *, alike: bool = False) -> str:
    """Return the label of the random search that is the control of a method.

    This form of random search has the hand sequence ``hands``, and as many trials as the method. If
    there are several such forms, the one that treats the idle arm as the method does is preferred.

    Parameters
    ----------
    study : Study
    task, label : str
        Name of the task, and label of the method.
    hands : str
        Hand sequence of all solved runs of random search, such as ``"RRLR"``. The empty string
        stands for the form of random search that tries all hand sequences.
    alike : bool
        True to accept only random search that treats the idle arm as the method does. False to
        accept random search that explores both arms, too, if there is no other.

    Returns
    -------
    str
        The label; the empty string if the folder has no such runs.
    """
    controls, trials = _controls(study, task), _most_trials(study, task, label)
    explored = explores_idle_arm(study, task, label)
    other = "" if alike else controls.get((hands, trials, True), "")
    return controls.get((hands, trials, explored), other)


@lru_cache(maxsize=4_096)
def explores_idle_arm(study: Study, task: str, label: str) -> bool:
    """Return whether a method counts as exploring with the idle arm on a task.

    - On a task for one arm, the result is always True.
    - For the learner, the result is ``modify_other`` of its exploration condition: True if the
      learner adds exploration noise to the idle arm.
    - For any other method with a parameter ``idle_arm``, such as random search, the result is the
      value of this parameter.
    - For a method without this parameter, the result is True.
    """
    if len(study.tasks[task].hands) == 1:
        return True
    runs = shared_cells(study)[task, label]
    if not study.methods.method_id[label].startswith(METHOD_PREFIX):
        return bool(_first(runs, "idle_arm", True))
    name = study.methods.condition[label] or _first(runs, "base")  # that of a user's condition
    changed = _first(runs, "modify_other")
    return EVERY_CONDITION[name].modify_other if pd.isna(changed) else bool(changed)


def _first(runs: pd.DataFrame, column: str, default: object = None) -> Any:
    """Return the value of the first run in a column, or the default if there is no such column.

    A whole row of the frame would take long, as each column has a type of its own.
    """
    return runs[column].iloc[0] if column in runs else default


@lru_cache(maxsize=4_096)
def _controls(study: Study, task: str) -> dict[tuple[str, float, bool], str]:
    """Return a dict that maps forms of random search on a task to their labels.

    A form is a method whose algorithm is ``random search``, with its setting. Each key is a tuple
    of

    - the hand sequence; the empty string for ``random-search/hands``, which tries all hand
      sequences;
    - the number of trials (:func:`_most_trials`);
    - True if the form explores the idle arm (:func:`explores_idle_arm`), otherwise False.

    If several forms have the same key, the first of them is used. A form is left out if

    - it has more than one stage (parameter ``stages``);
    - it has no solved run on the task;
    - it is not ``random-search/hands``, and its solved runs have different hand sequences.
    """
    labels = dict[tuple[str, float, bool], str]()
    of_search = study.methods[study.methods.algorithm == "random search"]
    for label in map(str, of_search.index):
        cell = shared_cells(study).get((task, label))
        if cell is None or _first(cell, "stages", 1) > 1:
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
    """Return the largest number of trials that a run of a method made on a task.

    The result is 0 for a method without trials.
    """
    return float(shared_cells(study)[task, label].trials.fillna(0).max())


def mean_excess(study: Study, signature: str, task: str, label: str) -> float:
    """Return the mean difference between a method's signature and that of random search.

    For each run of the method, the difference is the signature of the run minus the mean signature
    of random search with the same hand sequence. (For signature ``hand``, random search tries all
    hand sequences.) The result is the mean of these differences over runs.

    Parameters
    ----------
    study : Study
        Results with runs of the method and of random search.
    signature : str
        Name of the signature: a key of ``coartic.analysis.SIGNATURES``.
    task, label : str
        Name of the task, and label of the method.

    Returns
    -------
    float
        The mean difference, in the unit of the signature. Hand sequences for which
        :func:`with_control` returns no runs of random search are left out. The mean is NaN if no
        hand sequence is left.

    Raises
    ------
    CoarticError
        The signature is unknown, the study has several worlds, the folder has no runs of the method
        on the task, or runs cannot be executed again.
    """
    pairs = with_control(study, signature, task, label).values()
    excess = [values - control.mean() for values, control in pairs if len(control)]
    return float(np.concatenate(excess).mean()) if excess else math.nan


def selects(study: Study, label: str) -> bool:
    """Return whether a method, other than random search, can select its solution from trials.

    A method can do so if it declares that it uses the reward of each trial, and if at least one of
    its runs made more than one trial. The result is False for random search itself.
    """
    method = study.methods.loc[label]
    return bool(method.algorithm != "random search" and method.information == BY_TRIAL)


def contexts_of_control(study: Study, contexts: TwoContexts) -> TwoContexts | None:
    """Return the runs of random search as a control of a comparison of two contexts.

    Parameters
    ----------
    study : Study
        Results with runs of the method and of random search.
    contexts : TwoContexts
        Runs of a method of the study, at a goal that two tasks share.

    Returns
    -------
    TwoContexts or None
        Runs of random search on the same two tasks, compared at the same goal, with the same hand
        and in the same part of the posture. Random search makes as many trials as the method. On
        each task, it uses the hand sequence that is most frequent in the method's runs. Only the
        first 500 solved runs on each task are used. The result is None if

        - the method is random search, or cannot select its solution from trials (:func:`selects`);
        - one of the two tasks lacks such runs of random search;
        - on one of the two tasks, no run of random search hits the goal with the hand.

    Raises
    ------
    CoarticError
        The study has several worlds, or runs of random search cannot be executed again
        (:meth:`.Study.executed`).
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
    """Yield a comparison of a method's runs for each goal that two tasks share.

    Two tasks share goals if they begin with the same goals (:func:`.context_pairs`). Only the tasks
    that a report shows individually are used (:attr:`.Study.individual_tasks`). There is one
    comparison for each pair of tasks, for each shared goal, and for each hand with which at least
    one run on each of the two tasks hits this goal. Only the first 500 solved runs of the method on
    each task are used.

    Parameters
    ----------
    study : Study
    label : str
        Label of the method.
    part : {"all", "base", "joints"}
        Coordinates of the posture that are compared (:class:`.TwoContexts`).

    Yields
    ------
    TwoContexts
        The comparisons, in the order of the pairs of tasks, then of the goals, then left hand
        before right hand.
    """
    for first, second, shared in context_pairs(study.individual_tasks):
        keys = (first, label), (second, label)
        if shared_cells(study).keys() >= {*keys}:
            runs = study.executed(first, label), study.executed(second, label)
            for goal in range(1, shared + 1):
                for hand in HANDS:
                    contexts = TwoContexts(*runs, goal, hand, part=part)
                    if contexts.in_both:
                        yield contexts


@lru_cache(maxsize=4)
def shared_goal(study: Study, *, part: Part = "all") -> TwoContexts | None:
    """Return the first comparison of :func:`shared_goals` for the methods of a study, or None.

    The methods are tried in this order: the paper's learner, methods from files, methods that
    represent their algorithms (:func:`.headline_methods`), and then all other methods. ``part``
    names the coordinates of the posture that are compared (:class:`.TwoContexts`). The result is
    cached.
    """
    rows = study.methods
    subjects = rows.index[rows.is_learner], rows.index[~rows.built_in]
    order = [*LEARNERS, *itertools.chain(*subjects), *headline_methods(rows), *rows.index]
    of_methods = (shared_goals(study, label, part=part) for label in dict.fromkeys(order))
    return next(itertools.chain.from_iterable(of_methods), None)
