"""Names and looks of the built-in methods, and the works behind them.

``methods.toml`` has a row for each. A method of somebody else has none and goes by its id.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from coartic import Task
from coartic.internal.text import one_line
from coartic.learner import conditions
from coartic.learner.conditions import METHOD_PREFIX
from coartic.runs.plan import SEARCH

LEARNER = METHOD_PREFIX
"""Beginning of the paper's learner's id; the exploration condition follows."""
LEARNERS = EC1, EC2, EC3, EC4 = tuple(LEARNER + name for name in conditions.CONDITIONS)
"""Labels of the learner under the paper's conditions: the first with one arm, the others with
two, more exploration later."""
TOGETHER = f"{LEARNER.rstrip('/')} ("
"""Beginning of the label of several conditions together, each on the tasks that it is for."""
RANDOM_SEARCH = "random-search"
"""The best of random targets around the corrective process, which cannot coarticulate."""
RANDOM_SEARCHES = RANDOM_SEARCH, "random-search/hands"
"""The same with the best hands, and with every hand sequence."""
INITIAL = "corrective-alone/given"
"""The corrective process with a task's initial hands: the initial solution."""
BEST_HANDS = "corrective-alone/best-hands"
"""The corrective process with the best of all hand sequences."""


class KnownMethod(NamedTuple):
    """A built-in method's row; ``methods.toml`` explains the fields."""

    name: str
    algorithm: str
    works: Sequence[str]
    look: Sequence[str] | None = None
    headline: bool = False
    solvers: Sequence[str] = ()


KNOWN_METHODS = {
    name: KnownMethod(**row)
    for name, row in tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8")).items()
}
"""Rows of the built-in methods by id, in the order of lists and figures."""
_PARAMETERS = {
    "other_arm=": "other arm ",
    "noise_sd=": "σ ",
    "epsilon=": "ε ",
    "hands=": "hands ",
    "half_width=": "± ",
    "stop=": "stop ",
}


def most_exploring(task: Task) -> str:
    """Label of the learner under the condition that explores most on a task."""
    return EC4 if len(task.hands) > 1 else EC1


def is_learner(label: str) -> bool:
    """Whether it is the paper's learner under its own conditions, alone or several together."""
    return label.startswith((LEARNER, TOGETHER)) and not is_setting(label)


def learns_nothing(label: str) -> bool:
    """Return whether a method makes trials without learning from them: random search, and the
    corrective process alone, which tries hand sequences."""
    return label.partition(" ")[0] in (*RANDOM_SEARCHES, INITIAL, BEST_HANDS)


def is_built_in(label: str) -> bool:
    """Whether it is one of coartic's methods, or several of the learner's conditions together."""
    return label.partition(" ")[0] in KNOWN_METHODS or label.startswith(TOGETHER)


def is_setting(label: str) -> bool:
    """Whether it is a setting of a built-in method, or an ablation of the learner.

    A method of somebody else stands by itself with whatever parameters it was run.
    """
    return is_built_in(label) and bool(re.search(r"=|\bEC\d-", label))


def is_search(label: str) -> bool:
    """Whether it searches for the optimum: a reference rather than a method to compare."""
    return label.startswith(SEARCH)


def algorithm_of(label: str) -> str:
    """Algorithm of a method; a method without a row is its own."""
    row = KNOWN_METHODS.get(look_alike(label).partition(" ")[0])
    return row.algorithm if row else one_line(label)


def name_of(label: str) -> str:
    """The name of a method with its setting, the same wherever it is shown.

    ``learner EC4``, ``hill climbing``, ``CMA-ES (other arm still)``. The learner's conditions
    together, ``dual-process (EC1, EC4)``, are ``learner (EC1, EC4)``; a method that is not built
    in is its label.
    """
    label = one_line(label)
    method, _, setting = label.partition(" ")
    name = KNOWN_METHODS[method].name if method in KNOWN_METHODS else method
    if label.startswith(TOGETHER):
        name, _, setting = label.replace(LEARNER.rstrip("/"), "learner", 1).partition(") ")
        name = name.rstrip(")") + ")"
    for key, words in _PARAMETERS.items():
        setting = re.sub(rf"(^|(?<=, )){re.escape(key)}", words, setting)
    return f"{name} ({setting.replace('_', ' ')})" if setting else name


def look_alike(label: str) -> str:
    """Label of the method whose look this one has: EC4 for the learner over all tasks."""
    if label == "learner":
        return EC4
    if not label.startswith(TOGETHER):
        return label
    ends = (name for name in reversed(LEARNERS) if name.removeprefix(LEARNER) in label)
    return next(ends, label)


def main_methods(labels: Iterable[str]) -> list[str]:
    """Labels that stand for their algorithms, in the order of figures; all if none does.

    The learner over all tasks, with the condition that explores most, takes the place of its
    single conditions.
    """
    labels = list(dict.fromkeys(labels))
    over_all = [name for name in labels if name.startswith(TOGETHER) and not is_setting(name)]
    together = [max(over_all)] if over_all else []
    single = [
        label
        for label, row in KNOWN_METHODS.items()
        if row.headline and label in labels and not (together and label.startswith(LEARNER))
    ]
    foreign = [label for label in labels if not is_built_in(label)]
    return [*together, *single, *foreign] or labels


def in_order(labels: Collection[str]) -> list[str]:
    """Labels in the order of lists and figures, methods without a row last."""
    place = {name: number for number, name in enumerate(KNOWN_METHODS)}
    return sorted(labels, key=lambda label: place.get(look_alike(label).partition(" ")[0], 999))
