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

from coartic.errors import SolutionError
from coartic.inputs import brief_value
from coartic.model import PAPER, MotionModel, check_model
from coartic.motion.movement import check_goal, configuration, follow
from coartic.motion.outside import note_trials
from coartic.motion.reach import Reached, Requests, reach_with, setup_for
from coartic.robot import HANDS, Array, Hand
from coartic.tasks.task import Task, TaskLike, as_task, letters_of
from coartic.text import short_repr

Kind = Literal["learned", "corrective", "planned", "path"]
KINDS: tuple[Kind, ...] = ("learned", "corrective", "planned", "path")


@dataclass(frozen=True)
class Movement:
    """One movement of a solution, which :func:`execute` makes.

    Source: paper, section *Generating Movement for Each Goal*.
    """

    goal: int
    """Number of the goal it is made for, from 1 as in the paper."""
    hand: Hand
    """The hand that is to hit the goal, ``"left"`` or ``"right"``."""
    kind: Kind
    """``"learned"``, ``"planned"``, ``"corrective"`` or ``"path"``. Learned and planned movements
    are straight in joint space and end on a hit or on arrival; a path follows its waypoints and
    ends on a hit or at the last of them; a corrective movement ends only on a hit and is made
    only if the goal is not hit. The first movement for a goal, unless corrective, is always made;
    the others only while the goal is not hit."""
    target: Array | None = None
    """Target configuration q^t, shape ``(dof,)``, length unit (base) and rad (joints); the last
    waypoint of a path. None in a corrective movement has the corrective process find it when the
    time comes."""
    ticks: int | None = None
    """Control ticks it took; None before it is executed."""
    waypoints: Array | None = None
    """Configurations that a path passes through, shape ``(k, dof)``, from where the robot stands
    to ``waypoints[-1]``, length unit (base) and rad (joints); None for the other kinds."""

    def __repr__(self) -> str:
        named = ("goal", "hand", "kind", "target", "ticks", "waypoints")
        facts = {name: getattr(self, name) for name in named}
        return short_repr(self, **{k: v for k, v in facts.items() if v is not None})


@dataclass(frozen=True)
class Execution:
    """What happened when a solution was executed (:func:`execute`)."""

    movements: tuple[Movement, ...]
    """The movements as made, with targets and ticks, in order."""
    configurations: Array
    """Configuration at the moment each goal was hit, shape ``(goals hit, dof)``, length unit
    (base) and rad (joints)."""
    ticks: int
    """Control ticks spent in all."""
    corrections: int
    """Corrective movements made."""
    iterations: int = 0
    """Iterations of the corrective process, one Jacobian each."""
    evaluations: int = 0
    """Forward-kinematics evaluations made."""
    reason: str = ""
    """Why the task was not completed; empty where it was."""

    def __repr__(self) -> str:
        names = ("hands", "reward", "ticks", "corrections")
        facts = {name: getattr(self, name) for name in names}
        facts |= {"reason": self.reason} if self.reason else {}
        return short_repr(self, **facts)

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
        return hands_in(self.movements)

    def ticks_by_goal(self) -> tuple[int, ...]:
        """Control ticks spent on each goal that was attempted, in the order of the goals."""
        spent: dict[int, int] = {}
        for movement in self.movements:
            spent[movement.goal] = spent.get(movement.goal, 0) + (movement.ticks or 0)
        return tuple(spent[goal] for goal in sorted(spent))


Refused = SolutionError | ValueError | TypeError | OverflowError
"""What is wrong with a solution that cannot be executed."""


def hands_in(movements: Iterable[Movement]) -> str:
    """Hand used for each goal, such as ``"LRLR"``."""
    by_goal = {movement.goal: movement.hand for movement in movements}
    return letters_of([by_goal[goal] for goal in sorted(by_goal)])


def execute(
    task: TaskLike, solution: Iterable[Movement], *, model: MotionModel = PAPER
) -> Execution:
    """Execute a solution from the task's start and score it.

    The corrective process corrects a goal that is still missed after its movements, from where the
    robot stands, and the correction is paid for.

    Parameters
    ----------
    task : Task, str or pathlib.Path
        The task, its name or its file.
    solution : iterable of Movement
        At least one movement for each goal, in the order of the goals.
    model : MotionModel
        The constants of movement and of the corrective process.

    Returns
    -------
    Execution
        What happened: movements as made, configurations at the hits, control ticks and reward.
        Where the corrective process does not converge, the execution ends: ``completed`` is False
        and ``reason`` says so.

    Raises
    ------
    TaskError
        The task cannot be used.
    TypeError
        The task is neither a Task nor a text nor a path.
    SolutionError
        The solution breaks the task's rules: goals are missing or out of order, the robot does
        not have a hand, a target has the wrong shape or is not finite, a locked base moves.
    ValueError
        No movement can be made with the model.

    Notes
    -----
    Source: paper, section *Generating Movement for Each Goal*.
    """
    (execution,) = execute_many(as_task(task), [solution], model=model)
    if isinstance(execution, Exception):
        raise execution
    return execution


