"""Methods by id: those of this project, of installed plug-ins, and of the user's files."""

from __future__ import annotations

import ast
import difflib
import hashlib
import importlib.util
import inspect
import sys
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import ValidationError

import baselines.cma_es
import baselines.corrective_alone
import baselines.nullspace_qp
import baselines.optimum
import baselines.posture_based
import baselines.random_search
import baselines.trajectory_optimisation
from coartic import CoarticError, Task
from coartic.compiled import PACKAGE, model_source
from coartic.dual_process import DUAL_PROCESS
from coartic.inputs import read_text
from coartic.method import Method

ENTRY_POINTS = "coartic.methods"
BUILT_IN_ORIGIN = "built in"
_PACKAGES = {"coartic", "baselines", "benchmarks", "analysis"}
BUILT_IN: tuple[type[Method], ...] = (
    *DUAL_PROCESS,
    *baselines.corrective_alone.METHODS,
    *baselines.random_search.METHODS,
    *baselines.cma_es.METHODS,
    *baselines.nullspace_qp.METHODS,
    *baselines.posture_based.METHODS,
    *baselines.trajectory_optimisation.METHODS,
    *baselines.optimum.METHODS,
)


class MethodFileError(CoarticError):
    """A method file or plug-in that cannot be used."""


@dataclass(frozen=True)
class Plugin:
    """Source of a method file, so that any worker on any machine can run it."""

    filename: str
    source: str

    @property
    def digest(self) -> str:
        """Hash of the source."""
        return hashlib.sha256(self.source.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Entry:
    """One method as the harness knows it."""

    method: type[Method]
    origin: str
    """``built in``, the distribution of a plug-in, or the path of a method file."""
    code: str
    """Hash of the code that produces its results."""
    plugin: Plugin | None = None


Registry = Mapping[str, Entry]


def registry(method_files: Iterable[Path] = ()) -> dict[str, Entry]:
    """Every known method by id.

    A plug-in that cannot be loaded is a warning. Raises MethodFileError for a file that
    cannot be loaded, holds no method, or takes an id that is already there.
    """
    found: dict[str, Entry] = {}

    def add(method: type[Method], entry: Entry) -> None:
        name = _checked_name(method, entry.origin)
        if name in found:
            raise MethodFileError(
                f"{entry.origin}: method id {name!r} is already taken ({found[name].origin})"
            )
        found[name] = entry

    for method in BUILT_IN:
        add(method, Entry(method, BUILT_IN_ORIGIN, code_hash(_package_source(method))))
    for point in metadata.entry_points(group=ENTRY_POINTS):
        origin = f"plug-in {point.dist.name if point.dist else point.value}"
        try:  # a broken plug-in must not take the others with it
            for method in _methods_of(point.load(), origin):
                add(method, Entry(method, origin, code_hash(_package_source(method))))
        except Exception as error:
            warnings.warn(
                f"{origin}: entry point {point.name!r} cannot be used: {_brief(error)}",
                stacklevel=2,
            )
    for path in method_files:
        plugin = read_plugin(path)
        for method in plugin_methods(plugin):
            code = code_hash(file_source(plugin.source))
            add(method, Entry(method, str(path), code, plugin))
    return found


def read_plugin(path: Path) -> Plugin:
    """The text of a method file."""
    return Plugin(path.name, read_text(path, error=MethodFileError))


def plugin_methods(plugin: Plugin) -> list[type[Method]]:
    """The methods that a method file defines; the file is run to find them."""
    return list(_load_plugin(plugin))


@cache
def _load_plugin(plugin: Plugin) -> tuple[type[Method], ...]:
    module = ModuleType(f"coartic_method_{plugin.digest}")
    module.__file__ = plugin.filename
    sys.modules[module.__name__] = module  # typing looks annotations up there
    try:
        exec(compile(plugin.source, plugin.filename, "exec"), module.__dict__)
    except Exception as error:
        raise MethodFileError(f"{plugin.filename}: cannot be run: {_brief(error)}") from None
    return tuple(_methods_of(module, plugin.filename))


def _methods_of(target: Any, origin: str) -> list[type[Method]]:
    """A method class itself, or those that a module defines."""
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
        raise MethodFileError(f"{origin}: defines no subclass of coartic.method.Method")
    return found


def _checked_name(method: type[Method], origin: str) -> str:
    for attribute in ("name", "title", "citation", "told"):
        if not hasattr(method, attribute):
            raise MethodFileError(f"{origin}: {method.__name__} does not declare {attribute!r}")
    name = method.name
    if not isinstance(name, str) or not name or any(c in ", \t\n" for c in name):
        raise MethodFileError(
            f"{origin}: {method.__name__}.name is {name!r}; an id is text without spaces or commas"
        )
    return name


def build(entry: Entry, parameters: Mapping[str, Any]) -> Method:
    """A method with parameters; raises CoarticError naming the ones that are wrong."""
    try:
        return entry.method(entry.method.Parameters(**parameters))
    except ValidationError as error:
        known = ", ".join(entry.method.Parameters.model_fields) or "none"
        problems = "; ".join(
            f"{'.'.join(map(str, detail['loc']))}: {decapitalised(detail['msg'])} "
            f"(found {detail['input']!r})"
            for detail in error.errors()
        )
        raise CoarticError(
            f"method {entry.method.name!r}: {problems}. Its parameters: {known}."
        ) from None


def why_not(entry: Entry, task: Task, parameters: Mapping[str, Any] | None = None) -> str | None:
    """Why a method with parameters does not apply to a task; None where it does.

    Raises CoarticError for wrong parameters and for a method that fails to say.
    """
    method = build(entry, parameters or {})
    try:
        return method.why_not(task)
    except Exception as error:
        raise MethodFileError(
            f"method {entry.method.name!r} cannot say whether it applies to task "
            f"{task.name!r}: {_brief(error)}"
        ) from None


def unknown(kind: str, name: str, known: Iterable[str]) -> CoarticError:
    """An error for a name that is not among the known ones, with the nearest of them."""
    names = list(known)
    close = difflib.get_close_matches(name, names, n=1)
    hint = f"; did you mean {close[0]!r}?" if close else "."
    return CoarticError(f"unknown {kind} {name!r}{hint} Known: {', '.join(names)}.")


def _package_source(method: type[Method]) -> str:
    """Every source of the package (or the module) that an installed method comes from.

    For a method of this project: its own module and those of ``baselines`` it imports.
    """
    root = method.__module__.partition(".")[0]
    if root == "coartic":
        return ""  # part of the model's code anyway
    if root == "baselines":
        return _own_source(method.__module__)
    module = sys.modules[root]
    paths = [Path(folder) for folder in getattr(module, "__path__", [])]
    files = [path for folder in paths for path in sorted(folder.rglob("*.py"))]
    if not files and module.__file__:
        files = [Path(module.__file__)]
    return _joined(files)


def _own_source(name: str) -> str:
    sources: dict[str, str] = {}
    waiting = [name]
    while waiting:
        name = waiting.pop()
        module = sys.modules.get(name)
        if name in sources or module is None or name.partition(".")[0] != "baselines":
            continue
        sources[name] = inspect.getsource(module)
        waiting += _imported(sources[name])
    return "".join(f"{name}\n{sources[name]}" for name in sorted(sources))


def file_source(source: str) -> str:
    """Source of a method file with the local modules it imports: all but installed ones."""
    local: dict[str, Path] = {}
    waiting = [*_imported(source)]
    while waiting:
        root = waiting.pop().partition(".")[0]
        if root in local or root in sys.stdlib_module_names or root in _PACKAGES:
            continue
        spec = importlib.util.find_spec(root)
        if spec is None or spec.origin is None or "site-packages" in spec.origin:
            continue
        local[root] = Path(spec.origin)
        waiting += _imported(local[root].read_text(encoding="utf-8"))
    files = []
    for path in local.values():
        files += sorted(path.parent.rglob("*.py")) if path.name == "__init__.py" else [path]
    return source + _joined(files)


@cache
def _imported(source: str) -> tuple[str, ...]:
    names: list[str] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return tuple(names)


def _joined(files: list[Path]) -> str:
    return "".join(f"{path.name}\n{path.read_text(encoding='utf-8')}" for path in files)


def code_hash(source: str) -> str:
    """Hash of the code one method's results come from: the model, scoring, the method."""
    digest = hashlib.sha256(model_source())
    for path in (PACKAGE / "frames.py", Path(__file__).with_name("worker.py")):
        digest.update(_on_import(path))
    digest.update(source.encode())
    return digest.hexdigest()[:12]


@cache
def _on_import(path: Path) -> bytes:
    return path.read_bytes()


def decapitalised(text: str) -> str:
    """A sentence as part of another."""
    return text[:1].lower() + text[1:]


def _brief(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"
