"""The cascade against closed forms and other solvers; the controller on real tasks."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import null_space
from scipy.optimize import LinearConstraint, lsq_linear, minimize

from baselines.cascade import (
    DAMPING,
    LIMIT,
    SETTINGS,
    Cascade,
    CascadeError,
    cascade_for,
    damped_projection,
)
from baselines.modelled_cascade import ModelledCascade
from baselines.nullspace_control import Aim, Controller
from baselines.nullspace_qp import METHODS, NextGoal, NullspaceQP, Preshaping
from benchmarks import qp_solvers
from coartic import PAPER, Robot, execute, load_task
from coartic.method import MethodError, Session
from tests.support.strategies import configurations, tiny_task

ROBOT = Robot()
NOTHING = np.zeros(ROBOT.dof)


def solve(method, task, **parameters):
    method = method(method.Parameters(**parameters))
    session = Session(task, 0, method.told, trusted=True)
    result = method.solve(session)
    return result, execute(task, result.solution), session


def problems(count, seed, rate=0.5, preferred=0.3):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        jacobian = ROBOT.jacobian(rng.uniform(-2, 2, ROBOT.dof), "right")
        yield jacobian, rng.normal(size=2) * rate, rng.normal(size=ROBOT.dof) * preferred


@settings(max_examples=50)
@given(
    configurations(ROBOT, -3, 3),
    arrays(float, 2, elements=st.floats(-1, 1)),
    arrays(float, ROBOT.dof, elements=st.floats(-0.5, 0.5)),
    st.sampled_from([0.0, DAMPING, 0.3]),
)
def test_closed_form_is_the_damped_pseudoinverse_and_a_projection(q, rate, preferred, damping):
    """Level 1 by least squares with the damping as rows, level 2 in a basis of the nullspace."""
    jacobian = ROBOT.jacobian(q, "left")
    rows = np.vstack([jacobian, damping * np.eye(ROBOT.dof)])
    first = np.linalg.lstsq(rows, np.concatenate([rate, NOTHING]), rcond=None)[0]
    basis = null_space(jacobian)
    found = damped_projection(jacobian, rate, preferred, damping)
    np.testing.assert_allclose(found, first + basis @ (basis.T @ preferred), atol=1e-8)


@pytest.mark.parametrize("solver", SETTINGS)
def test_without_active_limits_the_cascade_is_the_closed_form(solver):
    cascade = cascade_for(ROBOT.dof, solver)
    for problem in problems(10, 1):
        exact = damped_projection(*problem)
        assert np.abs(exact).max() < LIMIT
        np.testing.assert_allclose(cascade.solve(*problem), exact, atol=1e-7)
        least = damped_projection(*problem[:2], NOTHING)
        np.testing.assert_allclose(cascade.solve(*problem[:2]), least, atol=1e-7)


@pytest.mark.parametrize("solver", SETTINGS)
def test_a_modelling_language_gives_the_same(solver):
    """cvxpy is told the two levels as they are defined; limits are active in half of them."""
    modelled = ModelledCascade(ROBOT.dof, solver)
    assert all(level.is_dcp(dpp=True) for level in modelled.levels)
    cascade = cascade_for(ROBOT.dof, solver)
    for problem in (*problems(5, 3), *problems(5, 4, rate=4.0, preferred=1.0)):
        found = cascade.solve(*problem)
        np.testing.assert_allclose(found, modelled.solve(*problem), rtol=0, atol=1e-8)


def test_the_method_through_cvxpy_is_the_same_to_the_last_bit():
    task, found = load_task("ascending"), []
    for modelling in ("none", "cvxpy"):
        method = NextGoal(NextGoal.Parameters(hands="RRR", period=10, modelling=modelling))
        session = Session(task, 0, method.told, trusted=True)
        result = method.solve(session)
        found.append(
            ([(m.hand, *m.target) for m in result.solution], session.meter.solver_iterations)
        )
    assert found[0] == found[1]


@pytest.mark.parametrize("solver", SETTINGS)
def test_singular_jacobians_leave_the_rates_bounded(solver):
    """Both arms straight along x on a base locked in x: nothing moves the hand along x."""
    cascade = cascade_for(ROBOT.dof - 1, solver)
    jacobian = np.delete(ROBOT.jacobian(NOTHING, "right"), 0, axis=1)
    assert np.linalg.matrix_rank(jacobian) == 1
    preferred = np.linspace(-0.2, 0.2, ROBOT.dof - 1)
    for rate in ([1.0, 0.0], [0.0, 1.0], [0.6, 0.8]):
        exact = damped_projection(jacobian, np.array(rate), preferred)
        assert np.linalg.norm(exact) < 1
        found = cascade.solve(jacobian, np.array(rate), preferred)
        np.testing.assert_allclose(found, exact, atol=1e-7)


def test_with_active_limits_both_levels_are_optimal():
    """Against bounded least squares (level 1) and a general solver (level 2)."""
    cascade = cascade_for(ROBOT.dof, "daqp")
    active = 0
    for jacobian, rate, preferred in problems(15, 2, rate=8.0, preferred=2.0):
        rows = np.vstack([jacobian, DAMPING * np.eye(ROBOT.dof)])
        first = lsq_linear(
            rows, np.concatenate([rate, NOTHING]), (-LIMIT, LIMIT), method="bvls", tol=1e-14
        ).x
        np.testing.assert_allclose(cascade.solve(jacobian, rate), first, atol=1e-5)
        found = cascade.solve(jacobian, rate, preferred)
        np.testing.assert_allclose(jacobian @ found, jacobian @ first, atol=1e-5)
        assert np.abs(found).max() <= LIMIT + 1e-9
        active += np.abs(found).max() > LIMIT - 1e-6
        second = minimize(
            lambda x, z=preferred: ((x - z) ** 2).sum(),
            first,
            jac=lambda x, z=preferred: 2 * (x - z),
            method="SLSQP",
            bounds=[(-LIMIT, LIMIT)] * ROBOT.dof,
            constraints=LinearConstraint(jacobian, jacobian @ first, jacobian @ first),
            options={"ftol": 1e-14},
        ).x
        np.testing.assert_allclose(found, second, atol=1e-4)
    assert active > 5


def test_a_failed_solve_says_which_and_why(monkeypatch):
    monkeypatch.setitem(SETTINGS, "proxqp", {"max_iter": 0})
    with pytest.raises(CascadeError, match="level 1: proxqp"):
        Cascade(4, "proxqp").solve(np.ones((2, 4)), np.ones(2))


def test_a_failed_solve_is_an_outcome(monkeypatch):
    def fails(*_):
        raise CascadeError("level 2: daqp ended infeasible")

    monkeypatch.setattr(Cascade, "solve", fails)
    with pytest.raises(MethodError, match="level 2") as caught:
        solve(NextGoal, tiny_task(), hands="RR", period=10)
    assert caught.value.outcome == "solver-failed"


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
@pytest.mark.parametrize(("task", "hands"), [("two-armed-2", "RRRR"), ("two-armed-1", "LRLR")])
def test_solutions_keep_the_rules(method, task, hands):
    """Steps within m, locks kept, every goal hit without correction, hands as given."""
    task = load_task(task)
    result, execution, session = solve(method, task, hands=hands, period=10)
    assert execution.completed
    assert execution.corrections == 0
    assert execution.hands == hands
    q = task.q0
    for movement, at_hit in zip(result.solution, execution.configurations, strict=True):
        steps = np.diff(np.vstack([q, movement.waypoints]), axis=0)
        assert np.linalg.norm(steps, axis=1).max() <= 10 * PAPER.step * (1 + 1e-9)
        q = at_hit
        if task.locked_base:
            assert (movement.waypoints[:, 1] == task.q0[1]).all()
    assert session.meter.jacobians > 0
    assert session.meter.solver_iterations > 0


def test_the_least_rates_move_no_joint_of_the_other_arm():
    task = load_task("two-armed-2")
    result, _, _ = solve(NullspaceQP, task, hands="RRRR", period=10)
    for movement in result.solution:
        joints = movement.waypoints[:, ROBOT.joints("left")]
        np.testing.assert_allclose(joints, np.tile(task.q0[2:6], (len(joints), 1)), atol=1e-12)


def test_preshaping_moves_the_other_arm_towards_its_goal():
    task = load_task("two-armed-2")
    misses = []
    for method in (NullspaceQP, Preshaping):
        _, execution, _ = solve(method, task, hands="RLRR", period=10)
        hand = ROBOT.forward_kinematics(execution.configurations[0], "left")
        misses.append(np.hypot(*(hand - task.goal_array[1])))
    assert misses[1] < 0.7 * misses[0]


def test_subgoals_of_lower_priority_coarticulate():
    """Figures of the module's text, at its defaults."""
    task = load_task("ascending")
    _, none, _ = solve(NullspaceQP, task)
    _, concurrent, _ = solve(NextGoal, task)
    assert (none.reward, concurrent.reward) == (-325, -304)


