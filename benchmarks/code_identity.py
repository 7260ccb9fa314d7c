"""The code that a result comes from, as a hash: read as text, never imported.

Of every module the syntax tree counts, without docstrings: a comment or a better sentence
does not make a result stale, a changed number does.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from coartic.benchmarks.declaration import Foreign, MethodFileError, brief
from coartic.inputs import read_bytes
from coartic.motion.compiled import PACKAGE, model_files

LARGEST_MODULE = 10_000_000
"""Bytes of a module that belongs to a method."""
_BASELINES = "coartic.baselines."


@cache
def built_in_code(module: str) -> str:
    """Hash for a method of this project, defined in ``module``, with all of ``baselines`` it
    imports."""
    if module.startswith("coartic.") and not module.startswith(_BASELINES):
        return _hash([])  # part of the model's code anyway
    found: dict[str, bytes] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name in found or not name.startswith(_BASELINES):
            continue
        found[name], imported = _baseline(name)
        waiting += imported
    return _hash(found[name] for name in sorted(found))


@cache
def built_in_sources(code: str) -> str:
    """Hash of what :func:`built_in_code` gave and of the very text of all that it can be made
    of, with the Python that reads it: where this is equal, that need not be made again, which
    takes a hundred times as long."""
    digest = hashlib.sha256(f"{code} {sys.version}".encode())
    for path in [*_model_files(), *sorted((PACKAGE / "baselines").rglob("*.py"))]:
        text = _text(path)
        digest.update(f"{path.parent.name}/{path.name} {len(text)} ".encode() + text)
    return digest.hexdigest()


def foreign_code(foreign: Foreign) -> str:
    """Hash for a method file with the local modules it imports, or for an installed package.

    Raises MethodFileError where it is no Python.
    """
    if foreign.kind == "installed":
        root = foreign.where.partition(":")[0].partition(".")[0]
        return _hash(essence(_tree(_text(path))) for path in _files_of(root))
    local: dict[str, list[Path]] = {}
    waiting = _imported(_tree(foreign.source, foreign.where))
    while waiting:
        root = waiting.pop().partition(".")[0]
        if root in local or root in sys.stdlib_module_names or root == "coartic":
            continue
        local[root] = [path for path in _files_of(root) if "site-packages" not in path.parts]
        waiting += [
            name for path in local[root] for name in _imported(_tree(_text(path), str(path)))
        ]
    files = [path for root in sorted(local) for path in local[root]]
    sources: list[str | bytes] = [foreign.source, *map(_text, files)]
    return _hash(essence(_tree(source, foreign.where)) for source in sources)


def _files_of(root: str) -> list[Path]:
    """The sources of a top-level module or package."""
    try:
        spec = importlib.util.find_spec(root)
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        return []
    folders = [Path(folder) for folder in spec.submodule_search_locations or []]
    if folders:
        return [path for folder in folders for path in sorted(folder.rglob("*.py"))]
    return [Path(spec.origin)] if spec.origin and spec.origin.endswith(".py") else []


@cache
def _baseline(name: str) -> tuple[bytes, list[str]]:
    """What counts of a module of this project, and what it imports: many methods share it."""
    path = PACKAGE.parent.joinpath(*name.split(".")).with_suffix(".py")
    if not path.is_file():  # a name within a module
        return b"", []
    tree = _tree(_text(path), name)
    return essence(tree), _imported(tree)


def _imported(tree: ast.Module) -> list[str]:
    names: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return names


def _hash(essences: Iterable[bytes]) -> str:
    digest = hashlib.sha256(_model())
    for essence in essences:
        digest.update(essence)
    return digest.hexdigest()[:12]


@cache
def _model() -> bytes:
    """The model, and the worker that hands it to methods."""
    return b"".join(
        path.name.encode() + essence(_tree(_text(path), str(path))) for path in _model_files()
    )


def _model_files() -> list[Path]:
    return [*model_files(), Path(__file__).with_name("worker.py")]


def essence(tree: ast.Module) -> bytes:
    """What counts of a module: its syntax tree without docstrings, which it loses, the same in
    every version of Python."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [child for child in body if not _is_text(child)]  # type: ignore[attr-defined]
    return _written(tree).encode()


def _written(tree: ast.Module) -> str:
    """A syntax tree as text: every node before its parts, without empty ones. What ``ast.dump``
    writes of those, and which there are, changes with the version of Python."""
    written, waiting = [], [tree]  # no recursion: a long sum is a deep tree
    while waiting:
        node: Any = waiting.pop()
        if isinstance(node, ast.AST):
            if isinstance(node, ast.JoinedStr):  # 3.12 has empty texts in it
                node.values = [own for own in node.values if not _is_empty(own)]
            parts = [(n, own) for n, own in ast.iter_fields(node) if own is not None and own != []]
            written.append(f"{type(node).__name__}({','.join(name for name, _ in parts)})")
            waiting += [own for _, own in reversed(parts)]
        elif isinstance(node, list):
            written.append(f"[{len(node)}]")
            waiting += reversed(node)
        else:
            written.append(hex(node) if type(node) is int else ascii(node))
    return " ".join(written)


def _is_empty(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value == ""


def _is_text(node: ast.AST) -> bool:
    """A text that stands for itself: a docstring, of an attribute as well."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _tree(source: str | bytes, name: str = "<method>") -> ast.Module:
    try:
        return ast.parse(source, name or "<method>")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise MethodFileError(f"{name}: cannot be run: {brief(error)}") from None


def _text(path: Path) -> bytes:
    return read_bytes(path, LARGEST_MODULE, error=MethodFileError)
