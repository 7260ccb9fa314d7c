"""The page of reward against what it costs: targets, areas, Pareto sets by task."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from analysis.markup import escaped
from analysis.report.document import Block, Bullets, DataTable, Document, Prose, Section
from analysis.report.tables.common import marked, table_ids
from analysis.report.tables.cost import (
    TARGET_SPENDS,
    areas_table,
    other_arms,
    pareto_table,
    reading_of_cost,
    targets_table,
)
from analysis.study import Study
from analysis.words import typographic


def frontier_document(study: Study) -> Document:
    """All tables of reward against cost, task by task."""
    reading = Section("reading", "How to read it", (Bullets(reading_of_cost()),))
    by_task = (_on(study, task, slug) for task, slug in table_ids(study).items())
    return Document("Reward and what it costs", (reading, *by_task), runs=study.run_ids)


def _on(study: Study, task: str, slug: str) -> Section:
    blocks: tuple[Block, ...] = optima_known(study, task), *cost_tables(study, task)
    return Section(f"on-{slug}", marked(study, task), blocks)


def cost_tables(study: Study, task: str) -> Iterator[DataTable]:
    """Targets of each optimum, areas and Pareto sets of a task, as far as there are any."""
    places = itertools.product(TARGET_SPENDS, other_arms(study, task))
    targets = (targets_table(study, task, *place) for place in places)
    return filter(None, (*targets, areas_table(study, task), pareto_table(study, task)))


def optima_known(study: Study, task: str) -> Prose:
    """What the task's tables are held to, and whether it is proven to be the best."""
    known = "; ".join(_optimum(study, task, arm) for arm in other_arms(study, task))
    return Prose((f"Optimum: {known}.",))


def _optimum(study: Study, task: str, arm: str) -> str:
    known = study.optima.get((task, arm))
    if known is None:
        return f"none is known with the other arm {arm}, so nothing is said of nearness to it"
    sure = "**not proven**: the best that was found, by search alone"
    if known.proven:
        sure = "proven"
    elif known.bound is not None:
        bound = typographic(str(known.bound))
        sure = f"**not proven**: the best that was found; none exceeds {bound}"
    said = f"{typographic(str(known.reward))} with the other arm {arm} ({sure})"
    frame = study.targets[(study.targets.task == task) & (study.targets.other_arm == arm)]
    if not len(frame) or frame.reached.any():
        return said
    # There is no table that says so.
    return f"{said}, which no run came near: {escaped(', '.join(dict.fromkeys(frame.method)))}"
