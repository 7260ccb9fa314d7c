"""Kaplan–Meier medians: published data, exact arithmetic, coverage."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coartic.analysis.statistics.intervals import kaplan_meier_median

# Remission times in weeks of Freireich et al. (1963), as printed by Cox (1972): 6-MP and
# placebo; False where the patient was still in remission.
TREATED = [
    (6, True), (6, True), (6, True), (6, False), (7, True), (9, False), (10, True), (10, False),
    (11, False), (13, True), (16, True), (17, False), (19, False), (20, False), (22, True),
    (23, True), (25, False), (32, False), (32, False), (34, False), (35, False),
]  # fmt: skip
PLACEBO = [1, 1, 2, 2, 3, 4, 4, 5, 5, 8, 8, 8, 8, 11, 11, 12, 12, 15, 17, 22, 23]


def product_limit(times, reached):
    """First time at which S ≤ 1/2, in exact arithmetic."""
    survival = Fraction(1)
    for time in sorted(set(times)):
        at_risk = sum(other >= time for other in times)
        events = sum(r for t, r in zip(times, reached, strict=True) if t == time)
        survival *= 1 - Fraction(events, at_risk)
        if survival <= Fraction(1, 2):
            return time
    return math.inf


def test_remission_times():
    """Medians 23 and 8 weeks; log-log intervals as R's survfit and SAS give them."""
    times, reached = zip(*TREATED, strict=True)
    found = kaplan_meier_median(times, reached)
    assert (found.value, found.low, found.high) == (23, 13, math.inf)
    found = kaplan_meier_median(PLACEBO, [True] * 21)
    assert (found.value, found.low, found.high) == (8, 4, 11)


@given(st.lists(st.tuples(st.integers(0, 12), st.booleans()), min_size=1, max_size=14))
def test_the_median_is_that_of_the_product_limit(sample):
    times, reached = zip(*sample, strict=True)
    found = kaplan_meier_median(times, reached)
    assert found.value == product_limit(times, reached)
    assert found.low <= found.value <= found.high


def test_few_runs_bound_nothing():
    """Six runs at one time are the fewest that show a median: 2 · 2⁻⁶ < 0.05."""
    for n in (1, 2, 5):
        found = kaplan_meier_median([4.0] * n, [True] * n)
        assert (found.value, found.low, found.high) == (4, 0, math.inf)
    found = kaplan_meier_median([4.0] * 6, [True] * 6)
    assert (found.value, found.low, found.high) == (4, 4, 4)


def test_those_who_never_reach_it_count():
    times = [1.0, 2.0, 3.0, 4.0] + [math.inf] * 6
    assert math.isinf(kaplan_meier_median(times, np.isfinite(times)).value)
    times = [1.0, 2.0, 3.0, 4.0, 5.0] + [math.inf] * 5
    assert kaplan_meier_median(times, np.isfinite(times)).value == 5
    nobody = kaplan_meier_median([3.0] * 10, [False] * 10)
    assert (nobody.value, nobody.low, nobody.high) == (math.inf,) * 3
    with pytest.raises(ValueError, match="no times"):
        kaplan_meier_median([], [])


def test_intervals_cover_the_median():
    """20 exponential times, censored where 70 % have come: median log 2."""
    rng = np.random.default_rng(1)
    horizon = -math.log(0.3)
    hits = 0
    for _ in range(500):
        times = rng.exponential(size=20)
        found = kaplan_meier_median(np.minimum(times, horizon), times <= horizon)
        hits += found.low <= math.log(2) <= found.high
    assert 0.93 <= hits / 500 < 1
