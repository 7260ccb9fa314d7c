"""The page of reward against what it costs: targets, areas, Pareto sets by task."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import pandas as pd

from coartic.analysis.comparisons.areas import Area
from coartic.analysis.comparisons.pareto import TIME_TOLERANCE
from coartic.analysis.comparisons.progress import LABELS, SPENDS
from coartic.analysis.comparisons.targets import Target
from coartic.analysis.markup import escaped
from coartic.analysis.report.document import (
    Block,
    Bullets,
    Column,
    DataTable,
    Document,
    Estimate,
    Prose,
    Row,
    Section,
    Value,
)
from coartic.analysis.report.tables.common import marked, table_ids
from coartic.analysis.report.tables.layout import LAYOUTS, finite, with_interval
from coartic.analysis.results.optima import ARMS, OtherArm
from coartic.analysis.study import Study
from coartic.analysis.words import typographic
from coartic.record import SEARCH

TARGET_SPENDS = ("trials", "forward_kinematics")
"""Spends whose targets have tables; ``targets.csv`` has all."""
SOMETIMES = 0.05
"""Share of resamples in which a method that has a row is on some front."""
_number = partial(Column, kind="number", rests_on=("runs",))
_of_optimum = partial(Column, kind="number", rests_on=("runs", "optimum"))
_IN_ID = {"forward_kinematics": ["kinematics"], "still": ["still"]}
"""What ids of tables say of a spend and an arm, but for the first of them."""
_TARGETS, _AREAS, _PARETO = (LAYOUTS[name] for name in ("targets", "areas", "pareto"))


def frontier_document(study: Study) -> Document:
    """All tables of reward against cost, task by task."""
    sections = [Section("reading", "How to read it", (Bullets(reading_of_cost()),))]
    for task, slug in table_ids(study).items():
        blocks: tuple[Block, ...] = optima_known(study, task), *cost_tables(study, task)
        sections.append(Section(f"on-{slug}", marked(study, task), blocks))
    return Document("Reward and what it costs", tuple(sections), runs=study.run_ids)


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


def reading_of_cost() -> tuple[str, ...]:
    """What is behind the tables of this module."""
    pareto = _PARETO.reading_with(tolerance=100 * TIME_TOLERANCE)
    return (*_TARGETS.reading_with(), *_AREAS.reading_with(), *pareto)


def other_arms(study: Study, task: str) -> tuple[OtherArm, ...]:
    """The optima that a task has: with one arm there is none to keep still."""
    return ARMS if len(study.tasks[task].hands) > 1 else ARMS[:1]


def targets_table(
    study: Study, task: str, spend: str = "trials", other_arm: OtherArm = "free"
) -> DataTable | None:
    """Spend to come near an optimum, the method that does so most often on top."""
    frame = _of_methods(study.targets, task)
    frame = frame[(frame.spend == spend) & (frame.other_arm == other_arm)]
    methods = {
        str(name): [Target(*row) for row in own.itertuples(index=False, name=None)]
        for name, own in frame.groupby("method", sort=False)
    }
    near = [rows for rows in methods.values() if any(row.reached for row in rows)]
    if not near:
        return None
    never = escaped(", ".join(name for name, rows in methods.items() if rows not in near))
    layout = _TARGETS.plus(_within(near[0], spend, other_arm))
    return layout.table(
        map(_target_row, sorted(near, key=_nearness)),
        *(table_ids(study)[task], *_IN_ID.get(spend, []), *_IN_ID.get(other_arm, [])),
        spend=LABELS[spend].capitalize(),
        task=escaped(task),
        other_arm=other_arm,
        planners=" Planners need no trials." if spend == "trials" else "",
        never=f" Never within {100 * near[0][0].share:.0f} %: {never}." if never else "",
    )


def _within(targets: list[Target], spend: str, other_arm: OtherArm) -> Iterator[Column]:
    """Of each share two columns: runs that came so near, and what it took; then the horizon."""
    for target in targets:
        name = f"within_{target.share:.0%}".rstrip("%")
        head = f"within {100 * target.share:.0f} %: {typographic(str(target.target))}"
        ends = target in (targets[0], targets[-1])
        column = partial(_of_optimum, other_arm=other_arm, printed=ends)
        yield column(f"{name}_reached", head, kind="text")
        yield column(name, f"median {LABELS[spend]}", digits=0)
    yield _number("horizon", "horizon", digits=0, printed=False)


def _target_row(targets: list[Target]) -> Row:
    """A method's, the widest share first."""
    values: list[Value] = [targets[0].method]
    for target in targets:
        values += [f"{target.reached}/{target.runs}", _median(target)]
    horizon = targets[0].horizon
    values.append(horizon if math.isfinite(horizon) else None)
    return Row(targets[0].method, tuple(values), ((targets[0].task, targets[0].method),))


