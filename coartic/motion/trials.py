"""Make trials with given targets by the compiled kernels, and count the trials.

Sessions, objectives, executions and environments make their trials through this module. A kernel
makes many trials at once.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coartic.internal.arguments import Numbers, checked_arguments
from coartic.internal.limits import brief_value, check_limits
from coartic.internal.text import pluralize
from coartic.internal.threads import in_parts
from coartic.model import PAPER, MotionModel, check_exact, check_model
from coartic.motion.doors import check_goal, configuration, finite_array
from coartic.motion.kernels.noise import MAX_CORRECTIONS
from coartic.motion.kernels.slots import SLOTS, Batch, batch_for, robot_parameters, width_of
from coartic.motion.kernels.trial import (
    CORRECTIONS,
    COUNTED,
    EVALUATIONS,
    FAILURES,
    ITERATIONS,
    TICKS,
    Requests,
    goal_record_type,
    reach_kernel,
)
from coartic.motion.kernels.trial import NO_REWARD as NO_REWARD
from coartic.robot import HANDS, MAX_ENTRY, Array, Configs, Hands, Points, Robot
from coartic.tasks.task import Task, check_hands, hands_of, in_world


class TrialRecords(NamedTuple):
    """Per-goal records, counts and rewards of N trials with G goals."""

    goals: NDArray[np.void]
    """Per-goal records, a structured array of shape ``(N, G, M)`` (:func:`goal_record_type`). M is
    the number of requested movements for each goal."""
    counts: NDArray[np.int64]
    """Counts of the trials, shape ``(N, 5)``, columns in the order of :data:`COUNTED`."""
    rewards: NDArray[np.int64]
    """Total rewards, shape ``(N,)``; :data:`NO_REWARD` where a trial failed."""


SHARE = 14 * SLOTS
"""Smallest number of trials of a thread, if trials are divided among threads. Starting a thread
takes as long as about a hundred trials."""
_IDLE: defaultdict[int, list[Batch]] = defaultdict(list)
"""Pool of batches that no thread uses: a dict that maps :attr:`Robot.max_links` to a list of
batches."""


def empty_records(robot: Robot, count: int, goals: int, moves: int = 1) -> TrialRecords:
    """Allocate the records of trials.

    The counts of the trials are 0; the caller fills in everything else.

    Parameters
    ----------
    robot : Robot
    count : int
        Number of trials.
    goals : int
        Number of goals.
    moves : int
        Largest number of movements to targets for each goal.
    """
    return TrialRecords(
        np.empty((count, goals, moves), goal_record_type(width_of(robot))),
        np.zeros((count, len(COUNTED)), dtype=np.int64),
        np.empty(count, dtype=np.int64),
    )


ALL_MOVE = np.empty((0, 0, 0, 3), dtype=np.int64)
"""Value of :attr:`Requests.movements` for movements that all end on a hit or on arrival."""
NO_WAYPOINTS = np.empty((0, 0))
NO_NOISE = np.zeros((1, 2), dtype=np.uint64)
"""Value of :attr:`Requests.worlds` for trials without noise."""
PRACTICE, JUDGE = 0x70726163, 0x6A756467
"""Keys by which two different noise seeds are derived from the seed of a run: ``PRACTICE`` for the
trials of the method, and ``JUDGE`` for the executions that score its solution. So no solution is
scored on noise that occurred in the trials of the method."""


@lru_cache(maxsize=4096)
def noise_seed(seed: int, world: int = PRACTICE) -> int:
    """Derive the seed of the motor noise from the seed of a run.

    The noise seed is an integer from 0 to 2^64 - 1. It comes from a child of ``seed``
    (``numpy.random.SeedSequence``), so that the noise is independent of ``default_rng(seed)``.
    ``seed`` is from 0 to 2^128 - 1, and the key ``world`` is :data:`PRACTICE` or :data:`JUDGE`.
    """
    return int(np.random.SeedSequence(seed, spawn_key=(world,)).generate_state(1, np.uint64)[0])


def noise_draws(seeds: ArrayLike, draws: ArrayLike) -> NDArray[np.uint64]:
    """Combine the noise seeds and the noise draws of N trials, shape ``(N, 2)``.

    A row of the result contains the seed and the draw of a trial; the result is a value for
    :attr:`Requests.worlds`. ``seeds`` (from :func:`noise_seed`) and ``draws`` are integers, or
    arrays of shape ``(N,)``.
    """
    columns = np.asarray(seeds, np.uint64), np.asarray(draws, np.uint64)
    rows = np.empty((np.broadcast(*columns).size, 2), np.uint64)
    rows[:, 0], rows[:, 1] = columns
    return rows


def reach(robot: Robot, arms: Requests, parameters: NDArray[np.void]) -> TrialRecords:
    """Make N requested trials with G goals, and return the records.

    A trial ends at the first goal that is missed. A trial with a target beyond :data:`MAX_ENTRY`
    fails without a movement; nothing else is checked. ``arms`` are the requested trials, and
    ``parameters`` come from :func:`robot_parameters`. Many trials are divided among threads.
    """
    count, goals, moves, _ = arms.targets.shape
    records, idle = empty_records(robot, count, goals, moves), _IDLE[robot.max_links]

    def work(part: slice) -> None:
        requests, results = arms, records
        if part.stop - part.start < count:
            rows = {name: array[part] for name, array in arms._asdict().items()
                    if name not in ("waypoints", "first") and len(array) == count}  # fmt: skip
            requests = arms._replace(**rows)
            results = TrialRecords._make(array[part] for array in records)
        try:
            batch = idle.pop()  # no other thread gets it
        except IndexError:
            batch = batch_for(robot)
        reach_kernel(parameters, *results, *requests, *batch)
        idle.append(batch)

    in_parts(work, count, SHARE)
    return records


class Reached(NamedTuple):
    """Results of N reaches, each by one arm for one goal (:func:`reach_goals`)."""

    q: Configs
    """Configuration in which each arm ended, shape ``(N, dof)``, in length units and rad."""
    hit: NDArray[np.bool_]
    """True where the hand is in the goal, shape ``(N,)``."""
    ticks: NDArray[np.int64]
    """Control ticks of each arm's movements, shape ``(N,)``."""
    corrected: Configs
    """Target of each arm's corrective movement, shape ``(N, dof)``; NaN if none was made."""
    corrections: NDArray[np.int64]
    """Corrective movements made, 0 or 1, shape ``(N,)``."""
    iterations: NDArray[np.int64]
    """Iterations of the corrective process, one Jacobian each, shape ``(N,)``."""
    evaluations: NDArray[np.int64]
    """Forward-kinematics evaluations, shape ``(N,)``; a correction of k iterations takes k + 1."""


