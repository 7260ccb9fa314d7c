"""Declarations of methods, with the location of their code (:class:`MethodInfo`)."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import json
import re
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import ValidationError
from pydantic_core import PydanticSerializationError

from coartic.errors import CoarticError
from coartic.internal.limits import brief_value
from coartic.internal.text import error_line, plain
from coartic.internal.user_files import import_from
from coartic.internal.validation import explain
from coartic.method import (
    Facts,
    Method,
    Outline,
    built_in_methods,
    outline_of,
    reason_against,
)
from coartic.method.as_method import methods_named_in
from coartic.model import MODEL_VERSION, MotionModel, differences
from coartic.tasks.task import Task

BUILT_IN = "built in"
"""Value of :attr:`MethodInfo.origin` for the built-in methods."""
ALWAYS_IN_IDS = frozenset(
    {
        *("base", "chains", "corrects", "counted", "credit", "direction", "discount", "drift"),
        *("epsilon", "exploration", "graphs", "hand_exploration", "hands", "horizon", "learned"),
        *("modify_chosen", "modify_other", "most_sequences", "nodes", "noise_sd", "noisy_starts"),
        *("other_arm", "period", "pull", "rounds", "sigma", "starts", "stop", "stored", "trials"),
    }
)
"""Names of parameters of built-in methods that are always hashed for the id of a run. Do not add
names. Any other parameter of a built-in method is hashed only if its value is not the default.
Therefore a new parameter of a method, or a new field of an exploration condition, does not change
the ids of existing runs. All parameters of a method from a file are hashed, because its defaults
may come from the environment or from another file."""
_INFORMED = {"pull": 0.0, "direction": "next-goal"}
_SUBTASK = {"discount": 0.0, "counted": "later"}
WITHDRAWN: dict[str, dict[str, Any]] = {
    **dict.fromkeys(("dual-process/EC1-informed", "dual-process/EC4-informed"), _INFORMED),
    **dict.fromkeys(("dual-process/EC1-subtask", "dual-process/EC4-subtask"), _SUBTASK),
    "dual-process/custom": dict.fromkeys([*_INFORMED, *_SUBTASK]),
}
"""Dict that maps ids of methods to parameters that they had until version 7.0.0, with the values
that runs of today's methods have. They stay in ids and stored parameters of runs."""
VERSION = re.compile(r"\d+\.\d+")
"""Pattern of the field ``code`` of a built-in method: versions of model and method."""


