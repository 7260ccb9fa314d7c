"""Read stored runs: estimates, tests, tables, figures. Imports ``coartic`` and reads records.

``coartic.analysis.load(folder)`` reads a results folder as a :class:`Study`.
"""

from importlib import import_module
from typing import Any

_MODULES = {
    "SIGNATURES": "analysis.signatures.measures",
    "Study": "analysis.study",
    "TwoContexts": "analysis.signatures.two_contexts",
    "all_of": "analysis.judging",
    "beyond_p": "analysis.signatures.context_tests",
    "by_task": "analysis.frames",
    "contexts_of_control": "analysis.control",
    "control_suite": "analysis.control",
    "ecdf": "analysis.frames",
    "fill_page": "analysis.pages",
    "gaps": "analysis.frames",
    "interval": "analysis.words",
    "judge": "analysis.judging",
    "load": "analysis.study",
    "mean": "estimates",
    "mean_beyond": "analysis.judging",
    "mean_excess": "analysis.control",
    "means": "analysis.frames",
    "number": "analysis.words",
    "other_tasks": "analysis.statistics.instances",
    "ranking": "analysis.frames",
    "read_hits": "analysis.hits",
    "shares": "analysis.frames",
    "solutions_of": "analysis.frames",
    "runtimes": "analysis.sections.costs",
    "with_control": "analysis.control",
    "write_study": "analysis.pages",
}
__all__ = [*_MODULES]


def __getattr__(name: str) -> Any:
    """Import a name when it is asked for: not every command needs all of them."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"coartic.{_MODULES[name]}"), name)
