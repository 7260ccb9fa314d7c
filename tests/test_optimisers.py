"""The objective function: costs, hands, budgets, histories, and examples of methods that use it."""

import copy
import multiprocessing
import pickle
import re
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import coartic
from coartic import (
    CoarticError,
    MotionModel,
    UndeclaredError,
    corrective_trial,
    execute,
    load_task,
    objective,
)
from coartic.benchmarks import conformance
from coartic.benchmarks.conformance import check_method
from coartic.benchmarks.registry import registry
from coartic.method import BudgetError, Information, MethodError, Session, run_method
from coartic.method.optimisers import FAILED, OPTIMISER_INFORMATION, Objective
from tests.support.processes import ROOT
from tests.support.strategies import shipped_optima, tiny_task

DOCS = ROOT / "docs"


def test_the_cost_of_a_point_is_what_its_trial_takes():
    task = load_task("two-armed-1")
    cost = objective(task, "LRLR", half_width=0.25)
    assert (cost.dim, cost.bounds.shape) == (4 * 9, (36, 2))  # the base is locked in y
    with pytest.raises(ValueError, match="read-only"):
        cost.configurations[0] += 1.0  # would move x0
    np.testing.assert_array_equal(cost.bounds.T, [cost.lower, cost.upper])
    np.testing.assert_allclose(cost.bounds.T - cost.x0, [[-0.25] * 36, [0.25] * 36])
    assert cost.best_cost == -corrective_trial(task, "LRLR").reward
    points = cost.x0 + 0.1 * np.random.default_rng(1).standard_normal((20, 36))
    np.testing.assert_array_equal(cost(points.T), cost.many(points))
    assert cost.evaluations == 40


def test_the_best_point_is_kept_with_its_solution():
    task = load_task("ascending")
    cost = objective("ascending")
    assert execute(task, cost.solution).reward == -319  # the corrective process alone
    assert cost.best_cost == 319 < cost(cost.x0)
    points = cost.x0 + 0.05 * np.random.default_rng(0).standard_normal((1500, cost.dim))
    best = points[cost.many(points).argmin()].copy()
    for each in (points, cost.x0):  # which may be changed without harm
        each += 1.0
    targets = np.array([movement.target for movement in cost.solution])
    np.testing.assert_array_equal(targets[cost.joints], best)
    assert -execute(task, cost.solution).reward == cost.best_cost == cost(best) < 319
    assert cost.history.cost.is_unique  # a point as good as the best is not a better one


def test_a_trial_that_fails_costs_more_than_any_that_succeeds():
    model = MotionModel(max_iterations=100)
    cost = objective("ascending", model=model)
    points = cost.x0 + np.random.default_rng(0).standard_normal((200, cost.dim))
    costs = cost.many(points)
    assert 0 < (costs == FAILED).sum() < 200
    assert costs[costs < FAILED].max() < 5000
    failed = points[costs.argmax()]
    assert not execute("ascending", cost.movements(failed), model=model).completed
    assert cost(cost.x0 + 1e6) == FAILED  # where an unbounded search may go
    with pytest.raises(MethodError, match="completes no hand sequence"):
        objective("ascending", model=MotionModel(max_iterations=2))
    many = tiny_task(goals=[[5.0, 1.0]] * 13)
    with pytest.raises(MethodError, match="hand sequences; .* pass the hands"):
        objective(many)
    with pytest.raises(coartic.NotApplicableError, match="8192 hand sequences"):
        _ = objective(many, "R" * 13).hand_sequences


COST = objective("ascending")
GOALS = np.argwhere(COST.joints)[:, 0]  # of each entry of a point


MASKED = np.ma.array(COST.x0, mask=np.arange(18) == 3)


def with_width(half_width):
    return objective("ascending", half_width=half_width)


@pytest.mark.parametrize(
    ("call", "wrong", "words"),
    [
        (COST, np.zeros(5), r"x has shape \(5,\); it must be \(18,\) or \(18, N\)"),
        (COST, np.zeros((18, 18)), r"use many\(x\) for rows, many\(x.T\) for columns"),
        (COST, COST.x0 + 1j, "it should be real numbers"),
        (COST.many, np.where(np.arange(18) == 7, np.nan, np.zeros((2, 18))),
         "entry 7 of point 0 is nan; each entry must be finite"),
        (COST, np.full(18, np.nan), "entry 0 of point 0 is nan"),
        (COST.movements, np.full(18, np.nan), "entry 0 of point 0 is nan"),
        (COST, np.where(GOALS == 1, np.inf, COST.x0), "is inf; each entry must be finite"),
        (COST, MASKED, "it should not have masked entries"),
        (with_width, 0, "half_width is .*; it must be a number from 1e-09 to 100"),
    ],
)  # fmt: skip
def test_what_is_no_point_and_no_width_is_refused(call, wrong, words):
    with pytest.raises(ValueError, match=words):
        call(wrong)
    assert COST.evaluations == 0


