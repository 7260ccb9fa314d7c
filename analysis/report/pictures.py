"""The pictures of a report, made beside its tables: most of the time that a report takes."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from joblib import Parallel, delayed, effective_n_jobs

from coartic.analysis.figures import Figures
from coartic.analysis.figures.plot import Plot, rendered, svg_text
from coartic.analysis.figures.register import SECTIONS, Section


class Picture(NamedTuple):
    """One figure in all its forms."""

    svg: str
    """For the page."""
    narrow: str
    """For a narrow page; empty where the first will do."""
    files: dict[str, bytes]
    """By name."""


class Pictures:
    """Of all figures, in the order of a report; ``processes`` make them while all else is made.

    With one, each is made when it is asked for.
    """

    def __init__(self, figures: Figures, formats: Sequence[str], processes: int) -> None:
        self.sections: dict[Section, list[Plot]] = {}
        self._made: dict[str, Picture] = {}
        # What is drawn is handed on at once, so that pictures of it are made meanwhile.
        work: Iterable[Any] = (
            delayed(_pictured)(*plots, tuple(formats)) for plots in self._drawn(figures)
        )
        if effective_n_jobs(processes) == 1:  # then none is begun before it is asked for
            work = list(work)
        made = Parallel(n_jobs=processes, return_as="generator", pre_dispatch="all")(work)
        self.plots = tuple(itertools.chain.from_iterable(self.sections.values()))
        self.like_the_paper = figures.like_the_paper
        self._coming = zip((plot.id for plot in self.plots), made, strict=True)

    def _drawn(self, figures: Figures) -> Iterator[tuple[Plot, Plot | None]]:
        """Every figure, and as it is on a narrow page where it is another there."""
        for name in SECTIONS:
            self.sections[name] = figures.of_section(name)
            narrow = figures.for_a_phone(name)
            yield from ((plot, narrow.get(plot.id)) for plot in self.sections[name])

    def __getitem__(self, name: str) -> Picture:
        """The figure's by its id, when it is made."""
        if name not in {plot.id for plot in self.plots}:
            raise KeyError(f"no figure {name!r}")
        while name not in self._made:
            done, picture = next(self._coming)
            self._made[done] = picture
        return self._made[name]

    def files(self) -> dict[str, bytes]:
        """Of all figures, by name."""
        return {name: data for plot in self.plots for name, data in self[plot.id].files.items()}


def _pictured(plot: Plot, narrow: Plot | None, formats: tuple[str, ...]) -> Picture:
    small = "" if narrow is None else svg_text(narrow)
    return Picture(svg_text(plot), small, rendered(plot, endings=formats))
