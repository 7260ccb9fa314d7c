"""Initial solutions: a hand sequence, each target from the corrective process.

Trial 0 of every run is one of these (paper, section *The Corrective Process*). A task
names its initial hands, or a policy that picks them by what the corrective process
alone achieves.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

from coartic.errors import LOADED, NotApplicableError, need
from coartic.model import PAPER, MotionModel
from coartic.motion.solution import Execution, Movement, execute, execute_many
from coartic.robot import HANDS, Hand
from coartic.tasks.task import Task, hands_of, letters_of

MOST_SEQUENCES = 4096  # hand sequences that are tried one by one


def corrective_trial(task: Task, hands: str, *, model: MotionModel = PAPER) -> Execution:
    """One trial by the corrective process alone, with the given hands (``"RRRR"``)."""
    return execute(task, _by_correction(hands), model=model)


def _by_correction(hands: str) -> list[Movement]:
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

    def rank(entry: tuple[str, Execution]) -> tuple[float, int]:
        reward = entry[1].reward
        return math.inf if reward is None else -reward, changes_of_hand(entry[0])

    each = list(sequences)
    trials: list[tuple[str, Execution]] = []
    made = execute_many(task, map(_by_correction, each), model=model)
    for hands, trial in zip(each, made, strict=True):
        if isinstance(trial, Exception):
            raise trial
        trials.append((hands, trial))
    return sorted(trials, key=rank)


def initial_hands(
    task: Task, hands: tuple[Hand, ...] | None = None, *, model: MotionModel = PAPER
) -> str:
    """The initial hand sequence of a task for a robot with the given hands.

    A named sequence stands as it is. Policies take the first of
    :func:`ranked_sequences` among sequences of one hand (``best-single-hand``) or among
    all (``best-of-all``). Raises NotApplicableError where no candidate completes the
    task, or there are too many.
    """
    return search_initial_hands(task, hands, model=model).hands


class InitialSearch(NamedTuple):
    """The initial hands of a task, and what a policy spent on finding them."""

    hands: str
    trials: int = 0
    movement_ticks: int = 0
    forward_kinematics: int = 0
    corrective_iterations: int = 0
    corrections: int = 0
    failed_trials: int = 0


def search_initial_hands(
    task: Task, hands: tuple[Hand, ...] | None = None, *, model: MotionModel = PAPER
) -> InitialSearch:
    """:func:`initial_hands` with its cost, which is nothing for a named sequence."""
    if not task.initial_is_policy:
        return InitialSearch(task.initial_hands)
    allowed = task.hands if hands is None else hands
    return _by_policy(_Content(task), tuple(hand for hand in HANDS if hand in allowed), model)


class _Content:
    """A task as a key of a cache: equal where the content is equal."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.text = task.model_dump_json()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Content) and self.text == other.text

    def __hash__(self) -> int:
        return hash(self.text)


@lru_cache(maxsize=64)
def _by_policy(content: _Content, hands: tuple[Hand, ...], model: MotionModel) -> InitialSearch:
    task = content.task
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
    made = [trial for _, trial in ranked]
    return InitialSearch(
        best,
        trials=len(made),
        movement_ticks=sum(trial.ticks for trial in made),
        forward_kinematics=sum(trial.evaluations for trial in made),
        corrective_iterations=sum(trial.iterations for trial in made),
        corrections=sum(trial.corrections for trial in made),
        failed_trials=sum(not trial.completed for trial in made),
    )