def test_a_goal_behind_a_straight_arm_is_reached():
    """The gradient vanishes there: the corrective process does not leave (test_corrective)."""
    task = tiny_task(goals=[[2.5, 0.1], [3.0, 1.0]], initial_hands="RR")
    for locked in (("x", "y"), ("x",)):
        task = task.model_copy(update={"locked_base": locked})
        _, execution, _ = solve(NextGoal, task, hands="RR", period=5)
        assert execution.completed
        assert execution.corrections == 0


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.6, 0.8)])
def test_a_goal_at_the_end_of_the_reach_is_reached(direction):
    goal = np.array([0.5, 0.1]) + 4.09 * np.array(direction)  # disc from 3.99 on, reach 4
    task = tiny_task(
        goals=[goal.tolist()],
        initial_hands="R",
        start={"base": [0.0, 0.0], "left": [0.0] * 4, "right": [0.5, 1.0, -1.0, 1.0]},
    ).model_copy(update={"locked_base": ("x", "y")})
    _, execution, _ = solve(NullspaceQP, task, hands="R", period=5)
    assert execution.completed
    assert execution.corrections == 0


@pytest.mark.parametrize("hands", ["every", "nearest", "RL"])
def test_an_unreachable_goal_is_infeasible(hands):
    task = tiny_task().model_copy(
        update={"goals": ((3.0, 1.0), (9.0, 3.0)), "locked_base": ("x", "y")}
    )
    with pytest.raises(MethodError, match="goal 2: the left hand ends .* short of it") as caught:
        solve(NextGoal, task, hands=hands, period=10)
    assert caught.value.outcome == "infeasible"


