"""What the analysis knows of the built-in methods: names, looks and works behind them.

A row of ``methods.toml`` for each; methods of others have none.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Literal

from pydantic import BaseModel, ConfigDict, TypeAdapter

from coartic import Task, exploration
from coartic.analysis.references import Key
from coartic.analysis.words import stated
from coartic.learning import METHOD_PREFIX
from coartic.text import one_line

LEARNER = METHOD_PREFIX
"""The paper's learner: the name begins so, and its exploration condition follows."""
CONDITIONS = EC1, EC2, EC3, EC4 = tuple(LEARNER + name for name in exploration.CONDITIONS)
"""Labels of the learner under the paper's conditions: the first with one arm, the others with two,
what explores more behind."""
TWO_ARMED = CONDITIONS[1:]
TOGETHER = f"{LEARNER.rstrip('/')} ("
"""So begins the label of several conditions together, each on the tasks that it is for."""
INITIAL = "corrective-alone/given"
"""Whose solution is the initial one."""


Color = Literal["blue", "sky", "green", "orange", "vermillion", "purple", "grey", "ink"]
Dash = Literal["solid", "dashed", "dotted", "dash-dotted"]


class KnownMethod(BaseModel):
    """A built-in method's row."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    short: str
    """Its name in figures and printed tables."""
    look: tuple[Color, Dash, str] | None = None
    """Colour, dash and matplotlib's marker in all figures; None for what is left there."""
    headline: bool = False
    """Whether it stands for its family where no methods are named."""
    works: tuple[Key, ...]
    """Keys of ``references.bib``, the most telling first; none for what is this software's own."""
    solvers: tuple[Key, ...] = ()
    """Keys of the works behind what poses and solves its programmes."""


KNOWN_METHODS: Mapping[str, KnownMethod] = TypeAdapter(dict[str, KnownMethod]).validate_python(
    stated(__file__)
)
"""Rows of the built-in methods by id, in the order of lists and figures."""
_PARAMETERS = {
    "other_arm=": "other arm ",
    "noise_sd=": "σ ",
    "epsilon=": "ε ",
    "hands=": "hands ",
    "timing=fixed": "fixed times",
}


FAMILIES: Mapping[str, str] = {
    "dual-process": "learner",
    "corrective-alone": "corrective process alone",
    "random-search": "random search",
    "cma-es": "CMA-ES",
    "nullspace-qp": "null-space control",
    "posture-based": "posture plan",
    "trajectory-optimisation": "trajectory plan",
    "optimum": "search for the optimum",
}
"""What the built-in methods of one family are called together."""


def most_exploring(task: Task) -> str:
    """Label of the learner under the condition that explores most on a task."""
    return EC4 if len(task.hands) > 1 else EC1


def family_of(label: str) -> str:
    """The family of a method in words; of one that is not built in what its name begins with."""
    first = re.split(r"[/ ]", one_line(label), maxsplit=1)[0]
    return FAMILIES.get(first, first)


def spoken_name(label: str) -> str:
    """The name of a method with its variant as a sentence has it.

    ``learner EC4``, ``null-space control (next goal)``.
    """
    name = short_name(label)
    if label.startswith(LEARNER):
        return f"{FAMILIES['dual-process']} {name}"
    _, apart, rest = name.partition(": ")
    return f"{family_of(label)} ({rest})" if apart and label in KNOWN_METHODS else name


def short_name(label: str) -> str:
    """The name of a method with its variant as figures and printed tables show it.

    Of a method that is not built in it is the label itself. The learner's conditions together,
    ``dual-process (EC1, EC4)``, are ``learner (EC1, EC4)``.
    """
    label = one_line(label)
    if label.startswith(TOGETHER):
        return label.replace(LEARNER.rstrip("/"), FAMILIES["dual-process"], 1)
    method, _, variant = label.partition(" ")
    name = KNOWN_METHODS[method].short if method in KNOWN_METHODS else method
    for key, words in _PARAMETERS.items():
        variant = re.sub(rf"(^|(?<=, )){re.escape(key)}", words, variant)
    if not variant:
        return name
    begun = f"{name[:-1]}, " if name.endswith(")") else f"{name} ("
    return f"{begun}{variant.replace('_', ' ')})"
