"""Estimates and tests against closed forms, enumeration, brute force and SciPy."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from coartic import estimates as statistics
from coartic.analysis import statistics as hypotheses


def studentised(*pairs):
    """The sum of differences of means over its standard error, exact for known numbers; infinite
    without spread, 0 without difference."""
    d = sum(np.mean(a) - np.mean(b) for a, b in pairs)
    samples = [of for pair in pairs for of in pair if len(of) > 1]
    error = math.sqrt(sum(np.var(of, ddof=1) / len(of) for of in samples))
    return 0.0 if abs(d) < 1e-12 else math.copysign(1e9, d) if error < 1e-9 else d / error


def against(number, values):
    """The statistic of each resample of values, and that of the values against a number."""
    around = np.array(values) - np.mean(values)
    null = [studentised((x, [0.0])) for x in itertools.product(around, repeat=len(values))]
    return null, studentised((values, [number]))


def exchanges(a, b):
    """Yield each division of two samples into samples as large."""
    pool = np.array([*a, *b], float)
    for chosen in itertools.combinations(range(len(pool)), len(a)):
        yield pool[[*chosen]], np.delete(pool, chosen)


def share_as_extreme(null, observed, alternative):
    if alternative == "two-sided":
        null, observed = np.abs(null), abs(observed)
    sign = -1 if alternative == "less" else 1
    return np.mean(sign * np.array(null) >= sign * observed - 1e-9)


@pytest.fixture
def three_suffice(monkeypatch):
    """Let three values suffice for intervals and tests, so that all resamples can be listed."""
    for module in (statistics, hypotheses):
        monkeypatch.setattr(module, "MIN_VALUES", 3)


ALTERNATIVES = "greater", "less", "two-sided"


@pytest.mark.parametrize(("a", "bound"), [([1, 2, 6, 6], 3.5), ([-3, -2, -7], -5)])
def test_bootstrap_test_against_all_resamples(a, bound):
    for alternative in ALTERNATIVES:
        expected = share_as_extreme(*against(bound, a), alternative)
        test = hypotheses.bootstrap_test(a, bound, alternative)
        assert test.p == pytest.approx(expected, abs=4 * math.sqrt(0.25 / 9_999))


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ([1, 2, 6], [0, 1, 3]), ([-3, -2, -2], [-2, -5, -9, -9, 1]), ([0, 0, 9, 9, 9], [0, 0, 9]),
        ([5.1] * 3, [5.2] * 4), ([1, 2, 3, 4, 5], [1, 1, 1, 1, 20]),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("three_suffice")
def test_exchange_test_against_all_exchanges(a, b):
    """With fewer resamples than exchanges, some of these are drawn."""
    null = [*map(studentised, exchanges(a, b))]
    for alternative in ALTERNATIVES:
        expected = share_as_extreme(null, studentised((a, b)), alternative)
        test = hypotheses.exchange_test(a, b, alternative)
        assert test.value == pytest.approx(np.mean(a) - np.mean(b))
        assert test.p == pytest.approx(expected)
        assert test.resamples == 0
        drawn = hypotheses.exchange_test(a, b, alternative, resamples=15)
        assert drawn.p == pytest.approx((1 + 15 * expected) / 16, abs=4 * math.sqrt(0.25 / 15))
        assert drawn.p >= 1 / 16


@pytest.mark.usefixtures("three_suffice")
def test_a_test_over_strata_against_all_exchanges():
    """In each of two strata; and in one, where values stand beside an exact number."""
    samples = [([1, 2, 6], [0, 1, 3]), ([0, 4, 5, 5], [2, 3, 9])]
    strata = [tuple(np.array(each, float) for each in pair) for pair in samples]
    null = itertools.starmap(studentised, itertools.product(*itertools.starmap(exchanges, strata)))
    expected = share_as_extreme([*null], studentised(*strata), "two-sided")
    assert hypotheses.stratified_test(strata) == pytest.approx(expected, abs=0.02)
    values = np.array([1.0, 2.0, 6.0, 6.0])
    expected = share_as_extreme(*against(5.0, values), "two-sided")
    assert 0.3 < expected < 0.4  # a sum in place of the difference has the smallest p of all
    for pair in ((values, 5.0), (5.0, values)):
        assert hypotheses.stratified_test([pair]) == pytest.approx(expected, abs=0.02)
    assert math.isnan(hypotheses.stratified_test([(1.0, 2.0)]))
    assert math.isnan(hypotheses.stratified_test([(values, 2.0), (values[:2], values)]))
    assert hypotheses.stratified_test([(values, values), (1.0, 1.0)]) == 1.0


@pytest.mark.usefixtures("three_suffice")
def test_smallest_p():
    """No resample comes near: p is that of the sample seen; tests of few values cannot reject."""
    far = 1000 + np.arange(8.0)
    assert hypotheses.bootstrap_test(far, 0, resamples=99).p == 0.01
    for alternative, least in (("greater", 1 / 16), ("two-sided", 2 / 16)):  # by signs
        test = hypotheses.bootstrap_test(far[:4], 0, alternative, resamples=99)
        assert test.least_p == pytest.approx(least)
    for first, second, alternative, least in (
        (far[:3], far[3:6], "less", 1 / 20),
        (far[:3], far[3:6], "two-sided", 2 / 20),
        (far, 2 * far, "less", 1 / 100),  # by the number of resamples
    ):
        test = hypotheses.exchange_test(first, second, alternative, resamples=99)
        assert test.p == test.least_p == pytest.approx(least)
    # Without equal numbers no exchange is the mirror of another.
    assert hypotheses.exchange_test(far[:3], far[3:7], "two-sided").least_p == 1 / 35


@pytest.mark.parametrize(
    ("samples", "weights"),
    [
        ([[0.0, 1.0, 2.5, 4.2, 9.1, 17.3]], [1]),
        ([[0.0, 1.0, 2.5, 4.2, 9.1, 13.3], [0.3, 1.6, 5.9]], [1, -1]),  # of unequal sizes
    ],
)
@pytest.mark.usefixtures("three_suffice")
def test_bca_interval_against_all_resamples(samples, weights):
    """The formula of Efron & Tibshirani (1993, equation 14.10) on all resamples."""
    parts = [*zip(weights, map(np.array, samples), strict=True)]
    means = [w * np.array([*itertools.product(of, repeat=len(of))]).mean(1) for w, of in parts]
    every = sum(np.meshgrid(*means)).ravel().round(9)
    value = round(sum(w * of.mean() for w, of in parts), 9)
    z0 = stats.norm.ppf((every < value).mean() + (every == value).mean() / 2)
    spread = np.array([
        w * (of.mean() - np.delete(of, i).mean()) for w, of in parts for i in range(len(of))
    ])  # fmt: skip
    a = (spread**3).sum() / (6 * (spread**2).sum() ** 1.5)
    z = z0 + stats.norm.ppf([0.025, 0.975])
    low, high = np.quantile(every, stats.norm.cdf(z0 + z / (1 - a * z)))
    interval = statistics.mean_of_means([of for _, of in parts], weights, 20_000)
    assert (interval.low, interval.high) == pytest.approx((low, high), abs=0.25)


def test_without_spread_an_interval_is_its_value_and_without_difference_there_is_no_p():
    interval = statistics.difference_of_means(np.full(6, 4.0), np.full(5, 3.0))
    assert interval.columns("gap") == {"gap": 1.0, "gap_low": 1.0, "gap_high": 1.0}
    assert math.isnan(hypotheses.bootstrap_test([2.0, 2.0], 2.0).p)
    assert math.isnan(hypotheses.exchange_test([0.1] * 6, [0.1] * 7).p)  # no mean of 0.1 is 0.1


def test_without_spread_it_is_an_exact_test():
    """By signs of three values, all alike; by exchange of five and five."""
    for alternative, by_sign, by_exchange in (
        ("greater", 1 / 8, 1 / 252), ("two-sided", 2 / 8, 2 / 252), ("less", 1, 1)
    ):  # fmt: skip
        assert hypotheses.bootstrap_test([2.0] * 3, 1.0, alternative).p == by_sign
        assert hypotheses.exchange_test([2.0] * 5, [1.0] * 5, alternative).p == by_exchange


@pytest.mark.parametrize("values", [[], [[1.0]], [1.0, math.nan], [math.inf]])
def test_samples_are_vectors_of_finite_numbers(values):
    with pytest.raises(ValueError, match="the sample (is|has) .*; it must"):
        statistics.mean(values)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=6))
def test_holm_is_closed_testing_by_bonferroni(p_values):
    """Adjusted p: the largest Bonferroni p of all subfamilies that hold the hypothesis."""
    m = range(len(p_values))
    families = [f for k in m for f in itertools.combinations(m, k + 1)]
    expected = [
        max(min(1, len(f) * min(p_values[j] for j in f)) for f in families if i in f) for i in m
    ]
    assert hypotheses.holm(p_values) == pytest.approx(expected)


def test_holm_leaves_out_what_was_not_tested():
    assert hypotheses.holm([0.04, math.nan, 0.01, 0.03, math.nan]) == pytest.approx(
        [0.06, math.nan, 0.03, 0.06, math.nan], nan_ok=True
    )
    assert hypotheses.holm([]) == []
    planned = hypotheses.holm([0.01, math.nan, 0.02], 4)  # those that are missing count as p = 1
    assert planned == pytest.approx([0.04, math.nan, 0.06], nan_ok=True)


def test_rounding_is_no_spread():
    """A mean of equal numbers can differ from them in the last bit."""
    assert not statistics.centred(np.full((3, 2), 0.1)).any()
    assert not statistics.varies(np.zeros(3))
    assert not statistics.varies(np.array([1e9, 1e9 - 1.0]))  # by the share that is rounding
    assert statistics.varies(np.array([1e9, 1e9 - 2.0]))
    assert statistics.standard_deviation(np.full(3, 0.1)) == 0


def test_share_test():
    """20 of 20 where three quarters are expected: 0.75 to the 20th."""
    test = hypotheses.share_test(20, 20, 0.75, "greater")
    assert test.value == pytest.approx(0.25)
    assert test.p == pytest.approx(0.75**20)
    assert hypotheses.share_test(0, 20, 0.75, "less").p == pytest.approx(0.25**20)
    assert hypotheses.share_test(15, 20, 0.75, "greater").p > 0.5


def test_the_least_number_of_values_on_both_sides():
    """Below five values there is neither an interval nor a p."""
    four, five = [1.0, 2.0, 4.0, 4.5], [1.0, 2.0, 4.0, 4.5, 7.0]
    assert [math.isnan(statistics.mean(of).low) for of in (four, five)] == [True, False]
    for first, second in ((four, five), (five, four), (five, [5.0, 6.0, 9.0, 9.5, 9.7])):
        few = len(first) + len(second) < 10
        assert math.isnan(hypotheses.exchange_test(first, second).p) == few
        assert math.isnan(statistics.difference_of_means(first, second).low) == few
        strata = [(np.array(first), np.array(second))]
        assert math.isnan(hypotheses.stratified_test(strata)) == few
    assert math.isnan(hypotheses.bootstrap_test([1.0], 0).p)
    assert not math.isnan(hypotheses.bootstrap_test(four[:2], 0).p)
