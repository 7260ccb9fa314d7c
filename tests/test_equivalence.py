"""Equivalence: intervals against scipy's t-tests, verdicts by where the interval lies."""

import math

import numpy as np
import pytest
from scipy import stats

from coartic.analysis.statistics.hypotheses import difference_to_published, equivalence
from coartic.estimates import Estimate


def test_interval_against_an_exact_value_is_students():
    ours = np.random.default_rng(14).normal(-484, 4, 12)
    interval = difference_to_published(ours, -484, None, 20)
    one_run = difference_to_published(ours, -484, 3.0, 1)  # has no spread
    assert repr(one_run) == repr(interval)  # NaN, too
    expected = stats.ttest_1samp(ours, -484).confidence_interval(0.95)
    assert (interval.low, interval.high) == pytest.approx((expected.low + 484, expected.high + 484))


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (-5.0, 5.0, "equivalent"),
        (-5.1, 5.0, "undecided"),
        (-5.0, 5.1, "undecided"),
        (5.0, 9.0, "undecided"),  # it may be at the margin
        (5.1, 9.0, "different"),
        (-9.0, -5.0, "undecided"),
        (-9.0, -5.1, "different"),
        (math.nan, math.nan, "undecided"),
    ],
)
def test_verdicts(low, high, expected):
    assert equivalence(Estimate(0.0, low, high), 5.0) == expected


def test_interval_of_two_samples_is_welchs():
    rng = np.random.default_rng(15)
    ours, theirs = rng.normal(-503, 5, 20), rng.normal(-502, 3, 15)
    expected = stats.ttest_ind(ours, theirs, equal_var=False).confidence_interval(0.95)
    published = difference_to_published(ours, theirs.mean(), theirs.std(ddof=1), 15)
    assert published.n == (20, 15)
    assert (published.low, published.high) == pytest.approx((expected.low, expected.high))


def test_degenerate_samples():
    assert math.isnan(difference_to_published([1.0], 2.0, 1.0, 3).low)
    point = difference_to_published([1.0] * 4, 3.0, 0.0, 4)
    assert (point.low, point.high) == (-2.0, -2.0)