@checked_arguments
def reach_goals(
    robot: Robot,
    q: Numbers,
    hands: Numbers,
    goals: Numbers,
    radius: float,
    targets: Numbers | None = None,
    *,
    checks: bool = True,
    locked_base: Sequence[str] = (),
    model: MotionModel = PAPER,
) -> Reached:
    """Let each of N arms reach for its own goal, independently of the others.

    Parameters
    ----------
    robot : Robot
        The robot of all arms.
    q : ndarray, shape (N, dof)
        Configurations in which the arms start, in length units (base) and rad (joints).
    hands : ndarray of int, shape (N,)
        Hand of each arm: 0 left, 1 right.
    goals : ndarray, shape (N, 2)
        Centre of the goal of each arm, x and y in length units.
    radius : float
        Radius of all goals (in length units).
    targets : ndarray, shape (N, dof), optional
        Targets of the first movements, in length units and rad. A coordinate whose entry is NaN
        does not move. An arm whose row is all NaN has no target: only the corrective process acts.
        By default no arm has a target.
    checks : bool
        True if an arm without a target stays where it is when its hand is in its goal already;
        False if the corrective process begins at once.
    locked_base : sequence of {"x", "y"}
        Coordinates of the base that the corrective process does not change.
    model : MotionModel

    Returns
    -------
    Reached
        Where the arms ended, and the ticks and evaluations that this took. An arm with a target
        beyond 1e5 does not move, and does not hit its goal.

    Raises
    ------
    ValueError
        An argument cannot be used:

        - a type or a shape is wrong;
        - a number outside ``targets`` is not finite, or is beyond ±100,000;
        - the radius is below 1e-9;
        - a hand is neither 0 nor 1;
        - ``locked_base`` has an entry other than ``"x"`` and ``"y"``;
        - a constant of the model is out of bounds or does not fit the radius, or the model has
          motor noise.

    Notes
    -----
    Source: paper, sections *Generating Movement for Each Goal* and *The Corrective Process*.
    """
    count = len(np.atleast_2d(q))
    starts = finite_array("q", q, (count, robot.dof))
    aims = np.full(starts.shape, np.nan) if targets is None else np.array(targets, order="C")
    if aims.shape != starts.shape:
        raise ValueError(f"targets has shape {aims.shape}; it must be {starts.shape}")
    codes = finite_array("hands", hands, (count,)).astype(np.int64)
    if not (np.isin(codes, range(len(HANDS))) & (codes == hands)).all():
        raise ValueError(f"hands is {brief_value(hands)}; each entry must be 0 (left) or 1 (right)")
    check_limits("radius", radius, 1e-9, MAX_ENTRY)
    check_exact(model, radius=radius)
    arms = Requests(
        starts=starts,
        hands=codes[:, None],
        targets=aims[:, None, None],
        movements=ALL_MOVE,
        waypoints=NO_WAYPOINTS,
        goals=finite_array("goals", goals, (count, 2))[:, None],
        first=0,
        worlds=NO_NOISE,
    )
    locked = tuple(locked_base)
    parameters = robot_parameters(robot, radius, locked_base=locked, model=model, checks=checks)
    ended = reach(robot, arms, parameters).goals[:, 0, 0]
    ended["corrected"][ended["corrections"] == 0] = np.nan
    columns = [ended[name][..., : robot.dof] if name in ("q", "corrected") else ended[name]
               for name in Reached._fields]  # fmt: skip
    return Reached._make(map(np.ascontiguousarray, columns))


