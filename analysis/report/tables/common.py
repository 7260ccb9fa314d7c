"""What the report's tables share: names of tasks, means, counts of hand sequences."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis import words
from coartic.analysis.published import Summary
from coartic.analysis.report.document import Estimate
from coartic.analysis.report.tables.layout import finite
from coartic.analysis.statistics.estimates import mean
from coartic.analysis.statistics.spread import sd
from coartic.analysis.study import Study


def table_ids(study: Study) -> dict[str, str]:
    """Names of tasks as tables' ids have them."""
    return words.slugs(study.tasks)


def mean_of(rewards: Any) -> Estimate | None:
    """Mean with SD and BCa interval, as far as there are any."""
    if not len(rewards):
        return None
    values = np.asarray(rewards, dtype=np.float64)
    found = mean(values)
    ends = () if math.isnan(found.low) else (found.low, found.high)
    return Estimate(found.estimate, finite(sd(values)), *ends)


def estimate_as_printed(published: Summary | None) -> Estimate | None:
    """Mean with SD and the digits of the paper."""
    if published is None:
        return None
    return Estimate(published.mean, published.sd, digits=published.digits)


def counts(hands: pd.Series) -> str | None:
    """``LRLR 17, RRLR 3``, the commonest first; None for none."""
    return ", ".join(f"{name} {count}" for name, count in hands.value_counts().items()) or None


def marked(study: Study, task: str) -> str:
    """A task's name, with † where it is reconstructed."""
    return words.marked(task, study.tasks[task])
