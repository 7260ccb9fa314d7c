"""Initial solutions: a hand sequence, each target from the corrective process.

Trial 0 of every run is one of these (paper, section *The Corrective Process*). A task
names its initial hands, or a policy that picks them by what the corrective process
alone achieves.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterable, Mapping
from functools import lru_cache

from coartic.errors import NotApplicableError
from coartic.internal.limits import brief_value
from coartic.model import PAPER, MotionModel
from coartic.motion.reach import compiled_task
from coartic.motion.solution import Execution, Movement, execute, execute_many
from coartic.robot import HANDS, Hand
from coartic.tasks.task import (
    WITHOUT_REACH,
    Task,
    TaskLike,
    as_task,
    check_hands,
    hands_of,
    letters_of,
)

MOST_SEQUENCES = 4096  # hand sequences that are tried one by one


def corrective_trial(task: TaskLike, hands: str, *, model: MotionModel = PAPER) -> Execution:
    """Make one trial by the corrective process alone.

    Parameters
    ----------
    task : Task, str or pathlib.Path
        The task, its name or its file.
    hands : str
        The hand for each goal: ``"LRRR"`` is left, right, right, right.
    model : MotionModel
        The constants of movement and of the corrective process.

    Returns
    -------
    Execution
        What happened: movements, configurations at the hits, control ticks and reward. Where the
        corrective process does not converge, ``completed`` is False and ``reason`` says so.

    Raises
    ------
    TaskError
        The task cannot be used.
    TypeError
        The task is neither a Task nor a text nor a path.
    ValueError
        The hands do not fit the task, or no movement can be made with the model.

    Notes
    -----
    Source: paper, section *The Corrective Process*.
    """
    task = as_task(task)
    hands = check_hands(task, hands)
    return execute(task, corrective_movements(hands), model=model)


def corrective_movements(hands: str) -> list[Movement]:
    """A corrective movement for each goal, with the given hands."""
    return [Movement(number, hand, "corrective") for number, hand in enumerate(hands_of(hands), 1)]


def hand_sequences(task: TaskLike, hands: Iterable[Hand] | None = None) -> list[str]:
    """All hand sequences of a task.

    Parameters
    ----------
    task : Task, str or pathlib.Path
        The task, its name or its file.
    hands : iterable of {"left", "right"}, optional
        The hands that may be used; all that the robot has by default.

    Returns
    -------
    list of str
        The sequences in alphabetical order, such as ``"LLLR"``: one letter for each of G goals,
        2^G sequences for two hands.

    Raises
    ------
    TaskError
        The task cannot be used.
    TypeError
        The task is neither a Task nor a text nor a path.
    NotApplicableError
        There are more than 4096 sequences.
    ValueError
        The robot has not all of these hands.
    """
    task = as_task(task)
    allowed = task.hands if hands is None else hands_among(task, hands)
    return sequences_with(allowed, len(task.goals), task.name)


def sequences_with(hands: Collection[Hand], goals: int, task: str) -> list[str]:
    """All sequences of some hands for so many goals, in alphabetical order.

    Raises NotApplicableError, which names the task, where there are too many.
    """
    ordered = [hand for hand in HANDS if hand in hands]
    if reason := too_many_sequences(task, goals, len(ordered)):
        raise NotApplicableError(reason)
    return [letters_of(sequence) for sequence in itertools.product(ordered, repeat=goals)]


def hands_among(task: Task, hands: Iterable[Hand]) -> tuple[Hand, ...]:
    """Some of the hands of a task's robot; ValueError where it does not have them."""
    chosen = tuple(hands)
    if not chosen or any(hand not in task.hands for hand in chosen):
        raise ValueError(
            f"hands is {brief_value(hands if isinstance(hands, str) else chosen)}; it must be a "
            f"list of hands of task {task.name!r}: {' and '.join(map(repr, task.hands))}"
        )
    return chosen


def too_many_sequences(task: str, goals: int, hands: int) -> str | None:
    """Why the sequences of so many hands cannot all be tried on a task, or None where they can."""
    count = hands**goals
    if count <= MOST_SEQUENCES:
        return None
    return f"task {task!r} has {count} hand sequences; at most {MOST_SEQUENCES} are tried"


