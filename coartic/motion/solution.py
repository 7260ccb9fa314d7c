"""Solutions: movements, and the one function that executes and scores them.

A solution is a list of movements, at least one per goal. :func:`execute` makes them from the task's
start by the rule of :mod:`coartic.motion.trial` and counts every tick. The corrective process
finishes any goal that they miss. Whatever a method says about its own solution, the score is the
reward of this execution.
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
from coartic.motion.correction import correct
from coartic.motion.initial_hands import hands_among, search_initial_hands, sequences_with
from coartic.motion.movement import LARGEST_ENTRY, configuration, follow, move
from coartic.motion.trial import (
    CompiledTask,
    account_type,
    compiled_task,
    count_trials,
    make_trials,
    reason_of_failure,
)
from coartic.robot import HANDS, Array, Configs, Hand
from coartic.tasks.catalogue import TaskLike, as_task
from coartic.tasks.task import Task, check_hands, hands_of, letters_of

Kind = Literal["learned", "corrective", "planned", "path"]
KINDS: tuple[Kind, ...] = get_args(Kind)
HELD = 1e-6
"""Largest distance of a locked base coordinate of a target from its value at the start (in length
units). Solvers leave smaller differences."""


@dataclass(frozen=True, eq=False)
class Movement:
    """A movement of a solution (:func:`execute`).

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
    """Target configuration q^t, shape ``(dof,)``, in length units and rad; for a path its last
    waypoint. If a corrective movement has None, the corrective process finds the target during
    execution."""
    ticks: int | None = None
    """Control ticks of the movement; None before the movement is executed."""
    waypoints: Array | None = None
    """Configurations through which a path passes in turn, shape ``(k, dof)``, in length units and
    rad; None for the other kinds."""
    __eq__ = equal_contents

    def __post_init__(self) -> None:
        for name, value in (("target", self.target), ("waypoints", self.waypoints)):
            if value is not None:  # a planner may change its own array later
                copy = np.array(real_array(name, value))
                copy.flags.writeable = False
                object.__setattr__(self, name, copy)


@dataclass(frozen=True, eq=False)
class Execution:
    """An executed solution (:func:`execute`)."""

    movements: tuple[Movement, ...]
    """The movements that were made, in order, with targets and ticks."""
    configurations: Array
    """Configuration at the moment each goal was hit, shape ``(goals hit, dof)``, in length units
    and rad."""
    ticks: int
    """Total number of control ticks."""
    corrections: int
    """Number of corrective movements that took a tick or more."""
    iterations: int = 0
    """Iterations of the corrective process, with one Jacobian each."""
    evaluations: int = 0
    """Forward-kinematics evaluations. A correction takes one more than its iterations. Each goal
    that is tried takes one more if its first movement is corrective, and otherwise two more."""
    reason: str = ""
    """Sentence on why the task was not completed; empty if it was completed."""
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
        """Hand of each goal that has a movement, in goal order, such as ``"LRLR"``."""
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
    """Return the hand of each goal that has a movement, such as ``"LRLR"``."""
    by_goal = {movement.goal: movement.hand for movement in movements}
    return letters_of([by_goal[goal] for goal in sorted(by_goal)])


