"""The evolution strategy against the package ``cma``, and where it ends."""

import cma
import numpy as np
import pytest

from coartic.baselines.evolution import EvolutionStrategy

COSTS = {
    "whole ticks": lambda x: np.ceil(20.0 * np.sqrt((x**2).sum(axis=1))),
    "a slope": lambda x: x @ np.arange(1.0, x.shape[1] + 1.0),
    "a bent valley": lambda x: (
        100.0 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1.0 - x[:, :-1]) ** 2
    ).sum(axis=1),
}


@pytest.mark.parametrize(
    ("cost", "dim", "size"),
    [*zip(COSTS.values(), (11, 2, 20), (11, 6, 48), strict=True)],
    ids=COSTS,
)
def test_points_are_those_of_the_package_to_the_last_bit(cost, dim, size):
    theirs = np.random.default_rng(3)
    options = {"popsize": size, "seed": np.nan, "verbose": -9}
    options["randn"] = lambda *shape: theirs.standard_normal(shape)
    package = cma.CMAEvolutionStrategy(np.full(dim, 0.3), 0.05, options)
    strategy = EvolutionStrategy(np.full(dim, 0.3), 0.05, size, np.random.default_rng(3))
    generations = 0
    while not strategy.has_ended() and generations < 250:
        assert not package.stop()
        points = strategy.ask()
        np.testing.assert_array_equal(points, np.array(package.ask()))
        costs = cost(points)
        strategy.tell(points, costs)
        package.tell(list(points), costs.tolist())
        generations += 1
    assert generations > 10
    assert bool(package.stop()) == (generations < 250)


def generations_until_it_ends(cost, dim=5, most=3000):
    strategy = EvolutionStrategy(np.full(dim, 0.3), 0.05, 8, np.random.default_rng(0))
    for generation in range(most):
        if strategy.has_ended():
            return generation
        points = strategy.ask()
        assert np.isfinite(points).all()
        strategy.tell(points, cost(points))
    return most


def test_it_ends_where_going_on_is_of_no_use():
    weights = 10.0 ** np.arange(0.0, 15.0, 3.0)  # variances 1e12 apart
    noise = np.random.default_rng(1)
    assert generations_until_it_ends(lambda x: np.zeros(len(x))) == 1
    assert generations_until_it_ends(lambda x: noise.standard_normal(len(x))) < 3000
    assert 50 < generations_until_it_ends(lambda x: (x**2).sum(axis=1)) < 400
    assert generations_until_it_ends(lambda x: (weights * x**2).sum(axis=1)) < 1500
    assert generations_until_it_ends(lambda x: x[:, 0]) < 400  # steps grow a thousandfold
