"""Execute solutions: make the movements of a solution, and score them.

A solution is executed from the task's start by the rule of :mod:`coartic.motion.kernels.trial`, and
the control ticks of all movements are counted. If the movements miss a goal, the corrective process
acts. The score of a solution is the reward of this execution; a reward that
a method itself reports is ignored.

:func:`execute` executes a solution once without noise. :func:`execute_noisy` executes solutions
many times with motor noise.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.errors import NotApplicableError, SolutionError
from coartic.internal.limits import MAX_RUN_SEED, MAX_RUNS, brief_value, check_limits
from coartic.internal.validation import equal_contents
from coartic.model import PAPER, MotionModel, check_model, refuse_noise
from coartic.motion.doors import line_points, path_points
from coartic.motion.initial_hands import hands_among, search_initial_hands, sequences_with
from coartic.motion.kernels.move import FOLLOW, MOVE, REPEAT
from coartic.motion.kernels.noise import STAYS
from coartic.motion.kernels.trial import FAILURES, TICKS
from coartic.motion.solution import (
    Movement,
    Plan,
    corrective_movements,
    hands_in,
    movements_by_goal,
)
from coartic.motion.trials import (
    ALL_MOVE,
    JUDGE,
    NO_NOISE,
    NO_WAYPOINTS,
    CompiledTask,
    TrialRecords,
    compiled_task,
    make_trials,
    noise_draws,
    noise_seed,
    reason_of_failure,
)
from coartic.robot import HANDS, Array, Configs, Hand, Hands
from coartic.tasks.catalogue import TaskLike, as_task
from coartic.tasks.task import Task, check_hands

_ACTIONS = {"learned": MOVE, "planned": MOVE, "corrective": REPEAT, "path": FOLLOW}
_MAX_NOISE = 100.0  # standard deviation, in length units and rad
_AT_ONCE = 4096  # noisy executions, which limits the memory


@dataclass(frozen=True, eq=False)
class Execution:
    """Result of executing a solution: movements made, ticks and reward (:func:`execute`)."""

    movements: tuple[Movement, ...]
    """The movements that were made, in order, with targets and ticks.

    - A goal that is hit without a movement has a corrective movement of 0 ticks.
    - With motor noise, targets are those without the noise.
    - With motor noise, the corrective process can act several times for a goal. These corrections
      are combined into one movement. The target of this movement is the last configuration of the
      last corrective process, and its ticks are the sum of the ticks of these corrections.
    """
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
    """Forward-kinematics evaluations, which are the sum of

    - the evaluations of all movements, without steps that cannot end a straight movement;
    - k + 1 evaluations for a correction of k iterations;
    - for each goal that is tried, one evaluation if its first movement is corrective, and two
      otherwise.
    """
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
        """Hand sequence of the goals that have movements, such as ``"LRLR"``."""
        return hands_in(self.movements)

    def ticks_by_goal(self) -> tuple[int, ...]:
        """Return the control ticks spent on each goal that has a movement, in goal order."""
        spent = Counter[int]()
        for movement in self.movements:
            spent[movement.goal] += movement.ticks or 0
        return tuple(spent[goal] for goal in sorted(spent))


Refused = SolutionError | ValueError | TypeError | OverflowError
"""Types of the errors for a solution that cannot be executed."""


def execute(
    task: TaskLike, solution: Iterable[Movement], *, model: MotionModel = PAPER
) -> Execution:
    """Execute a solution from the task's start, and score it.

    If the movements for a goal miss the goal, the corrective process starts from the robot's
    present configuration and makes a corrective movement. The ticks of this movement are counted as
    well.

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
        The task cannot be used, or ``task`` or ``model`` has a wrong type.
    SolutionError
        The solution breaks a rule of the task, for example:

        - goals are missing or out of order;
        - the hand of a movement is not a hand of the task;
        - a target has the wrong shape, an infinite entry, or NaN in all entries;
        - a target moves a locked base coordinate by more than 1e-6.
    ValueError
        A constant of the model is out of bounds or does not fit the radius of the goals, or the
        model has motor noise (use :func:`execute_noisy`).

    Notes
    -----
    Source: paper, section *Generating Movement for Each Goal*.
    """
    compiled = compiled_task(as_task(task), model)
    refuse_noise(model)
    (execution,) = execute_many(compiled, [solution])
    if isinstance(execution, Exception):
        raise execution
    return execution


def execute_many(
    compiled: CompiledTask,
    solutions: Iterable[Iterable[Movement]],
    worlds: NDArray[np.uint64] = NO_NOISE,
) -> list[Execution | Refused]:
    """Execute many solutions of one task at once.

    Parameters
    ----------
    compiled : CompiledTask
        The task with its motion model.
    solutions : iterable of iterable of Movement
        K solutions.
    worlds : ndarray of int, shape (K, 2), optional
        Noise seed and noise draw of each solution, if the model has motor noise
        (:func:`.noise_draws`).

    Returns
    -------
    list
        For each solution, in order, its Execution. For a solution that cannot be executed, the
        entry is an exception: the one that :func:`execute` would raise. It is not raised here.
    """
    executions: list[Plan | Refused] = []
    for solution in solutions:
        try:
            executions.append(movements_by_goal(compiled.task, solution))
        except (SolutionError, ValueError, TypeError, OverflowError) as error:
            executions.append(error)
    plans = [item for item in executions if isinstance(item, list)]
    made = iter(_execute_plans(compiled, plans, worlds))
    return [next(made) if isinstance(item, list) else item for item in executions]


class Requested(NamedTuple):
    """Requested movements of K solutions for G goals, as arrays."""

    hands: Hands
    """Shape ``(K, G)``, 0 left or 1 right."""
    targets: Configs
    """Shape ``(K, G, M, dof)``, in length units and rad."""
    movements: NDArray[np.int64]
    """Action of each movement, and its range of waypoints, shape ``(K, G, M, 3)``
    (:attr:`.Requests.movements`)."""
    waypoints: Configs
    """Waypoints of all paths, shape ``(W, dof)``."""


def _with_targets(movements: list[Movement], corrective: float = math.inf) -> list[Movement | None]:
    """Return the movements for a goal that are made before the corrective process acts.

    The list ends before the first movement without a target. It contains at most ``corrective``
    corrective movements, and ends before the next one. If the first of ``movements`` is corrective,
    the list begins with None, which stands for a check whether the hand is in the goal already.
    """
    aimed: list[Movement | None] = [None] if movements[0].kind == "corrective" else []
    for movement in movements:
        corrective -= movement.kind == "corrective"
        if movement.target is None or corrective < 0:
            break
        aimed.append(movement)
    return aimed


def _requested(
    compiled: CompiledTask, aims: Sequence[list[list[Movement | None]]], hands: Any
) -> Requested:
    """Convert requested movements to arrays for the kernels.

    Parameters
    ----------
    compiled : CompiledTask
    aims : sequence of list of list
        For each solution and goal, the movements of :func:`_with_targets`.
    hands : list of int
        Hands of all goals of all solutions, 0 left or 1 right.
    """
    goals = [movements for of_solution in aims for movements in of_solution]
    length = max(map(len, goals))
    rows = [m for movements in goals for m in movements + [None] * (length - len(movements))]
    stay, shape = [math.nan] * compiled.starts.shape[1], (len(aims), -1, length)
    targets = np.array([stay if m is None else m.target for m in rows])
    requested = np.array(hands).reshape(shape[:2]), targets.reshape(*shape, len(stay))
    made = [MOVE if m is None else _ACTIONS[m.kind] for m in rows]
    if made.count(MOVE) == len(made):
        return Requested(*requested, ALL_MOVE, NO_WAYPOINTS)
    ways = [NO_WAYPOINTS if m is None or m.waypoints is None else m.waypoints for m in rows]
    ends = np.cumsum([0, *map(len, ways)])
    movements = np.stack([made, ends[:-1], ends[1:]], axis=1).reshape(*shape, 3)
    waypoints = np.concatenate([way for way in ways if len(way)]) if ends[-1] else NO_WAYPOINTS
    return Requested(*requested, movements, waypoints)


def _execute_plans(
    compiled: CompiledTask,
    plans: Sequence[Plan],
    worlds: NDArray[np.uint64],
) -> list[Execution]:
    """Execute plans at once, and return the executions in the order of the plans."""
    if not plans:
        return []
    aims = [[_with_targets(movements) for movements in plan] for plan in plans]
    requested = _requested(compiled, aims, _hands_of(plans))
    records = make_trials(compiled, *requested, worlds=worlds).goals
    executed = movements_in(records, compiled.task.robot.dof, aims)
    trials = zip(plans, executed, records[..., 0], strict=True)
    return [_execution_of(compiled, *trial) for trial in trials]


def movements_in(
    records: NDArray[np.void], dof: int, requested: Iterable[Iterable[Sequence[Movement | None]]]
) -> list[list[Movement]]:
    """Return the movements that were made in each of N trials.

    The movements for the first goal that was missed are included. A goal that was hit without a
    movement gets a corrective movement of 0 ticks.

    Parameters
    ----------
    records : ndarray, shape (N, G, M)
        Per-goal records of the trials.
    dof : int
        Number of entries of a configuration.
    requested : iterable of iterable of sequence of Movement or None
        For each trial and goal, the movements that were requested (:func:`_with_targets`). The
        kinds of these movements are copied. The movement of a correction has kind ``corrective``.

    Returns
    -------
    list of list of Movement
        The movements made in each trial.
    """
    names = ("hand", "hit", "ticks", "corrections")
    goals = records[..., 0]
    columns = [goals[name].tolist() for name in names] + [records["moved"].tolist()]
    targets, trials = records["target"][..., :dof], []
    for n, of_trial in enumerate(requested):
        movements: list[Movement] = []
        of_goals = zip(of_trial, *[column[n] for column in columns], strict=True)
        for g, (of_goal, side, hit, total, corrections, moved) in enumerate(of_goals):
            goal, hand, start = g + 1, HANDS[side], len(movements)
            for m, movement in enumerate(of_goal):
                if movement is not None and moved[m]:
                    target = movement.target  # as it was asked for; None in trials of the learner
                    target = targets[n, g, m] if target is None else target
                    made = Movement(goal, hand, movement.kind, target, moved[m], movement.waypoints)
                    movements.append(made)
            if corrections:
                ticks = total - sum(moved)
                corrected = records["corrected"][n, g, 0, :dof]
                movements.append(Movement(goal, hand, "corrective", corrected, ticks))
            if not hit:
                break
            if len(movements) == start:  # hit without a movement: record the hand
                movements.append(Movement(goal, hand, "corrective", records["q"][n, g, 0, :dof], 0))
        trials.append(movements)
    return trials


def _execution_of(
    compiled: CompiledTask, plan: Plan, movements: list[Movement], goals: NDArray[np.void]
) -> Execution:
    """Return the execution of a plan.

    Parameters
    ----------
    compiled : CompiledTask
    plan : list of list of Movement
        Requested movements for each goal.
    movements : list of Movement
        Movements that were made (:func:`movements_in`).
    goals : ndarray, shape (G,)
        Per-goal records of the trial.
    """
    hits = sum(goals["hit"].tolist())
    # The hand is evaluated before the first movement and, unless it is corrective, at its end.
    checked = [2 - (of_goal[0].kind == "corrective") for of_goal in plan[: hits + 1]]
    return Execution(
        movements=tuple(movements),
        configurations=goals["q"][:hits, : compiled.task.robot.dof].copy(),
        ticks=sum([movement.ticks or 0 for movement in movements]),
        corrections=sum([m.kind == "corrective" and m.ticks != 0 for m in movements])
        + sum([max(count - 1, 0) for count in goals["corrections"].tolist()]),
        iterations=sum(goals["iterations"].tolist()),
        evaluations=sum(goals["evaluations"].tolist() + checked),
        reason=reason_of_failure(compiled, goals),
    )


def other_arm_travel(task: Task, hands: Iterable[Hand], reached: Array) -> float:
    """Compute the joint travel of the idle arm, summed over the goals (in rad).

    The idle arm of a goal is the arm whose hand does not hit the goal. Its travel on the way to the
    goal is a Euclidean distance between joint angles: from its angles at the hit of the previous
    goal (for goal 1, at the start) to its angles at the hit of this goal.

    Parameters
    ----------
    task : Task
    hands : iterable of {"left", "right"}
        The hand for each goal.
    reached : ndarray, shape (G, dof)
        Configuration at the hit of each goal, in length units and rad.

    Returns
    -------
    float
        Sum of the travels (in rad).
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


