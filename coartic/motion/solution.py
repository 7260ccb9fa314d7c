"""Solutions: movements, and the one function that executes and scores them.

A solution is a list of movements, at least one per goal. :func:`execute` makes them from the task's
start by the rule of :mod:`coartic.motion.trial`, pays every tick, and has the corrective process
finish any goal that they miss. Whatever a method says of its own solution, its score is the reward
of this execution.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coartic.errors import NotApplicableError, SolutionError
from coartic.internal.limits import brief_value, real_array
from coartic.internal.validation import equal_contents
from coartic.model import PAPER, MotionModel, check_model
from coartic.motion.batch import width_of
from coartic.motion.movement import LARGEST_ENTRY, configuration, correct, follow, move
from coartic.motion.trial import (
    CompiledTask,
    account_type,
    compiled_task,
    count_trials,
    hands_among,
    make_trials,
    reason_of_failure,
    search_initial_hands,
    sequences_with,
)
from coartic.robot import HANDS, Array, Configs, Hand
from coartic.tasks.catalogue import TaskLike, as_task
from coartic.tasks.task import Task, check_hands, hands_of, letters_of

Kind = Literal["learned", "corrective", "planned", "path"]
KINDS: tuple[Kind, ...] = get_args(Kind)
HELD = 1e-6
"""Largest distance of a locked base coordinate of a target from its value at the start, length
unit; solvers leave less."""


@dataclass(frozen=True, eq=False)
class Movement:
    """Movement of a solution (:func:`execute`).

    Source: paper, section *Generating Movement for Each Goal*.
    """

    goal: int
    """Number of the goal that the movement is made for, from 1 as in the paper."""
    hand: Hand
    """The hand that is to hit the goal, ``"left"`` or ``"right"``."""
    kind: Kind
    """``"learned"``, ``"planned"``, ``"corrective"`` or ``"path"``. Learned and planned movements
    are straight in joint space and end on a hit or on arrival; a path follows its waypoints and
    ends on a hit or at the last waypoint; a corrective movement is straight and ends on a hit or at
    its target. The first movement for a goal, unless corrective, is always made; all others are
    made only while the goal is not hit."""
    target: Array | None = None
    """Target configuration q^t, shape ``(dof,)``, length unit and rad; the last waypoint of a path.
    None in a corrective movement has the corrective process find it when the time comes."""
    ticks: int | None = None
    """Control ticks of the movement; None before it is executed."""
    waypoints: Array | None = None
    """Configurations that a path passes through in turn from where the robot stands, shape ``(k,
    dof)``, length unit and rad; None for the other kinds."""
    __eq__ = equal_contents

    def __post_init__(self) -> None:
        for name, given in (("target", self.target), ("waypoints", self.waypoints)):
            if given is not None:
                real_array(name, given)


@dataclass(frozen=True, eq=False)
class Execution:
    """An executed solution (:func:`execute`)."""

    movements: tuple[Movement, ...]
    """The movements as made, with targets and ticks, in order."""
    configurations: Array
    """Configuration at the moment each goal was hit, shape ``(goals hit, dof)``, length unit and
    rad."""
    ticks: int
    """Control ticks spent in all."""
    corrections: int
    """Corrective movements made, of a tick or more."""
    iterations: int = 0
    """Iterations of the corrective process, one Jacobian each."""
    evaluations: int = 0
    """Forward-kinematics evaluations, of a correction its iterations + 1; a further evaluation for
    each goal tried, or two unless its first movement is corrective."""
    reason: str = ""
    """Sentence on why the task was not completed; empty if it was."""
    __eq__ = equal_contents

    @property
    def completed(self) -> bool:
        """True if every goal was hit."""
        return not self.reason

    @property
    def reward(self) -> int | None:
        """Total reward, minus the number of ticks; None if the task was not completed."""
        return -self.ticks if self.completed else None

    @property
    def hands(self) -> str:
        """Hand of each goal that has a movement, in the order of goals, such as ``"LRLR"``."""
        return hands_in(self.movements)

    def ticks_by_goal(self) -> tuple[int, ...]:
        """Return the control ticks spent on each goal that has a movement, in goal order."""
        spent = Counter[int]()
        for movement in self.movements:
            spent[movement.goal] += movement.ticks or 0
        return tuple(spent[goal] for goal in sorted(spent))


Refused = SolutionError | ValueError | TypeError | OverflowError
"""Errors of a solution that cannot be executed."""


def hands_in(movements: Iterable[Movement]) -> str:
    """Return the hand of each goal that has a movement, in goal order, such as ``"LRLR"``."""
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
    solution : iterable of Movement
        At least one movement for each goal, in the order of the goals.
    model : MotionModel

    Returns
    -------
    Execution
        Movements as made, configurations at the hits, control ticks and reward. Where the
        corrective process does not converge, the execution ends: ``completed`` is False and
        ``reason`` says so, and why that may be.

    Raises
    ------
    TaskError, TypeError
        The task cannot be used, or ``task`` or ``model`` has another type.
    SolutionError
        The solution breaks the task's rules: goals are missing or out of order, a hand is not the
        task's, a target has the wrong shape or is not finite, a locked base moves by more
        than 1e-6.
    ValueError
        A constant of the model is out of bounds.

    Notes
    -----
    Source: paper, section *Generating Movement for Each Goal*.
    """
    (execution,) = execute_many(compiled_task(as_task(task), model), [solution])
    if isinstance(execution, Exception):
        raise execution
    return execution


