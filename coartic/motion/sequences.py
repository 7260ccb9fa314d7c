"""What the corrective process alone gives, for many sets of goals and hand sequences.

The rules are those of :func:`coartic.motion.initial.corrective_trial`. Meant for searches over
where goals may be: what two trials begin with, goal and hand by goal and hand, is computed once
if one follows the other, so that sequences of hands and grids of goals cost little more than
the movements in which they differ.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from coartic.model import PAPER, MotionModel, checked_model
from coartic.motion.compiled import entry, fill_row, inner
from coartic.motion.corrective import correct_lanes
from coartic.motion.lanes import board, depart, lanes_for, runs_for
from coartic.motion.movement import LARGEST, Goal, move_lanes
from coartic.motion.problem import arm_of, problem_of
from coartic.robot import HANDS, Array
from coartic.tasks.task import Task, hands_of


class CorrectiveTrials(NamedTuple):
    """Trials by the corrective process alone: N sets of goals, S hand sequences."""

    rewards: Array
    """Total reward, shape ``(N, S)``; NaN where the corrective process failed."""
    reached: Array
    """Configuration when each goal was hit, shape ``(N, S, G, dof)``; NaN after a failure."""


class _Path(NamedTuple):
    """A trial as far as it has come: before each goal, and at the end."""

    q: Any  # (G + 1, dof)
    ticks: Any  # (G + 1,), NaN after a failure
    hand: Any  # (G,) by which a goal was hit; -1 before the first trial
    goal: Any  # (G, 2)


@inner
def _hit(g: int, problem: Any, path: Any, lanes: Any, runs: Any) -> None:
    """From before goal ``g`` of a path to after it."""
    goal = Goal(path.goal[g, 0], path.goal[g, 1], problem.radius)
    arm, run = arm_of(problem, path.hand[g]), runs[0]
    path.ticks[g + 1] = path.ticks[g]
    fill_row(run.q, path.q[g])
    fill_row(run.target, path.q[g])
    if not math.isnan(path.ticks[g]):
        # A movement to where the robot is tells whether it stands in the goal already.
        depart(lanes.at, 0, 0, run.q, run.target, arm)
        move_lanes(lanes, 1, goal, False, problem.model, runs)
        if not run.hit:
            board(lanes.at, 0, 0, run.q, arm)
            correct_lanes(lanes, 1, goal, problem.corrector, problem.model, runs)
            if run.converged:
                depart(lanes.at, 0, 0, run.q, run.target, arm)
                stops = problem.model.corrective_arrival
                move_lanes(lanes, 1, goal, stops, problem.model, runs)
                path.ticks[g + 1] += run.ticks
            if not run.hit:
                path.ticks[g + 1] = math.nan
    fill_row(path.q[g + 1], run.q)
    if math.isnan(path.ticks[g + 1]):
        path.q[g + 1, :] = math.nan


@entry
def _try_all(
    goals: Any,
    codes: Any,
    problem: Any,
    rewards: Any,
    reached: Any,
    path: Any,
    lanes: Any,
    runs: Any,
) -> None:
    length = goals.shape[1]
    for number in range(len(goals)):
        for sequence in range(len(codes)):
            same = True
            for g in range(length):
                x, y = goals[number, g]
                hand = codes[sequence, g]
                same &= (path.hand[g] == hand) & (path.goal[g, 0] == x) & (path.goal[g, 1] == y)
                if not same:
                    path.hand[g], path.goal[g, 0], path.goal[g, 1] = hand, x, y
                    _hit(g, problem, path, lanes, runs)
                fill_row(reached[number, sequence, g], path.q[g + 1])
            rewards[number, sequence] = -path.ticks[length]


def corrective_trials(
    task: Task, sequences: Sequence[str], goals: Array, *, model: MotionModel = PAPER
) -> CorrectiveTrials:
    """Trials by the corrective process alone, with each hand sequence, at each set of goals.

    ``goals`` has shape ``(N, G, 2)``, length unit; those of the task itself do not matter, all
    else of it does. Sequences (``"RRLR"``) in alphabetical order and sets of goals that begin
    as the one before are cheap. Raises ValueError for a wrong shape, for figures that are
    not finite or beyond ``LARGEST``, and for hands the robot does not have.
    """
    checked_model(model, radius=task.radius)
    places = np.array(goals, dtype=np.float64)
    if places.ndim != 3 or places.shape[2] != 2:
        raise ValueError(f"goals have shape {places.shape}; needed are (N, G, 2)")
    if not (np.abs(places) <= LARGEST).all():
        raise ValueError(f"a goal is not finite or lies beyond {LARGEST:g}")
    for hands in sequences:
        if len(hands) != places.shape[1] or not set(hands_of(hands)) <= set(task.hands):
            raise ValueError(
                f"hands {hands!r} do not fit {places.shape[1]} goals of task {task.name!r}"
            )
    shape = (len(places), len(sequences), places.shape[1])
    made = CorrectiveTrials(np.empty(shape[:2]), np.empty((*shape, task.robot.dof)))
    path = _Path(
        q=np.tile(np.array(task.q0), (shape[2] + 1, 1)),
        ticks=np.zeros(shape[2] + 1),
        hand=np.full(shape[2], -1),
        goal=np.zeros((shape[2], 2)),
    )
    codes = [[HANDS.index(hand) for hand in hands_of(hands)] for hands in sequences]
    _try_all(
        places,
        np.array(codes, dtype=np.int64).reshape(shape[1:]),
        problem_of(task, model),
        *made,
        path,
        lanes_for(task.robot),
        runs_for(1, task.robot),
    )
    return made
