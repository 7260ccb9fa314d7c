"""Find what results of a method file come from: files and packages that its process has loaded.

The process that has imported the file looks at them; built-in methods have a version in their
place (:attr:`coartic.method.Method.version`).
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import io
import os
import re
import site
import sys
import sysconfig
import tokenize
from collections.abc import Collection, Iterable, Iterator
from functools import cache
from importlib import metadata
from pathlib import Path

import coartic
from coartic.internal.toml_files import check_file
from coartic.method import MODULES, Method
from coartic.model import MODEL_VERSION
from coartic.motion.compile import PACKAGE

OUR_PACKAGES = {"coartic", "analysis", "baselines", "benchmarks"}
"""Names of the packages of this project."""
_LARGEST_DATA = 2**30  # bytes of a declared file


def code_of(method: type[Method], file: Path) -> str:
    """Return a hash, 12 hexadecimal digits, of what the results of a method from a file come from.

    The hash covers the file, the data files that the method declares, and the user's files that
    this process has loaded (:func:`own_files`); versions of the method and the model, and of the
    built-in methods that these files import; names and versions of installed packages that these
    files import, except packages that coartic needs. Comments in Python code do not count
    (:func:`content_of`), nor do places of files. Raises OSError or CoarticError for a file that
    cannot be read.
    """
    files = {*own_files(), str(file)}
    texts = [content_of(path) for path in files]
    imported = _imported_by(frozenset(files))
    parts = [f"{MODEL_VERSION}.{method.version}".encode(), *texts]
    for declared in (file.parent / name for name in method.files):
        check_file(declared, most=_LARGEST_DATA)
        parts.append(declared.read_bytes())
    parts += [line.encode() for line in (*_built_in_versions(imported), *_packages(imported))]
    hashes = sorted(hashlib.sha256(part).digest() for part in parts)
    return hashlib.sha256(b"".join(hashes)).hexdigest()[:12]


def imported_packages(file: str) -> list[str]:
    """Return a line with name and version for each installed package that a method file, or a
    user's file that this process has loaded, imports, except packages that this project needs."""
    return _packages(_imported_by(frozenset({*own_files(), file})))


@cache
def _imported_by(files: Collection[str]) -> set[str]:
    """Return the names of the modules and attributes that the Python files among these paths import
    (:func:`_imports`)."""
    return {name for path in files if path.endswith(".py") for name in _imports(path)}


def own_files(known: Collection[str] = ()) -> set[str]:
    """Return the paths of the user's files that this process has loaded: existing files of all
    modules except modules named in ``known``, of the standard library, of installed packages and of
    this project."""
    found = {path for name, path in _loaded().items() if name not in known}
    return {path for path in found if not _is_installed(path) and os.path.exists(path)}


def libraries() -> dict[str, str]:
    """Return, by name, the versions of installed packages, without coartic, from whose importable
    names, such as ``yaml``, this process has loaded modules (:func:`_is_installed`)."""
    tops = {name.partition(".")[0] for name, path in _loaded().items() if _is_installed(path)}
    names = sorted({name for top in tops for name in _distributions().get(top, ())})
    return {name: _version(name) for name in names}


def content_of(path: str) -> bytes:
    """Return the bytes of a file that count in a hash: of a Python file its tokens without
    comments, blank lines and widths of indentation, an f-string as one token; of any other file all
    bytes. Raises OSError for a file that cannot be read."""
    content = Path(path).read_bytes()
    if not path.endswith(".py"):
        return content
    lines = content.splitlines(keepends=True)
    parts, strings, begin = list[bytes](), 0, (0, 0)
    for kind, text, start, end, _ in tokenize.tokenize(io.BytesIO(content).readline):
        name = tokenize.tok_name[kind]
        if name.endswith("STRING_START"):  # since Python 3.12 an f-string has tokens of its own
            begin = begin if strings else start
            strings += 1
        elif name.endswith("STRING_END"):
            strings -= 1
            if not strings:
                parts.append(_between(lines, begin, end))
        elif not strings and name not in ("COMMENT", "NL", "ENCODING"):
            parts.append(name.encode() if name in ("INDENT", "DEDENT") else text.strip().encode())
    return b"\0".join(parts)


