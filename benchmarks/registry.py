"""List methods by id: the built-in methods, and the methods of the user's files.

Method files are imported in separate processes (:mod:`coartic.benchmarks.method_files`).
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

from coartic.errors import CoarticError
from coartic.internal.text import unknown
from coartic.learner.conditions import EVERY_CONDITION, METHOD_PREFIX
from coartic.method import MODULES
from coartic.model import MODEL_VERSION
from coartic.runs.method_info import BUILT_IN, MethodInfo, method_info

_RESERVED = (METHOD_PREFIX, "optimum/")
"""Beginnings of ids that have a meaning in every table; they are reserved for built-in methods."""
METHOD_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+/-]{0,79}")
NAMES = ("CMA-ES", "learner", "optimum")
"""Names of built-in methods that an id of another method must not repeat."""


Registry = Mapping[str, MethodInfo]


def registry(method_files: Iterable[Path] = ()) -> dict[str, MethodInfo]:
    """Return the declaration of every known method by id: of the built-in methods, then of the
    methods in ``method_files``.

    Raises CoarticError for a file that cannot be loaded or holds no method, and for an id that is
    malformed, reserved or taken (:func:`check_id`).
    """
    infos = dict(built_in())
    for path in dict.fromkeys(Path(path).resolve() for path in method_files):
        from coartic.benchmarks.method_files import read_file  # which few commands need

        for info in read_file(path):
            check_id(info.name, info.origin, infos)
            infos[info.name] = info
    return infos


@cache
def built_in() -> Mapping[str, MethodInfo]:
    """Return the declarations of the built-in methods by id: always the same mapping, not to be
    changed."""
    return {
        method.name: method_info(method, BUILT_IN, name, f"{MODEL_VERSION}.{method.version}")
        for name in MODULES
        for method in importlib.import_module(name).METHODS
    }


def check_id(name: str, origin: str, registered: Registry) -> None:
    """Raise CoarticError for the id ``name`` of a method from ``origin`` that is malformed or has
    more than 80 characters, begins with a reserved word (:data:`_RESERVED`; capitals matter), or
    is, capitals aside, an id in ``registered``, a condition of the learner or one of
    :data:`NAMES`."""
    if not METHOD_NAME.fullmatch(name):
        raise CoarticError(
            f"{origin}: the name {name!r} must begin with a letter or digit and have only letters, "
            "digits, '.', '_', '+', '/' and '-', at most 80, such as 'my-search'"
        )
    why = ""
    if name.startswith(_RESERVED):
        ours = " or ".join(map(repr, _RESERVED))
        why = f"is reserved: ids that begin with {ours} are this project's"
    elif name in registered:
        why = f"is already taken ({registered[name].origin})"
    elif name.casefold() in map(str.casefold, (*registered, *EVERY_CONDITION, *NAMES)):
        why = "is a name of a method here: choose another"
    if why:
        raise CoarticError(f"{origin}: method id {name!r} {why}")


def methods_named(name: str, registered: Registry) -> list[str]:
    """Return the ids of the methods that a name stands for, in the order of ``registered``: of one
    method for an id or a condition of the learner, such as ``EC1``, of all methods whose ids match
    for a wildcard, such as ``optimum/*``; capitals matter.

    Raises CoarticError if no id matches.
    """
    name = f"{METHOD_PREFIX}{name}" if name in EVERY_CONDITION else name
    named = [method for method in registered if fnmatchcase(method, name)]
    if not named:
        raise CoarticError(unknown("method", name, [*registered, *EVERY_CONDITION]))
    return named
