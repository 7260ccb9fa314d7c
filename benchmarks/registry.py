"""List methods by id: the built-in methods, and the methods of the user's files.

Method files are imported in separate processes (:mod:`coartic.benchmarks.method_files`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

from coartic.errors import CoarticError
from coartic.internal.text import unknown
from coartic.learner.conditions import EVERY_CONDITION, METHOD_PREFIX
from coartic.method import built_in_methods
from coartic.model import MODEL_VERSION
from coartic.runs.method_info import BUILT_IN, MethodInfo, method_info

_RESERVED = (METHOD_PREFIX, "optimum/")
"""Prefixes of ids that are reserved for built-in methods, because tables interpret them."""
METHOD_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+/-]{0,79}")
NAMES = ("CMA-ES", "learner", "optimum")
"""Names of built-in methods that the id of another method must not repeat."""


Registry = Mapping[str, MethodInfo]


def registry(method_files: Iterable[Path] = ()) -> dict[str, MethodInfo]:
    """Return a dict that maps ids to the declarations of all known methods.

    Built-in methods come first, then the methods of ``method_files``. Raises CoarticError for a
    file that cannot be loaded or has no method, and for an id that is not allowed
    (:func:`check_id`).
    """
    infos = dict(built_in())
    for path in dict.fromkeys(Path(path).resolve() for path in method_files):
        from coartic.benchmarks.method_files import read_file  # most commands do not need it

        for info in read_file(path):
            check_id(info.name, info.origin, infos)
            infos[info.name] = info
    return infos


@cache
def built_in() -> Mapping[str, MethodInfo]:
    """Return a mapping from ids to the declarations of the built-in methods.

    Each call returns the same mapping: do not change it.
    """
    return {
        name: method_info(method, BUILT_IN, method.__module__, f"{MODEL_VERSION}.{method.version}")
        for name, method in built_in_methods().items()
    }


def check_id(name: str, origin: str, registered: Registry) -> None:
    """Check the id of a method that is not built in.

    Parameters
    ----------
    name : str
        The id.
    origin : str
        File of the method, for the message.
    registered : mapping
        Known methods by id.

    Raises
    ------
    CoarticError
        The id

        - has other characters than letters, digits and ``._+/-``, or more than 80;
        - begins with ``dual-process/`` or ``optimum/``;
        - is, ignoring case, a known id, a condition of the learner or one of :data:`NAMES`.
    """
    if not METHOD_NAME.fullmatch(name):
        raise CoarticError(
            f"{origin}: method id {name!r} must begin with a letter or digit and have at most 80 "
            "characters, only letters, digits, '.', '_', '+', '/' and '-', such as 'my-search'"
        )
    problem = ""
    if name.startswith(_RESERVED):
        reserved = " or ".join(map(repr, _RESERVED))
        problem = f"is reserved: an id must not begin with {reserved}"
    elif name in registered:
        problem = f"exists already ({registered[name].origin}): choose another"
    elif name.casefold() in map(str.casefold, (*registered, *EVERY_CONDITION, *NAMES)):
        problem = "is the name of a built-in method: choose another"
    if problem:
        raise CoarticError(f"{origin}: method id {name!r} {problem}")


def methods_named(name: str, registered: Registry) -> list[str]:
    """Return the ids of the methods that a name stands for.

    Parameters
    ----------
    name : str
        An id, a condition of the learner such as ``EC1``, or a wildcard such as ``optimum/*``. Case
        matters.
    registered : mapping
        Known methods by id.

    Returns
    -------
    list of str
        Ids in the order of ``registered``.

    Raises
    ------
    CoarticError
        No id matches.
    """
    name = f"{METHOD_PREFIX}{name}" if name in EVERY_CONDITION else name
    named = [method for method in registered if fnmatchcase(method, name)]
    if not named:
        raise CoarticError(unknown("method", name, [*registered, *EVERY_CONDITION]))
    return named
