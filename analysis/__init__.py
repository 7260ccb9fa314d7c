"""Read stored runs: estimates, tests, tables, figures.

``coartic.analysis.load(folder)`` reads a results folder as a :class:`Study`.
"""

from coartic.internal.lazy import import_lazily

_MODULES = {
    "SIGNATURES": "coartic.analysis.signatures.measures",
    "Study": "coartic.analysis.study",
    "TwoContexts": "coartic.analysis.signatures.two_contexts",
    "beyond_p": "coartic.analysis.signatures.context_tests",
    "by_task": "coartic.analysis.frames",
    "check_hits": "coartic.analysis.recordings",
    "consistency": "coartic.analysis.recordings",
    "contexts_of_control": "coartic.analysis.control",
    "draw_recording": "coartic.analysis.recordings",
    "ecdf": "coartic.analysis.frames",
    "gaps": "coartic.analysis.frames",
    "hits_from_markers": "coartic.analysis.recordings",
    "interval": "coartic.analysis.words",
    "load": "coartic.analysis.study",
    "mean": "coartic.estimates",
    "mean_excess": "coartic.analysis.control",
    "means": "coartic.analysis.frames",
    "number": "coartic.analysis.words",
    "other_tasks": "coartic.analysis.statistics.instances",
    "ranking": "coartic.analysis.frames",
    "read_hits": "coartic.analysis.recordings",
    "shares": "coartic.analysis.frames",
    "solutions_of": "coartic.analysis.recordings",
    "runtimes": "coartic.analysis.sections.costs",
    "with_control": "coartic.analysis.control",
}
__all__ = [*_MODULES]

__getattr__, __dir__ = import_lazily(__name__, _MODULES)
