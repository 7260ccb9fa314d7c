"""Plans that stop at goals, by finite differences and closed forms."""

from functools import cache

import numpy as np
import pytest

from coartic import PAPER, Robot, Task, execute, load_task
from coartic.baselines.trajectory_optimisation import METHODS
from coartic.baselines.trajectory_problem import Instance, spline, trajectory_problem
from coartic.method import Session
from coartic.tasks.task import hands_of

BY_COST = {method.cost: method for method in METHODS}
ORDERS = {"acceleration": 2, "jerk": 3}
ONE_SEGMENT = {"acceleration": (12, 3), "jerk": (720, 5)}  # from rest to rest: factor · L² / Tᵏ
QUICK = {"nodes": 20, "graphs": 1, "chains": 1, "noisy_starts": 0}
TASK = Task(
    name="five",
    robot=Robot(left_links=(1.0,), right_links=(1.2, 0.8)),
    start={"base": (0.0, 0.0), "left": (1.5,), "right": (0.4, 0.3)},
    goals=((2.6, 1.0), (3.2, -0.4), (1.5, -1.2), (0.2, 1.9), (2.2, 1.6)),
    initial_hands="RRRLR",
)
pytestmark = pytest.mark.parametrize("cost", ["acceleration", "jerk"])


@cache
def planned(cost, name=TASK.name, **parameters):
    """The plan of a task's initial hands."""
    task = TASK if name == TASK.name else load_task(name)
    method = BY_COST[cost](BY_COST[cost].Parameters(**QUICK, **parameters))
    session = Session(task, 0, method.told, trusted=True)
    problem = trajectory_problem(task.robot, task.hands, len(task.goals), cost)
    hands = hands_of(task.initial_hands)
    instance = Instance.of(task, hands, still=False, radius=task.radius - PAPER.arrival_tolerance)
    plan = method.cheapest(session, problem, instance, method.starts(session, task)[hands])
    assert plan.converged
    return plan


def rates_by_differences(plan, order, samples=4000):
    """Largest rates just before and just after inner goals, shape ``(G - 1, order - 1)``."""
    pieces = spline(plan, np.array(TASK.q0), samples)
    rates = np.zeros((len(pieces) - 1, order - 1))
    for goal, corner in enumerate(plan.configurations[:-1]):
        sides = pieces[goal][::-1], np.vstack([corner, pieces[goal + 1]])  # away from the goal
        for side, time in zip(sides, plan.durations[goal : goal + 2], strict=True):
            for k in range(1, order):
                differences = np.diff(side[: k + 1], k, axis=0) / (time / samples) ** k
                rates[goal, k - 1] = max(rates[goal, k - 1], np.abs(differences).max())
    return rates


def test_stops_are_at_multiples_alone(cost):
    """Rates are near 0 there, and not elsewhere."""
    passing = rates_by_differences(planned(cost), ORDERS[cost])
    assert np.all(passing > 0.1)
    for every, goals in ((1, [1, 2, 3, 4]), (2, [2, 4]), (3, [3]), (5, [])):
        plan = planned(cost, stop=1.0, stop_every=every)
        slow = rates_by_differences(plan, ORDERS[cost]) < 0.02 * passing
        for rate in slow.T:
            assert (np.flatnonzero(rate) + 1).tolist() == goals


@pytest.mark.parametrize("timing", ["free", "fixed"])
def test_more_of_a_stop_costs_more(cost, timing):
    costs = [planned(cost, timing=timing, stop=stop).cost for stop in (0.0, 0.5, 1.0)]
    assert costs == sorted(costs)
    assert costs[-1] > 2 * costs[0]
    fewer = [planned(cost, timing=timing, stop=1.0, stop_every=every).cost for every in (2, 5)]
    assert costs[0] == pytest.approx(fewer[1], rel=1e-6)
    assert costs[0] < fewer[0] < costs[-1]


def test_half_a_stop_leaves_half_of_every_rate(cost):
    passing, slowed = planned(cost), planned(cost, stop=0.5)
    share = np.abs(slowed.rates[:, 1:-1]) - 0.5 * np.abs(passing.rates[:, 1:-1])
    assert share.max() < 1e-7
    assert np.abs(slowed.rates[0, 1:-1]).max() > 0.01


@pytest.mark.parametrize("timing", ["free", "fixed"])
def test_a_full_stop_at_each_goal_costs_as_independent_reaches_do(cost, timing):
    """In straight lines; at free times no goal would gain by time from another."""
    plan = planned(cost, timing=timing, stop=1.0)
    factor, power = ONE_SEGMENT[cost]
    lengths, times = plan.lengths(TASK.q0), plan.durations
    assert plan.cost == pytest.approx((factor * lengths**2 / times**power).sum(), rel=1e-9)
    corners = np.vstack([TASK.q0, plan.configurations])
    for piece, begin, end, length in zip(
        spline(plan, TASK.q0, 50), corners[:-1], corners[1:], lengths, strict=True
    ):
        along = (piece - begin) @ (end - begin) / length**2
        np.testing.assert_allclose(piece, begin + along[:, None] * (end - begin), atol=1e-9)
    if timing == "free":
        longer = times > 0.06  # than the least time, which binds where one posture hits two goals
        savings = power * (lengths**2 / times ** (power + 1))[longer]
        np.testing.assert_allclose(savings, savings.mean(), rtol=1e-3)
        assert longer.sum() >= 4


@pytest.mark.parametrize("name", ["ascending", "descending"])
def test_full_stops_at_equal_times_are_the_plan_of_squared_changes(cost, name):
    """Nothing of smoothness is left: the same programme, solved as another one."""
    plan = planned(cost, name, timing="fixed", stop=1.0)
    jordan = planned("squared-changes", name)
    assert plan.cost == pytest.approx(ONE_SEGMENT[cost][0] * jordan.cost, rel=1e-6)
    np.testing.assert_allclose(plan.configurations, jordan.configurations, atol=1e-3)


def test_what_is_handed_over_is_executed_without_corrections(cost):
    method = BY_COST[cost]
    for stops in ({}, {"stop_every": 2}):
        parameters = method.Parameters(**QUICK, most_sequences=1, stop=1.0, **stops)
        result = method(parameters).solve(Session(TASK, 0, method.told, trusted=True))
        execution = execute(TASK, result.solution)
        assert (execution.completed, execution.corrections) == (True, 0)
        assert result.details["failed"] == {}