def _median(target: Target) -> Value:
    """Infinite where fewer than half came near within the horizon; None where none ever did."""
    if not target.reached:
        return None
    bounded = target.runs > 1 and math.isfinite(target.low)
    if not bounded and math.isfinite(target.median):
        return target.median
    low, high = (target.low, target.high) if bounded else (None, None)
    beyond = target.horizon if math.isfinite(target.horizon) else None
    return Estimate(target.median, low=low, high=high, beyond=beyond)


def _nearness(targets: list[Target]) -> tuple[float, ...]:
    """Sorts methods best first: shares of runs from the nearest target on, then medians."""
    nearest = targets[::-1]
    return (*(-t.reached / t.runs for t in nearest), *(t.median for t in nearest))


def areas_table(study: Study, task: str) -> DataTable | None:
    """Area under the anytime curve over every spend and of every optimum, the best first."""
    frame = _of_methods(study.areas, task)
    arms = [arm for arm in other_arms(study, task) if (frame.other_arm == arm).any()]
    spends = [spend for spend in SPENDS if (frame.spend == spend).any()]
    places = [(arm, spend) for arm in arms for spend in spends]
    areas = [Area(*row) for row in frame.itertuples(index=False, name=None)]
    known = {(area.method, area.other_arm, area.spend): area for area in areas}

    def first(method: str) -> float:
        return known[method, *places[0]].area if (method, *places[0]) in known else math.inf

    rows = []
    for method in sorted(dict.fromkeys(area.method for area in areas), key=first):
        own = (known.get((method, *place)) for place in places)
        values = (found and with_interval(found.area, found.low, found.high) for found in own)
        rows.append(Row(method, (method, *values), ((task, method),)))
    heads = (
        _of_optimum(
            spend if arm == "free" else f"{spend}_still",
            f"over {LABELS[spend]}" + ("" if arm == "free" else ", arm still"),
            digits=3,
            other_arm=arm,
            family="all methods of the table, as the largest spend of one that learns is the end",
            printed=arm == "free" and spend in spends[:2],
        )
        for arm, spend in places
    )
    return _AREAS.plus(heads).table(rows, table_ids(study)[task], task=escaped(task))


def pareto_table(study: Study, task: str) -> DataTable | None:
    """Methods on some Pareto set of reward and spend."""
    frame = study.pareto[study.pareto.task == task]
    rows = [
        Row(str(method), tuple(_on_fronts(own)), ((task, str(method)),))
        for method, own in frame.groupby("method", sort=False)
        if (own.told_share > SOMETIMES).any()
    ]
    layout = _PARETO.plus(_fronts())
    made = layout.table(rows, table_ids(study)[task], task=escaped(task))
    named = {row.key for row in rows}
    unshown = ((task, str(method)) for method in frame.method.unique() if method not in named)
    return made and replace(made, unshown=tuple(unshown))


def _fronts() -> Iterator[Column]:
    """Of each spend three columns: the median, and on which fronts it is."""
    share, every = partial(_number, kind="share", digits=0), "all methods compared on the task"
    less = f"{every}, of which those count that are told no more"
    for place, (spend, label) in enumerate(LABELS.items()):
        yield _number(spend, label, printed=place < 3)
        yield share(f"{spend}_front", "on front", printed=place < 3, family=every)
        yield share(f"{spend}_told", "of those told no more", printed=False, family=less)


def _on_fronts(rows: pd.DataFrame) -> Iterator[Value]:
    """A method's values, spend by spend."""
    first = rows.iloc[0]
    yield from (str(first.method), str(first.told), float(first.reward))
    for amount, front, told in zip(rows.amount, rows.front_share, rows.told_share, strict=True):
        whole = float(amount).is_integer()
        yield from (int(amount) if whole else finite(amount), finite(front), finite(told))


def _of_methods(frame: pd.DataFrame, task: str) -> pd.DataFrame:
    """Rows of a task without the optimum's searches, which are what the others are held to."""
    return frame[(frame.task == task) & ~frame.method.str.startswith(SEARCH)]
