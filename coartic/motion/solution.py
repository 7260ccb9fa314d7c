"""Solutions, and the one function that executes and scores them.

A solution is a list of movements, at least one per goal. :func:`execute` makes them
from the task's start under the rules of :mod:`coartic.motion.movement`, pays every tick,
and has the corrective process finish any goal that they miss. Whatever a method
says of its own solution, its score is what comes out here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from coartic.errors import LOADED, SolutionError, need
from coartic.model import PAPER, MotionModel, checked_model
from coartic.motion.corrective import correct
from coartic.motion.movement import MoveResult, configuration, follow, move
from coartic.robot import Array, Hand
from coartic.tasks.task import Task, letters_of

Kind = Literal["learned", "corrective", "planned", "path"]
KINDS: tuple[Kind, ...] = ("learned", "corrective", "planned", "path")


@dataclass(frozen=True)
class Movement:
    """One movement of a solution."""

    goal: int
    """Number of the goal it is made for, from 1 as in the paper."""
    hand: Hand
    kind: Kind
    """Learned and planned movements are straight in joint space and end on a hit or on
    arrival; a path follows its waypoints and ends on a hit or at the last of them; a
    corrective movement ends only on a hit and is made only if the goal is not hit. The
    first movement for a goal, unless corrective, is always made; the others only while
    the goal is not hit."""
    target: Array | None = None
    """Target configuration q^t, shape ``(dof,)``; the last waypoint of a path. None in a
    corrective movement has the corrective process find it when the time comes."""
    ticks: int | None = None
    """Ticks it took; None before it is executed."""
    waypoints: Array | None = None
    """Of a path: configurations to pass through, shape ``(k, dof)``, from where the
    robot stands to ``waypoints[-1]``; None for the other kinds."""


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
    iterations: int = 0
    """Iterations of the corrective process, one Jacobian each."""
    evaluations: int = 0
    """Forward-kinematics evaluations made."""
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
    the execution ends there with a reason. Raises SolutionError for a solution that
    breaks the task's rules: goals missing or out of order, a hand the robot does not
    have, a target of the wrong shape or not finite, a locked base that moves. Raises
    ValueError for a model that no movement can be made with, TypeError for what is no task.
    """
    need(task, Task, LOADED)
    run = _Run(task, checked_model(model, radius=task.radius))
    for number, movements in _by_goal(task, list(solution)):
        run.reach(number, movements)
        if run.reason:
            break
    return run.outcome()


def other_arm_travel(task: Task, hands: Iterable[Hand], reached: Array) -> float:
    """Joint travel of the arm that is not chosen, summed over the movements to each goal.

    ``hands`` hit the goals, with the robot in the configurations ``reached``, shape ``(G, dof)``.
    In rad, from hit to hit; 0 where that arm keeps still, as in exploration conditions 1
    and 3 of the learner.
    """
    travel, before = 0.0, task.q0
    for hand, q in zip(hands, reached, strict=True):
        joints = task.robot.joints("right" if hand == "left" else "left")
        difference = q[joints] - before[joints]
        travel += math.sqrt(difference.dot(difference))
        before = q
    return travel


