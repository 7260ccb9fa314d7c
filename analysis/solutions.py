"""Executed solutions of one method on one task, and the initial solution."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from coartic import Execution, Task, corrective_trial, initial_hands
from coartic.errors import NotApplicableError
from coartic.robot import HANDS, Array
from coartic.tasks.task import hands_of


@dataclass(frozen=True)
class Solutions:
    """Executed solutions of n runs of one method with one setting on one task with G goals."""

    task: Task
    label: str
    """Label: id of the method with its setting, or ``recorded``."""
    runs: tuple[Execution, ...]
    """Executions of the solutions, one for each run."""
    run_ids: tuple[str, ...] = ()
    """Ids of the runs, in the order of ``runs``; empty without ids."""
    unfinished: int = 0
    """Number of recorded trials, not among ``runs``, in which a goal was never reached, as counted
    by :func:`.hits_from_markers`; 0 for others."""

    @cached_property
    def hands(self) -> NDArray[np.int64]:
        """Hands chosen for the goals, shape ``(n, G)``: 0 for left, 1 for right, as in HANDS."""
        hands = [[HANDS.index(hand) for hand in hands_of(run.hands)] for run in self.runs]
        return np.array(hands, dtype=np.int64).reshape(-1, len(self.task.goals))

    @cached_property
    def configurations(self) -> Array:
        """Configurations that hit the goals, shape ``(n, G, dof)``, length unit and rad."""
        shape = len(self.runs), len(self.task.goals), self.task.robot.dof
        return np.array([run.configurations for run in self.runs]).reshape(shape)

    @cached_property
    def starts(self) -> Array:
        """Configurations at the start of each subtask, shape ``(n, G, dof)``: the hit of the goal
        before, or the start of the task."""
        starts = np.empty_like(self.configurations)
        starts[:, 0], starts[:, 1:] = self.task.q0, self.configurations[:, :-1]
        return starts

    @cached_property
    def against_same_hands(self) -> Array:
        """Ticks of each subtask less its ticks by the corrective process alone with the hands of
        the run, shape ``(n, G)``; NaN if this process does not complete the task."""
        every = {run.hands for run in self.runs}
        references = {hands: corrective_trial(self.task, hands) for hands in every}
        changes = np.full((len(self.runs), len(self.task.goals)), np.nan)
        for row, run in zip(changes, self.runs, strict=True):
            if (reference := references[run.hands]).completed:
                row[:] = np.subtract(run.ticks_by_goal(), reference.ticks_by_goal())
        return changes


def initial_solution(task: Task) -> Execution | None:
    """Return the execution of the corrective process alone with the initial hands of a task.

    None if the corrective process does not complete the task with these hands, or if the task does
    not name them and no hand sequence of its policy completes it or over 4,096 would have to be
    tried.
    """
    try:
        execution = corrective_trial(task, initial_hands(task))
    except NotApplicableError:
        return None
    return execution if execution.completed else None
