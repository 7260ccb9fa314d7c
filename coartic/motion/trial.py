"""Trials: the rule that executions, learners and environments follow, goal by goal.

A run is one of many robots that make trials side by side. At each goal it passes through five
phases (paper, sections *Generating Movement for Each Goal* and *The Corrective Process*):

1. *begin*: the run's next goal is set.
2. *aim*: a hand and perhaps a target are chosen. Callers differ in how they choose.
3. *move*: the robot moves to the target. Without a target it only checks whether its hand is in the
   goal already.
4. *correct*: if the goal is missed, the corrective process **A** looks for a configuration that
   hits it, and the robot moves there.
5. *account*: what happened is written down. The trial goes on if the goal is hit.

Two loops consist of these phases: :func:`reach_kernel` moves to given targets, and
:mod:`coartic.learner.kernel` explores around learned targets. The result of a run depends neither
on the other runs nor on their number.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.internal.arguments import Numbers, checked_arguments
from coartic.internal.limits import brief_value, check_limits
from coartic.internal.text import counted
from coartic.internal.threads import in_parts
from coartic.model import PAPER, MotionModel, check_model
from coartic.motion.batch import (
    SLOTS,
    Batch,
    RobotRecord,
    RunRecord,
    arm_of,
    batch_for,
    load,
    robot_parameters,
    start,
    width_of,
)
from coartic.motion.compile import entry, fill_row, inlined, record_type, shared
from coartic.motion.correction import correct_slots, pull_slots
from coartic.motion.movement import (
    LARGEST_ENTRY,
    check_goal,
    configuration,
    finite_array,
    move_slots,
)
from coartic.robot import HANDS, Array, Configs, Hands, Points, Robot
from coartic.tasks.task import Task, check_hands, hands_of

IDLE, CHECK, MOVE, REPEAT = range(4)
"""Next action of a run:

