"""Parameters and constants that versions 1.0 and 1.1 stored, and this version does not have.

That is how they read the paper, which could then be read in several ways, and how null-space
control stated its programmes. They are still a part of the hash with which the id of a run begins;
so runs that did as this version does count as its own, and others are refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from coartic.learner.conditions import METHOD_PREFIX
from coartic.model import PAPER

MODEL = {
    **PAPER._asdict(),
    "arrival_tick": 1,
    "corrective_arrival": False,
    "first_step": False,
    "whole_last_step": False,
}
"""The constants of movement, as they were stored."""
_OF_LEARNER = {
    "equal_distance": "random",
    "first_trial": "learns",
    "state": "previous-hand",
    "ties": "left",
    "unknown_target": "corrects",
}


def parameters_then(method: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of a method as they were stored."""
    return {**parameters, **_fixed(method)}


def parameters_now(method: str, stored: Mapping[str, Any]) -> dict[str, Any]:
    """Stored parameters of a method, without those that it no longer has. Raises TypeError for what
    is no table."""
    if not isinstance(stored, Mapping):
        raise TypeError(f"parameters are {stored!r}")
    return {name: value for name, value in stored.items() if name not in _fixed(method)}


def _fixed(method: str) -> dict[str, Any]:
    if method.startswith("nullspace-qp/"):
        return {"modelling": "none"}
    return _OF_LEARNER if method.startswith(METHOD_PREFIX) else {}
