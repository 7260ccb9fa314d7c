"""What judges say: findings by tests, and tables of raw values with the cells behind them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from analysis.claims.register import Finding
from analysis.report.document import Column, DataTable, Estimate, Row, Value
from analysis.results.optima import ARMS, OtherArm
from analysis.statistics.estimates import SEED, Inference, mean
from analysis.statistics.hypotheses import bootstrap_test
from analysis.words import interval
from coartic.robot import Array


def exceeds(values: Array, bound: Array | float) -> Inference:
    """One-tailed bootstrap test that the mean is above a number, or above another sample's."""
    return bootstrap_test(values, bound, seed=SEED)


def shown(values: Array, style: str = ".1f") -> str:
    """The mean with its BCa interval."""
    return interval(mean(values, seed=SEED), style)


def all_hold(tests: Sequence[Inference], parts: Sequence[str], before: str = "") -> Finding:
    """What is seen where every test points as claimed; ``parts`` of a sentence say so."""
    seen = all(test.estimate > 0 for test in tests)
    return Finding(seen, before + "; ".join(parts), tuple(tests))


def measured(
    claim: str,
    evidence: str,
    title: str,
    columns: tuple[Column, ...],
    rows: Sequence[Row],
) -> Finding:
    """A finding that judges nothing: a sentence and a table."""
    name, caption = f"evidence-{claim}", f"{title} ({claim})."
    table = DataTable(name, caption, columns, tuple(rows)) if rows else None
    return Finding(None, evidence, table=table)


def estimate_of(found: Inference) -> Estimate:
    """An estimate with its interval, where it has one."""
    if math.isnan(found.low):
        return Estimate(found.estimate)
    return Estimate(found.estimate, None, found.low, found.high)


def of_either_optimum(*columns: Column) -> tuple[Column, ...]:
    """Columns for the optimum with the other arm free, then the same for that with it still."""
    return tuple(
        replace(
            column,
            name=f"{column.name}_{arm}",
            header=f"{column.header}, other arm {arm}",
            other_arm=arm,
        )
        for arm in ARMS
        for column in columns
    )


def by_optimum(arm: OtherArm, *values: Value) -> tuple[Value, ...]:
    """The values below :func:`of_either_optimum`; none for the other optimum."""
    none = (None,) * len(values)
    return (*values, *none) if arm == "free" else (*none, *values)
