"""Comparisons with random search, which selects the best of many random targets.

Selection by reward alone produces signatures of coarticulation, so the signatures of a method that
selects its solution from trials have to exceed the signatures of random search. A folder may have
several settings of random search; the setting with the largest signature counts.
"""

from __future__ import annotations

import math
from statistics import fmean

import numpy as np

from coartic.analysis.method_frame import BY_TRIAL
from coartic.analysis.signatures.two_contexts import TwoContexts
from coartic.analysis.study import Study
from coartic.robot import Array


def random_search_on(study: Study, task: str) -> list[str]:
    """Return the labels of the settings of random search that solved a task."""
    labels = study.methods.index[study.methods.algorithm == "random search"]
    cells = {label: study.cells.get((task, label)) for label in labels}
    return [label for label, cell in cells.items() if cell is not None and len(cell.good)]


def most_of_random_search(study: Study, signature: str, task: str) -> Array:
    """Return a signature of random search on a task, shape ``(n,)``; empty without it.

    Of the setting with the largest mean of this signature, on the task or, for an instance of a
    family, over the instances.
    """
    family, shown = study.tasks[task].family, dict[str, dict[str, Array]]()
    for each, other in study.tasks.items():
        if each == task or (family is not None and other.family == family):
            for label in random_search_on(study, each):
                if len(values := study.signature_of(signature, each, label)):
                    shown.setdefault(label, {})[each] = values
    most = max(shown.values(), key=lambda of: fmean(map(np.mean, of.values())), default={})
    return most.get(task, np.empty(0))


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
    """Return the settings of random search in the same contexts, with as many trials or more."""
    names, pairs = [task.name for task in contexts.tasks], []

    def trials(label: str) -> Array:
        made = [study.cells[name, label].runs.trials.fillna(0).max() for name in names]
        return np.array(made, dtype=np.float64)

    on_first, on_second = (random_search_on(study, name) for name in names)
    for label in (each for each in on_first if each in on_second):
        if (trials(label) >= trials(contexts.method)).all():
            first, second = (study.executed(name, label) for name in names)
            pairs.append(TwoContexts(first, second, contexts.goal, contexts.hand))
    return [pair for pair in pairs if pair.in_both]


def context_beyond_p(study: Study, contexts: TwoContexts) -> float:
    """Return the p-value of the test that a method's posture difference exceeds the posture
    difference of random search.

    NaN for a method that selects nothing, and if no random search made as many trials.
    """
    if not selects(study, contexts.method):
        return math.nan
    random_search = random_search_for(study, contexts)
    return math.nan if random_search is None else contexts.p_beyond(random_search)
