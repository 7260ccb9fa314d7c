"""Look up built-in methods, and methods of the user's files, by their ids.

Method files are imported in separate processes (:mod:`coartic.benchmarks.method_files`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

from coartic.errors import CoarticError
from coartic.internal.text import unknown
from coartic.learner.conditions import EVERY_CONDITION, METHOD_PREFIX
from coartic.method import built_in_methods
from coartic.runs.method_info import BUILT_IN, MethodInfo, code_of, method_info

_RESERVED = (METHOD_PREFIX, "optimum/")
"""Prefixes that only ids of built-in methods may have, because tables interpret these prefixes."""
METHOD_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+/-]{0,79}")
NAMES = ("CMA-ES", "learner", "optimum")
"""Names of built-in methods in figures and tables, which no method of the user may have as its
id."""


Registry = Mapping[str, MethodInfo]


def registry(
    method_files: Iterable[Path] = (), ends: ExitStack | None = None
) -> dict[str, MethodInfo]:
    """Return a dict that maps ids to the declarations of all known methods.

    Parameters
    ----------
    method_files : iterable of Path
        Python files that define methods of the user.
    ends : contextlib.ExitStack, optional
        Stack with which the processes end that read the files (:func:`.read_file`).

    Returns
    -------
    dict of str to MethodInfo
        The built-in methods, then the methods of ``method_files`` in the order of the files.

    Raises
    ------
    CoarticError
        A file cannot be loaded or defines no method (:func:`.read_file`), or the id of a method is
        not allowed (:func:`check_id`).
    """
    infos = dict(built_in())
    for path in dict.fromkeys(Path(path).resolve() for path in method_files):
        from coartic.benchmarks.method_files import read_file  # most commands do not need it

        for info in read_file(path, ends):
            check_id(info.name, info.origin, infos)
            infos[info.name] = info
    return infos


@cache
def built_in() -> Mapping[str, MethodInfo]:
    """Return a dict that maps ids to the declarations of the built-in methods.

    Each call returns the same dict: do not change it.
    """
    return {
        name: method_info(method, BUILT_IN, method.__module__, code_of(method))
        for name, method in built_in_methods().items()
    }


def check_id(name: str, origin: str, registered: Registry) -> None:
    """Check that a method of the user may have a given id.

    Parameters
    ----------
    name : str
        The id.
    origin : str
        File of the method, with which the error message begins.
    registered : mapping of str to MethodInfo
        Dict that maps ids to all methods that are known already.

    Raises
    ------
    CoarticError
        One of these is the case:

        - the id does not begin with an ASCII letter or digit, has a character other than an ASCII
          letter, a digit or one of ``._+/-``, or has more than 80 characters;
        - the id begins with ``dual-process/`` or ``optimum/``;
        - the id is a known id, the id of an exploration condition or one of :data:`NAMES`, where
          upper and lower case are treated as equal.
    """
    if not METHOD_NAME.fullmatch(name):
        raise CoarticError(
            f"{origin}: method id {name!r} must begin with a letter or digit and have at most 80 "
            "characters: letters from a to z, digits, '.', '_', '+', '/' and '-', such as "
            "'my-search'"
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
    """Return the ids of the methods that a name or wildcard stands for.

    Parameters
    ----------
    name : str
        An id, an exploration condition of the learner such as ``EC1``, or a wildcard such as
        ``optimum/*``. Upper and lower case differ.
    registered : mapping of str to MethodInfo
        Dict that maps ids to all known methods.

    Returns
    -------
    list of str
        Ids in the order of ``registered``.

    Raises
    ------
    CoarticError
        No known method has this id, or matches the wildcard.

    Examples
    --------
    >>> methods_named("EC1", built_in())
    ['dual-process/EC1']
    >>> methods_named("posture-qp/*", built_in())
    ['posture-qp/current-goal', 'posture-qp/goals-ahead']
    """
    name = f"{METHOD_PREFIX}{name}" if name in EVERY_CONDITION else name
    named = [method for method in registered if fnmatchcase(method, name)]
    if not named:
        raise CoarticError(unknown("method", name, [*registered, *EVERY_CONDITION]))
    return named
