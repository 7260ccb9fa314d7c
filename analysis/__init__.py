"""Read stored runs, and compute estimates, tests, tables and figures from them.

``coartic.analysis.load(folder)`` reads a results folder as a :class:`Study`.
"""

from typing import Any

from coartic.internal.lazy import import_lazily

_MODULES = {
    "FIGURES": "coartic.analysis.figures.drawings",
    "SIGNATURES": "coartic.analysis.signatures",
    "TABLES": "coartic.analysis.tables",
    "Study": "coartic.analysis.study",
    "TwoContexts": "coartic.analysis.signatures",
    "beyond_p": "coartic.analysis.signatures",
    "by_task": "coartic.analysis.frames",
    "check_hits": "coartic.analysis.recordings",
    "consistency": "coartic.analysis.recordings",
    "contexts_of_control": "coartic.analysis.control",
    "contrast": "coartic.analysis.study",
    "ecdf": "coartic.analysis.running_times",
    "figure": "coartic.analysis.figures.plot",
    "interval": "coartic.analysis.words",
    "lean": "coartic.analysis.signatures",
    "load": "coartic.analysis.study",
    "mean": "coartic.estimates",
    "mean_excess": "coartic.analysis.control",
    "means": "coartic.analysis.frames",
    "number": "coartic.analysis.words",
    "other_tasks": "coartic.analysis.statistics",
    "ranking": "coartic.analysis.frames",
    "read_hits": "coartic.analysis.recordings",
    "shares": "coartic.analysis.frames",
    "solutions_of": "coartic.analysis.recordings",
    "table": "coartic.analysis.tables",
    "runtimes": "coartic.analysis.running_times",
    "with_control": "coartic.analysis.control",
}
_CHECKED = {
    *("beyond_p", "contexts_of_control", "interval", "mean", "mean_excess", "number"),
    *("other_tasks", "with_control"),
}
__all__ = [*_MODULES]

_import, __dir__ = import_lazily(__name__, _MODULES)


def __getattr__(name: str) -> Any:
    """Import an attribute of the package when it is first used, and return it.

    A function named in :data:`_CHECKED` is wrapped, so that it checks the types and limits of its
    arguments. Modules inside the package import the same function without this check, from its own
    module (:data:`_MODULES`). Raises AttributeError for an unknown name.
    """
    value = _import(name)
    if name in _CHECKED:
        from coartic.internal.arguments import checked_arguments

        value = globals()[name] = checked_arguments(value)
    return value
