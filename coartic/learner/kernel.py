"""The dual-process learner: trial and error over the corrective process.

The paper's section *The Learning Process* and Figure 3. Per trial and goal: choose a
hand, perturb the stored target configuration, move, and let the corrective process
finish where the goal was missed. A trial better than any before it that passed
through the same state and hand replaces what is stored there; better by its whole reward,
or, in a variant, by the return of that goal.

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
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.learner.conditions import ExplorationCondition
from coartic.motion.compiled import (
    entry,
    fill_row,
    generator_at,
    inlined,
    inner,
    record_type,
)
from coartic.motion.lanes import LANES, Lanes, lanes_for, runs_for, width_of
from coartic.motion.reach import LOOK, MOVE, STAY, attempt, correct_missed
from coartic.motion.setup import arm_of
from coartic.motion.trigonometry import joint_chain
from coartic.robot import HANDS
from coartic.tasks.task import Task

NO_HAND = 2  # ∅, the previous hand before goal 1
LEARNED, CORRECTIVE = 0, 1
_EXPLORATION = {"none": 0, "random": 1, "closest": 2}
_EQUALLY_NEAR = 1e-9  # hands at the same place up to rounding, length unit


class Rules(NamedTuple):
    """An exploration condition on a robot, as the kernel reads it."""

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


class Log(NamedTuple):
    """The movements of one trial of each run, where it stood when each goal was hit, and the
    return of each."""

    count: Any  # (N,)
    movements: Any  # (N, 2 G) records of goal, hand, kind, ticks and target
    hits: Any  # (N, G) records of hand, reward and credit of the subtask, and q


class Kept(NamedTuple):
    """Results of each run."""

    rewards: Any  # (N, T)
    completed: Any  # (N, T)
    best_trial: Any  # (N,), -1 for none
    replayed: Any  # (N,) whether the replay hit every goal
    replay_rewards: Any  # (N,)
    counts: Any  # (N, counters) what was spent, without the replay
    corrections: Any  # (N, 1 + TENTHS) made until the end of trial 0, in each tenth of the rest
    first: Log
    best: Log
    replay: Log


class Count(NamedTuple):
    """Indices of the counters."""

    ticks: int = 0
    evaluations: int = 1
    iterations: int = 2
    corrections: int = 3
    failed: int = 4


COUNT = Count()
TENTHS = 10
"""Equal parts of the trials after trial 0, of which corrections are counted apart."""


class Work(NamedTuple):
    """Work space of runs, each now at the same goal of the same trial: that of
    :class:`coartic.motion.reach.Batch` and the learner's own."""

    runs: Any  # (N,) records: see runs_for
    lanes: Lanes
    trials: Any  # (N,) records: see _TRIAL
    xs: Any  # (n + 1,) for the longer arm: positions of its joints
    ys: Any


