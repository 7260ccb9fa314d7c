"""The sections of the page in its order, and every table and figure of the report.

To add a topic, name its section here. A table that no section shows is a CSV file beside the page.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import walk_packages

from coartic.analysis import topics
from coartic.analysis.figures.plot import FIGURES
from coartic.analysis.section import Section
from coartic.analysis.table import TABLES
from coartic.analysis.topics import (
    settings,
    tasks,
)
from coartic.analysis.topics.coarticulation import sentences as coarticulation
from coartic.analysis.topics.comparison import sentences as comparison
from coartic.analysis.topics.families import sentences as families
from coartic.analysis.topics.paper import sentences as paper

for _module in walk_packages(topics.__path__, f"{topics.__name__}."):
    import_module(_module.name)  # its tables and figures

__all__ = ["FIGURES", "SECTIONS", "TABLES"]

SECTIONS: tuple[Section, ...] = (
    settings.SETTINGS,
    coarticulation.COARTICULATION,
    paper.PUBLISHED,
    paper.CLAIMS,
    comparison.NEAREST,
    comparison.RUNTIMES,
    paper.HANDS,
    comparison.LEARNING,
    coarticulation.SIGNATURES,
    families.FAMILIES,
    families.EXPLORATION,
    families.SIGNS,
    tasks.TASKS,
    comparison.METHODS,
)
