"""Arms that reach for goals side by side against the same movements made one by one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import PAPER, MotionModel, Robot, correct, move
from coartic.motion.lanes import LANES
from coartic.motion.reach import Reached, reach_unchecked
from coartic.robot import HANDS
from tests.support import reference
from tests.support.strategies import UNEVEN

RADIUS = 0.1
MODELS = [
    PAPER,
    MotionModel(max_iterations=60),
    MotionModel(corrective_arrival=True, arrival_tolerance=0.09),
    MotionModel(whole_last_step=True),
    MotionModel(first_step=True),
]


def arms(rng, robot, count):
    """Configurations, hands, goals and targets: few goals, near and far, for many arms."""
    q = rng.uniform(-1.5, 1.5, (count, robot.dof))
    hands = [HANDS[k] for k in rng.integers(2, size=count)]
    near = [robot.forward_kinematics(each, hand) for each, hand in zip(q, hands, strict=True)]
    goals = np.array(near) + rng.normal(0, 1, (count, 2)) * rng.choice([0.05, 0.5], (count, 1))
    goals = goals[rng.integers(max(1, count // 3), size=count)]
    targets = q + rng.normal(0, 1, q.shape) * rng.choice([0.0, 0.05, 0.3], (count, 1))
    targets[rng.random(q.shape) < 0.2] = np.nan
    targets[rng.random(count) < 0.3] = np.nan
    return q, hands, goals, targets


def reach(robot, q, hands, goals, targets, **options):
    codes = np.array([HANDS.index(hand) for hand in hands])
    return reach_unchecked(robot, q, codes, goals, RADIUS, targets, **options)


def one_by_one(robot, arm, stops, *, corrects, looks, locked, model, by=(move, correct)):
    """What ``reach`` gives of one arm, in the order of its fields, from the parts of its text."""
    moved, corrected = by
    q, hand, goal, target = arm
    goal, none = tuple(goal), np.isnan(target).all()
    hit, ticks, evaluations = False, 0, 0
    if not none or looks:
        end = np.where(np.isnan(target), q, target)
        stops = bool(stops) and not none
        result = moved(robot, q, end, hand, goal, RADIUS, stop_on_arrival=stops, model=model)
        q, hit, evaluations = result.q, result.hit, result.evaluations
        ticks = 0 if none else result.ticks
    posture, corrections, iterations = np.full(robot.dof, np.nan), 0, 0
    if corrects and not hit:
        answer = corrected(robot, q, hand, goal, locked_base=locked, model=model)
        iterations, evaluations = answer.iterations, evaluations + answer.iterations + 1
        if answer.converged:
            posture, corrections = answer.q, 1
            result = moved(
                robot, q, posture, hand, goal, RADIUS,
                stop_on_arrival=model.corrective_arrival, model=model,
            )  # fmt: skip
            q, hit, ticks = result.q, result.hit, ticks + result.ticks
            evaluations += result.evaluations
    return q, hit, ticks, posture, corrections, iterations, evaluations


@settings(max_examples=40)
@given(
    robot=st.sampled_from([Robot(), UNEVEN]),
    seed=st.integers(0, 10**6),
    count=st.sampled_from([1, 2, 9]),
    corrects=st.booleans(),
    looks=st.booleans(),
    locked=st.sampled_from([(), ("x",), ("y",), ("x", "y")]),
    model=st.sampled_from(MODELS),
)
def test_equal_to_movements_one_by_one(robot, seed, count, corrects, looks, locked, model):
    rng = np.random.default_rng(seed)
    q, hands, goals, targets = arms(rng, robot, count)
    stops = rng.random(count) < 0.5
    together = reach(
        robot, q, hands, goals, targets,
        stops=stops, corrects=corrects, looks=looks, locked_base=locked, model=model,
    )  # fmt: skip
    options = {"corrects": corrects, "looks": looks, "locked": locked, "model": model}
    for n, arm in enumerate(zip(q, hands, goals, targets, strict=True)):
        expected = one_by_one(robot, arm, stops[n], **options)
        for name, field, value in zip(Reached._fields, together, expected, strict=True):
            np.testing.assert_array_equal(field[n], value, err_msg=name)


def test_the_judge_agrees():
    """The loop that visits every step, with NumPy's cosine; more arms than there are lanes."""
    rng, robot, model = np.random.default_rng(5), Robot(), MODELS[1]
    q, hands, goals, targets = arms(rng, robot, LANES + 30)
    goals[: LANES + 5] = goals[0]
    together = reach(robot, q, hands, goals, targets, model=model)
    options = {"corrects": True, "looks": True, "locked": (), "model": model}
    for n, arm in enumerate(zip(q, hands, goals, targets, strict=True)):
        judged = one_by_one(robot, arm, True, **options, by=(reference.move, reference.correct))
        for name, value in zip(Reached._fields[:-1], judged, strict=False):
            given = getattr(together, name)[n]
            np.testing.assert_allclose(given, value, rtol=0, atol=1e-9, err_msg=name)
    assert 10 < together.hit.sum() < len(q)
    assert 10 < together.corrections.sum() < len(q)


@pytest.mark.parametrize("chosen", [slice(None, None, -1), slice(3, 60, 7), slice(5, 6)])
def test_an_arm_does_not_notice_its_neighbours(chosen):
    q, hands, goals, targets = arms(np.random.default_rng(6), UNEVEN, LANES + 30)
    goals[::2] = goals[0]
    together = reach(UNEVEN, q, hands, goals, targets, model=MODELS[1])
    some = reach(UNEVEN, q[chosen], hands[chosen], goals[chosen], targets[chosen], model=MODELS[1])
    for field, same in zip(together, some, strict=True):
        np.testing.assert_array_equal(field[chosen], same)