@pytest.mark.parametrize("method", [NextGoal, Preshaping])
def test_every_sequence_keeps_the_best(method):
    task = tiny_task(
        goals=[[4.0, 1.5], [-3.0, 2.0]],
        initial_hands="RL",
        start={"base": [0.0, 0.0], "left": [2.0, 0.5, 0.5, 0.0], "right": [0.5] * 4},
    )
    given_hands = {
        hands: solve(method, task, hands=hands, period=20)[1].reward
        for hands in map("".join, itertools.product("LR", repeat=2))
    }
    result, execution, _ = solve(method, task, hands="every", period=20)
    assert execution.reward == max(given_hands.values()) == given_hands[execution.hands]
    assert len(set(given_hands.values())) > 1
    assert result.details["sequences"] == 4
    assert result.details["simulated_movements"] < 2 * 4


def test_nearest_hands_are_those_without_a_secondary_objective():
    task = load_task("two-armed-2")
    _, none, _ = solve(NullspaceQP, task, hands="nearest", period=10)
    _, concurrent, _ = solve(NextGoal, task, hands="nearest", period=10)
    assert concurrent.hands == none.hands


def test_the_other_hand_goes_where_the_nearest_cannot():
    """The left one is nearer and ends 0.39 short of the disc."""
    task = tiny_task(goals=[[3.9, 1.0]], initial_hands="R").model_copy(
        update={"locked_base": ("x", "y")}
    )
    _, execution, _ = solve(NullspaceQP, task, hands="nearest", period=10)
    assert execution.hands == "R"


def test_hands_that_do_not_fit_are_refused():
    def why_not(task, hands):
        return NextGoal(NextGoal.Parameters(hands=hands)).why_not(task)

    task = tiny_task()
    assert why_not(task, "LR") is None
    assert "names 3 hands for 2 goals" in why_not(task, "LRL")
    right = task.model_copy(update={"hands": ("right",)})
    assert "no left hand" in why_not(right, "LR")
    assert "no other arm" in Preshaping().why_not(right)
    assert "hand sequences" in why_not(
        tiny_task(goals=[[5.0, 1.0]] * 13, initial_hands="R" * 13), "every"
    )


def test_the_posture_hits_its_goal_and_lies_near():
    """Against a general solver started from the same configuration."""
    task = load_task("two-armed-2")
    session = Session(task, 0, NextGoal.told, trusted=True)
    control = Controller(session, task, cascade_for(ROBOT.dof, "daqp"), 1, 100)
    rng = np.random.default_rng(3)
    for goal in (0, 1, 2, 3) * 2:
        q = rng.uniform(-1, 1, ROBOT.dof)
        posture = control.posture(q, Aim("right", goal))
        miss = ROBOT.forward_kinematics(posture, "right") - task.goal_array[goal]
        assert np.hypot(*miss) < 1e-3
        nearest = minimize(
            lambda p, q=q: ((p - q) ** 2).sum(),
            posture,
            jac=lambda p, q=q: 2 * (p - q),
            method="SLSQP",
            constraints={
                "type": "eq",
                "fun": lambda p, goal=goal: (
                    ROBOT.forward_kinematics(p, "right") - task.goal_array[goal]
                ),
                "jac": lambda p: ROBOT.jacobian(p, "right"),
            },
        ).x
        gap = np.linalg.norm(posture - q) - np.linalg.norm(nearest - q)
        assert abs(gap) < 2e-3
        assert np.linalg.norm(posture - nearest) < 0.05


def test_table_of_solvers(monkeypatch):
    monkeypatch.setattr(qp_solvers, "HANDS", "RRR")
    monkeypatch.setattr(qp_solvers, "TASK", "ascending")
    monkeypatch.setattr(qp_solvers, "_reward", lambda solver: "-304")
    found = qp_solvers.recorded(6)
    figures = qp_solvers.measure(found)
    figures["osqp"].modelled.failures.append("level 2: osqp ended user_limit")
    figures["osqp"].modelled.solutions[0] = None
    text = qp_solvers.table(found, figures)
    rows = [line.strip("| ").split(" | ") for line in text.splitlines()[2:6]]
    assert [row[0] for row in rows] == list(qp_solvers.SOLVERS)
    for row in rows:
        assert all(0 < float(figure) < 1000 for figure in row[1:6])  # ms
        assert 0 < int(row[6].rstrip("%")) < 100
        assert max(float(figure) for figure in row[7:10]) < 1e-6
        assert row[10] == ("0, 1" if row[0] == "osqp" else "0, 0")
    assert text.endswith("osqp: level 2: osqp ended user_limit")
    assert all(f"{name} " in qp_solvers.conditions() for name in ("cvxpy", "daqp", "osqp"))
