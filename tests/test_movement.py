"""Movement against the engine that visits every step; the corrective process, its definition."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import (
    PAPER,
    MotionModel,
    NotApplicableError,
    Robot,
    Task,
    correct,
    corrective_trial,
    execute,
    initial_hands,
    load_task,
    move,
    objective,
)
from coartic.baselines.corrective_alone import BestHands
from coartic.method import MethodError, Session
from coartic.motion.kernels.compile import chain_by, entry, joint_lever
from coartic.motion.kernels.correct import project
from coartic.motion.kernels.move import clear_steps, largest_square
from coartic.motion.kernels.trigonometry import cosine, sine
from coartic.robot import HANDS
from tests.support import reference
from tests.support.strategies import TIED, UNEVEN, configurations

ROBOT = Robot()


def assert_equals_every_step(robot, q, target, hand, goal, radius, stops=True, model=PAPER):
    """To the last bit, ties included."""
    arguments = robot, q, target, hand, tuple(goal), radius
    fast = move(*arguments, stop_on_arrival=stops, model=model)
    slow = reference.move(*arguments, stop_on_arrival=stops, model=model)
    assert (fast.ticks, fast.hit) == (slow.ticks, slow.hit)
    assert (fast.q == slow.q).all()
    assert fast.evaluations <= slow.evaluations
    return fast


def random_movements(rng, robot, hand, count, largest):
    """Movements, each with a goal that is anywhere, near its path, or near its end.

    Shapes (count, dof), (count, dof), (count, 2).
    """
    q = rng.uniform(-largest, largest, (count, robot.dof))
    target = q + rng.normal(size=q.shape) * rng.choice([0.01, 0.1, 0.5], (count, 1))
    place = rng.random((count, 1))
    point = np.where(place < 0.7, q + place * (target - q), target)
    spread = rng.choice([0.02, 0.1, 0.15, 1.0], (count, 1))
    goals = robot.forward_kinematics(point, hand) + rng.normal(size=(count, 2)) * spread
    return q, target, goals


@pytest.mark.parametrize("robot", [ROBOT, UNEVEN])
@pytest.mark.parametrize("largest", [3.0, 9e4])
@pytest.mark.parametrize("hand", HANDS)
def test_equals_every_step_many_times(robot, largest, hand):
    rng = np.random.default_rng(15)
    drawn = random_movements(rng, robot, hand, 200, largest)
    models = [MotionModel(step=step) for step in (0.01, 0.003, 0.1)]
    others = rng.integers(3, size=200), rng.random(200) < 0.5
    for q, target, goal, model, stops in zip(*drawn, *others, strict=True):
        assert_equals_every_step(robot, q, target, hand, goal, 0.1, stops, models[model])


@entry
def _cleared(square, rim, closing, slowness, bend):
    return clear_steps(square, rim, closing, slowness, bend)


@pytest.mark.parametrize("largest", [0.0, 6.0, 13.0])  # powers of 10
def test_the_bound_keeps_its_promise(largest):
    """In the steps it clears, no motion within the bounds can close the gap."""
    rng = np.random.default_rng(16)
    powers = rng.uniform([-9.0, -9.0, -20.0, -20.0], largest, (2000, 4))
    kept = 0
    for distance, share, speed, bend in 10.0**powers:
        radius = distance * (1.0 - min(share, 1.0))
        closing = rng.uniform(-1, 1) * speed
        rim = radius + 1e-9
        steps = float(_cleared(distance**2, rim, closing * distance, 1.0 / speed, bend))
        steps = min(steps, 1e12)  # more than a movement can have
        moved = min(speed * steps, closing * steps + bend * steps**2 / 2)
        assert steps == 0.0 or moved < distance - radius - 5e-10
        kept += steps > 0.0
    assert kept > 400
    for gap in (0.0, 1e-10, 1e-9):  # too near to call
        assert _cleared((0.1 + gap) ** 2, 0.1 + 1e-9, 0.01, 1e2, 1e-3) == 0.0
    assert _cleared(1.0, 0.5, 0.0, np.inf, 0.0) == np.inf  # nothing moves
    # What is too small, or too large, for single precision is not mistaken for nothing.
    assert _cleared(4e-12, 1e-6, 1e-23, 2e17, 0.0) < 1e-6 / 5e-18
    assert _cleared(1e24, 0.0, -1e20, 0.0, 1e-3) == 0.0


@pytest.mark.parametrize(("angle", "radius", "step"), [(1e5, 1e-4, 1e-6), (1e5, 1e-2, 1e-4)])
def test_equals_every_step_where_positions_are_rounded_most(angle, radius, step):
    """Long links at large angles: what is clear by the bounds is so by more than rounding."""
    rng = np.random.default_rng(18)
    robot = Robot(left_links=(1e4, 0.5), right_links=(1.0,))
    model = MotionModel(step=step, arrival_tolerance=0.0)
    for _ in range(60):
        q = np.array([*rng.uniform(-1, 1, 2), rng.uniform(0.6, 1) * angle, 0.0, 0.0])
        target, steps = q.copy(), rng.integers(20, 400)
        target[0] += steps * step
        target[2] += 3 * rng.integers(-3, 4) * np.spacing(q[2])
        point = q + rng.integers(10, steps + 1) / steps * (target - q)
        x, y = robot.forward_kinematics(point, "left")
        goal = (x + radius + rng.normal() * 1e-9, y)
        assert_equals_every_step(robot, q, target, "left", goal, radius, False, model)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"target": np.full(10, np.nan)}, "all entries must be finite"),
        ({"target": np.full(10, 1e17)}, "all entries must be from -100000 to 100000"),
        ({"goal": (np.nan, 1.0)}, r"goal is \[nan, 1.0\]; all entries must be finite"),
        ({"radius": np.nan}, "radius is nan"),
    ],
)
def test_inputs_are_left_alone_and_checked(wrong, words):
    given = {"q": np.zeros(10), "target": np.ones(10), "goal": (1.0, 1.0), "radius": 0.1}
    move(ROBOT, hand="right", **given)
    assert not given["q"].any()
    assert (given["target"] == 1).all()
    with pytest.raises(ValueError, match=words):
        move(ROBOT, hand="right", **given | wrong)


@settings(max_examples=25)
@given(
    robot=st.just(ROBOT) | st.just(UNEVEN),
    data=st.data(),
    hand=st.sampled_from(HANDS),
    goal=st.tuples(st.floats(-6, 6), st.floats(-3, 3)),
    locked=st.sampled_from([(), ("x",), ("y",)]),
)
def test_equals_the_matrix_form(robot, data, hand, goal, locked):
    model = MotionModel(max_iterations=200)
    q = data.draw(configurations(robot, -3, 3))
    fast = correct(robot, q, hand, goal, locked_base=locked, model=model)
    slow = reference.correct(robot, q, hand, goal, locked_base=locked, model=model)
    assert fast.converged == slow.converged
    if fast.converged:
        assert fast.iterations == slow.iterations
        np.testing.assert_allclose(fast.q, slow.q, atol=1e-9)


def test_a_correction_whose_numbers_overflow_ends_there():
    model = MotionModel(gain=1e3, max_iterations=5000)
    found = correct(ROBOT, np.zeros(ROBOT.dof), "right", (3.0, 2.0), model=model)
    assert not found.converged
    assert found.iterations < 100  # each makes numbers a thousand times as large


@entry
def _project(change, along_x, along_y):
    project(change, along_x, along_y)


@pytest.mark.parametrize("rows", [(1, 2, 0, 1), (1, 0, 0.5, 0), (0.5, 0, 1, 0), (0, 0, 1, 0)])
def test_a_projection_is_that_of_the_pseudoinverse(rows):
    """Of Jacobians of rank 2 and 1, whose rows are mixed of two."""
    rng = np.random.default_rng(17)
    jacobian, change = np.reshape(rows, (2, 2)) @ rng.normal(size=(2, 5)), rng.normal(size=5)
    due = change - np.linalg.pinv(jacobian) @ jacobian @ change
    _project(change, *jacobian)
    np.testing.assert_allclose(change, due, atol=1e-9)


@entry
def _largest(length):
    return largest_square(length)


@settings(max_examples=50)
@given(length=st.floats(1e-9, 1e5) | st.sampled_from([0.0, 1e-200, 0.001, 0.01, 0.1]))
def test_a_square_within_the_largest_has_a_root_within_the_length(length):
    """Errors are compared by their squares: to the last bit as by themselves."""
    square = _largest(length)
    assert math.sqrt(square) <= length < math.sqrt(math.nextafter(square, math.inf))


@entry
def _by_steps(q, arm, goal, gain, tolerance, most, xs, ys):
    """The descent with the cosine that knows any angle, one evaluation after the other."""
    tip = len(arm.links)
    for iteration in range(most):
        chain_by(q, arm, xs, ys, cosine, sine)
        error_x, error_y = goal[0] - xs[tip], goal[1] - ys[tip]
        if math.sqrt(error_x * error_x + error_y * error_y) <= tolerance:
            return iteration
        q[0] += gain * error_x
        q[1] += gain * error_y
        for k in range(tip):
            dx, dy = joint_lever(xs, ys, k, tip)
            q[arm.first_joint + k] += gain * (dx * error_x + dy * error_y)
    return most


@pytest.mark.parametrize("seed", range(8))
def test_an_arm_that_is_wound_up_is_corrected_to_the_bit(seed):
    """Beyond what the kernels' own cosine knows, from the start or on the way."""
    rng = np.random.default_rng(seed)
    robot, hand = (ROBOT, UNEVEN)[seed % 2], HANDS[seed // 2 % 2]
    q = rng.uniform(-1, 1, robot.dof)
    q[2:] += rng.choice([9.9e4, 5e4, 2.4e4]) * rng.choice([1, 1, -1])
    goal, slow = rng.uniform(-1, 1, 2), q.copy()
    fast = correct(robot, q, hand, tuple(goal))
    model = PAPER.for_radius()
    iterations = _by_steps(
        slow, robot.arm(hand), tuple(goal), model.gain, model.correction_tolerance,
        model.max_iterations, *np.empty((2, robot.max_links + 1)),
    )  # fmt: skip
    assert fast.iterations == iterations
    np.testing.assert_array_equal(fast.q, slow)


@pytest.mark.parametrize(
    ("task", "budget", "hands", "trials"),
    [
        (load_task("two-armed-1"), None, "LRLR", 16),
        (load_task("two-armed-1"), 3, "LLLR", 3),  # -760, -672, -715
        (TIED, None, "RRL", 8),
    ],
)
def test_every_hand_sequence_alone(task, budget, hands, trials):
    session = Session(task, 0, BestHands.information, trial_budget=budget)
    assert execute(task, BestHands().solve(session).solution).hands == hands
    assert session.meter.trials == trials


def test_a_correction_that_does_not_converge_has_a_reason():
    """A straight arm that points at its goal stays straight; two iterations are too few."""
    task = Task(goals=[(2.5, 0.1)], hands=["right"], locked_base=("x", "y"))
    reason = corrective_trial(task, "R").reason
    assert "goal 1" in reason
    for call in (initial_hands, objective):
        with pytest.raises((NotApplicableError, MethodError), match="complete"):
            call(task)
    few = corrective_trial("ascending", "RRR", model=MotionModel(max_iterations=2))
    assert few.reason.endswith("in 2 iterations")
