"""What judges say: findings by tests, and tables of raw values with the cells behind them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

from coartic.analysis.claims.register import Finding
from coartic.analysis.report.document import DataTable, Row, Value
from coartic.analysis.report.tables.layout import LAYOUTS, TableLayout
from coartic.analysis.results.optima import ARMS, OtherArm
from coartic.analysis.statistics.estimates import Inference, mean
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.words import interval
from coartic.robot import Array

NEAR = (1.5e-4, 0.06)
"""p-values between the least that 9999 resamples give and more than 5 %."""
MANY = 999_999
"""Resamples of p-values between these: the standard error of the p-value is then 0.4 % of
itself at 0.06, 3 % at 0.001."""


def exceeds(values: Array, bound: Array | float, *, sure: bool = False) -> Inference:
    """One-tailed bootstrap test that the mean is above a number, or above another sample's.

    ``sure``: with a hundred times the resamples where either tail is near any level that it may
    be held against, so that hardly a verdict hangs on which resamples were drawn.
    """
    found = bootstrap_test(values, bound)
    if sure and NEAR[0] < min(found.p, 1 - found.p) < NEAR[1]:
        return bootstrap_test(values, bound, resamples=MANY)
    return found


def shown(values: Array, style: str = ".1f") -> str:
    """The mean with its BCa interval."""
    return interval(mean(values), style)


def all_hold(tests: Sequence[Inference], parts: Sequence[str], before: str = "") -> Finding:
    """What is seen where every test points as claimed; ``parts`` of a sentence say so."""
    seen = all(test.estimate > 0 for test in tests)
    return Finding(seen, before + "; ".join(parts), tuple(tests))


def measured(claim: str, evidence: str, rows: Sequence[Row], **facts: float) -> Finding:
    """A finding that judges nothing: a sentence and a table, with ``facts`` in its words."""
    of = layout(claim)
    columns = (replace(column, header=column.header.format(**facts)) for column in of.columns)
    table = DataTable(of.name, of.caption.format(**facts), tuple(columns), tuple(rows))
    return Finding(None, evidence, table=table if rows else None)


def layout(claim: str) -> TableLayout:
    """What the table of its evidence says."""
    return LAYOUTS[f"evidence-{claim}"]


def by_optimum(arm: OtherArm, **values: Value) -> dict[str, Value]:
    """Values by column, whose names end in the other arm: none for the other optimum."""
    sides = itertools.product(ARMS, values.items())
    return {f"{name}_{side}": value if side == arm else None for side, (name, value) in sides}
