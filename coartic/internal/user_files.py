"""Import Python files of the user from their source, and ignore stored bytecode."""

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
    """Return whether a module belongs to the user and was loaded from a file.

    A module belongs to the user if it is not a part of coartic or of the standard library, and is
    not in a folder of installed packages, such as ``site-packages``.

    Parameters
    ----------
    module : str
        Name of the module.
    path : Path
        Resolved path of the file of the module.
    """
    return (
        module.partition(".")[0] != "coartic"
        and path.is_file()
        and not _PACKAGES & {*path.parts}
        and not any(path.is_relative_to(folder) for folder in _library_folders())
    )


def import_from(folder: Path) -> None:
    """Prepare this process to import modules from a folder with files of the user.

    - *Search path.* The folder becomes the first entry of ``sys.path``, like the folder of a
      program. If the root of a checkout of coartic is in ``sys.path``, it becomes the last entry,
      because its subfolders have common names, such as ``analysis`` and ``tests``.
    - *Bytecode.* From then on, modules of the user are compiled from their source, and their
      bytecode is not stored. Python itself would use stored bytecode if the size and the time stamp
      of the source have not changed, and a changed file from an archive can have both unchanged.
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
