"""Every way to make a trial makes that of the step-by-step reference."""

import functools
import itertools
from types import SimpleNamespace

import numpy as np
import pytest

import coartic
from coartic import PAPER, MotionModel, Movement, execute, load_task, movements_of, trajectory
from coartic.method import Session
from coartic.method.optimisers import OPTIMISER_INFORMATION, explored_joints
from coartic.motion import trials
from coartic.motion.execution import execute_many
from coartic.motion.kernels.slots import SLOTS, robot_parameters
from coartic.motion.kernels.trial import CORRECTIONS, FAILURES, ITERATIONS, TICKS, Requests
from coartic.motion.trials import (
    ALL_MOVE,
    NO_WAYPOINTS,
    compiled_task,
    noise_draws,
    reach,
    reach_goals,
)
from coartic.robot import HANDS
from coartic.tasks.task import hands_of
from tests.support import reference
from tests.support.strategies import make_trials, random_solution, sample, uneven_task

LIMITS = {  # iterations of the corrective process, spread of the targets
    "ascending": (80, 4.0),
    "two-armed-2": (120, 0.3),
    "uneven": (100, 4.0),
}
TASKS = {name: uneven_task() if name == "uneven" else load_task(name) for name in LIMITS}
MODELS = {name: MotionModel(max_iterations=most) for name, (most, _) in LIMITS.items()}
BOTH = TASKS["two-armed-2"]
NOISY = MotionModel(motor_noise=0.1)


@functools.cache
def cases(name):
    """Trials; in every second one, the arms without a goal to come stay and no other joint."""
    task, model, rng = TASKS[name], MODELS[name], np.random.default_rng(3)
    noise = rng.choice([0.03, LIMITS[name][1]], (20, 1, 1))
    hands, targets = sample(task, 20, noise, seed=1)
    session = Session(task, 0, OPTIMISER_INFORMATION)
    for n in range(len(hands)):
        if n % 2 == 0:
            targets[n][:, ~explored_joints(session)] = np.nan
        else:
            targets[n][rng.random(targets[n].shape) < 0.2] = np.nan
        if n % 4 > 1:
            targets[n, rng.integers(len(task.goals))] = np.nan
    return [
        SimpleNamespace(
            hands=each, targets=rows, due=reference.execute(task, movements_of(each, rows), model)
        )
        for each, rows in zip(hands, targets, strict=True)
    ]


def by_execute_many(task, model, cases):
    solutions = [case.solution for case in cases]
    for made in execute_many(compiled_task(task, model), solutions):
        names = ("reward", "ticks", "corrections", "iterations", "movements")
        yield {name: getattr(made, name) for name in names} | {"hits": made.configurations}


def by_trials(task, model, cases):
    session = Session(task, 0, OPTIMISER_INFORMATION, model=model)
    trials = session.trials([case.hands for case in cases], np.array([c.targets for c in cases]))
    assert session.meter.forward_kinematics == trials.evaluations.sum()
    assert session.meter.movement_ticks == trials.ticks.sum()
    assert session.meter.corrections == trials.corrections.sum()
    assert session.meter.failed_trials == session.rewards.count(None)
    assert session.meter.trials == len(cases)
    for n, reward in enumerate(session.rewards):
        assert trials.rewards[n] == (-np.inf if reward is None else reward)
        reached = trials.reached[n]
        yield {
            "reward": reward,
            "ticks": trials.ticks[n],
            "corrections": trials.corrections[n],
            "iterations": trials.iterations[n],
            "hits": reached[~np.isnan(reached[:, 0])],
        }


def by_trajectory(task, model, cases):
    for case in cases:
        if case.due.reward is None:
            with pytest.raises(coartic.SolutionError, match="goal"):
                trajectory(task, case.solution, model=model)
            yield None
            continue
        path = trajectory(task, case.solution, model=model)
        hits = path.configurations[path.hits] if path.ticks else path.execution.configurations
        yield {"ticks": path.ticks, "hits": hits, "rows": path.configurations}


def assert_due(door, task, model, cases):
    """What a way to make trials says of each is what is due; of some it may say nothing."""
    found = [*door(task, model, cases)]
    assert len(found) == len(cases)
    for facts, case in zip(found, cases, strict=True):
        for name, value in (facts or {}).items():
            due = getattr(case.due, name)
            if name == "reward":
                assert value == due
            elif name == "movements":
                for one, other in zip(value, due, strict=True):
                    np.testing.assert_allclose(one.target, other.target, rtol=0, atol=1e-9)
                    assert repr(one) == repr(other)
            else:
                due = np.reshape(due, np.shape(value))
                np.testing.assert_allclose(value, due, rtol=0, atol=1e-9, err_msg=name)
    return any(found)


@pytest.mark.parametrize("name", TASKS)
def test_a_trial_is_the_references(name):
    assert assert_due(by_trials, TASKS[name], MODELS[name], cases(name))
    rewards = [case.due.reward for case in cases(name)]
    assert (None in rewards) == (name != "two-armed-2")
    assert len({*rewards}) >= 8
    assert len({case.due.corrections for case in cases(name)}) >= 2


