"""Hash the code that a result comes from, as syntax trees.

The hash covers the file of the method, the session, the execution of solutions, and the modules
that these import from the folder or package of the method and from coartic. Comments, docstrings,
imports for type checkers, ``__version__``, the place of a file and the version of Python do not
count: a changed number makes a result stale, a better sentence or a release does not.
"""

from __future__ import annotations

import ast
import hashlib
import os
import re
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import coartic
from coartic.benchmarks.syntax import statements_in, text_of
from coartic.motion.compile import PACKAGE

_API = PACKAGE / "__init__.py"
"""Module that imports nothing before a name is used: a name counts in the module that defines
it."""
_EVERY_RUN = PACKAGE / "method.py", PACKAGE / "motion" / "solution.py"
_AROUND = tuple(Path(__file__).with_name(name) for name in ("worker.py", "scoring.py"))
"""Modules that perform and score a run. Of their imports, only the modules above change results."""


def code_of(method: Path, data: tuple[Path, ...] = ()) -> str:
    """Return the hash, 12 hexadecimal digits, of the code of a method in a file, and of the data
    files that the method reads. Raises OSError for a file that cannot be read, SyntaxError or
    ValueError for one that is no Python."""
    modules = [path.read_bytes() for path in [*files_of(method), *_AROUND]]
    content = sorted(syntax(text)[0].encode() for text in modules)
    content += [path.read_bytes() for path in data]
    return hashlib.sha256(b"".join(content)).hexdigest()[:12]


def files_of(method: Path) -> set[Path]:
    """Return the file of a method and all other files that its runs execute, of its folder or
    package and of coartic; other packages do not count."""
    root = next(folder for folder in method.parents if not (folder / "__init__.py").exists())
    within = root if "site-packages" not in root.parts else root / method.relative_to(root).parts[0]
    places = {(root, within)}
    if within != PACKAGE.parent:  # which has the package in it
        places.add((PACKAGE.parent, PACKAGE))
    files, waiting = set[Path](), [method, *_EVERY_RUN]
    while waiting:
        if (path := waiting.pop()) not in files:
            files.add(path)
            waiting += _imported_files(path, places)
    return files


def _imported_files(path: Path, places: Iterable[tuple[Path, Path]]) -> Iterator[Path]:
    """Yield the files that a module imports, and the ``__init__.py`` of the packages around them,
    except coartic's; a file can come twice. A pair of ``places`` is a root of imports and the
    folder in which files count."""
    for level, module, names in syntax(path.read_bytes())[1]:
        for root, within in places:
            base = os.path.join(path.parents[level - 1] if level else root, *module.split("."))
            for name in names:
                place = os.path.join(base, *name.split(".")).rstrip(os.sep)
                found = filter(os.path.isfile, (f"{place}.py", f"{place}/__init__.py"))
                for file in map(Path, found):
                    if within in file.parents and file != _API:
                        yield file
                        if root != PACKAGE.parent:
                            around = [p / "__init__.py" for p in file.parents if root in p.parents]
                            yield from filter(Path.is_file, around)


@cache
def syntax(content: bytes) -> tuple[str, tuple[tuple[int, str, tuple[str, ...]], ...]]:
    """Return the code of a module as text (:mod:`coartic.benchmarks.syntax`), and its imports:
    level (0 for an absolute import), module and names; the name ``""`` is the module itself. Raises
    SyntaxError or ValueError for content that is no Python."""
    tree, imports = ast.parse(content), []
    for node in statements_in(tree):
        of_api = list[str]()
        if isinstance(node, ast.Import):
            names = tuple(alias.name for alias in node.names)
            imports.append((0, "", names))
            if "coartic" in names:
                of_api = re.findall(r"\bcoartic\.(\w+)", content.decode(errors="replace"))
        elif isinstance(node, ast.ImportFrom):
            names = tuple(alias.name for alias in node.names)
            imports.append((node.level, node.module or "", ("", *names)))
            if node.module == "coartic" and not node.level:
                of_api = [*names]
        homes = {coartic.HOME[name] for name in of_api if name in coartic.HOME}
        imports += [(0, home, ("",)) for home in homes]
    return text_of(tree), tuple(imports)
