"""Read stored runs: estimates, tests, tables, figures. Imports ``coartic`` and reads records.

``coartic.analysis.load(folder)`` reads a results folder as a :class:`Study`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from coartic.analysis.claims.judging import all_of, judge, mean_beyond
    from coartic.analysis.frames import ecdf, gaps, means, ranking
    from coartic.analysis.pages import fill_page, write_study
    from coartic.analysis.signatures.context_tests import beyond_p
    from coartic.analysis.signatures.measures import SIGNATURES
    from coartic.analysis.signatures.two_contexts import TwoContexts
    from coartic.analysis.statistics.instances import other_tasks
    from coartic.analysis.study import Study, load
    from coartic.analysis.topics.costs import runtimes
    from coartic.analysis.words import interval
    from coartic.estimates import mean

__all__ = [
    "SIGNATURES", "Study", "TwoContexts", "all_of", "beyond_p", "ecdf", "fill_page", "gaps",
    "interval", "judge", "load", "mean", "mean_beyond", "means", "other_tasks", "ranking",
    "runtimes", "write_study",
]  # fmt: skip

_HOMES = {
    "analysis.claims.judging": ("all_of", "judge", "mean_beyond"),
    "analysis.frames": ("ecdf", "gaps", "means", "ranking"),
    "analysis.pages": ("fill_page", "write_study"),
    "analysis.topics.costs": ("runtimes",),
    "analysis.signatures.context_tests": ("beyond_p",),
    "analysis.signatures.measures": ("SIGNATURES",),
    "analysis.signatures.two_contexts": ("TwoContexts",),
    "estimates": ("mean",),
    "analysis.statistics.instances": ("other_tasks",),
    "analysis.study": ("Study", "load"),
    "analysis.words": ("interval",),
}


def __getattr__(name: str) -> Any:
    """Import a name when it is asked for: not every command needs all of them."""
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"coartic.{home}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
