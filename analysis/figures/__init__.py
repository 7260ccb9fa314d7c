"""Figures: those of the report, and what a figure of your own needs.

``FIGURES["ranking"](study)`` draws one of the report, ``save`` writes it as files. The others are
for figures of your own, which then look like these: :func:`panels` and :func:`means` draw,
:func:`picture` gives the file. Draw within ``styled``, a decorator.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from coartic.analysis.figures.plot import Plot, picture, save
    from coartic.analysis.figures.style import (
        COVERAGE,
        GREY,
        ONE,
        PALETTE,
        TWO,
        legend,
        letters,
        means,
        panels,
        styled,
    )  # fmt: skip
    from coartic.analysis.sections import FIGURES

_HOMES = {"FIGURES": "sections"} | dict.fromkeys(("Plot", "picture", "save"), "figures.plot")
__all__ = [
    "COVERAGE", "FIGURES", "GREY", "ONE", "PALETTE", "TWO", "Plot", "legend", "letters", "means",
    "panels", "picture", "save", "styled",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    """What is imported when it is asked for: not every study needs all of it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = _HOMES.get(name, "figures.style")
    return getattr(import_module(f"coartic.analysis.{home}"), name)
