"""Solutions, and the one function that executes and scores them.

A solution is a list of movements, at least one per goal. :func:`execute` makes them
from the task's start under the rules of :mod:`coartic.motion.movement`, pays every tick,
and has the corrective process finish any goal that they miss. Whatever a method
says of its own solution, its score is what comes out here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Literal, NamedTuple

import numpy as np

from coartic.errors import SolutionError
from coartic.inputs import brief_value
from coartic.model import PAPER, MotionModel
from coartic.motion.movement import LARGEST_ENTRY, configuration, follow
from coartic.motion.outside import note_trials
from coartic.motion.reach import Bench, Reached, bench_of, reach_all
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
    (execution,) = execute_many(bench_of(as_task(task), model), [solution])
    if isinstance(execution, Exception):
        raise execution
    return execution


def execute_many(
    bench: Bench, solutions: Iterable[Iterable[Movement]]
) -> list[Execution | Refused]:
    """:func:`execute` solutions of one task side by side, which takes a fraction of the time.

    In their order, each as if it were alone; in place of an execution, the error that
    :func:`execute` raises for such a solution.
    """
    plans: list[Plan | Refused] = []
    for solution in solutions:
        try:
            plans.append(movements_by_goal(bench.task, solution))
        except (SolutionError, ValueError, TypeError, OverflowError) as error:
            plans.append(error)
    note_trials(len(plans))
    straight = [plan for plan in plans if isinstance(plan, list) and not has_path(plan)]
    asked = [[slots_for(movements) for movements in plan] for plan in straight]
    made = make_straight(bench, straight, asked)
    executions = (execution_of(*each) for each in zip(straight, made, strict=True))
    found: list[Execution | Refused] = []
    for plan in plans:
        if not isinstance(plan, list):
            found.append(plan)
        else:
            found.append(execute_paths(bench, plan) if has_path(plan) else next(executions))
    return found


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


Plan = list[list[Movement]]
"""The movements of a solution, goal by goal."""
Slots = list[Movement | None]
"""Movements to targets for a goal as the kernel takes them: None first where none is made at once,
but the hand may be in the goal already."""


class Subtask(NamedTuple):
    """What came of a goal."""

    made: list[Movement]
    q: Array
    hit: bool
    iterations: int
    evaluations: int
    """Without a look before the first movement, which :func:`execution_of` counts."""


def has_path(plan: Plan) -> bool:
    """Whether a movement follows a path."""
    return any(movement.kind == "path" for movements in plan for movement in movements)


def slots_for(movements: list[Movement]) -> Slots:
    """Straight movements of a goal as the kernel takes them, up to the first that **A** finds."""
    given = takewhile(lambda movement: movement.target is not None, movements)
    made_at_once = bool(movements) and movements[0].kind != "corrective"
    return [*given] if made_at_once else [None, *given]


def make_straight(bench: Bench, plans: list[Plan], asked: list[list[Slots]]) -> list[list[Subtask]]:
    """Make the straight movements of solutions side by side: what came of each goal attempted."""
    if not plans:
        return []
    hands = np.array([[HANDS.index(movements[0].hand) for movements in plan] for plan in plans])
    most = max(len(slots) for of_plan in asked for slots in of_plan)
    targets = np.full((*hands.shape, most, bench.starts.shape[1]), np.nan)
    stops = np.ones(targets.shape[:3], dtype=np.bool_)
    for n, of_plan in enumerate(asked):
        for g, slots in enumerate(of_plan):
            for m, movement in enumerate(slots):
                if movement is not None:
                    targets[n, g, m] = movement.target
                    stops[n, g, m] = movement.kind != "corrective"
    reached, looks = reach_all(bench, hands, targets, stops), bool(bench.setup["looks"][0])
    return [
        subtasks_of(plan, asked[n], targets[n], Reached._make(f[n] for f in reached), looks)
        for n, plan in enumerate(plans)
    ]


def execute_paths(bench: Bench, plan: Plan) -> Execution:
    """Execute a solution in which movements follow paths: one movement after the other."""
    task, model, subtasks, q = bench.task, bench.model, list[Subtask](), bench.starts[0]
    for g, movements in enumerate(plan):
        done = Subtask([], q, False, 0, 0)
        for m, movement in enumerate(
            [*movements, Movement(g + 1, movements[0].hand, "corrective")]
        ):
            if movement.waypoints is not None:
                where = movement.waypoints, movement.hand, task.goals[g], task.radius
                moved = follow(task.robot, done.q, *where, model=model)
                made = [replace(movement, ticks=moved.ticks)]
                part = Subtask(made, moved.q, moved.hit, 0, moved.evaluations)
            else:
                setup = bench.setup.copy()
                setup["looks"], setup["corrects"] = m == 0, movement.target is None
                goal = bench.goals[:, g : g + 1]
                here = bench._replace(starts=done.q[None], goals=goal, setup=setup)
                ((part,),) = make_straight(here, [[movements]], [[slots_for([movement])]])
            iterations = done.iterations + part.iterations
            evaluations = done.evaluations + part.evaluations
            done = Subtask(done.made + part.made, part.q, part.hit, iterations, evaluations)
            if done.hit or movement.target is None:
                break
        subtasks.append(done)
        q = done.q
        if not done.hit:
            break
    return execution_of(plan, subtasks)


def subtasks_of(
    plan: Plan, asked: list[Slots], targets: Array, reached: Reached, looks: bool
) -> list[Subtask]:
    """What came of the goals of one trial that were attempted, by straight movements alone."""
    hit, ticks, corrections, iterations, evaluations, moved = (
        each.tolist()
        for each in (
            reached.hit, reached.ticks, reached.corrections, reached.iterations,
            reached.evaluations, reached.moved,
        )
    )  # fmt: skip
    subtasks = []
    for g, (movements, slots) in enumerate(zip(plan, asked, strict=True)):
        made = [
            Movement(movement.goal, movement.hand, movement.kind, target, spent)
            for movement, target, spent in zip(slots, targets[g], moved[g], strict=False)
            if movement is not None and spent
        ]
        if corrections[g]:
            first, target, spent = movements[0], reached.corrected[g], ticks[g] - sum(moved[g])
            made.append(Movement(first.goal, first.hand, "corrective", target, spent))
        evaluated = evaluations[g] - (looks and slots[0] is None)
        subtasks.append(Subtask(made, reached.q[g], hit[g], iterations[g], evaluated))
        if not hit[g]:
            break
    return subtasks


def execution_of(plan: Plan, subtasks: list[Subtask]) -> Execution:
    """An execution of the goals that were attempted."""
    made: list[Movement] = []
    for movements, subtask in zip(plan, subtasks, strict=False):
        goal, hand = movements[0].goal, movements[0].hand
        if subtask.hit and not subtask.made:  # hit on the way: show the hand
            made.append(Movement(goal, hand, "corrective", subtask.q.copy(), 0))
        made += subtask.made
    hits = [subtask.q for subtask in subtasks if subtask.hit]
    reason = ""
    if len(hits) < len(subtasks):
        reason = (
            f"goal {goal}: the corrective process did not converge with the {hand} hand in "
            f"{subtasks[-1].iterations} iterations"
        )
    return Execution(
        movements=tuple(made),
        configurations=np.array(hits).reshape(-1, len(subtasks[0].q)),
        ticks=sum(movement.ticks or 0 for movement in made),
        corrections=sum(movement.kind == "corrective" and movement.ticks != 0 for movement in made),
        iterations=sum(subtask.iterations for subtask in subtasks),
        # And for each goal a look before the first movement, and one at where that leads.
        evaluations=sum(subtask.evaluations + 2 for subtask in subtasks),
        reason=reason,
    )


def movements_by_goal(task: Task, solution: Iterable[Movement]) -> Plan:
    """The movements grouped by goal, checked against the task."""
    if not isinstance(solution, Iterable):
        raise SolutionError(
            f"task {task.name!r}: the solution is {brief_value(solution)}; needed is a list of "
            "movements"
        )
    plan: Plan = []
    for movement in solution:
        if not isinstance(movement, Movement):
            raise SolutionError(f"task {task.name!r}: {brief_value(movement)} is not a Movement")
        if not plan or plan[-1][0].goal != movement.goal:
            plan.append([])
        of_goal = plan[-1]
        where = f"task {task.name!r}, goal {movement.goal}"
        if movement.hand not in task.hands:
            raise SolutionError(
                f"{where}: the robot has no {movement.hand} hand; it has "
                f"{' and '.join(map(repr, task.hands))}"
            )
        if of_goal and movement.hand != of_goal[0].hand:
            raise SolutionError(f"{where}: two hands for one goal")
        of_goal.append(check_movement(movement, where))
    check_points(task, plan)
    given, wanted = [each[0].goal for each in plan], list(range(1, len(task.goals) + 1))
    if given != wanted:
        raise SolutionError(f"task {task.name!r}: movements for goals {given}, wanted {wanted}")
    return plan


def check_movement(movement: Movement, where: str) -> Movement:
    """A movement that has what its kind needs; a path with its target. Raises SolutionError, which
    begins with ``where``."""
    if movement.kind not in KINDS:
        raise SolutionError(f"{where}: unknown kind {movement.kind!r}; known: {KINDS}")
    if movement.kind == "path":
        if movement.waypoints is None or len(movement.waypoints) == 0:
            raise SolutionError(f"{where}: a path needs waypoints")
        way = np.array(movement.waypoints, dtype=np.float64)
        if movement.target is not None and not np.array_equal(movement.target, way[-1]):
            raise SolutionError(f"{where}: a path's target is its last waypoint")
        return replace(movement, target=way[-1], waypoints=way)
    if movement.waypoints is not None:
        raise SolutionError(f"{where}: a {movement.kind} movement has no waypoints")
    if movement.target is None and movement.kind != "corrective":
        raise SolutionError(f"{where}: a {movement.kind} movement needs a target")
    return movement


def check_points(task: Task, plan: Plan) -> None:
    """Raises SolutionError for a target or waypoint that is no configuration of the robot, or that
    moves a locked base coordinate."""
    points: list[Array] = []
    goals: list[int] = []
    for movements in plan:
        for movement in movements:
            way = [] if movement.target is None else [movement.target]
            points += way if movement.waypoints is None else list(movement.waypoints)
            goals += [movement.goal] * (len(points) - len(goals))
    locked = [{"x": 0, "y": 1}[coordinate] for coordinate in task.locked_base]
    with suppress(ValueError):  # of rows of different lengths
        array = np.array(points)
        if array.dtype == np.float64 and array.shape == (len(points), task.robot.dof):
            within = (np.abs(array) <= LARGEST_ENTRY).all()
            if within and all((array[:, k] == task.q0[k]).all() for k in locked):
                return
    for goal, point in zip(goals, points, strict=True):
        where = f"task {task.name!r}, goal {goal}"
        try:
            checked = configuration(task.robot, point)
        except ValueError as error:
            raise SolutionError(f"{where}: {error}") from None
        if np.any(checked[locked] != task.q0[locked]):
            raise SolutionError(f"{where}: the target moves a locked base coordinate")
