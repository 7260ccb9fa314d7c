"""Initial solutions: a hand sequence, each target from the corrective process.

Trial 0 of every run is one of these (paper, section *The Corrective Process*). A task
names its initial hands, or a policy that picks them by what the corrective process
alone achieves.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from functools import lru_cache

from coartic.errors import LOADED, NotApplicableError, need
from coartic.model import PAPER, MotionModel
from coartic.motion.solution import Execution, Movement, execute, execute_many
from coartic.robot import HANDS, Hand
from coartic.tasks.task import WITHOUT_REACH, Task, hands_of, letters_of

MOST_SEQUENCES = 4096  # hand sequences that are tried one by one


def corrective_trial(task: Task, hands: str, *, model: MotionModel = PAPER) -> Execution:
    """One trial by the corrective process alone, with the given hands (``"RRRR"``)."""
    return execute(task, corrective_movements(hands), model=model)


def corrective_movements(hands: str) -> list[Movement]:
    """A corrective movement for each goal, with the given hands."""
    return [Movement(number, hand, "corrective") for number, hand in enumerate(hands_of(hands), 1)]


def hand_sequences(task: Task, hands: Iterable[Hand] | None = None) -> list[str]:
    """All hand sequences of a task, left before right; 2^G of them for two hands.

    Raises NotApplicableError above ``MOST_SEQUENCES``, TypeError for what is no task.
    """
    need(task, Task, LOADED)
    allowed = task.hands if hands is None else tuple(hands)
    ordered = [hand for hand in HANDS if hand in allowed]
    reason = too_many_sequences(task, len(ordered))
    if reason is not None:
        raise NotApplicableError(reason)
    return [letters_of(s) for s in itertools.product(ordered, repeat=len(task.goals))]


def too_many_sequences(task: Task, hands: int) -> str | None:
    """Why the sequences of so many hands cannot all be tried, or None where they can."""
    count = hands ** len(task.goals)
    if count <= MOST_SEQUENCES:
        return None
    return f"task {task.name!r} has {count} hand sequences; at most {MOST_SEQUENCES} are tried"


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
    executions = execute_many(task, map(corrective_movements, each), model=model)
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
    task: Task, hands: tuple[Hand, ...] | None = None, *, model: MotionModel = PAPER
) -> str:
    """The initial hand sequence of a task for a robot with the given hands.

    A named sequence stands as it is. Policies take the first of
    :func:`ranked_sequences` among sequences of one hand (``best-single-hand``) or among
    all (``best-of-all``). Raises NotApplicableError where no candidate completes the
    task, or there are too many.
    """
    return search_initial_hands(task, hands, model=model)[0]


def search_initial_hands(
    task: Task, hands: tuple[Hand, ...] | None = None, *, model: MotionModel = PAPER
) -> tuple[str, Mapping[str, int]]:
    """:func:`initial_hands`, and what finding them has spent, by the names of a session's meter:
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
            f"task {task.name!r}: the corrective process completes it with none of the "
            f"{len(candidates)} hand sequences of initial_hands = {task.initial_hands!r}"
        )
    trials = [trial for _, trial in ranked]
    iterations = sum(trial.iterations for trial in trials)
    return best, {
        "trials": len(trials),
        "movement_ticks": sum(trial.ticks for trial in trials),
        "forward_kinematics": sum(trial.evaluations for trial in trials),
        "jacobians": iterations,
        "corrective_iterations": iterations,
        "corrections": sum(trial.corrections for trial in trials),
        "failed_trials": sum(not trial.completed for trial in trials),
    }
