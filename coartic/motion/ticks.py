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
from coartic.tasks.task import Task, hands_of


@dataclass(frozen=True)
class Trajectory:
    """Every control tick of an execution that hit all goals."""

    task: Task
    execution: Execution
    configurations: Array
    """Configurations passed, shape ``(ticks, dof)``: a row each control tick, the first one
    the start. A movement of k steps gives k + 1 rows, the last one the tick that detects its
    end, so the row after it (the next movement's first) repeats it. Under a model without
    that tick k steps give k rows and the start one of its own: ``(ticks + 1, dof)``."""
    hits: NDArray[np.int64]
    """Row at which each goal was hit, shape ``(G,)``. A goal that was hit without a tick
    of its own has the row in which the robot stood; 0 before the first tick."""

    @property
    def hands(self) -> tuple[Hand, ...]:
        """Hand chosen for each goal."""
        return hands_of(self.execution.hands)

    @property
    def ticks(self) -> int:
        """Number of control ticks; the reward also loses the penalty, where there is one."""
        return self.execution.ticks

    def hand_path(self, hand: Hand) -> Array:
        """Position of either hand in each row, shape ``(rows, 2)``, length unit."""
        return self.task.robot.forward_kinematics(self.configurations, hand)

    def subtask(self, goal: int) -> Array:
        """Rows from the hit of the goal before (or the start) to that of ``goal``, both
        included, shape ``(k, dof)``; ``goal`` counts from 1."""
        first = self.hits[goal - 2] if goal > 1 else 0
        return self.configurations[first : self.hits[goal - 1] + 1]


def trajectory(task: Task, movements: Iterable[Movement], model: MotionModel = PAPER) -> Trajectory:
    """Execute a solution and keep every control tick.

    Agrees with :func:`~coartic.motion.solution.execute` bit for bit in the number of ticks and
    the configuration at each hit. Raises SolutionError where the solution breaks the
    task's rules or does not hit every goal.
    """
    execution = execute(task, movements, model=model)
    if not execution.completed:
        raise SolutionError(f"task {task.name!r}: {execution.reason}")
    unpaid = 1 - model.arrival_tick  # the point that a movement begins with
    q = np.array(task.q0)
    rows = [q[None, :][:unpaid]]
    elapsed = np.zeros(len(task.goals), dtype=np.int64)
    for movement in execution.movements:
        assert movement.ticks is not None
        assert movement.target is not None
        if movement.kind == "path":
            assert movement.waypoints is not None
            points = path_points(task.robot, q, movement.waypoints, model)
            points = points[unpaid : unpaid + movement.ticks]
        else:
            points = line_points(q, movement.target, unpaid + movement.ticks, model)[unpaid:]
        if len(points):
            q = points[-1]
            rows.append(points)
        elapsed[movement.goal - 1 :] += movement.ticks
    hits = np.maximum(elapsed - model.arrival_tick, 0)
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
