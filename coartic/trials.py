"""Many trials in one call: target configurations in, rewards out.

The rules are those of :func:`coartic.solution.execute` for solutions with at most one
learned movement per goal; the corrective process **A** finishes what they miss. Meant
for methods that make thousands of trials.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.compiled import entry
from coartic.corrective import correct_kernel
from coartic.model import PAPER, MotionModel, checked_model
from coartic.movement import LARGEST, move_kernel, scratch_for
from coartic.robot import HANDS, Array
from coartic.task import Task, hands_of


class Trials(NamedTuple):
    """What came of N trials."""

    ticks: NDArray[np.int64]
    """Control ticks of each, shape ``(N,)``."""
    completed: NDArray[np.bool_]
    """Whether every goal was hit, shape ``(N,)``."""
    targets: Array
    """Targets as moved to, shape ``(N, G, dof)``; a row of NaN where **A** alone acted,
    and in the goals after a failure what was given."""
    reached: Array
    """Configuration when each goal was hit, shape ``(N, G, dof)``; NaN after a failure."""
    corrections: int
    """Corrective movements made, in all trials."""
    iterations: int
    """Iterations of the corrective process, one Jacobian each."""
    evaluations: int
    """Forward-kinematics evaluations the kernel made."""


class _Count(NamedTuple):
    """Indices of the counters."""

    corrections: int = 0
    iterations: int = 1
    evaluations: int = 2


_C = _Count()


def _make(
    hands: Any,
    start: Any,
    goals: Any,
    radius: float,
    free_x: bool,
    free_y: bool,
    left: Any,
    right: Any,
    model: Any,
    scratch: Any,
    targets: Any,
    reached: Any,
    ticks: Any,
    completed: Any,
    counts: Any,
) -> None:
    """Make every trial, filling ``targets`` and all that follows it."""
    q = np.empty_like(start)
    found = np.empty_like(start)
    for trial in range(len(targets)):
        q[:] = start
        for goal in range(len(goals)):
            arm = left if hands[goal] == 0 else right
            goal_x, goal_y = goals[goal, 0], goals[goal, 1]
            target = targets[trial, goal]
            given = False
            for j in range(len(q)):
                given = given or not math.isnan(target[j])
            if given:
                for j in range(len(q)):
                    if math.isnan(target[j]):
                        target[j] = q[j]
                spent, hit, evaluations = move_kernel(
                    q, target, arm, goal_x, goal_y, radius, True, model, scratch
                )
                ticks[trial] += spent
            else:  # a movement to where it is tells whether the goal is hit
                found[:] = q
                _, hit, evaluations = move_kernel(
                    q, found, arm, goal_x, goal_y, radius, False, model, scratch
                )
            counts[_C.evaluations] += evaluations
            if not hit:
                found[:] = q
                converged, iterations = correct_kernel(
                    found, arm, goal_x, goal_y, free_x, free_y, 0.0, model, scratch
                )
                counts[_C.iterations] += iterations
                counts[_C.evaluations] += iterations + 1
                if not converged:
                    break
                spent, hit, evaluations = move_kernel(
                    q, found, arm, goal_x, goal_y, radius, False, model, scratch
                )
                counts[_C.corrections] += 1
                counts[_C.evaluations] += evaluations
                ticks[trial] += spent
                if not hit:
                    break
            reached[trial, goal] = q
            completed[trial] = goal == len(goals) - 1


_compiled_make = entry(_make)


def make_trials(task: Task, hands: str, targets: Array, *, model: MotionModel = PAPER) -> Trials:
    """Make N trials with the hand sequence ``hands`` (``"RRLR"``), each from the start.

    ``targets`` has shape ``(N, G, dof)``, length unit (base) and rad (joints). A joint
    whose target is NaN keeps its value; for a goal without any target **A** acts alone.
    Raises ValueError for a wrong shape, for targets that are infinite or beyond
    ``LARGEST``, for ones that move a locked base, and for hands the robot does not have.
    """
    checked_model(model, radius=task.radius)
    names = hands_of(hands)
    if len(names) != len(task.goals) or not set(names) <= set(task.hands):
        raise ValueError(f"hands {hands!r} do not fit task {task.name!r}")
    made = np.array(targets, dtype=np.float64)
    if made.ndim != 3 or made.shape[1:] != (len(task.goals), task.robot.dof):
        raise ValueError(
            f"targets have shape {made.shape}; needed are (N, {len(task.goals)}, {task.robot.dof})"
        )
    if np.any(np.abs(made) > LARGEST):
        raise ValueError(f"a target has a figure beyond {LARGEST:g}")
    for coordinate in task.locked_base:
        column = made[..., "xy".index(coordinate)]
        if np.any(~np.isnan(column) & (column != task.q0["xy".index(coordinate)])):
            raise ValueError(f"a target moves the base in {coordinate}, which is locked")
    reached = np.full_like(made, np.nan)
    ticks = np.zeros(len(made), dtype=np.int64)
    completed = np.zeros(len(made), dtype=np.bool_)
    counts = np.zeros(len(_C), dtype=np.int64)
    _compiled_make(
        np.array([HANDS.index(hand) for hand in names], dtype=np.int64),
        np.array(task.q0),
        np.array(task.goal_array),
        float(task.radius),
        "x" not in task.locked_base,
        "y" not in task.locked_base,
        task.robot.arm("left"),
        task.robot.arm("right"),
        model,
        scratch_for(task.robot),
        made,
        reached,
        ticks,
        completed,
        counts,
    )
    return Trials(ticks, completed, made, reached, *map(int, counts))
