"""The cascade against closed forms and another solver; the controller on real tasks."""

import itertools

import numpy as np
import pytest

from coartic import Robot, execute, load_task
from coartic.baselines.cascade import DAMPING, LIMIT, SLACK, solve_cascade
from coartic.baselines.controllers import Aim
from coartic.baselines.posture_qp import FACES, METHODS, GoalsAhead, PostureController
from coartic.method import MethodError, Session
from coartic.robot import directions
from tests.support.strategies import TIED, least_cost, solve, steps_from, tiny_task

ROBOT = Robot()
ANGLES = 2 * np.pi * np.arange(FACES) / FACES
NORMALS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])


def problems(count, seed, far=0.5, preferred=0.3):
    """Discs of goals that lie so far from the hand, and changes preferred."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        jacobian = ROBOT.jacobian(rng.uniform(-2, 2, ROBOT.dof), "right")
        error = rng.normal(size=2) * far
        yield NORMALS @ jacobian, NORMALS @ error - 0.1, rng.normal(size=ROBOT.dof) * preferred


def stated(rows, least, preferred):
    """The cascade as its docstring states it; what level 1 falls short of, and the changes."""
    import cvxpy as cp

    s, x = cp.Variable(), cp.Variable(rows.shape[1])
    limits = cp.abs(x) <= LIMIT
    effort = cp.square(s) + DAMPING**2 * cp.sum_squares(x)
    cp.Problem(cp.Minimize(effort), [rows @ x + s >= least, limits]).solve(cp.CLARABEL)
    short = max(float(s.value), 0.0) + SLACK
    nearest = cp.Minimize(cp.sum_squares(x - preferred))
    cp.Problem(nearest, [rows @ x >= least - short, limits]).solve(cp.CLARABEL)
    return short, x.value


@pytest.mark.parametrize(("far", "preferred", "bind"), [(0.5, 0.3, False), (4.0, 1.0, True)])
def test_both_levels_of_a_disc_are_as_another_solver_has_them(far, preferred, bind):
    moved = bound = 0
    for rows, least, wanted in problems(4, 4, far, preferred):
        short, nearest = stated(rows, least, wanted)
        changes, first, iterations = solve_cascade(rows, least, wanted)
        assert iterations > 0
        assert (least - rows @ first).max() < short + 1e-6
        assert np.abs(changes).max() <= LIMIT + 1e-9
        assert (least - rows @ changes).max() < short + 1e-6
        np.testing.assert_allclose(changes, nearest, atol=1e-4)
        moved += np.linalg.norm(changes - wanted) > 1e-3
        bound += np.abs(changes).max() > LIMIT - 1e-6
    assert moved > 1
    assert (bound > 0) == bind


def test_a_failed_solve_is_an_outcome():
    with pytest.raises(MethodError, match="level .: DAQP ended") as caught:
        solve_cascade(np.eye(FACES, ROBOT.dof), np.full(FACES, np.inf), np.zeros(ROBOT.dof))
    assert caught.value.outcome == "solver-failed"


def test_a_goal_behind_a_straight_arm_is_reached():
    """The gradient vanishes there: the corrective process does not leave (test_movement)."""
    task = tiny_task(goals=[[2.5, 0.1], [3.0, 1.0]], hands=["right"])
    _, execution, _ = solve(GoalsAhead, task.model_copy(update={"locked_base": ("x", "y")}))
    assert execution.completed
    assert execution.corrections == 0


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_every_sequence_keeps_the_best(method):
    goals = [[4.0, 1.5], [-3.0, 2.0]]
    start = {"left": [2.0, 0.5, 0.5, 0.0], "right": [0.5] * 4}
    task = tiny_task(goals=goals, initial_hands="RL", start=start)
    rewards = {}
    for hands in itertools.product(task.hands, repeat=2):
        session = Session(task, 0, method.information, trusted=True)
        alone, aims = PostureController(session, task, 20), (Aim(hands[0], 0), Aim(hands[1], 1))
        first = alone.leg(None, aims[: 1 + method.goals_ahead])
        solution = first.movement, alone.leg(first, aims[1:]).movement
        rewards[hands] = execute(task, solution).reward
    result, execution, _ = solve(method, task, period=20)
    chosen = tuple(movement.hand for movement in result.solution)
    assert execution.reward == max(rewards.values()) == rewards[chosen]
    assert len(set(rewards.values())) > 1
    assert result.details["sequences"] == 4
    assert result.details["simulated_movements"] < 2 * 4
    assert solve(method, TIED)[1].hands == "RRL"


def controller(task):
    return PostureController(Session(task, 0, GoalsAhead.information, trusted=True), task, 5)


def miss(q, task, hand, goal):
    return np.hypot(*(ROBOT.forward_kinematics(q, hand) - task.goal_array[goal]))


def test_postures_make_the_way_through_all_discs_shortest():
    """A local minimum of the reward's own metric: a general solver finds nothing shorter near."""
    task = load_task("two-armed/v1/d003")
    aims = tuple(Aim("right", goal) for goal in range(len(task.goals)))
    postures = [*controller(task).begin(task.q0, aims, None).values()]
    steps = steps_from(task.q0, postures)
    hands, every = ["right"] * len(aims), np.ones(steps.shape, bool)
    shortest = least_cost(task, hands, every, [steps.ravel()], radius=task.radius)
    assert all(miss(q, task, "right", goal) <= task.radius for goal, q in enumerate(postures))
    assert np.linalg.norm(steps, axis=1).sum() < shortest + 0.03  # three steps


@pytest.mark.parametrize("locked", [(), ("y",)])
def test_faces_say_how_the_hand_leaves_the_disc(locked):
    """Rows by finite differences of the distances that come with them."""
    task = load_task("two-armed-2").model_copy(update={"locked_base": locked})
    control = controller(task)
    q = np.random.default_rng(4).uniform(-1, 1, ROBOT.dof)
    rows, outside = control.faces(q, Aim("left", 2))
    for column, joint in enumerate(control.moving):
        change = outside - control.faces(q + 1e-6 * np.eye(ROBOT.dof)[joint], Aim("left", 2))[1]
        np.testing.assert_allclose(change / 1e-6, rows[:, column], atol=1e-5)
    # A polygon in a circle: its faces are no farther than the circle, and nearer by as much as
    # the cosine of half the angle between two of them.
    far = miss(q, task, "left", 2)
    half = directions(np.pi / FACES)[0]
    assert half * far - 0.1 - 1e-3 <= outside.max() <= far - half * 0.1 + 1e-3
