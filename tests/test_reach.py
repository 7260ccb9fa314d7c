"""Arms that reach for goals side by side against the same movements made one by one."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import PAPER, MotionModel, Robot, correct, move
from coartic.motion.lanes import LANES
from coartic.motion.reach import Reached, reach_unchecked
from coartic.robot import HANDS
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


def one_by_one(robot, arm, stops, *, corrects, looks, locked, model):
    """What ``reach`` gives of one arm, in the order of its fields, from the parts of its text."""
    q, hand, goal, target = arm
    goal, none = tuple(goal), np.isnan(target).all()
    hit, ticks, evaluations = False, 0, 0
    if not none or looks:
        end = np.where(np.isnan(target), q, target)
        stops = bool(stops) and not none
        result = move(robot, q, end, hand, goal, RADIUS, stop_on_arrival=stops, model=model)
        q, hit, evaluations = result.q, result.hit, result.evaluations
        ticks = 0 if none else result.ticks
    posture, corrections, iterations = np.full(robot.dof, np.nan), 0, 0
    if corrects and not hit:
        answer = correct(robot, q, hand, goal, locked_base=locked, model=model)
        iterations, evaluations = answer.iterations, evaluations + answer.iterations + 1
        if answer.converged:
            posture, corrections = answer.q, 1
            result = move(
                robot, q, posture, hand, goal, RADIUS,
                stop_on_arrival=model.corrective_arrival, model=model,
            )  # fmt: skip
            q, hit, ticks = result.q, result.hit, ticks + result.ticks
            evaluations += result.evaluations
    return q, hit, ticks, posture, corrections, iterations, evaluations


@settings(max_examples=30)
@given(
    robot=st.sampled_from([Robot(), UNEVEN]),
    seed=st.integers(0, 10**6),
    count=st.sampled_from([1, 2, 9, LANES + 3]),
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
