"""The evolution strategy against the package ``cma``, and where it ends."""

from functools import reduce
from operator import add

import cma
import numpy as np
import pytest
from cma import recombination_weights

from coartic.baselines.cma_strategy import EvolutionStrategy

NOISE = np.random.default_rng(1)
COSTS = {
    "whole ticks": (lambda x: np.ceil(20.0 * np.sqrt((x**2).sum(axis=1))), 11, 11),
    "a slope": (lambda x: x @ np.arange(1.0, x.shape[1] + 1.0), 2, 6),
    "a bent valley": (
        lambda x: (100.0 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1.0 - x[:, :-1]) ** 2).sum(axis=1),
        4, 16,
    ),
    "a plain": (lambda x: np.zeros(len(x)), 5, 8),
    "noise": (lambda x: NOISE.standard_normal(len(x)), 3, 7),
    "variances 1e12 apart": (lambda x: x**2 @ 10.0 ** np.arange(0.0, 15.0, 3.0), 5, 8),
}  # fmt: skip


@pytest.mark.parametrize(("cost", "dim", "size"), COSTS.values(), ids=COSTS)
def test_points_and_the_end_are_those_of_the_package_to_the_last_bit(cost, dim, size, monkeypatch):
    # The package rounds sums as its Python does, otherwise from Python 3.12 on.
    monkeypatch.setattr(recombination_weights, "sum", lambda w: reduce(add, w, 0), raising=False)
    theirs = np.random.default_rng(3)
    options = {"popsize": size, "seed": np.nan, "verbose": -9}
    options["randn"] = lambda *shape: theirs.standard_normal(shape)
    package = cma.CMAEvolutionStrategy(np.full(dim, 0.3), 0.05, options)
    strategy = EvolutionStrategy(np.full(dim, 0.3), 0.05, size, np.random.default_rng(3))
    generations = 0
    while not strategy.has_ended() and generations < 1500:
        assert not package.stop()
        points = strategy.ask()
        np.testing.assert_array_equal(points, np.array(package.ask()))
        costs = cost(points)
        strategy.tell(points, costs)
        package.tell(list(points), costs.tolist())
        generations += 1
    assert generations < 1500
    # It ends where variances are 1e12 apart, which the package does not.
    assert bool(package.stop()) == (cost is not COSTS["variances 1e12 apart"][0])
