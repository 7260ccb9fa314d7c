"""Methods by id: those of this project, of installed plug-ins, and of the user's files.

Methods of this project are classes here. The others are known by what they declare: their
code is run in sandboxes alone, to describe them and to perform their runs.
"""

from __future__ import annotations

import json
import threading
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from coartic import CoarticError, Task
from coartic.benchmarks.code_identity import built_in_code, foreign_code
from coartic.benchmarks.declaration import (
    Declaration,
    Foreign,
    MethodFileError,
    built_in_methods,
    completed,
    declared,
    reason_against,
)
from coartic.benchmarks.sandbox import Failure, Sandbox
from coartic.inputs import problems_inline, read_text
from coartic.learner.learning import METHOD_PREFIX
from coartic.method import Method
from coartic.runs import record
from coartic.runs.record import SEARCH
from coartic.runs.stored import Values
from coartic.text import LONGEST_LINE, did_you_mean, plain

ENTRY_POINTS = "coartic.methods"
RESERVED = (METHOD_PREFIX, SEARCH)
"""Ids that begin so have a meaning in every table: methods of this project alone have them."""
QUESTION_LIMIT_S = 60.0
"""Seconds that a method which is not built in has to say what it is."""
MODULES = (
    "coartic.learner.method",
    "coartic.baselines.corrective_alone",
    "coartic.baselines.random_search",
    "coartic.baselines.cma_es",
    "coartic.baselines.nullspace_qp",
    "coartic.baselines.posture_based",
    "coartic.baselines.trajectory_optimisation",
    "coartic.baselines.optimum",
)
"""Where this project's methods are, each in its module's ``METHODS``."""
MODULE_OF = {method.name: module for module in MODULES for method in built_in_methods(module)}
"""Where each built-in method is, by id."""
BUILT_IN: tuple[type[Method], ...] = tuple(
    method for module in MODULES for method in built_in_methods(module)
)
CLASSES: Mapping[str, type[Method]] = {method.name: method for method in BUILT_IN}
"""The built-in methods by id."""


