"""Names of methods, and facts about the built-in ones, which ``methods.toml`` has.

:mod:`~.method_frame` has a row for each method of a study.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from coartic.internal.text import one_line
from coartic.learner.conditions import CONDITIONS, EVERY_CONDITION, INFORMED, METHOD_PREFIX

if TYPE_CHECKING:
    from coartic.runs.method_info import MethodInfo

CONDITION_OF = {f"{METHOD_PREFIX}{name}": name for name in EVERY_CONDITION}
"""Ids of conditions of the learner, informed ones and ablations too, by the id of the method."""
LEARNERS = EC1, EC2, EC3, EC4 = tuple(CONDITION_OF)[: len(CONDITIONS)]
"""Ids of the learner under EC1 (for one arm) to EC4, which explore more and more."""
INFORMED_LEARNERS = tuple(f"{METHOD_PREFIX}{name}" for name in INFORMED)
"""Ids of the informed learner, for one arm and for two."""
RANDOM_SEARCH = "random-search"
"""Id of random search: the best of random targets around postures of the corrective process."""


COLORS = {
    "ink": "#000000",
    "walnut": "#4a2b18",
    "grape": "#4b2a9b",
    "navy": "#00558f",
    "forest": "#007c52",
    "rust": "#d55e00",
    "silver": "#8c8c8c",
    "azure": "#5bb8ea",
    "rose": "#dc9fc3",
    "amber": "#eba717",
}
"""Colours of methods by name, from dark to light. On a dark page ``page.css`` has lighter ones."""
MARKS: dict[str, Any] = {
    "star": ("*", "-"),
    "circle": ("o", (0, (1, 1.2))),
    "square": ("s", (0, (4, 1.5))),
    "diamond": ("D", (0, (9, 1.5))),
    "thin-diamond": ("d", "-"),
    "triangle": ("^", (0, (3, 1, 1, 1, 1, 1))),
    "inverted-triangle": ("v", (0, (2, 2))),
    "plus": ("P", (0, (5, 1.2, 1, 1.2))),
    "cross": ("X", (0, (7, 1, 3, 1))),
}
"""Marks of methods in Matplotlib's terms, each with the dash of lines."""


class _KnownMethod(NamedTuple):
    """Facts about a built-in method; ``methods.toml`` explains the fields."""

    name: str
    algorithm: str
    works: Sequence[str]
    look: Sequence[str] = ()
    headline: bool = False
    ablation_of: str = ""
    solvers: Sequence[str] = ()
    short: str = ""


KNOWN_METHODS = {
    name: _KnownMethod(**row)
    for name, row in tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8")).items()
}
"""Rows of the built-in methods by id, in the order of lists and figures."""
SEARCHES = ("optimum/search",)
"""Ids of the searches for the optimum: references rather than methods to compare."""
_WORDS = {
    "other_arm": "other arm ",
    "noise_sd": "σ ",
    "epsilon": "ε ",
    "hands": "hands ",
    "sigma": "σ ",
    "stop": "stop ",
}
"""Words for parameters, before their values."""


def title_of(method: str | MethodInfo, setting: str = "", *, short: bool = False) -> str:
    """Return the name of a method with its setting in words: ``learner EC4``, ``CMA-ES (other
    arm still)``. ``setting`` has the form ``sigma=0.1, stop=1``, empty for none.
    The name of a method from a file is the title in its declaration, or its id if ``method`` is
    the id. ``short``: the short name of a built-in method, if it has one; the id of a method from a
    file."""
    name, title = (method, method) if isinstance(method, str) else (method.name, method.title)
    if known := KNOWN_METHODS.get(name):
        name = (short and known.short) or known.name
    else:
        name = one_line(name if short else title)
    if not setting:
        return name
    pairs = (part.partition("=") for part in one_line(setting).split(", "))
    words = (_WORDS.get(key, key + equals) + value for key, equals, value in pairs)
    return f"{name} ({', '.join(words).replace('_', ' ')})"
