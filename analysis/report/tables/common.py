"""What the report's tables share: names of tasks, values of cells, empty tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pandas as pd

from analysis.published import Summary
from analysis.report.document import CellKey, Column, DataTable, Estimate, Row, Value
from analysis.statistics.estimates import SEED, mean
from analysis.statistics.spread import sd
from analysis.words import slugs

if TYPE_CHECKING:
    from analysis.study import Study


def table_ids(study: Study) -> dict[str, str]:
    """Names of tasks as tables' ids have them."""
    return slugs(study.results.tasks)


def table(
    name: str,
    caption: str,
    columns: tuple[Column, ...],
    rows: list[Row],
    notes: tuple[str, ...] = (),
) -> DataTable | None:
    """A table, or None where it would have no rows."""
    return DataTable(name, caption, columns, tuple(rows), notes) if rows else None


def row_of(
    columns: tuple[Column, ...], key: str, of: Any, cells: tuple[CellKey, ...], **own: Value
) -> Row:
    """A row whose values are fields of ``of`` by the columns' names, but for its ``own``."""
    values = (own[c.name] if c.name in own else getattr(of, c.name) for c in columns)
    return Row(key, tuple(values), cells)


def mean_of(rewards: Any) -> Estimate | None:
    """Mean with SD and BCa interval, as far as there are any."""
    if not len(rewards):
        return None
    found = mean(rewards, seed=SEED)
    ends = () if math.isnan(found.low) else (found.low, found.high)
    return Estimate(found.estimate, finite(sd(rewards)), *ends)


def with_interval(value: float, low: float, high: float) -> Value:
    """A value with its interval where it has one; None for NaN."""
    ends = () if math.isnan(low) else (low, high)
    return None if math.isnan(value) else Estimate(value, None, *ends)


def estimate_as_printed(published: Summary | None) -> Estimate | None:
    """Mean with SD and the digits of the paper."""
    if published is None:
        return None
    return Estimate(published.mean, published.sd, digits=published.digits)


def finite(value: float) -> float | None:
    """None for NaN."""
    return None if math.isnan(value) else float(value)


def counts(hands: pd.Series) -> str | None:
    """``LRLR 17, RRLR 3``, the commonest first; None for none."""
    return ", ".join(f"{name} {count}" for name, count in hands.value_counts().items()) or None


def marked(study: Study, task: str) -> str:
    """A task's name, with † where it is reconstructed."""
    return f"{task} †" if study.results.tasks[task].reconstructed else task