def goals_without_target(movements: Iterable[Movement]) -> tuple[int, ...]:
    """Return the numbers, from 1 and in order, of the goals that have corrective movements only."""
    kinds = {(movement.goal, movement.kind == "corrective") for movement in movements}
    return tuple(sorted(goal for goal, alone in kinds if alone and (goal, False) not in kinds))


def execute_many(
    compiled: CompiledTask, solutions: Iterable[Iterable[Movement]]
) -> list[Execution | Refused]:
    """Execute and score solutions of one task: solutions without paths side by side, solutions with
    a path one by one. Return a list with, for each solution in order, its execution, or, in its
    place, the error that :func:`execute` would raise for the solution."""
    executions: list[Execution | Plan | Refused] = []
    for solution in solutions:
        try:
            plan = movements_by_goal(compiled.task, solution)
        except (SolutionError, ValueError, TypeError, OverflowError) as error:
            executions.append(error)
        else:
            kinds = {movement.kind for movements in plan for movement in movements}
            executions.append(_make_one_by_one(compiled, plan) if "path" in kinds else plan)
    plans = [each for each in executions if isinstance(each, list)]
    straight = iter(_make_straight(compiled, plans))
    return [next(straight) if isinstance(x, list) else x for x in executions]


Plan = list[list[Movement]]
"""The movements of a solution, goal by goal; the plan of a suite is another thing."""


def _with_targets(movements: list[Movement]) -> list[Movement | None]:
    """Return the ``movements`` for a goal before the first movement without a target, for which the
    corrective process acts; before them None, a check of the hand, if the first is corrective."""
    given: list[Movement | None] = [None] if movements[0].kind == "corrective" else []
    for movement in movements:
        if movement.target is None:
            break
        given.append(movement)
    return given


def _make_straight(compiled: CompiledTask, plans: Sequence[Plan]) -> list[Execution]:
    """Execute plans without paths side by side, and return the executions in their order."""
    if not plans:
        return []
    given = [[_with_targets(movements) for movements in plan] for plan in plans]
    most = max([len(of_goal) for of_plan in given for of_goal in of_plan])
    rows = [m for each in given for some in each for m in some + [None] * (most - len(some))]
    hands = [HANDS.index(movements[0].hand) for plan in plans for movements in plan]
    stay, shape = [math.nan] * compiled.starts.shape[1], (len(plans), -1, most)
    accounts = make_trials(
        compiled,
        np.array(hands).reshape(shape[:2]),
        np.array([stay if m is None else m.target for m in rows]).reshape(*shape, len(stay)),
        np.array([m is None or m.kind != "corrective" for m in rows]).reshape(shape),
    ).goals
    made = movements_in(accounts, compiled.task.robot.dof, given)
    goals = accounts[..., 0]
    return [_execution_of(compiled, *each) for each in zip(plans, made, goals, strict=True)]