def execute_many(
    task: Task, solutions: Iterable[Iterable[Movement]], *, model: MotionModel = PAPER
) -> list[Execution | Refused]:
    """:func:`execute` solutions of one task side by side, which takes a fraction of the time.

    In their order, each as if it were alone; in place of an execution, the error that
    :func:`execute` raises for such a solution. Raises ValueError for a model that no movement
    can be made with.
    """
    check_model(model, radius=task.radius)
    runs: list[SolutionRun | Refused] = []
    for solution in solutions:
        try:
            runs.append(SolutionRun(task, solution))
        except (SolutionError, ValueError, TypeError, OverflowError) as error:
            runs.append(error)
    note_trials(len(runs))
    going = [run for run in runs if isinstance(run, SolutionRun)]
    for number in range(1, len(task.goals) + 1):
        going = [run for run in going if not run.reason]
        if going:
            try_goal(task, number, going, model)
    return [run.outcome() if isinstance(run, SolutionRun) else run for run in runs]


def other_arm_travel(task: Task, hands: Iterable[Hand], reached: Array) -> float:
    """Joint travel of the arm that is not chosen, summed over the movements to each goal.

    ``hands`` hit the goals, with the robot in the configurations ``reached``, shape ``(G, dof)``.
    In rad, from hit to hit; 0 where that arm keeps still, as in exploration conditions 1
    and 3 of the learner.
    """
    travel, before = 0.0, task.q0
    for hand, q in zip(hands, reached, strict=True):
        joints = task.robot.joints("right" if hand == "left" else "left")
        square = 0.0
        # In this order: a dot product of BLAS rounds as the processor's kernel happens to.
        for difference in (q[joints] - before[joints]).tolist():
            square += difference * difference
        travel += math.sqrt(square)
        before = q
    return travel


class SolutionRun:
    """An execution while it goes on."""

    def __init__(self, task: Task, solution: Iterable[Movement]) -> None:
        self.task = task
        # The corrective process has the last word.
        self.due = [
            [*movements, Movement(number, movements[0].hand, "corrective")]
            for number, movements in movements_by_goal(task, solution)
        ]
        self.q = configuration(task.robot, task.q0)
        self.hit = False
        self.movements: list[Movement] = []
        self.configurations: list[Array] = []
        self.corrections = self.iterations = self.evaluations = 0
        self.reason = ""

    def next(self, number: int, place: int) -> Movement | None:
        """The movement at a place among those for a goal, if it is to be made."""
        due = self.due[number - 1]
        if place >= len(due) or self.reason:
            return None
        needed = not self.hit or (place == 0 and due[0].kind != "corrective")
        return due[place] if needed else None

    def take(self, movement: Movement, q: Array, ticks: int, hit: bool) -> None:
        """Note a movement that was made, and where it ended."""
        self.q, self.hit = q, hit
        self.corrections += movement.kind == "corrective"
        target = np.array(movement.target, dtype=np.float64)
        self.movements.append(replace(movement, target=target, ticks=ticks))

    def end_goal(self, number: int) -> None:
        """Note what came of the goal."""
        if self.reason:
            return
        if not self.hit:
            self.reason = f"goal {number}: the corrective movement ended outside the goal"
            return
        if not self.movements or self.movements[-1].goal != number:  # hit on the way: show the hand
            hand = self.due[number - 1][0].hand
            self.movements.append(Movement(number, hand, "corrective", np.array(self.q), 0))
        self.configurations.append(np.array(self.q))

    def outcome(self) -> Execution:
        """What has happened so far."""
        return Execution(
            movements=tuple(self.movements),
            configurations=np.array(self.configurations).reshape(-1, len(self.q)),
            ticks=sum(movement.ticks or 0 for movement in self.movements),
            corrections=self.corrections,
            iterations=self.iterations,
            evaluations=self.evaluations,
            reason=self.reason,
        )


Due = list[tuple[SolutionRun, Movement]]
How = Literal["look", "move", "correct"]


