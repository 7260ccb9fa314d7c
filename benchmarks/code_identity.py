"""The code that a result comes from, as a hash of syntax trees.

Comments and docstrings do not count: a better sentence does not make a result stale, a changed
number does. Where a method's file lies does not count either.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from coartic.motion.compiled import PACKAGE, model_files


def code_of(method: Path, data: tuple[Path, ...] = ()) -> str:
    """Hash of the model's code, of the file that defines a method, of all that this imports and
    that came with it, and of the data files that it reads. Raises OSError or SyntaxError."""
    model = _model()
    own: dict[Path, None] = {}
    waiting = [method]
    while waiting:
        if (path := waiting.pop()) not in own and path not in model:
            own[path] = None
            waiting += _imported(path, method)
    texts = [*model.values(), *map(_essence, sorted(own, key=lambda path: path.name))]
    digest = hashlib.sha256("".join(texts).encode())
    for path in data:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


@cache
def _model() -> dict[Path, str]:
    """The files of the model, and of the worker that hands it to methods: what counts of each."""
    files = [*model_files(), Path(__file__).with_name("worker.py")]
    return {path: _essence(path) for path in files}


def _imported(path: Path, method: Path) -> Iterator[Path]:
    """The files that a module imports and that came with the method."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        names = [alias.name for alias in getattr(node, "names", [])]
        if isinstance(node, ast.ImportFrom):
            module = node.module or ""
            folder = path.parents[node.level - 1] if node.level else None
            found = [module, *(f"{module}.{name}".strip(".") for name in names)]
        elif isinstance(node, ast.Import):
            folder, found = None, names
        else:
            continue
        for name in filter(None, found):
            top, *rest = name.split(".")
            base = folder / top if folder else _home(top, method)
            if base is not None:
                files = base.joinpath(*rest).with_suffix(".py"), base.joinpath(*rest, "__init__.py")
                yield from filter(Path.is_file, files)


def _home(top: str, method: Path) -> Path | None:
    """Where a module's top-level name is, without a suffix; None for what is somebody else's."""
    if top in sys.stdlib_module_names or (top == "coartic" and PACKAGE not in method.parents):
        return None
    spec = importlib.util.find_spec(top)
    if spec is None:
        return None
    if spec.submodule_search_locations:
        home = Path(next(iter(spec.submodule_search_locations)))
    else:
        home = Path(spec.origin or top).with_suffix("")
    return home if "site-packages" not in home.parts or home in method.parents else None


def _essence(path: Path) -> str:
    """What counts of a module: its syntax tree without docstrings."""
    tree = ast.parse(path.read_bytes())
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            node.value.value = None
    return ast.dump(tree)
