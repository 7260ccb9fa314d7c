"""Methods by id: those of this project, of installed plug-ins, and of the user's files.

Plug-ins and method files are imported, which runs them.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import json
import re
import sys
import threading
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import ValidationError

from coartic.benchmarks.code_identity import code_of
from coartic.errors import CoarticError
from coartic.inputs import problems_inline
from coartic.learner.conditions import METHOD_PREFIX
from coartic.method import Information, Method
from coartic.runs.plan import BUILT_IN, SEARCH, DeclaredMethod
from coartic.tasks.task import Task
from coartic.text import LONGEST_LINE, plain

ENTRY_POINTS = "coartic.methods"
RESERVED = (METHOD_PREFIX, SEARCH)
"""Ids that begin so have a meaning in every table: methods of this project alone have them."""
MODULES = (
    "coartic.learner.method",
    "coartic.baselines.corrective_alone",
    "coartic.baselines.random_search",
    "coartic.baselines.cma_es",
    "coartic.baselines.nullspace_qp",
    "coartic.baselines.posture_based",
    "coartic.baselines.trajectory_optimisation",
    "coartic.baselines.receding_horizon",
    "coartic.baselines.believed_reward",
    "coartic.baselines.optimum",
)
"""Where this project's methods are, each in its module's ``METHODS``."""


@dataclass(frozen=True)
class Entry:
    """One method as the harness knows it."""

    method: type[Method]
    origin: str
    """``built in``, the distribution of a plug-in, or the path of a method file."""
    where: str
    """What a worker imports: the name of a module, or the path of a method file."""
    code: str
    """Hash of the code that produces its results."""

    @property
    def name(self) -> str:
        """Id of the method."""
        return self.method.name

    @property
    def is_ours(self) -> bool:
        """Whether it is one of this project's methods."""
        return self.origin == BUILT_IN

    @property
    def told(self) -> tuple[str, ...]:
        """What it is told."""
        return tuple(sorted(item.value for item in self.method.told))

    @property
    def defaults(self) -> dict[str, Any]:
        """Its parameters; None for one that has no default."""
        fields = self.method.Parameters.model_fields.items()
        values = {
            name: None if field.is_required() else field.get_default(call_default_factory=True)
            for name, field in fields
        }
        plain_values: dict[str, Any] = json.loads(json.dumps(values, default=str))
        return plain_values

    @property
    def declared(self) -> DeclaredMethod:
        """What is kept of it beside its runs."""
        return DeclaredMethod(
            title=self.method.title,
            citation=self.method.citation,
            told=self.told,
            secondary=tuple(self.method.secondary),
            stochastic=self.method.stochastic,
            defaults=self.defaults,
            origin=self.origin,
            code=self.code,
        )

    def complete(self, parameters: Mapping[str, Any]) -> dict[str, Any]:
        """All parameters, defaults included, as plain data; CoarticError names the ones that are
        wrong."""
        names = list(self.method.Parameters.model_fields)
        try:
            typed = self.with_parameters(parameters).parameters
            complete: dict[str, Any] = json.loads(json.dumps(typed.model_dump(mode="json")))
        except ValidationError as error:
            wrong, listed = problems_inline(error, names), ", ".join(names) or "none"
            raise CoarticError(
                f"method {self.name!r}: {wrong} (its parameters: {listed})"
            ) from None
        return complete

    def with_parameters(self, parameters: Mapping[str, Any]) -> Method:
        """The method with these parameters."""
        return self.method(self.method.Parameters(**parameters))

    def why_not(self, task: Task, parameters: Mapping[str, Any] | None = None) -> str | None:
        """Why the method with parameters does not apply to a task; None where it does.

        Raises CoarticError for wrong parameters.
        """
        self.complete(parameters or {})
        try:
            reason = self.with_parameters(parameters or {}).why_not(task)
        except Exception as error:
            raise CoarticError(
                f"method {self.name!r} cannot say whether it applies to task {task.name!r}: "
                f"{error_line(error)}"
            ) from None
        return None if reason is None else plain(str(reason))


Registry = Mapping[str, Entry]


def registry(method_files: Iterable[Path] = ()) -> dict[str, Entry]:
    """Every known method by id.

    A plug-in that cannot be loaded is a warning. Raises CoarticError for a file that
    cannot be loaded, holds no method, or takes an id that is reserved or already there.
    """
    entries = dict(built_in())
    for point in metadata.entry_points(group=ENTRY_POINTS):
        origin = f"plug-in {point.dist.name if point.dist else point.value}"
        try:  # a broken plug-in must not take the others with it
            add_entries(entries, entries_of_plugin(point, origin))
        except CoarticError as error:
            warnings.warn(
                f"{origin}: entry point {point.name!r} cannot be used: {error}", stacklevel=2
            )
    for path in dict.fromkeys(Path(path).resolve() for path in method_files):
        add_entries(entries, entries_of_file(path))
    return entries


@cache
def built_in() -> Mapping[str, Entry]:
    """This project's methods by id."""
    entries: dict[str, Entry] = {}
    for name in MODULES:
        module = importlib.import_module(name)
        code = code_of(Path(inspect.getfile(module)))  # once for its methods: it takes a while
        entries |= {method.name: Entry(method, BUILT_IN, name, code) for method in module.METHODS}
    return entries


