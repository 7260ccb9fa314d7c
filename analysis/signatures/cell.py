"""One cell of a results folder, its runs as tick-by-tick trajectories."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.results.folder import Results
from coartic import Execution, Hand, Task, Trajectory, corrective_trial, initial_hands, trajectory
from coartic.errors import NotApplicableError
from coartic.frames import movements_from
from coartic.robot import Array


@dataclass(frozen=True)
class Cell:
    """The solved runs of one method with parameters on one task."""

    task: Task
    method: str
    variant: str
    runs: tuple[Trajectory, ...]

    @cached_property
    def initial(self) -> Execution | None:
        """The initial solution: the corrective process alone with the task's hands.

        None where it completes the task with none.
        """
        try:
            return self.corrective(initial_hands(self.task))
        except NotApplicableError:
            return None

    def corrective(self, hands: str) -> Execution | None:
        """The corrective process alone with these hands; None where it fails the task."""
        execution = corrective_trial(self.task, hands)
        return execution if execution.completed else None

    @cached_property
    def sequences(self) -> list[str]:
        """Hand sequence of each run."""
        return [run.execution.hands for run in self.runs]

    @cached_property
    def typical(self) -> tuple[Trajectory, ...]:
        """Runs with the most frequent hand sequence, so that postures compare."""
        if not self.runs:
            return ()
        sequence = Counter(self.sequences).most_common(1)[0][0]
        return tuple(run for run in self.runs if run.execution.hands == sequence)

    def with_hand(self, hand: Hand, goal: int) -> tuple[Trajectory, ...]:
        """Runs that hit a goal with ``hand``; ``goal`` counts from 1."""
        return tuple(run for run in self.runs if run.hands[goal - 1] == hand)


def postures(runs: tuple[Trajectory, ...], goal: int) -> Array:
    """Configuration of each run when it hit a goal, shape ``(runs, dof)``."""
    return np.array([run.execution.configurations[goal - 1] for run in runs])


def last_ticks(runs: tuple[Trajectory, ...], goal: int, count: int) -> Array:
    """The last control ticks of each run up to a hit, shape ``(runs, count, dof)``."""
    ends = [run.hits[goal - 1] + 1 for run in runs]
    return np.array(
        [run.configurations[end - count : end] for run, end in zip(runs, ends, strict=True)]
    )


def cells_of(results: Results) -> list[Cell]:
    """Every cell of a results folder in the order of the plan."""
    tasks = results.tasks
    solutions = dict(list(results.solutions().groupby("run_id")))
    waypoints = results.paths()
    paths = dict(list(waypoints.groupby("run_id"))) if len(waypoints) else {}
    return [
        Cell(
            tasks[cell.task],
            cell.method,
            cell.variant,
            tuple(
                trajectory(
                    tasks[cell.task],
                    movements_from(tasks[cell.task], solutions[run_id], paths.get(run_id)),
                )
                for run_id in cell.good.run_id
            ),
        )
        for cell in results.cells
    ]
