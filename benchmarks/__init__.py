"""Plan, perform and record the runs of suites, on top of ``coartic`` and ``baselines``.

``coartic.benchmarks.run_suite(suite, folder)`` runs a suite (:mod:`coartic.benchmarks.runner`).
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from coartic.benchmarks.planning import plan_suite
    from coartic.benchmarks.runner import Progress, perform, run_suite

__all__ = ["Progress", "perform", "plan_suite", "run_suite"]


def __getattr__(name: str) -> Any:
    """Import a name of the API on first use; worker processes need no name of it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from coartic.benchmarks import runner

    return getattr(runner, name)