def changes_of_hand(sequence: str) -> int:
    """How often successive goals are hit by different hands."""
    return sum(a != b for a, b in itertools.pairwise(sequence))


def ranked_sequences(
    task: Task, sequences: Iterable[str], *, model: MotionModel = PAPER
) -> list[tuple[str, Execution]]:
    """The corrective process alone with each hand sequence, best first, failed ones last.

    Of equal rewards the one with the fewest changes of hand comes first, then the one
    that was given first.
    """

    each = list(sequences)
    trials: list[tuple[str, Execution]] = []
    executions = execute_many(compiled_task(task, model), map(corrective_movements, each))
    for hands, trial in zip(each, executions, strict=True):
        if isinstance(trial, Exception):
            raise trial
        trials.append((hands, trial))
    return sorted(
        trials,
        key=lambda entry: (
            math.inf if entry[1].reward is None else -entry[1].reward,
            changes_of_hand(entry[0]),
        ),
    )


def initial_hands(
    task: TaskLike, hands: tuple[Hand, ...] | None = None, *, model: MotionModel = PAPER
) -> str:
    """The hand sequence of a first trial of a task.

    A sequence that the task names stands as it is. Of a policy it is the sequence with which the
    corrective process alone gets the highest reward: among sequences of one hand
    (``"best-single-hand"``), or among all (``"best-of-all"``).

    Parameters
    ----------
    task : Task, str or pathlib.Path
        The task, its name or its file.
    hands : tuple of {"left", "right"}, optional
        The hands among which a policy chooses; all that the robot has by default.
    model : MotionModel
        The constants of movement and of the corrective process.

    Returns
    -------
    str
        The hand for each goal, such as ``"RRRR"``.

    Raises
    ------
    TaskError
        The task cannot be used.
    TypeError
        The task is neither a Task nor a text nor a path.
    NotApplicableError
        No candidate completes the task, or there are more than 4096.
    ValueError
        The robot has not all of these hands, or no movement can be made with the model.

    Notes
    -----
    Source: paper, section *Experiments*.
    """
    task = as_task(task)
    chosen = None if hands is None else hands_among(task, hands)
    return search_initial_hands(task, chosen, model=model)[0]


def initial_reward(task: Task, model: MotionModel = PAPER) -> int | None:
    """Reward of the corrective process alone with a task's initial hands; None where it fails with
    them, or there are none with which it completes the task."""
    try:
        hands = initial_hands(task, model=model)
    except NotApplicableError:
        return None
    return corrective_trial(task, hands, model=model).reward


def search_initial_hands(
    task: Task, hands: tuple[Hand, ...] | None = None, *, model: MotionModel = PAPER
) -> tuple[str, Mapping[str, int]]:
    """The sequence of :func:`initial_hands`, and what its search spent, by the names of a meter:
    nothing for a named sequence."""
    if not task.initial_is_policy:
        return task.initial_hands, {}
    allowed = task.hands if hands is None else hands
    ordered = tuple(hand for hand in HANDS if hand in allowed)
    return search_by_policy(task.model_dump_json(), ordered, model)


@lru_cache(maxsize=64)
def search_by_policy(
    task_json: str, hands: tuple[Hand, ...], model: MotionModel
) -> tuple[str, Mapping[str, int]]:
    """The search of a task, given as JSON, with these hands: the same is made once."""
    task = Task.model_validate_json(task_json, context=WITHOUT_REACH)
    if task.initial_hands == "best-single-hand":
        candidates = [letters_of([hand] * len(task.goals)) for hand in hands]
    else:
        candidates = hand_sequences(task, hands)
    ranked = ranked_sequences(task, candidates, model=model)
    best, execution = ranked[0]
    if not execution.completed:
        raise NotApplicableError(
            f"task {task.name!r}: the corrective process completes it with no hand sequence that "
            f"initial_hands = {task.initial_hands!r} allows; with {best}, {execution.reason}"
        )
    trials = [trial for _, trial in ranked]
    iterations = sum(trial.iterations for trial in trials)
    return best, {
        "initial_trials": len(trials),
        "movement_ticks": sum(trial.ticks for trial in trials),
        "forward_kinematics": sum(trial.evaluations for trial in trials),
        "jacobians": iterations,
        "corrective_iterations": iterations,
        "corrections": sum(trial.corrections for trial in trials),
    }
