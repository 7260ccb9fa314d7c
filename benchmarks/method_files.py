"""Read method files, each in a separate process, and compute hashes of their code.

When a method file is imported, it can change its process: for example, it can change the current
folder, replace functions of a library or exit. In a separate process such changes do not affect the
process that runs suites, nor the other method files. Two files can also import different modules
that have the same name.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Iterable, Mapping
from concurrent.futures import BrokenExecutor
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from importlib import metadata
from inspect import isclass, signature
from pathlib import Path
from typing import Any

from pebble import ProcessExpired, ProcessPool
from pydantic import BaseModel

from coartic.benchmarks.processes import CONTEXT, signal_name
from coartic.errors import CoarticError
from coartic.internal.limits import brief_value
from coartic.internal.text import MAX_LINE_LENGTH, error_line, plain
from coartic.internal.threads import begin_worker
from coartic.internal.toml_files import read_bytes
from coartic.internal.user_files import is_users
from coartic.method import Facts, Information, Method
from coartic.method.optimisers import Optimiser
from coartic.model import MODEL_VERSION, WORLD
from coartic.runs.method_info import (
    READERS,
    MethodInfo,
    answer,
    load_file,
    load_method,
    method_info,
    methods_in,
)

_ANSWER_S = 300.0  # longest wait for an answer: libraries can take long to import


def read_file(path: Path, ends: ExitStack | None = None) -> list[MethodInfo]:
    """Return the declarations of the methods of a file.

    A new process imports the file. The new process stays alive, and answers later questions about
    the methods (:data:`.READERS`).

    Parameters
    ----------
    path : Path
        The method file, whose name ends in ``.py``.
    ends : contextlib.ExitStack, optional
        Stack with which the new process ends. By default it ends with this process.

    Returns
    -------
    list of MethodInfo
        Declarations of the methods that the file defines, in the order of their definitions.

    Raises
    ------
    CoarticError
        The file cannot be read or imported, defines no method, or has a wrong declaration of a kind
        that :func:`_declarations` finds; or the process cannot start, ends, or does not answer
        within 300 s.
    """
    shown = plain(str(path), MAX_LINE_LENGTH)
    read_bytes(path)
    if path.suffix != ".py":
        raise CoarticError(f"{shown}: the name of a method file must end in .py")
    reader = ProcessPool(1, initializer=begin_worker, context=CONTEXT)
    if ends is not None:
        ends.callback(reader.join)
        ends.callback(reader.stop)
        ends.callback(READERS.pop, str(path), None)
    infos: list[MethodInfo] = _ask(reader, shown, _declarations, path, shown)
    READERS[str(path)] = partial(_ask, reader, shown, _answer, path)
    return infos


def _ask(reader: Any, shown: str, function: Any, *arguments: Any) -> Any:
    """Call a function in the process of a method file, and return the result.

    Parameters
    ----------
    reader : pebble.ProcessPool
        Pool of one process, which has imported the file or will import it.
    shown : str
        Name of the file in messages.
    function : callable
        Function of this module to call.
    *arguments
        Arguments of the function.

    Raises
    ------
    CoarticError
        The function raised a CoarticError, or the process cannot start, ended, or did not answer
        within 300 s.
    """
    try:
        return reader.schedule(function, args=arguments, timeout=_ANSWER_S).result()
    except CoarticError as error:
        raise CoarticError(str(error)) from None  # without the traceback of the other process
    except ProcessExpired as error:
        code = error.exitcode
        how = f"{signal_name(-code)} ended it" if code < 0 else f"it ended with exit code {code}"
        raise CoarticError(f"{shown}: the process that reads it ended: {how}") from None
    except TimeoutError:
        raise CoarticError(f"{shown}: its process did not answer within {_ANSWER_S:g} s") from None
    except (BrokenExecutor, OSError, RuntimeError) as error:
        cause = error.__cause__ or error
        reason = error_line(cause)
        if isinstance(cause, EOFError | ConnectionError):
            reason = "the server of processes was ended, perhaps because memory ran out"
        raise CoarticError(
            f"{shown}: a process to read it cannot start ({reason}). Repeat the command"
        ) from None


# The functions below run in the process of a file.


def _answer(path: Path, method: str, question: str, *arguments: Any) -> Any:
    """Answer a question about a method of a file (:func:`.answer`).

    ``method`` is the id of the method. Raises CoarticError if the method cannot answer.
    """
    try:
        return answer(load_method(str(path), method), question, *arguments)
    except CoarticError:
        raise
    except BaseException as error:
        raise CoarticError(f"{path} cannot be used: {error_line(error)}") from None


def check_code(info: MethodInfo) -> None:
    """Import the file of a method, and check that its code has not changed.

    Raises CoarticError if the hash of the code differs from ``info.code``, because one of the files
    in the hash (:func:`_code_of`) was changed after ``info`` was made.
    """
    path = Path(info.where)
    module, loaded = load_file(path, info.code)
    files = _user_files(loaded)
    codes = {method.name: _code_of(method, path, files) for method in methods_in(module)}
    if codes.get(info.name) != info.code:
        raise CoarticError(
            f"{info.where}, or a file that it loads, has changed since the suite was started: "
            "repeat the command, on a cluster with the same files everywhere"
        )


def _declarations(path: Path, shown: str) -> list[MethodInfo]:
    """Import a method file, and return the declarations of its methods.

    Each declaration contains the hash of the method's code (:func:`_code_of`), and the installed
    packages that are imported by the file, or by another file of the user that it loads.

    Parameters
    ----------
    path : Path
        The file.
    shown : str
        Name of the file in messages.

    Returns
    -------
    list of MethodInfo

    Raises
    ------
    CoarticError
        The file cannot be imported or defines no complete method; a module beside it is not the
        one that it would import (:func:`_check_helpers`); an attribute of a method, such as
        ``name`` or ``Parameters``, has a wrong type; its function ``solve`` (or ``optimise``) has
        wrong arguments; or the method has a function ``why_not`` (the old name of
        ``inapplicable_reason``).
    """
    try:
        _check_helpers(path, path.parent)
        module, loaded = load_file(path)
    except CoarticError:
        raise
    except BaseException as error:
        raise CoarticError(f"{shown} cannot be imported: {error_line(error)}") from None
    methods = methods_in(module)
    if not methods:
        unfinished = [
            f"{method.__name__} has no {', '.join(sorted(method.__abstractmethods__))}"
            for method in methods_in(module, abstract=True)
        ]
        missing = f" that is complete: {', '.join(unfinished)}" if unfinished else ""
        raise CoarticError(
            f"{shown} must define a subclass of coartic.Method or coartic.Optimiser{missing}"
        )
    files = _user_files(loaded)
    for file in files:
        _check_helpers(file, path.parent)
    packages, infos = _packages_of({path, *files}), list[MethodInfo]()
    for method in methods:
        where = f"{shown}: {method.__name__}"
        for attribute in ("name", "title", "citation", "tuned_on"):
            text = getattr(method, attribute, None)
            if not isinstance(text, str) or plain(text, MAX_LINE_LENGTH) != text:
                raise CoarticError(
                    f"{where}: {attribute} must be a string of one line, not {text!r}"
                )
        information = getattr(method, "information", None)
        if not isinstance(information, frozenset | set) or not all(
            isinstance(item, Information) for item in information
        ):
            raise CoarticError(
                f"{where}: information must be a set of Information, not {information!r}"
            )
        adapts_to = method.adapts_to
        if adapts_to is not None and not (isinstance(adapts_to, frozenset | set) and
                                          adapts_to <= {*WORLD}):  # fmt: skip
            raise CoarticError(
                f"{where}: adapts_to must be None or a set of {', '.join(WORLD)}, not {adapts_to!r}"
            )
        if not isinstance(method.facts, Facts):
            raise CoarticError(f"{where}: facts must be Facts(...), not {method.facts!r}")
        parameters, names = method.Parameters, method.files
        for attribute, is_right, wanted in (
            ("Parameters", isclass(parameters) and issubclass(parameters, BaseModel),
             "a subclass of coartic.method.Parameters"),
            ("stochastic", type(method.stochastic) is bool, "True or False"),
            ("version", type(method.version) is int, "an integer"),
            ("quick", isinstance(method.quick, Mapping), "a dict of parameters"),
            ("files", isinstance(names, tuple | list) and all(isinstance(x, str) for x in names),
             'a tuple of names, such as ("weights.npz",)'),
        ):  # fmt: skip
            if not is_right:
                value = brief_value(getattr(method, attribute))
                raise CoarticError(f"{where}: {attribute} must be {wanted}, not {value}")
        if hasattr(method, "why_not"):  # its old name, which would silently not be called
            raise CoarticError(f"{where}: why_not is called inapplicable_reason now: rename it")
        function, arguments = "solve", "session"
        if issubclass(method, Optimiser):
            function, arguments = "optimise", "objective, rng"
        try:
            signature(getattr(method, function)).bind("self", *arguments.split(", "))
        except TypeError:
            raise CoarticError(
                f"{where}: {function} must be defined as {function}(self, {arguments})"
            ) from None
        info = method_info(method, shown, str(path), _code_of(method, path, files))
        infos.append(replace(info, packages=packages))
    return infos


def _code_of(method: type[Method], path: Path, files: Iterable[Path]) -> str:
    """Return a hash (12 hex digits) of the code of a method from a file.

    The hash covers

    - the version of the model and the version of the method;
    - the method file at ``path``;
    - the data files that the method declares (:attr:`.Method.files`);
    - ``files``, the other files of the user that are loaded when the method file is imported.

    The hash depends on the contents of the files, not on their names and folders. Raises
    CoarticError for a file that cannot be read.
    """
    declared = [path.parent / name for name in method.files]
    parts = [f"{MODEL_VERSION}.{method.version}".encode()]
    for file in (path, *declared, *files):
        try:
            parts.append(read_bytes(file))
        except CoarticError as error:
            raise CoarticError(f"{path}: its file {error}") from None
    hashes = sorted(hashlib.sha256(part).digest() for part in parts)  # independent of paths
    return hashlib.sha256(b"".join(hashes)).hexdigest()[:12]


def _user_files(names: Iterable[str]) -> set[Path]:
    """Return the files of the loaded modules that belong to the user.

    ``names`` are the names of the modules; :func:`.is_users` says which modules are the user's.
    """
    files = {
        name: Path(path).resolve()
        for name in names
        if isinstance(path := getattr(sys.modules.get(name), "__file__", None), str)
    }
    return {path for name, path in files.items() if is_users(name, path)}


def _check_helpers(file: Path, folder: Path) -> None:
    """Check that a Python file does not import a module whose name hides one in a folder.

    Raises CoarticError if the file imports a name that the folder has as a module, and that is also
    the name of a module of Python, or of another module that is loaded already. Such a module would
    be used in place of that in the folder.
    """
    for name in sorted(_imports_of(file)):
        helpers = folder / f"{name}.py", folder / name / "__init__.py"
        loaded = getattr(sys.modules.get(name), "__file__", None)
        for helper in filter(Path.is_file, helpers):
            if name in sys.stdlib_module_names or (
                loaded is not None and not helper.samefile(loaded)
            ):
                raise CoarticError(
                    f"{plain(str(file))}: {name} is also the name of a module that Python or "
                    f"coartic uses, which would be imported in place of {plain(str(helper))}: give "
                    "this module another name"
                )


def _imports_of(file: Path) -> set[str]:
    """Return the names of the modules that a Python file imports, without their submodules."""
    if file.suffix != ".py":
        return set()
    names = set[str]()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module)
    return {name.partition(".")[0] for name in names}


def _packages_of(files: Iterable[Path]) -> dict[str, str]:
    """Return a dict that maps the installed packages that Python files import to their versions.

    Modules of the standard library and of coartic are left out.
    """
    tops = set[str]().union(*map(_imports_of, files)) - {"coartic"} - sys.stdlib_module_names
    if not tops:
        return {}
    installed = metadata.packages_distributions()
    packages = sorted({package for top in tops for package in installed.get(top, ())})
    return {package: metadata.version(package) for package in packages}