def _between(lines: list[bytes], start: tuple[int, int], end: tuple[int, int]) -> bytes:
    """Return the text in ``lines``, UTF-8, from ``start`` to before ``end``, each the number of a
    line, from 1, and of a letter in it, from 0."""
    text = [line.decode(errors="replace") for line in lines[start[0] - 1 : end[0]]]
    text[-1] = text[-1][: end[1]]
    text[0] = text[0][start[1] :]
    return "".join(text).encode()


def _loaded() -> dict[str, str]:
    """Return, by name, the absolute path of the file of each loaded module that has a file, except
    this project's modules."""
    return {
        name: outside
        for name, module in [*sys.modules.items()]
        if isinstance(path := getattr(module, "__file__", None), str)
        and (outside := _outside(path))
    }


@cache
def _outside(path: str) -> str:
    """Return the absolute path of a file, or an empty text for a file of this project."""
    absolute = os.path.abspath(path)
    return "" if absolute.startswith(_our_folders()) else absolute


@cache
def _our_folders() -> tuple[str, ...]:
    """Return the folders of this project, each with a separator at its end."""
    folders = [PACKAGE, *(PACKAGE / name for name in OUR_PACKAGES)]  # within it, or linked there
    ours = (each(folder) for folder in folders for each in (os.path.abspath, os.path.realpath))
    return tuple(f"{folder}{os.sep}" for folder in ours)


_version, _distributions = cache(metadata.version), cache(metadata.packages_distributions)


@cache
def _is_installed(path: str) -> bool:
    """Return True for a path in a folder of the standard library or of installed packages, False
    for any other path, as in a package installed in editable mode."""
    if {"site-packages", "dist-packages"} & {*Path(path).parts}:
        return True
    standard = [sysconfig.get_path(name) for name in ("stdlib", "platstdlib")]
    folders = [*standard, *site.getsitepackages(), site.getusersitepackages()]
    return any(path.startswith(f"{folder}{os.sep}") for folder in folders)


def _imports(path: str) -> Iterator[str]:
    """Yield the full name of each module or attribute that a statement of a Python file imports,
    such as ``numpy.linalg``, and of each attribute of ``coartic`` that the file names, such as
    ``coartic.learn``; no relative imports, and nothing of a file that is gone or malformed."""
    try:
        tree = ast.parse(Path(path).read_bytes())
    except (OSError, SyntaxError):  # it was removed or changed since it was imported
        return
    names = {"coartic"}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
            names |= {a.asname for a in node.names if a.name == "coartic" and a.asname}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(value=ast.Name(id=name)) if name in names:
                yield f"coartic.{node.attr}"


def _built_in_versions(imported: Iterable[str]) -> list[str]:
    """Return a line with id and version for each built-in method that ``imported`` names reach: the
    methods of the module of a name, or, for a module of ``coartic.baselines`` or
    ``coartic.learner`` without methods, all methods there."""
    ours = (name[len("coartic.") :] for name in imported if name.startswith("coartic."))
    names = {coartic.HOME.get(name, f"coartic.{name}") for name in ours}
    modules = set[str]()
    for name in names:
        if name.startswith(("coartic.baselines", "coartic.learner")):
            inside = [each for each in MODULES if f"{name}.".startswith(f"{each}.")]
            folder = ".".join(name.split(".")[:2])
            modules |= {*(inside or (each for each in MODULES if each.startswith(folder)))}
    methods = [each for name in modules for each in importlib.import_module(name).METHODS]
    return sorted(f"{each.name} {each.version}" for each in methods)


def _packages(imported: Iterable[str]) -> list[str]:
    """Return a line with name and version for each installed package that has the first part of one
    of the ``imported`` names, except packages that this project needs."""
    tops = {name.partition(".")[0] for name in imported} - OUR_PACKAGES - sys.stdlib_module_names
    names = {name for top in tops for name in _distributions().get(top, ())}
    return sorted(f"{n} {_version(n)}" for n in names if _plain_name(n) not in _needed())


@cache
def _needed() -> set[str]:
    """Return the names of the packages that this project itself needs."""
    needs = [each for each in metadata.requires("coartic") or () if "extra ==" not in each]
    return {_plain_name(re.split(r"[^\w.-]", each)[0]) for each in needs}


def _plain_name(name: str) -> str:
    """Return the name of a package as package indexes compare names: small letters, with ``-`` for
    each run of ``-``, ``_`` and ``.``."""
    return re.sub(r"[-_.]+", "-", name).lower()
