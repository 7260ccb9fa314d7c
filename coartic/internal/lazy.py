"""Import the modules that define a package's names at first use.

Numba and some other libraries are slow to import, and most commands do not need them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def import_lazily(
    package: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Make the functions ``__getattr__`` and ``__dir__`` of a package that imports lazily.

    Parameters
    ----------
    package : str
        Name of the package, which is being imported.
    homes : mapping of str to str
        Dict that maps each public name of the package to the module from which it is imported.

    Returns
    -------
    callable
        Function ``__getattr__``. It imports the module of a name, and returns the object with this
        name. It raises AttributeError for a name that is not in ``homes``.
    callable
        Function ``__dir__``. It returns a sorted list of the names in ``homes``, and of those names
        of the package that end with two underscores.
    """
    module = sys.modules[package]

    def find(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(homes[name]), name)
        setattr(module, name, value)
        return value

    def names() -> list[str]:
        return sorted({*homes, *(name for name in vars(module) if name.endswith("__"))})

    return find, names
