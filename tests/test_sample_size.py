"""Runs needed: printed tables of power analysis, and simulation."""

import numpy as np
import pytest
from scipy import stats

from analysis.statistics.power import power, runs_needed, smallest_difference


@pytest.mark.parametrize(
    ("effect", "tails", "runs"),
    [(0.2, 2, 394), (0.5, 2, 64), (0.8, 2, 26), (0.5, 1, 51), (0.8, 1, 21)],
)
def test_textbook_sizes_of_two_samples(effect, tails, runs):
    """Cohen (1988), tables 2.4: power 0.8 at level 0.05, differences in SDs."""
    assert runs_needed(10 * effect, 10, 10, tails=tails) == runs
    assert runs_needed(-10 * effect, 10, 10, tails=tails) == runs


def test_one_sample_of_differences():
    """34 pairs for half an SD, two-tailed."""
    assert runs_needed(0.5, 1, 0, tails=2) == 34


def test_large_sizes_are_those_of_the_normal_distribution():
    z = stats.norm.ppf(0.95) + stats.norm.ppf(0.8)
    assert runs_needed(0.01, 1, 2) == pytest.approx(z**2 * 5 / 0.01**2, rel=1e-4)


def test_the_size_is_the_smallest():
    for sds in ((3, 3), (7, 2), (12, 0)):
        runs = runs_needed(5, *sds, target=0.9, level=0.01)
        assert power(5, *sds, runs, level=0.01) >= 0.9 > power(5, *sds, runs - 1, level=0.01)


@pytest.mark.parametrize("sds", [(4.0, 4.0), (3.0, 9.0)])
def test_power_in_simulation(sds):
    rng = np.random.default_rng(20)
    runs, simulations = runs_needed(4, *sds), 4_000
    a = rng.normal(4, sds[0], (simulations, runs))
    b = rng.normal(0, sds[1], (simulations, runs))
    found = stats.ttest_ind(a, b, axis=1, equal_var=False, alternative="greater").pvalue < 0.05
    expected = power(4, *sds, runs)
    assert found.mean() == pytest.approx(expected, abs=4 * np.sqrt(0.16 / simulations) + 0.01)


def test_power_of_rewards_with_two_levels():
    """A guide, not a promise: within 5 points for a mixture like two-armed-2 under EC4."""
    rng = np.random.default_rng(21)
    simulations, mixture_sd = 4_000, np.sqrt(0.7 * 49 + 0.3 + 0.21 * 24**2)
    runs = runs_needed(8, mixture_sd, 2)
    level = rng.random((simulations, runs)) < 0.7
    a = np.where(level, rng.normal(-331, 7, level.shape), rng.normal(-355, 1, level.shape))
    b = rng.normal(0.7 * -331 + 0.3 * -355 - 8, 2, level.shape)
    found = stats.ttest_ind(a, b, axis=1, equal_var=False, alternative="greater").pvalue < 0.05
    assert found.mean() == pytest.approx(0.8, abs=0.05)


def test_limits():
    assert runs_needed(1, 0, 0) == 2
    assert power(0, 1, 1, 20) == pytest.approx(0.05)
    assert power(0, 0, 0, 20) == 0
    assert power(1e3, 1, 1, 20) == pytest.approx(1)
    for wrong in ((0, 1, 1, 0.8), (1, 1, 1, 1.0), (1, 1, 1, 0.01)):
        with pytest.raises(ValueError, match="needs a difference"):
            runs_needed(*wrong[:3], target=wrong[3])
    for runs, tails in ((1, 1), (5, 3)):
        with pytest.raises(ValueError, match="power needs"):
            power(1, 1, 1, runs, tails=tails)


def test_two_tails_far_out():
    """Far beyond the critical value scipy's cdf of the other tail is NaN."""
    assert power(15, 4, 4, 20, tails=2) == pytest.approx(1)
    assert runs_needed(300, 1, 1, tails=2) == 2


@pytest.mark.parametrize("tails", [1, 2])
@pytest.mark.parametrize("sds", [(3, 3), (7, 2), (12, 0)])
def test_the_smallest_difference_is_what_the_runs_find(sds, tails):
    found = smallest_difference(*sds, 20, tails=tails)
    assert power(found, *sds, 20, tails=tails) == pytest.approx(0.8, abs=1e-6)
    assert (
        runs_needed(found * 1.0001, *sds, tails=tails)
        <= 20
        < runs_needed(found * 0.98, *sds, tails=tails)
    )


def test_the_smallest_difference_of_textbooks_and_without_spread():
    """Cohen (1988), table 2.4: 64 runs of each find half an SD, two-tailed."""
    assert smallest_difference(10, 10, 64, tails=2) == pytest.approx(5, abs=0.03)
    assert smallest_difference(0, 0, 5) == 0
    with pytest.raises(ValueError, match="power between"):
        smallest_difference(1, 1, 5, target=1.0)