def movements_in(
    accounts: NDArray[np.void], dof: int, given: Iterable[Iterable[Sequence[Movement | None]]]
) -> list[list[Movement]]:
    """Return a list for each of N trials, of the movements made for goals up to the first goal
    missed, from the accounts of goals, shape ``(N, G, M)``; ``dof`` is the length of a
    configuration. ``given`` has the movements to be made by trial and goal (:func:`_with_targets`),
    from which the kinds come. A goal hit without a movement has a corrective movement of 0 ticks.
    """
    names = ("hand", "hit", "ticks", "corrections")
    first = accounts[..., 0]
    columns = [first[name].tolist() for name in names] + [accounts["moved"].tolist()]
    targets, trials = accounts["target"][..., :dof], []
    for n, of_trial in enumerate(given):
        movements: list[Movement] = []
        of_goals = zip(of_trial, *[column[n] for column in columns], strict=True)
        for g, (of_goal, side, hit, total, corrections, moved) in enumerate(of_goals):
            goal, hand, before = g + 1, HANDS[side], len(movements)
            for m, movement in enumerate(of_goal):
                if movement is not None and moved[m]:
                    target = targets[n, g, m]
                    movements.append(Movement(goal, hand, movement.kind, target, moved[m]))
            if corrections:
                ticks = total - sum(moved)
                corrected = accounts["corrected"][n, g, 0, :dof]
                movements.append(Movement(goal, hand, "corrective", corrected, ticks))
            if not hit:
                break
            if len(movements) == before:  # hit on the way: show the hand
                movements.append(
                    Movement(goal, hand, "corrective", accounts["q"][n, g, 0, :dof], 0)
                )
        trials.append(movements)
    return trials


def _make_one_by_one(compiled: CompiledTask, plan: Plan) -> Execution:
    """Execute a plan with paths, one movement after the other, and return the execution."""
    count_trials(1)
    task, q = compiled.task, compiled.starts[0]
    model = compiled.model.for_radius(task.radius)
    made, goals = list[Movement](), np.zeros(len(plan), account_type(width_of(task.robot)))
    for number, (goal, movements) in enumerate(zip(task.goals, plan, strict=True), 1):
        hand, before = movements[0].hand, len(made)
        where, checks = (hand, goal, task.radius), movements[0].kind == "corrective"
        iterations, evaluations = 0, int(checks)
        hit = checks and move(task.robot, q, q, *where, model=model).hit
        for movement in [] if hit else [*movements, Movement(number, hand, "corrective")]:
            target, stops = movement.target, movement.kind != "corrective"
            if target is None:
                locked = task.locked_base
                found = correct(task.robot, q, hand, goal, locked_base=locked, model=model)
                target, iterations = found.q, found.iterations
                evaluations += iterations + 1
                if not found.converged:
                    break
            if movement.waypoints is None:
                moved = move(task.robot, q, target, *where, stop_on_arrival=stops, model=model)
            else:
                moved = follow(task.robot, q, movement.waypoints, *where, model=model)
            made.append(replace(movement, target=target, ticks=moved.ticks))
            q, hit, evaluations = moved.q, moved.hit, evaluations + moved.evaluations
            if hit or movement.target is None:
                break
        if hit and len(made) == before:  # on the way: show the hand
            made.append(Movement(number, hand, "corrective", q.copy(), 0))
        account = goals[number - 1]
        account["q"][: len(q)], account["hand"], account["hit"] = q, HANDS.index(hand), hit
        account["iterations"], account["evaluations"] = iterations, evaluations
        if not hit:
            break
    return _execution_of(compiled, plan, made, goals)


def _execution_of(
    compiled: CompiledTask, plan: Plan, movements: list[Movement], goals: NDArray[np.void]
) -> Execution:
    """Return the execution of a plan, the movements as given, from the ``movements`` as made, up to
    the first goal missed, and the accounts of the ``goals``, shape ``(G,)``."""
    hits = sum(goals["hit"].tolist())
    # The place of the hand is known before the first movement, and where that leads.
    checked = [2 - (of_goal[0].kind == "corrective") for of_goal in plan[: hits + 1]]
    return Execution(
        movements=tuple(movements),
        configurations=goals["q"][:hits, : compiled.task.robot.dof].copy(),
        ticks=sum([movement.ticks or 0 for movement in movements]),
        corrections=sum([m.kind == "corrective" and m.ticks != 0 for m in movements]),
        iterations=sum(goals["iterations"].tolist()),
        evaluations=sum(goals["evaluations"].tolist() + checked),
        reason=reason_of_failure(compiled, goals),
    )


def other_arm_travel(task: Task, hands: Iterable[Hand], reached: Array) -> float:
    """Return the joint travel of the idle arm, rad, summed over the goals: for each goal the
    Euclidean distance of the joint angles of the arm that does not hit the goal from their values
    at the hit before (for goal 1, at the start). ``hands`` has the hand for each goal, ``reached``
    the configuration at each hit, ``(G, dof)``."""
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


