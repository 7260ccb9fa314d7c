"""Scores: a solution executed apart from its method, as it is stored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from pydantic import Field

from coartic.errors import CoarticError, IncompleteError, SolutionError
from coartic.model import MotionModel
from coartic.motion.movement import configuration
from coartic.motion.solution import (
    Execution,
    Kind,
    Movement,
    execute_many,
    other_arm_travel,
)
from coartic.robot import Hand
from coartic.runs.stored import Amount, Count, Itself, Plain, Reward
from coartic.tasks.task import Task, hands_of

MOST_MOVEMENTS = 10_000
"""Movements of one solution."""
MOST_STEPS = 1_000_000
"""Movement steps along one solution, its targets visited in order: thousands do."""
_KNOWN = 512  # scores that are kept
Unscored = CoarticError | ValueError | TypeError | OverflowError
"""Why a solution has no score."""
_REASONS = (CoarticError, ValueError, TypeError, OverflowError)


class PlainMovement(Plain):
    """A movement as it is stored; see :class:`coartic.motion.solution.Movement`."""

    goal: Annotated[int, Field(ge=1)]
    hand: Hand
    kind: Kind
    target: tuple[float, ...] | None = None
    ticks: Count | None = None
    waypoints: tuple[tuple[float, ...], ...] | None = None

    @classmethod
    def of(cls, movement: Movement) -> PlainMovement:
        """A movement as plain data; pydantic's ValidationError for one that is none."""
        target, waypoints = movement.target, movement.waypoints
        return cls(
            goal=movement.goal,
            hand=movement.hand,
            kind=movement.kind,
            target=None if target is None else tuple(np.asarray(target, np.float64).tolist()),
            ticks=movement.ticks,
            waypoints=None
            if waypoints is None
            else tuple(tuple(np.asarray(point, np.float64).tolist()) for point in waypoints),
        )

    def text(self) -> bytes:
        """The movement as JSON, which tells any two apart."""
        return self.__pydantic_serializer__.to_json(self)

    def movement(self) -> Movement:
        """The movement itself."""
        return Movement(
            goal=self.goal,
            hand=self.hand,
            kind=self.kind,
            target=None if self.target is None else np.array(self.target),
            ticks=self.ticks,
            waypoints=None if self.waypoints is None else np.array(self.waypoints),
        )


class Solved(Plain):
    """A solution as it was executed, and its score."""

    reward: Reward
    hands: Annotated[str, Field(pattern="^[LR]+$")]
    ticks_by_goal: tuple[Count, ...]
    corrections: Count
    """Corrective movements that were needed."""
    other_arm_travel: Amount
    """Of the arm that is not chosen, rad."""
    movements: Annotated[tuple[PlainMovement, ...], Field(max_length=MOST_MOVEMENTS)]

    def brief(self) -> str:
        """The score in words."""
        return f"{self.reward} with {self.hands}, ticks {list(self.ticks_by_goal)}"


def solved(task: Task, solution: Sequence[Movement], model: MotionModel) -> Solved:
    """Execute a solution apart from its method: the only score that counts.

    Raises SolutionError where it breaks the task's rules, IncompleteError where it does not
    hit every goal, and what :func:`coartic.motion.solution.execute` raises.
    """
    (found,) = _solved(task, [solution], model)
    if isinstance(found, Exception):
        raise found
    return found


def _solved(
    task: Task, solutions: Iterable[Iterable[Movement]], model: MotionModel
) -> list[Solved | Unscored]:
    """The score of each solution, or why it has none."""

    def checked(solution: Iterable[Movement]) -> list[Movement] | Unscored:
        try:
            return _checked_length(task, list(solution), model)
        except _REASONS as error:
            return error

    def score(execution: Execution) -> Solved | Unscored:
        try:
            return _scored(task, execution)
        except _REASONS as error:
            return error

    each = [checked(solution) for solution in solutions]
    try:
        made = execute_many(task, [own for own in each if isinstance(own, list)], model=model)
    except _REASONS as error:  # of the task or the model
        return [error if isinstance(own, list) else own for own in each]
    executions = iter(made)
    found = [next(executions) if isinstance(own, list) else own for own in each]
    return [score(own) if isinstance(own, Execution) else own for own in found]


def _checked_length(task: Task, solution: list[Movement], model: MotionModel) -> list[Movement]:
    """The solution itself; SolutionError where it would take too long to execute."""
    if len(solution) > MOST_MOVEMENTS:
        raise SolutionError(f"{len(solution)} movements; at most {MOST_MOVEMENTS} are allowed")
    corners = [task.q0]
    for movement in solution:
        path = () if movement.waypoints is None else movement.waypoints
        corners += [configuration(task.robot, point) for point in path]
        if movement.target is not None:
            corners.append(configuration(task.robot, movement.target))
    steps = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()) / model.step
    if steps > MOST_STEPS:
        raise SolutionError(f"its path has {steps:.0f} steps; at most {MOST_STEPS} are allowed")
    return solution


def scored(task: Task, movements: tuple[PlainMovement, ...], model: MotionModel) -> Solved:
    """:func:`solved` of movements that are kept, once for those that agree to the last bit:
    runs that begin alike, and a folder that is read again."""
    (found,) = scored_together(task, [movements], model)
    if isinstance(found, Exception):
        raise found
    return found


def scored_together(
    task: Task, solutions: Iterable[tuple[PlainMovement, ...]], model: MotionModel
) -> list[Solved | Unscored]:
    """:func:`scored` of many solutions of a task, in their order; what it raises in place of a
    score that cannot be had.
    """
    whose = Itself(task)
    asked = [_Exact(b"".join(row.text() for row in rows), rows) for rows in solutions]
    found: dict[_Exact, Solved | Unscored] = {}
    for exact in dict.fromkeys(asked):
        if (before := _known.get((whose, exact, model))) is not None:
            found[exact] = before
    new = [exact for exact in dict.fromkeys(asked) if exact not in found]
    rows = [(row.movement() for row in exact.movements) for exact in new]
    for exact, score in zip(new, _solved(task, rows, model), strict=True):
        found[exact] = score
        if isinstance(score, Solved):
            _known[whose, exact, model] = score
        else:
            score.with_traceback(None)
    while len(_known) > _KNOWN:
        _known.pop(next(iter(_known)), None)
    return [found[exact] for exact in asked]


@dataclass(frozen=True)
class _Exact:
    """Movements, equal where their texts are: -0.0 is another figure than 0.0."""

    text: bytes
    movements: tuple[PlainMovement, ...] = field(compare=False)


_known: dict[tuple[Itself, _Exact, MotionModel], Solved] = {}


def _scored(task: Task, execution: Execution) -> Solved:
    if execution.reward is None:
        raise IncompleteError(execution.reason)
    return Solved(
        reward=execution.reward,
        hands=execution.hands,
        ticks_by_goal=execution.ticks_by_goal(),
        corrections=execution.corrections,
        other_arm_travel=other_arm_travel(
            task, hands_of(execution.hands), execution.configurations
        ),
        movements=tuple(map(PlainMovement.of, execution.movements)),
    )
