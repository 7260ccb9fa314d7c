"""Methods by id: the built-in methods, and the methods of the user's files.

Processes of their own import method files (:mod:`coartic.benchmarks.reader`).
"""

from __future__ import annotations

import importlib
import inspect
import threading
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

from pydantic import TypeAdapter

from coartic.benchmarks.code_identity import code_of
from coartic.benchmarks.reader import begin_reader
from coartic.errors import CoarticError
from coartic.internal.text import LONGEST_LINE, plain, unknown
from coartic.internal.toml_files import check_file
from coartic.learner.conditions import ABLATIONS, CONDITIONS, METHOD_PREFIX
from coartic.runs.method_info import BUILT_IN, READERS, MethodInfo, method_info
from coartic.runs.plan import SEARCH

RESERVED = (METHOD_PREFIX, SEARCH)
"""Ids that begin so have a meaning in every table: methods of this project alone have them."""
NAMES = ("CMA-ES", "learner", "optimum")
"""Names of this project's methods that could be ids of others."""
MODULES = (
    "coartic.learner.method",
    "coartic.baselines.corrective_alone",
    "coartic.baselines.random_search",
    "coartic.baselines.hill_climbing",
    "coartic.baselines.cma_es",
    "coartic.baselines.nullspace_qp",
    "coartic.baselines.posture_qp",
    "coartic.baselines.posture_based",
    "coartic.baselines.trajectory_optimisation",
    "coartic.baselines.receding_horizon",
    "coartic.baselines.optimum",
)
"""Where this project's methods are, each in its module's ``METHODS``."""


Registry = Mapping[str, MethodInfo]
_INFOS = TypeAdapter(list[MethodInfo])


def registry(method_files: Iterable[Path] = ()) -> dict[str, MethodInfo]:
    """Return every known method by id.

    Raises CoarticError for a file that cannot be loaded, holds no method, or takes an id that is
    reserved or already there.
    """
    infos = dict(built_in())
    for path in dict.fromkeys(Path(path).resolve() for path in method_files):
        add_methods(infos, methods_of_file(path))
    return infos


@cache
def built_in() -> Mapping[str, MethodInfo]:
    """This project's methods by id."""
    infos: dict[str, MethodInfo] = {}
    for name in MODULES:
        module = importlib.import_module(name)
        code = code_of(Path(inspect.getfile(module)))
        infos |= {
            method.name: method_info(method, BUILT_IN, name, code) for method in module.METHODS
        }
    return infos


_parsing = threading.Lock()  # Python 3.11 cannot parse in two threads at once


def current_code(where: str, name: str) -> str:
    """Hash of the code of a method that is imported from ``where``; ``none`` where it has none."""
    with _parsing:
        if where.endswith(".py"):
            if where not in READERS:  # which reads the file anew whenever it is asked
                list(methods_of_file(Path(where)))
            infos = READERS[where]("", "methods")
            return next((info["code"] for info in infos if info["name"] == name), "none")
        return code_of(Path(inspect.getfile(importlib.import_module(where))))


def add_methods(registered: dict[str, MethodInfo], infos: Iterable[MethodInfo]) -> None:
    """Add methods by id. Raises CoarticError for an id that is reserved or taken, and for
    one that differs from a name here in large and small letters alone."""
    for info in infos:
        names = (*registered, *CONDITIONS, *ABLATIONS, *NAMES)
        why = ""
        if info.name.startswith(RESERVED):
            ours = " or ".join(map(repr, RESERVED))
            why = f"is reserved: ids that begin with {ours} are this project's"
        elif info.name in registered:
            why = f"is already taken ({registered[info.name].origin})"
        elif info.name.casefold() in map(str.casefold, names):
            why = "is a name of a method here: choose another"
        if why:
            raise CoarticError(f"{info.origin}: method id {info.name!r} {why}")
        registered[info.name] = info


def methods_named(name: str, registered: Registry) -> list[str]:
    """Return the ids of the methods that a name stands for.

    A condition of the learner goes by its own name as well; ``optimum/*`` names all that begin
    so. Raises CoarticError if there is none.
    """
    name = f"{METHOD_PREFIX}{name}" if name in CONDITIONS | ABLATIONS else name
    named = [method for method in registered if fnmatchcase(method, name)]
    if not named:
        raise CoarticError(unknown("method", name, [*registered, *CONDITIONS, *ABLATIONS]))
    return named


def methods_of_file(path: Path) -> Iterator[MethodInfo]:
    """The methods of a file, which a process of its own imports: what it does there changes
    nothing here. Raises CoarticError where there is none that can be used."""
    shown = plain(str(path), LONGEST_LINE)
    check_file(path)
    if path.suffix != ".py":
        raise CoarticError(f"{shown}: the name of a method file ends in .py")
    ask = begin_reader(path, shown)
    for info in _INFOS.validate_python(ask("", "methods")):
        READERS[str(path)] = ask
        yield replace(info, origin=shown, where=str(path))