COPIED = objective("ascending", budget=50)


@pytest.mark.process
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of fork, beside threads
def test_copies_are_refused_and_a_process_that_inherits_one():
    for copied in (pickle.dumps, copy.copy, copy.deepcopy):
        with pytest.raises(coartic.CoarticError, match="use vectorized=True or objective.many"):
            copied(COPIED)
    refused = pytest.raises(coartic.CoarticError, match="sent to another process")
    with multiprocessing.get_context("fork").Pool(1) as pool, refused:
        pool.map(evaluate_copied, [COPIED.x0])
    assert (COPIED.evaluations, COPIED(COPIED.x0)) == (0, 320)


def evaluate_copied(x):
    return COPIED(x)


def test_points_become_movements():
    task = load_task("two-armed-2")
    cost = objective(task, "RLRR")
    points = cost.x0 + 0.3 * np.random.default_rng(2).standard_normal((30, cost.dim))
    for hands in (None, "RRRR", "LLRL"):
        costs = cost.many(points, hands)
        for point, due in zip(points, costs, strict=True):
            assert execute(task, cost.movements(point, hands)).reward == -due
    assert cost.many(points[:2], ["RRRR", "LLRL"]).tolist() == [
        cost(points[0], "RRRR"), cost(points[1], "LLRL")
    ]  # fmt: skip
    assert cost.evaluations == 94


EXAMPLES = DOCS / "examples"
PROGRAMS = {"ioh_logger", "choose_hands", "catcma"}
METHODS = [path for path in sorted(EXAMPLES.glob("*.py")) if path.stem not in PROGRAMS]


@pytest.mark.parametrize("path", METHODS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")
def test_the_examples_are_methods(path, in_this_process, monkeypatch):
    monkeypatch.setattr(conformance, "CHECK_TRIALS", 30)
    text = path.read_text("utf-8")
    for library in re.findall(r"^(?:import|from) (\w+)", text, re.MULTILINE):
        pytest.importorskip(library)
    name = re.search(r'name = "(.*)"', text)[1]
    entry = registry([path])[name]
    laws = check_method(entry, tasks=[load_task("ascending")])
    assert [law for law in laws if not law.passed] == []
    session = Session(
        load_task("ascending"), 0, map(Information, entry.information), trial_budget=300
    )
    solution = entry.configure({}).solve(session).solution
    assert session.meter.trials == len(session.rewards) == 300
    reward = execute("ascending", solution).reward
    assert reward == max(session.rewards)


def test_frames_are_points_in_the_order_of_their_columns():
    cost = objective("ascending")
    points = cost.x0 + 0.01 * np.arange(3)[:, None]
    frame = pd.DataFrame(points, columns=[f"x{n}" for n in range(cost.dim)])
    due = cost.many(points).tolist()
    assert cost.many(frame).tolist() == cost(frame.T).tolist() == due
    assert cost(frame.iloc[2]) == due[2]
    assert -execute("ascending", cost.movements(frame.iloc[2])).reward == due[2]


FOUR = load_task("two-armed-2")


def test_what_is_known_of_a_task():
    for entry in shipped_optima():
        if (entry.base, entry.other_arm) != ("task", "free"):
            continue
        problem = objective(entry.task)
        assert (problem.best_known, problem.proven) == (-entry.reward, entry.bound == entry.reward)
    assert objective("two-armed/v1/i900").best_known is None
    assert not objective("two-armed/v1/i900").proven
    assert objective("ascending", model=coartic.MotionModel(gain=0.04)).best_known is None


@pytest.mark.parametrize("threads", [1, 4])
@settings(max_examples=12)
@given(
    sizes=st.lists(st.integers(0, 40), max_size=8),
    budget=st.integers(1, 200),
    seed=st.integers(0, 99),
)
def test_the_history_is_what_the_returned_costs_say(threads, sizes, budget, seed):
    """In batches of any size, 0 for a point alone; where the budget cuts a batch; after refused
    copies; and of threads, whose order is open."""
    cost, single = (objective("two-armed-1", "LRLR", budget=most) for most in (budget + 1, None))
    rng, alone = np.random.default_rng(seed), cost.best_cost
    batches = [
        cost.x0 + rng.uniform(0, 0.05) * rng.standard_normal((max(size, 1), cost.dim))
        for size in sizes
    ]

    def evaluate(size, points):
        with suppress(CoarticError):
            pickle.dumps(cost)
        with suppress(BudgetError):
            returned = cost.many(points) if size else [cost(points[0])]
            np.testing.assert_array_equal(returned, single.many(points))

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(evaluate, sizes, batches))
    costs, history = [each for points in batches for each in single.many(points)], cost.history
    assert cost.evaluations == min(budget, len(costs))
    assert {*history.cost} <= {alone, *costs}
    if threads == 1 or len(costs) <= budget:
        assert cost.best_cost == min([alone, *costs[:budget]])
    if threads == 1:
        lowest = np.minimum.accumulate([alone, *costs[:budget]])
        first = [(int(np.argmax(lowest == each)), each) for each in np.unique(lowest)[::-1]]
        assert [*history.itertuples(index=False, name=None)] == first
    assert (np.diff(history.evaluations) > 0).all()
    assert (np.diff(history.cost) < 0).all()
    assert history.cost.iloc[-1] == cost.best_cost