def movements_by_goal(task: Task, solution: Iterable[Movement]) -> Plan:
    """Check a solution, and return a list of the movements for each goal, in the order of goals;
    a path has its last waypoint as target, and locked base coordinates are as at the start.
    Raises SolutionError for a solution that breaks the task's rules."""
    if not isinstance(solution, Iterable):
        raise SolutionError(
            f"task {task.name!r}: the solution is {brief_value(solution)}; needed is a list of "
            "movements"
        )
    plan: Plan = []
    for movement in solution:
        if not isinstance(movement, Movement):
            raise SolutionError(f"task {task.name!r}: {brief_value(movement)} is not a Movement")
        if not isinstance(movement.goal, (int, np.integer)):
            raise SolutionError(
                f"task {task.name!r}: goal of a movement is {brief_value(movement.goal)}; it must "
                "be a whole number"
            )
        if not plan or plan[-1][0].goal != movement.goal:
            plan.append([])
        of_goal = plan[-1]
        try:
            of_goal.append(_check_movement(task, movement))
            if movement.hand != of_goal[0].hand:
                raise SolutionError("two hands for one goal")
        except (SolutionError, ValueError) as error:
            where = f"task {task.name!r}, goal {movement.goal}"
            raise SolutionError(f"{where}: {error}") from None
    given, wanted = [each[0].goal for each in plan], list(range(1, len(task.goals) + 1))
    if given != wanted:
        raise SolutionError(f"task {task.name!r}: movements for goals {given}, wanted {wanted}")
    return plan


def _check_movement(task: Task, movement: Movement) -> Movement:
    """Return the movement itself, or a copy with arrays as in :func:`movements_by_goal`. Raises
    SolutionError or ValueError for a hand that the task does not have, for an unknown kind, and if
    target or waypoints do not fit."""
    kind, target, waypoints = movement.kind, movement.target, movement.waypoints
    if not isinstance(movement.hand, str) or movement.hand not in task.hands:
        known = " and ".join(map(repr, task.hands))
        hand = brief_value(movement.hand).strip("'")
        raise SolutionError(f"task {task.name!r} has no {hand} hand; it has {known}")
    if not isinstance(kind, str) or kind not in KINDS:
        raise SolutionError(f"unknown kind {brief_value(kind)}; known: {KINDS}")
    if kind == "path":
        if waypoints is None or not isinstance(waypoints, Iterable) or len([*waypoints]) == 0:
            raise SolutionError("a path needs waypoints, a list of configurations")
        path = np.array([_check_point(task, point) for point in waypoints], dtype=np.float64)
        if target is not None and not np.array_equal(target, waypoints[-1]):
            raise SolutionError("a path's target is its last waypoint")
        return replace(movement, target=path[-1], waypoints=path)
    if waypoints is not None:
        raise SolutionError(f"a {kind} movement has no waypoints")
    if target is not None:
        held = _check_point(task, target)
        return movement if held is target else replace(movement, target=held)
    if kind != "corrective":
        raise SolutionError(f"a {kind} movement needs a target")
    return movement


def _check_point(task: Task, point: Any) -> Array:
    """Return a configuration as an array ``(dof,)``: the array given, or a new array in which
    locked base coordinates are as at the start. Raises ValueError if ``point`` is no configuration
    of the robot, or moves a locked base coordinate by more than 1e-6."""
    usual = type(point) is np.ndarray and point.dtype == np.float64
    # A length is quick to compute, and not below a limit where an entry is NaN.
    if not usual or point.shape != task.q0.shape or not math.hypot(*point.tolist()) < LARGEST_ENTRY:
        point = configuration(task.robot, point)
    held: Array = point
    for k in map("xy".index, task.locked_base):
        if held[k] != task.q0[k]:
            return _hold_base(task, held.copy())
    return held


def _hold_base(task: Task, points: Array) -> Array:
    """Set locked base coordinates of points, ``(..., dof)``, to their values at the start, in
    place, and return ``points`` itself. Raises ValueError where one of them differs from the start
    by more than :data:`HELD`, 1e-6 length units; NaN stays."""
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
    """Return a copy of targets, shape ``(N, G, dof)``, length unit and rad, in which locked base
    coordinates are as at the start; NaN passes. Raises ValueError for another shape, for infinite
    entries and for targets that move a locked base by more than 1e-6."""
    copy = np.array(real_array("targets", targets))
    if copy.ndim != 3 or copy.shape[1:] != (len(task.goals), task.robot.dof):
        raise ValueError(
            f"targets have shape {copy.shape}; needed are (N, {len(task.goals)}, {task.robot.dof})"
        )
    if np.isinf(copy).any():
        raise ValueError("targets have infinite entries; needed are finite ones")
    return _hold_base(task, copy)


# ---- Solutions from hands and targets, and initial ones ----


