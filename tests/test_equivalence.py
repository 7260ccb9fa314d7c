"""Equivalence: intervals and p-values against scipy's t-tests, and coherence."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from coartic.analysis.statistics.equivalence import difference, equivalence


def test_interval_against_an_exact_value_is_students():
    ours = np.random.default_rng(14).normal(-484, 4, 12)
    interval = difference(ours, -484, None, 20)
    expected = stats.ttest_1samp(ours, -484).confidence_interval(0.95)
    assert (interval.low, interval.high) == pytest.approx((expected.low + 484, expected.high + 484))


@pytest.mark.parametrize(
    ("shift", "spread", "verdict"),
    [
        (0.0, 1.0, "equivalent"), (-30.0, 1.0, "different"), (30.0, 1.0, "different"),
        (0.0, 80.0, "undecided"),
        (6.0, 20.0, "undecided"), (-6.0, 20.0, "undecided"),  # the interval goes across the margin
        (4.0, 20.0, "undecided"), (-4.0, 20.0, "undecided"),
    ],
)  # fmt: skip
def test_verdicts(shift, spread, verdict):
    """Of 20 evenly spaced values the standard error is spread · 0.607 / √20: of 20, an interval
    of ± 5.7."""
    ours = -500 + shift + spread * np.linspace(-1, 1, 20)
    interval = difference(ours, -500, 1.0, 20)
    assert (interval.verdict, interval.margin) == (verdict, 5.0)


def test_edge_cases_of_the_difference():
    assert difference([-500.0], -500, 1.0, 20).verdict == "undecided"
    same = difference([-500.0, -500.0], -500, None, 20)
    assert (same.low, same.high, same.verdict) == (0.0, 0.0, "equivalent")


def test_p_is_of_two_one_sided_tests():
    rng = np.random.default_rng(15)
    ours, theirs = rng.normal(-503, 5, 20), rng.normal(-502, 3, 15)
    ours_and_theirs = equivalence(ours, theirs, 4.0)
    above = stats.ttest_ind(ours + 4, theirs, equal_var=False, alternative="greater").pvalue
    below = stats.ttest_ind(ours - 4, theirs, equal_var=False, alternative="less").pvalue
    assert ours_and_theirs.p == pytest.approx(max(above, below))
    assert ours_and_theirs.n == (20, 15)
    printed = difference(ours, theirs.mean(), theirs.std(ddof=1), 15)
    expected = stats.ttest_ind(ours, theirs, equal_var=False).confidence_interval(0.95)
    for one in (ours_and_theirs, printed):
        assert (one.low, one.high) == pytest.approx((expected.low, expected.high))


@given(
    st.lists(st.integers(-20, 20).map(float), min_size=2, max_size=8),
    st.lists(st.integers(-20, 20).map(float), min_size=2, max_size=8),
    st.floats(0.1, 10),
)
def test_interval_and_p_say_the_same(a, b, margin):
    interval = equivalence(a, b, margin)
    if interval.note:
        return
    touching = any(abs(abs(end) - margin) < 1e-6 for end in (interval.low, interval.high))
    assert touching or (interval.verdict == "equivalent") == (interval.p <= 0.025)


def test_degenerate_samples():
    one = equivalence([1.0], [1.0, 2.0, 3.0], 9.0)
    assert math.isnan(one.low)
    assert one.verdict == "undecided"
    point = equivalence([1.0] * 4, [3.0] * 4, 1.5)
    assert (point.low, point.high, point.verdict) == (-2.0, -2.0, "different")
    assert math.isnan(point.p)
