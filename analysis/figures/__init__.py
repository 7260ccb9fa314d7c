"""The figures of the report, each a function of a study: ``FIGURES["ranking"](study)``.

``save`` writes one as files. Topics draw them; what they share is in this package: looks, files,
and films of the robot.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from coartic.analysis.figures.plot import FIGURES, Plot, save

__all__ = ["FIGURES", "Plot", "save"]


def __getattr__(name: str) -> Any:
    """What is asked for, once every topic has named its figures."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    import_module("coartic.analysis.report.contents")
    return getattr(import_module("coartic.analysis.figures.plot"), name)
