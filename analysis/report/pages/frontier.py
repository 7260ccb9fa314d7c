"""The page of reward against what it costs: targets, areas, Pareto sets by task."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from analysis.markup import escaped
from analysis.report.document import Bullets, DataTable, Document, Prose, Section
from analysis.report.legends import with_legends
from analysis.report.tables.common import marked, table_ids
from analysis.report.tables.cost import (
    READING_OF_COST,
    TARGET_SPENDS,
    areas_table,
    other_arms,
    pareto_table,
    targets_table,
)
from analysis.words import typographic

if TYPE_CHECKING:
    from analysis.study import Study


def frontier_document(study: Study) -> Document:
    """All tables of reward against cost, task by task."""
    sections = [
        Section(
            f"on-{slug}",
            marked(study, task),
            (optima_known(study, task), *cost_tables(study, task)),
        )
        for task, slug in table_ids(study).items()
    ]
    return Document(
        "Reward and what it costs",
        (Section("reading", "How to read it", (Bullets(READING_OF_COST),)), *sections),
        runs={key: tuple(map(str, cell.runs.run_id)) for key, cell in study.cells.items()},
    )


def cost_tables(study: Study, task: str) -> Iterator[DataTable]:
    """Targets of each optimum, areas and Pareto sets of a task, as far as there are any."""
    tables: list[DataTable | None] = [
        targets_table(study, task, spend, arm)
        for spend in TARGET_SPENDS
        for arm in other_arms(study, task)
    ]
    tables += [areas_table(study, task), pareto_table(study, task)]
    yield from (with_legends(table) for table in tables if table is not None)


def optima_known(study: Study, task: str) -> Prose:
    """What the task's tables are held to, and whether it is proven to be the best."""
    known = "; ".join(_optimum(study, task, arm) for arm in other_arms(study, task))
    return Prose((f"Optimum: {known}.",))


def _optimum(study: Study, task: str, arm: str) -> str:
    known = study.optima.get((task, arm))
    if known is None:
        return f"none is known with the other arm {arm}, so nothing is said of nearness to it"
    best = typographic(str(known.reward))
    if known.proven:
        sure = "proven"
    elif known.bound is None:
        sure = "**not proven**: the best that was found, by search alone"
    else:
        bound = typographic(str(known.bound))
        sure = f"**not proven**: the best that was found; none exceeds {bound}"
    return f"{best} with the other arm {arm} ({sure})" + _nobody(study, task, arm)


def _nobody(study: Study, task: str, arm: str) -> str:
    """Where no run came near there is no table that says so."""
    frame = study.targets[(study.targets.task == task) & (study.targets.other_arm == arm)]
    if not len(frame) or frame.reached.any():
        return ""
    names = ", ".join(dict.fromkeys(frame.method))
    return f", which no run came near: {escaped(names)}"
