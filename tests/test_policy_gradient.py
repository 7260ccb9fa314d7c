"""The policy gradient against closed forms, on rewards that are known functions."""

from types import SimpleNamespace

import numpy as np
import pytest

from coartic import MotionModel, execute_noisy, load_task
from coartic.baselines.policy_gradient import Policy, PolicyGradient, PolicyGradientParameters
from tests.support.strategies import solve


class Plain:
    """Trials with a reward that is a function of the targets ``(N, n)``, and noise."""

    def __init__(self, reward, dim, noise=0.0):
        self.left, self.explored = 10**8, np.ones((1, dim), dtype=bool)
        self._reward, self._noise = reward, noise
        self._rng = np.random.default_rng(7)

    def run_corrective(self, hands):
        reached = np.zeros((1, *self.explored.shape))
        return SimpleNamespace(rewards=np.array([-300.0]), reached=reached)

    def around(self, hands, values):
        noise = self._noise * self._rng.standard_normal(len(values))
        return SimpleNamespace(rewards=self._reward(values) + noise)


def policy_on(plain, seed=0, **parameters):
    rng = np.random.default_rng(seed)
    return Policy(rng, plain, "R", PolicyGradientParameters(**parameters))


def quadratic(optimum, curvature):
    return lambda x: -0.5 * ((x - optimum) ** 2 * curvature).sum(axis=1) - 100.0


OPTIMUM = np.array([0.4, -0.3, 0.2, 0.0])
CURVATURE = np.array([2e3, 2e3, 4e3, 0.0])


def test_a_step_is_the_gradient_of_the_expected_reward():
    """By Stein's lemma E[R z] = -c s (m - x*) and E[R (z² - 1)] = -c s² for curvature c and spread
    s. Noise makes the reward nearly normal: d is then its SD, and the clip hardly ever acts."""
    spread, noise = 0.05, 50.0
    curvature, optimum = np.array([2e3, -8e3, 0.0, 8e3]), np.array([0.1, 0.02, 0.3, 0.0])
    plain = Plain(quadratic(optimum, curvature), 4, noise)
    policy = policy_on(plain, sigma=spread, batch=1_000_000, step=0.7, spread_step=0.2)
    policy.generation()
    quadratic_variance = (curvature**2 * spread**2 * (optimum**2 + spread**2 / 2)).sum()
    sd = np.sqrt(noise**2 + quadratic_variance)
    mean = 0.7 * spread * curvature * spread * optimum / sd
    np.testing.assert_allclose(policy.mean, mean, atol=0.02 * np.abs(mean).max())
    change = -0.2 * curvature * spread**2 / sd
    moved = policy.log_spread - np.log(spread)
    np.testing.assert_allclose(moved, change, atol=0.02 * np.abs(change).max())


def test_mean_and_spread_go_where_the_reward_is():
    """The mean goes to the optimum. The spread shrinks to its lower bound where the reward has a
    maximum, and stays larger where it does not depend on the coordinate."""
    plain = Plain(quadratic(OPTIMUM, CURVATURE), 4, noise=2.0)
    policy = policy_on(plain, batch=50, step=2.0, spread_step=0.2)
    errors, spreads = [], []
    for _ in range(400):
        policy.generation()
        errors.append(np.abs(policy.mean - OPTIMUM)[:3].max())
        spreads.append(np.exp(policy.log_spread))
    assert np.mean(errors[-100:]) < 0.01 < 0.2 < errors[0]
    last = np.mean(spreads[-100:], axis=0)
    assert (last[:3] < 0.01).all()
    assert np.min(spreads) == pytest.approx(0.005)
    assert last[3] > 3 * last[:3].max()


def test_the_spread_grows_at_a_minimum():
    """Up to its upper bound, while the mean hardly moves."""
    plain = Plain(lambda x: 1e3 * (x**2).sum(axis=1) - 300.0, 2, noise=2.0)
    policy = policy_on(plain, batch=50, step=1e-3, spread_step=0.2)
    for _ in range(100):
        policy.generation()
    assert np.exp(policy.log_spread) == pytest.approx(0.3)


def test_a_fixed_spread_stays():
    plain = Plain(quadratic(OPTIMUM, CURVATURE + 1e3), 4, noise=2.0)
    policy = policy_on(plain, sigma=0.04, spread="fixed", batch=50, step=2.0, spread_step=5.0)
    means = []
    for _ in range(400):
        policy.generation()
        means.append(policy.mean)
    assert (policy.log_spread == np.log(0.04)).all()
    np.testing.assert_allclose(np.mean(means[200:], axis=0), OPTIMUM, atol=0.01)
    wide = policy_on(plain, sigma=0.5, spread="fixed", batch=50)  # beyond a learned one's bounds
    wide.generation()
    assert (wide.log_spread == np.log(0.5)).all()


