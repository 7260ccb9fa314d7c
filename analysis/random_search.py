"""Comparisons with random search, which selects the best of many random targets.

Selection by reward alone produces signatures of coarticulation, so the signatures of a method that
selects its solution from trials have to exceed the signatures of random search. Like is compared
with like:

- runs with the same hand sequence;
- of both, the runs that *improved*: that take fewer ticks than the corrective process alone with
  the same hands, which is trial 0 of random search. Random search in a wide box mostly returns
  trial 0, whose signatures are 0, and such runs would hide what the others show;
- with as many trials.

Of several widths of its box the width counts that shows most.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from statistics import fmean

import numpy as np

from coartic.analysis.method_frame import BY_TRIAL
from coartic.analysis.signatures.two_contexts import TwoContexts
from coartic.analysis.study import Study
from coartic.estimates import FEWEST
from coartic.robot import Array

LEAST_SHARE = 0.1
"""Share of a method's runs that a hand sequence has at least where it is compared."""


def random_search_on(study: Study, task: str, trials: float = 0) -> list[str]:
    """Return the labels of the settings of random search that solved a task.

    With ``trials``: those with the fewest trials that are at least so many.
    """
    labels = study.methods.index[study.methods.algorithm == "random search"]
    trials_by_label = {
        label: most_trials(study, task, label)
        for label in labels
        if (task, label) in study.cells and len(study.cells[task, label].good)
    }
    if not trials:
        return [*trials_by_label]
    fewest = min((each for each in trials_by_label.values() if each >= trials), default=None)
    return [label for label, count in trials_by_label.items() if count == fewest]


def most_trials(study: Study, task: str, label: str) -> float:
    """Return the most trials that a run of a method made on a task."""
    return float(study.cells[task, label].runs.trials.fillna(0).max())


def beside_random_search(
    study: Study, signature: str, task: str, label: str
) -> dict[str, tuple[Array, Array]]:
    """Return a signature of a method and of random search by hand sequence.

    For each sequence with which at least a tenth of the method's improved runs end: the values of
    the method, and those of the random search that shows most of the signature with the same hands
    and as many trials, shape ``(n,)``; empty where no such random search has three runs.
    """
    of_method = study.signature_by_hands(signature, task, label)
    total = sum(map(len, of_method.values()))
    trials = most_trials(study, task, label)
    return {
        hands: (values, most_of_random_search(study, signature, task, hands, trials))
        for hands, values in of_method.items()
        if len(values) >= LEAST_SHARE * total
    }


def most_of_random_search(
    study: Study,
    signature: str,
    task: str,
    hands: str,
    trials: float,
    *,
    every: bool = False,
) -> Array:
    """Return a signature of the random search that shows most of it with some hands.

    Shape ``(n,)``; empty where no setting with so many trials has three such runs.
    ``every``: as in :meth:`.Study.signature_by_hands`.
    """
    of_settings = (
        study.signature_by_hands(signature, task, label, every=every).get(hands, np.empty(0))
        for label in random_search_on(study, task, trials)
    )
    enough = [values for values in of_settings if len(values) >= FEWEST]
    return max(enough, key=np.mean, default=np.empty(0))


def most_in_family(study: Study, signature: str, family: str, trials: float) -> str:
    """Return the setting of random search that shows most of a signature in the mean over the
    instances of a family; empty where none shows it."""
    shown: dict[str, list[float]] = {}
    for task, each in study.tasks.items():
        if each.family == family:
            for label in random_search_on(study, task, trials):
                if len(values := [*study.signature_by_hands(signature, task, label).values()]):
                    shown.setdefault(label, []).append(float(np.concatenate(values).mean()))
    return max(shown, key=lambda label: fmean(shown[label]), default="")


def excess_on_instance(study: Study, signature: str, task: str, label: str) -> float:
    """Return the excess of a method's signature over random search on an instance of a family.

    The mean over the runs of the method with whose hands random search has a run; NaN without any.
    """
    trials = most_trials(study, task, label)
    most = most_in_family(study, signature, str(study.tasks[task].family), trials)
    if (task, most) not in study.cells:
        return math.nan
    other = study.signature_by_hands(signature, task, most)
    both: Mapping[str, Array] = study.signature_by_hands(signature, task, label)
    excess = [both[hands] - other[hands].mean() for hands in both if hands in other]
    return float(np.concatenate(excess).mean()) if excess else math.nan


def selects(study: Study, label: str) -> bool:
    """Return whether a method may select its solution from many trials by their rewards."""
    method = study.methods.loc[label]
    return bool(method.algorithm != "random search" and method.information == BY_TRIAL)


def random_search_for(study: Study, contexts: TwoContexts) -> TwoContexts | None:
    """Return the setting of random search with the largest posture difference between the same two
    contexts; None without random search."""
    return max(
        every_random_search_for(study, contexts),
        key=lambda pair: pair.posture_difference,
        default=None,
    )


def every_random_search_for(study: Study, contexts: TwoContexts) -> list[TwoContexts]:
    """Return the improved runs of random search, by setting, in the same two contexts with as many
    trials as the method, where each context has three of them."""
    names, pairs = [task.name for task in contexts.tasks], []
    first, second = (
        random_search_on(study, name, most_trials(study, name, contexts.method)) for name in names
    )
    for label in (each for each in first if each in second):
        runs, others = (study.executed(name, label).improved() for name in names)
        pairs.append(TwoContexts(runs, others, contexts.goal, contexts.hand))
    return [pair for pair in pairs if min(map(len, pair.configurations)) >= FEWEST]


def context_beyond_p(study: Study, contexts: TwoContexts) -> float:
    """Return the p-value of the test that a method's posture difference exceeds the posture
    difference of random search.

    NaN for a method that selects nothing, and if no random search made as many trials.
    """
    if not selects(study, contexts.method):
        return math.nan
    random_search = random_search_for(study, contexts)
    return math.nan if random_search is None else contexts.p_beyond(random_search)
