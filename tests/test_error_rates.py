"""The simulation of error rates: what it counts, and what it draws from."""

import itertools

import numpy as np
import pytest

from coartic.analysis.calibration import error_rates
from coartic.analysis.calibration.simulation import Check, lines, rate


def test_errors_are_counted_and_marked():
    one_in_20 = itertools.cycle([True] + [False] * 19)
    often = Check("errs too often", "x", lambda rng: rng.random() < 0.2, 0.05)
    holds = Check("holds", "x", lambda rng: next(one_in_20), 0.05)
    seldom = Check("errs too seldom", "x", lambda rng: False, 0.05)
    unknown = Check("promises nothing", "x", lambda rng: True)

    def said():
        sections = {"Errs": [often, holds], "More": [seldom, unknown]}
        return list(lines(sections, 2_000, lambda number, check: number, "wilson"))

    first, second, third, fourth = [line for line in said() if ", x" in line]
    assert first.endswith("ABOVE")
    assert second.endswith("]")
    assert third.endswith("0.00%  [0.00%, 0.19%]  BELOW")
    assert fourth.endswith("]")
    assert said() == said()
    found = rate(often, 5_000, 2)
    assert found.value == pytest.approx(0.2, abs=4 * 28 / 5_000)
    again, other = (rate(often, 5_000, seed) for seed in (2, 3))
    assert found[:3] == again[:3] != other[:3]


def test_populations_have_the_parameters_they_state():
    """Mean by sampling; interquartile mean by its definition on other draws."""
    for population in error_rates.populations():
        values = np.sort(population.draw(np.random.default_rng(5), 100_000))
        error = values.std() / np.sqrt(len(values))
        assert values.mean() == pytest.approx(population.mean, abs=5 * error)
        middle = values[25_000:75_000].mean()
        assert middle == pytest.approx(population.middle, abs=20 * error)


def test_every_check_runs():
    for check in error_rates.checks():
        assert rate(check, 1, 0).value in (0, 1), check.name
