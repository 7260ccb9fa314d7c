"""Trials made by the compiled batch against the same trials executed one by one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import MotionModel, Movement, corrective_trial, execute, hand_sequences, load_task
from coartic.motion.trials import make_trials
from coartic.tasks.catalogue import builtin_tasks
from coartic.tasks.task import hands_of
from tests.support.strategies import tiny_task, uneven_task

TASKS = [
    *map(load_task, builtin_tasks()),
    tiny_task(),
    uneven_task(
        [0.3],
        [0.1, 0.4, -0.2, 0.2],
        base=[0.5, -0.5],
        goals=[[2.0, 1.0], [1.0, 0.5], [1.05, 0.5], [3.0, 0.0]],
        initial_hands="RRRR",
        locked_base=["x"],
    ),
]


@settings(max_examples=20)
@given(
    st.sampled_from(TASKS),
    st.integers(0, 10**6),
    st.sampled_from([0.0, 0.05, 0.5, 3.0]),
    st.sampled_from([2, 100, 20_000]),
)
def test_equal_to_execution_one_by_one(task, seed, noise, max_iterations):
    rng = np.random.default_rng(seed)
    model = MotionModel(max_iterations=max_iterations)
    hands = [str(sequence) for sequence in rng.choice(hand_sequences(task), 8)]
    goals, dof = len(task.goals), task.robot.dof
    targets = np.tile(task.q0, (8, goals, 1)) + noise * rng.standard_normal((8, goals, dof))
    for sequence in set(hands):
        alone = corrective_trial(task, sequence).configurations  # fewer where it cannot reach
        with_sequence = [chosen == sequence for chosen in hands]
        targets[with_sequence, : len(alone)] += alone - task.q0
    held = rng.random((8, goals, dof)) < 0.2
    held[..., ["xy".index(coordinate) for coordinate in task.locked_base]] = True
    held[rng.random((8, goals)) < 0.2] = True
    targets[held] = np.nan
    trials = make_trials(task, hands, targets, model=model)

    iterations = corrections = evaluations = 0
    for n in range(8):
        movements = []
        attempted = min(goals, (~np.isnan(trials.reached[n, :, 0])).sum() + 1)
        for goal, hand in enumerate(hands_of(hands[n])):
            if held[n, goal].all():
                movements.append(Movement(goal + 1, hand, "corrective"))
                evaluations -= goal < attempted
                assert np.isnan(trials.targets[n, goal]).all()
                continue
            evaluations -= 2 * (goal < attempted)  # execute looks before it moves
            target = trials.targets[n, goal]
            if goal < attempted:
                before = trials.reached[n, goal - 1] if goal else task.q0
                np.testing.assert_array_equal(
                    target, np.where(held[n, goal], before, targets[n, goal])
                )
            else:
                target = task.q0  # not moved to, but a solution names one for every goal
            movements.append(Movement(goal + 1, hand, "learned", target))
        one = execute(task, movements, model=model)
        assert trials.completed[n] == one.completed
        assert trials.ticks[n] == one.ticks
        np.testing.assert_array_equal(
            trials.reached[n, : len(one.configurations)], one.configurations
        )
        assert np.isnan(trials.reached[n, len(one.configurations) :]).all()
        iterations += one.iterations
        corrections += one.corrections
        evaluations += one.evaluations
    assert trials.iterations.sum() == iterations
    assert trials.corrections.sum() == corrections
    assert trials.evaluations.sum() == evaluations


def test_one_hand_sequence_stands_for_all():
    task = load_task("two-armed-1")
    targets = np.random.default_rng(0).normal(0, 0.3, (3, len(task.goals), task.robot.dof))
    targets[..., :2] = np.nan
    one, each = (make_trials(task, hands, targets) for hands in ("RLRL", ["RLRL"] * 3))
    for same, other in zip(one, each, strict=True):
        np.testing.assert_array_equal(same, other)
    with pytest.raises(ValueError, match="2 hand sequences for 3 trials"):
        make_trials(task, ["RLRL", "RRRR"], targets)


def test_failures_are_seen():
    """With two corrective iterations no correction of any length converges."""
    task = load_task("ascending")
    trials = make_trials(
        task, "RRR", np.full((2, 3, 10), np.nan), model=MotionModel(max_iterations=2)
    )
    assert not trials.completed.any()
    assert (trials.ticks == 0).all()
    assert (trials.corrections == 0).all()
    assert np.isnan(trials.reached).all()


def test_what_was_given_is_left_alone():
    targets = np.full((1, 3, 10), np.nan)
    targets[0, 0, 0] = 1.0
    given = targets.copy()
    trials = make_trials(load_task("ascending"), "RRR", targets)
    np.testing.assert_array_equal(targets, given)
    np.testing.assert_array_equal(trials.targets[0, 0], [1.0, *[0.0] * 9])


@pytest.mark.parametrize(
    ("name", "hands", "shape", "value", "message"),
    [
        ("ascending", "RR", (1, 3, 10), 0.0, "do not fit"),
        ("ascending", "RRL", (1, 3, 10), 0.0, "do not fit"),
        ("ascending", "RRR", (3, 10), 0.0, "have shape"),
        ("ascending", "XXX", (1, 3, 10), 0.0, "'XXX' do not fit"),
        ("ascending", 3, (1, 3, 10), 0.0, "3 do not fit"),
        ("ascending", ["RRR", ["R", "R", "R"]], (2, 3, 10), 0.0, "do not fit"),
        ("ascending", "RRR", (1, 3, 9), 0.0, "have shape"),
        ("ascending", "RRR", (1, 3, 10), np.inf, "beyond"),
        ("two-armed-1", "RRRR", (1, 4, 10), 0.1, "moves the base in y"),
    ],
)
def test_trials_that_cannot_be_made(name, hands, shape, value, message):
    with pytest.raises(ValueError, match=message):
        make_trials(load_task(name), hands, np.full(shape, value))