def sample_execution(
    task: Task, movements: Iterable[Movement], model: MotionModel = PAPER
) -> Array:
    """Return the configuration at each control tick of an execution without noise.

    Parameters
    ----------
    task : Task
    movements : iterable of Movement
        The movements of the execution (:attr:`Execution.movements`), with targets and ticks.
    model : MotionModel
        The motion model of the execution.

    Returns
    -------
    ndarray, shape (ticks, dof)
        Configurations, in length units and rad. The first row is the start. A movement of k steps
        has k + 1 rows. The last row of a movement is therefore repeated as the first row of the
        next movement.
    """
    q, rows = np.array(task.q0), [np.empty((0, task.robot.dof))]
    for movement in movements:
        assert movement.target is not None
        if movement.waypoints is not None:
            points = path_points(task.robot, q, movement.waypoints, model)[: movement.ticks]
        else:
            points = line_points(q, movement.target, model)[: movement.ticks]
        if len(points):
            q = points[-1]
            rows.append(points)
    return np.concatenate(rows)


# ---- Motor noise ----


def execute_noisy(
    task: TaskLike,
    solutions: Iterable[Iterable[Movement]],
    motor_noise: float,
    repeats: int,
    seed: int | Iterable[int],
    model: MotionModel = PAPER,
    *,
    signal_dependent: bool = False,
) -> Array:
    """Execute solutions of a task many times with motor noise, and count the ticks.

    Gaussian noise displaces the target of each movement. If a goal is missed, the corrective
    process makes corrective movements, which are noisy as well, until the hand hits the goal or the
    execution fails. All other rules are as in :func:`coartic.execute`.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    solutions : iterable of iterables of Movement
        K solutions of the task, as a list even if there is only one.
    motor_noise : float
        Standard deviation s of the noise, from 0 to 100, in length units (base) and rad (joints).
        If it is 0, the ticks are the same as in :func:`coartic.execute`, unless the target of a
        corrective movement contains NaN (see Notes).
    repeats : int
        Number R of executions of each solution, from 1 to 1,000,000.
    seed : int or iterable of int
        Seed of the noise, from 0 to 2^128 - 1: one seed for all solutions, or one for each. With
        one seed, execution number r is made with the same noise for all solutions (*common random
        numbers*). The ticks of execution number r of a solution depend neither on the other
        solutions nor on ``repeats``.
    model : MotionModel
        The motion model of the executions. Its constant ``motor_noise`` must be 0.
    signal_dependent : bool
        True if the noise of aimed movements grows with their length. The noise of corrections
        always grows with their length.

    Returns
    -------
    ndarray, shape (K, R)
        Control ticks of each execution; NaN if the execution failed. An execution fails if the
        corrective process does not converge, or if a goal is still missed after 50 corrections. If
        executions of a solution fail, report the number of failures as well: the mean over the
        other executions alone would make the solution look better than it is.

    Raises
    ------
    TaskError, TypeError
        The task cannot be used, or ``task``, ``solutions``, ``model`` or ``signal_dependent`` has a
        wrong type.
    SolutionError
        One of these is the case:

        - a solution breaks the task's rules, as in :func:`coartic.execute`;
        - all movements of a solution have stored ticks, and the sum of these ticks differs from the
          ticks of the execution without noise, for example because the solution belongs to another
          task.
    ValueError
        ``motor_noise``, ``repeats``, ``seed`` or a constant of the model has a wrong type or is out
        of bounds, the model has motor noise, or the number of seeds is not the number of solutions.

    Notes
    -----
    The robot stands at q. Coordinate c of a noisy target is, with standard normal numbers z::

        aimed movement         t_c + s z_c              if c moves, else q_c
        waypoint k of W        w_kc + (k / W) s z_c     if c moves, else q_c
        correction             a_c + s min(1, L) z_c    for base and chosen arm, else a_c

    - An *aimed movement* is a learned or planned movement with the target t. A path has the
      waypoints w_1 to w_W and one vector z; it is not steered while it is made (open loop).
    - A coordinate *moves* if its entry of the target, or of any waypoint, is a number that differs
      by more than 1e-9 from where the robot stands now. A locked base does not move.
    - The target of a *correction* is the configuration a that the corrective process finds from q.
      L is the Euclidean distance from q to a. A locked base coordinate ends at a_c.
    - With ``signal_dependent`` the first two rows also have s min(1, L) instead of s. L is then the
      Euclidean distance from q to the target without noise (for a path, to its last waypoint).
    - The noisy target takes the place of the target everywhere: for the hit, for the arrival of an
      aimed movement, and for the tick that the arrival costs.
    - If the solution contains a corrective movement with a target, this target is compared with the
      configuration that the corrective process finds in the execution without noise. If they differ
      by more than 1e-9 in a coordinate, where NaN is not compared, or if the process does not
      converge, the movement is treated as an aimed movement, which ends on a hit or at its target.
      Otherwise it is treated as a correction, and its stored target is not used.
    - z is a function of the seed, the number of the execution, the goal, the number of the movement
      made for this goal and the coordinate (:mod:`coartic.motion.kernels.noise`).

    Source: constant noise of the end posture is our simplification. Noise in the execution of
    people's movements has constant, signal-dependent and temporal parts (van Beers, Haggard &
    Wolpert 2004, *The role of execution noise in movement variability*, J. Neurophysiol.
    91:1050-1063). ``signal_dependent`` stands for the second part (Harris & Wolpert 1998,
    *Signal-dependent noise determines motor planning*, Nature 394:780-784); nothing stands for the
    third.

    Examples
    --------
    >>> from coartic import corrective_trial, execute_noisy
    >>> solution = corrective_trial("ascending", "RRR").movements
    >>> execute_noisy("ascending", [solution], 0.0, 2, seed=0)
    array([[319., 319.]])
    >>> execute_noisy("ascending", [solution], 0.01, 100, seed=0).shape
    (1, 100)
    """
    check_limits("motor_noise", motor_noise, 0.0, _MAX_NOISE)
    check_limits("repeats", repeats, 1, MAX_RUNS)
    if not isinstance(signal_dependent, bool | np.bool_):
        raise TypeError(f"signal_dependent is {brief_value(signal_dependent)}; it must be a bool")
    if not isinstance(solutions, Iterable):
        raise TypeError(f"solutions is {brief_value(solutions)}; it must be a list of solutions")
    chosen = as_task(task)
    if check_model(model, radius=chosen.radius).motor_noise > 0.0:
        raise ValueError(
            f"model.motor_noise is {model.motor_noise:g}; it must be 0, because argument "
            "motor_noise says how large the noise is"
        )
    plans = [_plan_of(chosen, k, solution) for k, solution in enumerate(solutions)]
    seeds = np.array([noise_seed(value, JUDGE) for value in _seeds(seed, len(plans))], np.uint64)
    if not plans:
        return np.empty((0, int(repeats)))
    aims, ticks = _execute_exactly(compiled_task(chosen, model), plans)
    for k, plan in enumerate(plans):
        _check_ticks(chosen, k, plan, ticks[k])
    if motor_noise == 0.0:
        return np.repeat(ticks[:, None], repeats, axis=1)
    noisy = model._replace(motor_noise=float(motor_noise))
    compiled = compiled_task(chosen, noisy, grows=bool(signal_dependent))
    hands, targets, movements, waypoints = _requested(compiled, aims, _hands_of(plans))
    count, parts = len(plans) * int(repeats), []
    for begin in range(0, count, _AT_ONCE):
        number, draws = np.divmod(np.arange(begin, min(begin + _AT_ONCE, count)), int(repeats))
        actions = movements[number] if len(movements) else movements
        of_part = hands[number], targets[number], actions, waypoints
        records = make_trials(compiled, *of_part, noise_draws(seeds[number], draws))
        parts.append(_ticks_of(records))
    return np.concatenate(parts).reshape(len(plans), -1)


