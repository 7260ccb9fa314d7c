"""Equivalence: intervals and p-values against scipy's t-tests, and coherence."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from coartic.analysis.statistics.equivalence import bootstrap_equivalence, difference, shares


def test_interval_is_welchs():
    rng = np.random.default_rng(13)
    ours, theirs = rng.normal(-505, 5, 20), rng.normal(-502, 3, 15)
    found = difference(ours, theirs.mean(), theirs.std(ddof=1), 15)
    expected = stats.ttest_ind(ours, theirs, equal_var=False).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high))
    assert found.estimate == pytest.approx(ours.mean() - theirs.mean())


def test_interval_against_an_exact_value_is_students():
    ours = np.random.default_rng(14).normal(-484, 4, 12)
    found = difference(ours, -484, None, 20)
    expected = stats.ttest_1samp(ours, -484).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((expected.low + 484, expected.high + 484))


@pytest.mark.parametrize(
    ("shift", "spread", "verdict"),
    [(0.0, 1.0, "equivalent"), (-30.0, 1.0, "different"), (0.0, 80.0, "undecided")],
)
def test_verdicts(shift, spread, verdict):
    ours = -500 + shift + spread * np.linspace(-1, 1, 20)
    assert difference(ours, -500, 1.0, 20).verdict == verdict


def test_margin():
    assert difference([-500.0] * 2, -500, 1.0, 20).margin == 5.0


def test_edge_cases_of_the_difference():
    assert difference([-500.0], -500, 1.0, 20).verdict == "undecided"
    same = difference([-500.0, -500.0], -500, None, 20)
    assert (same.low, same.high, same.verdict) == (0.0, 0.0, "equivalent")


def test_p_is_of_two_one_sided_tests():
    rng = np.random.default_rng(15)
    ours, theirs = rng.normal(-503, 5, 20), rng.normal(-502, 3, 15)
    found = difference(ours, theirs.mean(), theirs.std(ddof=1), 15, margin=4.0)
    above = stats.ttest_ind(ours + 4, theirs, equal_var=False, alternative="greater").pvalue
    below = stats.ttest_ind(ours - 4, theirs, equal_var=False, alternative="less").pvalue
    assert found.p == pytest.approx(max(above, below))
    assert found.n == (20, 15)


def test_bootstrap_of_many_normal_values_is_welchs():
    rng = np.random.default_rng(16)
    a, b = rng.normal(0, 1, 200), rng.normal(0.2, 2, 150)
    found = bootstrap_equivalence(a, b, 0.6, seed=1)
    expected = stats.ttest_ind(a, b, equal_var=False).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=0.03)
    published = difference(a, b.mean(), b.std(ddof=1), 150, margin=0.6)
    assert found.p == pytest.approx(published.p, abs=0.02)


def test_bootstrap_against_a_known_number():
    values = np.random.default_rng(17).normal(-319, 3, 50)
    found = bootstrap_equivalence(values, -319, 2.0, seed=1)
    expected = stats.ttest_1samp(values, -319).confidence_interval(0.95)
    assert (found.low + 319, found.high + 319) == pytest.approx(
        (expected.low + 638, expected.high + 638), abs=0.1
    )
    assert found.n == (50,)


@given(
    st.lists(st.floats(-10, 10), min_size=3, max_size=8),
    st.lists(st.floats(-10, 10), min_size=3, max_size=8),
    st.floats(0.1, 10),
)
def test_interval_and_p_say_the_same(a, b, margin):
    found = bootstrap_equivalence(a, b, margin, seed=0, resamples=199)
    if found.note:
        return
    inside = -margin < found.low and found.high < margin
    touching = any(abs(abs(end) - margin) < 1e-6 for end in (found.low, found.high))
    assert touching or inside == (found.p <= 0.025)


def test_bootstrap_of_degenerate_samples():
    few = bootstrap_equivalence([1.0, 2.0], [1.0, 2.0, 3.0], 9.0, seed=0)
    assert math.isnan(few.low)
    assert few.verdict == "undecided"
    point = bootstrap_equivalence([1.0] * 4, [3.0] * 4, 1.5, seed=0)
    assert (point.low, point.high, point.verdict) == (-2.0, -2.0, "different")
    assert math.isnan(point.p)


def test_arguments_that_cannot_be():
    with pytest.raises(ValueError, match="margin"):
        bootstrap_equivalence([1.0, 2, 3], 0.0, 0.0, seed=0)
    with pytest.raises(ValueError, match="margin"):
        difference([1.0, 2.0], 1, 1, 20, margin=-1)
    with pytest.raises(ValueError, match="too few"):
        bootstrap_equivalence([1.0, 2, 3], 0.0, 1.0, seed=0, resamples=20)


def test_shares_agree_where_newcombes_interval_is_within_the_margin():
    """20 of 20 twice: the interval is ± z² / (20 + z²), a quarter at z² = 20/3."""
    found = shares((20, 20), (20, 20), 0.25)
    assert found.p == pytest.approx(stats.norm.sf(math.sqrt(20 / 3)), rel=1e-6)
    assert found.verdict == "equivalent"
    apart = shares((5, 20), (9, 20), 0.25)
    assert apart.estimate == pytest.approx(-0.2)
    assert apart.verdict == "undecided"
    assert 0.025 < apart.p < 0.5
    assert shares((0, 20), (11, 20), 0.25).p == 1.0
    assert shares((0, 20), (11, 20), 0.25).verdict == "different"
    many = shares((4_000_000, 8_000_000), (4_000_000, 8_000_000), 0.25)
    assert many.verdict == "equivalent"
    assert 0 < many.p < 1e-9
    # The p-value is that of the interval.
    for count in range(10, 20):
        one = shares((count, 20), (17, 20), 0.25)
        assert (one.p < 0.025) == (one.verdict == "equivalent")
    with pytest.raises(ValueError, match="margin"):
        shares((1, 2), (1, 2), 0.0)
