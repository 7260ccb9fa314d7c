"""Suites, the runner, and the records it keeps. Imports ``coartic`` and ``baselines``.

``coartic.benchmarks.run_suite(suite, folder)`` runs a suite (:mod:`coartic.benchmarks.runner`).
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from coartic.benchmarks.planning import plan_suite
    from coartic.benchmarks.runner import Progress, perform, run_suite

__all__ = ["Progress", "perform", "plan_suite", "run_suite"]


def __getattr__(name: str) -> Any:
    """Import a name of the API when it is first used: workers need none of it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from coartic.benchmarks import runner

    return getattr(runner, name)