def _hands_of(plans: Sequence[Plan]) -> list[int]:
    """Return a list of the hands of all goals of all plans, 0 left or 1 right."""
    return [HANDS.index(movements[0].hand) for plan in plans for movements in plan]


def _ticks_of(records: TrialRecords) -> Array:
    """Return the ticks of trials, shape ``(N,)``; NaN for a trial that failed."""
    return np.where(records.counts[:, FAILURES] > 0, np.nan, records.counts[:, TICKS])


def _execute_exactly(
    compiled: CompiledTask, plans: Sequence[Plan]
) -> tuple[list[list[list[Movement | None]]], Array]:
    """Execute plans without noise, and find out which movements are aimed movements.

    A corrective movement with a target is treated as a correction if the corrective process,
    starting from the configuration in which the robot then stands, finds this target to within
    1e-9. Otherwise, and if the process does not converge, the movement is treated as an aimed
    movement.

    Returns
    -------
    list
        For each plan and goal, the aimed movements before the corrective process acts; None stands
        for a check whether the hand is in the goal.
    ndarray, shape (K,)
        Ticks of each plan; NaN if it fails.
    """
    kept = [[0] * len(plan) for plan in plans]  # corrective movements that are aimed, by goal
    aims = [[_with_targets(movements, 0) for movements in plan] for plan in plans]
    ticks, due = np.empty(len(plans)), [*range(len(plans))]
    while due:
        aims_due, hands = [aims[k] for k in due], _hands_of([plans[k] for k in due])
        records = make_trials(compiled, *_requested(compiled, aims_due, hands))
        ticks[due] = _ticks_of(records)
        changed = []
        for n, k in enumerate(due):
            for g, goal in enumerate(records.goals[n, :, 0]):
                after = [m for m in plans[k][g] if m.kind == "corrective"][kept[k][g] :]
                target = after[0].target if after else None
                if target is not None and not _is_found(goal, target):
                    kept[k][g] += 1
                    aims[k][g] = _with_targets(plans[k][g], kept[k][g])
                    changed.append(k)
                    break
                if not goal["hit"]:
                    break
        due = changed
    return aims, ticks


