"""Scores: a solution executed apart from its method, as it is stored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from pydantic import Field

from coartic.errors import CoarticError, IncompleteError, SolutionError
from coartic.model import MotionModel
from coartic.motion.executions import Made, Straight, execute_straight
from coartic.motion.movement import configuration
from coartic.motion.solution import Execution, Kind, Movement, execute, other_arm_travel
from coartic.robot import Hand
from coartic.runs.stored import Amount, Count, Itself, Plain, Reward
from coartic.tasks.task import Task, hands_of, letters_of

MOST_MOVEMENTS = 10_000
"""Movements of one solution."""
MOST_STEPS = 1_000_000
"""Movement steps along one solution, its targets visited in order: thousands do."""
MANY = 32
"""Solutions from which on they are executed side by side: for fewer its kernel is not compiled."""
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
    execution = execute(task, solution, model=model)
    if not execution.completed:
        raise IncompleteError(execution.reason)
    return _scored(task, execution)


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

    Many are executed side by side (:mod:`coartic.motion.executions`), which gives the same.
    """
    whose = Itself(task)
    asked = [_Exact(b"".join(row.text() for row in rows), rows) for rows in solutions]
    found: dict[_Exact, Solved | Unscored] = {}
    for exact in dict.fromkeys(asked):
        if (before := _known.get((whose, exact, model))) is not None:
            found[exact] = before
    new = [exact for exact in dict.fromkeys(asked) if exact not in found]
    if len(new) >= MANY:
        found |= _side_by_side(task, new, model)
    for exact in new:
        if exact not in found:
            try:
                rows = [row.movement() for row in exact.movements]
                found[exact] = solved(task, rows, model)
            except _REASONS as error:
                found[exact] = error.with_traceback(None)
        if isinstance(score := found[exact], Solved):
            _known[whose, exact, model] = score
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
    assert execution.reward is not None
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


def _side_by_side(task: Task, asked: Sequence[_Exact], model: MotionModel) -> dict[_Exact, Solved]:
    """The scores of those that can be executed so."""
    straight = {
        number: Straight(*zip(*rows, strict=True))
        for number, exact in enumerate(asked)
        if 0 < len(exact.movements) <= MOST_MOVEMENTS
        and (rows := _straight(exact.movements)) is not None
    }
    made = execute_straight(task, straight, model, most_steps=MOST_STEPS)
    return {asked[number]: _solved(task, asked[number], own) for number, own in made.items()}


def _straight(
    movements: tuple[PlainMovement, ...],
) -> list[tuple[int, Hand, Kind, tuple[float, ...]]] | None:
    """Goal, hand, kind and target of each; None where one is a path or lacks its target."""
    rows: list[tuple[int, Hand, Kind, tuple[float, ...]]] = []
    for row in movements:
        if row.target is None or row.waypoints is not None or row.kind == "path":
            return None
        rows.append((row.goal, row.hand, row.kind, row.target))
    return rows


def _solved(task: Task, exact: _Exact, made: Made) -> Solved:
    rows, ticks = [], [0] * len(task.goals)
    for row, spent in zip(exact.movements, made.ticks, strict=True):
        if spent is not None:
            ticks[row.goal - 1] += spent
            rows.append(row if row.ticks == spent else row.model_copy(update={"ticks": spent}))
    hands = {row.goal: row.hand for row in rows}
    return Solved(
        reward=-sum(ticks),
        hands=letters_of(list(hands.values())),
        ticks_by_goal=tuple(ticks),
        corrections=sum(row.kind == "corrective" for row in rows),
        other_arm_travel=other_arm_travel(task, hands.values(), made.reached),
        movements=tuple(rows),
    )