def execute(
    task: TaskLike, solution: Iterable[Movement], *, model: MotionModel = PAPER
) -> Execution:
    """Execute a solution from the task's start and score it.

    If a goal is still missed after its movements, the corrective process finds a correction from
    where the robot stands. The ticks of this movement count.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    solution : iterable of Movement
        At least one movement for each goal, in the order of the goals.
    model : MotionModel

    Returns
    -------
    Execution
        Movements made, configurations at the hits, control ticks and reward. If the corrective
        process does not converge, the execution ends: ``completed`` is False, and ``reason`` says
        at which goal.

    Raises
    ------
    TaskError, TypeError
        The task cannot be used, or ``task`` or ``model`` has another type.
    SolutionError
        The solution breaks a rule of the task:

        - goals are missing or out of order;
        - the task does not have a movement's hand;
        - a target has the wrong shape or is not finite;
        - a locked base moves by more than 1e-6.
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
    """Return the numbers of the goals, from 1, that have only corrective movements."""
    goals, aimed = set[int](), set[int]()
    for movement in movements:
        (goals if movement.kind == "corrective" else aimed).add(movement.goal)
    return tuple(sorted(goals - aimed))


def execute_many(
    compiled: CompiledTask, solutions: Iterable[Iterable[Movement]]
) -> list[Execution | Refused]:
    """Execute and score many solutions of one task, and return a list in their order.

    For a solution that cannot be executed, the list has the error that :func:`execute` would raise.
    Solutions without paths are executed side by side, solutions with a path one after the other.
    """
    executions: list[Execution | Plan | Refused] = []
    for solution in solutions:
        try:
            plan = movements_by_goal(compiled.task, solution)
        except (SolutionError, ValueError, TypeError, OverflowError) as error:
            executions.append(error)
        else:
            kinds = {movement.kind for movements in plan for movement in movements}
            executions.append(_execute_with_paths(compiled, plan) if "path" in kinds else plan)
    plans = [item for item in executions if isinstance(item, list)]
    straight = iter(_execute_straight(compiled, plans))
    return [next(straight) if isinstance(item, list) else item for item in executions]


Plan = list[list[Movement]]
"""The movements of a solution, goal by goal. (The plan of a suite is something else.)"""


def _with_targets(movements: list[Movement]) -> list[Movement | None]:
    """Return the movements for a goal that have targets, up to the first one without.

    The corrective process acts from the first movement without a target on. If the first movement
    is corrective, the list begins with None, which stands for a check whether the hand is in the
    goal.
    """
    aimed: list[Movement | None] = [None] if movements[0].kind == "corrective" else []
    for movement in movements:
        if movement.target is None:
            break
        aimed.append(movement)
    return aimed


def _execute_straight(compiled: CompiledTask, plans: Sequence[Plan]) -> list[Execution]:
    """Execute plans without paths side by side, and return the executions in their order."""
    if not plans:
        return []
    requested = [[_with_targets(movements) for movements in plan] for plan in plans]
    goals = [movements for plan in requested for movements in plan]
    length = max(map(len, goals))
    rows = [m for movements in goals for m in movements + [None] * (length - len(movements))]
    hands = [HANDS.index(movements[0].hand) for plan in plans for movements in plan]
    stay, shape = [math.nan] * compiled.starts.shape[1], (len(plans), -1, length)
    accounts = make_trials(
        compiled,
        np.array(hands).reshape(shape[:2]),
        np.array([stay if m is None else m.target for m in rows]).reshape(*shape, len(stay)),
        np.array([m is None or m.kind != "corrective" for m in rows]).reshape(shape),
    ).goals
    executed = movements_in(accounts, compiled.task.robot.dof, requested)
    trials = zip(plans, executed, accounts[..., 0], strict=True)
    return [_execution_of(compiled, *trial) for trial in trials]


def movements_in(
    accounts: NDArray[np.void], dof: int, requested: Iterable[Iterable[Sequence[Movement | None]]]
) -> list[list[Movement]]:
    """Return the movements that were made in N trials, up to the first goal missed.

    A goal that is hit without a movement has a corrective movement of 0 ticks.

    Parameters
    ----------
    accounts : ndarray, shape (N, G, M)
        Accounts of the goals.
    dof : int
        Length of a configuration.
    requested : iterable of iterable of sequence of Movement or None
        For each trial and goal the movements that were to be made (:func:`_with_targets`). The
        kinds of the result come from these movements.

    Returns
    -------
    list of list of Movement
        A list for each trial.
    """
    names = ("hand", "hit", "ticks", "corrections")
    goals = accounts[..., 0]
    columns = [goals[name].tolist() for name in names] + [accounts["moved"].tolist()]
    targets, trials = accounts["target"][..., :dof], []
    for n, of_trial in enumerate(requested):
        movements: list[Movement] = []
        of_goals = zip(of_trial, *[column[n] for column in columns], strict=True)
        for g, (of_goal, side, hit, total, corrections, moved) in enumerate(of_goals):
            goal, hand, start = g + 1, HANDS[side], len(movements)
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
            if len(movements) == start:  # hit without a movement: record the hand
                movements.append(
                    Movement(goal, hand, "corrective", accounts["q"][n, g, 0, :dof], 0)
                )
        trials.append(movements)
    return trials


def _execute_with_paths(compiled: CompiledTask, plan: Plan) -> Execution:
    """Execute a plan with paths, one movement after the other."""
    count_trials(1)
    task, q = compiled.task, compiled.starts[0]
    model = compiled.model.for_radius(task.radius)
    executed, goals = list[Movement](), np.zeros(len(plan), account_type(width_of(task.robot)))
    for number, (goal, movements) in enumerate(zip(task.goals, plan, strict=True), 1):
        hand, start = movements[0].hand, len(executed)
        aim, checks = (hand, goal, task.radius), movements[0].kind == "corrective"
        iterations, evaluations = 0, int(checks)
        hit = checks and move(task.robot, q, q, *aim, model=model).hit
        for movement in [] if hit else [*movements, Movement(number, hand, "corrective")]:
            target, stops = movement.target, movement.kind != "corrective"
            if target is None:
                locked = task.locked_base
                correction = correct(task.robot, q, hand, goal, locked_base=locked, model=model)
                target, iterations = correction.q, correction.iterations
                evaluations += iterations + 1
                if not correction.converged:
                    break
            if movement.waypoints is None:
                moved = move(task.robot, q, target, *aim, stop_on_arrival=stops, model=model)
            else:
                moved = follow(task.robot, q, movement.waypoints, *aim, model=model)
            executed.append(replace(movement, target=target, ticks=moved.ticks))
            q, hit, evaluations = moved.q, moved.hit, evaluations + moved.evaluations
            if hit or movement.target is None:
                break
        if hit and len(executed) == start:  # hit without a movement: record the hand
            executed.append(Movement(number, hand, "corrective", q.copy(), 0))
        account = goals[number - 1]
        account["q"][: len(q)], account["hand"], account["hit"] = q, HANDS.index(hand), hit
        account["iterations"], account["evaluations"] = iterations, evaluations
        if not hit:
            break
    return _execution_of(compiled, plan, executed, goals)


def _execution_of(
    compiled: CompiledTask, plan: Plan, movements: list[Movement], goals: NDArray[np.void]
) -> Execution:
    """Return the execution of a plan from the movements and accounts of its trial.

    ``movements`` are those that were made, up to the first goal missed; ``goals`` are the accounts,
    shape ``(G,)``.
    """
    hits = sum(goals["hit"].tolist())
    # The hand is evaluated before the first movement and, unless it is corrective, at its end.
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
    """Compute the joint travel of the idle arm, summed over the goals (in rad).

    For each goal, the travel is the Euclidean distance between two vectors of joint angles of the
    arm that does not hit the goal: those at this hit and those at the hit before (for goal 1, at
    the start).

    Parameters
    ----------
    task : Task
    hands : iterable of {"left", "right"}
        The hand for each goal.
    reached : ndarray, shape (G, dof)
        The configuration at each hit.
    """
    travel, previous = 0.0, task.q0
    for hand, q in zip(hands, reached, strict=True):
        joints = task.robot.joints("right" if hand == "left" else "left")
        square = 0.0
        # Added in this order, because the rounding of a BLAS dot product depends on the processor.
        for difference in (q[joints] - previous[joints]).tolist():
            square += difference * difference
        travel += math.sqrt(square)
        previous = q
    return travel


def movements_by_goal(task: Task, solution: Iterable[Movement]) -> Plan:
    """Check a solution, and return a list of the movements for each goal.

    A path gets its last waypoint as target, and locked base coordinates their values at the start.
    Raises SolutionError if the solution breaks the task's rules.
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
                raise SolutionError("movements have different hands; a goal needs one hand")
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
    """Check a movement's hand, kind, target and waypoints.

    Return the movement itself, or a copy with arrays as in :func:`movements_by_goal`. Raises
    SolutionError or ValueError if something does not fit.
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
            raise SolutionError("a path needs waypoints, a list of configurations")
        path = np.array([_check_point(task, point) for point in waypoints], dtype=np.float64)
        if target is not None and not np.array_equal(target, waypoints[-1]):
            raise SolutionError("the target of a path must be None or its last waypoint")
        return replace(movement, target=path[-1], waypoints=path)
    if waypoints is not None:
        raise SolutionError(f"a {kind} movement cannot have waypoints; only a path can")
    if target is not None:
        point = _check_point(task, target)
        return movement if point is target else replace(movement, target=point)
    if kind != "corrective":
        raise SolutionError(f"a {kind} movement needs a target")
    return movement


def _check_point(task: Task, point: Any) -> Array:
    """Check a configuration, and return it as an array ``(dof,)``.

    The result is the array that was passed, or a new array if locked base coordinates have to be
    set to their values at the start. Raises ValueError if ``point`` is not a configuration of the
    robot, or moves a locked base coordinate by more than 1e-6.
    """
    usual = type(point) is np.ndarray and point.dtype == np.float64
    # The length is quick to compute; with a NaN entry it is not below any limit.
    if not usual or point.shape != task.q0.shape or not math.hypot(*point.tolist()) < LARGEST_ENTRY:
        point = configuration(task.robot, point)
    array: Array = point
    for k in map("xy".index, task.locked_base):
        if array[k] != task.q0[k]:
            return _hold_base(task, array.copy())
    return array


def _hold_base(task: Task, points: Array) -> Array:
    """Set locked base coordinates of points to their values at the start, in place.

    ``points`` has shape ``(..., dof)`` and is returned; NaN stays. Raises ValueError if a
    coordinate differs from the start by more than :data:`HELD`, 1e-6 length units.
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
    """Check targets, and return a copy with locked base coordinates as at the start.

    The shape is ``(N, G, dof)``, in length units and rad; NaN is allowed. Raises ValueError for
    another shape, for infinite entries, and for targets that move a locked base by more than 1e-6.
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
        The configuration to move to for each goal, in length units (base) and rad (joints). For a
        row of NaN only the corrective process acts.

    Returns
    -------
    tuple of Movement
        A movement for each goal, of kind ``learned``, or ``corrective`` for a row of NaN.
        :func:`coartic.execute` and :func:`coartic.trajectory` accept the tuple as a solution.

    Raises
    ------
    ValueError
        The hands are not letters L and R, or the number of rows is not the number of hands.
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


def corrective_trial(task: TaskLike, hands: str, *, model: MotionModel = PAPER) -> Execution:
    """Make one trial in which only the corrective process acts.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    hands : str
        The hand for each goal: ``"LRRR"`` is left, right, right, right.
    model : MotionModel

    Returns
    -------
    Execution
        Movements, configurations at the hits, control ticks and reward. If the corrective process
        does not converge, ``completed`` is False, and ``reason`` says at which goal.

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
    """Return a corrective movement without a target for each goal.

    ``hands`` is a hand sequence such as ``"RRLR"``.
    """
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
        The sequences in alphabetical order, such as ``"LLLR"``: one letter for each of G goals, 2^G
        sequences for two hands.

    Raises
    ------
    TaskError, TypeError
        The task cannot be used, or is not a Task, a string or a path.
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
    """Find the hand sequence of a task's first trial.

    If the task names a sequence, that sequence is returned. If the task names a policy, the result
    is the sequence for which the corrective process on its own gets the highest reward: among
    sequences of one hand (``"best-single-hand"``), or among all (``"best-of-all"``).

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
        No sequence that was tried completes the task, or there are more than 4096.
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
    """Return the reward of the corrective process on its own with a task's initial hands.

    Return None if the trial fails, or if a policy is to find the hands and finds none
    (:func:`initial_hands`).
    """
    try:
        hands = initial_hands(task, model=model)
    except NotApplicableError:
        return None
    return corrective_trial(task, hands, model=model).reward
