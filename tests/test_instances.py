"""Statistics over instances: planted spreads come back."""

import math

import numpy as np
import pytest

from coartic.analysis.optima import relative_gap
from coartic.analysis.statistics import other_tasks, task_mean


def width(estimate):
    return estimate.high - estimate.low


def due(variance, n, rel):
    """Twice 1.96 times the root of a variance over a number."""
    return pytest.approx(2 * 1.96 * math.sqrt(variance / n), rel=rel)


def test_width_of_the_interval():
    centres = np.linspace(-1, 1, 40)
    # Runs add their own: variance 1 of each of 4.
    runs = np.array([-1.0, 1.0, -1.0, 1.0]) * math.sqrt(3 / 4)
    noisy = other_tasks({"a": [c + runs for c in centres]})
    assert noisy.value == pytest.approx(0)
    assert width(noisy) == due(centres.var(ddof=1) + 3 / 4 / 4, 40, 0.08)


def test_the_interval_of_few_instances_by_counting():
    """Five instances -2 to 2. Of their 5^5 = 3125 resamples 56 (1.8 %) sum to -7 or less and 126
    (4.0 %) to -6 or less, so that the 2.5 % quantile of means is -6/5; it is wider by √(5/4)."""
    few = other_tasks({"a": [np.full(2, float(c)) for c in range(-2, 3)]})
    end = 6 / 5 * math.sqrt(5 / 4)
    assert (few.low, few.value, few.high) == pytest.approx((-end, 0, end))


def test_families_count_alike_whatever_their_number_of_instances():
    many = [np.array([1.0])] * 30
    few = [np.array([0.0, 0.0])] * 3
    both = other_tasks({"many": many, "few": few})
    assert (both.value, both.low, both.high) == (0.5, 0.5, 0.5)
    assert both.n == (30, 3)
    none = other_tasks({"many": many, "few": few[:2]})
    assert math.isnan(none.low)
    with pytest.raises(ValueError, match="one instance"):
        other_tasks({})
    with pytest.raises(ValueError, match="at least one value"):
        other_tasks({"a": [[1.0], [], [2.0]]})


def test_the_interval_ends_at_what_runs_can_make():
    """Gaps are never below 0: two instances at 0 and one far away."""
    gaps = [np.zeros(3), np.zeros(3), np.array([0.3, 0.3, 0.4])]
    gap = other_tasks({"a": gaps})
    assert gap.low == 0
    assert gap.high <= 0.4
    turned = other_tasks({"a": [-runs for runs in gaps]})
    assert (turned.low, turned.high) == pytest.approx((-gap.high, -gap.low))


def test_given_tasks_are_strata():
    """Tasks far apart add no width to the interval of their mean."""
    assert relative_gap([-300, -303], -300).tolist() == [0, 0.01]
    rng = np.random.default_rng(31)
    runs = rng.normal(0, 1, (4, 20))
    mean = task_mean([100 * i + runs[i] for i in range(4)])
    assert mean.value == pytest.approx(150 + runs.mean())
    assert width(mean) == due(runs.var(axis=1).sum() / 4**2, 20, 0.1)
    assert task_mean([[1.0] * 4, [5.0] * 40]).value == 3.0  # each counts the same
    with pytest.raises(ValueError, match="at least one sample"):
        task_mean([])
