"""Problems for optimisers: hands, budgets, histories, and libraries that take them."""

import numpy as np
import pytest

import coartic
from coartic import BudgetError, CoarticError, UndeclaredError, execute, load_task
from coartic.method import Session
from coartic.motion.solution import movements_of
from coartic.optimisers import OPTIMISER_INFORMATION, Objective
from tests.support.strategies import shipped_optima

FOUR = load_task("two-armed-2")


def test_hands_may_come_with_points():
    """Of all points, or of each; a joint that has no entry keeps still."""
    problem = coartic.objective(FOUR, "LRLR")
    targets = problem.configurations + 0.05 * np.random.default_rng(0).standard_normal((4, 10))
    targets[~problem.joints] = np.nan
    q = FOUR.q0
    for goal, target in enumerate(targets):
        targets[goal] = q = np.where(problem.joints[goal], target, q)
    point = targets[problem.joints]

    def cost_of(hands):
        return -execute(FOUR, movements_of(hands, targets)).reward

    assert problem(point) == cost_of("LRLR")
    assert problem(point, "RRRR") == cost_of("RRRR")
    assert problem.many([point] * 2, ["LLLL", "RLRR"]).tolist() == list(
        map(cost_of, ("LLLL", "RLRR"))
    )
    assert problem.best_cost == -execute(FOUR, problem.solution).reward


def test_what_is_known_of_a_task():
    for entry in shipped_optima():
        if (entry.base, entry.other_arm) != ("task", "free"):
            continue
        problem = coartic.objective(entry.task)
        assert (problem.best_known, problem.proven) == (-entry.reward, entry.bound == entry.reward)
    assert coartic.objective("two-armed/v1/i900").best_known is None
    assert not coartic.objective("two-armed/v1/i900").proven
    assert coartic.objective("ascending", model=coartic.MotionModel(gain=0.04)).best_known is None


def test_the_history_is_that_of_the_costs_one_by_one():
    rng = np.random.default_rng(0)
    many, single = (coartic.objective("two-armed-1", "LRLR") for _ in range(2))
    points = many.x0 + rng.uniform(0, 0.05, (400, 1)) * rng.standard_normal((400, many.dim))
    costs = np.concatenate([many.many(points[:150]), many.many(points[150:])])
    assert [single(point) for point in points] == costs.tolist()
    assert many.history.equals(single.history)
    lowest = np.minimum.accumulate([many.history.cost[0], *costs])
    assert len(many.history) > 3
    for target in np.unique(lowest):
        due = np.flatnonzero(lowest <= target)[0]
        assert many.evaluations_to(target) == many.evaluations_to(target + 0.5) == due
    never = [lowest[-1] - 1, np.nan, -np.inf]
    assert many.evaluations_to([*never, lowest[0]]).tolist() == [np.inf] * 3 + [0]


def test_a_budget_counts_the_trials_with_which_hands_are_chosen():
    problem = coartic.objective(FOUR, budget=20)
    with pytest.raises(BudgetError):
        problem.many(np.tile(problem.x0, (5, 1)))
    assert problem.evaluations == 4
    again = problem.fresh()
    assert (again.evaluations, again.dim) == (0, problem.dim)
    again(again.x0)
    with pytest.raises(ValueError, match="budget is 0; it must be a whole number from 1"):
        coartic.objective(FOUR, budget=0)


def test_instances_of_a_family():
    test, tuned = (
        coartic.problems("one-armed/v1", split=split, count=3) for split in ("test", "development")
    )
    assert [p.task.name for p in test] == [f"one-armed/v1/i00{n}" for n in range(3)]
    assert [p.task.split for p in tuned] == ["development"] * 3
    with pytest.raises(ValueError, match="split is 'fresh'; it must be 'test' or 'development'"):
        coartic.problems("one-armed/v1", split="fresh")
    with pytest.raises(CoarticError, match="one-armed"):
        coartic.problems("one-armd/v1")
    with pytest.raises(ValueError, match="count is 0"):
        coartic.problems("one-armed/v1", count=0)


def test_a_method_cannot_see_its_task():
    information = Objective(Session(FOUR, 0, OPTIMISER_INFORMATION))
    for ask in ("task", "best_known", "proven"):
        with pytest.raises(UndeclaredError, match="cannot see its task"):
            getattr(information, ask)
    with pytest.raises(UndeclaredError):
        information.fresh()
    assert "best known" not in repr(information)
