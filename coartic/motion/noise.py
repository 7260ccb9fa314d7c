"""Motor noise: execute solutions whose movements miss their targets at random.

:func:`execute_noisy` makes the movements of a solution as :func:`coartic.execute` does, except that
each movement ends near its target instead of at it. Robots that execute the same solution, each
with its own noise, move side by side. Compiled kernels make straight movements and corrections;
paths are followed one after the other.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.errors import SolutionError
from coartic.internal.limits import MOST_RUN_SEED, MOST_RUNS, brief_value, check_limits
from coartic.model import PAPER, MotionModel
from coartic.motion.batch import SLOTS, Batch, arm_of, batch_for, load, start
from coartic.motion.compile import entry, fill_row
from coartic.motion.correction import correct_slots
from coartic.motion.movement import follow, move_slots
from coartic.motion.solution import Movement, Plan, movements_by_goal
from coartic.motion.trial import MOVE, REPEAT, CompiledTask, compiled_task, count_trials
from coartic.robot import BASE_DOF, HANDS, Array, Configs, Hand
from coartic.tasks.catalogue import TaskLike, as_task
from coartic.tasks.task import Task

Flags = NDArray[np.bool_]
MOST_CORRECTIONS = 50
"""Largest number of corrective movements for one goal. An execution with noise that needs more
fails."""
_MOST_NOISE = 100.0  # standard deviation, in length units and rad
_STAYS = 1e-9  # change up to which a coordinate does not move, in length units or rad
_FIND, _FOLLOW = 4, 5  # further actions: find a correction, follow a path
_ACTIONS = {"learned": MOVE, "planned": MOVE, "corrective": REPEAT, "path": _FOLLOW}


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

    Each movement misses its target at random. If a goal is missed, the corrective process corrects
    it until it is hit; corrections have noise as well. All other rules are as in
    :func:`coartic.execute`.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    solutions : iterable of iterables of Movement
        K solutions of the task, as a list even if there is only one.
    motor_noise : float
        Standard deviation s of the noise, from 0 to 100, in length units (base) and rad (joints).
        With 0 the ticks are the same as in :func:`coartic.execute`.
    repeats : int
        Number R of executions of each solution.
    seed : int or iterable of int
        A seed for each solution, or one seed, whose child k (``SeedSequence.spawn``) is the seed of
        solution k. The ticks of a solution depend on its own seed and on ``repeats``, but not on
        the other solutions.
    model : MotionModel
    signal_dependent : bool
        True if the noise of aimed movements grows with their length. The noise of corrections
        always does.

    Returns
    -------
    ndarray, shape (K, R)
        Control ticks of each execution; NaN if it failed, because the corrective process did not
        converge or the goal was still missed after 50 corrections. If a solution has failures,
        report their number as well, because the mean over its other executions is too low.

    Raises
    ------
    TaskError, TypeError
        The task cannot be used, or an argument has another type.
    SolutionError
        A solution breaks the task's rules, as in :func:`coartic.execute`. Or its movements have
        other ticks than they take on this task with this model, for example because the solution is
        of another task.
    ValueError
        ``motor_noise``, ``repeats``, ``seed`` or a constant of the model is out of bounds, or the
        number of seeds is not the number of solutions.

    Notes
    -----
    The robot stands at q. Coordinate c of a noisy target is, with standard normal numbers z::

        aimed movement         t_c + s z_c              if c moves, else q_c
        waypoint k of K        w_kc + (k / K) s z_c     if c moves, else q_c
        correction             a_c + s min(1, L) z_c    for base and chosen arm, else a_c

    - An *aimed movement* has the target t: it is learned or planned. A path has the waypoints w_1
      to w_K and one z; it is not steered while it is made (open loop).
    - A coordinate *moves* if the target, or any waypoint, differs by more than 1e-9 from where the
      robot stands at this movement in the execution without noise. A locked base does not move.
    - A *correction* has as target the configuration a that the corrective process finds from q,
      even if the solution has a corrective movement with a target. L is the Euclidean distance from
      q to a. A locked base coordinate keeps a_c.
    - With ``signal_dependent`` all three rows have s min(1, L) instead of s. L is the distance from
      q to the target without noise, for a path to its last waypoint.
    - The noisy target counts as the target everywhere: for the hit, for the arrival of an aimed
      movement, and for the tick that this costs.
    - A corrective movement is an aimed movement that ends on a hit or at its target if, in the
      execution without noise, its target differs by more than 1e-9 from the target of the
      corrective process.

    A solution draws from ``numpy.random.default_rng`` of its seed: for its aimed movements and
    paths in shape (R, movements, dof); then for each goal, for its first, second, ... correction,
    ``dof`` numbers for each repeat that makes this correction.

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
    check_limits("motor_noise", motor_noise, 0.0, _MOST_NOISE)
    check_limits("repeats", repeats, 1, MOST_RUNS)
    if not isinstance(signal_dependent, bool | np.bool_):
        raise TypeError(f"signal_dependent is {brief_value(signal_dependent)}; it must be a bool")
    if not isinstance(solutions, Iterable):
        raise TypeError(f"solutions is {brief_value(solutions)}; it must be a list of solutions")
    compiled = compiled_task(as_task(task), model)
    plans = [_plan_of(compiled.task, k, solution) for k, solution in enumerate(solutions)]
    generators = _generators(seed, len(plans))
    exact, robots = _Robots(compiled, 1), _Robots(compiled, int(repeats))
    ticks = np.empty((len(plans), robots.count))
    for k, (plan, rng) in enumerate(zip(plans, generators, strict=True)):
        aims = _execute_exactly(exact, plan)
        _check_ticks(compiled.task, k, plan, exact.ticks[0])
        ticks[k] = exact.ticks
        if motor_noise > 0.0:
            _execute_noisily(robots, plan, aims, _Noise(float(motor_noise), signal_dependent, rng))
            ticks[k] = robots.ticks
    count_trials(len(plans) * (1 + robots.count))
    return ticks


class _Aim(NamedTuple):
    """Movement to a target of the solution, or along its waypoints."""

    action: int
    """How the movement is made: ``MOVE``, ``REPEAT`` (corrective) or ``_FOLLOW`` (a path)."""
    points: Configs
    """The target, shape ``(1, dof)``, or the K waypoints, ``(K, dof)``, in length units and rad."""
    moves: Flags
    """True where a coordinate moves, shape ``(dof,)``."""


class _Noise(NamedTuple):
    """Motor noise of a solution."""

    sd: float
    """Standard deviation s, in length units and rad."""
    grows: bool
    """True if the noise of aimed movements grows with their length."""
    rng: np.random.Generator


class _Robots:
    """Robots that execute the same solution of a task side by side."""

    def __init__(self, compiled: CompiledTask, count: int) -> None:
        """Make ``count`` robots for a task."""
        self.compiled, self.count = compiled, count
        self.batch = batch_for(compiled.task.robot, count)
        runs, dof = self.batch.runs, compiled.task.robot.dof
        self.q: Configs = runs["q"][:, :dof]
        """Where each robot stands, shape ``(count, dof)``, in length units and rad."""
        self.targets: Configs = runs["target"][:, :dof]
        """Target of each robot, in the same shape and units."""
        self.hit: Flags = runs["hit"]
        """True where the hand is in the present goal, shape ``(count,)``."""
        self.ticks = np.zeros(count)
        """Ticks of each execution so far, shape ``(count,)``; NaN once it has failed."""

    def goals(self, plan: Plan) -> Iterator[tuple[int, list[Movement]]]:
        """Start at the task's start, and yield each goal's index with the movements for it.

        When an index is yielded, this goal is the present goal. The caller makes the movements
        before it goes on.
        """
        runs, task = self.batch.runs, self.compiled.task
        self.q[:], self.ticks[:] = task.q0, 0.0
        for index, movements in enumerate(plan):
            runs["goal"], runs["hand"] = task.goals[index], HANDS.index(movements[0].hand)
            self.hit[:] = False
            if movements[0].kind == "corrective":  # the hand may be in the goal already
                self.targets[:] = self.q
                self.act(REPEAT, self.due)
            yield index, movements

    @property
    def due(self) -> Flags:
        """True for the robots that have not failed and have not yet hit the present goal, shape
        ``(count,)``."""
        return ~self.hit & ~np.isnan(self.ticks)

    def aim(self, aim: _Aim, misses: Array) -> None:
        """Move the robots that are :attr:`due`, as ``aim`` says.

        Row n of ``misses``, shape ``(count, dof)``, is added to the target of robot n in the
        coordinates that move. On a path, waypoint k of K is shifted by k/K of the row.
        """
        if aim.action != _FOLLOW:
            self.targets[:] = np.where(aim.moves, aim.points + misses, self.q)
            self._move(aim.action)
            return
        task, count = self.compiled.task, len(aim.points)
        shares = np.arange(1, count + 1)[:, None] / count
        for n in np.flatnonzero(self.due):
            run, q = self.batch.runs[n], self.q[n]
            points = np.where(aim.moves, aim.points + shares * misses[n], q)
            hand, goal = HANDS[run["hand"]], tuple(run["goal"])
            model = self.compiled.model
            result = follow(task.robot, q, points, hand, goal, task.radius, model=model)
            self.q[n], self.hit[n] = result.q, result.hit
            self.ticks[n] += result.ticks

    def correct(self, hand: Hand, noise: _Noise) -> None:
        """Correct the robots that are :attr:`due` until they hit the goal.

        An execution fails if the corrective process does not converge, or after 50 corrections.
        """
        task = self.compiled.task
        free = np.zeros(task.robot.dof, dtype=np.bool_)
        free[:BASE_DOF] = [axis not in task.locked_base for axis in "xy"]
        free[task.robot.joints(hand)] = True
        for _ in range(MOST_CORRECTIONS):
            if not self.due.any():
                return
            due = self.due
            self.act(_FIND, due)
            self.ticks[due & ~self.batch.runs["converged"]] = np.nan
            due = self.due
            targets = self.targets[due]
            misses = noise.sd * noise.rng.standard_normal(targets.shape)
            self.targets[due] = targets + free * misses * _scale(targets - self.q[due])
            self._move(REPEAT)
        self.ticks[self.due] = np.nan

    def _move(self, action: int) -> None:
        """Move the robots that are :attr:`due` straight to their targets, and count the ticks."""
        due = self.due
        self.act(action, due)
        self.ticks[due] += self.batch.runs["ticks"][due]

    def act(self, action: int, due: Flags) -> None:
        """Let the robots that are ``due``, shape ``(count,)``, act (:func:`_act_kernel`)."""
        self.batch.runs["acting"] = due
        _act_kernel(action, self.compiled.parameters, self.batch)


def _execute_exactly(robot: _Robots, plan: Plan) -> list[list[_Aim]]:
    """Execute a solution with one robot and without noise, and return its aimed movements.

    The list has, for each goal, the movements before the corrective process acts, with the
    coordinates that they move.
    """
    aims = list[list[_Aim]]()
    exactly = _Noise(0.0, False, np.random.default_rng(0))
    for index, movements in robot.goals(plan):
        aims.append([])
        for movement in movements:
            if movement.kind == "corrective" and _is_by_process(robot, movement):
                break
            corners = movement.target if movement.waypoints is None else movement.waypoints
            points = np.atleast_2d(np.asarray(corners, dtype=np.float64))
            moves = np.abs(points - robot.q).max(axis=0) > _STAYS
            aim = _Aim(_ACTIONS[movement.kind], points, moves)
            robot.aim(aim._replace(moves=np.ones_like(moves)), np.zeros(robot.q.shape))
            aims[index].append(aim)
        robot.correct(movements[0].hand, exactly)
    return aims


def _is_by_process(robot: _Robots, movement: Movement) -> bool:
    """Return whether a corrective movement has the target that the corrective process finds.

    The process begins where the robot stands. The targets count as the same if no coordinate
    differs by more than 1e-9. The result is also True if the movement has no target or is not made.
    """
    if movement.target is None or not robot.due[0]:
        return True
    robot.act(_FIND, robot.due)
    converged = bool(robot.batch.runs["converged"][0])
    return converged and bool(np.abs(robot.targets - movement.target).max() <= _STAYS)


def _execute_noisily(robots: _Robots, plan: Plan, aims: list[list[_Aim]], noise: _Noise) -> None:
    """Execute a solution with noise, from its aimed movements by goal."""
    shape = (robots.count, sum(map(len, aims)), robots.q.shape[1])
    draws = iter(np.moveaxis(noise.rng.standard_normal(shape), 1, 0))
    for index, movements in robots.goals(plan):
        for aim in aims[index]:
            misses = noise.sd * next(draws)
            if noise.grows:
                misses *= _scale(np.where(aim.moves, aim.points[-1], robots.q) - robots.q)
            robots.aim(aim, misses)
        robots.correct(movements[0].hand, noise)


def _scale(changes: Array) -> Array:
    """Return min(1, L), shape ``(N, 1)``, for the lengths L of ``changes``, shape ``(N, dof)``."""
    squares = np.cumsum(changes * changes, axis=1)[:, -1:]  # added in the order of coordinates
    return np.minimum(1.0, np.sqrt(squares))


@entry
def _act_kernel(action: int, robot: NDArray[np.void], batch: Batch) -> None:
    """Let the runs whose ``acting`` is True act, 72 at a time, in place.

    - ``MOVE``: move straight to the target, and stop on a hit or on arrival;
    - ``REPEAT``: move straight to the target, and stop on a hit;
    - ``_FIND``: set the target to where the corrective process ends, and set ``converged``.

    ``robot`` comes from :func:`coartic.motion.batch.robot_parameters`.
    """
    slots, slot, last_run = batch.slots[0], 0, len(batch.runs) - 1
    for i in range(len(batch.runs)):
        run = batch.runs[i]
        if run.acting:
            arm = arm_of(robot[0], run.hand)
            if action == _FIND:
                fill_row(run.target, run.q)
                load(slots, slot, i, run, arm)
            else:
                start(slots, slot, i, run, arm)
            slot += 1
        if slot == SLOTS or (i == last_run and slot > 0):
            if action == _FIND:
                correct_slots(batch, slot, robot[0])
            else:
                move_slots(batch, slot, action == MOVE, robot[0])
            slot = 0


def _plan_of(task: Task, number: int, solution: Iterable[Movement]) -> Plan:
    """Return the movements of ``solutions[number]`` by goal.

    Raises SolutionError if the solution breaks the task's rules.
    """
    try:
        return movements_by_goal(task, solution)
    except SolutionError as error:
        raise SolutionError(f"solutions[{number}]: {error}") from None


def _check_ticks(task: Task, number: int, plan: Plan, ticks: float) -> None:
    """Check that a solution's movements have the ticks that they take without noise.

    ``ticks`` is the number that they take, or NaN if the execution fails. Nothing is checked if a
    movement has no ticks. Raises SolutionError if the numbers differ.
    """
    stored = [movement.ticks for movements in plan for movement in movements]
    counts = [count for count in stored if count is not None]
    if len(counts) == len(stored) and sum(counts) != ticks:
        outcome = "it fails" if np.isnan(ticks) else f"they take {ticks:.0f}"
        raise SolutionError(
            f"solutions[{number}]: its movements took {sum(counts)} ticks; on task {task.name!r}, "
            f"with this model and without noise, {outcome}. Is the solution of another task?"
        )


def _generators(seed: Any, count: int) -> list[np.random.Generator]:
    """Return a new random generator for each of ``count`` solutions.

    ``seed`` is a seed for each solution, or one seed for all. Raises ValueError for other seeds.
    """
    if not isinstance(seed, Iterable):
        check_limits("seed", seed, 0, MOST_RUN_SEED)
        return [*map(np.random.default_rng, np.random.SeedSequence(int(seed)).spawn(count))]
    seeds = [*seed]
    if len(seeds) != count:
        raise ValueError(
            f"seed has {len(seeds)} entries; it must have one for each of the {count} solutions"
        )
    for value in seeds:
        check_limits("seed", value, 0, MOST_RUN_SEED)
    return [np.random.default_rng(int(value)) for value in seeds]
