"""Means over random tasks, each of which counts alike, for tables, sentences and claims."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.claims.data import Data, MissingError
from coartic.analysis.claims.register import Finding
from coartic.analysis.statistics.estimates import FEWEST, Estimate, interval, mean
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.table import Row
from coartic.analysis.words import capital, estimate
from coartic.robot import Array

RECEDING_HORIZON = "receding-horizon"
"""The planner whose goals ahead are varied."""
RESAMPLES_OF_STUDIES = 99_999
"""Resamples of a test, as many as on families of tasks: p-values are corrected over many claims."""


@cached
def solved_cells(study: Study) -> dict[str, list[tuple[CellRuns, dict[str, Any]]]]:
    """Cells with a solved run, each with its parameters, by method."""
    cells: dict[str, list[tuple[CellRuns, dict[str, Any]]]] = {}
    for cell in study.cells.values():
        if len(cell.good):
            parameters = json.loads(str(cell.good.parameters.iloc[0]))
            cells.setdefault(cell.method, []).append((cell, parameters))
    return cells


def judged(data: Data, rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of a table on random tasks that methods were not tuned on, as a claim reads them.

    Columns ``task`` and ``cell``, whose runs are the claim's.
    """
    tasks = {name: data.task(name) for name in rows.task}
    drawn = [n for n, task in tasks.items() if task.family and task.split != "development"]
    rows = rows[rows.task.isin(drawn)]
    data.run_ids.extend(run for cell in rows.cell for run in cell.good.run_id)
    return rows


def over_tasks(values: pd.Series, margin: float = 0.0) -> Estimate:
    """One-tailed test that the mean over tasks is above a margin; MissingError for too few."""
    there = values.dropna().to_numpy(dtype=np.float64)
    if len(there) < FEWEST:
        raise MissingError(f"fewer than {FEWEST} random tasks can be judged")
    return bootstrap_test(there, margin, resamples=RESAMPLES_OF_STUDIES)


def means_over_tasks(parts: Mapping[str, tuple[pd.Series, float, int]]) -> Finding:
    """The finding of a claim on means over tasks, by sentences that each have a place for one.

    With each: the values by task, a bound, and 1 where their mean should be above it, -1 below.
    """
    tests = tuple(over_tasks(sign * v, sign * bound) for v, bound, sign in parts.values())
    seen = []
    for sentence, (values, _, _) in parts.items():
        there = values.dropna().to_numpy(dtype=np.float64)
        seen.append(f"{sentence.format(estimate(mean(there), 2))} ({len(there)} tasks)")
    evidence = f"{capital('; '.join(seen))}."
    return Finding(all(test.value > 0 for test in tests), evidence, tests)


def mean_of(name: str, values: pd.Series) -> Row:
    """The mean over tasks that have a value, with its interval, as columns of a table."""
    there = values.dropna().to_numpy(dtype=np.float64)
    return interval(name, mean(there)) if len(there) else {}


def mean_or_nan(values: Sequence[float] | Array) -> float:
    """The mean of the values that there are; NaN without any."""
    there = np.asarray(values, dtype=np.float64)
    there = there[~np.isnan(there)]
    return float(there.mean()) if len(there) else math.nan