def test_what_is_better_for_all_targets_alike_moves_nothing():
    """Rewards that rise from the first batch to the second, whatever the targets: advantages are
    then positive, but their products with z and z² - 1 have a mean of 0."""
    rise = [0.0]
    plain = Plain(lambda x: np.full(len(x), rise[0] - 100.0), 4, noise=10.0)
    policy = policy_on(plain, batch=100_000, step=1.0, spread_step=0.2)
    policy.generation()
    rise[0] = 20.0
    policy.generation()
    np.testing.assert_allclose(policy.mean, 0.0, atol=0.05 * 0.05)
    np.testing.assert_allclose(policy.log_spread, np.log(0.05), atol=0.2 * 0.05)


def test_a_unit_of_reward_does_not_matter():
    """Advantages have none: as long as the reward varies by more than a tick, a scaled and shifted
    reward leads to the same policy."""
    reward = quadratic(OPTIMUM, CURVATURE + 1e3)
    policies = [
        policy_on(Plain(each, 4), batch=20, step=1.0, spread_step=0.2)
        for each in (reward, lambda x: 8.0 * reward(x) - 64.0)
    ]
    for _ in range(20):
        for policy in policies:
            policy.generation()
        np.testing.assert_allclose(policies[0].mean, policies[1].mean, rtol=1e-9)
        np.testing.assert_allclose(policies[0].log_spread, policies[1].log_spread, rtol=1e-9)
    assert np.abs(policies[0].mean - OPTIMUM).max() < 0.3


def test_below_a_tick_differences_are_not_blown_up():
    """A reward that hardly varies hardly moves the policy: d is at least a tick."""
    plain = Plain(lambda x: 0.001 * x.sum(axis=1) - 100.0, 4)
    policy = policy_on(plain, batch=50, step=2.0, spread_step=0.2)
    for _ in range(20):
        policy.generation()
    assert 0.0 < np.abs(policy.mean).max() < 1e-3


def test_an_outlier_moves_the_mean_by_a_bounded_step():
    """With one trial of a million ticks in a batch, A is at least -3."""
    outlier = [0.0]

    def reward(x):
        rewards = quadratic(OPTIMUM, CURVATURE + 1e3)(x)
        rewards[0] -= outlier[0]
        return rewards

    policy = policy_on(Plain(reward, 4), batch=10, step=1.0, spread_step=0.2, spread="fixed")
    for _ in range(30):
        policy.generation()
    before, outlier[0] = policy.mean, 1e6
    policy.generation()
    assert 0.0 < np.abs(policy.mean - before).max() < 0.05 * 3.0 * 2.0  # of E|z| = 0.8


def test_failed_trials_and_an_incomplete_batch():
    """The optimum is in the region where trials fail: the mean goes up to it and no further. While
    all trials fail, nothing is learned, and nothing from a batch that is cut short."""
    plain = Plain(quadratic(OPTIMUM, CURVATURE + 1e3), 4, noise=2.0)
    wanted, edge, failed = plain._reward, [0.2], []

    def reward(x):
        failed.append((x[:, 0] > edge[0]).mean())
        return np.where(x[:, 0] > edge[0], -np.inf, wanted(x))

    plain._reward = reward
    policy = policy_on(plain, batch=50, step=2.0, spread_step=0.2)
    for _ in range(300):
        policy.generation()
    assert policy.mean[0] == pytest.approx(edge[0], abs=0.05)
    assert 0.0 < np.mean(failed[100:]) < 0.5
    assert policy.reward <= wanted(np.array([[0.2, *OPTIMUM[1:]]]))[0] + 10.0
    before, edge[0] = (*policy.mean, *policy.log_spread), 1.0
    plain.left = 49
    policy.generation()
    assert (*policy.mean, *policy.log_spread) == before
    hopeless = policy_on(Plain(lambda x: np.full(len(x), -np.inf), 4), batch=20)
    for _ in range(5):
        hopeless.generation()
    assert (hopeless.mean == 0.0).all()


def test_an_answer_in_noise_is_a_mean():
    """With a fixed spread of 1e-6 and tiny steps it stays at the postures of the first trial."""
    task, world = load_task("two-armed-1"), MotionModel(motor_noise=0.01)
    options = {"sigma": 1e-6, "spread": "fixed", "step": 1e-3, "sequence": "LRLR", "model": world}
    result, *_ = solve(PolicyGradient, task, trials=500, **options)
    first, *_ = solve(PolicyGradient, task, trials=1, **options)
    targets, start = ([m.target for m in each.solution] for each in (result, first))
    np.testing.assert_allclose(targets, start, atol=1e-3)
    learned, *_ = solve(PolicyGradient, task, trials=3000, sequence="LRLR", model=world)
    ticks = execute_noisy(task, [learned.solution, first.solution], 0.01, 50, 0).mean(axis=1)
    assert ticks[0] < 0.95 * ticks[1]
