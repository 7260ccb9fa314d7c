"""A section of the page: a heading that asks, a finding, a picture, a table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from coartic.analysis.study import Study


@dataclass(frozen=True)
class Section:
    """One section of the page. It is left out where the runs allow neither figure nor table."""

    id: str
    short: str
    """Name among the contents."""
    title: str
    caption: str = ""
    """Caption of the table."""
    finding: Callable[[Study], str] | None = None
    """Sentence that says what was found; empty where the runs say nothing."""
    figure: str = ""
    """Id of the picture."""
    table: str = ""
    """Id of the table."""
    note: str = ""
    """What a reader must know to read picture and table."""
    single: bool = False
    """Whether it is about single tasks: left out for many random ones."""
