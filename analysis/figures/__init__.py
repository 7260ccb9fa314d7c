"""Figures for a paper, each a function of a :class:`~coartic.analysis.study.Study`."""

from coartic.analysis.figures.plot import Plot
from coartic.analysis.figures.register import REGISTER, FigureEntry, Figures

__all__ = ["REGISTER", "FigureEntry", "Figures", "Plot"]