def rules_of(task: Task, condition: ExplorationCondition) -> Rules:
    """The rules of a condition on the robot of a task."""
    follows, explored = np.zeros((2, 2, width_of(task.robot)), dtype=np.bool_)
    base = np.array(["x" not in task.locked_base, "y" not in task.locked_base])
    for chosen, hand in enumerate(HANDS):
        of_arm, others = task.robot.joints(hand), task.robot.joints(HANDS[1 - chosen])
        explored[chosen, :2] = condition.modify_chosen & base
        explored[chosen, of_arm] = condition.modify_chosen
        explored[chosen, others] = condition.modify_other
        follows[chosen, others] = not condition.modify_other
    return Rules(
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


def empty_log(runs: int, task: Task) -> Log:
    """Logs without movements."""
    goals, q = len(task.goals), (np.float64, width_of(task.robot))
    numbers = dict.fromkeys(("goal", "hand", "kind", "ticks"), np.int64)
    movement = record_type({**numbers, "target": q})
    credit = dict.fromkeys(("reward", "credit"), np.float64)
    hit = record_type({"hand": np.int64, **credit, "q": q})
    count = np.zeros(runs, dtype=np.int64)
    return Log(count, np.zeros((runs, 2 * goals), movement), np.zeros((runs, goals), hit))


_TRIAL = record_type(
    {
        "previous": np.int64,  # hand of the goal before
        "ticks": np.int64,
        "counts": (np.int64, len(COUNT)),  # of all trials of the run
    }
)


def work_for(runs: int, task: Task) -> Work:
    """Work space of runs, all counters 0. ValueError for more than there are lanes."""
    if runs > LANES:
        raise ValueError(f"{runs} runs at once; there are {LANES} lanes")
    return Work(
        runs=runs_for(runs, task.robot),
        lanes=lanes_for(task.robot),
        trials=np.zeros(runs, _TRIAL),
        xs=np.empty(task.robot.most_links + 1),
        ys=np.empty(task.robot.most_links + 1),
    )


@inlined
def distance_to_goal(n: int, hand: int, setup: Any, work: Any) -> float:
    """How far a hand of run ``n`` is from the centre of its goal, length unit."""
    run, arm = work.runs[n], arm_of(setup, hand)
    joint_chain(run.q, arm, work.xs, work.ys)
    run.evaluations += 1
    tip = len(arm.links)
    dx = run.goal[0] - work.xs[tip]
    dy = run.goal[1] - work.ys[tip]
    return math.sqrt(dx * dx + dy * dy)


@inner
def greedy_hand(entries: Any, hands: Any) -> int:
    """Hand of the highest value; the first of equals."""
    best = hands[0]
    for hand in hands[1:]:
        if entries[hand].value > entries[best].value:
            best = hand
    return int(best)


@inner
def random_hand(hands: Any, rng: Any) -> int:
    """One of the hands, each as likely."""
    return int(hands[int(rng.random() * len(hands))])


@inlined
def closest_hand(n: int, setup: Any, rules: Any, rng: Any, work: Any) -> int:
    """The hand closest to the goal, a random one of equally close ones."""
    nearest = rules.hands[0]
    nearest_distance = distance_to_goal(n, nearest, setup, work)
    tie = False
    for hand in rules.hands[1:]:
        distance = distance_to_goal(n, hand, setup, work)
        tie = abs(distance - nearest_distance) <= _EQUALLY_NEAR
        if distance < nearest_distance:
            nearest, nearest_distance = hand, distance
    return int(random_hand(rules.hands, rng)) if tie else int(nearest)


@inlined
def choose_hand(
    n: int, entries: Any, explore: bool, setup: Any, rules: Any, rngs: Any, work: Any
) -> int:
    """The hand of a run: greedy, or with probability ε an explored one."""
    if explore and rules.exploration != 0:
        rng = generator_at(rngs, n)
        if rng.random() < rules.epsilon:
            if rules.exploration == 1:
                return random_hand(rules.hands, rng)
            return closest_hand(n, setup, rules, rng, work)
    return greedy_hand(entries, rules.hands)


@inlined
def set_target(
    target: Any, q: Any, stored: Any, hand: int, explore: bool, rules: Any, rng: Any
) -> None:
    """q^t = q*(s, a) + η; joints that are not to be modified keep their current values."""
    for j in range(len(q)):
        target[j] = q[j] if rules.follows[hand, j] else stored[j]
        if explore and rules.explored[hand, j]:
            target[j] += rules.noise_sd * rng.standard_normal()


@inlined
def aim(
    n: int,
    number: int,
    explore: bool,
    setup: Any,
    rules: Any,
    tables: Any,
    rngs: Any,
    work: Any,
) -> None:
    """Choose the hand of a run; where it has a stored target, set it."""
    run = work.runs[n]
    entries = tables[n, number, work.trials[n].previous]
    run.hand = choose_hand(n, entries, explore, setup, rules, rngs, work)
    learned = entries[run.hand]
    if learned.value > -math.inf:
        rng = generator_at(rngs, n)
        set_target(run.target, run.q, learned.target, run.hand, explore, rules, rng)
        run.how = MOVE


@inlined
def aim_first(n: int, number: int, first_hands: Any, first_targets: Any, work: Any) -> None:
    """Set hand and target of a run in trial 0."""
    run = work.runs[n]
    run.hand = first_hands[number]
    if not math.isnan(first_targets[number, 0]):
        fill_row(run.target, first_targets[number])
        run.how = MOVE


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
    trial.counts[COUNT.ticks] += run.ticks


@inlined
def note_goal(n: int, number: int, log: Any, work: Any) -> None:
    """Log and count corrections of a goal; a trial fails where it was missed."""
    run, trial = work.runs[n], work.trials[n]
    trial.counts[COUNT.iterations] += run.iterations
    trial.counts[COUNT.corrections] += run.converged
    if run.converged or (run.hit and run.how == LOOK):
        record_movement(log, n, number, CORRECTIVE, run, trial)
    run.going = run.hit
    if run.going:
        hit = log.hits[n, number]
        hit.hand = trial.previous = run.hand
        fill_row(hit.q, run.q)
    else:
        trial.counts[COUNT.failed] += 1


@inner
def make_trial(
    first: bool,
    explore: bool,
    first_hands: Any,
    first_targets: Any,
    start: Any,
    goals: Any,
    setup: Any,
    rules: Any,
    tables: Any,
    log: Any,
    rngs: Any,
    work: Any,
) -> None:
    """One trial of every run into ``log``; the ``first`` one with ``first_hands`` and targets."""
    runs = len(work.runs)
    for n in range(runs):
        run, trial = work.runs[n], work.trials[n]
        fill_row(run.q, start)
        run.evaluations = 0
        run.going = True
        trial.previous = NO_HAND
        trial.ticks = 0
        log.count[n] = 0
    for number in range(len(goals)):
        for n in range(runs):
            run = work.runs[n]
            fill_row(run.goal, goals[number])
            fill_row(run.target, run.q)
            run.how, run.hit = LOOK if run.going else STAY, False
            if run.going and first:
                aim_first(n, number, first_hands, first_targets, work)
            elif run.going:
                aim(n, number, explore, setup, rules, tables, rngs, work)
        attempt(runs, setup, work)
        for n in range(runs):
            run = work.runs[n]
            run.corrects = rules.corrects or first or run.how != MOVE
            if run.how == MOVE:
                record_movement(log, n, number, LEARNED, run, work.trials[n])
        correct_missed(runs, setup, work)
        for n in range(runs):
            if work.runs[n].going:
                note_goal(n, number, log, work)
    for n in range(runs):
        work.trials[n].counts[COUNT.evaluations] += work.runs[n].evaluations


@inlined
def find_returns(n: int, rules: Any, log: Any) -> None:
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
        if rules.counts_earlier:
            earlier = rules.discount * (earlier + hit.reward)
    for number in range(goals - 1, -1, -1):
        hit = log.hits[n, number]
        later = hit.reward + rules.discount * later
        hit.credit += later


@inlined
def update_tables(n: int, reward: float, rules: Any, tables: Any, log: Any) -> None:
    """Credit visited states and hands with the reward of the trial, or each with its return."""
    if rules.by_subtask:
        find_returns(n, rules, log)
    for number in range(log.hits.shape[1]):
        hit = log.hits[n, number]
        credit = hit.credit if rules.by_subtask else reward
        before = log.hits[n, number - 1].hand if number > 0 else NO_HAND
        learned = tables[n, number, before, hit.hand]
        if credit > learned.value:
            learned.value = credit
            fill_row(learned.target, hit.q)


@inlined
def copy_movements(n: int, source: Any, destination: Any) -> None:
    """Copy the logged movements of run ``n``."""
    for row in range(source.count[n]):
        destination.movements[n, row] = source.movements[n, row]
    destination.count[n] = source.count[n]


@inner
def learn_from(earlier: int, rules: Any, tables: Any, kept: Any, log: Any, work: Any) -> None:
    """Keep the rewards of a trial after so many; where it was completed, update Q and q*."""
    others = max(1, kept.rewards.shape[1] - 1)
    part = 0 if earlier == 0 else 1 + (earlier - 1) * TENTHS // others
    for n in range(len(work.trials)):
        trial = work.trials[n]
        kept.corrections[n, part] = trial.counts[COUNT.corrections]
        reward = -trial.ticks
        kept.rewards[n, earlier] = reward
        kept.completed[n, earlier] = work.runs[n].going
        if not work.runs[n].going:
            continue
        if earlier == 0:
            copy_movements(n, log, kept.first)
        update_tables(n, float(reward), rules, tables, log)
        best = kept.best_trial[n]
        if best < 0 or reward > kept.rewards[n, best]:
            kept.best_trial[n] = earlier
            copy_movements(n, log, kept.best)


@entry
def learn_kernel(
    first_hands: Any,
    first_targets: Any,
    start: Any,
    goals: Any,
    setup: Any,
    rules: Any,
    tables: Any,
    kept: Any,
    log: Any,
    rngs: Any,
    work: Any,
) -> None:
    """All trials of N runs, each with its own generator, and the replay of what they learned.

    ``first_hands`` (G,) are those of trial 0, ``first_targets`` (G, width) where it moves to, NaN
    where the corrective process acts. ``tables`` and ``kept`` are filled; ``log``
    is overwritten by every trial.
    """
    trials = kept.rewards.shape[1]
    for trial in range(trials + 1):
        replay = trial == trials
        for n in range(len(work.trials) if replay else 0):  # which is not part of the runs
            fill_row(kept.counts[n], work.trials[n].counts)
        first = trial == 0
        make_trial(
            first, not replay, first_hands, first_targets, start, goals, setup[0], rules, tables,
            log, rngs, work,
        )  # fmt: skip
        if not replay:
            learn_from(trial, rules, tables, kept, log, work)
    for n in range(len(work.trials)):
        kept.replayed[n] = work.runs[n].going
        kept.replay_rewards[n] = -work.trials[n].ticks
        copy_movements(n, log, kept.replay)