@dataclass(frozen=True)
class MethodInfo:
    """Declaration of a method, with the location of its code."""

    name: str
    """Id of the method."""
    title: str
    citation: str
    information: tuple[str, ...]
    """Information that the method declares."""
    stochastic: bool
    """True if the results depend on the seed. A method that is not stochastic is run once on each
    task."""
    defaults: dict[str, Any]
    """Dict that maps each parameter to its default; None for a parameter without a default. The
    dict includes parameters that were withdrawn (:data:`WITHDRAWN`)."""
    origin: str
    """``built in``, or the path of a method file, as a printable line."""
    code: str
    """Versions of model and method, such as ``1.2``. For a method file it is a hash of the code
    (:mod:`coartic.benchmarks.method_files`)."""
    packages: dict[str, str] = field(default_factory=dict, compare=False)
    """Dict that maps installed packages to their versions: those that the method file, or another
    file of the user that it loads, imports. Empty for a built-in method."""
    facts: Facts = field(default_factory=Facts, compare=False)
    """Citations and names of the method. Results folders store them only for methods from files.
    Results folders of version 6.0.0 do not store them at all."""
    tuned_on: str = field(default="", compare=False)
    """Tasks on which the method's parameters were chosen; not stored."""
    where: str = field(default="", compare=False)
    """Module or method file that a worker imports; not stored."""

    @property
    def is_ours(self) -> bool:
        """True for a built-in method of coartic."""
        return self.origin == BUILT_IN

    @cached_property
    def content(self) -> dict[str, Any]:
        """The declaration as plain data, as it is stored. Do not change the dict."""
        content = asdict(replace(self, tuned_on="", where=""))
        if self.is_ours:
            del content["facts"]  # they are in its class
        return content

    @property
    def key(self) -> tuple[str, str, str]:
        """Arguments of :func:`load_method`; the code is empty for a built-in method."""
        return self.where, self.name, "" if self.is_ours else self.code

    def load(self) -> type[Method]:
        """Import the method and return its class.

        A process imports a method file once for each ``code``; it does not import the file again
        when the file changes. Raises the errors of :func:`load_method`.
        """
        return load_method(*self.key)

    def configure(self, parameters: Mapping[str, Any]) -> Method:
        """Import the method, and return an instance of its class with given parameters.

        For a parameter that is not passed, the default is used. Raises CoarticError for a wrong
        parameter.
        """
        method = self.load()
        return method(_validated(method, parameters))

    def complete(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return a dict of the parameters that identify a run, as plain data.

        The values are those of :func:`canonical_parameters`, so that ``complete`` of the result is
        the result. Raises CoarticError for a wrong parameter.
        """
        return self.identifying(self._ask("complete", parameters))

    def identifying(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """Return those of all parameters of the method that are hashed for the id of a run.

        These are all parameters of a method from a file. Of a built-in method they are those in
        :data:`ALWAYS_IN_IDS`, all parameters that differ from their defaults, and those of
        :data:`WITHDRAWN`.
        """
        return {
            name: value
            for name, value in {**parameters, **WITHDRAWN.get(self.name, {})}.items()
            if not self.is_ours
            or name in ALWAYS_IN_IDS
            or not same_value(value, self.defaults[name])
        }

    def codes_named_in(self, parameters: Mapping[str, Any]) -> dict[str, str]:
        """Return a dict that maps the ids of built-in methods that parameters name to their codes.

        The parameters of a method from a file name no methods.
        """
        named = methods_named_in(parameters) if self.is_ours else {}
        return {name: code_of(built_in_methods()[name]) for name in named.values()}

    def inapplicable_reason(
        self, task: Task, parameters: Mapping[str, Any] | None = None
    ) -> str | None:
        """Return why the method, with given parameters, does not apply to a task; else None.

        For a parameter that is not passed, the default is used. Raises CoarticError for a wrong
        parameter, or if the method cannot say whether it applies.
        """
        reason: str | None = self._ask("inapplicable_reason", parameters or {}, *outline_of(task))
        return reason and plain(reason)

    def refuses(self, model: MotionModel) -> str | None:
        """Return why the method cannot run under a motion model; None if it can."""
        reason = self._ask("refuses", *model) if differences(model) else None
        return None if reason is None else plain(str(reason))

    def rules(self) -> dict[str, Any]:
        """Return the settings of the method that ``coartic check`` needs.

        Returns
        -------
        dict
            - ``quick``: :attr:`.Method.quick`;
            - ``config``: dict with two settings of pydantic for the class of the parameters:
              ``extra`` is ``"forbid"`` if unknown parameters are refused, and ``frozen`` is True if
              parameters cannot be changed. A setting that the class does not make is None.
        """
        return dict(self._ask("rules"))

    def _ask(self, question: str, *arguments: Any) -> Any:
        """Ask the method a question (:func:`answer`), and return the answer.

        If another process has read the method's file (:data:`READERS`), that process answers.
        Otherwise this process imports the method.
        """
        if self.where in READERS:
            return READERS[self.where](self.name, question, *arguments)
        return answer(self.load(), question, *arguments)


READERS: dict[str, Callable[..., Any]] = {}
"""Dict that maps the path of each method file to a function. The function passes the id of a
method, a question and its arguments to the process that has imported the file, and returns the
answer. (The process that runs suites does not import method files.)"""


def answer(method: type[Method], question: str, *arguments: Any) -> Any:
    """Answer a question about a method.

    Parameters
    ----------
    method : type
        Class of the method.
    question : {"complete", "inapplicable_reason", "refuses", "rules"}
        Name of the function of :class:`MethodInfo` that needs the answer.
    *arguments
        Arguments of the question:

        - ``"rules"``: none;
        - ``"refuses"``: the constants of a motion model;
        - ``"complete"``: the parameters of the method;
        - ``"inapplicable_reason"``: the parameters of the method, then the entries of an
          :class:`.Outline`.

    Raises
    ------
    CoarticError
        A parameter is wrong, or the method cannot say whether it applies. Other errors of the
        method's own check of parameters, and errors of its function ``refuses``, are raised as they
        are.
    """
    if question == "refuses":
        return method.refuses(MotionModel(*arguments))
    if question == "rules":
        config = method.Parameters.model_config
        wanted = {key: config.get(key) for key in ("extra", "frozen")}
        return {"quick": dict(method.quick), "config": wanted}
    parameters, *outline = arguments
    if question == "complete":
        return canonical_parameters(method, parameters)
    typed = _validated(method, parameters)
    task = Outline(*outline)._replace(hands=tuple(outline[3]))
    try:
        return reason_against(method(typed), task)
    except Exception as error:
        raise CoarticError(
            f"method {method.name!r} cannot say whether it applies to task {task.name!r}: "
            f"{error_line(error)}"
        ) from None


def canonical_parameters(method: type[Method], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return all parameters of a method in the form in which they are hashed, stored and run.

    The values are validated by ``method.Parameters`` and written as JSON. A worker, and whoever
    performs a stored run again, validates these values once more, with those that were defaults.
    Therefore a second validation must not change them. Raises CoarticError if it does, or if a
    parameter is wrong.
    """
    typed = _validated(method, parameters)
    again = _validated(method, _dumped(method, typed))  # 1 of a float's default is 1.0 now
    for name in method.Parameters.model_fields:
        value, new = getattr(typed, name), getattr(again, name)
        if value != new:
            raise CoarticError(
                f"method {method.name!r}: {name} is {brief_value(value)}, and {brief_value(new)} "
                "when it is stored, read back and validated again. Its type and its validators "
                "must keep a default, and a value that they returned: convert it in the method"
            )
    return _dumped(method, again)


def _validated(method: type[Method], parameters: Mapping[str, Any]) -> Any:
    """Return an instance of ``method.Parameters``, as from the JSON of the parameters.

    Raises CoarticError for a wrong parameter.
    """
    given = _without_withdrawn(method, parameters)
    try:
        text = json.dumps(given, default=lambda value: value.tolist())  # of NumPy
    except (AttributeError, TypeError):
        raise CoarticError(
            f"method {method.name!r}: the parameters {brief_value(given)} must be plain data"
        ) from None
    try:
        return method.Parameters.model_validate_json(text)
    except ValidationError as error:
        names = list(method.Parameters.model_fields)
        problem, listed = explain(error, names), ", ".join(names) or "none"
        raise CoarticError(
            f"method {method.name!r}: {problem} (its parameters: {listed})"
        ) from None


def _dumped(method: type[Method], typed: Any) -> dict[str, Any]:
    """Return the parameters in an instance of ``method.Parameters`` as plain data."""
    _plain_parameters(method, typed.model_dump())  # mode json has None for some NaN
    try:
        data = typed.model_dump(mode="json", fallback=lambda value: value.tolist(), warnings=False)
    except (PydanticSerializationError, AttributeError) as error:
        raise CoarticError(
            f"method {method.name!r}: a default must be plain data ({error_line(error)})"
        ) from None
    return _plain_parameters(method, data)


def same_value(first: Any, second: Any) -> bool:
    """Return whether two values of a parameter are the same, as plain data of the same type.

    In contrast to ``==``, the values 1, 1.0 and True differ.

    Examples
    --------
    >>> same_value([0.5, None], [0.5, None]), same_value(1, True)
    (True, False)
    """
    return json.dumps(first, sort_keys=True) == json.dumps(second, sort_keys=True)


def _without_withdrawn(method: type[Method], parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters without those of :data:`WITHDRAWN`.

    Raises CoarticError if one of these has another value than runs of today's methods have.
    """
    withdrawn = WITHDRAWN.get(method.name, {})
    for name, value in withdrawn.items():
        if name in parameters and parameters[name] != value:
            raise CoarticError(
                f"method {method.name!r}: {name} is {brief_value(parameters[name])}, but this "
                "parameter was withdrawn after version 7.0.0 (commit a0cf376b)"
            )
    return {name: parameters[name] for name in parameters if name not in withdrawn}


def code_of(method: type[Method]) -> str:
    """Return the code of a built-in method: the versions of model and method."""
    return f"{MODEL_VERSION}.{method.version}"


def method_info(method: type[Method], origin: str, where: str, code: str) -> MethodInfo:
    """Make the declaration of a method from its class.

    ``origin``, ``where`` and ``code`` are fields of the :class:`MethodInfo`. Raises CoarticError
    for a parameter whose default is infinite or NaN.
    """
    return MethodInfo(
        name=method.name,
        title=method.title,
        citation=method.citation,
        information=tuple(sorted(item.value for item in method.information)),
        stochastic=method.stochastic,
        defaults=_defaults(method) | WITHDRAWN.get(method.name, {}),
        origin=origin,
        code=code,
        facts=method.facts,
        tuned_on=method.tuned_on,
        where=where,
    )


def _defaults(method: type[Method]) -> dict[str, Any]:
    """Return a dict that maps a method's parameters to their defaults, as plain data.

    They are written as :func:`canonical_parameters` writes them, if the method can do without any
    other value. The value of a parameter without a default is None. Raises CoarticError for a
    default that is infinite or NaN.
    """
    with suppress(Exception):  # parameters that are required, or refuse their defaults
        return canonical_parameters(method, {})
    defaults = {
        name: None if field.is_required() else field.get_default(call_default_factory=True)
        for name, field in method.Parameters.model_fields.items()
    }
    return _plain_parameters(method, defaults)


def _plain_parameters(method: type[Method], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of ``values`` in which each value is plain data.

    A value that JSON does not have becomes a string. Raises CoarticError for a value that contains
    infinity or NaN, or a set.
    """

    def as_text(value: object) -> str:
        if isinstance(value, set | frozenset):
            raise TypeError
        return str(value)

    plain_values = {}
    for name, value in values.items():
        try:
            plain_values[name] = json.loads(json.dumps(value, default=as_text, allow_nan=False))
        except TypeError:
            raise CoarticError(
                f"method {method.name!r}: {name} is {brief_value(value)}; a parameter must be "
                "plain data, and no set, which has no order: use a tuple"
            ) from None
        except ValueError:
            raise CoarticError(
                f"method {method.name!r}: {name} is {brief_value(value)}; a parameter must be "
                "finite: use None for no limit"
            ) from None
    return plain_values


def load_method(where: str, name: str, code: str = "") -> type[Method]:
    """Import a method and return its class.

    Parameters
    ----------
    where : str
        Module, or path of a method file.
    name : str
        Id of the method.
    code : str
        Hash of the code. A process imports a method file once for each hash.

    Raises
    ------
    CoarticError
        The module or file defines no method with this id. Errors of the import are raised as they
        are.
    """
    if where.endswith(".py"):
        methods = methods_in(load_file(Path(where), code)[0])
    else:
        methods = importlib.import_module(where).METHODS
    for method in methods:
        if method.name == name:
            return method
    raise CoarticError(f"{where} defines no method {name!r}")


def methods_in(module: ModuleType, *, abstract: bool = False) -> list[type[Method]]:
    """Return the classes of methods that a module defines itself, not those that it imports.

    If ``abstract`` is True, only the classes that do not define every required function, such as
    ``solve``, are returned. Otherwise only the classes that define all of them are returned.
    """
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
    """Import a method file, and find out which modules are loaded with it.

    A process imports the file once for each ``code``, a hash of the code. The file and the user's
    modules are compiled from their source (:func:`.import_from`). Errors of the file are raised as
    they are.

    Returns
    -------
    module
        The module of the file.
    frozenset of str
        Names of the modules that the import has loaded. The module itself, and modules that were
        loaded before, are left out.
    """
    name = f"coartic_method_{path.stem}"
    import_from(path.parent)
    before = {*sys.modules}
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module, frozenset({*sys.modules} - before - {name})