class _Run:
    """An execution while it goes on."""

    def __init__(self, task: Task, model: MotionModel) -> None:
        self.task = task
        self.model = model
        self.q = np.array(task.q0)
        self.made: list[Movement] = []
        self.configurations: list[Array] = []
        self.corrections = self.iterations = self.evaluations = 0
        self.reason = ""

    def reach(self, number: int, movements: list[Movement]) -> None:
        """Make the movements of one goal; the corrective process has the last word."""
        hand = movements[0].hand
        here = self._move(number, self.q, hand, "planned")
        hit = here.hit
        first = True
        for movement in (*movements, Movement(number, hand, "corrective")):
            needed = not hit or (first and movement.kind != "corrective")
            first = False
            if not needed:
                continue
            if movement.kind == "path":
                result = self._follow(movement)
            else:
                target = movement.target
                if target is None:
                    target = self._correct(number, hand)
                    if target is None:
                        return
                movement = replace(movement, target=np.array(target, dtype=np.float64))
                result = self._move(number, target, hand, movement.kind)
            self.q, hit = result.q, result.hit
            self.corrections += movement.kind == "corrective"
            self.made.append(replace(movement, ticks=result.ticks))
        if not hit:
            self.reason = f"goal {number}: the corrective movement ended outside the goal"
            return
        if not self.made or self.made[-1].goal != number:  # hit on the way: show the hand
            self.made.append(Movement(number, hand, "corrective", np.array(self.q), 0))
        self.configurations.append(np.array(self.q))

    def outcome(self) -> Execution:
        """What has happened so far."""
        return Execution(
            movements=tuple(self.made),
            configurations=np.array(self.configurations).reshape(-1, self.task.robot.dof),
            ticks=sum(movement.ticks or 0 for movement in self.made),
            corrections=self.corrections,
            iterations=self.iterations,
            evaluations=self.evaluations,
            reason=self.reason,
        )

    def _move(self, number: int, target: Array, hand: Hand, kind: Kind) -> MoveResult:
        result = move(
            self.task.robot,
            self.q,
            target,
            hand,
            self.task.goals[number - 1],
            self.task.radius,
            stop_on_arrival=kind != "corrective" or self.model.corrective_arrival,
            model=self.model,
        )
        self.evaluations += result.evaluations
        return result

    def _follow(self, movement: Movement) -> MoveResult:
        assert movement.waypoints is not None
        result = follow(
            self.task.robot,
            self.q,
            movement.waypoints,
            movement.hand,
            self.task.goals[movement.goal - 1],
            self.task.radius,
            model=self.model,
        )
        self.evaluations += result.evaluations
        return result

    def _correct(self, number: int, hand: Hand) -> Array | None:
        found = correct(
            self.task.robot,
            self.q,
            hand,
            self.task.goals[number - 1],
            locked_base=self.task.locked_base,
            model=self.model,
        )
        self.iterations += found.iterations
        self.evaluations += found.iterations + 1
        if found.converged:
            return found.q
        self.reason = (
            f"goal {number}: the corrective process did not converge "
            f"with the {hand} hand in {found.iterations} iterations"
        )
        return None


def _by_goal(task: Task, solution: list[Movement]) -> list[tuple[int, list[Movement]]]:
    """The movements grouped by goal, checked against the task."""
    locked = [{"x": 0, "y": 1}[coordinate] for coordinate in task.locked_base]
    groups: list[tuple[int, list[Movement]]] = []
    for movement in solution:
        if not isinstance(movement, Movement):
            raise SolutionError(f"task {task.name!r}: {movement!r} is not a Movement")
        if not groups or groups[-1][0] != movement.goal:
            groups.append((movement.goal, []))
        where = f"task {task.name!r}, goal {movement.goal}"
        if movement.hand not in task.hands:
            raise SolutionError(f"{where}: the robot has no {movement.hand} hand")
        if groups[-1][1] and movement.hand != groups[-1][1][0].hand:
            raise SolutionError(f"{where}: two hands for one goal")
        if movement.kind not in KINDS:
            raise SolutionError(f"{where}: unknown kind {movement.kind!r}; known: {KINDS}")
        points: list[Array] = []
        if movement.kind == "path":
            points = [] if movement.waypoints is None else list(movement.waypoints)
            if not points:
                raise SolutionError(f"{where}: a path needs waypoints")
            end = np.array(points[-1], dtype=np.float64)
            if movement.target is not None and not np.array_equal(movement.target, end):
                raise SolutionError(f"{where}: a path's target is its last waypoint")
            movement = replace(movement, target=end, waypoints=np.array(points, dtype=np.float64))
        elif movement.waypoints is not None:
            raise SolutionError(f"{where}: a {movement.kind} movement has no waypoints")
        elif movement.target is not None:
            points = [movement.target]
        elif movement.kind != "corrective":
            raise SolutionError(f"{where}: a {movement.kind} movement needs a target")
        for point in points:
            try:
                checked = configuration(task.robot, point)
            except ValueError as error:
                raise SolutionError(f"{where}: {error}") from None
            if np.any(checked[locked] != task.q0[locked]):
                raise SolutionError(f"{where}: the target moves a locked base coordinate")
        groups[-1][1].append(movement)
    wanted = list(range(1, len(task.goals) + 1))
    if [goal for goal, _ in groups] != wanted:
        given = [goal for goal, _ in groups]
        raise SolutionError(f"task {task.name!r}: movements for goals {given}, wanted {wanted}")
    return groups
