"""MethodInfo: the declaration of a method without its code, and where its code is."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import json
import re
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
from coartic.internal.validation import explain
from coartic.method import Method, Outline, outline_of
from coartic.tasks.task import Task

BUILT_IN = "built in"
"""Origin of this project's methods."""
ALWAYS_IN_IDS = frozenset(
    {
        *("base", "chains", "corrects", "counted", "credit", "direction", "discount", "drift"),
        *("epsilon", "exploration", "graphs", "hand_exploration", "hands", "horizon", "learned"),
        *("modify_chosen", "modify_other", "most_sequences", "nodes", "noise_sd", "noisy_starts"),
        *("other_arm", "period", "pull", "rounds", "sigma", "starts", "stop", "stored", "trials"),
    }
)
"""Names of parameters that count in the id of a run whatever their values. Add none: any other
parameter counts only if its value is not the default. So a new field of a method, or of an
exploration condition, changes no id of a run that does not use it."""
VERSION = re.compile(r"\d+\.\d+")
"""Code of a built-in method, versions of model and method, in place of a hash."""


@dataclass(frozen=True)
class MethodInfo:
    """The declaration of a method, its origin, and the place of its code."""

    name: str
    """Id of the method."""
    title: str
    citation: str
    information: tuple[str, ...]
    """Information that the method declares."""
    stochastic: bool
    """True if the seed matters; other methods are run once on a task."""
    defaults: dict[str, Any]
    """Default of each parameter, by name; None for a parameter without a default."""
    origin: str
    """``built in``, or the path of a method file, as a printable line."""
    code: str
    """Versions of model and method, such as ``1.2``; for a method file, the hash of what its
    results come from (:mod:`coartic.benchmarks.method_files`)."""
    packages: dict[str, str] = field(default_factory=dict, compare=False)
    """Versions of the installed packages that its method file imports, by name."""
    tuned_on: str = field(default="", compare=False)
    """Tasks on which its parameters were chosen; not stored."""
    where: str = field(default="", compare=False)
    """Module or method file that a worker imports; not stored."""

    @property
    def is_ours(self) -> bool:
        """True for a built-in method of coartic."""
        return self.origin == BUILT_IN

    @property
    def key(self) -> tuple[str, str, str]:
        """Module or method file, id and, for a method file, code, else an empty text: the arguments
        of :func:`load_method`."""
        return self.where, self.name, "" if self.is_ours else self.code

    def load(self) -> type[Method]:
        """Import the method and return its class (:func:`load_method`); a process imports it once
        for each ``code``, and notices no change of the file."""
        return load_method(*self.key)

    def configure(self, parameters: Mapping[str, Any]) -> Method:
        """Import the method and return an instance with these parameters, and defaults for all
        other parameters. Raises ValueError for wrong parameters."""
        method = self.load()
        return method(method.Parameters(**parameters))

    def complete(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return the parameters that identify a run, by name, as plain data: those of
        :data:`ALWAYS_IN_IDS`, and others that do not have their defaults. Raises CoarticError for a
        wrong parameter."""
        return dict(self._ask("complete", parameters))

    def why_not(self, task: Task, parameters: Mapping[str, Any] | None = None) -> str | None:
        """Return the reason why the method with parameters (None: defaults) does not apply to a
        task; None if it applies. Raises CoarticError as :func:`answer`."""
        reason = self._ask("why_not", parameters or {}, *outline_of(task))
        return None if reason is None else plain(str(reason))

    def rules(self) -> dict[str, Any]:
        """Return a dictionary: ``quick`` has :attr:`.Method.quick`, ``config`` two settings of
        Pydantic: ``extra`` is ``"forbid"`` if unknown parameters are refused, ``frozen`` is True if
        parameters cannot be set."""
        return dict(self._ask("rules"))

    def _ask(self, question: str, *arguments: Any) -> Any:
        """Return the answer of the method, or of the process that has imported its file, to a
        question of :func:`answer`. Raises CoarticError for wrong parameters or no answer."""
        if self.where in READERS:
            return READERS[self.where](self.name, question, *arguments)
        return answer(self.load(), question, *arguments)


READERS: dict[str, Callable[..., Any]] = {}
"""Functions that ask the process which has imported a method file, by the path of the file; this
process imports no method file."""


def answer(method: type[Method], question: str, *arguments: Any) -> Any:
    """Return the result of the function of :class:`MethodInfo` that ``question`` names:
    ``"complete"``, ``"why_not"`` or ``"rules"``.

    ``arguments`` are parameters (none for ``"rules"``), then for ``"why_not"`` the entries of an
    outline. Raises CoarticError for parameters that do not fit, and if the method cannot say
    whether it applies; other errors that a method's own check of parameters raises pass.
    """
    if question == "rules":
        config = method.Parameters.model_config
        wanted = {key: config.get(key) for key in ("extra", "frozen")}
        return {"quick": dict(method.quick), "config": wanted}
    parameters, *outline = arguments
    try:
        typed = method.Parameters.model_validate(parameters)
    except ValidationError as error:
        names = list(method.Parameters.model_fields)
        wrong, listed = explain(error, names), ", ".join(names) or "none"
        text = f"method {method.name!r}: {wrong} (its parameters: {listed})"
        raise CoarticError(text) from None
    if question == "complete":
        values = json.loads(json.dumps(typed.model_dump(mode="json")))
        return {
            name: value
            for name, value in values.items()
            if name in ALWAYS_IN_IDS or value != _defaults(method)[name]
        }
    task = Outline(*outline)._replace(hands=tuple(outline[3]))
    try:
        return method(typed).why_not(task)
    except Exception as error:
        raise CoarticError(
            f"method {method.name!r} cannot say whether it applies to task {task.name!r}: "
            f"{error_line(error)}"
        ) from None


def method_info(method: type[Method], origin: str, where: str, code: str) -> MethodInfo:
    """Return the info of a method from its class, its ``origin`` (``built in``, or the path of its
    file), ``where`` a worker imports it (module or file) and its ``code``."""
    return MethodInfo(
        name=method.name,
        title=method.title,
        citation=method.citation,
        information=tuple(sorted(item.value for item in method.information)),
        stochastic=method.stochastic,
        defaults=_defaults(method),
        origin=origin,
        code=code,
        tuned_on=method.tuned_on,
        where=where,
    )


def _defaults(method: type[Method]) -> dict[str, Any]:
    """Return the default of each parameter as plain data, by name; None for a parameter without a
    default."""
    defaults = {
        name: None if field.is_required() else field.get_default(call_default_factory=True)
        for name, field in method.Parameters.model_fields.items()
    }
    return dict(json.loads(json.dumps(defaults, default=str)))


def load_method(where: str, name: str, code: str = "") -> type[Method]:
    """Return the class of the method with id ``name`` from ``where``, a module or the path of a
    method file, which is imported once for each ``code``, a hash. Raises CoarticError if no method
    there has this id; an error of the import passes."""
    if where.endswith(".py"):
        methods = methods_in(load_file(Path(where), code)[0])
    else:
        methods = importlib.import_module(where).METHODS
    for method in methods:
        if method.name == name:
            return method
    raise CoarticError(f"{where} defines no method {name!r}")


def methods_in(module: ModuleType, *, abstract: bool = False) -> list[type[Method]]:
    """Return the classes of methods that a module itself defines: complete classes, or, with
    ``abstract``, classes that lack a function, such as ``solve``."""
    return [
        value
        for value in vars(module).values()
        if inspect.isclass(value)
        and issubclass(value, Method)
        and inspect.isabstract(value) == abstract
        and value.__module__ == module.__name__
    ]


@cache
def load_file(path: Path, code: str = "") -> tuple[ModuleType, frozenset[str]]:
    """Import a method file, once for each ``code``, a hash, and return the module, and the names of
    the modules that the import has loaded; an error of the file passes. The folder of the file is
    added to ``sys.path``, for modules from there."""
    name = f"coartic_method_{path.stem}"
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    before = {*sys.modules}
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module, frozenset({*sys.modules} - before - {name})
