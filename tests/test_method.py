"""Sessions: what a method is told, what is taken and refused, and what is counted."""

from concurrent.futures import ThreadPoolExecutor
from importlib import import_module

import numpy as np
import pytest

from coartic import (
    MotionModel,
    Movement,
    NotApplicableError,
    corrective_trial,
    execute,
    load_task,
)
from coartic.method import (
    MODULES,
    BudgetError,
    Information,
    Method,
    MethodError,
    Result,
    Session,
    UndeclaredError,
    outline_of,
    run_method,
)
from coartic.method.optimisers import OPTIMISER_INFORMATION
from coartic.motion.solution import movements_of, next_action
from tests.support.strategies import make_trials, sample, tiny_task

BLIND = frozenset({Information.REWARD_BY_TRIAL})


def test_a_budget_that_ends_within_a_batch():
    task = load_task("two-armed-2")
    hands, targets = sample(task, 10)
    unlimited = make_trials(task, hands, targets)
    session = Session(task, 0, OPTIMISER_INFORMATION, trial_budget=7)
    assert len(session.trials(hands[:4], targets[:4]).ticks) == 4
    rest = session.trials(hands[4:], targets[4:])
    np.testing.assert_array_equal(rest.rewards, unlimited.rewards[4:7])
    assert (session.trials_made, session.trials_left, len(session.rewards)) == (7, 0, 7)
    assert len(session.trials([], targets[:0]).ticks) == 0
    with pytest.raises(BudgetError, match="the budget of 7 trials is spent"):
        session.trials(hands, targets)


class FailsOnce(Method):
    name = title = "test/fails-once"
    information = BLIND

    def solve(self, session):
        if session.seed == 1:
            raise MethodError("infeasible", "not with seed 1")
        return Result((), {"seed": session.seed})


def test_a_failure_in_a_batch_stays_in_its_place():
    """The other sessions are solved, and each result belongs to its session."""
    sessions = [Session(load_task("ascending"), seed, BLIND) for seed in range(3)]
    first, failed, last = FailsOnce().solve_together(sessions)
    assert (first.details, last.details) == ({"seed": 0}, {"seed": 2})
    assert isinstance(failed, MethodError)
    assert (failed.outcome, str(failed)) == ("infeasible", "not with seed 1")


def test_a_method_without_the_corrective_process_does_not_see_it():
    task = load_task("ascending")
    hands, targets = sample(task, 3)
    session = Session(task, 0, BLIND)
    blind, seen = session.trials(hands, targets), make_trials(task, hands, targets)
    np.testing.assert_array_equal(blind.rewards, seen.rewards)
    assert seen.corrections.sum() > 0
    hidden = (blind.corrections, blind.iterations, blind.targets, blind.reached)
    assert [len(field) for field in hidden] == [0] * 4
    single = session.trial(movements_of(hands[0], targets[0]))
    assert (single.reward, len(single.configurations)) == (blind.rewards[0], 0)
    assert [movement.ticks for movement in single.movements] == [None] * 3
    targets[1, 2] = np.nan
    with pytest.raises(UndeclaredError, match="corrective process"):
        session.trials(hands, targets)
    with pytest.raises(UndeclaredError, match="reward by trial"):
        Session(task, 0, OPTIMISER_INFORMATION - BLIND).trials(hands, targets)


def test_a_target_that_is_far_away_fails_its_trial_alone():
    task = load_task("two-armed-2")
    hands, targets = sample(task, 12)
    targets[:, 2, 3:6] = np.nan
    session, others = (Session(task, 0, OPTIMISER_INFORMATION) for _ in range(2))
    far = np.isin(np.arange(12), [0, 5, 11])
    given = targets.copy()
    given[far, [0, 3, 1], [6, 9, 7]] = [1.1e5, -3e5, 1e300]
    before = given.copy()
    trials = session.trials(hands, given)
    np.testing.assert_array_equal(given, before)
    due = others.trials([*np.array(hands)[~far]], targets[~far])
    for rows, expected in zip(trials, due, strict=True):
        np.testing.assert_array_equal(rows[~far], expected)
    assert np.isneginf(trials.rewards[far]).all()
    assert [session.rewards[n] for n in (0, 5, 11)] == [None] * 3
    assert session.meter.failed_trials == others.meter.failed_trials + 3
    assert session.meter.movement_ticks == others.meter.movement_ticks


