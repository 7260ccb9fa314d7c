"""Initial solutions: a hand sequence, each target from the corrective process.

Trial 0 of every run is one of these (paper, section *The Corrective Process*). A task
names its initial hands, or a policy that picks them by what the corrective process
alone achieves.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable

from coartic.errors import NotApplicableError
from coartic.model import PAPER, MotionModel
from coartic.robot import HANDS, Hand
from coartic.solution import Execution, Movement, execute
from coartic.task import Task, hands_of, letters_of


def corrective_trial(task: Task, hands: str, *, model: MotionModel = PAPER) -> Execution:
    """One trial by the corrective process alone, with the given hands (``"RRRR"``)."""
    movements = [
        Movement(number, hand, "corrective") for number, hand in enumerate(hands_of(hands), 1)
    ]
    return execute(task, movements, model=model)


def hand_sequences(task: Task, hands: Iterable[Hand] | None = None) -> list[str]:
    """All hand sequences of a task, left before right; 2^G of them for two hands."""
    allowed = task.hands if hands is None else tuple(hands)
    ordered = [hand for hand in HANDS if hand in allowed]
    return [letters_of(s) for s in itertools.product(ordered, repeat=len(task.goals))]


def initial_hands(
    task: Task, hands: tuple[Hand, ...] | None = None, *, model: MotionModel = PAPER
) -> str:
    """The initial hand sequence of a task for a robot with the given hands.

    A named sequence stands as it is. Policies take the highest reward of the
    corrective process alone among sequences of one hand (``best-single-hand``) or
    among all (``best-of-all``); of equals, the one with the fewest changes of hand,
    then the first with left before right. Raises NotApplicableError where no
    candidate completes the task.
    """
    if not task.initial_is_policy:
        return task.initial_hands
    candidates = hand_sequences(task, hands)
    if task.initial_hands == "best-single-hand":
        candidates = [sequence for sequence in candidates if len(set(sequence)) == 1]
    scored = []
    for order, sequence in enumerate(candidates):
        reward = corrective_trial(task, sequence, model=model).reward
        if reward is not None:
            changes = sum(a != b for a, b in itertools.pairwise(sequence))
            scored.append((-reward, changes, order, sequence))
    if not scored:
        raise NotApplicableError(
            f"task {task.name!r}: the corrective process completes it with none of the "
            f"{len(candidates)} hand sequences that {task.initial_hands!r} tries"
        )
    return min(scored)[-1]