class CompiledTask(NamedTuple):
    """A task in the form that the kernels read (:func:`compiled_task`)."""

    task: Task
    starts: Configs
    """Configuration at the start of a trial, shape ``(1, dof)``, in length units and rad."""
    goals: Points
    """Centres of the goals, shape ``(1, G, 2)``."""
    parameters: NDArray[np.void]
    """Parameters of the robot (:func:`coartic.motion.kernels.slots.robot_parameters`)."""
    model: MotionModel
    options: tuple[bool, bool]
    """Values of the options ``checks`` and ``grows`` (:func:`compiled_task`)."""


_last_compiled: CompiledTask | None = None


def compiled_task(
    task: Task, model: MotionModel, *, checks: bool = True, grows: bool = False
) -> CompiledTask:
    """Convert a task and a motion model to arrays for the kernels.

    The last result is cached: do not change its arrays.

    Parameters
    ----------
    task : Task
    model : MotionModel
    checks : bool
        True if an arm without a target stays where it is when its hand is in its goal already;
        False if the corrective process begins at once.
    grows : bool
        True if the motor noise of aimed movements grows with their length.

    Returns
    -------
    CompiledTask

    Raises
    ------
    ValueError
        A constant of the model is out of bounds or does not fit the radius, or the task is an
        unchecked copy (``model_copy``) whose start or goals are wrong.
    TypeError
        The model is not a MotionModel.
    """
    global _last_compiled
    task = in_world(task, model) if isinstance(model, MotionModel) else task
    latest = _last_compiled  # another thread may replace it
    options = checks, grows
    if latest is not None and latest.task is task and latest.model is model:  # noqa: SIM102
        if latest.options == options:
            return latest
    model = check_model(model, radius=task.radius)
    goals = [check_goal(goal, task.radius) for goal in task.goals]
    _last_compiled = compiled = CompiledTask(
        task=task,
        starts=configuration(task.robot, task.q0)[None],
        goals=np.array([goals], dtype=np.float64),
        parameters=robot_parameters(
            task.robot,
            task.radius,
            locked_base=task.locked_base,
            model=model,
            checks=checks,
            grows=grows,
        ),
        model=model,
        options=options,
    )
    return compiled


# ---- Trials outside the session of a run ----

_outside = 0


def count_trials(count: int) -> None:
    """Add to the number of trials that this process made outside sessions of runs.

    The trials that the session of a run makes are added as well; the session then subtracts them by
    a negative ``count``. :func:`trials_outside` returns the number.
    """
    global _outside
    _outside += count


def trials_outside() -> int:
    """Return how many trials this process has made outside the sessions of runs.

    The number also includes trials that compiled methods of this project make in a run without
    their session. The runner uses the number only for other methods, for which a trial outside the
    session is an error.
    """
    return _outside


def make_trials(
    compiled: CompiledTask,
    hands: Hands,
    targets: Configs,
    movements: NDArray[np.int64] = ALL_MOVE,
    waypoints: Configs = NO_WAYPOINTS,
    worlds: NDArray[np.uint64] = NO_NOISE,
) -> TrialRecords:
    """Make N trials of a task, count the trials, and return their records.

    The trials are counted by :func:`count_trials`. All arguments are as in :class:`Requests`.
    Without motor noise ``worlds`` has no effect.
    """
    count_trials(len(targets))
    arms = Requests(
        compiled.starts, hands, targets, movements, waypoints, compiled.goals, 0, worlds
    )
    return reach(compiled.task.robot, arms, compiled.parameters)


def reach_next(
    compiled: CompiledTask,
    q: Configs,
    hands: Hands,
    targets: Configs,
    first: int,
    worlds: NDArray[np.uint64] = NO_NOISE,
) -> TrialRecords:
    """Continue a trial: let a robot reach for consecutive goals of a task.

    The trial is not counted.

    Parameters
    ----------
    compiled : CompiledTask
    q : ndarray, shape (1, dof)
        Present configuration of the robot, in length units and rad.
    hands, targets : ndarray
        Hands and targets, as in :class:`Requests`. The length of their second axis is the number of
        goals for which the robot reaches.
    first : int
        Index in the task of the first of these goals, from 0.
    worlds : ndarray of int, shape (1, 2)
        Noise seed and noise draw of the trial. Without motor noise they have no effect.

    Returns
    -------
    TrialRecords
        Records of these goals.
    """
    goals = compiled.goals[:, first : first + targets.shape[1]]
    arms = Requests(q, hands, targets, ALL_MOVE, NO_WAYPOINTS, goals, first, worlds)
    return reach(compiled.task.robot, arms, compiled.parameters)


