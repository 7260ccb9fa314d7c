"""The tables of the report, each a function of a study: ``tables.ranking(study)``.

``TABLES`` has them by their ids. Topics define them (:mod:`coartic.analysis.table`).
"""

from typing import Any

from coartic.analysis.report.contents import TABLES

__all__ = ["TABLES"]


def __getattr__(name: str) -> Any:
    """A table by its id, with underscores in place of dashes."""
    if (table := TABLES.get(name.replace("_", "-"))) is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return table
