"""The practised policy: what it sees, draws, learns and keeps, beside slow or exact checks."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_2samp

from coartic import PAPER, Robot, correct, execute, move
from coartic.method import Session
from coartic.tasks.families import broken_rule, draft, instance_of, read_family
from coartic.tasks.task import address_of
from tests.support.processes import program

practice = program(Path(__file__).parents[3] / "studies" / "practice" / "policy.py")
ROBOT, RIGHT, TRIALS = Robot(), slice(6, 10), 40 * practice.BATCH


@pytest.fixture(scope="module", autouse=True)
def _kept(tmp_path_factory):
    """Policies are kept for these tests alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(practice, "KEPT", tmp_path_factory.mktemp("kept"))
        yield


def ticks(network, q, goals, ahead):
    subtasks = practice.trial(network, q, goals, ahead, 0.1, PAPER)
    return np.array([subtask.reached[-1].ticks for subtask in subtasks])


@settings(max_examples=10)
@given(st.integers(0, 1000), st.floats(-3, 3), st.floats(-9, 9), st.sampled_from([-1, 1]))
def test_an_agent_does_the_same_wherever_it_stands_and_in_a_mirror(seed, angle, away, flip):
    network = practice.Network.draw(np.random.default_rng(seed), 28, 6, 1.0)  # it changes much
    q, goals = practice.draw_tasks(np.random.default_rng(seed), 4)
    cos, sin = math.cos(angle), math.sin(angle)

    def elsewhere(points):
        return (points * [1, flip]) @ [[cos, sin], [-sin, cos]] + [away, -away]

    there = q.copy()
    there[:, RIGHT] *= flip
    there[:, RIGHT.start] += angle
    there[:, :2] = elsewhere(q[:, :2] + ROBOT.right_shoulder) - ROBOT.right_shoulder
    different = ticks(network, there, elsewhere(goals), 2) - ticks(network, q, goals, 2)
    assert np.abs(different).max() <= 1  # rounding


def test_tasks_are_drawn_as_instances_are():
    family, fine = read_family(practice.FAMILY), (None, "corrective")  # but for A's failures
    q, goals = practice.draw_tasks(np.random.default_rng(1), 2000)
    drafts = [draft(family, address_of(f"eight/v1/2028-{k:03d}"), 0) for k in range(900)]
    tasks = [task for task in drafts if broken_rule(family, task) in fine]
    for angles, places in zip(q[:40, RIGHT].tolist(), goals[:40].tolist(), strict=True):
        start = tasks[0].start.model_copy(update={"right": tuple(angles)})
        drawn = tasks[0].model_copy(update={"goals": tuple(map(tuple, places)), "start": start})
        assert broken_rule(family, drawn) in fine
    theirs = np.array([task.q0 for task in tasks]), np.array([task.goal_array for task in tasks])
    ours, theirs = (
        [*starts[:, RIGHT].T, *places[:, 0].T, *np.ptp(places, axis=1).T]
        for starts, places in ((q, goals), theirs)
    )
    assert min(ks_2samp(*pair).pvalue for pair in zip(ours, theirs, strict=True)) > 1e-3


def test_a_step_of_a_network_goes_against_its_gradient():
    rng = np.random.default_rng(0)
    network = practice.Network.draw(rng, 5, 2, 1.0)
    inputs, wanted = (rng.standard_normal((64, n)) for n in (5, 2))
    before = [weight.astype(np.float64) for weight in network.weights]
    layers = network.layers(inputs)
    network.descend(layers, layers[-1] - wanted, 1e-3)

    def loss(k, place, by):
        weights = [weight.copy() for weight in before]
        weights[k][place] += by
        return ((practice.Network(weights)(inputs) - wanted) ** 2).sum() / 2

    for k, weight in enumerate(before):
        for place in map(tuple, rng.integers(weight.shape, size=(4, weight.ndim))):
            rise = loss(k, place, 1e-5) - loss(k, place, -1e-5)
            step = network.weights[k][place] - weight[place]
            assert step == pytest.approx(-1e-3 * np.sign(rise), rel=0.01)


def test_the_slope_is_that_of_the_clipped_objective():
    rng, sd = np.random.default_rng(0), 0.4
    before, noise, other, gain = (rng.standard_normal((32, 6)) for _ in range(4))
    action, mean, gain = before + sd * noise, before + 0.1 * other, gain[:, 0]

    def objective(means):
        farther = ((action - means) ** 2 - (action - before) ** 2).sum(axis=1)
        ratio = np.exp(-farther / (2 * sd**2))
        return np.minimum(ratio * gain, np.clip(ratio, 0.8, 1.2) * gain).mean()

    slopes = practice.slope_of(mean, before, action, gain, sd)
    for step in 1e-6 * rng.standard_normal((20, 32, 6)):
        expected = (objective(mean - step) - objective(mean + step)) / 2
        assert (slopes * step).sum() == pytest.approx(expected, rel=1e-3, abs=1e-12)


@pytest.mark.parametrize("name", ["eight/v1/d000", "eight/v1/d001"])
def test_the_trial_is_that_of_a_plain_loop(name):
    task = instance_of(read_family(practice.FAMILY), address_of(name))
    session, total, q = Session(task, 0, practice.Practised.information), 0, np.array(task.q0)
    method = practice.Practised(practice.PracticeParameters(practice=TRIALS, agent=3))
    result, policy = method.solve(session), practice.recall(1, 3, TRIALS, PAPER)
    for number, goal in enumerate(task.goals):
        posture, view = correct(ROBOT, q, "right", goal).q, task.goal_array[number : number + 2]
        seen = practice.observe(q[None], posture[None], view[None], 1)
        changes = policy(seen) * np.sqrt(np.linalg.norm(q - posture))
        target = correct(ROBOT, practice.change(posture[None], changes)[0], "right", goal).q
        moved = move(ROBOT, q, target, "right", goal, task.radius)
        q, total = moved.q, total + moved.ticks
    assert execute(task, result.solution).ticks == session.meter.movement_ticks == total


def test_practice_helps_on_other_tasks():
    policy = practice.recall(1, 3, TRIALS, PAPER)
    tasks = practice.draw_tasks(np.random.default_rng(5), 300)
    nothing = practice.Network([np.zeros_like(weight) for weight in policy.weights])
    before, after = (ticks(network, *tasks, 1).sum(axis=0) for network in (nothing, policy))
    assert (before - after).mean() > max(0.02 * before.mean(), 3 * (before - after).std() / 17)


def test_practice_is_kept(monkeypatch):
    few = 5 * practice.BATCH
    *_, (_, practised) = practice.practise(1, 3, few, PAPER)
    practice.recall(1, 3, few, PAPER)
    monkeypatch.setattr(practice, "practise", None)
    practice.recall.cache_clear()
    kept = practice.recall(1, 3, few, PAPER)
    assert all(map(np.array_equal, kept.weights, practised.weights))
