"""Problems for optimisers: all hand sequences, budgets, histories, and runs that are stored."""

import warnings

import numpy as np
import pytest

import coartic
from coartic import BudgetError, CoarticError, UndeclaredError, execute, load_task
from coartic.analysis import load
from coartic.analysis.verify import check_runs
from coartic.method import Session
from coartic.motion.trials import movements_of
from coartic.optimisers import TOLD, Objective
from coartic.tasks.optima import entries

FOUR = load_task("two-armed-2")


def cost_of(task, hands, targets):
    return -execute(task, movements_of(hands, targets)).reward


def test_a_point_says_which_hands():
    """A hand where it is above 0, and a target for every joint that may move."""
    problem = coartic.problem(FOUR)
    assert (problem.dim, problem.bounds.shape) == (4 * 10 + 4, (44, 2))
    assert problem.joints.all()
    targets = problem.postures + 0.05 * np.random.default_rng(0).standard_normal((4, 10))
    for hands in ("LRLR", "RRRR", "RLRR"):
        signs = [0.3 if hand == "R" else -0.2 for hand in hands]
        due = cost_of(FOUR, hands, targets)
        assert problem([*targets.ravel(), *signs]) == due
        assert problem(targets.ravel(), hands) == due
        assert problem.many([targets.ravel()] * 2, ["LLLL", hands])[1] == due
    assert problem(problem.x0) == problem(problem.postures.ravel(), problem.hands)
    assert coartic.problem("ascending").dim == coartic.objective("ascending").dim  # one hand
    rail = coartic.problem("two-armed-1")  # locked in y
    assert rail.dim == 4 * 9 + 4
    assert not rail.joints[:, 1].any()


def test_the_best_known_cost_is_there_to_be_found():
    for entry in entries():
        if (entry.base, entry.other_arm) != ("task", "free"):
            continue
        problem = coartic.problem(entry.task)
        assert (problem.best_known, problem.proven) == (-entry.reward, entry.bound == entry.reward)
        names = list(problem.task.robot.joint_names)
        none = [np.nan] * len(names)
        targets = [none if m["ticks"] == 0 else [m[n] for n in names] for m in entry.solution]
        assert problem(np.array(targets)[problem.joints], entry.hands) == problem.best_known
        assert execute(problem.task, problem.solution).reward == entry.reward
        assert problem(problem.best_x) == problem.best_cost
    assert coartic.problem("two-armed/v1/i000").best_known is None
    assert not coartic.problem("two-armed/v1/i000").proven
    assert coartic.problem("ascending", model=coartic.MotionModel(gain=0.04)).best_known is None


def test_the_history_is_that_of_the_costs_one_by_one():
    rng = np.random.default_rng(0)
    many, single = (coartic.problem("two-armed-1", "LRLR") for _ in range(2))
    points = many.x0 + rng.uniform(0, 0.05, (400, 1)) * rng.standard_normal((400, many.dim))
    costs = np.concatenate([many.many(points[:150]), many.many(points[150:])])
    assert [single(point) for point in points] == costs.tolist()
    assert many.history.equals(single.history)
    lowest = np.minimum.accumulate([many.history.cost[0], *costs])
    assert len(many.history) > 3
    for target in np.unique(lowest):
        due = np.flatnonzero(lowest <= target)[0]
        assert many.evaluations_to(target) == many.evaluations_to(target + 0.5) == due
    assert many.evaluations_to([lowest[-1] - 1, lowest[0]]).tolist() == [np.inf, 0]


def test_a_budget_counts_the_trials_with_which_hands_are_chosen():
    problem = coartic.problem(FOUR, budget=20)
    with pytest.raises(BudgetError):
        problem.many(np.tile(problem.x0, (5, 1)))
    assert problem.evaluations == 4
    again = problem.fresh()
    assert (again.evaluations, again.dim) == (0, problem.dim)
    again(again.x0)
    with pytest.raises(ValueError, match="budget is 0; it must be a whole number from 1"):
        coartic.problem(FOUR, budget=0)


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