OTHERS = {
    "two-armed-2": MotionModel(max_iterations=300, arrival_tolerance=0.09),
    "uneven": MotionModel(max_iterations=100),
}


@functools.cache
def rich_cases(name):
    """Solutions of all kinds of movement, several for a goal, near what hits and far from it."""
    task, model, rng = TASKS[name], OTHERS[name], np.random.default_rng(0)
    solutions = [random_solution(task, model, rng) for _ in range(10)]
    return [
        SimpleNamespace(solution=each, due=reference.execute(task, each, model))
        for each in solutions
    ]


@pytest.mark.parametrize("name", OTHERS)
@pytest.mark.parametrize("door", [by_execute_many, by_trajectory])
def test_a_solution_of_any_kind_is_the_references(door, name):
    assert assert_due(door, TASKS[name], OTHERS[name], rich_cases(name))


def test_counts_of_trials_with_several_targets_for_a_goal():
    """They are those of the reference, whatever the number of targets."""
    task, model = TASKS["two-armed-2"], OTHERS["two-armed-2"]
    hands, targets = sample(task, 12, 0.3, seed=5)
    twice = np.stack([targets, targets[::-1]], axis=2)
    codes = [[HANDS.index(hand) for hand in hands_of(letters)] for letters in hands]
    records = trials.make_trials(compiled_task(task, model), np.array(codes), twice)
    for letters, rows, counts, reward in zip(hands, twice, *records[1:], strict=True):
        solution = [
            Movement(goal, hand, "learned", target)
            for goal, (hand, both) in enumerate(zip(hands_of(letters), rows, strict=True), 1)
            for target in both
        ]
        due = reference.execute(task, solution, model)
        expected = due.ticks, due.iterations, due.corrections, due.reward is None
        places = TICKS, ITERATIONS, CORRECTIONS, FAILURES
        assert tuple(counts[[*places]]) == expected
        assert reward == (trials.NO_REWARD if due.reward is None else due.reward)


@pytest.mark.parametrize("name", OTHERS)
def test_a_trial_does_not_notice_its_neighbours(name):
    """To the last bit, whatever their number and order; nor does an execution."""
    task, model = TASKS[name], MODELS[name]
    hands, targets = sample(task, SLOTS + 30)
    targets[::7, 1] = np.nan
    hands = np.array(hands)
    together = make_trials(task, [*hands], targets, model=model)
    for chosen in (slice(None, None, -1), slice(3, 60, 7), slice(5, 6)):
        some = make_trials(task, [*hands[chosen]], targets[chosen], model=model)
        for field, same in zip(together, some, strict=True):
            np.testing.assert_array_equal(field[chosen], same)
    solutions = [case.solution for case in rich_cases(name)]
    many = execute_many(compiled_task(task, OTHERS[name]), solutions)
    for solution, execution in zip(solutions, many, strict=True):
        alone = execute(task, solution, model=OTHERS[name])
        np.testing.assert_array_equal(alone.configurations, execution.configurations)
        assert alone.evaluations == execution.evaluations


@pytest.mark.parametrize("bad", [np.nan, -np.inf, 1e300])
@pytest.mark.parametrize("where", ["start", "target", "goal"])
def test_kernels_end_whatever_they_get(bad, where):
    """Without the checks of their callers; a loop that does not end would end the tests."""
    q, targets = np.tile(BOTH.q0, (5, 1)), np.tile(BOTH.q0 + 0.5, (5, 1))
    goals = np.tile(BOTH.goal_array[0], (5, 1))
    {"start": q, "target": targets, "goal": goals}[where][::2, 0] = bad
    hands, worlds = np.arange(5)[:, None] % 2, noise_draws(np.arange(5), 0)
    for given, model in itertools.product((targets, targets * np.nan), (PAPER, NOISY)):
        arms = (q, hands, given[:, None, None], ALL_MOVE, NO_WAYPOINTS, goals[:, None], 0, worlds)
        assert (
            len(
                reach(
                    BOTH.robot, Requests(*arms), robot_parameters(BOTH.robot, model=model)
                ).rewards
            )
            == 5
        )


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        *(("hands", [0, hand], "must be 0 .left. or 1 .right.") for hand in (2, -1, 0.5)),
        ("q", [BOTH.q0[:9]] * 2, "^q "),
        ("q", [BOTH.q0 * np.nan] * 2, "^q "),
        ("goals", [[1.0, 2.0]], "^goals "),
        ("goals", [[1.0, np.inf]] * 2, "^goals "),
        ("targets", np.zeros((2, 9)), "^targets "),
        ("radius", 0.0, "radius"),
        ("locked_base", ("z",), "may only have 'x' and 'y'"),
    ],
)
def test_many_arms_are_checked_before_a_kernel_gets_them(name, wrong, words):
    usual = {"q": [BOTH.q0] * 2, "hands": [0, 1], "goals": BOTH.goal_array[:2], "radius": 0.1}
    assert reach_goals(BOTH.robot, **usual).hit.all()
    with pytest.raises(ValueError, match=words):
        reach_goals(BOTH.robot, **usual | {name: wrong})
