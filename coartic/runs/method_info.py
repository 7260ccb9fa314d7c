"""MethodInfo: the declaration of a method without its code, and where its code is."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import ValidationError

from coartic.errors import CoarticError
from coartic.internal.text import error_line, plain
from coartic.internal.validation import explain_inline
from coartic.method import Method, Outline, outline_of
from coartic.tasks.task import Task

BUILT_IN = "built in"
"""Origin of this project's methods."""


@dataclass(frozen=True)
class MethodInfo:
    """The declaration of a method, its origin, and where its code is."""

    name: str
    title: str
    citation: str
    information: tuple[str, ...]
    stochastic: bool
    """Whether the seed matters; the others are run once."""
    defaults: dict[str, Any]
    """Its parameters; None for one that has no default."""
    origin: str
    """``built in``, or the path of a method file."""
    code: str
    """Hash of the code that its results come from."""
    where: str = field(default="", compare=False)
    """Module or method file that a worker imports. Not stored."""

    @property
    def is_ours(self) -> bool:
        """Whether it is one of this project's methods."""
        return self.origin == BUILT_IN

    @property
    def key(self) -> tuple[str, str, str]:
        """Where it is imported from, its name and, as a file may change, its code."""
        return self.where, self.name, "" if self.is_ours else self.code

    def load(self) -> type[Method]:
        """The method itself, imported once a process, unless its code has changed since."""
        return load_method(*self.key)

    def configure(self, parameters: Mapping[str, Any]) -> Method:
        """The method with these parameters."""
        method = self.load()
        return method(method.Parameters(**parameters))

    def complete(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """All parameters, defaults included, as plain data; CoarticError names those that are
        wrong."""
        return dict(self._ask("complete", parameters))

    def why_not(self, task: Task, parameters: Mapping[str, Any] | None = None) -> str | None:
        """Why the method with parameters does not apply to a task; None where it does.

        Raises CoarticError for wrong parameters.
        """
        reason = self._ask("why_not", parameters or {}, *outline_of(task))
        return None if reason is None else plain(str(reason))

    def rules(self) -> dict[str, Any]:
        """``quick`` parameters for a check, and the ``config`` of all its parameters: what is done
        with unknown ones, and whether they can be changed."""
        return dict(self._ask("rules"))

    def _ask(self, question: str, *arguments: Any) -> Any:
        """The answer of the method, or of the process that has read its file."""
        if self.where in READERS:
            return READERS[self.where](self.name, question, *arguments)
        return answer(self.load(), question, *arguments)


READERS: dict[str, Callable[..., Any]] = {}
"""Readers of method files, which this process does not import, by :attr:`MethodInfo.where`."""


def answer(method: type[Method], question: str, *arguments: Any) -> Any:
    """The answer of a method to :class:`MethodInfo`, as plain data. Raises CoarticError."""
    if question == "rules":
        config = method.Parameters.model_config
        wanted = {key: config.get(key) for key in ("extra", "frozen")}
        return {"quick": dict(method.quick), "config": wanted}
    parameters, *outline = arguments
    try:
        typed = method.Parameters.model_validate(parameters)
    except ValidationError as error:
        names = list(method.Parameters.model_fields)
        wrong, listed = explain_inline(error, names), ", ".join(names) or "none"
        text = f"method {method.name!r}: {wrong} (its parameters: {listed})"
        raise CoarticError(text) from None
    if question == "complete":
        return json.loads(json.dumps(typed.model_dump(mode="json")))
    task = Outline(*outline)._replace(hands=tuple(outline[3]))
    try:
        return method(typed).why_not(task)
    except Exception as error:
        raise CoarticError(
            f"method {method.name!r} cannot say whether it applies to task {task.name!r}: "
            f"{error_line(error)}"
        ) from None


def method_info(method: type[Method], origin: str, where: str, code: str) -> MethodInfo:
    """The info of a method that is imported from ``where``."""
    fields = method.Parameters.model_fields.items()
    defaults = {
        name: None if field.is_required() else field.get_default(call_default_factory=True)
        for name, field in fields
    }
    return MethodInfo(
        name=method.name,
        title=method.title,
        citation=method.citation,
        information=tuple(sorted(item.value for item in method.information)),
        stochastic=method.stochastic,
        defaults=json.loads(json.dumps(defaults, default=str)),
        origin=origin,
        code=code,
        where=where,
    )


@cache
def load_method(where: str, name: str, code: str = "") -> type[Method]:
    """A method from its module or file, whose ``code`` may change. Raises CoarticError where it is
    not there."""
    module = load_file(Path(where)) if where.endswith(".py") else importlib.import_module(where)
    for method in [*getattr(module, "METHODS", ()), *methods_in(module)]:
        if method.name == name:
            return method  # type: ignore[no-any-return]
    raise CoarticError(f"{where} defines no method {name!r}")


def methods_in(module: ModuleType) -> list[type[Method]]:
    """The methods that a module itself defines, complete ones."""
    return [
        value
        for value in vars(module).values()
        if inspect.isclass(value)
        and issubclass(value, Method)
        and not inspect.isabstract(value)
        and value.__module__ == module.__name__
    ]


def load_file(path: Path) -> ModuleType:
    """Import a method file, which can import modules beside it."""
    name = f"coartic_method_{path.stem}"
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