def test_a_method_is_not_told_its_task():
    told = Objective(Session(FOUR, 0, TOLD))
    for ask in ("task", "best_known", "proven"):
        with pytest.raises(UndeclaredError, match="not told its task"):
            getattr(told, ask)
    for do in (told.fresh, lambda: told.record("nowhere", "mine")):
        with pytest.raises(UndeclaredError):
            do()
    assert "best known" not in repr(told)


def searched(problem, seed=0):
    """After random search around the best point."""
    rng = np.random.default_rng(seed)
    try:
        while True:
            problem.many(problem.x0 + 0.05 * rng.standard_normal((20, problem.dim)))
    except BudgetError:
        return problem


def test_runs_are_recorded_as_those_of_methods(tmp_path):
    made = []
    for name in ("ascending", "descending"):
        for seed in range(3):
            made.append(searched(coartic.problem(name, budget=100), seed))
            assert made[-1].record(tmp_path / "mine", "random") == seed
    study = load(tmp_path / "mine")
    runs = study.runs
    assert runs.reward.tolist() == [-problem.best_cost for problem in made]
    assert runs.trials.tolist() == [100] * 6
    for (_, rewards), problem in zip(study.rewards(), made, strict=True):
        better = np.maximum.accumulate(rewards)
        assert -better[-1] == problem.best_cost
        assert np.flatnonzero(better == better[-1])[0] == problem.evaluations_to(problem.best_cost)
    assert check_runs(tmp_path / "mine").wrong == []
    assert not coartic.runtimes(study).empty
    problem = made[0]
    for arguments, words in (
        ({"name": "cma-es/bandit"}, "method of this project"),
        ({"name": "a b"}, "must be one such as"),
        ({"name": "random", "suite": "other"}, "the suite is 'problems'"),
        ({"name": "random", "suite": "a/b"}, "suite is"),
    ):
        with pytest.raises(CoarticError, match=words):
            problem.record(tmp_path / "mine", **arguments)
    other = searched(coartic.problem("ascending", budget=50))
    with pytest.raises(CoarticError, match="with other parameters"):
        other.record(tmp_path / "mine", "random")
    gain = searched(coartic.problem("ascending", model=coartic.MotionModel(gain=0.04), budget=50))
    with pytest.raises(CoarticError, match="constants of the paper"):
        gain.record(tmp_path / "mine", "gain")


def by_scipy(problem):
    optimize = pytest.importorskip("scipy.optimize")
    options = {"vectorized": True, "updating": "deferred", "polish": False, "maxiter": 1, "rng": 0}
    optimize.differential_evolution(problem, problem.bounds, x0=problem.x0, popsize=2, **options)


def by_cma(problem):
    cma = pytest.importorskip("cma")
    cma.fmin2(problem, problem.x0, 0.02, {"seed": 1, "verbose": -9, "maxfevals": 60})


def by_nevergrad(problem):
    nevergrad = pytest.importorskip("nevergrad")
    box = nevergrad.p.Array(init=problem.x0).set_bounds(*problem.bounds.T)
    nevergrad.optimizers.OnePlusOne(box, budget=60).minimize(problem)


def by_optuna(problem):
    optuna = pytest.importorskip("optuna")
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))

    def cost(trial):
        return problem([trial.suggest_float(f"x{n}", *box) for n, box in enumerate(problem.bounds)])

    study.optimize(cost, n_trials=60)


def by_ioh(problem):
    ioh = pytest.importorskip("ioh")
    low, high = problem.bounds.min(), problem.bounds.max()
    kind = ioh.ProblemClass.REAL
    ioh.wrap_problem(problem, "mine", kind, dimension=problem.dim, lb=low, ub=high)
    wrapped = ioh.get_problem("mine", 1, problem.dim, kind)
    costs = [wrapped(x) for x in problem.x0 + np.linspace(-0.02, 0.02, 60)[:, None]]
    assert wrapped.state.current_best.y == min(costs)


@pytest.mark.parametrize(
    "minimise", [by_scipy, by_cma, by_nevergrad, by_optuna, by_ioh], ids=lambda f: f.__name__
)
def test_libraries_take_a_problem_as_it_is(minimise):
    problem = coartic.problem(FOUR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        minimise(problem)
    assert problem.evaluations >= 50
    assert execute(FOUR, problem.solution).reward == -problem.best_cost
