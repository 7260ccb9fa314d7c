"""The simulation of error rates: what it counts, and what it draws from."""

import itertools

import numpy as np
import pytest

from analysis.calibration import error_rates
from analysis.calibration.error_rates import Check


def test_errors_are_counted_and_marked(monkeypatch):
    one_in_20 = itertools.cycle([True] + [False] * 19)
    plan = [
        Check("errs too often", "x", 0.05, lambda rng, seed: rng.random() < 0.2),
        Check("holds", "x", 0.05, lambda rng, seed: next(one_in_20)),
        Check("errs too seldom", "x", 0.05, lambda rng, seed: False),
    ]
    monkeypatch.setattr(error_rates, "checks", lambda: plan)
    table = error_rates.error_rates(2_000, seed=1, jobs=1)
    assert [row[-1] for row in table.rows] == ["+", "", "-"]
    assert table.rows[2][3].startswith("0.0% [0.0%, 0.2%]")
    assert table == error_rates.error_rates(2_000, seed=1, jobs=1)
    assert error_rates.simulate(plan[0], 5_000, 2) == pytest.approx(1_000, abs=4 * 28)


def test_populations_have_the_parameters_they_state():
    """Mean by sampling; interquartile mean by its definition on other draws."""
    for population in error_rates.populations():
        values = np.sort(population.draw(np.random.default_rng(5), 400_000))
        error = values.std() / np.sqrt(len(values))
        assert values.mean() == pytest.approx(population.mean, abs=5 * error)
        middle = values[100_000:300_000].mean()
        assert middle == pytest.approx(population.middle, abs=20 * error)


def test_every_check_runs():
    for check in error_rates.checks():
        assert error_rates.simulate(check, 1, 0) in (0, 1), check.subject
