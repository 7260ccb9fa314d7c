"""Reaching for a goal: the rule that every trial, execution and learner follows.

The first movement for a goal is made. Where there is none, the hand may be in the goal already.
Further movements are made while the goal is missed, and in the end the corrective process **A**
looks for a configuration that hits it, and the arm moves there (paper, sections *Generating
Movement for Each Goal* and *The Corrective Process*). Many arms reach side by side; what one gives
depends neither on the others nor on their number.
"""

from __future__ import annotations

import math
from collections import defaultdict
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.internal.threads import in_parts
from coartic.model import PAPER, MotionModel, check_model
from coartic.motion.compiled import entry, fill_row, inlined, shared
from coartic.motion.corrective import correct_slots
from coartic.motion.movement import check_goal, configuration, move_slots
from coartic.motion.robot_parameters import arm_of, robot_parameters_for
from coartic.motion.slots import SLOTS, load, runs_for, slots_for, start
from coartic.robot import Array, Robot
from coartic.tasks.task import Task

IDLE, CHECK, MOVE, REPEAT = range(4)
"""How a run acts next: not at all; it checks whether its hand is in the goal; it moves to its
target and ends on arrival, too; it repeats a corrective movement, which ends on a hit or at the
target."""


class Reached(NamedTuple):
    """Results of N arms, or of N arms and G goals: then each shape is ``(N, G, ...)``."""

    q: Array
    """Where each ended, or stayed, shape ``(N, dof)``."""
    hit: NDArray[np.bool_]
    """Whether its hand is in the goal, shape ``(N,)``."""
    ticks: NDArray[np.int64]
    """Control ticks of its movements, shape ``(N,)``."""
    moved: NDArray[np.int64]
    """Control ticks of each movement to a given target among them, shape ``(N, M)``; 0 where it
    was not made."""
    corrected: Array
    """Target of its corrective movement, shape ``(N, dof)``; NaN where none was reached."""
    corrections: NDArray[np.int64]
    """Corrective movements reached, 0 or 1: 0 also where **A** did not converge."""
    iterations: NDArray[np.int64]
    """Iterations of the corrective process, one Jacobian each."""
    evaluations: NDArray[np.int64]
    """Forward-kinematics evaluations reached."""


class Requests(NamedTuple):
    """Requests to the kernel: N arms, each to G goals in turn by M movements each."""

    starts: Any  # (N, dof), or (1, dof) for one start of all
    hands: Any  # (N, G)
    targets: Any  # (N, G, M, dof), in which the kernel fills in joints without a target
    stops: Any  # (N, G, M) whether the movement to the target ends on arrival; empty where all do
    goals: Any  # (N, G, 2), or (1, G, 2) for the same goals of all


class Batch(NamedTuple):
    """Work space of a lot of arms, each now at its next goal."""

    runs: Any  # records: see runs_for
    slots: Any


@shared
def move_acting(count: int, stops: bool, robot_parameters: Any, batch: Any) -> None:
    """Move the acting arms to their targets."""
    at, slot = batch.slots.at[0], 0
    for i in range(count):
        run = batch.runs[i]
        if run.acting:
            start(at, slot, i, run.q, run.target, arm_of(robot_parameters, run.hand), run.goal)
            slot += 1
    if slot > 0:
        move_slots(batch.slots, slot, stops, robot_parameters, batch.runs)


@inlined
def attempt(count: int, robot_parameters: Any, batch: Any) -> None:
    """Let each run act as it is to; one that does not move takes no ticks."""
    for stops in (True, False):
        for i in range(count):
            run = batch.runs[i]
            # A movement to where an arm is tells whether it hits; it needs no other end.
            run.acting = run.how == MOVE if stops else run.how == CHECK or run.how == REPEAT
        move_acting(count, stops, robot_parameters, batch)
    for i in range(count):
        if batch.runs[i].how < MOVE:
            batch.runs[i].ticks = 0


@shared
def find_corrections(count: int, robot_parameters: Any, batch: Any) -> None:
    """Have **A** look for where to finish missed goals: the ``target`` of runs ``converged``."""
    at, slot = batch.slots.at[0], 0
    for i in range(count):
        run = batch.runs[i]
        run.acting, run.converged = run.corrects and run.going and not run.hit, False
        run.ticks, run.iterations = 0, 0
        if run.acting:
            fill_row(run.target, run.q)
            load(at, slot, i, run.q, arm_of(robot_parameters, run.hand), run.goal)
            slot += 1
    correct_slots(batch.slots, slot, robot_parameters, batch.runs)