def _is_found(goal: np.void, target: Array) -> bool:
    """Return whether the corrective process itself finds the target of a corrective movement.

    ``goal`` is the record of the goal in an execution in which the process acts in place of the
    corrective movement to ``target``. Entries of ``target`` that are NaN are not compared. The
    result is also True if the goal is hit before a correction is made.
    """
    if goal["corrections"] == 0:
        return bool(goal["hit"])
    differences = np.abs(goal["corrected"][: len(target)] - target)
    return bool(np.nanmax(differences) <= STAYS)


def _plan_of(task: Task, number: int, solution: Iterable[Movement]) -> Plan:
    """Return the movements of ``solutions[number]`` for each goal.

    Raises SolutionError, whose message contains ``number``, if the solution breaks the task's
    rules.
    """
    try:
        return movements_by_goal(task, solution)
    except SolutionError as error:
        raise SolutionError(f"solutions[{number}]: {error}") from None


def _check_ticks(task: Task, number: int, plan: Plan, ticks: float) -> None:
    """Check that a solution's stored ticks are those of its execution without noise.

    The sum of the ticks that are stored with the movements is compared with ``ticks``, the ticks of
    the execution (NaN if the execution fails). Nothing is checked if a movement has no stored
    ticks. Raises SolutionError if the two numbers differ; ``number`` is the index of the solution
    in the error message.
    """
    stored = [movement.ticks for movements in plan for movement in movements]
    counts = [count for count in stored if count is not None]
    if len(counts) == len(stored) and sum(counts) != ticks:
        outcome = "it fails" if np.isnan(ticks) else f"they take {ticks:.0f}"
        raise SolutionError(
            f"solutions[{number}]: its movements took {sum(counts)} ticks; on task {task.name!r}, "
            f"with this model and without noise, {outcome}. Is the solution of another task?"
        )


