"""The rule of trials, which executions, learners and environments share.

A run is one of many robots that make trials side by side. At each goal, a run passes through five
phases (paper, sections *Generating Movement for Each Goal* and *The Corrective Process*):

1. *begin*: the run's next goal is set.
2. *aim*: a hand and, usually, a target are chosen. How they are chosen depends on the caller.
3. *move*: the robot moves to the target. Without a target it only checks whether its hand is in the
   goal already; an option leaves out this check.
4. *correct*: if the goal is missed, the corrective process **A** looks for a configuration that
   hits the goal, and the robot moves to that configuration.
5. *record*: the results at the goal are recorded. The trial goes on if the goal is hit.

Two kernels consist of these phases: :func:`reach_kernel` moves to given targets, and
:mod:`coartic.learner.kernel` explores around learned targets. The result of a run depends neither
on the other runs nor on their number.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.motion.kernels.compile import entry, fill_row, inlined, record_type
from coartic.motion.kernels.correct import correct_runs
from coartic.motion.kernels.move import CHECK, IDLE, MOVE, follow_paths, move_runs
from coartic.motion.kernels.noise import hashed
from coartic.motion.kernels.slots import Batch, RobotRecord, RunRecord
from coartic.robot import MAX_ENTRY, Configs, Hands, Points

COUNTED = (
    *("movement_ticks", "forward_kinematics", "iterations"),
    *("corrections", "failed_trials"),
)
"""Names of what the kernels count, in the order of the columns of the arrays ``counts``. All but
the iterations of the corrective process are counters of :class:`~coartic.method.Meter`."""
TICKS, EVALUATIONS, ITERATIONS, CORRECTIONS, FAILURES = range(len(COUNTED))
GoalRecord = Any
"""Record with the results at one goal of a trial (:func:`goal_record_type`)."""


@cache
def goal_record_type(width: int) -> np.dtype[np.void]:
    """Return the NumPy dtype of the record of one goal in a trial.

    Configurations have ``width`` entries. If several movements are requested for a goal, there is a
    record for each of them. The fields ``target`` and ``moved`` are filled in each of these
    records, all other fields only in the first record.
    """
    fields = {
        "q": (np.float64, width),  # where the robot is afterwards, in length units and rad
        "target": (np.float64, width),  # of the movement, without noise; as requested if not made
        "corrected": (np.float64, width),  # last iterate of A, if a corrective movement is made
        "moved": np.int64,  # ticks of the movement to the target, 0 if it is not made
        "hand": np.int64,
        "hit": np.bool_,
        "ticks": np.int64,  # of all movements for the goal
        "corrections": np.int64,  # corrective movements made
        "iterations": np.int64,  # of the corrective process
        "evaluations": np.int64,  # of forward kinematics
        "failed": np.bool_,  # True if the trial ends here because the goal is missed
    }
    return record_type(fields)


# ---- The five phases ----


@inlined
def set_off(run: RunRecord, q: Any, seed: Any, draw: Any, robot: RobotRecord) -> None:
    """Start the trial of a run at configuration ``q``, shape ``(dof,)``, in place.

    ``q`` is copied into the run, ``going`` becomes True, and ``evaluations`` becomes 0. With motor
    noise, ``world`` becomes the hash of ``seed`` (64-bit seed of the noise) and ``draw`` (number of
    the noise draw). All other fields do not change.
    """
    fill_row(run.q, q)
    run.going, run.evaluations = True, 0
    if robot.model.motor_noise > 0.0:
        run.world = hashed(hashed(seed, 0), draw)


@inlined
def begin(run: RunRecord, number: int, goal: Any) -> None:
    """Set the next goal of a run, x and y, in place: phase 1, *begin*.

    ``number`` is the goal's number in the task, from 0. The target becomes the present
    configuration, ``hit`` becomes False, and ``corrects`` becomes True. The next action becomes
    :data:`CHECK`, or :data:`IDLE` if the trial has ended.
    """
    fill_row(run.goal, goal)
    fill_row(run.target, run.q)
    run.action = CHECK if run.going else IDLE
    run.number, run.made = number, 0
    run.hit, run.corrects = False, True


@inlined
def aim(run: RunRecord, target: Any) -> None:
    """Set the target of a run, in place: phase 2, *aim*.

    A coordinate whose entry of ``target`` is NaN does not move. The next action becomes
    :data:`MOVE`, unless all entries are NaN.
    """
    for j in range(len(target)):
        if not math.isnan(target[j]):
            run.target[j] = target[j]
            run.action = MOVE


@inlined
def record_goal(run: RunRecord, moved: int, goal: GoalRecord) -> None:
    """Write a run's results at its goal into a record: phase 5, *record*.

    ``moved`` is the number of ticks of the run's movements to targets. If the run missed its goal,
    its trial ends. The run's count of evaluations becomes 0.
    """
    fill_row(goal.q, run.q)
    goal.hand, goal.hit = run.hand, run.hit
    goal.ticks = moved + run.ticks
    goal.corrections, goal.iterations = run.corrections, run.iterations
    goal.evaluations = run.evaluations
    if run.corrections > 0:
        fill_row(goal.corrected, run.target)
    goal.failed = run.going and not run.hit
    run.going, run.evaluations = run.hit, 0


@inlined
def count_goal(goal: GoalRecord, counts: Any) -> None:
    """Add the numbers in a goal's record to a trial's counts, in place.

    ``counts`` has shape ``(5,)``: ticks, evaluations, iterations, corrections and failures.
    """
    counts[TICKS] += goal.ticks
    counts[EVALUATIONS] += goal.evaluations
    counts[ITERATIONS] += goal.iterations
    counts[CORRECTIONS] += goal.corrections
    counts[FAILURES] += goal.failed


# ---- Trials with given targets ----


class Requests(NamedTuple):
    """Requests for N trials with G goals, and M movements for each goal."""

    starts: Configs
    """Starting configurations, shape ``(N, dof)``, or ``(1, dof)`` for the same start of all
    trials."""
    hands: Hands
    """Hand for each goal, 0 left or 1 right, shape ``(N, G)``."""
    targets: Configs
    """Targets, shape ``(N, G, M, dof)``, in length units and rad; NaN for coordinates that do not
    move. If all entries of a target are NaN, there is no movement. The target of a path is its last
    waypoint. The first movement for a goal is always made, further movements only while the goal is
    missed."""
    movements: NDArray[np.int64]
    """Action and waypoints of each movement, shape ``(N, G, M, 3)``:

    - the action ``MOVE``, ``REPEAT`` or ``FOLLOW`` (:data:`coartic.motion.kernels.move.IDLE`);
    - for a path, the start and the end (exclusive) of its range of rows in ``waypoints``.

    The array is empty if the action of all movements is ``MOVE``.
    """
    waypoints: Configs
    """Waypoints of all paths, shape ``(W, dof)``."""
    goals: Points
    """Centres of the goals, shape ``(N, G, 2)``, or ``(1, G, 2)`` if the goals are the same for all
    trials."""
    first: int
    """Index in the task of the first goal of ``goals``, from 0."""
    worlds: NDArray[np.uint64]
    """Seed of the noise and number of the noise draw for each trial (:func:`.noise_draws`), shape
    ``(N, 2)``, or ``(1, 2)`` if they are the same for all trials."""


NO_REWARD = -(2**63 - 1)
"""Integer that stands for the reward of a failed trial in arrays of rewards."""


@inlined
def _are_within(targets: Any) -> bool:
    """Return whether all entries of the targets of a trial are from -1e5 to 1e5.

    The bound is :data:`MAX_ENTRY`. ``targets`` has shape ``(G, M, dof)``. NaN, which stands for a
    joint that does not move, is allowed.
    """
    large = 0
    for g in range(targets.shape[0]):
        for m in range(targets.shape[1]):
            for j in range(targets.shape[2]):
                large += abs(targets[g, m, j]) > MAX_ENTRY
    return large == 0


@inlined
def _reach_lot(
    offset: int, count: int, arms: Any, robot: Any, goals: Any, counts: Any, batch: Any
) -> None:
    """Make ``count`` of the requested trials, beginning with trial ``offset``, in place.

    ``arms`` is :class:`Requests`; each row of its arrays belongs to a trial. ``count`` is at most
    the number of runs of ``batch``, and ``robot`` is a :data:`RobotRecord`. This function fills the
    records ``goals``, shape ``(N, G, M)``, and adds to ``counts``, shape ``(N, 5)``. The caller has
    set ``counts`` to 0.
    """
    for i in range(count):
        n, run = offset + i, batch.runs[i]
        world = arms.worlds[min(n, len(arms.worlds) - 1)]
        start = arms.starts[min(n, len(arms.starts) - 1)]
        set_off(run, start, world[0], world[1], robot)
        run.going = _are_within(arms.targets[n])
        counts[n, FAILURES] = not run.going
    for g in range(arms.targets.shape[1]):
        for i in range(count):
            n, run = offset + i, batch.runs[i]
            begin(run, arms.first + g, arms.goals[min(n, len(arms.goals) - 1), g])
            run.hand = arms.hands[n, g]
            if not robot.checks:
                run.action = IDLE
        for m in range(arms.targets.shape[2]):
            for i in range(count):
                n, run = offset + i, batch.runs[i]
                target, noted = arms.targets[n, g, m], goals[n, g, m].target
                if m > 0:
                    fill_row(run.target, run.q)
                    run.action = IDLE
                if run.going and not run.hit:
                    aim(run, target)
                if run.action == MOVE:
                    fill_row(noted, run.target)
                    if len(arms.movements) > 0:
                        run.action = arms.movements[n, g, m, 0]
                else:
                    fill_row(noted, target)
            move_runs(count, robot, batch)
            if len(arms.waypoints) > 0:
                follow_paths(count, offset, arms.movements[:, g, m], arms.waypoints, robot, batch)
            for i in range(count):
                goals[offset + i, g, m].moved = batch.runs[i].ticks
        correct_runs(count, robot, batch)
        for i in range(count):
            n, moved = offset + i, 0
            for m in range(goals.shape[2]):
                moved += goals[n, g, m].moved
            record_goal(batch.runs[i], moved, goals[n, g, 0])
            count_goal(goals[n, g, 0], counts[n])


REQUESTED = len(Requests._fields)


@entry
def reach_kernel(robot: Any, goals: Any, counts: Any, rewards: Any, *arrays: Any) -> None:
    """Make the requested trials, as many at a time as the batch has runs.

    ``goals``, ``counts`` and ``rewards`` are the entries of
    :class:`~coartic.motion.trials.TrialRecords`. They are filled in place; the caller has set
    ``counts`` to 0. ``arrays`` are the entries of :class:`Requests`, followed by the entries of a
    batch.
    """
    arms, batch = Requests(*arrays[:REQUESTED]), Batch(*arrays[REQUESTED:])
    count, room = len(arms.targets), len(batch.runs)
    for offset in range(0, count, room):
        _reach_lot(offset, min(room, count - offset), arms, robot[0], goals, counts, batch)
    for n in range(count):
        rewards[n] = -counts[n, TICKS] if counts[n, FAILURES] == 0 else NO_REWARD
