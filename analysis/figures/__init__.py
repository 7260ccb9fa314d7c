"""The figures. Each is drawn by a function of a study, named in :data:`FIGURES` by its id.

A function raises CoarticError where the folder's runs do not allow its figure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from coartic.analysis.figures.bars import bars
from coartic.analysis.figures.configurations import PAPER, paper_configurations
from coartic.analysis.figures.context import context
from coartic.analysis.figures.families import exploration_by_family, gaps_by_family
from coartic.analysis.figures.learning_curves import learning_curves
from coartic.analysis.figures.plot import Plot, save
from coartic.analysis.figures.postures import postures
from coartic.analysis.figures.price import price
from coartic.analysis.figures.published import published
from coartic.analysis.figures.ranking import ranking
from coartic.analysis.figures.recruitment import recruitment
from coartic.analysis.figures.tasks import tasks
from coartic.analysis.study import Study

FIGURES: Mapping[str, Callable[[Study], Plot]] = {
    "tasks": tasks,
    "postures": postures,
    "published": published,
    "learned-reward": bars,
    "recruitment": recruitment,
    "learning-curves": learning_curves,
    "ranking": ranking,
    "price": price,
    "context": context,
    "gaps-by-family": gaps_by_family,
    "exploration-by-family": exploration_by_family,
    **{name: partial(paper_configurations, name) for name in PAPER},
}
"""Every figure by its id."""

__all__ = ["FIGURES", "Plot", "save"]
