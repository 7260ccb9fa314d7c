"""What a method declares of itself, as plain data, and the questions that it answers.

A method of this project is asked where it is. Any other one runs code that nobody here has
read, from its import on, so it is asked in a process of its own
(:mod:`coartic.benchmarks.registry`),
and what comes back is checked here: :class:`Declaration` is the border.
"""

from __future__ import annotations

import importlib
import inspect
import json
import sys
from collections.abc import Mapping
from importlib import metadata
from types import ModuleType
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from coartic import CoarticError, Task
from coartic.inputs import problems_inline
from coartic.method import Information, Method
from coartic.runs.stored import Plain, Values
from coartic.text import Line, plain


class MethodFileError(CoarticError):
    """A method file or plug-in that cannot be used."""


class Foreign(Plain):
    """Where a method that is not built in comes from."""

    kind: Literal["file", "installed"]
    where: str
    """Name of the method file, or the value of an entry point, such as ``package:Class``."""
    source: str = ""
    """Text of the method file, so that any worker on any machine can run it."""


class Declaration(Plain):
    """What a method declares, apart from its code."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._+/-]*$", max_length=80)]
    title: Line
    citation: Line
    told: Annotated[tuple[Information, ...], Field(max_length=len(Information))]
    secondary: Annotated[tuple[Line, ...], Field(max_length=20)]
    stochastic: bool
    frozen: bool
    """Whether its parameters cannot be changed once they are validated."""
    defaults: Values
    """Its parameters; None for one that has no default."""
    quick: Values
    """Parameters for a check in seconds."""


def declared(method: type[Method]) -> Declaration:
    """The declaration of a method's class. Raises MethodFileError where it is none."""
    for attribute in ("name", "title", "citation", "told"):
        if not hasattr(method, attribute):
            raise MethodFileError(f"{method.__name__} does not declare {attribute!r}")
    try:
        content = {
            "name": method.name,
            "title": method.title,
            "citation": method.citation,
            "told": sorted(str(item) for item in method.told),
            "secondary": list(method.secondary),
            "stochastic": method.stochastic,
            "frozen": method.Parameters.model_config.get("frozen") is True,
            "defaults": {
                name: None
                if field.is_required()
                else _json(field.get_default(call_default_factory=True))
                for name, field in method.Parameters.model_fields.items()
            },
            "quick": dict(method.quick),
        }
        return Declaration.model_validate_json(json.dumps(content, allow_nan=False))
    except ValidationError as error:
        raise MethodFileError(f"{method.__name__}: {problems_inline(error)}") from None
    except (TypeError, ValueError, AttributeError) as error:
        raise MethodFileError(f"{method.__name__}: {brief(error)}") from None


def completed(method: type[Method], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """All parameters of a method, defaults included, as plain data.

    Raises CoarticError that names the ones that are wrong.
    """
    try:
        built = method(method.Parameters(**parameters)).parameters
        complete: dict[str, Any] = json.loads(
            json.dumps(built.model_dump(mode="json"), allow_nan=False)
        )
    except ValidationError as error:
        known = ", ".join(method.Parameters.model_fields) or "none"
        found = problems_inline(error, method.Parameters.model_fields)
        raise CoarticError(f"method {method.name!r}: {found}. Its parameters: {known}.") from None
    return complete


def reason_against(method: type[Method], task: Task, parameters: Mapping[str, Any]) -> str | None:
    """Why a method with parameters does not apply to a task; None where it does."""
    completed(method, parameters)
    reason = method(method.Parameters(**parameters)).why_not(task)
    return None if reason is None else str(reason)


def built_in_methods(module: str) -> tuple[type[Method], ...]:
    """The methods of a module of this project. Raises MethodFileError where it is not there."""
    try:
        found = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module}.".startswith(f"{error.name}."):
            raise  # what it imports
        raise MethodFileError("it is not installed on this worker") from None
    methods: tuple[type[Method], ...] = found.METHODS
    return methods


def methods_of(foreign: Foreign) -> list[type[Method]]:
    """The methods of a file or an entry point; runs their code.

    Raises MethodFileError where it fails or defines none.
    """
    try:
        target = _loaded(foreign)
    except (Exception, SystemExit, KeyboardInterrupt) as error:
        raise MethodFileError(f"cannot be run: {brief(error)}") from None
    if inspect.isclass(target) and issubclass(target, Method):
        return [target]
    found = [
        value
        for value in vars(target).values()
        if inspect.isclass(value)
        and issubclass(value, Method)
        and not inspect.isabstract(value)
        and value.__module__ == getattr(target, "__name__", None)
    ]
    if not found:
        unfinished = [
            f"{value.__name__} has no {', '.join(sorted(vars(value)['__abstractmethods__']))}"
            for value in vars(target).values()
            if inspect.isclass(value) and value is not Method and inspect.isabstract(value)
        ]
        why = f" that is complete: {', '.join(unfinished)}" if unfinished else ""
        raise MethodFileError(f"defines no subclass of coartic.method.Method{why}")
    return found


def _loaded(foreign: Foreign) -> Any:
    if foreign.kind == "installed":
        return metadata.EntryPoint("method", foreign.where, "coartic.methods").load()
    module = ModuleType("coartic_method_file")
    module.__file__ = foreign.where
    sys.modules[module.__name__] = module  # typing looks annotations up there
    exec(compile(foreign.source, foreign.where, "exec"), module.__dict__)
    return module


def _json(value: Any) -> Any:
    """A default as JSON has it; as text where JSON has no word for it."""
    try:
        return json.loads(json.dumps(value, allow_nan=False))
    except (TypeError, ValueError):
        return plain(str(value))


def brief(error: BaseException) -> str:
    """An exception in one line."""
    try:
        text = str(error)
    except Exception:
        text = "(its message cannot be shown)"
    return plain(f"{type(error).__name__}: {text}")