@dataclass(frozen=True)
class Entry:
    """One method as the harness knows it."""

    declared: Declaration
    origin: str
    """``built in``, the distribution of a plug-in, or the path of a method file."""
    code: str
    """Hash of the code that produces its results."""
    foreign: Foreign | None = None
    """Where it comes from; None for a method of this project."""

    @property
    def name(self) -> str:
        """Id of the method."""
        return self.declared.name

    def complete(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """All parameters, defaults included; CoarticError names the ones that are wrong."""
        return _complete(self.foreign, self.name, json.dumps(parameters, sort_keys=True))

    def most_together(self, parameters: Mapping[str, Any]) -> int:
        """Runs with parameters, at most, that one process performs side by side."""
        if self.foreign is not None:
            return 1
        method = CLASSES[self.name]
        return method(method.Parameters(**parameters)).most_together()

    def why_not(self, task: Task, parameters: Mapping[str, Any] | None = None) -> str | None:
        """Why the method with parameters does not apply to a task; None where it does.

        Raises CoarticError for wrong parameters and for a method that fails to say.
        """
        if self.foreign is None:
            return reason_against(CLASSES[self.name], task, parameters or {})
        try:
            reason = _ask(
                self.foreign,
                question="applies",
                method=self.name,
                task=task.model_dump(mode="json"),
                parameters=dict(parameters or {}),
            )
        except MethodFileError as error:
            raise MethodFileError(
                f"method {self.name!r} cannot say whether it applies to task {task.name!r}: {error}"
            ) from None
        return None if reason is None else plain(str(reason))


Registry = Mapping[str, Entry]


def registry(method_files: Iterable[Path] = ()) -> dict[str, Entry]:
    """Every known method by id.

    A plug-in that cannot be loaded is a warning. Raises MethodFileError for a file that
    cannot be loaded, holds no method, or takes an id that is reserved or already there.
    """
    found = dict(_built_in())

    def add(foreign: Foreign, origin: str) -> None:
        origin = plain(origin, LONGEST_LINE)
        described, code = _described(foreign, origin), foreign_code(foreign)
        for declaration in described:
            name = declaration.name
            if name.startswith(RESERVED):
                raise MethodFileError(
                    f"{origin}: method id {name!r} is reserved: ids that begin with "
                    f"{' or '.join(map(repr, RESERVED))} are this project's"
                )
            if name in found:
                raise MethodFileError(
                    f"{origin}: method id {name!r} is already taken ({found[name].origin})"
                )
            found[name] = Entry(declaration, origin, code, foreign)

    for point in metadata.entry_points(group=ENTRY_POINTS):
        origin = f"plug-in {point.dist.name if point.dist else point.value}"
        try:  # a broken plug-in must not take the others with it
            add(Foreign(kind="installed", where=point.value), origin)
        except CoarticError as error:
            warnings.warn(
                f"{origin}: entry point {point.name!r} cannot be used: {error}", stacklevel=2
            )
    for path in method_files:
        add(read_method_file(path), str(path))
    return found


@cache
def _built_in() -> dict[str, Entry]:
    return {
        name: Entry(declared(method), record.BUILT_IN, built_in_code(method.__module__))
        for name, method in CLASSES.items()
    }


def read_method_file(path: Path) -> Foreign:
    """The text of a method file. Raises MethodFileError where there is none."""
    return Foreign(kind="file", where=path.name, source=read_text(path, error=MethodFileError))


def unknown(kind: str, name: str, known: Iterable[str]) -> CoarticError:
    """An error for a name that is not among the known ones, with the nearest of them."""
    names = list(known)
    hint = did_you_mean(name, names) or "."
    more = f" and {len(names) - _MOST_NAMED} others" if len(names) > _MOST_NAMED else ""
    return CoarticError(
        f"unknown {kind} {name!r}{hint} Known: {', '.join(names[:_MOST_NAMED])}{more}."
    )


@cache
def _complete(foreign: Foreign | None, name: str, parameters: str) -> dict[str, Any]:
    given: dict[str, Any] = json.loads(parameters)
    if foreign is None:
        return completed(CLASSES[name], given)
    found = _ask(foreign, question="complete", method=name, parameters=given)
    try:
        return _VALUES.validate_python(found)
    except ValidationError as error:
        raise MethodFileError(
            f"method {name!r}: its parameters: {problems_inline(error)}"
        ) from None


@cache
def _described(foreign: Foreign, origin: str) -> tuple[Declaration, ...]:
    foreign_code(foreign)  # what is no Python is said without running it
    try:
        found = _ask(foreign, question="describe")
        return tuple(Declaration.model_validate_json(json.dumps(item)) for item in found)
    except MethodFileError as error:
        raise MethodFileError(f"{origin}: {error}") from None
    except (ValidationError, TypeError) as error:
        raise MethodFileError(f"{origin}: declares no method: {plain(str(error))}") from None


_asked: dict[Foreign, Sandbox] = {}
_MOST_NAMED = 40  # in an error
_VALUES: TypeAdapter[dict[str, Any]] = TypeAdapter(Values)
_lock = threading.Lock()


def _ask(foreign: Foreign, **question: Any) -> Any:
    """What a method that is not built in answers, in a process of its own."""
    with _lock:
        sandbox = _asked.get(foreign)
        if sandbox is None or not sandbox.alive:
            sandbox = _asked[foreign] = Sandbox()
        answer = sandbox.ask(
            {**question, "foreign": foreign.model_dump(mode="json")}, QUESTION_LIMIT_S
        )
    if isinstance(answer, Failure):
        raise MethodFileError(f"it gave no answer: {answer.reason}")
    try:
        said = json.loads(answer)
        error, result = said["error"], said["answer"]
    except (ValueError, RecursionError, TypeError, KeyError):
        raise MethodFileError("what it answered cannot be read") from None
    if error is not None:
        raise MethodFileError(plain(str(error)))
    return result