def test_a_budget_counts_the_trials_with_which_hands_are_chosen():
    problem = objective(FOUR, budget=17)
    problem(problem.x0)
    with pytest.raises(BudgetError):
        problem(problem.x0)
    few = "budget is 15; it takes 16 trials to choose among the hand sequences .* raise the budget"
    for budget, words in ((0, "budget is 0; it must be an integer from 1"), (15, few)):
        with pytest.raises(ValueError, match=words):
            objective(FOUR, budget=budget)
    assert objective(FOUR, "RLRR", budget=5).trials_left == 4
    assert objective(FOUR, budget=16).trials_left == 0


class Idle(coartic.Optimiser):
    name, title, citation = "test/idle", "Idle", "None."

    def optimise(self, objective, rng):
        pass


def test_an_optimiser_that_evaluates_nothing_has_no_solution():
    """But where the hands take all trials, it could not."""
    for trials in (2, 10):
        with pytest.raises(MethodError, match="optimise ended without evaluating a point"):
            run_method(Idle(Idle.Parameters(trials=trials)), "ascending")
    result, session = run_method(Idle(Idle.Parameters(trials=16)), FOUR)
    assert session.trials_made == 16
    assert execute(FOUR, result.solution).reward == max(session.rewards)


class Recommends(coartic.Optimiser):
    """Returns what a function makes of the objective, once all trials are made."""

    name = "test/recommends"
    title = "Recommends"

    def optimise(self, objective, rng):
        with suppress(BudgetError):
            while True:
                objective.many(objective.x0 + 0.05 * rng.standard_normal((7, objective.dim)))
        self.best_trial = objective.solution
        return self.answer(objective)


def recommended(answer, model):
    """The solution and the best trial of an optimiser that returns an answer, and the session."""
    method = Recommends(Recommends.Parameters(trials=200, hands="LRLR"))
    method.answer = answer
    result, session = run_method(method, FOUR, model=model)
    assert session.trials_made == 200
    return result.solution, method.best_trial, session


def test_a_point_that_is_returned_is_the_solution_in_noise_alone():
    noisy, due = MotionModel(motor_noise=0.01), {}

    def answer(cost):
        due["x"] = cost.x0 + 0.01
        return due["x"]

    solution, best, _ = recommended(answer, noisy)
    assert solution == objective(FOUR, "LRLR", model=noisy).movements(due["x"]) != best
    solution, *_ = recommended(lambda cost: (cost.x0, "RRRR"), noisy)
    assert {movement.hand for movement in solution} == {"right"}
    solution, best, _ = recommended(lambda cost: None, noisy)
    assert solution == best
    solution, best, session = recommended(answer, MotionModel())
    assert solution == best
    assert execute(FOUR, solution).reward == max(session.rewards)


@pytest.mark.parametrize(
    "wrong",
    [
        3.0,
        "x",
        (),
        np.zeros(3),
        np.full(40, np.inf),
        np.full(40, np.nan),
        ([0.0], "RRRR"),
        ([0.0] * 40, "RR"),
        {"x": 1},
    ],
)
def test_what_is_no_point_cannot_be_recommended(wrong):
    with pytest.raises(ValueError, match="optimise returned .* must return a point of 40 numbers"):
        recommended(lambda cost: wrong, MotionModel(motor_noise=0.01))


def test_a_method_cannot_see_its_task():
    cost = Objective(Session(FOUR, 0, OPTIMISER_INFORMATION))
    for ask in ("task", "best_known", "proven"):
        with pytest.raises(UndeclaredError, match="cannot see its task"):
            getattr(cost, ask)
    assert cost.hand_sequences == coartic.hand_sequences(FOUR)
