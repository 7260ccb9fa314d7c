"""Trajectory optimisation: costs against integrals, plans against another optimiser."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from coartic import PAPER, Robot, Task, corrective_trial, execute, load_task
from coartic.baselines.posture_graph import chains_of, sample_layers
from coartic.baselines.trajectory_optimisation import cheapest_plan
from coartic.baselines.trajectory_problem import (
    JOINT_WEIGHT,
    Instance,
    spline,
    trajectory_problem,
)
from coartic.baselines.whole_ticks import Rounding, movements
from coartic.method import Session
from coartic.motion.execution import other_arm_travel
from coartic.tasks.task import hands_of
from tests.support.strategies import changed, least_cost, steps_from

ORDERS = {"acceleration": 2, "jerk": 3, "hand-jerk": 3}
SMALL = Robot(left_links=(1.0,), right_links=(1.2, 0.8))


def small_task(**change):
    content = {
        "name": "small",
        "robot": SMALL,
        "start": {"left": (1.5,), "right": (0.4, 0.3)},
        "goals": ((2.6, 1.0), (3.2, -0.4)),
    }
    content.update(change)
    content.setdefault("initial_hands", "R" * len(content["goals"]))
    return Task(**content)


@pytest.mark.parametrize(
    ("cost", "hands", "still", "weight"),
    [
        ("path-length", ("right", "left"), False, 1.0),
        ("path-length", ("left", "right"), True, 1.0),
        ("path-length", ("right", "left"), False, 4.0),
        ("path-length", ("right", "right"), False, 0.25),
        ("squared-displacement", ("right", "right"), False, 1.0),
        ("squared-displacement", ("right", "left"), True, 1.0),
    ],
)
def test_plans_agree_with_another_optimiser(cost, hands, still, weight):
    task = small_task()
    instance = Instance.of(task, hands, still=still, radius=task.radius)
    layers, _ = sample_layers(task, 60, np.random.default_rng(0))
    chain = dict(chains_of(task, layers, base_weight=weight))[hands]
    problem = trajectory_problem(task.robot, task.hands, 2, cost, weight)
    plan = problem.solve(instance, chain)
    assert plan.converged, plan.reason
    free, square = ~instance.held, cost == "squared-displacement"
    start = steps_from(task.q0, chain)[free]
    start += 0.1 * np.random.default_rng(1).standard_normal(start.shape)
    least = least_cost(
        task, hands, free, [start], radius=task.radius, square=square, base_weight=weight
    )
    moved = steps_from(task.q0, plan.configurations)
    weighted = moved * np.where(np.arange(task.robot.dof) < 2, weight, 1.0)
    squares = (weighted**2).sum(axis=1)
    if not square:
        assert plan.lengths() == pytest.approx(np.sqrt(squares), abs=1e-9)
    assert plan.cost <= least + 1e-5
    assert plan.cost == pytest.approx((squares if square else np.sqrt(squares)).sum(), abs=1e-5)
    for q, hand, goal in zip(plan.configurations, hands, task.goals, strict=True):
        assert math.dist(task.robot.forward_kinematics(q, hand), goal) <= task.radius + 1e-7
    assert np.all(moved[instance.held] == 0.0)


@pytest.mark.parametrize("cost", ["acceleration", "jerk", "hand-jerk"])
def test_smooth_plans_are_smooth_and_pass_the_goals(cost):
    hands, pieces = ("right", "left", "right"), 1500
    task = small_task(goals=((2.6, 1.0), (0.2, 1.9), (3.2, -0.4)), initial_hands="RLR")
    instance = Instance.of(task, hands, still=False, radius=0.09)
    problem = trajectory_problem(task.robot, task.hands, len(hands), cost)
    plan = problem.solve(instance, corrective_trial(task, task.initial_hands).configurations)
    assert plan.converged
    assert plan.durations.sum() == pytest.approx(len(hands))
    assert not np.allclose(plan.durations, 1.0)
    # Integrated by differences, the cost is the plan's.
    order, total, end = ORDERS[cost], 0.0, task.q0
    for goal, (piece, hand) in enumerate(zip(spline(plan, pieces), hands, strict=True)):
        points, end = np.vstack([end, piece]), piece[-1]
        places = task.robot.forward_kinematics(points, hand)
        assert end == pytest.approx(plan.configurations[goal], abs=1e-9)
        assert np.hypot(*(places[-1] - task.goals[goal])) <= 0.09
        parts = [(1.0, points)]
        if cost == "hand-jerk":
            parts = [(1.0, places), (JOINT_WEIGHT, points)]
        time = plan.durations[goal]
        for weight, each in parts:
            rates = np.diff(each, n=order, axis=0) / (time / pieces) ** order
            total += weight * (rates**2).mean(axis=0).sum() * time
    assert total == pytest.approx(plan.cost, rel=2e-3)


ONE_SEGMENT = {"acceleration": (12, 3), "jerk": (720, 5)}  # from rest to rest: factor · L² / Tᵏ


@pytest.mark.parametrize("cost", ["acceleration", "jerk"])
def test_a_full_stop_at_each_goal_costs_as_independent_reaches_do(cost):
    """In straight lines; no goal would gain by time from another."""
    goals = ((2.6, 1.0), (3.2, -0.4), (1.5, -1.2), (0.2, 1.9), (2.2, 1.6))
    task = small_task(goals=goals, initial_hands="RRRLR")
    instance = Instance.of(task, hands_of("RRRLR"), still=False, radius=0.09)
    problem = trajectory_problem(task.robot, task.hands, len(goals), cost)
    start = corrective_trial(task, "RRRLR").configurations
    passing, plan = (problem.solve(instance, start, stops=stops) for stops in (False, True))
    assert passing.converged
    assert plan.converged
    factor, power = ONE_SEGMENT[cost]
    lengths, times = plan.lengths(), plan.durations
    assert plan.cost == pytest.approx((factor * lengths**2 / times**power).sum(), rel=1e-9)
    assert plan.cost > 2 * passing.cost
    begin = task.q0
    for piece, length in zip(spline(plan, 50), lengths, strict=True):
        way = piece[-1] - begin
        along = (piece - begin) @ way / length**2
        np.testing.assert_allclose(piece, begin + along[:, None] * way, atol=1e-9)
        begin = piece[-1]
    longer = times > 0.06  # than the least time, which binds where one posture hits two goals
    savings = power * (lengths**2 / times ** (power + 1))[longer]
    np.testing.assert_allclose(savings, savings.mean(), rtol=1e-3)
    assert longer.sum() >= 4


def test_the_cheapest_plan_that_converged_is_kept():
    plans = [SimpleNamespace(cost=c, converged=c > 1, spent={"gradients": 1}) for c in (3, 2, 1, 4)]
    session = Session(small_task(), 0, ())
    for given, kept in ((plans, plans[1]), ([plans[2], plans[2]], plans[2])):
        problem = SimpleNamespace(solve=lambda _, plan, **options: plan)
        assert cheapest_plan(session, problem, None, given) is kept
    assert session.meter.gradients == 6


def test_a_solve_that_fails_says_so():
    task = changed("ascending", goals=[[9, 9]], locked_base=["x", "y"], initial_hands="R")
    problem = trajectory_problem(task.robot, task.hands, 1, "path-length")
    instance = Instance.of(task, ("right",), still=True, radius=task.radius)
    plan = problem.solve(instance, np.array([task.q0]))
    assert not plan.converged
    assert plan.reason != "Solve_Succeeded"


def test_whole_ticks_are_what_is_executed():
    for name, hands in (("ascending", "RRR"), ("two-armed-1", "LRLR")):
        task = load_task(name)
        sequence = hands_of(hands)
        instance = Instance.of(task, sequence, still=True, radius=task.radius)
        problem = trajectory_problem(task.robot, task.hands, len(hands), "path-length")
        plan = problem.solve(instance, corrective_trial(task, hands).configurations)
        session = Session(task, 0, ())
        rounding = Rounding(session, problem, instance)
        rounded = rounding.nearest(plan)
        solution = movements(session, task, instance, rounded.configurations, rounded.steps)
        execution = execute(task, solution)
        assert execution.corrections == 0
        assert execution.ticks <= rounded.ticks
        assert rounding.estimated_ticks(plan) <= rounded.ticks <= rounding.estimated_ticks(plan) + 1
        assert other_arm_travel(task, sequence, execution.configurations) == 0.0
        exact = plan.lengths()[:-1] / PAPER.step
        choices = itertools.product(*[(math.floor(steps), math.ceil(steps)) for steps in exact])
        every = list(rounding.iter_roundings(plan))
        assert min(each.ticks for each in every) <= rounded.ticks
        nearest_first = sorted(choices, key=lambda steps: np.abs(steps - exact).sum())
        assert [each.steps[:-1] for each in every] == nearest_first


def test_goals_that_one_posture_hits_are_merged_in_every_way():
    task = small_task(goals=((2.6, 1.0), (2.7, 1.09), (2.6, 1.1)))
    instance = Instance.of(task, ("right",) * 3, still=True, radius=task.radius)
    problem = trajectory_problem(task.robot, task.hands, 3, "path-length")
    plan = problem.solve(instance, corrective_trial(task, "RRR").configurations)
    rounding = Rounding(Session(task, 0, ()), problem, instance)
    plans = dict(rounding.iter_plans(plan, task, lambda ticks: True))
    assert list(plans) == [(), (1,), (2,), (1, 2)]
    for merged, merger in plans.items():
        np.testing.assert_allclose(merger.lengths()[list(merged)], 0.0, atol=1e-9)