def method_at(where: str, name: str) -> type[Method]:
    """A method by what :attr:`Entry.where` and its id say, as a worker imports it."""
    module = file_module(Path(where)) if where.endswith(".py") else importlib.import_module(where)
    for method in [*getattr(module, "METHODS", ()), *methods_in(module)]:
        if method.name == name:
            return method  # type: ignore[no-any-return]
    raise CoarticError(f"{where} defines no method {name!r}")


def file_module(path: Path) -> ModuleType:
    """The module of a method file; what lies beside it can be imported by it."""
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


_parsing = threading.Lock()  # Python 3.11 cannot parse in two threads at once


def current_code(where: str, name: str) -> str:
    """Hash of the code of a method that is imported from ``where``; ``none`` where it has none."""
    with _parsing:
        if where.endswith(".py"):
            return {e.name: e.code for e in entries_of_file(Path(where))}.get(name, "none")
        return code_of(Path(inspect.getfile(importlib.import_module(where))))


def add_entries(registered: dict[str, Entry], entries: Iterable[Entry]) -> None:
    """Add methods by id. Raises CoarticError for an id that is reserved or taken."""
    for entry in entries:
        if entry.name.startswith(RESERVED):
            raise CoarticError(
                f"{entry.origin}: method id {entry.name!r} is reserved: ids that begin with "
                f"{' or '.join(map(repr, RESERVED))} are this project's"
            )
        if entry.name in registered:
            raise CoarticError(
                f"{entry.origin}: method id {entry.name!r} is already taken "
                f"({registered[entry.name].origin})"
            )
        registered[entry.name] = entry


def entries_of_file(path: Path) -> Iterator[Entry]:
    """The methods of a file. Raises CoarticError where there is none that can be used."""
    shown = plain(str(path), LONGEST_LINE)
    if not path.is_file():
        raise CoarticError(f"{shown}: there is no such file")
    try:
        module = file_module(path)
    except (Exception, SystemExit) as error:
        raise CoarticError(f"{shown}: cannot be imported: {error_line(error)}") from None
    yield from entries_of_module(module, methods_in(module), shown, str(path))


def entries_of_plugin(point: metadata.EntryPoint, origin: str) -> Iterator[Entry]:
    """The methods of an installed plug-in. Raises CoarticError."""
    try:
        target = point.load()
    except (Exception, SystemExit) as error:
        raise CoarticError(f"cannot be imported: {error_line(error)}") from None
    if not inspect.isclass(target):
        yield from entries_of_module(target, methods_in(target), origin, target.__name__)
    elif issubclass(target, Method):
        module = sys.modules[target.__module__]
        yield from entries_of_module(module, [target], origin, module.__name__)
    else:
        raise CoarticError(f"{target!r} is not a subclass of coartic.method.Method")


def entries_of_module(
    module: ModuleType, methods: Iterable[type[Method]], origin: str, where: str
) -> Iterator[Entry]:
    """Methods of a module with their code. Raises CoarticError where there is none."""
    methods = list(methods)
    for method in methods:
        check_declaration(method, origin)
        file = Path(inspect.getfile(module))
        data = tuple(file.parent / name for name in method.files)
        try:
            code = code_of(file, data)
        except OSError as error:
            raise CoarticError(
                f"{origin}: method {method.name!r} declares a file that cannot be read: "
                f"{error.filename}"
            ) from None
        except (SyntaxError, ValueError) as error:
            raise CoarticError(
                f"{origin}: it imports what is no Python: {error_line(error)}"
            ) from None
        yield Entry(method, origin, where, code)
    if not methods:
        unfinished = [
            f"{value.__name__} has no {', '.join(sorted(value.__abstractmethods__))}"
            for value in vars(module).values()
            if inspect.isclass(value) and issubclass(value, Method) and inspect.isabstract(value)
            and value is not Method
        ]  # fmt: skip
        why = f" that is complete: {', '.join(unfinished)}" if unfinished else ""
        raise CoarticError(f"{origin}: defines no subclass of coartic.method.Method{why}")


def check_declaration(method: type[Method], origin: str) -> None:
    """Raises CoarticError where a method does not declare what every method does."""
    where = f"{origin}: {method.__name__}"
    for attribute in ("name", "title", "citation"):
        text = getattr(method, attribute, None)
        if not isinstance(text, str) or plain(text, LONGEST_LINE) != text:
            raise CoarticError(f"{where}: {attribute} must be a text of one line, not {text!r}")
    if not _NAME.fullmatch(method.name):
        raise CoarticError(
            f"{where}: name {method.name!r} may have letters, digits, '.', '_', '+', '/' and '-'"
        )
    told = getattr(method, "told", None)
    if not isinstance(told, frozenset | set) or not all(isinstance(i, Information) for i in told):
        raise CoarticError(f"{where}: told must be a set of Information, not {told!r}")


_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+/-]{0,79}")


def error_line(error: BaseException) -> str:
    """An exception in one line."""
    return plain(f"{type(error).__name__}: {error}")


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
