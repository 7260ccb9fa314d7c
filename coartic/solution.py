"""Solutions, and the one function that executes and scores them.

A solution is a list of movements, at least one per goal. :func:`execute` makes them
from the task's start under the rules of :mod:`coartic.movement`, pays every tick,
and has the corrective process finish any goal that they miss. Whatever a method
says of its own solution, its score is what comes out here.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from coartic.corrective import correct
from coartic.errors import CoarticError
from coartic.model import PAPER, MotionModel
from coartic.movement import configuration, move
from coartic.robot import Array, Hand
from coartic.task import Task, letters_of

Kind = Literal["learned", "corrective", "planned"]
KINDS: tuple[Kind, ...] = ("learned", "corrective", "planned")


@dataclass(frozen=True)
class Movement:
    """One movement of a solution."""

    goal: int
    """Number of the goal it is made for, from 1 as in the paper."""
    hand: Hand
    kind: Kind
    """Learned and planned movements end on a hit or on arrival and are always made;
    a corrective one ends only on a hit, and is made only if the goal is not hit."""
    target: Array | None = None
    """Target configuration q^t, shape ``(dof,)``; None in a corrective movement has
    the corrective process find it when the time comes."""
    ticks: int | None = None
    """Ticks it took; None before it is executed."""


@dataclass(frozen=True)
class Execution:
    """What happened when a solution was executed."""

    movements: tuple[Movement, ...]
    """The movements as made, with targets and ticks, in order."""
    configurations: Array
    """Configuration at the moment each goal was hit, shape ``(goals hit, dof)``."""
    ticks: int
    corrections: int
    """Corrective movements made."""
    reason: str = ""
    """Why the task was not completed; empty where it was."""

    @property
    def completed(self) -> bool:
        """Whether every goal was hit."""
        return not self.reason

    @property
    def reward(self) -> int | None:
        """Total reward, -1 a tick; None where the task was not completed."""
        return -self.ticks if self.completed else None

    @property
    def hands(self) -> str:
        """Hand used for each goal, such as ``"LRLR"``."""
        by_goal = {movement.goal: movement.hand for movement in self.movements}
        return letters_of([by_goal[goal] for goal in sorted(by_goal)])

    def ticks_by_goal(self) -> tuple[int, ...]:
        """Ticks spent on each goal that was attempted."""
        spent: dict[int, int] = {}
        for movement in self.movements:
            spent[movement.goal] = spent.get(movement.goal, 0) + (movement.ticks or 0)
        return tuple(spent[goal] for goal in sorted(spent))


def execute(task: Task, solution: Iterable[Movement], *, model: MotionModel = PAPER) -> Execution:
    """Execute a solution from the task's start and score it.

    A goal that is still missed after its movements is corrected by **A** from where
    the robot stands, and the correction is paid for. Where **A** does not converge
    the execution ends there with a reason. Raises CoarticError for a solution that
    breaks the task's rules: goals missing or out of order, a hand the robot does not
    have, a target of the wrong shape or not finite, a locked base that moves.
    """
    robot = task.robot
    groups = _by_goal(task, list(solution))
    q = np.array(task.q0)
    made: list[Movement] = []
    configurations: list[Array] = []
    corrections = 0

    def outcome(reason: str = "") -> Execution:
        ticks = sum(movement.ticks or 0 for movement in made)
        reached = np.array(configurations).reshape(-1, robot.dof)
        return Execution(tuple(made), reached, ticks, corrections, reason)

    for number, planned in groups:
        hand, goal = planned[0].hand, task.goals[number - 1]
        hit = move(robot, q, q, hand, goal, task.radius, model=model).hit
        # The corrective process has the last word on every goal.
        for movement in (*planned, Movement(number, hand, "corrective")):
            corrective, target = movement.kind == "corrective", movement.target
            if corrective and hit:
                if not made or made[-1].goal != number:  # hit on the way: show the hand
                    made.append(Movement(number, hand, "corrective", np.array(q), 0))
                continue
            if target is None:
                found = correct(robot, q, hand, goal, locked_base=task.locked_base, model=model)
                if not found.converged:
                    return outcome(
                        f"goal {number}: the corrective process did not converge "
                        f"with the {hand} hand in {found.iterations} iterations"
                    )
                target = found.q
            result = move(
                robot, q, target, hand, goal, task.radius,
                stop_on_arrival=not corrective, model=model,
            )  # fmt: skip
            q, hit = result.q, result.hit
            corrections += corrective
            made.append(Movement(number, hand, movement.kind, target, result.ticks))
        if not hit:
            return outcome(f"goal {number}: the corrective movement ended outside the goal")
        configurations.append(np.array(q))
    return outcome()


def _by_goal(task: Task, solution: list[Movement]) -> list[tuple[int, list[Movement]]]:
    """The movements grouped by goal, checked against the task."""
    locked = [{"x": 0, "y": 1}[coordinate] for coordinate in task.locked_base]
    groups: list[tuple[int, list[Movement]]] = []
    for movement in solution:
        if not groups or groups[-1][0] != movement.goal:
            groups.append((movement.goal, []))
        groups[-1][1].append(movement)
        where = f"task {task.name!r}, goal {movement.goal}"
        if movement.hand not in task.hands:
            raise CoarticError(f"{where}: the robot has no {movement.hand} hand")
        if movement.hand != groups[-1][1][0].hand:
            raise CoarticError(f"{where}: two hands for one goal")
        if movement.kind not in KINDS:
            raise CoarticError(f"{where}: unknown kind {movement.kind!r}; known: {KINDS}")
        if movement.target is None:
            if movement.kind != "corrective":
                raise CoarticError(f"{where}: a {movement.kind} movement needs a target")
            continue
        try:
            target = configuration(task.robot, movement.target)
        except ValueError as error:
            raise CoarticError(f"{where}: {error}") from None
        if np.any(target[locked] != task.q0[locked]):
            raise CoarticError(f"{where}: the target moves a locked base coordinate")
    wanted = list(range(1, len(task.goals) + 1))
    if [goal for goal, _ in groups] != wanted:
        given = [goal for goal, _ in groups]
        raise CoarticError(f"task {task.name!r}: movements for goals {given}, wanted {wanted}")
    return groups
