"""Plan, perform and record the runs of suites, on top of ``coartic`` and ``baselines``.

``coartic.benchmarks.run_suite(suite, folder)`` runs a suite (:mod:`coartic.benchmarks.runner`).
"""

from typing import TYPE_CHECKING, Any

from coartic.internal.lazy import find, names_of

if TYPE_CHECKING:
    from coartic.benchmarks.planning import plan_suite
    from coartic.benchmarks.runner import Progress, perform, run_suite

_MODULES = {
    "Progress": "coartic.benchmarks.runner",
    "perform": "coartic.benchmarks.runner",
    "plan_suite": "coartic.benchmarks.planning",
    "run_suite": "coartic.benchmarks.runner",
}
__all__ = ["Progress", "perform", "plan_suite", "run_suite"]


def __getattr__(name: str) -> Any:
    """Import a name of the API on first use; worker processes need no name of it."""
    return find(__name__, name, _MODULES)


def __dir__() -> list[str]:
    """The names of the API."""
    return names_of(__name__, _MODULES)