def try_goal(task: Task, number: int, runs: list[SolutionRun], model: MotionModel) -> None:
    """Make the movements of one goal, in each run as many as are needed."""
    seen = reach_goal(task, number, [(run, run.due[number - 1][0]) for run in runs], "look", model)
    for n, run in enumerate(runs):
        run.hit = bool(seen.hit[n])
        # A movement, which this has always been counted as, also asks where its target is.
        run.evaluations += int(seen.evaluations[n]) + 1
    for place in range(max(len(run.due[number - 1]) for run in runs)):
        due = [(run, movement) for run in runs if (movement := run.next(number, place)) is not None]
        for run, movement in due:
            if movement.kind == "path":
                follow_path(task, run, movement, model)
        straight = [(run, movement) for run, movement in due if movement.kind != "path"]
        move_straight(
            task, number, [(r, m) for r, m in straight if m.target is not None], "move", model
        )
        move_straight(
            task, number, [(r, m) for r, m in straight if m.target is None], "correct", model
        )
    for run in runs:
        run.end_goal(number)


def follow_path(task: Task, run: SolutionRun, movement: Movement, model: MotionModel) -> None:
    """Make a movement along its path."""
    assert movement.waypoints is not None
    goal = task.goals[movement.goal - 1]
    result = follow(
        task.robot, run.q, movement.waypoints, movement.hand, goal, task.radius, model=model
    )
    run.evaluations += result.evaluations
    run.take(movement, result.q, result.ticks, result.hit)


def move_straight(task: Task, number: int, due: Due, how: How, model: MotionModel) -> None:
    """Make straight movements, a run each: to given targets, or to those that **A** finds."""
    if not due:
        return
    result = reach_goal(task, number, due, how, model)
    for n, (run, movement) in enumerate(due):
        iterations = int(result.iterations[n])
        run.iterations += iterations
        run.evaluations += int(result.evaluations[n])
        if how == "correct":
            if not result.corrections[n]:
                run.reason = (
                    f"goal {number}: the corrective process did not converge "
                    f"with the {movement.hand} hand in {iterations} iterations"
                )
                continue
            movement = replace(movement, target=result.corrected[n])
        run.take(movement, result.q[n], int(result.ticks[n]), bool(result.hit[n]))


def reach_goal(task: Task, number: int, due: Due, how: How, model: MotionModel) -> Reached:
    """Let each run look whether it has hit the goal, move to its target, or be corrected."""
    targets = np.full((len(due), 1, task.robot.dof), np.nan)
    if how == "move":
        targets[:, 0] = [movement.target for _, movement in due]
    ends = [movement.kind != "corrective" for _, movement in due]
    arms = Requests(
        starts=np.array([run.q for run, _ in due]),
        hands=np.array([[HANDS.index(movement.hand)] for _, movement in due]),
        targets=targets,
        stops=np.array(ends)[:, None],
        bounds=np.array([0, len(due)]),
        goals=np.array([[check_goal(task.goals[number - 1], task.radius)[:2]]]),
    )
    setup = setup_for(
        task.robot,
        float(task.radius),
        locked_base=task.locked_base,
        model=model,
        corrects=how == "correct",
        looks=how == "look",
    )
    reached = reach_with(task.robot, arms, setup)
    return Reached._make(field[:, 0] for field in reached)


def movements_by_goal(task: Task, solution: Iterable[Movement]) -> list[tuple[int, list[Movement]]]:
    """The movements grouped by goal, checked against the task."""
    if not isinstance(solution, Iterable):
        raise SolutionError(
            f"task {task.name!r}: the solution is {brief_value(solution)}; needed is a list of "
            "movements"
        )
    groups: list[tuple[int, list[Movement]]] = []
    for movement in solution:
        if not isinstance(movement, Movement):
            raise SolutionError(f"task {task.name!r}: {brief_value(movement)} is not a Movement")
        if not groups or groups[-1][0] != movement.goal:
            groups.append((movement.goal, []))
        of_goal = groups[-1][1]
        where = f"task {task.name!r}, goal {movement.goal}"
        if movement.hand not in task.hands:
            raise SolutionError(
                f"{where}: the robot has no {movement.hand} hand; it has "
                f"{' and '.join(map(repr, task.hands))}"
            )
        if of_goal and movement.hand != of_goal[0].hand:
            raise SolutionError(f"{where}: two hands for one goal")
        of_goal.append(check_movement(task, movement, where))
    wanted = list(range(1, len(task.goals) + 1))
    if [goal for goal, _ in groups] != wanted:
        given = [goal for goal, _ in groups]
        raise SolutionError(f"task {task.name!r}: movements for goals {given}, wanted {wanted}")
    return groups


def check_movement(task: Task, movement: Movement, where: str) -> Movement:
    """A movement that has what its kind needs and leads to configurations that the task allows; a
    path with its target. Raises SolutionError, which begins with ``where``."""
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
    locked = [{"x": 0, "y": 1}[coordinate] for coordinate in task.locked_base]
    for point in points:
        try:
            checked = configuration(task.robot, point)
        except ValueError as error:
            raise SolutionError(f"{where}: {error}") from None
        if np.any(checked[locked] != task.q0[locked]):
            raise SolutionError(f"{where}: the target moves a locked base coordinate")
    return movement
