"""Many solutions executed side by side, as :func:`coartic.motion.solution.execute` does.

Only of solutions that it executes without a word of the corrective process: movements straight
in joint space whose targets are given and which hit every goal. That is what is stored of a run,
so a folder of many runs is executed again at a tenth of the cost. Of any other solution nothing
is said here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.model import MotionModel, checked_model
from coartic.motion.compiled import entry, fill_row, inner
from coartic.motion.lanes import LANES, depart, lanes_for, runs_for
from coartic.motion.movement import LARGEST, move_lanes
from coartic.motion.problem import arm_of, goal_of, problem_of
from coartic.robot import HANDS, Array, Hand
from coartic.tasks.task import Task


class Straight(NamedTuple):
    """A solution of straight movements."""

    goals: Sequence[int]
    """Of each movement, from 1."""
    hands: Sequence[Hand]
    kinds: Sequence[str]
    targets: Sequence[Sequence[float]]


class Made(NamedTuple):
    """What came of a solution that hits every goal."""

    ticks: list[int | None]
    """Of each movement; None where it was not needed."""
    reached: Array
    """Configuration when each goal was hit, shape ``(G, dof)``."""


class _Rows(NamedTuple):
    """Movements of N solutions, R in all, and what the kernel fills."""

    first: Any  # (N, G + 1) row of each goal's first movement, and the one after the last
    hands: Any  # (N, G)
    arrives: Any  # (R,) whether it ends on arrival, too: whether it is not corrective
    targets: Any  # (R, dof)
    ticks: Any  # (R,) -1 where it was not made
    reached: Any  # (N, G, dof)
    going: Any  # (N,) whether every goal was hit so far


class _Work(NamedTuple):
    """What the kernel works on."""

    runs: Any  # (N,) records: see runs_for
    row: Any  # (N,) the movement that is made next; -1 where none is
    hit: Any  # (N,)
    lanes: Any


@inner
def _move_chosen(number: int, arrives: bool, problem: Any, rows: Any, work: Any) -> None:
    """Move the solutions that have a row, in lots of as many as there are lanes."""
    goal = goal_of(problem, number)
    count = 0
    for n in range(len(work.runs)):
        run = work.runs[n]
        if work.row[n] >= 0:
            arm = arm_of(problem, rows.hands[n, number])
            depart(work.lanes.at, count, n, run.q, run.target, arm)
            count += 1
        if count == LANES or (n == len(work.runs) - 1 and count > 0):
            move_lanes(work.lanes, count, goal, arrives, problem.model, work.runs)
            count = 0


@entry
def _execute(problem: Any, rows: Any, work: Any) -> None:
    """Execute all solutions, goal by goal."""
    for n in range(len(work.runs)):
        fill_row(work.runs[n].q, problem.start)
    for number in range(len(problem.goals)):
        most = 0
        for n in range(len(work.runs)):  # whether the goal is hit where the robot stands
            work.row[n] = 0 if rows.going[n] else -1
            fill_row(work.runs[n].target, work.runs[n].q)
            most = max(most, rows.first[n, number + 1] - rows.first[n, number])
        _move_chosen(number, True, problem, rows, work)
        for n in range(len(work.runs)):
            work.hit[n] = work.runs[n].hit
        for place in range(most):
            for arrives in (True, False):
                for n in range(len(work.runs)):
                    row = rows.first[n, number] + place
                    needed = rows.going[n] and row < rows.first[n, number + 1]
                    needed = needed and rows.arrives[row] == arrives
                    needed = needed and (not work.hit[n] or (place == 0 and arrives))
                    work.row[n] = row if needed else -1
                    if needed:
                        fill_row(work.runs[n].target, rows.targets[row])
                _move_chosen(number, arrives, problem, rows, work)
                for n in range(len(work.runs)):
                    if work.row[n] >= 0:
                        rows.ticks[work.row[n]] = work.runs[n].ticks
                        work.hit[n] = work.runs[n].hit
        for n in range(len(work.runs)):
            # A goal that no movement was needed for is hit on the way: a case of its own.
            made = rows.ticks[rows.first[n, number]] >= 0
            rows.going[n] = rows.going[n] and work.hit[n] and made
            fill_row(rows.reached[n, number], work.runs[n].q)


def execute_straight(
    task: Task, solutions: Mapping[int, Straight], model: MotionModel, *, most_steps: float
) -> dict[int, Made]:
    """Execute solutions from the task's start; by number those of which something can be said.

    Of the others :func:`coartic.motion.solution.execute` has to say what they are: those that
    miss a goal, hit one on the way, are longer than ``most_steps`` or break the task's rules, and
    all of them where corrective movements end on arrival. Raises
    ValueError for a model that no movement can be made with.
    """
    checked_model(model, radius=task.radius)
    laid = {
        number: firsts
        for number, solution in solutions.items()
        if (firsts := _firsts(task, solution)) is not None
    }
    if not laid or model.corrective_arrival:
        return {}
    chosen = [solutions[number] for number in laid]
    targets = np.array([target for own in chosen for target in own.targets], dtype=np.float64)
    starts = np.cumsum([0, *(len(own.targets) for own in chosen)])
    first = np.array(list(laid.values()), dtype=np.int64) + starts[:-1, None]
    codes = [
        [HANDS.index(own.hands[index]) for index in firsts[:-1]]
        for own, firsts in zip(chosen, laid.values(), strict=True)
    ]
    shape = len(chosen), len(task.goals), task.robot.dof
    rows = _Rows(
        first=first,
        hands=np.array(codes, dtype=np.int64),
        arrives=np.array([kind != "corrective" for own in chosen for kind in own.kinds]),
        targets=targets,
        ticks=np.full(len(targets), -1, dtype=np.int64),
        reached=np.empty(shape),
        going=_fit(task, targets, starts, most_steps * model.step),
    )
    row, hit = np.zeros(shape[0], np.int64), np.zeros(shape[0], np.bool_)
    work = _Work(runs_for(shape[0], task.robot), row, hit, lanes_for(task.robot))
    _execute(problem_of(task, model), rows, work)
    ticks = [None if count < 0 else count for count in rows.ticks.tolist()]
    spans = pairwise(starts.tolist())
    return {
        number: Made(ticks[begin:end], reached)
        for number, (begin, end), reached, good in zip(
            laid, spans, rows.reached, rows.going.tolist(), strict=True
        )
        if good
    }


def _firsts(task: Task, solution: Straight) -> list[int] | None:
    """Index of each goal's first movement, and the number of movements; None where they are not
    in order, with one hand for a goal, and of the robot's degrees of freedom."""
    firsts: list[int] = []
    hand = ""
    for index, (goal, own) in enumerate(zip(solution.goals, solution.hands, strict=True)):
        if goal == len(firsts) + 1:
            firsts.append(index)
            hand = own
        if goal != len(firsts) or own != hand or own not in task.hands:
            return None
    dof = task.robot.dof
    fitting = len(firsts) == len(task.goals) and all(len(q) == dof for q in solution.targets)
    return [*firsts, len(solution.goals)] if fitting else None


def _fit(
    task: Task, targets: Array, starts: NDArray[np.int64], longest: float
) -> NDArray[np.bool_]:
    """Whether each solution's targets are within bounds and leave a locked base where it is."""
    before = np.concatenate([task.q0[None, :], targets[:-1]])
    before[starts[:-1]] = task.q0
    length = np.add.reduceat(np.sqrt(((targets - before) ** 2).sum(axis=1)), starts[:-1])
    good = np.asarray((np.abs(targets) <= LARGEST).all(axis=1))
    for coordinate in task.locked_base:
        joint = "xy".index(coordinate)
        good &= targets[:, joint] == task.q0[joint]
    whole = np.logical_and.reduceat(good, starts[:-1])
    return np.asarray(whole & (length < 0.9 * longest))
