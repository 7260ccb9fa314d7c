"""A task as the kernels read it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from coartic.model import MotionModel
from coartic.motion.compiled import inlined
from coartic.motion.corrective import Corrector
from coartic.motion.movement import Goal, check_goal, configuration
from coartic.robot import Arm
from coartic.tasks.task import Task


class Problem(NamedTuple):
    """Task and constants."""

    start: Any  # (dof,)
    goals: Any  # (G, 2)
    radius: float
    left: Arm
    right: Arm
    corrector: Corrector
    model: MotionModel


def problem_of(task: Task, model: MotionModel) -> Problem:
    """The task for a kernel.

    Raises ValueError for an invalid task: a copy with changed fields is unchecked, and kernels
    would read beyond their arrays.
    """
    locked = task.locked_base
    goals = [check_goal(goal, task.radius)[:2] for goal in task.goals]
    return Problem(
        start=configuration(task.robot, task.q0),
        goals=np.array(goals, dtype=np.float64),
        radius=float(task.radius),
        left=task.robot.arm("left"),
        right=task.robot.arm("right"),
        corrector=Corrector("x" not in locked, "y" not in locked),
        model=model,
    )


@inlined
def arm_of(problem: Any, hand: int) -> Any:
    """The arm of a hand: 0 left, 1 right."""
    return problem.left if hand == 0 else problem.right


@inlined
def goal_of(problem: Any, number: int) -> Any:
    """A goal, from 0."""
    return Goal(problem.goals[number, 0], problem.goals[number, 1], problem.radius)