- ``IDLE``: none;
- ``CHECK``: check whether the hand is in the goal;
- ``MOVE``: move to the target, and end on a hit or on arrival;
- ``REPEAT``: make a corrective movement, which ends on a hit or at the target.
"""
COUNTED = (
    *("movement_ticks", "forward_kinematics", "corrective_iterations"),
    *("corrections", "failed_trials"),
)
"""Counters of :class:`~coartic.method.Meter` that the kernels update: the columns of counts."""
TICKS, EVALUATIONS, ITERATIONS, CORRECTIONS, FAILURES = range(len(COUNTED))
GoalAccount = Any
"""Record of what happened at a goal (:func:`account_type`)."""


@cache
def account_type(width: int) -> np.dtype[np.void]:
    """Return the NumPy type of the account of a goal in a trial.

    Configurations have ``width`` entries. If there are several movements to targets for a goal,
    each has a record with its ``target`` and ``moved``; all other fields are in the first record.
    """
    fields = {
        "q": (np.float64, width),  # where the robot is afterwards, in length units and rad
        "target": (np.float64, width),  # of the movement; as requested if it is not made
        "corrected": (np.float64, width),  # target of the corrective movement, if one is made
        "moved": np.int64,  # ticks of the movement to the target, 0 if it is not made
        "hand": np.int64,
        "hit": np.bool_,
        "ticks": np.int64,  # of all movements
        "corrections": np.int64,  # 1 if a corrective movement is made
        "iterations": np.int64,  # of the corrective process
        "evaluations": np.int64,  # of forward kinematics
        "failed": np.bool_,  # True if the trial ends here because the goal is missed
    }
    return record_type(fields)


# ---- The five phases ----


@inlined
def set_off(run: RunRecord, q: Any) -> None:
    """Start the trial of a run at configuration ``q``, shape ``(dof,)``, in place.

    ``going`` becomes True and ``evaluations`` 0. Other fields stay.
    """
    fill_row(run.q, q)
    run.going, run.evaluations = True, 0


@inlined
def begin(run: RunRecord, goal: Any) -> None:
    """Set the next goal of a run, x and y, in place: phase 1, *begin*.

    The target becomes the present configuration, ``hit`` False and ``corrects`` True. The next
    action is to check whether the hand is in the goal, or none if the trial has ended.
    """
    fill_row(run.goal, goal)
    fill_row(run.target, run.q)
    run.action = CHECK if run.going else IDLE
    run.hit, run.corrects = False, True


@inlined
def aim(run: RunRecord, target: Any) -> None:
    """Set the target of a run, in place: phase 2, *aim*.

    Where an entry of ``target`` is NaN, base or joint stays. Unless all entries are NaN, the next
    action becomes to move. ``target`` has at least ``dof`` entries.
    """
    for j in range(len(target)):
        if not math.isnan(target[j]):
            run.target[j] = target[j]
            run.action = MOVE


@inlined
def move_runs(count: int, robot: RobotRecord, batch: Batch) -> None:
    """Let each of the first ``count`` runs do its ``action``: phase 3, *move*.

    :data:`IDLE` lists the actions. ``q``, ``hit``, ``ticks``, ``evaluations`` and ``acting`` change
    in place. Ticks are 0 if there is no movement.
    """
    for stops in (True, False):
        for i in range(count):
            run, action = batch.runs[i], batch.runs[i].action
            # CHECK is a movement to the present configuration.
            run.acting = action == MOVE if stops else action in (CHECK, REPEAT)
        _move_acting(count, stops, robot, batch)
    for i in range(count):
        if batch.runs[i].action < MOVE:
            batch.runs[i].ticks = 0


@inlined
def make_corrections(count: int, robot: RobotRecord, batch: Batch) -> None:
    """Move each run for which **A** converged to the configuration found: phase 4, *correct*.

    Only the first ``count`` runs of a batch are moved, and :func:`find_corrections` has to be
    called before. The movement ends as soon as the hand is in the goal, or at ``target``. ``ticks``
    of each run become the ticks of this movement, 0 if none is made.
    """
    for i in range(count):
        batch.runs[i].acting = batch.runs[i].converged
    _move_acting(count, False, robot, batch)


@inlined
def account(run: RunRecord, moved: int, goal: GoalAccount) -> None:
    """Write a run's result for its goal into an account: phase 5, *account*.

    ``moved`` is the number of ticks of the run's movements to targets. If the run missed its goal,
    its trial ends. The run's count of evaluations becomes 0.
    """
    fill_row(goal.q, run.q)
    goal.hand, goal.hit = run.hand, run.hit
    goal.ticks = moved + run.ticks
    goal.corrections, goal.iterations = run.converged, run.iterations
    goal.evaluations = run.evaluations
    if run.converged:
        fill_row(goal.corrected, run.target)
    goal.failed = run.going and not run.hit
    run.going, run.evaluations = run.hit, 0


@inlined
def count_goal(goal: GoalAccount, counts: Any) -> None:
    """Add the numbers in a goal's account to a trial's counts, in place.

    ``counts`` has shape ``(5,)``: ticks, evaluations, iterations, corrections and failures.
    """
    counts[TICKS] += goal.ticks
    counts[EVALUATIONS] += goal.evaluations
    counts[ITERATIONS] += goal.iterations
    counts[CORRECTIONS] += goal.corrections
    counts[FAILURES] += goal.failed


@shared
def _move_acting(count: int, stops: bool, robot: RobotRecord, batch: Batch) -> None:
    """Move each of the first ``count`` runs that is ``acting`` to its target, in place.

    A movement ends on a hit or at its target. With ``stops`` it also ends when the hand is near the
    position to which the target brings it.
    """
    slots, slot = batch.slots[0], 0
    for i in range(count):
        if batch.runs[i].acting:
            start(slots, slot, i, batch.runs[i], arm_of(robot, batch.runs[i].hand))
            slot += 1
    if slot > 0:
        move_slots(batch, slot, stops, robot)


@inlined
def _find_by(count: int, robot: RobotRecord, batch: Batch, descend: Any) -> None:
    """Let a corrective process set the ``target`` of each run that it applies to.

    The process applies to those of the first ``count`` runs that missed the goal, go on and may be
    corrected. ``descend`` is the kernel of the process **A**. In each of the first ``count`` runs
    ``converged`` becomes True if **A** converged, and ``ticks`` becomes 0.
    """
    slots, slot = batch.slots[0], 0
    for i in range(count):
        run = batch.runs[i]
        run.acting, run.converged = run.corrects and run.going and not run.hit, False
        run.ticks, run.iterations = 0, 0
        if run.acting:
            fill_row(run.target, run.q)
            load(slots, slot, i, run, arm_of(robot, run.hand))
            slot += 1
    descend(batch, slot, robot)


@shared
def find_corrections(count: int, robot: RobotRecord, batch: Batch) -> None:
    """Let the paper's corrective process **A** find targets for missed goals.

    :func:`_find_by` says for which runs, and what is set.
    """
    _find_by(count, robot, batch, correct_slots)


@shared
def find_pulled_corrections(count: int, robot: RobotRecord, batch: Batch) -> None:
    """Find targets as :func:`find_corrections` does, with **A** pulled to preferred postures."""
    _find_by(count, robot, batch, pull_slots)


# ---- Trials with given targets ----


class Requests(NamedTuple):
    """Movements that the kernel is to make: N arms reach for G goals each.

    There are M movements for each goal of an arm.
    """

    starts: Configs
    """Starting configurations, shape ``(N, dof)``, or ``(1, dof)`` if all arms start alike."""
    hands: Hands
    """Hand for each goal, 0 left or 1 right, shape ``(N, G)``."""
    targets: Configs
    """Targets, shape ``(N, G, M, dof)``, in length units and rad; NaN for entries that stay. The
    first movement for a goal is always made, further ones only while the goal is missed."""
    stops: NDArray[np.bool_]
    """True where the movement to a target ends on arrival as well, shape ``(N, G, M)``; empty if
    all movements do."""
    goals: Points
    """Centres of the goals, shape ``(N, G, 2)``, or ``(1, G, 2)`` if all arms have the same
    goals."""


ALL_STOP = np.empty((0, 0, 0), dtype=np.bool_)
"""Value of :attr:`Requests.stops` with which all movements end on arrival as well."""


NO_REWARD = -(2**63 - 1)
"""Reward of a failed trial where rewards are integers."""


class Accounts(NamedTuple):
    """Accounts of N trials with G goals."""

    goals: NDArray[np.void]
    """Accounts of the goals, shape ``(N, G, M)``: records (:func:`account_type`)."""
    counts: NDArray[np.int64]
    """Counts of the trials, by :data:`COUNTED`, shape ``(N, 5)``."""
    rewards: NDArray[np.int64]
    """Total rewards, shape ``(N,)``; :data:`NO_REWARD` where a trial failed."""


@inlined
def _are_within(targets: Any) -> bool:
    """Return whether no entry of a trial's targets is beyond :data:`LARGEST_ENTRY` in size.

    ``targets`` has shape ``(G, M, dof)``. NaN means that a joint stays, and counts as within the
    bound.
    """
    large = 0
    for g in range(targets.shape[0]):
        for m in range(targets.shape[1]):
            for j in range(targets.shape[2]):
                large += abs(targets[g, m, j]) > LARGEST_ENTRY
    return large == 0


@inlined
def _reach_lot(
    offset: int, count: int, arms: Any, robot: Any, goals: Any, counts: Any, batch: Any
) -> None:
    """Let ``count`` arms from index ``offset`` on reach for their goals, in place.

    ``count`` is at most the number of runs of ``batch``. ``arms`` are :class:`Requests`, and
    ``robot`` is a :data:`RobotRecord`. This function fills the accounts ``goals``, shape ``(N, G,
    M)``, and adds to ``counts``, shape ``(N, 5)``, which the caller sets to 0 before.
    """
    for i in range(count):
        n, run = offset + i, batch.runs[i]
        set_off(run, arms.starts[min(n, len(arms.starts) - 1)])
        run.going = _are_within(arms.targets[n])
        counts[n, FAILURES] = not run.going
    for g in range(arms.targets.shape[1]):
        for i in range(count):
            n, run = offset + i, batch.runs[i]
            begin(run, arms.goals[min(n, len(arms.goals) - 1), g])
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
                    if len(arms.stops) > 0 and not arms.stops[n, g, m]:
                        run.action = REPEAT
                else:
                    fill_row(noted, target)
            move_runs(count, robot, batch)
            for i in range(count):
                goals[offset + i, g, m].moved = batch.runs[i].ticks
        find_corrections(count, robot, batch)
        make_corrections(count, robot, batch)
        for i in range(count):
            n, moved = offset + i, 0
            for m in range(goals.shape[2]):
                moved += goals[n, g, m].moved
            account(batch.runs[i], moved, goals[n, g, 0])
            count_goal(goals[n, g, 0], counts[n])


@entry
def reach_kernel(robot: Any, goals: Any, counts: Any, rewards: Any, *arrays: Any) -> None:
    """Let every arm reach for its goals, as many at once as the batch holds.

    ``goals``, ``counts`` and ``rewards`` are the entries of :class:`Accounts`, filled in place; the
    caller sets ``counts`` to 0. ``arrays`` are the entries of :class:`Requests`, followed by the
    entries of a batch.
    """
    arms, batch = Requests(*arrays[:5]), Batch(*arrays[5:])
    count, room = len(arms.targets), len(batch.runs)
    for offset in range(0, count, room):
        _reach_lot(offset, min(room, count - offset), arms, robot[0], goals, counts, batch)
    for n in range(count):
        rewards[n] = -counts[n, TICKS] if counts[n, FAILURES] == 0 else NO_REWARD


SHARE = 14 * SLOTS
"""Smallest number of arms for a thread. Starting a thread takes as long as a hundred trials."""
_IDLE: defaultdict[int, list[Batch]] = defaultdict(list)
"""Batches that no thread uses, by :attr:`Robot.max_links`."""


def empty_accounts(robot: Robot, count: int, goals: int, moves: int = 1) -> Accounts:
    """Return new accounts of ``count`` trials.

    The accounts have ``goals`` goals, and ``moves`` movements to targets for each goal. The counts
    of the trials are 0; the caller fills in everything else.
    """
    return Accounts(
        np.empty((count, goals, moves), account_type(width_of(robot))),
        np.zeros((count, len(COUNTED)), dtype=np.int64),
        np.empty(count, dtype=np.int64),
    )


def reach(robot: Robot, arms: Requests, parameters: NDArray[np.void]) -> Accounts:
    """Let N arms reach for G goals each, in turn, and return their accounts.

    An arm that misses a goal makes no movement for later goals. A trial with a target beyond
    :data:`LARGEST_ENTRY` fails without a movement; nothing else is checked. ``parameters`` come
    from :func:`robot_parameters`. Many arms are divided among threads.
    """
    count, goals, moves, _ = arms.targets.shape
    accounts, idle = empty_accounts(robot, count, goals, moves), _IDLE[robot.max_links]

    def work(part: slice) -> None:
        requests, results = arms, accounts
        if part.stop - part.start < count:
            requests = Requests._make(a[part] if len(a) == count else a for a in arms)
            results = Accounts._make(array[part] for array in accounts)
        try:
            batch = idle.pop()  # no other thread gets it
        except IndexError:
            batch = batch_for(robot)
        reach_kernel(parameters, *results, *requests, *batch)
        idle.append(batch)

    in_parts(work, count, SHARE)
    return accounts


class Reached(NamedTuple):
    """Results of N arms that reached for a goal each (:func:`reach_goals`)."""

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
    """Forward-kinematics evaluations, shape ``(N,)``; a correction takes one more than its
    iterations."""


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
    """Let N arms reach for one goal each, side by side, from where they are.

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
        Targets of the first movements. An entry that is NaN keeps its value. An arm whose row is
        NaN has no target: only the corrective process acts. By default no arm has a target.
    checks : bool
        True if an arm without a target stays when its hand is in its goal already; False if the
        corrective process begins at once.
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
        A shape is wrong, a number outside ``targets`` is not finite or out of bounds, a hand is
        neither 0 nor 1, or the model does not fit the radius.

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
    check_limits("radius", radius, 1e-9, LARGEST_ENTRY)
    check_model(model, radius=radius)
    arms = Requests(
        starts=starts,
        hands=codes[:, None],
        targets=aims[:, None, None],
        stops=ALL_STOP,
        goals=finite_array("goals", goals, (count, 2))[:, None],
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
    """Parameters of the robot (:func:`coartic.motion.batch.robot_parameters`)."""
    model: MotionModel


_last_compiled: CompiledTask | None = None


def compiled_task(task: Task, model: MotionModel) -> CompiledTask:
    """Return a task with a model as arrays for the kernels.

    The arrays are cached: do not change them.

    Raises
    ------
    ValueError
        A constant of the model is out of bounds or does not fit the radius, or the task is an
        unchecked copy (``model_copy``) whose start or goals are wrong.
    TypeError
        The model is not a MotionModel.
    """
    global _last_compiled
    latest = _last_compiled  # another thread may replace it
    if latest is not None and latest.task is task and latest.model is model:
        return latest
    check_model(model, radius=task.radius)
    goals = [check_goal(goal, task.radius) for goal in task.goals]
    _last_compiled = compiled = CompiledTask(
        task=task,
        starts=configuration(task.robot, task.q0)[None],
        goals=np.array([goals], dtype=np.float64),
        parameters=robot_parameters(
            task.robot, task.radius, locked_base=task.locked_base, model=model
        ),
        model=model,
    )
    return compiled


# ---- Trials outside the session of a run: honest methods make none ----

_outside = 0


def count_trials(count: int) -> None:
    """Add ``count`` to the number of trials made outside the sessions of runs.

    :func:`trials_outside` returns that number. The session of a run subtracts its own trials.
    """
    global _outside
    _outside += count


def trials_outside() -> int:
    """Return the number of trials that :func:`count_trials` has counted in this process."""
    return _outside


def make_trials(
    compiled: CompiledTask,
    hands: Hands,
    targets: Configs,
    stops: NDArray[np.bool_] = ALL_STOP,
) -> Accounts:
    """Make N trials of a task, count them (:func:`count_trials`), and return their accounts.

    ``hands``, ``targets`` and ``stops`` are as in :class:`Requests`.
    """
    count_trials(len(targets))
    arms = Requests(compiled.starts, hands, targets, stops, compiled.goals)
    return reach(compiled.task.robot, arms, compiled.parameters)


def reason_of_failure(compiled: CompiledTask, goals: NDArray[np.void]) -> str:
    """Return a sentence on the first goal that a trial missed, or an empty string.

    ``goals`` are the accounts of the trial's goals, shape ``(G,)``.
    """
    if goals["hit"][-1]:
        return ""
    number = int(goals["hit"].argmin())
    goal = goals[number]
    return (
        f"goal {number + 1}: the corrective process did not converge with the "
        f"{HANDS[goal['hand']]} hand in {counted(int(goal['iterations']), 'iteration')}"
    )


class Trials(NamedTuple):
    """Results of N trials."""

    ticks: NDArray[np.int64]
    """Control ticks of each trial, shape ``(N,)``."""
    completed: NDArray[np.bool_]
    """True where every goal was hit, shape ``(N,)``."""
    corrections: NDArray[np.int64]
    """Corrective movements made, shape ``(N,)``."""
    iterations: NDArray[np.int64]
    """Iterations of the corrective process, one Jacobian each, shape ``(N,)``."""
    evaluations: NDArray[np.int64]
    """Forward-kinematics evaluations, shape ``(N,)``; a correction takes one more than its
    iterations."""
    targets: Configs
    """Targets of the movements made, shape ``(N, G, dof)``, in length units and rad. A row is NaN
    if no target was passed. For goals after a failure the row is the target as it was passed."""
    reached: Configs
    """Configuration when each goal was hit, shape ``(N, G, dof)``; NaN if it was not hit."""

    @property
    def rewards(self) -> Array:
        """Total reward of each trial, minus its ticks, shape ``(N,)``.

        The reward of a failed trial is -inf.
        """
        return np.where(self.completed, -self.ticks, -np.inf)


def trials_of(accounts: Accounts, dof: int) -> Trials:
    """Return the results of trials from their accounts.

    ``dof`` is the number of entries of a configuration. The arrays of the result, except
    ``completed``, are views of ``accounts``. This function changes ``accounts``: it sets
    ``accounts.goals["q"]`` to NaN at goals that were not hit. If there are several movements for a
    goal, only the first account of the goal is used.
    """
    goals, counts = accounts.goals[..., 0], accounts.counts
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
    """Return the hand for each goal of ``count`` trials, 0 left or 1 right.

    The shape is ``(count, G)``. Raises ValueError if the sequences do not fit the task, or if a
    list does not have ``count`` of them.
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
            f"hands has {counted(len(sequences), 'hand sequence')} for {counted(count, 'trial')}; "
            "it must have one for each"
        )
    rows = np.empty((count, len(task.goals)), dtype=np.int64)
    rows[:] = np.reshape([codes[sequence] for sequence in sequences], (-1, len(task.goals)))
    return rows
