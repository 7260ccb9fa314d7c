"""Draw figures of your own in the style of the figures of the report.

Write a function that calls :func:`panels`, :func:`means` or :func:`dots` and returns a Matplotlib
figure, and decorate it with ``styled``. :func:`picture` turns the figure into the bytes of a file.
``coartic.analysis.FIGURES["ranking"](study)`` draws a figure of the report.
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