def movements_of(hands: str, targets: ArrayLike) -> tuple[Movement, ...]:
    """Make a solution of hands and target configurations.

    Parameters
    ----------
    hands : str
        The hand for each goal, such as ``"RRLR"``.
    targets : array_like, shape (G, dof)
        The configuration to move to for each goal, length unit (base) and rad (joints). Where a row
        is NaN, the corrective process acts alone.

    Returns
    -------
    tuple of Movement
        A movement for each goal, of kind ``learned``, or ``corrective`` where the row is NaN, for
        :func:`coartic.execute` and :func:`coartic.trajectory`.

    Raises
    ------
    ValueError
        The hands are not letters L and R, or there is not a row for each.
    """
    chosen, targets = hands_of(hands), real_array("targets", targets)
    if targets.ndim != 2 or len(targets) != len(chosen):
        raise ValueError(
            f"targets have shape {targets.shape}; needed is a row for each of the "
            f"{len(chosen)} hands in {brief_value(hands)}"
        )
    return tuple(
        Movement(number, hand, "corrective")
        if np.isnan(target).all()
        else Movement(number, hand, "learned", target)
        for number, (hand, target) in enumerate(zip(chosen, targets, strict=True), 1)
    )


def corrective_trial(task: TaskLike, hands: str, *, model: MotionModel = PAPER) -> Execution:
    """Make one trial by the corrective process alone.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    hands : str
        The hand for each goal: ``"LRRR"`` is left, right, right, right.
    model : MotionModel

    Returns
    -------
    Execution
        Movements, configurations at the hits, control ticks and reward. Where the corrective
        process does not converge, ``completed`` is False and ``reason`` says so.

    Raises
    ------
    TaskError, TypeError
        The task cannot be used, or ``task`` or ``model`` has another type.
    ValueError
        The hands do not fit the task, or a constant of the model is out of bounds.

    Notes
    -----
    Source: paper, section *The Corrective Process*.
    """
    task = as_task(task)
    hands = check_hands(task, hands)
    return execute(task, corrective_movements(hands), model=model)


def corrective_movements(hands: str) -> list[Movement]:
    """Return a list of one corrective movement, without a target, for each goal, with the hands of
    a sequence such as ``"RRLR"``."""
    return [Movement(number, hand, "corrective") for number, hand in enumerate(hands_of(hands), 1)]


def hand_sequences(task: TaskLike, hands: Iterable[Hand] | None = None) -> list[str]:
    """List all hand sequences of a task.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    hands : iterable of {"left", "right"}, optional
        The hands that may be used; the task's by default.

    Returns
    -------
    list of str
        The sequences in alphabetical order, such as ``"LLLR"``: one letter for each of G goals,
        2^G sequences for two hands.

    Raises
    ------
    TaskError, TypeError
        The task cannot be used, or is neither a Task nor a text nor a path.
    NotApplicableError
        There are more than 4096 sequences.
    ValueError
        ``hands`` is empty, or names a hand that is not the task's.
    """
    task = as_task(task)
    return sequences_with(hands_among(task, hands), len(task.goals), task.name)


def initial_hands(
    task: TaskLike, hands: tuple[Hand, ...] | None = None, *, model: MotionModel = PAPER
) -> str:
    """Return the hand sequence of a task's first trial.

    If the task names a sequence, it is this sequence. If the task names a policy, it is the
    sequence with which the corrective process alone gets the highest reward: among sequences of one
    hand (``"best-single-hand"``), or among all (``"best-of-all"``).

    Parameters
    ----------
    task : Task, str or pathlib.Path
    hands : tuple of {"left", "right"}, optional
        The hands among which a policy chooses; the task's by default.
    model : MotionModel

    Returns
    -------
    str
        The hand for each goal, such as ``"RRRR"``.

    Raises
    ------
    TaskError, TypeError
        The task cannot be used, or ``task`` or ``model`` has another type.
    NotApplicableError
        No candidate completes the task, or there are more than 4096.
    ValueError
        ``hands`` is empty or names a hand that is not the task's, or a constant of the model is out
        of bounds.

    Notes
    -----
    Source: paper, section *Experiments*.
    """
    task = as_task(task)
    return search_initial_hands(task, hands, model=check_model(model))[0]


def initial_reward(task: Task, model: MotionModel = PAPER) -> int | None:
    """Return the reward, minus the ticks, of a trial by the corrective process alone with a task's
    initial hands; None if the trial fails, or if a policy is to find the hands and finds none
    (:func:`initial_hands`)."""
    try:
        hands = initial_hands(task, model=model)
    except NotApplicableError:
        return None
    return corrective_trial(task, hands, model=model).reward