@inlined
def correct_missed(count: int, robot_parameters: Any, batch: Any) -> None:
    """Have **A** finish missed goals; ``target`` and ``ticks`` become those of its movements."""
    find_corrections(count, robot_parameters, batch)
    for i in range(count):
        batch.runs[i].acting = batch.runs[i].converged
    move_acting(count, False, robot_parameters, batch)


@inlined
def row_of(rows: Any, n: int) -> Any:
    """The row of an arm, or the only one."""
    return rows[n if len(rows) > 1 else 0]


@inlined
def reach_lot(
    first: int, count: int, arms: Any, robot_parameters: Any, reached: Any, batch: Any
) -> None:
    """Some of the arms to their goals, as many as there is room for."""
    for i in range(count):
        fill_row(batch.runs[i].q, row_of(arms.starts, first + i))
        batch.runs[i].going = True
    for g in range(arms.targets.shape[1]):
        for i in range(count):
            run = batch.runs[i]
            fill_row(run.goal, row_of(arms.goals, first + i)[g])
            run.hand, run.corrects = arms.hands[first + i, g], True
            run.hit, run.evaluations = False, 0
            reached.ticks[first + i, g] = 0
        for m in range(arms.targets.shape[2]):
            for i in range(count):
                run, target = batch.runs[i], arms.targets[first + i, g, m]
                fill_row(run.target, run.q)
                run.how = CHECK if m == 0 and robot_parameters.checks and run.going else IDLE
                if run.going and (m == 0 or not run.hit):
                    given = 0
                    for j in range(len(target)):  # a joint without a target stays where it is
                        if not math.isnan(target[j]):
                            run.target[j] = target[j]
                            given += 1
                    if given > 0:
                        stops = len(arms.stops) == 0 or arms.stops[first + i, g, m]
                        run.how = MOVE if stops else REPEAT
                        fill_row(target, run.target)
            attempt(count, robot_parameters, batch)
            for i in range(count):
                reached.moved[first + i, g, m] = batch.runs[i].ticks
                reached.ticks[first + i, g] += batch.runs[i].ticks
        correct_missed(count, robot_parameters, batch)
        for i in range(count):
            n, run = first + i, batch.runs[i]
            fill_row(reached.q[n, g], run.q)
            reached.hit[n, g] = run.going = run.hit
            reached.ticks[n, g] += run.ticks
            reached.corrections[n, g] = run.converged
            reached.iterations[n, g] = run.iterations
            reached.evaluations[n, g] = run.evaluations
            for j in range(len(reached.corrected[n, g])):
                reached.corrected[n, g, j] = run.target[j] if run.converged else math.nan


@entry
def reach_goals(arms: Any, robot_parameters: Any, reached: Any, batch: Any) -> None:
    """Every arm to its goals, in lots."""
    count, room = len(arms.targets), len(batch.runs)
    for first in range(0, count, room):
        reach_lot(first, min(room, count - first), arms, robot_parameters[0], reached, batch)


SHARE = 14 * SLOTS
"""Arms for a thread, at least: to begin one takes as long as a hundred trials."""
_IDLE: defaultdict[int, list[Batch]] = defaultdict(list)
"""Arrays for the kernel to work on that nobody uses, by :attr:`Robot.most_links`."""
ALL_STOP = np.empty((0, 0, 0), dtype=np.bool_)
"""Movements that all end on arrival, too; see :class:`Requests`."""


def blank(arms: Requests) -> Reached:
    """Empty arrays for the results of arms."""
    count, goals, moves, dof = arms.targets.shape
    shape = count, goals
    return Reached(
        q=np.empty((*shape, dof)),
        hit=np.empty(shape, np.bool_),
        ticks=np.empty(shape, np.int64),
        moved=np.empty((*shape, moves), np.int64),
        corrected=np.empty((*shape, dof)),
        corrections=np.empty(shape, np.int64),
        iterations=np.empty(shape, np.int64),
        evaluations=np.empty(shape, np.int64),
    )


