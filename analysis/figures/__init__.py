"""Figures for a paper, each a function of a :class:`~analysis.study.Study`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from analysis.figures.bars import bars
from analysis.figures.configurations import paper_configurations
from analysis.figures.context import context
from analysis.figures.frontier import frontier
from analysis.figures.learning_curves import learning_curves
from analysis.figures.plot import Plot
from analysis.figures.profiles import profiles
from analysis.figures.published import published
from analysis.figures.recruitment import recruitment
from analysis.figures.selection import known_methods
from analysis.figures.signature_matrix import signature_matrix
from analysis.figures.tasks import tasks_plot
from coartic import CoarticError

if TYPE_CHECKING:
    from analysis.study import Study


@dataclass(frozen=True)
class Figures:
    """The figures that a folder's runs allow, in the paper's order, and the others."""

    plots: tuple[Plot, ...]
    skipped: dict[str, str]
    """Why there is none, by what would have been drawn."""


def all_figures(
    study: Study, most_tasks: int | None = None, methods: Sequence[str] | None = None
) -> Figures:
    """Every figure with its default methods or ``methods``, labels with their variants.

    What lacks runs is skipped with the reason. Figures of signatures, one a task, are skipped
    where there are more than ``most_tasks``. Raises CoarticError for a method that the folder
    does not have.
    """
    if methods is not None:
        known_methods(study, methods)
    plots = [tasks_plot(list(study.results.tasks.values()))]
    drawn, skipped = paper_configurations(study, methods)
    plots += drawn
    makers: dict[str, Callable[..., Plot | list[Plot]]] = {
        "learned-reward": bars,
        "published": published,
        "learning-curves": learning_curves,
        "recruitment": recruitment,
        "context": context,
        "signatures": signature_matrix,
        "frontier": frontier,
        "profiles": profiles,
    }
    tasks = len(study.results.tasks)
    if most_tasks is not None and tasks > most_tasks:
        del makers["signatures"]
        skipped["signatures"] = f"there would be one for each of {tasks} tasks"
    for name, maker in makers.items():
        try:
            found = maker(study) if methods is None else maker(study, methods=methods)
        except CoarticError as error:
            skipped[name] = str(error)
        else:
            plots += found if isinstance(found, list) else [found]
    return Figures(tuple(plots), skipped)


__all__ = ["Figures", "Plot", "all_figures"]
