"""Figures for a paper, each a function of a :class:`~analysis.study.Study`."""

from analysis.figures.plot import Plot
from analysis.figures.register import REGISTER, Entry, Figures

__all__ = ["REGISTER", "Entry", "Figures", "Plot"]
