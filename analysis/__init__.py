"""What stored runs say: comparisons and figures. Imports ``coartic`` and reads records.

``coartic.analysis.load(folder)`` reads a results folder.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from coartic.analysis.study import Study, load

__all__ = ["Study", "load"]


def __getattr__(name: str) -> Any:
    """What is imported when it is asked for: not every command needs all of it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from coartic.analysis import study

    return getattr(study, name)
