"""A solution tick by tick: what :func:`coartic.motion.solution.execute` scores, spelled out."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coartic.errors import SolutionError
from coartic.model import PAPER, MotionModel
from coartic.motion.movement import path_points
from coartic.motion.solution import Execution, Movement, execute
from coartic.robot import Array, Hand
from coartic.tasks.task import Task, TaskLike, as_task, hands_of
from coartic.text import short_repr


@dataclass(frozen=True)
class Trajectory:
    """Every control tick of an execution that hit all goals (:func:`trajectory`)."""

    task: Task
    """The task."""
    execution: Execution
    """What :func:`coartic.execute` says of the solution."""
    configurations: Array
    """Configurations passed, shape ``(ticks, dof)``, length unit (base) and rad (joints): a row
    each control tick, the first one the start. A movement of k steps gives k + 1 rows, the last
    one the tick that detects its end, so the next movement's first row repeats it."""
    hits: NDArray[np.int64]
    """Row at which each goal was hit, shape ``(G,)``. A goal that was hit without a tick
    of its own has the row in which the robot stood; 0 before the first tick."""

    def __repr__(self) -> str:
        return short_repr(
            self,
            task=self.task.name,
            hands=self.execution.hands,
            reward=self.execution.reward,
            configurations=self.configurations,
            hits=self.hits,
        )

    @property
    def hands(self) -> tuple[Hand, ...]:
        """Hand chosen for each goal."""
        return hands_of(self.execution.hands)

    @property
    def ticks(self) -> int:
        """Number of control ticks; the reward also loses the penalty, where there is one."""
        return self.execution.ticks

    def hand_path(self, hand: Hand) -> Array:
        """The path of a hand.

        Parameters
        ----------
        hand : {"left", "right"}
            Either hand, also one that the task does not let hit goals.

        Returns
        -------
        ndarray, shape (rows, 2)
            Its position in each row of ``configurations``, length unit.

        Raises
        ------
        ValueError
            The hand is neither ``"left"`` nor ``"right"``.
        """
        return self.task.robot.forward_kinematics(self.configurations, hand)

    def subtask(self, goal: int) -> Array:
        """The configurations from the hit of the goal before, or the start, to that of a goal.

        Parameters
        ----------
        goal : int
            Number of the goal, from 1.

        Returns
        -------
        ndarray, shape (k, dof)
            Rows of ``configurations``, both ends included.
        """
        first = self.hits[goal - 2] if goal > 1 else 0
        return self.configurations[first : self.hits[goal - 1] + 1]


def trajectory(
    task: TaskLike, movements: Iterable[Movement], model: MotionModel = PAPER
) -> Trajectory:
    """Execute a solution and keep every control tick.

    The number of ticks and the configurations at the hits are those of :func:`coartic.execute`,
    bit for bit.

    Parameters
    ----------
    task : Task, str or pathlib.Path
        The task, its name or its file.
    movements : iterable of Movement
        The solution: at least one movement for each goal, in the order of the goals.
    model : MotionModel
        The constants of movement and of the corrective process.

    Returns
    -------
    Trajectory
        The configurations tick by tick, and the rows in which the goals were hit.

    Raises
    ------
    TaskError
        The task cannot be used.
    TypeError
        The task is neither a Task nor a text nor a path.
    SolutionError
        The solution breaks the task's rules, or does not hit every goal.
    ValueError
        No movement can be made with the model.
    """
    task = as_task(task)
    execution = execute(task, movements, model=model)
    if not execution.completed:
        raise SolutionError(f"task {task.name!r}: {execution.reason}")
    return spell_out(task, execution, model)


def spell_out(task: Task, execution: Execution, model: MotionModel) -> Trajectory:
    """Every control tick of an execution that has hit all goals."""
    q = np.array(task.q0)
    rows = [q[None, :][:0]]
    elapsed = np.zeros(len(task.goals), dtype=np.int64)
    for movement in execution.movements:
        assert movement.ticks is not None
        assert movement.target is not None
        if movement.kind == "path":
            assert movement.waypoints is not None
            points = path_points(task.robot, q, movement.waypoints, model)
            points = points[: movement.ticks]
        else:
            points = line_points(q, movement.target, movement.ticks, model)
        if len(points):
            q = points[-1]
            rows.append(points)
        elapsed[movement.goal - 1 :] += movement.ticks
    hits = np.maximum(elapsed - 1, 0)
    return Trajectory(task, execution, np.concatenate(rows), hits)


def line_points(q: Array, target: Array, count: int, model: MotionModel) -> Array:
    """The first points of a movement, summed and rounded as its kernel does."""
    difference = target - q
    square = 0.0
    for value in difference.tolist():
        square += value * value
    distance = math.sqrt(square)
    last = math.ceil(distance / model.step)
    k = np.arange(count)[:, None]
    if not last:
        return np.repeat(target[None, :], count, axis=0)
    between = q + k * model.step / distance * difference
    points: Array = np.where((k < last) | model.whole_last_step, between, target)
    return points
