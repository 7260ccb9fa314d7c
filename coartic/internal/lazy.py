"""Packages that import a name when it is asked for: the compiler takes a while, and few need it."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from importlib import import_module
from typing import Any


def find(package: str, name: str, homes: Mapping[str, str]) -> Any:
    """Import a name of a package from its module, and keep it in the package.

    Raises AttributeError for a name that no module of ``homes`` has.
    """
    if name not in homes:
        raise AttributeError(f"module {package!r} has no attribute {name!r}")
    value = getattr(import_module(homes[name]), name)
    setattr(sys.modules[package], name, value)
    return value


def names_of(package: str, homes: Mapping[str, str]) -> list[str]:
    """Return the names of a package's API, and those that Python gives every module."""
    given = (name for name in vars(sys.modules[package]) if name.endswith("__"))
    return sorted({*homes, *given})