def reason_of_failure(compiled: CompiledTask, goals: NDArray[np.void]) -> str:
    """Return a sentence on the first goal that a trial missed, or an empty string.

    ``goals`` are the per-goal records of the trial, shape ``(G,)``.
    """
    if goals["hit"][-1]:
        return ""
    number = int(goals["hit"].argmin())
    goal = goals[number]
    hand, corrections = HANDS[goal["hand"]], int(goal["corrections"])
    if corrections == MAX_CORRECTIONS:
        return f"goal {number + 1}: the {hand} hand misses it after {corrections} corrections"
    return (
        f"goal {number + 1}: the corrective process did not converge with the {hand} hand in "
        f"{pluralize(int(goal['iterations']), 'iteration')}"
    )


class Trials(NamedTuple):
    """Results of N trials of a task with G goals."""

    ticks: NDArray[np.int64]
    """Control ticks of each trial, shape ``(N,)``."""
    completed: NDArray[np.bool_]
    """True where every goal was hit, shape ``(N,)``."""
    corrections: NDArray[np.int64]
    """Corrective movements made, shape ``(N,)``."""
    iterations: NDArray[np.int64]
    """Iterations of the corrective process, one Jacobian each, shape ``(N,)``."""
    evaluations: NDArray[np.int64]
    """Forward-kinematics evaluations, shape ``(N,)``; a correction of k iterations takes k + 1."""
    targets: Configs
    """Targets of the movements, shape ``(N, G, dof)``, in length units and rad. A coordinate whose
    entry was passed as NaN has its value at the beginning of the movement. All entries of a goal
    are NaN if no target was passed for it. The entries of goals after a goal at which the trial
    failed are those that were passed."""
    reached: Configs
    """Configuration in which each goal was hit, shape ``(N, G, dof)``, in length units and rad; NaN
    for a goal that was not hit."""

    @property
    def rewards(self) -> Array:
        """Total reward of each trial, shape ``(N,)``: minus its ticks, or -inf if it failed."""
        return np.where(self.completed, -self.ticks, -np.inf)


def trials_of(records: TrialRecords, dof: int) -> Trials:
    """Return the results of trials from their records.

    ``dof`` is the number of entries of a configuration. The arrays of the result, except
    ``completed``, are views of ``records``. This function changes ``records``: it sets
    ``records.goals["q"]`` to NaN at goals that were not hit. If there are several movements for a
    goal, only the first record of the goal is used.
    """
    goals, counts = records.goals[..., 0], records.counts
    reached = goals["q"][..., :dof]
    if counts[:, FAILURES].any():
        reached[~goals["hit"]] = np.nan
    return Trials(
        ticks=counts[:, TICKS],
        completed=counts[:, FAILURES] == 0,
        corrections=counts[:, CORRECTIONS],
        iterations=counts[:, ITERATIONS],
        evaluations=counts[:, EVALUATIONS],
        targets=goals["target"][..., :dof],
        reached=reached,
    )


HandSequences = str | Sequence[str]
"""Hand sequences of N trials: one for all (``"RRLR"``), or a list of N."""


def hand_codes(task: Task, hands: HandSequences, count: int) -> Hands:
    """Return hand sequences as integer codes (0 left, 1 right), shape ``(count, G)``.

    ``hands`` is one sequence for all trials, or one sequence for each of ``count`` trials. Raises
    ValueError if a sequence does not fit the task, or if the number of sequences in a list is not
    ``count``.
    """
    is_list = isinstance(hands, Iterable) and not isinstance(hands, str)
    sequences: list[Any] = list(hands) if is_list else [hands]
    codes = dict[str, list[int]]()
    for sequence in sequences:
        if not isinstance(sequence, str) or sequence not in codes:
            chosen = hands_of(check_hands(task, sequence))
            codes[sequence] = [HANDS.index(hand) for hand in chosen]
    if is_list and len(sequences) != count:
        raise ValueError(
            f"hands has {pluralize(len(sequences), 'hand sequence')} for "
            f"{pluralize(count, 'trial')}; it must have one for each"
        )
    rows = np.empty((count, len(task.goals)), dtype=np.int64)
    if sequences:
        rows[:] = [codes[sequence] for sequence in sequences]
    return rows