def test_until_the_first_that_is_better():
    task = load_task("two-armed-2")
    hands, targets = sample(task, 12)
    rewards = make_trials(task, hands, targets).rewards
    until = np.full(12, np.inf)
    until[[2, 5, 9]] = rewards[[2, 5, 9]] - [0.0, 1.0, 1.0]  # the first one is equalled
    session, alone = (Session(task, 0, OPTIMISER_INFORMATION) for _ in range(2))
    np.testing.assert_array_equal(session.trials(hands, targets, until=until).rewards, rewards[:6])
    alone.trials(hands[:6], targets[:6])
    assert session.meter == alone.meter


def test_a_session_counts_per_configuration():
    session = Session(load_task("ascending"), 0, set(Information), trial_budget=2)
    session.forward_kinematics(np.zeros((4, 5, 10)), "right")
    correction = session.correct(session.q0, "right", 1)
    execution = session.trial([Movement(k, "right", "corrective") for k in (1, 2, 3)])
    meter = session.meter
    assert meter.forward_kinematics == 20 + correction.iterations + 1 + execution.evaluations
    assert (meter.trials, meter.movement_ticks, meter.corrections) == (1, 319, 3)
    assert session.trials_left == 1
    with pytest.raises(ValueError, match="goal is .* from 1 to 3"):
        session.correct(session.q0, "right", 4)


def test_a_session_is_shared_by_threads():
    task = load_task("ascending")
    session = Session(task, 0, OPTIMISER_INFORMATION, trial_budget=100)
    solution = corrective_trial(task, "RRR").movements

    def work(n):
        try:
            return session.trial(solution).reward
        except BudgetError:
            return None

    with ThreadPoolExecutor(8) as pool:
        rewards = [*pool.map(work, range(300))]
    assert rewards.count(-319) == session.meter.trials == len(session.rewards) == 100


METHODS = {method.name: method for name in MODULES for method in import_module(name).METHODS}
ANY_WORLD = [MotionModel(motor_noise=0.01), MotionModel(norm="maximum"), MotionModel(base_weight=4)]
REFUSED = {  # how many of these three worlds a method refuses
    "dual-process/EC4": 0, "dual-process/EC4-informed": 0, "cma-es/bandit": 0, "random-search": 0,
    "corrective-alone/best-hands": 0, "optimum/search": 1, "receding-horizon": 1,
    "optimum/in-model": 0,
    "trajectory-optimisation/path-length": 1, "trajectory-optimisation/jerk": 2,
    "nullspace-qp/least-motion": 2, "posture-based/one-goal": 2, "posture-qp/current-goal": 2,
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_method_refuses_worlds_whose_lengths_it_does_not_know(name):
    """Noise is no reason to refuse; a planner that counts the paper's lengths would be wrong."""
    reasons = [METHODS[name].refuses(model) for model in ANY_WORLD]
    assert reasons[0] is None
    assert sum(reason is not None for reason in reasons) == REFUSED[name]
    for reason, constant in zip(reasons, ("motor_noise", "norm", "base_weight"), strict=True):
        assert reason is None or f"model.{constant} is " in reason


def test_a_planner_that_counts_lengths_itself_is_not_run_in_another_world():
    method = METHODS["posture-based/one-goal"]()
    with pytest.raises(NotApplicableError, match="model.base_weight is 4.0; .* leave the constant"):
        run_method(method, "ascending", model=MotionModel(base_weight=4))
    with pytest.raises(ValueError, match="model.norm is 'taxi'; it must be 'euclidean' or"):
        run_method(method, "ascending", model=MotionModel(norm="taxi"))


@pytest.mark.parametrize("name", METHODS)
def test_every_method_solves_a_task_in_noise(name):
    """A planner by its own computations, without noise; any other by noisy trials."""
    method = METHODS[name]
    parameters = dict(method.quick)
    if "trials" in method.Parameters.model_fields:
        parameters["trials"] = 60
    task = tiny_task(goals=[[4.0, 1.0], [3.5, 1.5]])
    made = method(method.Parameters(**parameters))
    if made.inapplicable_reason(outline_of(task)) is None:
        result, session = run_method(made, task, model=MotionModel(motor_noise=0.01))
        assert execute(task, result.solution).completed
        assert session.model.motor_noise == 0.01
        assert {movement.ticks for movement in result.solution} == {None}
        assert all(m.target is None for m in result.solution if m.kind == "corrective")
        assert (result.initial, result.replay) == ((), ())
        if not session.trials_made and name != "optimum/in-model":  # a planner: its plan
            plan, _ = run_method(made, task)
            assert result.solution == next_action(plan.solution)
