"""The corrective process alone, with every hand sequence.

The paper's exhaustive strategy (section *Exploration Condition 3*): try all 2^G hand
sequences, each target from **A**, and no further exploration. It is told the goals,
forward kinematics and Jacobian of the robot, and the reward of each trial.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from coartic import (
    PAPER,
    Execution,
    MotionModel,
    NotApplicableError,
    Task,
    corrective_trial,
    hand_sequences,
)

MOST_SEQUENCES = 4096


@dataclass(frozen=True)
class SequenceTrial:
    """One trial of the corrective process alone."""

    hands: str
    execution: Execution


def every_sequence(task: Task, *, model: MotionModel = PAPER) -> list[SequenceTrial]:
    """One trial per hand sequence, best first, failed ones last.

    Deterministic. Raises NotApplicableError above ``MOST_SEQUENCES`` sequences.
    """
    count = len(task.hands) ** len(task.goals)
    if count > MOST_SEQUENCES:
        raise NotApplicableError(
            f"task {task.name!r} has {count} hand sequences; at most {MOST_SEQUENCES} are tried"
        )
    trials = [
        SequenceTrial(hands, corrective_trial(task, hands, model=model))
        for hands in hand_sequences(task)
    ]

    def cost(trial: SequenceTrial) -> float:
        reward = trial.execution.reward
        return math.inf if reward is None else -reward

    return sorted(trials, key=cost)
