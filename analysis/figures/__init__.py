"""Figures of your own, which look like those of the report.

:func:`panels` and :func:`means` draw within ``styled``, a decorator; :func:`picture` gives the
file. ``coartic.analysis.sections.FIGURES["ranking"](study)`` draws a figure of the report.
"""

from coartic.analysis.figures.plot import Plot, picture
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
)

__all__ = [
    "COVERAGE", "GREY", "ONE", "PALETTE", "TWO", "Plot", "legend", "letters", "means", "panels",
    "picture", "styled",
]  # fmt: skip
