"""Statistics over instances: planted components, differences and slopes come back."""

import math

import numpy as np
import pytest

from coartic.analysis.statistics.estimates import NO_SPREAD
from coartic.analysis.statistics.instances import (
    Paired,
    chance,
    components,
    other_tasks,
    paired,
)
from coartic.analysis.statistics.power import power


def simulated(rng, instances, runs, *, between=0.1, within=0.05, mean=0.3):
    """Scores of one method: instances vary about the mean, runs about their instance."""
    centres = rng.normal(mean, between, instances)
    return [(rng.normal(centre, within, runs),) for centre in centres]


def test_the_interval_speaks_about_other_tasks():
    """It covers the mean of the distribution that instances are drawn from, at its level."""
    rng = np.random.default_rng(1)
    covered = 0
    for _ in range(150):
        found = other_tasks({f: simulated(rng, 8, 10) for f in "ab"}, seed=0)
        covered += found.low <= 0.3 <= found.high
    # A percentile interval of 2 x 8 instances; 0.95 ± 3 standard errors, and short by a little.
    assert 0.895 <= covered / 150 <= 0.985


def test_runs_do_not_stand_for_tasks():
    """A thousand runs on four instances leave the interval as wide as the instances make it."""
    rng = np.random.default_rng(2)
    wide = other_tasks({"a": simulated(rng, 4, 1000)}, seed=0)
    narrow = other_tasks({"a": simulated(rng, 64, 10)}, seed=0)
    assert wide.high - wide.low > 2.5 * (narrow.high - narrow.low)


def test_width_of_the_interval():
    """The root of the variance of instances over their number, twice 1.96 times."""
    centres = np.linspace(-1, 1, 40)
    found = other_tasks({"a": [(np.full(3, c),) for c in centres]}, seed=0)
    assert found.estimate == pytest.approx(0)
    assert found.high - found.low == pytest.approx(
        2 * 1.96 * centres.std(ddof=1) / math.sqrt(40), rel=0.08
    )
    # Runs add their own: variance 1 of each of 4.
    runs = np.array([-1.0, 1.0, -1.0, 1.0]) * math.sqrt(3 / 4)
    noisy = other_tasks({"a": [(c + runs,) for c in centres]}, seed=0)
    wider = math.sqrt((centres.var(ddof=1) + 3 / 4 / 4) / 40)
    assert noisy.high - noisy.low == pytest.approx(2 * 1.96 * wider, rel=0.08)


def test_families_count_alike_whatever_their_number_of_instances():
    many = [(np.array([1.0]),)] * 30
    few = [(np.array([0.0, 0.0]),)] * 3
    found = other_tasks({"many": many, "few": few}, seed=0)
    assert (found.estimate, found.low, found.high, found.note) == (0.5, 0.5, 0.5, NO_SPREAD)
    assert found.n == (30, 3)
    none = other_tasks({"many": many, "few": few[:2]}, seed=0)
    assert math.isnan(none.low)
    assert "fewer than 3 instances" in none.note
    with pytest.raises(ValueError, match="one instance"):
        other_tasks({}, seed=0)


def test_a_pair_is_the_difference_on_the_same_instance():
    """What makes an instance hard for both has no part in it."""
    rng = np.random.default_rng(3)
    hard = rng.normal(0, 5, 20)
    pairs = [(rng.normal(h + 0.5, 0.1, 10), rng.normal(h, 0.1, 10)) for h in hard]
    found = other_tasks({"a": pairs}, seed=4)
    assert found.low < 0.5 < found.high
    assert found.high - found.low < 0.1
    assert found == other_tasks({"a": pairs}, seed=4)
    swapped = other_tasks({"a": [(b, a) for a, b in pairs]}, seed=4)
    assert swapped.estimate == pytest.approx(-found.estimate)


def test_planted_components_come_back():
    rng = np.random.default_rng(5)
    instances, methods, runs = 300, 12, 6
    method = np.linspace(-1, 1, methods)
    hard = rng.normal(0, 2.0, instances)
    scores = {}
    for m in range(methods):
        suits = rng.normal(0, 0.7, instances)
        means = method[m] + hard + suits
        scores[f"m{m}"] = [rng.normal(mean, 0.4, runs) for mean in means]
    found = components(scores)
    assert found.method == pytest.approx(method.var(ddof=1), rel=0.1)
    assert found.instance == pytest.approx(4.0, rel=0.2)
    assert found.interaction == pytest.approx(0.49, rel=0.1)
    assert found.seed == pytest.approx(0.16, rel=0.05)
    assert sum(found.shares().values()) == pytest.approx(1)


def test_components_without_any():
    alike = [np.array([0.5]), np.array([0.5, 0.5])]
    assert math.isnan(components({"a": alike, "b": alike}).shares()["seed"])
    with pytest.raises(ValueError, match="two methods"):
        components({"a": alike})
    with pytest.raises(ValueError, match="same instances"):
        components({"a": alike, "b": alike[:1]})


def test_planted_difference_and_its_variance():
    rng = np.random.default_rng(6)
    true = rng.normal(0.02, 0.03, 800)
    first = [rng.normal(0.5 + d, 0.1, 10) for d in true]
    second = [rng.normal(0.5, 0.05, 10) for _ in true]
    found = paired(first, second)
    assert found.mean == pytest.approx(0.02, abs=0.005)
    assert found.between == pytest.approx(0.0009, rel=0.2)
    assert found.within == pytest.approx((0.01, 0.0025), rel=0.1)
    assert found.variance(10) == found.between + sum(found.within) / 10


def test_instances_that_show_a_difference():
    """As the noncentral t distribution has it, within the steps of the search."""
    found = Paired(0.0, 0.0, (0.0009, 0.0007))
    count = found.needed(0.01, 1)
    assert 0.8 <= chance(0.01, 0.04, count, 0.05) < 0.82
    assert chance(0.01, 0.04, math.floor(count / 1.03), 0.05) < 0.8
    assert found.needed(0.01, 100) < 10 < count
    assert Paired(0.0, 0.0, (0.0, 0.0)).needed(0.01, 1) == 3
    assert chance(0.5, 1.0, 20, 0.05, tails=1) == pytest.approx(power(0.5, 1.0, 0.0, 20, 0.05))
    rng = np.random.default_rng(7)
    drawn = rng.normal(0.5, 1.0, (4000, 20))
    t = drawn.mean(axis=1) / drawn.std(axis=1, ddof=1) * math.sqrt(20)
    assert chance(0.5, 1.0, 20, 0.05) == pytest.approx((np.abs(t) > 2.093).mean(), abs=0.03)
    with pytest.raises(ValueError, match="difference of 0"):
        found.needed(0.0, 1)
