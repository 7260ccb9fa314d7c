"""Import the names of a package on first use.

The compiler is slow to import, and most commands do not need it.
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
        Name of the package.
    homes : mapping
        Maps each name to the module that defines it.

    Returns
    -------
    callable
        ``__getattr__``; it raises AttributeError for names that are not in ``homes``.
    callable
        ``__dir__``.
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
