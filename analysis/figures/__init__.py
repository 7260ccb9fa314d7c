"""Figures of your own, which look like the figures of the report.

:func:`panels`, :func:`means` and :func:`dots` draw in a function with the decorator ``styled``;
:func:`picture` returns the bytes of a file. ``coartic.analysis.FIGURES["ranking"](study)`` draws a
figure of the report.
"""

from coartic.analysis.figures.plot import Plot, picture
from coartic.analysis.figures.style import (
    COVERAGE,
    GREY,
    ONE,
    PALETTE,
    TWO,
    dots,
    legend,
    letters,
    look_of,
    means,
    panels,
    styled,
)

__all__ = [
    "COVERAGE", "GREY", "ONE", "PALETTE", "TWO", "Plot", "dots", "legend", "letters", "look_of",
    "means", "panels", "picture", "styled",
]  # fmt: skip
