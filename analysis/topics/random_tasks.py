"""Means over random tasks, each of which counts alike, for tables and claims."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.claims.data import Data, MissingError
from coartic.analysis.claims.register import Finding
from coartic.analysis.statistics.estimates import FEWEST, Estimate, interval, mean
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.study import CellRuns, Study
from coartic.analysis.table import Row
from coartic.analysis.words import estimate
from coartic.robot import Array

RESAMPLES_OF_STUDIES = 99_999
"""Resamples of a test, as many as on families of tasks: p-values are corrected over many claims."""


def reported(data: Data, name: str) -> bool:
    """Whether a task is one of those that methods were not tuned on."""
    return data.task(name).split != "development"


def solved_cells(study: Study, method: str) -> Iterator[tuple[CellRuns, dict[str, Any]]]:
    """Cells of a method with a solved run, each with its parameters."""
    for cell in study.cells.values():
        if cell.method == method and len(cell.good):
            yield cell, json.loads(str(cell.good.parameters.iloc[0]))


def over_tasks(values: pd.Series, margin: float = 0.0) -> Estimate:
    """One-tailed test that the mean over tasks is above a margin; MissingError for too few."""
    there = values.dropna().to_numpy(dtype=np.float64)
    if len(there) < FEWEST:
        raise MissingError(f"fewer than {FEWEST} random tasks can be judged")
    return bootstrap_test(there, margin, resamples=RESAMPLES_OF_STUDIES)


def in_words(sentence: str, values: pd.Series) -> str:
    """A sentence with the mean over tasks and its interval, and with how many tasks there are."""
    there = values.dropna()
    seen = estimate(mean(there.to_numpy(dtype=np.float64)), 2)
    return f"{sentence.format(seen)} ({len(there)} tasks)"


def finding(parts: dict[str, tuple[pd.Series, float, int]]) -> Finding:
    """What is seen of values, by sentences that each have a place for a mean over tasks.

    With each: the values by task, a bound, and 1 where they should be above it, -1 below.
    """
    tests = tuple(over_tasks(sign * v, sign * bound) for v, bound, sign in parts.values())
    seen = [in_words(sentence, values) for sentence, (values, _, _) in parts.items()]
    return Finding(all(test.value > 0 for test in tests), one_sentence(seen), tests)


def one_sentence(parts: list[str]) -> str:
    """Parts of the evidence as one sentence."""
    words = "; ".join(parts)
    return f"{words[0].upper()}{words[1:]}."


def mean_of(name: str, values: pd.Series) -> Row:
    """The mean over tasks that have a value, with its interval, as columns of a table."""
    there = values.dropna().to_numpy(dtype=np.float64)
    return interval(name, mean(there)) if len(there) else {}


def mean_or_nan(values: Sequence[float] | Array) -> float:
    """The mean of the values that there are; NaN without any."""
    there = np.asarray(values, dtype=np.float64)
    there = there[~np.isnan(there)]
    return float(there.mean()) if len(there) else math.nan
