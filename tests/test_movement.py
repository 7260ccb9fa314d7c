"""Movement: the kernel against the engine that visits every step, and against geometry."""

import numpy as np
import pytest

from coartic import PAPER, MotionModel, Robot, move
from coartic.motion.compile import entry
from coartic.motion.movement import clear_steps
from coartic.robot import HANDS
from tests.support import reference
from tests.support.strategies import UNEVEN

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
    drawn = random_movements(rng, robot, hand, 1_000, largest)
    models = [MotionModel(step=step) for step in (0.01, 0.003, 0.1)]
    others = rng.integers(3, size=1_000), rng.random(1_000) < 0.5
    for q, target, goal, model, stops in zip(*drawn, *others, strict=True):
        assert_equals_every_step(robot, q, target, hand, goal, 0.1, stops, models[model])


@pytest.mark.parametrize("stops", [False, True])
@pytest.mark.parametrize(
    ("angle", "at_end", "offset", "radius"),
    [
        (2.5, False, (0.0, 0.25), 0.25),
        (1.5, True, (0.0, 0.25), 0.25),
        (0.0, False, (1.0, 0.0), 0.1),
    ],
)
def test_equals_every_step_where_the_rim_runs_through_an_end(angle, at_end, offset, radius, stops):
    """Through the start of a movement, through its end, and where there is no way to go."""
    q = np.full(10, angle)
    target = 0.75 * q
    goal = ROBOT.forward_kinematics(target if at_end else q, "left") + offset
    assert_equals_every_step(ROBOT, q, target, "left", goal, radius, stops)


def test_grazing_a_goal():
    """Goals whose rim the hand's path only just touches, or only just misses."""
    rng = np.random.default_rng(8)
    outcomes = set()
    for _ in range(2000):
        q = rng.uniform(-2, 2, 10)
        target = q + rng.normal(size=10) * 0.3
        middle = q + rng.uniform(0.2, 0.8) * (target - q)
        velocity = ROBOT.jacobian(middle, "right") @ (target - q)
        normal = np.array([-velocity[1], velocity[0]]) / np.hypot(*velocity)
        reach = 0.1 + rng.choice([-1e-6, -1e-12, 1e-12, 1e-6, 1e-4])
        goal = tuple(ROBOT.forward_kinematics(middle, "right") + reach * normal)
        arguments = (ROBOT, q, target, "right", goal, 0.1)
        outcomes.add(assert_equals_every_step(*arguments).hit)
    assert outcomes == {True, False}


@entry
def _cleared(square, rim, closing, slowness, bend):
    return clear_steps(square, rim, closing, slowness, bend)


@pytest.mark.parametrize("largest", [0.0, 6.0, 13.0])  # powers of 10
def test_the_bound_keeps_its_promise(largest):
    """In the steps it clears, no motion within the bounds can close the gap."""
    rng = np.random.default_rng(16)
    powers = rng.uniform([-9.0, -9.0, -20.0, -20.0], largest, (5000, 4))
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
    assert kept > 1000
    for gap in (0.0, 1e-10, 1e-9):  # too near to call
        assert _cleared((0.1 + gap) ** 2, 0.1 + 1e-9, 0.01, 1e2, 1e-3) == 0.0
    assert _cleared(1.0, 0.5, 0.0, np.inf, 0.0) == np.inf  # nothing moves
    # What is too small, or too large, for single precision is not mistaken for nothing.
    assert _cleared(4e-12, 1e-6, 1e-23, 2e17, 0.0) < 1e-6 / 5e-18
    assert _cleared(1e24, 0.0, -1e20, 0.0, 1e-3) == 0.0


def test_the_bound_clears_nearly_all_it_may():
    """Of a straight approach, and of motions that turn as much as they can."""
    for u, c in ((0.01, 0.0), (0.0, 1e-4), (-0.01, 1e-4), (0.01, 1e-4)):
        exact = 0.5 / u if c == 0.0 else (np.sqrt(u * u + 2 * c * 0.5) - u) / c
        assert _cleared(1.0, 0.5, u, 0.0, c) == pytest.approx(exact, rel=2e-5)


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


def test_inputs_are_left_alone_and_checked():
    q, target = np.zeros(10), np.ones(10)
    move(ROBOT, q, target, "right", (1.0, 1.0), 0.1)
    assert not q.any()
    assert (target == 1).all()
    with pytest.raises(ValueError, match=r"shape \(3,\)"):
        move(ROBOT, np.zeros(3), target, "right", (1.0, 1.0), 0.1)
    with pytest.raises(ValueError, match="not finite"):
        move(ROBOT, q, np.full(10, np.nan), "right", (1.0, 1.0), 0.1)
    with pytest.raises(ValueError, match="a (figure|number) beyond 100000"):
        move(ROBOT, q, np.full(10, 1e17), "right", (1.0, 1.0), 0.1)
    with pytest.raises(ValueError, match="goal \\(nan, 1.0\\) is not finite"):
        move(ROBOT, q, target, "right", (np.nan, 1.0), 0.1)
    with pytest.raises(ValueError, match="radius is nan"):
        move(ROBOT, q, target, "right", (1.0, 1.0), np.nan)