def batch_for(robot: Robot) -> Batch:
    """New arrays for the kernel to work on."""
    return Batch(runs_for(SLOTS, robot), slots_for(robot))


def reach_with(robot: Robot, arms: Requests, robot_parameters: NDArray[np.void]) -> Reached:
    """Let N arms reach for G goals each, in turn, until they miss one.

    Nothing is checked. In ``arms.targets`` joints without a target are filled in, for goals that
    were attempted. Many arms are shared among threads.
    """
    count, reached, idle = len(arms.targets), blank(arms), _IDLE[robot.most_links]

    def work(part: slice) -> None:
        some, results = arms, reached
        if part.stop - part.start < count:
            some = Requests._make(each[part] if len(each) == count else each for each in arms)
            results = Reached._make(each[part] for each in reached)
        try:
            batch = idle.pop()  # no other thread gets it
        except IndexError:
            batch = batch_for(robot)
        reach_goals(some, robot_parameters, results, batch)
        idle.append(batch)

    if count >= 2 * SHARE:
        in_parts(work, count, SHARE)
    else:
        work(slice(0, count))
    return reached


def reach_unchecked(
    robot: Robot,
    q: Array,
    hands: NDArray[np.int64],
    goals: Array,
    radius: float,
    targets: Array | None = None,
    *,
    checks: bool = True,
    locked_base: tuple[str, ...] = (),
    model: MotionModel = PAPER,
) -> Reached:
    """Let N arms reach for a goal each, side by side, from where they are.

    Nothing is checked. ``q`` has shape ``(N, dof)``, length unit (base) and rad (joints); ``hands``
    ``(N,)``, indices into HANDS; ``goals`` ``(N, 2)`` and ``radius`` is that of them all, length
    unit. ``targets`` has shape ``(N, dof)``: where a joint's target is NaN, the joint keeps its
    value, and an arm whose row is NaN has none. ``checks``: whether such an arm may be in its goal
    already; else **A** begins at once. ``locked_base`` holds ``"x"`` and/or ``"y"``; **A** leaves
    these as they are. Source: paper, sections *Generating Movement for Each Goal* and *The
    Corrective Process*.
    """
    given = np.full(q.shape, np.nan) if targets is None else np.array(targets, order="C")
    robot_parameters = robot_parameters_for(
        robot, radius, locked_base=locked_base, model=model, checks=checks
    )
    arms = Requests(
        starts=np.array(q, order="C"),
        hands=np.array(hands)[:, None],
        targets=given[:, None, None],
        stops=ALL_STOP,
        goals=np.array(goals, order="C")[:, None],
    )
    return Reached._make(each[:, 0] for each in reach_with(robot, arms, robot_parameters))


class CompiledTask(NamedTuple):
    """A task as the kernel reads it (:func:`compiled_task`)."""

    task: Task
    starts: Array  # (1, dof)
    goals: Array  # (1, G, 2)
    robot_parameters: NDArray[np.void]  # (1,)
    model: MotionModel


def compiled_task(task: Task, model: MotionModel) -> CompiledTask:
    """A task for the kernel. Raises ValueError for a task or a model that no trial can be made
    with: a copy of a task with changed fields is unchecked."""
    check_model(model, radius=task.radius)
    goals = [check_goal(goal, task.radius) for goal in task.goals]
    return CompiledTask(
        task=task,
        starts=configuration(task.robot, task.q0)[None],
        goals=np.array([goals], dtype=np.float64),
        robot_parameters=robot_parameters_for(
            task.robot, task.radius, locked_base=task.locked_base, model=model
        ),
        model=model,
    )


def reach_all(
    compiled: CompiledTask,
    hands: NDArray[np.int64],
    targets: Array,
    stops: NDArray[np.bool_] = ALL_STOP,
) -> Reached:
    """Results of N trials from the start, of shape ``(N, G, ...)``.

    Nothing is checked. ``hands`` has shape ``(N, G)``, indices into HANDS. ``targets`` has shape
    ``(N, G, M, dof)``, in which joints without one are filled in; the first movement for a goal is
    made, further ones where it is still missed. ``stops``, of the shape of ``targets`` without the
    last axis: whether a movement ends on arrival, too; each does by default.
    """
    arms = Requests(compiled.starts, hands, targets, stops, compiled.goals)
    return reach_with(compiled.task.robot, arms, compiled.robot_parameters)
