"""Plan, perform and store the runs of suites.

``coartic.benchmarks.run_suite(suite, folder)`` plans the runs of a suite, and performs the runs
that a results folder lacks (:mod:`coartic.benchmarks.runner`).
"""

from typing import TYPE_CHECKING

from coartic.internal.lazy import import_lazily

if TYPE_CHECKING:
    from coartic.benchmarks.planning import plan_suite
    from coartic.benchmarks.runner import Progress, perform, run_suite

__all__ = ["Progress", "perform", "plan_suite", "run_suite"]

_RUNNER = dict.fromkeys(("Progress", "perform", "run_suite"), "coartic.benchmarks.runner")
__getattr__, __dir__ = import_lazily(
    __name__, _RUNNER | {"plan_suite": "coartic.benchmarks.planning"}
)
