"""The code that a result comes from, as a hash of syntax trees.

Comments, docstrings, ``__version__`` and the place of a file do not count: a changed number makes
a result stale, a better sentence or a release does not.
"""

from __future__ import annotations

import ast
import hashlib
from collections import deque
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from coartic.motion.sources import model_files

_WITHIN_STATEMENTS = ast.stmt | ast.excepthandler | ast.match_case


def code_of(method: Path, data: tuple[Path, ...] = ()) -> str:
    """Hash of the model's code, a method's file, the modules that it imports from its folder or
    package, and the data files that it reads. Raises OSError or SyntaxError."""
    root = next(folder for folder in method.parents if not (folder / "__init__.py").exists())
    within = root if "site-packages" not in root.parts else root / method.relative_to(root).parts[0]
    model, files, waiting = model_texts(), dict[Path, None](), [method]
    while waiting:
        if (path := waiting.pop()) not in files and path not in model:
            files[path] = None
            waiting += [file for file in imported_files(path, root) if within in file.parents]
    texts = [*model.values(), *map(code_text, sorted(files, key=lambda path: path.name))]
    content = [text.encode() for text in texts] + [path.read_bytes() for path in data]
    return hashlib.sha256(b"".join(content)).hexdigest()[:12]


@cache
def model_texts() -> dict[Path, str]:
    """What counts of the model, and of the worker that hands it to methods, file by file."""
    return {p: code_text(p) for p in [*model_files(), Path(__file__).with_name("worker.py")]}


def imported_files(path: Path, root: Path) -> Iterator[Path]:
    """The files below ``root`` that a module imports."""
    for level, module, names in syntax(path.read_bytes())[1]:
        base = path.parents[level - 1] if level else root
        base = base.joinpath(*filter(None, module.split(".")))
        for name in names:
            place = base.joinpath(*filter(None, name.split(".")))
            yield from filter(Path.is_file, (place.with_suffix(".py"), place / "__init__.py"))


def code_text(path: Path) -> str:
    """What counts of a module: its syntax tree without docstrings and ``__version__``."""
    return syntax(path.read_bytes())[0]


@cache
def syntax(content: bytes) -> tuple[str, tuple[tuple[int, str, tuple[str, ...]], ...]]:
    """What counts of a module, as a text; its imports: level, module, names."""
    imports = []
    for node in statements(tree := ast.parse(content)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            node.value.value = None
        elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__version__":
            node.value = ast.Constant(None)
        elif isinstance(node, ast.Import):
            imports.append((0, "", tuple(alias.name for alias in node.names)))
        elif isinstance(node, ast.ImportFrom):
            names = ("", *(alias.name for alias in node.names))
            imports.append((node.level, node.module or "", names))
    return ast.dump(tree), tuple(imports)


def statements(tree: ast.AST) -> Iterator[ast.AST]:
    """What :func:`ast.walk` finds, without expressions, which are most of a tree."""
    waiting = deque([tree])
    while waiting:
        node = waiting.popleft()
        waiting += [n for n in ast.iter_child_nodes(node) if isinstance(n, _WITHIN_STATEMENTS)]
        yield node
