"""Methods by id."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from coartic import CONDITIONS, CoarticError, ExplorationCondition
from coartic.learner import METHOD_PREFIX

METHODS: dict[str, ExplorationCondition] = {
    f"{METHOD_PREFIX}{name}": condition for name, condition in CONDITIONS.items()
}


def unknown(kind: str, name: str, known: Iterable[str]) -> CoarticError:
    """An error for a name that is not among the known ones, with the nearest of them."""
    names = list(known)
    close = difflib.get_close_matches(name, names, n=1)
    hint = f"; did you mean {close[0]!r}?" if close else ";"
    return CoarticError(f"unknown {kind} {name!r}{hint} Known: {', '.join(names)}.")
