"""Solutions of one method on one task, tick by tick, and what they are compared with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from coartic import Execution, Hand, Task, Trajectory, corrective_trial, initial_hands
from coartic.errors import NotApplicableError
from coartic.robot import Array


@dataclass(frozen=True)
class Trajectories:
    """The solved runs of one method with parameters on one task."""

    task: Task
    method: str
    variant: str
    runs: tuple[Trajectory, ...]
    run_ids: tuple[str, ...] = ()

    @cached_property
    def initial(self) -> Execution | None:
        """The initial solution: the corrective process alone with the task's hands.

        None where it completes the task with none.
        """
        return initial_solution(self.task)

    @cached_property
    def sequences(self) -> list[str]:
        """Hand sequence of each run."""
        return [run.execution.hands for run in self.runs]

    def with_hand(self, hand: Hand, goal: int) -> tuple[Trajectory, ...]:
        """Runs that hit a goal with ``hand``; ``goal`` counts from 1."""
        return tuple(run for run in self.runs if run.hands[goal - 1] == hand)

    @cached_property
    def against_same_hands(self) -> Array:
        """Ticks of subtasks less the corrective process's with each run's own hands.

        Shape ``(n, G)``; NaN for runs with whose hands it does not complete the task.
        """
        references = {hands: corrective(self.task, hands) for hands in set(self.sequences)}
        changes = np.full((len(self.runs), len(self.task.goals)), np.nan)
        for row, run in zip(changes, self.runs, strict=True):
            if (reference := references[run.execution.hands]) is not None:
                row[:] = change_from(run.execution, reference)
        return changes


def change_from(execution: Execution, reference: Execution) -> NDArray[np.int64]:
    """Ticks of each subtask less those of another solution, shape ``(G,)``; negative: faster."""
    return np.subtract(execution.ticks_by_goal(), reference.ticks_by_goal(), dtype=np.int64)


def corrective(task: Task, hands: str) -> Execution | None:
    """The corrective process alone with these hands; None where it fails the task."""
    execution = corrective_trial(task, hands)
    return execution if execution.completed else None


def initial_solution(task: Task) -> Execution | None:
    """The corrective process alone with the task's hands; None where it completes it with none."""
    try:
        return corrective(task, initial_hands(task))
    except NotApplicableError:
        return None


def postures(runs: tuple[Trajectory, ...], goal: int) -> Array:
    """Configuration of each run when it hit a goal, shape ``(runs, dof)``."""
    return np.array([run.execution.configurations[goal - 1] for run in runs])


def best_sequences(sequences: pd.DataFrame) -> list[str]:
    """The hand sequences that are best by the corrective process alone, ties included.

    ``sequences``: a task's rows of :meth:`Study.sequences`. Empty where none has a reward.
    """
    solved = sequences[sequences.reward.notna()]
    return [str(hands) for hands in solved.hands[solved.reward == solved.reward.max()]]