def _seeds(seed: Any, count: int) -> list[int]:
    """Return a list with the noise seed of each of ``count`` solutions.

    ``seed`` is one seed for all solutions, or a seed for each. Raises ValueError for other seeds.
    """
    seeds = [*seed] if isinstance(seed, Iterable) else [seed] * count
    if len(seeds) != count:
        raise ValueError(
            f"seed has {len(seeds)} entries; it must have one for each of the {count} solutions"
        )
    for value in seeds[:1] if not isinstance(seed, Iterable) else seeds:
        check_limits("seed", value, 0, MAX_RUN_SEED)
    return [int(value) for value in seeds]


# ---- The corrective process on its own, and initial hands ----


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
        The task cannot be used, or ``task`` or ``model`` has a wrong type.
    ValueError
        The hands do not fit the task, a constant of the model is out of bounds, or the model has
        motor noise.

    Notes
    -----
    Source: paper, section *The Corrective Process*.
    """
    task = as_task(task)
    hands = check_hands(task, hands)
    return execute(task, corrective_movements(hands), model=model)


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
        The sequences, such as ``"LLLR"``, in alphabetical order. A sequence has one letter for each
        of G goals. With two hands there are 2^G sequences.

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

    If the task names a sequence, that sequence is returned. If the task names a policy, one trial
    with only the corrective process is made with each candidate sequence, and the sequence with the
    highest reward is returned. The candidates are

    - ``"best-single-hand"``: the sequences of one hand;
    - ``"best-of-all"``: all sequences.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    hands : tuple of {"left", "right"}, optional
        The hands among which a policy chooses; the task's by default.
    model : MotionModel
        The motion model. Its motor noise is ignored in the search.

    Returns
    -------
    str
        The hand for each goal, such as ``"RRRR"``.

    Raises
    ------
    TaskError, TypeError
        The task cannot be used, or ``task`` or ``model`` has a wrong type.
    NotApplicableError
        No sequence that was tried completes the task, or there are more than 4096 sequences to try.
    ValueError
        ``hands`` is empty or names a hand that the task does not have, or a constant of the model
        is out of bounds.

    Notes
    -----
    Source: paper, section *Experiments*.

    Examples
    --------
    >>> initial_hands("ascending")
    'RRR'
    """
    task = as_task(task)
    return search_initial_hands(task, hands, model=check_model(model))[0]


def initial_reward(task: Task, model: MotionModel = PAPER) -> int | None:
    """Return the reward of the trial with only the corrective process and the initial hands.

    The motor noise of ``model`` is ignored. The result is None if the trial fails, or if the task
    names a policy that finds no hands (:func:`initial_hands`).
    """
    try:
        hands = initial_hands(task, model=model)
    except NotApplicableError:
        return None
    return corrective_trial(task, hands, model=model.without_noise()).reward
