"""The posture graph: its dynamic programme against every chain, one by one."""

import itertools

import numpy as np
import pytest

from coartic import load_task
from coartic.baselines.posture_graph import chains_of, move_other_arm, sample_layers
from tests.support.strategies import steps_from


def cheapest(task, layers, hands):
    """Every combination of nodes, one by one."""
    best = np.inf
    for nodes in itertools.product(*(layers[key] for key in enumerate(hands))):
        length, before = 0.0, np.array(task.q0)
        for hand, node in zip(hands, nodes, strict=True):
            q = before.copy()
            q[:2], joints = node[:2], task.robot.joints(hand)
            q[joints] = node[joints]
            length += np.linalg.norm(q - before)
            before = q
        best = min(best, length)
    return best


def length_of(task, configurations):
    return np.linalg.norm(steps_from(task.q0, configurations), axis=1).sum()


@pytest.mark.parametrize("name", ["two-armed-2", "ascending"])
def test_chains_are_the_cheapest(name):
    task = load_task(name)
    layers, _ = sample_layers(task, 3, np.random.default_rng(3))
    chains = dict(chains_of(task, layers))
    assert len(chains) == len(task.hands) ** len(task.goals)
    for hands, configurations in chains.items():
        steps = steps_from(task.q0, configurations)
        assert length_of(task, configurations) == pytest.approx(cheapest(task, layers, hands))
        for goal, hand in enumerate(hands):
            (other,) = {"left", "right"} - {hand}
            assert np.all(steps[goal][task.robot.joints(other)] == 0.0)
            miss = task.robot.forward_kinematics(configurations[goal], hand)
            assert np.hypot(*(miss - task.goals[goal])) <= task.radius


def test_a_free_arm_is_spread_over_its_way():
    task = load_task("two-armed-2")
    layers, _ = sample_layers(task, 10, np.random.default_rng(6))
    hands = ("left", "right", "right", "left")
    chain = dict(chains_of(task, layers))[hands]
    spread = move_other_arm(task, hands, chain)
    left = task.robot.joints("left")
    first, last = chain[0, left], chain[3, left]
    assert spread[1, left] == pytest.approx(first + (last - first) / 3)
    assert np.array_equal(spread[[0, 3]][:, left], chain[[0, 3]][:, left])
    assert np.array_equal(spread[:, :2], chain[:, :2])


def test_a_beam_keeps_the_cheapest_beginnings():
    task = load_task("two-armed-1")
    layers, _ = sample_layers(task, 12, np.random.default_rng(8))
    by_hands = dict(chains_of(task, layers))
    assert list(by_hands) == list(itertools.product(("left", "right"), repeat=4))
    for most in (1, 5, 16):
        kept = chains_of(task, layers, most)
        assert len(kept) == most
        for hands, configurations in kept:
            assert np.array_equal(configurations, by_hands[hands])
    best = min(by_hands, key=lambda hands: length_of(task, by_hands[hands]))
    assert best in dict(chains_of(task, layers, 5))
