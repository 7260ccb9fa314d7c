"""What the report's tables share: names of tasks, values of cells, empty tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import pandas as pd

from analysis.report.document import Column, DataTable, Estimate, Row, Value
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


def mean_of(rewards: Any) -> Estimate | None:
    """Mean with SD and BCa interval, as far as there are any."""
    if not len(rewards):
        return None
    found = mean(rewards, seed=SEED)
    spread = finite(sd(rewards))
    if math.isnan(found.low):
        return Estimate(found.estimate, spread)
    return Estimate(found.estimate, spread, found.low, found.high)


def with_interval(value: float, low: float, high: float) -> Value:
    """A value with its interval where it has one; None for NaN."""
    if math.isnan(value):
        return None
    return Estimate(value) if math.isnan(low) else Estimate(value, None, low, high)


def finite(value: float) -> float | None:
    """None for NaN."""
    return None if math.isnan(value) else float(value)


def counts(hands: pd.Series) -> str | None:
    """``LRLR 17, RRLR 3``, the commonest first; None for none."""
    return ", ".join(f"{name} {count}" for name, count in hands.value_counts().items()) or None


def marked(study: Study, task: str) -> str:
    """A task's name, with † where it is reconstructed."""
    return f"{task} †" if study.results.tasks[task].reconstructed else task
