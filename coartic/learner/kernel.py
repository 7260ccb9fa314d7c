"""The dual-process learner: trial and error on top of the corrective process.

This module implements the paper's section *The Learning Process* and Figure 3. At each goal of a
trial, the learner chooses a hand, perturbs the target configuration that is stored for this hand,
and moves to it. If the hand misses the goal, the corrective process **A** moves it into the goal
(:mod:`coartic.motion.kernels.trial`).

The learner stores a table keyed by state (the goal and the previous hand) and hand. An entry
consists of the value Q and the target q*. In each state that a completed trial passed through, the
trial is compared with all earlier completed trials that chose the same hand in this state. They are
compared by their total rewards or, in an ablation, by their rewards of the movements to the goal.
If the trial is better than all of these earlier trials, its reward and its configuration at the
goal replace Q and q* in the table.

One call of a compiled kernel by :mod:`coartic.learner.learning` makes many runs side by side: the
outer loop is over trials, then over goals, then over runs. Each run draws random numbers from its
own NumPy generator (``default_rng(seed)``, PCG64), in this order:

1. at each goal of a trial after trial 0, up to the first goal that is missed, if hands are
   explored: a uniform number that is compared with ε;
2. at the same goal, if that number is below ε and a hand is chosen at random: a uniform number that
   chooses the hand;
3. at the same goal, if a target is stored: a standard normal number for each explored entry of the
   configuration, in the order of ``q``.

Runs share no data, so that the result of a run depends neither on the other runs nor on their
number. Motor noise does not come from this generator (:mod:`coartic.motion.kernels.noise`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.learner.conditions import ExplorationCondition
from coartic.motion.kernels.compile import (
    chain_by,
    entry,
    fill_row,
    generator_at,
    inlined,
    inner,
    joint_lever,
    record_type,
)
from coartic.motion.kernels.correct import correct_runs, project
from coartic.motion.kernels.move import MOVE, move_runs
from coartic.motion.kernels.slots import (
    Batch,
    RobotRecord,
    RunRecord,
    arm_of,
    batch_for,
    width_of,
)
from coartic.motion.kernels.trial import (
    CORRECTIONS,
    COUNTED,
    TICKS,
    begin,
    count_goal,
    record_goal,
    set_off,
)
from coartic.motion.kernels.trial import aim as aim_at
from coartic.motion.kernels.trigonometry import cosine, sine
from coartic.motion.solution import Movement
from coartic.motion.trials import CompiledTask
from coartic.robot import HANDS, Array, Configs, Hands, Points
from coartic.tasks.task import Task

NO_HAND = 2  # the paper's ∅, the previous hand before goal 1
_RANDOM = 1
_EXPLORATION = {"none": 0, "random": _RANDOM, "closest": 2}
_EQUALLY_NEAR = 1e-9  # difference of distances that counts as rounding, in length units
TENTHS = 10
"""Number of parts of the trials after trial 0 for which corrections are counted separately."""
Flags = NDArray[np.bool_]


class LearnerParameters(NamedTuple):
    """A task and an exploration condition in the form that the kernel reads."""

    start: Configs
    """Configuration at the start of a trial, shape ``(dof,)``, in length units and rad."""
    goals: Points
    """Centres of the goals, shape ``(G, 2)``."""
    first_hands: Hands
    """Hands of trial 0, shape ``(G,)``."""
    first_targets: Configs
    """Targets of trial 0, shape ``(G, width)``; NaN beyond ``dof``, and for goals at which only
    **A** acts."""
    hands: Hands
    """Hands that may be used, shape ``(1,)`` or ``(2,)``."""
    follows: Flags
    """True for each entry of a configuration whose target is its present value, shape ``(2,
    width)``. Row h holds if hand h (0 left, 1 right) is chosen."""
    explored: Flags
    """True for each entry of a configuration to which noise is added, shape ``(2, width)``. Row h
    holds if hand h (0 left, 1 right) is chosen."""
    exploration: int
    """Exploration of the hand: 0 none, 1 random, 2 closest."""
    epsilon: float
    """ε: probability with which the hand for a goal is explored."""
    noise_sd: float
    """Standard deviation of the noise η, in length units and rad."""
    corrects: bool
    """True if **A** corrects a goal that a movement to a stored target misses."""
    by_subtask: bool
    """True if Q of a goal is learned from the reward of the movements to the goal, not from the
    reward of the trial."""
    nullspace_gain: float
    """κ: gain of null-space exploration."""


class Results(NamedTuple):
    """Results of N runs of T trials on a task with G goals."""

    rewards: NDArray[np.int64]
    """Minus the ticks of each trial, failed trials included, shape ``(N, T)``."""
    completed: Flags
    """True if a trial hit every goal, shape ``(N, T)``."""
    best_trial: NDArray[np.int64]
    """First of the completed trials with the highest reward, from 0, shape ``(N,)``; -1 if no trial
    was completed."""
    counts: NDArray[np.int64]
    """Counts of all trials without the replay, in the order of
    :data:`coartic.motion.kernels.trial.COUNTED`, shape ``(N, 5)``."""
    corrections: NDArray[np.int64]
    """Corrective movements in trial 0 and in each tenth of the later trials, shape ``(N, 11)``."""
    initial_accounts: NDArray[np.void]
    """Per-goal records of trial 0, if it was completed, shape ``(N, G)``."""
    best_accounts: NDArray[np.void]
    """Per-goal records of the best trial, if there is one, shape ``(N, G)``."""
    last_records: NDArray[np.void]
    """Per-goal records of the latest trial, shape ``(N, G)``. At the end of :func:`learn_kernel`
    this is the replay."""


class _Workspace(NamedTuple):
    """Work space of N runs that are at the same goal of a trial."""

    batch: Batch
    counts: NDArray[np.int64]
    """Counts of the trial, shape ``(N, 5)``."""
    xs: Array
    """x of shoulder, joints and hand, shape ``(n + 1,)`` for the longer arm."""
    ys: Array
    jacobian: Array
    """Rows x and y of a Jacobian, and changes of joints, shape ``(3, width)``."""


def learner_parameters(
    compiled: CompiledTask, condition: ExplorationCondition, initial: Sequence[Movement]
) -> LearnerParameters:
    """Convert a task and an exploration condition to the form that the learner's kernel reads.

    ``initial`` contains the movement for each goal in trial 0. If a movement has no target, only
    the corrective process acts at this goal.
    """
    task, width = compiled.task, width_of(compiled.task.robot)
    first_targets = np.full((len(initial), width), np.nan)
    for target, movement in zip(first_targets, initial, strict=True):
        if movement.target is not None:
            target[: task.robot.dof] = movement.target
    follows, explored = np.zeros((2, 2, width), dtype=np.bool_)
    base = np.array(["x" not in task.locked_base, "y" not in task.locked_base])
    for chosen, hand in enumerate(HANDS):
        joints, idle_joints = task.robot.joints(hand), task.robot.joints(HANDS[1 - chosen])
        explored[chosen, :2] = condition.modify_chosen & base
        explored[chosen, joints] = condition.modify_chosen
        explored[chosen, idle_joints] = condition.modify_other
        follows[chosen, idle_joints] = not condition.modify_other
    return LearnerParameters(
        start=compiled.starts[0],
        goals=compiled.goals[0],
        first_hands=np.array([HANDS.index(movement.hand) for movement in initial], dtype=np.int64),
        first_targets=first_targets,
        hands=np.array(sorted(HANDS.index(hand) for hand in condition.hands), dtype=np.int64),
        follows=follows,
        explored=explored,
        exploration=_EXPLORATION[condition.hand_exploration],
        epsilon=condition.epsilon,
        noise_sd=condition.noise_sd,
        corrects=condition.corrects,
        by_subtask=condition.credit == "subtask",
        nullspace_gain=condition.drift,
    )


def empty_tables(runs: int, task: Task) -> NDArray[np.void]:
    """Return the learner's tables before learning, shape ``(runs, G, 3, 2)``.

    The axes are run, goal, previous hand (left, right, none) and hand. An entry is a record with
    two fields. ``value`` is Q, initially -inf. ``target`` is q*, initially ``dof`` entries of NaN,
    padded with zeros to the width of kernel records.
    """
    learned = record_type({"value": np.float64, "target": (np.float64, width_of(task.robot))})
    tables = np.zeros((runs, len(task.goals), 3, 2), learned)
    tables["value"], tables["target"][..., : task.robot.dof] = -np.inf, np.nan
    return tables


def workspace_for(runs: int, task: Task) -> _Workspace:
    """Return new arrays for a kernel that makes ``runs`` runs, at most 72."""
    return _Workspace(
        batch=batch_for(task.robot, runs),
        counts=np.zeros((runs, len(COUNTED)), dtype=np.int64),
        xs=np.empty(task.robot.max_links + 1),
        ys=np.empty(task.robot.max_links + 1),
        jacobian=np.zeros((3, width_of(task.robot))),
    )


@inner
def distance_to_goal(run: RunRecord, hand: int, robot: RobotRecord, workspace: _Workspace) -> float:
    """Return the distance of a run's hand (0 left, 1 right) from its goal's centre.

    The distance is in length units. The run's count ``evaluations`` grows by 1.
    """
    arm = arm_of(robot, hand)
    chain_by(run.q, arm, workspace.xs, workspace.ys, cosine, sine)
    run.evaluations += 1
    tip = len(arm.links)
    dx = run.goal[0] - workspace.xs[tip]
    dy = run.goal[1] - workspace.ys[tip]
    return math.sqrt(dx * dx + dy * dy)


@inlined
def _best_hand(entries: Any, hands: Any) -> int:
    """Return the hand among ``hands`` with the highest Q; at a tie the first.

    ``entries`` contains a record for each hand, 0 left and 1 right.
    """
    best = hands[0]
    for hand in hands[1:]:
        if entries[hand].value > entries[best].value:
            best = hand
    return int(best)


@inlined
def choose_hand(
    n: int, entries: Any, explore: bool, robot: Any, learner: Any, rng: Any, workspace: Any
) -> int:
    """Choose the hand (0 left, 1 right) of run ``n`` for its present goal.

    The choice is the hand with the highest value Q in ``entries``, a record for each hand; at a tie
    the left hand. If ``explore`` is True and the condition explores hands, the choice is instead,
    with probability ε, a random hand, or the hand closest to the goal (a random hand if both are
    equally close).
    """
    hands, run = learner.hands, workspace.batch.runs[n]
    if explore and learner.exploration != 0 and rng.random() < learner.epsilon:
        nearest, is_random = hands[0], learner.exploration == _RANDOM
        if not is_random:
            least = distance_to_goal(run, nearest, robot, workspace)
            for hand in hands[1:]:
                distance = distance_to_goal(run, hand, robot, workspace)
                is_random = abs(distance - least) <= _EQUALLY_NEAR
                if distance < least:
                    nearest, least = hand, distance
        return int(hands[int(rng.random() * len(hands))]) if is_random else int(nearest)
    return _best_hand(entries, hands)


@inner
def prefer(run: RunRecord, number: int, table: Any, learner: LearnerParameters) -> None:
    """Set the preferred posture p of a run, in place.

    The kernel calls this after the hand for a goal is chosen. p is (q + t') / 2. Here q is the
    present posture, and t' the target that is stored for the next goal and for the hand with the
    highest value Q at the next goal. If there is no next goal or no stored target, p is q. In the
    entries that are not explored with that hand, p is q as well.

    ``number`` is the index of the goal, from 0. ``table`` is an array of records with the fields
    ``value`` and ``target``, shape ``(G, 3, 2)``; its axes are goal, previous hand (0 left, 1
    right, 2 none) and hand. If κ is 0, nothing changes.
    """
    if learner.nullspace_gain == 0.0:
        return
    fill_row(run.preferred, run.q)
    if number + 1 < len(table):
        hand = _best_hand(table[number + 1, run.hand], learner.hands)
        following = table[number + 1, run.hand, hand]
        if following.value > -math.inf:
            for j in range(len(run.q)):
                if learner.explored[hand, j]:
                    run.preferred[j] = 0.5 * (run.q[j] + following.target[j])


@inner
def explore_nullspace(
    run: RunRecord, robot: RobotRecord, learner: LearnerParameters, workspace: _Workspace
) -> None:
    """Move the mean of exploration, the run's ``target`` t, in place.

    Base and chosen arm move by κ N(t) (p − t), and an idle arm that is explored moves by κ (p − t).
    κ is the learner's ``nullspace_gain``, p the preferred posture, and N projects onto the null
    space of the hand's Jacobian. Entries that are not explored do not change; nothing changes if κ
    is 0.
    """
    if learner.nullspace_gain == 0.0:
        return
    x, y, v = workspace.jacobian
    arm = arm_of(robot, run.hand)
    tip = len(arm.links)
    chain_by(run.target, arm, workspace.xs, workspace.ys, cosine, sine)
    for j in range(len(run.q)):
        x[j], y[j], v[j] = 0.0, 0.0, 0.0
        k = j - arm.first_joint
        if learner.explored[run.hand, j]:
            change = run.preferred[j] - run.target[j]
            if j == 0:
                x[j], v[j] = 1.0, change
            elif j == 1:
                y[j], v[j] = 1.0, change
            elif 0 <= k < tip:
                x[j], y[j] = joint_lever(workspace.xs, workspace.ys, k, tip)
                v[j] = change
            else:
                run.target[j] += learner.nullspace_gain * change
    project(v, x, y)
    for j in range(len(run.q)):
        run.target[j] += learner.nullspace_gain * v[j]


@inlined
def aim(
    n: int,
    number: int,
    previous: int,
    table: Any,
    explore: bool,
    robot: RobotRecord,
    learner: LearnerParameters,
    rng: np.random.Generator,
    workspace: _Workspace,
) -> None:
    """Choose the hand for a goal and set its target: phase 2, *aim*.

    The target is the stored target q*(s, a), except that an idle arm keeps its present posture if
    the condition does not modify it. If no target is stored, only the corrective process acts. If
    ``explore`` is True, the hand is explored (:func:`choose_hand`), a stored target is moved
    towards the preferred posture (:func:`explore_nullspace`), and noise η is added to it.

    ``n`` is the index of the run in ``workspace.batch.runs``, ``number`` the index of the goal,
    ``previous`` the previous hand (0 left, 1 right, 2 none), and ``table`` as in :func:`prefer`.
    """
    run, entries = workspace.batch.runs[n], table[number, previous]
    run.hand = choose_hand(n, entries, explore, robot, learner, rng, workspace)
    stored = entries[run.hand]
    prefer(run, number, table, learner)
    if stored.value > -math.inf:
        run.action, run.corrects = MOVE, learner.corrects
        for j in range(len(run.q)):
            run.target[j] = run.q[j] if learner.follows[run.hand, j] else stored.target[j]
        if explore:
            explore_nullspace(run, robot, learner, workspace)
        for j in range(len(run.q)):
            if explore and learner.explored[run.hand, j]:
                run.target[j] += learner.noise_sd * rng.standard_normal()


@inlined
def make_trial(
    trial: int,
    explore: bool,
    robot: RobotRecord,
    learner: LearnerParameters,
    tables: Any,
    records: Any,
    rngs: Any,
    seeds: Any,
    workspace: _Workspace,
) -> None:
    """Make trial number ``trial``, from 0, in each of N runs.

    A trial ends at the first goal that is missed. This function fills the per-goal records
    ``records``, shape ``(N, G)``, and the counts in ``workspace``. In trial 0, the hands and
    targets are those in ``learner``. If ``explore`` is False, the trial is greedy: without
    exploration of hands, null-space exploration (κ) and exploration noise. Other arguments are as
    in :func:`learn_kernel`.
    """
    batch, counts, runs, initial = workspace.batch, workspace.counts, len(tables), trial == 0
    for n in range(runs):
        set_off(batch.runs[n], learner.start, seeds[n], trial, robot)
        for k in range(counts.shape[1]):
            counts[n, k] = 0
    for number in range(len(learner.goals)):
        for n in range(runs):
            run = batch.runs[n]
            begin(run, number, learner.goals[number])
            if initial:
                run.hand = learner.first_hands[number]
                if run.going:
                    aim_at(run, learner.first_targets[number])
            elif run.going:
                previous = records[n, number - 1].hand if number > 0 else NO_HAND
                rng = generator_at(rngs, n)
                aim(n, number, previous, tables[n], explore, robot, learner, rng, workspace)
        move_runs(runs, robot, batch)
        for n in range(runs):
            records[n, number].moved = batch.runs[n].ticks
            if batch.runs[n].action == MOVE:
                fill_row(records[n, number].target, batch.runs[n].target)
        correct_runs(runs, robot, batch)
        for n in range(runs):
            record_goal(batch.runs[n], records[n, number].moved, records[n, number])
            count_goal(records[n, number], counts[n])


@inlined
def _copy_accounts(source: Any, destination: Any) -> None:
    """Copy the per-goal records of a trial, shape ``(G,)``, in place.

    The records are copied in words of 64 bits. LLVM would copy them byte by byte, which takes long
    to compile.
    """
    copies, words = destination.view(np.int64), source.view(np.int64)
    for k in range(len(words)):
        copies[k] = words[k]


@inlined
def _learn_from(
    number: int, learner: LearnerParameters, tables: Any, results: Results, workspace: _Workspace
) -> None:
    """Enter a trial of each run into the results, and learn from it.

    ``number`` is the number of the trial, from 0. In each state that a completed trial passed
    through, its reward (or, by subtask, that of the movements to the goal) is compared with Q of
    the hand that it chose. If the reward is higher, it replaces Q in ``tables``, and the
    configuration at the hit replaces q*.
    """
    later_trials = max(1, results.rewards.shape[1] - 1)
    part = 0 if number == 0 else 1 + (number - 1) * TENTHS // later_trials
    for n in range(len(tables)):
        trial, counts = results.last_records[n], workspace.counts[n]
        completed = workspace.batch.runs[n].going
        for k in range(len(counts)):
            results.counts[n, k] += counts[k]
        results.corrections[n, part] += counts[CORRECTIONS]
        reward = -counts[TICKS]
        results.rewards[n, number] = reward
        results.completed[n, number] = completed
        if not completed:
            continue
        if number == 0:
            _copy_accounts(trial, results.initial_accounts[n])
        for goal in range(len(trial)):
            credit = float(-trial[goal].ticks if learner.by_subtask else reward)
            previous = trial[goal - 1].hand if goal > 0 else NO_HAND
            learned = tables[n, goal, previous, trial[goal].hand]
            if credit > learned.value:
                learned.value = credit
                fill_row(learned.target, trial[goal].q)
        best = results.best_trial[n]
        if best < 0 or reward > results.rewards[n, best]:
            results.best_trial[n] = number
            _copy_accounts(trial, results.best_accounts[n])


@entry
def learn_kernel(
    robot: Any, learner: Any, tables: Any, results: Any, rngs: Any, seeds: Any, workspace: Any
) -> None:
    """Make all trials of N runs, then the replay of each run.

    The replay is a greedy trial without exploration. If ``results`` has room for 0 trials,
    trial 0 takes the place of the replay.

    Parameters
    ----------
    robot
        From :func:`.robot_parameters`.
    learner
        From :func:`learner_parameters`.
    tables
        New :func:`empty_tables`, filled in place.
    results
        :class:`Results` of zeros with ``best_trial`` -1, filled in place.
    rngs
        The runs' own generators (:func:`.addresses`).
    seeds
        Seed of the motor noise of each run (:func:`.noise_seed`), shape ``(N,)``. Trial k is made
        with noise draw k. The replay is made with the draw after that of the last trial.
    workspace
        From :func:`workspace_for`.
    """
    trials = results.rewards.shape[1]
    for number in range(trials + 1):  # the last trial is the replay, which is not part of the runs
        explore, records = number < trials, results.last_records
        make_trial(number, explore, robot[0], learner, tables, records, rngs, seeds, workspace)
        if number < trials:
            _learn_from(number, learner, tables, results, workspace)
