"""All figures: how each is drawn, and which section of a report shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Literal, NamedTuple, get_args

from matplotlib.figure import Figure

from coartic import CoarticError
from coartic.analysis.figures import style
from coartic.analysis.figures.bars import bars
from coartic.analysis.figures.configurations import PAPER, paper_configurations
from coartic.analysis.figures.context import context
from coartic.analysis.figures.families import exploration_by_family, gaps_by_family
from coartic.analysis.figures.frontier import frontier
from coartic.analysis.figures.learning_curves import learning_curves
from coartic.analysis.figures.plot import Plot
from coartic.analysis.figures.postures import postures
from coartic.analysis.figures.price import price
from coartic.analysis.figures.profiles import profiles
from coartic.analysis.figures.published import published
from coartic.analysis.figures.ranking import ranking
from coartic.analysis.figures.recruitment import recruitment
from coartic.analysis.figures.selection import known_methods
from coartic.analysis.figures.signature_matrix import signature_matrix
from coartic.analysis.figures.tasks import tasks_of
from coartic.analysis.generality.sample import one_by_one
from coartic.analysis.study import Study
from coartic.text import did_you_mean

Section = Literal[
    "answers",
    "families",
    "tasks-drawn",
    "paper",
    "movements",
    "learning",
    "methods",
    "cost",
    "coarticulation",
]
"""Of a report that shows figures, by id."""
SECTIONS: tuple[Section, ...] = get_args(Section)
"""In the order of a report."""


class FigureEntry(NamedTuple):
    """One row of the register."""

    name: str
    """Id of the figure, or what the ids of several begin with."""
    draw: Callable[..., Plot | list[Plot]]
    """Of a study and, by keyword, ``methods``: labels to show in place of its own choice.

    Raises CoarticError where the runs do not allow it.
    """
    section: Section
    paper: str = ""
    """Figure of the paper that it is like."""
    by_task: bool = False
    """Whether there is one for each task, which may be too many."""
    narrows: bool = True
    """Whether it is drawn one column wide as well: where it can be read so, and no chart is shown
    in its place."""


REGISTER = (
    FigureEntry("tasks", tasks_of, "tasks-drawn", "Figure 4"),
    *(
        FigureEntry(name, partial(paper_configurations, name), "movements", figure)
        for name, (figure, _) in PAPER.items()
    ),
    FigureEntry("learned-reward", bars, "paper", "Figure 8"),
    FigureEntry("published", published, "paper"),
    FigureEntry("learning-curves", learning_curves, "learning"),
    FigureEntry("recruitment", recruitment, "paper"),
    FigureEntry("gaps-by-family", gaps_by_family, "families"),
    FigureEntry("exploration-by-family", exploration_by_family, "families"),
    FigureEntry("context", context, "coarticulation"),
    FigureEntry("signatures", signature_matrix, "coarticulation", by_task=True, narrows=False),
    FigureEntry("frontier", frontier, "cost"),
    FigureEntry("profiles", profiles, "methods"),
    FigureEntry("postures", postures, "answers"),
    FigureEntry("ranking", ranking, "answers", narrows=False),
    FigureEntry("price", price, "answers", narrows=False),
)
"""The paper's figures in its order, and the others."""


class Figures(Mapping[str, Figure]):
    """The figures that a folder's runs allow, by id; each is drawn when it is asked for."""

    def __init__(
        self,
        study: Study,
        methods: Sequence[str] | None = None,
        most_tasks: int | None = None,
    ) -> None:
        """Figures of ``methods``, labels with their variants, or of each figure's default.

        Those that there is one of for each task are skipped where there are more than
        ``most_tasks``. Raises CoarticError for a method that the folder does not have.
        """
        if methods is not None:
            known_methods(study, methods)
        self._study, self._methods, self._most = study, methods, most_tasks
        self._drawn: dict[str, list[Plot] | CoarticError] = {}

    @property
    def plots(self) -> list[Plot]:
        """All figures with their words and numbers."""
        return [plot for entry in REGISTER for plot in self._of(entry)]

    @property
    def skipped(self) -> dict[str, str]:
        """Why there is none, by what would have been drawn."""
        self.plots  # noqa: B018
        drawn = self._drawn.items()
        return {name: str(why) for name, why in drawn if isinstance(why, CoarticError)}

    def of_section(self, section: str) -> list[Plot]:
        """Figures of one section of a report."""
        return [plot for e in REGISTER if e.section == section for plot in self._of(e)]

    def for_a_phone(self, section: str) -> dict[str, Plot]:
        """Figures of one section that are wider than a column, drawn one column wide, by id."""
        found: dict[str, Plot] = {}
        for entry in REGISTER:
            plots = self._of(entry) if entry.narrows and entry.section == section else []
            if any(plot.figure.get_figwidth() > style.ONE for plot in plots):
                with style.on_a_phone():
                    drawn = entry.draw(self._study, methods=self._methods)
                narrow = drawn if isinstance(drawn, list) else [drawn]
                found |= {plot.id: replace(plot, id=f"{plot.id}-narrow") for plot in narrow}
        return found

    @property
    def like_the_paper(self) -> dict[str, str]:
        """Ids by the figures of the paper that they are like."""
        return {entry.paper: entry.name for entry in REGISTER if entry.paper and self._of(entry)}

    def plot(self, name: str) -> Plot:
        """A figure with its words and numbers, by its id; KeyError where there is none."""
        for entry in REGISTER:
            if str(name).startswith(entry.name):
                found = self._found(entry)
                if isinstance(found, CoarticError):
                    raise KeyError(f"no figure {name!r}: {found}")
                for plot in found:
                    if plot.id == name:
                        return plot
        hint = did_you_mean(str(name), self) or f"; there are {', '.join(self)}"
        raise KeyError(f"no figure {name!r}{hint}")

    def __repr__(self) -> str:
        return f"Figures by id, of {self._study!r}"

    def __getitem__(self, name: str) -> Figure:
        """The figure alone."""
        return self.plot(name).figure

    def __iter__(self) -> Iterator[str]:
        """Ids, in the order of the register."""
        return iter([plot.id for plot in self.plots])

    def __len__(self) -> int:
        """How many there are."""
        return len(self.plots)

    def _of(self, entry: FigureEntry) -> list[Plot]:
        found = self._found(entry)
        return [] if isinstance(found, CoarticError) else found

    def _found(self, entry: FigureEntry) -> list[Plot] | CoarticError:
        """The figures of a row, drawn once, or why there are none."""
        if entry.section == "families" and self._study.instances is None:
            return []  # nothing that is missed
        if entry.name not in self._drawn:
            tasks = len(self._study.tasks)
            together = tasks - len(one_by_one(self._study))
            try:
                if together and self._most is not None and entry.section != "families":
                    raise CoarticError(f"{together} instances of families are shown together")
                if entry.by_task and self._most is not None and tasks > self._most:
                    raise CoarticError(f"there would be one for each of {tasks} tasks")
                found = entry.draw(self._study, methods=self._methods)
                self._drawn[entry.name] = found if isinstance(found, list) else [found]
            except CoarticError as error:
                self._drawn[entry.name] = error
        return self._drawn[entry.name]
