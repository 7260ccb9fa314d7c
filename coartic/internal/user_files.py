"""Import the user's Python files from their source, whatever bytecode there is."""

from __future__ import annotations

import site
import sys
import sysconfig
from functools import cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType

import coartic

_PACKAGES = {"site-packages", "dist-packages"}
_cached_code = SourceFileLoader.get_code


@cache
def _library_folders() -> tuple[Path, ...]:
    folders = [sysconfig.get_path("stdlib"), sysconfig.get_path("platstdlib")]
    folders += [*site.getsitepackages(), site.getusersitepackages()]
    return tuple(Path(folder).resolve() for folder in folders)


def is_users(module: str, path: Path) -> bool:
    """Return whether a module is the user's, and was loaded from a file.

    That is a file which does not belong to this project, the standard library or an installed
    package. ``path`` is the resolved path of the file of ``module``.
    """
    return (
        module.partition(".")[0] != "coartic"
        and path.is_file()
        and not _PACKAGES & {*path.parts}
        and not any(path.is_relative_to(folder) for folder in _library_folders())
    )


def import_from(folder: Path) -> None:
    """Prepare this process for the modules of a folder with the user's files.

    - The folder comes first in ``sys.path``, as that of a program does. If coartic runs in a
      checkout, the root of the checkout comes last, because it has folders with common names, such
      as ``analysis`` and ``tests``.
    - Modules of the user are compiled from their source. Python takes bytecode of a file for
      current if size and time stamp are the same, which is so of some files from archives and of
      files that were copied with their time stamps. No bytecode of the user's files is written.
    """
    sys.path.insert(0, str(folder))
    root = Path(coartic.__file__).parents[1]
    if root.name not in _PACKAGES and str(root) in sys.path[1:]:
        sys.path.remove(str(root))
        sys.path.append(str(root))
    SourceFileLoader.get_code = _code_of  # type: ignore[assignment, method-assign]


def _code_of(loader: SourceFileLoader, module: str) -> CodeType | None:
    path = loader.get_filename(module)
    if is_users(module, Path(path).resolve()):
        return loader.source_to_code(loader.get_data(path), path)
    return _cached_code(loader, module)
