"""Runs needed: sizes that others give, and simulation."""

import numpy as np
import pytest
from scipy import stats

from coartic.analysis.statistics.power import POWER, power, runs_needed


@pytest.mark.parametrize(("effect", "runs"), [(0.2, 310), (0.5, 51), (0.8, 21), (1.0, 14)])
def test_textbook_sizes_of_two_samples(effect, runs):
    """Power 0.8 at level 0.05, one-tailed, differences in SDs: as G*Power has them."""
    assert runs_needed(10 * effect, 10, 10) == runs
    assert runs_needed(-10 * effect, 10, 10) == runs


def test_one_sample_of_differences():
    """27 pairs for half an SD."""
    assert runs_needed(0.5, 1, 0) == 27


def test_large_sizes_are_those_of_the_normal_distribution():
    z = stats.norm.ppf(0.95) + stats.norm.ppf(0.8)
    assert runs_needed(0.01, 1, 2) == pytest.approx(z**2 * 5 / 0.01**2, rel=1e-4)


def test_the_size_is_the_smallest():
    for sds in ((3, 3), (7, 2), (12, 0)):
        runs = runs_needed(5, *sds)
        assert power(5, *sds, runs) >= POWER > power(5, *sds, runs - 1)


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
    assert power(1e6, 1, 1, 20) == pytest.approx(1)
    with pytest.raises(ValueError, match="needs a difference"):
        runs_needed(0, 1, 1)
    for sds, runs in (((1, 1), 1), ((1, -1), 5)):
        with pytest.raises(ValueError, match="power needs"):
            power(1, *sds, runs)
