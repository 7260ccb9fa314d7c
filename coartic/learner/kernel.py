"""The dual-process learner: trial and error over the corrective process.

The paper's section *The Learning Process* and Figure 3. Per trial and goal: choose a
hand, perturb the stored target configuration, move, and let the corrective process
finish where the goal was missed. A trial better than any before it that passed
through the same state and hand replaces what is stored there; better by its whole reward,
or, in an ablation, by the return of that goal.

One call of a compiled kernel performs many runs side by side, goal by goal and trial by
trial (:mod:`coartic.learner.learning` makes it). Each draws from a NumPy generator of its own
(``default_rng(seed)``, PCG64), per trial and goal in this order: a uniform number against
ε, where hands are explored; a second one that picks a hand, where the first fell below ε
and the pick is random; one standard normal per explored joint, in the order of ``q``, where a
target is stored. Runs share nothing: the result of one depends neither on the others nor on their
number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.learner.conditions import ExplorationCondition
from coartic.motion.compiled import entry, fill_row, generator_at, inlined, inner, record_type
from coartic.motion.reach import CHECK, IDLE, MOVE, Batch, CompiledTask, attempt, correct_missed
from coartic.motion.robot_parameters import arm_of
from coartic.motion.slots import runs_for, slots_for, width_of
from coartic.motion.solution import Movement
from coartic.motion.trigonometry import joint_chain
from coartic.robot import HANDS
from coartic.tasks.task import Task

NO_HAND = 2  # ∅, the previous hand before goal 1
LEARNED, CORRECTIVE = 0, 1
_RANDOM = 1
_EXPLORATION = {"none": 0, "random": _RANDOM, "closest": 2}
_EQUALLY_NEAR = 1e-9  # hands at the same place up to rounding, length unit


class LearnerParameters(NamedTuple):
    """Learner parameters: a task and an exploration condition, as the kernel reads them."""

    start: Any  # (dof,)
    goals: Any  # (G, 2)
    first_hands: Any  # (G,) of trial 0
    first_targets: Any  # (G, width) where trial 0 moves to; NaN where **A** acts
    hands: Any  # (1 or 2,) hands available
    follows: Any  # (2, width) for each chosen hand: joint takes its current value
    explored: Any  # (2, width) for each chosen hand: joint is perturbed
    exploration: int
    epsilon: float
    noise_sd: float
    corrects: bool
    by_subtask: bool
    discount: float
    counts_earlier: bool


class TrialLog(NamedTuple):
    """The movements of one trial of each run, where it stood when each goal was hit, and the
    return of each."""

    count: Any  # (N,)
    movements: Any  # (N, 2 G) records of goal, hand, kind, ticks and target
    hits: Any  # (N, G) records of hand, reward and credit of the subtask, and q


class Results(NamedTuple):
    """Results of each run."""

    rewards: Any  # (N, T)
    completed: Any  # (N, T)
    best_trial: Any  # (N,), -1 for none
    replayed: Any  # (N,) whether the replay hit every goal
    replay_rewards: Any  # (N,)
    counts: Any  # (N, COUNTED) what was spent, without the replay
    corrections: Any  # (N, 1 + TENTHS) made in trial 0 and in each tenth of the rest
    first: TrialLog
    best: TrialLog
    replay: TrialLog


COUNTED = (
    "movement_ticks",
    "forward_kinematics",
    "corrective_iterations",
    "corrections",
    "failed_trials",
)
"""Counters of :class:`~coartic.method.Meter` that the kernel keeps, in this order."""
_TICKS, _EVALUATIONS, _ITERATIONS, _CORRECTIONS, _FAILED = range(len(COUNTED))
TENTHS = 10
"""Equal parts of the trials after trial 0, of which corrections are counted apart."""


class Workspace(NamedTuple):
    """Work space of N runs, each now at the same goal of the same trial."""

    batch: Batch
    trials: Any  # (N,) records: see _TRIAL
    xs: Any  # (n + 1,) for the longer arm: positions of its joints
    ys: Any


def learner_parameters_of(
    compiled: CompiledTask, condition: ExplorationCondition, first: Sequence[Movement]
) -> LearnerParameters:
    """The learner parameters of a task and a condition, with a movement to each goal for trial
    0."""
    task, width = compiled.task, width_of(compiled.task.robot)
    first_targets = np.zeros((len(first), width))
    for target, movement in zip(first_targets, first, strict=True):
        target[: task.robot.dof] = np.nan if movement.target is None else movement.target
    follows, explored = np.zeros((2, 2, width), dtype=np.bool_)
    base = np.array(["x" not in task.locked_base, "y" not in task.locked_base])
    for chosen, hand in enumerate(HANDS):
        of_arm, others = task.robot.joints(hand), task.robot.joints(HANDS[1 - chosen])
        explored[chosen, :2] = condition.modify_chosen & base
        explored[chosen, of_arm] = condition.modify_chosen
        explored[chosen, others] = condition.modify_other
        follows[chosen, others] = not condition.modify_other
    return LearnerParameters(
        start=compiled.starts[0],
        goals=compiled.goals[0],
        first_hands=np.array([HANDS.index(movement.hand) for movement in first], dtype=np.int64),
        first_targets=first_targets,
        hands=np.array(sorted(HANDS.index(hand) for hand in condition.hands), dtype=np.int64),
        follows=follows,
        explored=explored,
        exploration=_EXPLORATION[condition.hand_exploration],
        epsilon=float(condition.epsilon),
        noise_sd=float(condition.noise_sd),
        corrects=bool(condition.corrects),
        by_subtask=condition.credit == "subtask",
        discount=float(condition.discount),
        counts_earlier=condition.counted == "all",
    )


def empty_tables(runs: int, task: Task) -> NDArray[np.void]:
    """Tables in which nothing is learned, ``(N, G, 3, 2)``.

    By run, goal, previous hand (left, right, none) and hand: a record of ``value``, Q, and
    ``target``, q*.
    """
    learned = record_type({"value": np.float64, "target": (np.float64, width_of(task.robot))})
    tables = np.zeros((runs, len(task.goals), 3, 2), learned)
    tables["value"], tables["target"][..., : task.robot.dof] = -np.inf, np.nan
    return tables


def empty_log(runs: int, task: Task) -> TrialLog:
    """Logs without movements."""
    goals, q = len(task.goals), (np.float64, width_of(task.robot))
    numbers = dict.fromkeys(("goal", "hand", "kind", "ticks"), np.int64)
    movement = record_type({**numbers, "target": q})
    credit = dict.fromkeys(("reward", "credit"), np.float64)
    hit = record_type({"hand": np.int64, **credit, "q": q})
    count = np.zeros(runs, dtype=np.int64)
    return TrialLog(count, np.zeros((runs, 2 * goals), movement), np.zeros((runs, goals), hit))


_TRIAL = record_type(
    {
        "previous": np.int64,  # hand of the goal before
        "ticks": np.int64,
        "corrections": np.int64,
        "counts": (np.int64, len(COUNTED)),  # of all trials of the run
    }
)


def workspace_for(runs: int, task: Task) -> Workspace:
    """Work space of runs, as many as there are slots at most; all counters are 0."""
    return Workspace(
        batch=Batch(runs_for(runs, task.robot), slots_for(task.robot)),
        trials=np.zeros(runs, _TRIAL),
        xs=np.empty(task.robot.most_links + 1),
        ys=np.empty(task.robot.most_links + 1),
    )


@inlined
def distance_to_goal(n: int, hand: int, robot_parameters: Any, workspace: Any) -> float:
    """How far a hand of run ``n`` is from the centre of its goal, length unit."""
    run, arm = workspace.batch.runs[n], arm_of(robot_parameters, hand)
    joint_chain(run.q, arm, workspace.xs, workspace.ys)
    run.evaluations += 1
    tip = len(arm.links)
    dx = run.goal[0] - workspace.xs[tip]
    dy = run.goal[1] - workspace.ys[tip]
    return math.sqrt(dx * dx + dy * dy)


@inlined
def choose_hand(
    n: int,
    entries: Any,
    explore: bool,
    robot_parameters: Any,
    learner_parameters: Any,
    rngs: Any,
    workspace: Any,
) -> int:
    """The hand of highest value; with probability ε a random one, or the closest to the goal.

    Of equal values the first, of hands that are equally close a random one.
    """
    hands = learner_parameters.hands
    if explore and learner_parameters.exploration != 0:
        rng = generator_at(rngs, n)
        if rng.random() < learner_parameters.epsilon:
            nearest, draws = hands[0], learner_parameters.exploration == _RANDOM
            if not draws:
                least = distance_to_goal(n, nearest, robot_parameters, workspace)
                for hand in hands[1:]:
                    distance = distance_to_goal(n, hand, robot_parameters, workspace)
                    draws = abs(distance - least) <= _EQUALLY_NEAR
                    if distance < least:
                        nearest, least = hand, distance
            return int(hands[int(rng.random() * len(hands))]) if draws else int(nearest)
    best = hands[0]
    for hand in hands[1:]:
        if entries[hand].value > entries[best].value:
            best = hand
    return int(best)


@inlined
def aim(
    n: int,
    number: int,
    first: bool,
    explore: bool,
    robot_parameters: Any,
    learner_parameters: Any,
    tables: Any,
    rngs: Any,
    workspace: Any,
) -> None:
    """Choose the hand of a run and, where there is a target q*(s, a), set q^t = q*(s, a) + η;
    joints that are not to be modified keep their current values."""
    run = workspace.batch.runs[n]
    if first:
        run.hand = learner_parameters.first_hands[number]
        if not math.isnan(learner_parameters.first_targets[number, 0]):
            fill_row(run.target, learner_parameters.first_targets[number])
            run.how = MOVE
        return
    entries = tables[n, number, workspace.trials[n].previous]
    run.hand = choose_hand(
        n, entries, explore, robot_parameters, learner_parameters, rngs, workspace
    )
    stored = entries[run.hand]
    if stored.value > -math.inf:
        run.how = MOVE
        rng = generator_at(rngs, n)
        for j in range(len(run.q)):
            run.target[j] = (
                run.q[j] if learner_parameters.follows[run.hand, j] else stored.target[j]
            )
            if explore and learner_parameters.explored[run.hand, j]:
                run.target[j] += learner_parameters.noise_sd * rng.standard_normal()


@inlined
def record_movement(log: Any, n: int, number: int, kind: int, run: Any, trial: Any) -> None:
    """Log a movement of run ``n``."""
    movement = log.movements[n, log.count[n]]
    movement.goal = number
    movement.hand = run.hand
    movement.kind = kind
    movement.ticks = run.ticks
    fill_row(movement.target, run.target)
    log.count[n] += 1
    trial.ticks += run.ticks
    trial.counts[_TICKS] += run.ticks


@inner
def make_trial(
    first: bool,
    explore: bool,
    robot_parameters: Any,
    learner_parameters: Any,
    tables: Any,
    log: Any,
    rngs: Any,
    workspace: Any,
) -> None:
    """One trial of every run into ``log``; ``first``: trial 0. A trial fails at a goal missed."""
    runs = len(workspace.trials)
    for n in range(runs):
        run, trial = workspace.batch.runs[n], workspace.trials[n]
        fill_row(run.q, learner_parameters.start)
        run.evaluations = 0
        run.going = True
        trial.previous = NO_HAND
        trial.ticks = trial.corrections = 0
        log.count[n] = 0
    for number in range(len(learner_parameters.goals)):
        for n in range(runs):
            run = workspace.batch.runs[n]
            fill_row(run.goal, learner_parameters.goals[number])
            fill_row(run.target, run.q)
            run.how, run.hit = CHECK if run.going else IDLE, False
            if run.going:
                aim(
                    n,
                    number,
                    first,
                    explore,
                    robot_parameters,
                    learner_parameters,
                    tables,
                    rngs,
                    workspace,
                )
        attempt(runs, robot_parameters, workspace.batch)
        for n in range(runs):
            run = workspace.batch.runs[n]
            run.corrects = learner_parameters.corrects or first or run.how != MOVE
            if run.how == MOVE:
                record_movement(log, n, number, LEARNED, run, workspace.trials[n])
        correct_missed(runs, robot_parameters, workspace.batch)
        for n in range(runs):
            run, trial = workspace.batch.runs[n], workspace.trials[n]
            if run.going:
                trial.counts[_ITERATIONS] += run.iterations
                trial.counts[_CORRECTIONS] += run.converged
                trial.corrections += run.converged
                if run.converged or (run.hit and run.how == CHECK):
                    record_movement(log, n, number, CORRECTIVE, run, trial)
                run.going = run.hit
                if run.going:
                    hit = log.hits[n, number]
                    hit.hand = trial.previous = run.hand
                    fill_row(hit.q, run.q)
                else:
                    trial.counts[_FAILED] += 1
    for n in range(runs):
        workspace.trials[n].counts[_EVALUATIONS] += workspace.batch.runs[n].evaluations


@inlined
def find_returns(n: int, learner_parameters: Any, log: Any) -> None:
    """Set the return of each goal in the log of a completed trial."""
    goals, row, earlier, later = log.hits.shape[1], 0, 0.0, 0.0
    for number in range(goals):
        hit = log.hits[n, number]
        ticks = 0
        while row < log.count[n] and log.movements[n, row].goal == number:
            ticks += log.movements[n, row].ticks
            row += 1
        hit.reward = -ticks
        hit.credit = earlier
        if learner_parameters.counts_earlier:
            earlier = learner_parameters.discount * (earlier + hit.reward)
    for number in range(goals - 1, -1, -1):
        hit = log.hits[n, number]
        later = hit.reward + learner_parameters.discount * later
        hit.credit += later


@inlined
def copy_movements(n: int, source: Any, destination: Any) -> None:
    """Copy the logged movements of run ``n``."""
    for row in range(source.count[n]):
        destination.movements[n, row] = source.movements[n, row]
    destination.count[n] = source.count[n]


@inner
def learn_from(
    number: int, learner_parameters: Any, tables: Any, results: Any, log: Any, workspace: Any
) -> None:
    """Keep the rewards of a trial; where it was completed, update Q and q*: credit visited states
    and hands with the reward of the trial, or each with its return."""
    others = max(1, results.rewards.shape[1] - 1)
    part = 0 if number == 0 else 1 + (number - 1) * TENTHS // others
    for n in range(len(workspace.trials)):
        trial = workspace.trials[n]
        results.corrections[n, part] += trial.corrections
        reward = -trial.ticks
        results.rewards[n, number] = reward
        results.completed[n, number] = workspace.batch.runs[n].going
        if not workspace.batch.runs[n].going:
            continue
        if number == 0:
            copy_movements(n, log, results.first)
        if learner_parameters.by_subtask:
            find_returns(n, learner_parameters, log)
        for goal in range(log.hits.shape[1]):
            hit = log.hits[n, goal]
            credit = hit.credit if learner_parameters.by_subtask else float(reward)
            before = log.hits[n, goal - 1].hand if goal > 0 else NO_HAND
            learned = tables[n, goal, before, hit.hand]
            if credit > learned.value:
                learned.value = credit
                fill_row(learned.target, hit.q)
        best = results.best_trial[n]
        if best < 0 or reward > results.rewards[n, best]:
            results.best_trial[n] = number
            copy_movements(n, log, results.best)


@entry
def learn_kernel(
    robot_parameters: Any,
    learner_parameters: Any,
    tables: Any,
    results: Any,
    log: Any,
    rngs: Any,
    workspace: Any,
) -> None:
    """All trials of N runs, each with its own generator, and the replay of what they learned.

    ``tables`` and ``results`` are filled; ``log`` is overwritten by every trial.
    """
    trials = results.rewards.shape[1]
    for number in range(trials + 1):  # the last is the replay, which is not part of the runs
        if number == trials:
            for n in range(len(workspace.trials)):
                fill_row(results.counts[n], workspace.trials[n].counts)
        make_trial(
            number == 0,
            number < trials,
            robot_parameters[0],
            learner_parameters,
            tables,
            log,
            rngs,
            workspace,
        )
        if number < trials:
            learn_from(number, learner_parameters, tables, results, log, workspace)
    for n in range(len(workspace.trials)):
        results.replayed[n] = workspace.batch.runs[n].going
        results.replay_rewards[n] = -workspace.trials[n].ticks
        copy_movements(n, log, results.replay)
