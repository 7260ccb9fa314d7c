"""Solutions of tasks: lists of movements, with at least one movement for each goal.

:func:`coartic.execute` executes and scores a solution.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from coartic.errors import SolutionError
from coartic.internal.limits import brief_value, real_array
from coartic.internal.validation import equal_contents
from coartic.motion.doors import configuration
from coartic.robot import MAX_ENTRY, Array, Configs, Hand
from coartic.tasks.task import Task, hands_of, letters_of

Kind = Literal["learned", "corrective", "planned", "path"]
KINDS: tuple[Kind, ...] = get_args(Kind)
HELD = 1e-6
"""Largest allowed difference between a locked base coordinate of a target and its value at the
start (in length units). Results of solvers differ by less."""


@dataclass(frozen=True, eq=False)
class Movement:
    """A movement of a solution (:func:`coartic.execute`).

    The arrays of a movement are read-only copies of the arrays that are passed.

    Source: paper, section *Generating Movement for Each Goal*.
    """

    goal: int
    """Number of the goal for which the movement is made. Goals count from 1, as in the paper."""
    hand: Hand
    """The hand that is to hit the goal, ``"left"`` or ``"right"``."""
    kind: Kind
    """Kind of the movement:

    - ``"learned"`` and ``"planned"`` movements are straight in joint space and end on a hit or on
      arrival;
    - a ``"path"`` follows its waypoints and ends on a hit or at the last waypoint;
    - a ``"corrective"`` movement is straight and ends on a hit or at its target.

    The first movement for a goal is always made, unless it is corrective. All other movements are
    made only while the goal is not hit.
    """
    target: Array | None = None
    """Target configuration q^t, shape ``(dof,)``, in length units and rad. A coordinate whose entry
    is NaN does not move. The target of a path is its last waypoint, without NaN, or None. If a
    corrective movement has None, the corrective process finds the target during execution."""
    ticks: int | None = None
    """Control ticks of the movement; None before the movement is executed."""
    waypoints: Array | None = None
    """Configurations through which a path passes, in order, shape ``(k, dof)``, in length units and
    rad; None for a movement of another kind."""
    __eq__ = equal_contents

    def __post_init__(self) -> None:
        for name, value in (("target", self.target), ("waypoints", self.waypoints)):
            if value is not None:  # a planner may change its own array later
                copy = np.array(real_array(name, value))
                copy.flags.writeable = False
                object.__setattr__(self, name, copy)


def hands_in(movements: Iterable[Movement]) -> str:
    """Return the hand sequence of the goals that have movements, such as ``"LRLR"``."""
    by_goal = {movement.goal: movement.hand for movement in movements}
    return letters_of([by_goal[goal] for goal in sorted(by_goal)])


def goals_without_target(movements: Iterable[Movement]) -> tuple[int, ...]:
    """Return the numbers of the goals, from 1, that have only corrective movements."""
    goals, aimed = set[int](), set[int]()
    for movement in movements:
        (goals if movement.kind == "corrective" else aimed).add(movement.goal)
    return tuple(sorted(goals - aimed))


def next_action(movements: Iterable[Movement]) -> tuple[Movement, ...]:
    """Return copies of movements that can be executed again with other noise.

    In the copies all ticks, and the targets of corrective movements, are None, because these
    results depend on the noise of the execution in which the movements were made.
    """
    return tuple(
        replace(movement, ticks=None, target=None)
        if movement.kind == "corrective"
        else replace(movement, ticks=None)
        for movement in movements
    )


Plan = list[list[Movement]]
"""Movements of a solution: a list of movements for each goal, in the order of the goals. (The plan
of a suite is something else.)"""


def movements_by_goal(task: Task, solution: Iterable[Movement]) -> Plan:
    """Check a solution, and return a list of its movements for each goal.

    In the result, the target of a movement of kind ``path`` is its last waypoint. Locked base
    coordinates of targets and waypoints are set to those of the task's start configuration; NaN is
    kept.

    Parameters
    ----------
    task : Task
    solution : iterable of Movement

    Returns
    -------
    list of list of Movement
        The movements for each goal, in the order of the goals.

    Raises
    ------
    SolutionError
        The solution breaks a rule of the task.
    """
    if not isinstance(solution, Iterable):
        raise SolutionError(
            f"task {task.name!r}: the solution is {brief_value(solution)}; it must be a list of "
            "movements"
        )
    plan: Plan = []
    for movement in solution:
        if not isinstance(movement, Movement):
            raise SolutionError(
                f"task {task.name!r}: {brief_value(movement)} is not a Movement; make a solution "
                "of arrays by movements_of(hands, targets)"
            )
        if not isinstance(movement.goal, (int, np.integer)):
            raise SolutionError(
                f"task {task.name!r}: goal of a movement is {brief_value(movement.goal)}; it must "
                "be an integer"
            )
        if not plan or plan[-1][0].goal != movement.goal:
            plan.append([])
        of_goal = plan[-1]
        try:
            of_goal.append(_check_movement(task, movement))
            if movement.hand != of_goal[0].hand:
                raise SolutionError(
                    f"the movements have the hands {of_goal[0].hand} and {movement.hand}; all "
                    "movements to one goal must have the same hand"
                )
        except (SolutionError, ValueError) as error:
            raise SolutionError(f"task {task.name!r}, goal {movement.goal}: {error}") from None
    numbers, expected = [movements[0].goal for movements in plan], [*range(1, len(task.goals) + 1)]
    if numbers != expected:
        raise SolutionError(
            f"task {task.name!r}: the solution has movements for goals {numbers}; it must have "
            f"movements for goals {expected}, in this order"
        )
    return plan


def _check_movement(task: Task, movement: Movement) -> Movement:
    """Check the hand, the kind, the target and the waypoints of a movement.

    Return the movement itself, or a copy with changed arrays (:func:`movements_by_goal`). Raises
    SolutionError or ValueError if something does not fit the task.
    """
    kind, target, waypoints = movement.kind, movement.target, movement.waypoints
    if not isinstance(movement.hand, str) or movement.hand not in task.hands:
        hands = " and ".join(map(repr, task.hands))
        hand = brief_value(movement.hand).strip("'")
        raise SolutionError(f"task {task.name!r} has no {hand} hand; it has {hands}")
    if not isinstance(kind, str) or kind not in KINDS:
        kinds = ", ".join(map(repr, KINDS))
        raise SolutionError(f"kind of a movement is {brief_value(kind)}; it must be one of {kinds}")
    if kind == "path":
        if waypoints is None or not isinstance(waypoints, Iterable) or len([*waypoints]) == 0:
            raise SolutionError(
                f"waypoints of a path are {brief_value(waypoints)}; they must be a list of "
                "configurations, at least one"
            )
        path = np.array([_check_point(task, point) for point in waypoints], dtype=np.float64)
        if target is not None and not np.array_equal(target, waypoints[-1]):
            raise SolutionError(
                f"target of a path is {brief_value(target)}; it must be None or the last waypoint"
            )
        return replace(movement, target=path[-1], waypoints=path)
    if waypoints is not None:
        raise SolutionError(
            f"waypoints of a {kind} movement must be None; only a movement of kind 'path' has them"
        )
    if target is not None:
        point = _check_point(task, target, kind)
        return movement if point is target else replace(movement, target=point)
    if kind != "corrective":
        raise SolutionError(f"target of a {kind} movement is None; it must be a configuration")
    return movement


def _check_point(task: Task, point: Any, kind: Kind = "path") -> Array:
    """Check a target or a waypoint, and return it as an array, shape ``(dof,)``.

    In the result, locked base coordinates are those of the task's start configuration. The result
    is usually the array that was passed, and a new array if something has to be changed. Raises
    ValueError

    - if ``point`` is not a configuration of the robot; entries of a target may be NaN, but not
      those of a waypoint;
    - if all entries are NaN;
    - if ``point`` moves a locked base coordinate by more than 1e-6.
    """
    usual = type(point) is np.ndarray and point.dtype == np.float64
    # The length is quick to compute; with a NaN entry it is not below any limit.
    if not usual or point.shape != task.q0.shape or not math.hypot(*point.tolist()) < MAX_ENTRY:
        numbers = real_array("configuration", point)
        stays = np.isnan(numbers) if kind != "path" else np.zeros(numbers.shape, np.bool_)
        if stays.all() and numbers.size:
            raise ValueError(
                f"the target of a {kind} movement is NaN in all entries, so that nothing would "
                "move; for a goal at which only the corrective process acts, pass a corrective "
                "movement without a target"
            )
        given = configuration(task.robot, np.where(stays, 0.0, numbers))
        point = np.where(stays, np.nan, given)
    array: Array = point
    for k in map("xy".index, task.locked_base):
        if array[k] != task.q0[k]:
            return _hold_base(task, array.copy())
    return array


def _hold_base(task: Task, points: Array) -> Array:
    """Set locked base coordinates of configurations to those of the task's start, in place.

    ``points`` has shape ``(..., dof)`` and is returned; entries that are NaN do not change. Raises
    ValueError if a coordinate differs from the start by more than 1e-6 length units (:data:`HELD`).
    """
    for coordinate in task.locked_base:
        k = "xy".index(coordinate)
        moved = np.abs(points[..., k] - task.q0[k])
        if (moved > HELD).any():
            raise ValueError(
                f"a target moves the base in {coordinate}, which is locked, by "
                f"{np.nanmax(moved):.2g}: entry {k} must be {task.q0[k]:g}, as at the start"
            )
        points[..., k][moved > 0] = task.q0[k]
    return points


def check_targets(task: Task, targets: Any) -> Configs:
    """Check the targets of N trials, and return a copy of them.

    ``targets`` and the copy have shape ``(N, G, dof)``, in length units and rad; NaN is allowed. In
    the copy, locked base coordinates are set to those of the task's start configuration. Raises
    ValueError for another shape, for infinite entries, and for targets that move a locked base by
    more than 1e-6 length units.
    """
    copy = np.array(real_array("targets", targets))
    if copy.ndim != 3 or copy.shape[1:] != (len(task.goals), task.robot.dof):
        raise ValueError(
            f"targets has shape {copy.shape}; it must be (N, {len(task.goals)}, {task.robot.dof})"
        )
    if np.isinf(copy).any():
        raise ValueError("targets has infinite entries; each entry must be finite or NaN")
    return _hold_base(task, copy)


# ---- Solutions from hands and targets, and initial ones ----


def movements_of(hands: str, targets: ArrayLike) -> tuple[Movement, ...]:
    """Make a solution from hands and target configurations.

    Parameters
    ----------
    hands : str
        The hand for each goal, such as ``"RRLR"``.
    targets : array_like, shape (G, dof)
        Target configuration for each goal, in length units (base) and rad (joints). A coordinate
        whose entry is NaN does not move. At a goal whose entries are all NaN, only the corrective
        process acts.

    Returns
    -------
    tuple of Movement
        A movement for each goal. Its kind is ``corrective`` if all entries of the goal are NaN, and
        ``learned`` otherwise. :func:`coartic.execute` and :func:`coartic.trajectory` accept the
        tuple as a solution.

    Raises
    ------
    ValueError
        The hands are not letters L and R, ``targets`` is not an array of real numbers with two
        axes, or the number of its rows is not the number of hands.

    Examples
    --------
    >>> [movement.kind for movement in movements_of("RL", [[0.1] * 10, [np.nan] * 10])]
    ['learned', 'corrective']
    """
    chosen, targets = hands_of(hands), real_array("targets", targets)
    if targets.ndim != 2 or len(targets) != len(chosen):
        raise ValueError(
            f"targets has shape {targets.shape}; it must have a row for each of the "
            f"{len(chosen)} hands in {brief_value(hands)}"
        )
    return tuple(
        Movement(number, hand, "corrective")
        if np.isnan(target).all()
        else Movement(number, hand, "learned", target)
        for number, (hand, target) in enumerate(zip(chosen, targets, strict=True), 1)
    )


def corrective_movements(hands: str) -> list[Movement]:
    """Return, for each goal, a corrective movement that has no target.

    ``hands`` is a hand sequence such as ``"RRLR"``. Raises ValueError for other letters than L and
    R.
    """
    return [Movement(number, hand, "corrective") for number, hand in enumerate(hands_of(hands), 1)]
