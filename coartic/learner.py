"""The dual-process learner: trial and error over the corrective process.

The paper's section *The Learning Process* and Figure 3. Per trial and goal: choose a
hand, perturb the stored target configuration, move, and let the corrective process
finish where the goal was missed. A trial better than any before it that passed
through the same state and hand replaces what is stored there; better by its whole reward,
or, in a variant, by the return from that goal on.

One call of a compiled kernel performs many runs side by side, goal by goal and trial by
trial (:mod:`coartic.learning` makes it). Each draws from a NumPy generator of its own
(``default_rng(seed)``, PCG64), per trial and goal in this order: a uniform number against
ε, where hands are explored; a second one that picks a hand, where the first fell below ε
and the pick is random, or where two hands are equal and ties are broken at random; one
standard normal per explored joint, in the order of ``q``, where a target is stored; a bias
draws nothing. Runs share nothing: the result of one depends neither on the others nor on
their number.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from coartic.compiled import entry, fill_row, generator_at, inlined, inner, joint_chain
from coartic.corrective import correct_lanes, shift_kernel
from coartic.exploration import ExplorationCondition
from coartic.lanes import LANES, Ends, Lanes, board, depart, ends_of, lanes_for
from coartic.movement import Scratch, move_lanes, scratch_for
from coartic.problem import arm_of, goal_of
from coartic.robot import HANDS
from coartic.task import Task

NO_HAND = 2  # ∅, the previous hand before goal 1
LEARNED, CORRECTIVE = 0, 1
_EXPLORATION = {"none": 0, "random": 1, "closest": 2}
_TIES = {"left": 0, "right": 1, "random": 2, "nearest": 3, "previous": 4}
_EQUALLY_NEAR = 1e-9  # hands at the same place up to rounding, length unit


class Rules(NamedTuple):
    """An exploration condition on a robot, as the kernel reads it."""

    hands: Any  # (1 or 2,) hands available
    follows: Any  # (2, dof) for each chosen hand: joint takes its current value
    explored: Any  # (2, dof) for each chosen hand: joint is perturbed
    exploration: int
    epsilon: float
    noise_sd: float
    bias: float
    corrects: bool
    ties: int
    rounding: float  # distances that differ by no more are equal
    first_learns: bool
    explores_unknown: bool
    update_equal: bool
    goal_alone: bool
    by_subtask: bool
    discount: float


class Tables(NamedTuple):
    """What each run learns, by goal, previous hand (left, right, none) and hand."""

    value: Any  # Q, (N, G, 3, 2)
    target: Any  # q*, (N, G, 3, 2, dof)


class Log(NamedTuple):
    """The movements of one trial of each run, and where it stood when each goal was hit."""

    count: Any  # (N,)
    goal: Any  # (N, 2 G)
    hand: Any
    kind: Any
    ticks: Any
    target: Any  # (N, 2 G, dof)
    hands: Any  # (N, G)
    reached: Any  # (N, G, dof)


class Kept(NamedTuple):
    """What is kept of the trials of each run."""

    rewards: Any  # (N, T)
    completed: Any  # (N, T)
    best_trial: Any  # (N,), -1 for none
    replayed: Any  # (N,) whether the replay hit every goal
    counts: Any  # (N, counters) what was spent, without the replay
    corrections: Any  # (N, 1 + PARTS) made until the end of trial 0, and of each part of the rest
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
    biased: int = 5


COUNT = Count()
PARTS = 10
"""Equal parts of the trials after trial 0, of which corrections are counted apart."""


class Work(NamedTuple):
    """What the trials of the runs work on, each now at the same goal of the same trial."""

    q: Any  # (N, dof) where the robot is
    target: Any  # (N, dof) where it is to go
    hand: Any  # (N,) chosen for this goal
    previous: Any  # (N,) hand of the goal before
    stored: Any  # (N,) whether the hand has a stored target
    aimed: Any  # (N,) whether it moves to a target of its own before A acts
    going: Any  # (N,) whether the trial has not failed
    acting: Any  # (N,) whether the run is among those that are moved or corrected next
    total: Any  # (N,) ticks of the trial
    counts: Any  # (N, counters)
    ends: Ends
    lanes: Lanes
    scratch: Scratch


def rules_of(task: Task, condition: ExplorationCondition) -> Rules:
    """The rules of a condition on the robot of a task."""
    dof = task.robot.dof
    follows = np.zeros((2, dof), dtype=np.bool_)
    explored = np.zeros((2, dof), dtype=np.bool_)
    base = np.array(["x" not in task.locked_base, "y" not in task.locked_base])
    for chosen, hand in enumerate(HANDS):
        own, others = task.robot.joints(hand), task.robot.joints(HANDS[1 - chosen])
        explored[chosen, :2] = condition.modify_chosen & base
        explored[chosen, own] = condition.modify_chosen
        explored[chosen, others] = condition.modify_other
        follows[chosen, others] = not condition.modify_other
    return Rules(
        hands=np.array(sorted(HANDS.index(hand) for hand in condition.hands), dtype=np.int64),
        follows=follows,
        explored=explored,
        exploration=_EXPLORATION[condition.hand_exploration],
        epsilon=float(condition.epsilon),
        noise_sd=float(condition.noise_sd),
        bias=float(condition.bias),
        corrects=bool(condition.corrects),
        ties=_TIES[condition.ties],
        rounding=_EQUALLY_NEAR if condition.equal_distance == "random" else -1.0,
        first_learns=condition.first_trial == "learns",
        explores_unknown=condition.unknown_target == "explores",
        update_equal=condition.update == "not-less",
        goal_alone=condition.state == "goal",
        by_subtask=condition.credit == "subtask",
        discount=float(condition.discount),
    )


def empty_tables(runs: int, goals: int, dof: int) -> Tables:
    """Tables in which nothing is learned."""
    shape = (runs, goals, 3, 2)
    return Tables(np.full(shape, -np.inf), np.full((*shape, dof), np.nan))


def empty_log(runs: int, goals: int, dof: int) -> Log:
    """Logs without movements."""
    goal, hand, kind, ticks = np.zeros((4, runs, 2 * goals), dtype=np.int64)
    return Log(
        count=np.zeros(runs, dtype=np.int64),
        goal=goal,
        hand=hand,
        kind=kind,
        ticks=ticks,
        target=np.zeros((runs, 2 * goals, dof)),
        hands=np.zeros((runs, goals), dtype=np.int64),
        reached=np.zeros((runs, goals, dof)),
    )


def work_for(runs: int, task: Task) -> Work:
    """Work space of runs, all counters 0. ValueError for more than there are lanes."""
    if runs > LANES:
        raise ValueError(f"{runs} runs at once; there are {LANES} lanes")
    q, target = np.zeros((2, runs, task.robot.dof))
    hand, previous, total = np.zeros((3, runs), dtype=np.int64)
    stored, aimed, going, acting = np.zeros((4, runs), dtype=np.bool_)
    return Work(
        q=q,
        target=target,
        hand=hand,
        previous=previous,
        stored=stored,
        aimed=aimed,
        going=going,
        acting=acting,
        total=total,
        counts=np.zeros((runs, len(COUNT)), dtype=np.int64),
        ends=ends_of(runs),
        lanes=lanes_for(task.robot),
        scratch=scratch_for(task.robot),
    )


@inlined
def _goal_distance(run: int, number: int, hand: int, problem: Any, work: Any) -> float:
    arm = arm_of(problem, hand)
    scratch = work.scratch
    joint_chain(work.q[run], arm, scratch.xs, scratch.ys)
    work.counts[run, COUNT.evaluations] += 1
    tip = len(arm.links)
    dx = problem.goals[number, 0] - scratch.xs[tip]
    dy = problem.goals[number, 1] - scratch.ys[tip]
    return math.sqrt(dx * dx + dy * dy)


@inner
def _greedy(values: Any, hands: Any) -> int:
    """Hand of the highest value; the first of equals."""
    best = hands[0]
    for hand in hands[1:]:
        if values[hand] > values[best]:
            best = hand
    return int(best)


@inner
def _equal(values: Any, hands: Any) -> bool:
    """Whether there are two hands, of equal value."""
    return len(hands) > 1 and bool(values[hands[0]] == values[hands[1]])


@inner
def _random_hand(hands: Any, rng: Any) -> int:
    return int(hands[int(rng.random() * len(hands))])


@inlined
def _closest_hand(run: int, number: int, problem: Any, rules: Any, rng: Any, work: Any) -> int:
    nearest = rules.hands[0]
    nearest_distance = _goal_distance(run, number, nearest, problem, work)
    tie = False
    for hand in rules.hands[1:]:
        distance = _goal_distance(run, number, hand, problem, work)
        tie = abs(distance - nearest_distance) <= rules.rounding
        if distance < nearest_distance:
            nearest, nearest_distance = hand, distance
    return int(_random_hand(rules.hands, rng)) if tie else int(nearest)


@inlined
def _untied(run: int, number: int, problem: Any, rules: Any, rng: Any, work: Any) -> int:
    """Which of two hands of equal value, where it is not always the left one."""
    hand = 1
    if rules.ties == 2:
        hand = _random_hand(rules.hands, rng)
    elif rules.ties == 3:
        left = _goal_distance(run, number, 0, problem, work)
        hand = 1 if _goal_distance(run, number, 1, problem, work) < left else 0
    elif rules.ties == 4:
        hand = 1 if work.previous[run] == 1 else 0
    return hand


@inlined
def _before(run: int, rules: Any, work: Any) -> int:
    """What the tables know of the goal before: its hand, or nothing."""
    return NO_HAND if rules.goal_alone else int(work.previous[run])


@inlined
def _choose_hands(
    number: int, explore: bool, problem: Any, rules: Any, tables: Any, rngs: Any, work: Any
) -> None:
    """The hand of every run: greedy, or with probability ε an explored one."""
    for run in range(len(work.q)):
        if not work.going[run]:
            continue
        hand = -1
        if explore and rules.exploration != 0:
            rng = generator_at(rngs, run)
            if rng.random() < rules.epsilon:
                if rules.exploration == 1:
                    hand = _random_hand(rules.hands, rng)
                else:
                    hand = _closest_hand(run, number, problem, rules, rng, work)
        if hand < 0:
            values = tables.value[run, number, _before(run, rules, work)]
            hand = _greedy(values, rules.hands)
            if rules.ties != 0 and _equal(values, rules.hands):
                hand = _untied(run, number, problem, rules, generator_at(rngs, run), work)
        work.hand[run] = hand


@inlined
def _set_target(
    target: Any, q: Any, stored: Any, hand: int, explore: bool, rules: Any, rng: Any
) -> None:
    """q^t = q*(s, a) + η; joints that are not to be modified keep their current values."""
    for j in range(len(q)):
        target[j] = q[j] if rules.follows[hand, j] else stored[j]
        if explore and rules.explored[hand, j]:
            target[j] += rules.noise_sd * rng.standard_normal()


@inlined
def _aim(
    number: int,
    first: bool,
    explore: bool,
    problem: Any,
    rules: Any,
    tables: Any,
    rngs: Any,
    work: Any,
) -> None:
    """Where something is learned, set the target; elsewhere see whether the goal is hit."""
    goal = goal_of(problem, number)
    for run in range(len(work.q)):
        work.acting[run] = False
        if not work.going[run]:
            continue
        hand, before = work.hand[run], _before(run, rules, work)
        stored = tables.target[run, number, before, hand]
        work.stored[run] = work.aimed[run] = tables.value[run, number, before, hand] > -math.inf
        if not work.stored[run] and rules.explores_unknown and explore and not first:
            work.aimed[run] = True
            stored = work.q[run]
        if not work.aimed[run]:
            distance = _goal_distance(run, number, hand, problem, work)
            work.ends.hit[run] = distance <= problem.radius
            continue
        rng = generator_at(rngs, run)
        _set_target(work.target[run], work.q[run], stored, hand, explore, rules, rng)
        if explore and rules.bias > 0.0:
            # The mean of η moves into the direction in which **A** would step from q*(s, a).
            arm, length = arm_of(problem, hand), rules.bias * rules.noise_sd
            explored = rules.explored[hand]
            shift_kernel(work.target[run], stored, arm, goal, explored, length, work.scratch)
            work.counts[run, COUNT.evaluations] += 1
            work.counts[run, COUNT.biased] += 1
        work.acting[run] = True


@inlined
def _record(log: Any, run: int, number: int, hand: int, kind: int, ticks: int, q: Any) -> None:
    row = log.count[run]
    log.goal[run, row] = number
    log.hand[run, row] = hand
    log.kind[run, row] = kind
    log.ticks[run, row] = ticks
    fill_row(log.target[run, row], q)
    log.count[run] = row + 1


@inlined
def _move(number: int, kind: int, problem: Any, log: Any, work: Any) -> None:
    """Move the acting runs to their targets and log it."""
    lanes, ends = work.lanes, work.ends
    count = 0
    for run in range(len(work.q)):
        if work.acting[run]:
            arm = arm_of(problem, work.hand[run])
            depart(lanes.at, count, run, work.q[run], work.target[run], arm)
            count += 1
    goal = goal_of(problem, number)
    stops = kind == LEARNED or problem.model.corrective_arrival
    move_lanes(lanes, count, goal, stops, problem.model, work.q, work.target, ends)
    for run in range(len(work.q)):
        if work.acting[run]:
            ticks = ends.ticks[run]
            work.total[run] += ticks
            work.counts[run, COUNT.ticks] += ticks
            _record(log, run, number, work.hand[run], kind, ticks, work.target[run])
            if kind == CORRECTIVE and not ends.hit[run]:
                work.counts[run, COUNT.failed] += 1
                work.going[run] = False


@inlined
def _correct(number: int, problem: Any, rules: Any, log: Any, work: Any) -> None:
    """Set the targets of runs that missed to what **A** finds; trials fail where it does not."""
    lanes, ends = work.lanes, work.ends
    count = 0
    for run in range(len(work.q)):
        work.acting[run] = False
        if not work.going[run]:
            continue
        if ends.hit[run]:
            if not work.aimed[run]:
                _record(log, run, number, work.hand[run], CORRECTIVE, 0, work.q[run])
        elif work.stored[run] and not rules.corrects:
            work.counts[run, COUNT.failed] += 1
            work.going[run] = False
        else:
            fill_row(work.target[run], work.q[run])
            board(lanes.at, count, run, work.q[run], arm_of(problem, work.hand[run]))
            count += 1
            work.acting[run] = True
    goal = goal_of(problem, number)
    correct_lanes(lanes, count, goal, problem.corrector, problem.model, work.target, ends)
    for run in range(len(work.q)):
        if work.acting[run]:
            work.counts[run, COUNT.iterations] += ends.iterations[run]
            converged = ends.converged[run]
            work.counts[run, COUNT.corrections if converged else COUNT.failed] += 1
            work.acting[run] = work.going[run] = converged


@inner
def _trial(
    first: bool,
    explore: bool,
    first_hands: Any,
    problem: Any,
    rules: Any,
    tables: Any,
    log: Any,
    rngs: Any,
    work: Any,
) -> None:
    """One trial of every run into ``log``; the ``first`` one with ``first_hands``."""
    for run in range(len(work.q)):
        fill_row(work.q[run], problem.start)
        work.previous[run] = NO_HAND
        work.going[run] = True
        work.total[run] = 0
        work.ends.evaluations[run] = 0
        log.count[run] = 0
    for number in range(len(problem.goals)):
        if first:
            work.hand[:] = first_hands[number]
        else:
            _choose_hands(number, explore, problem, rules, tables, rngs, work)
        _aim(number, first, explore, problem, rules, tables, rngs, work)
        for kind in range(2):
            if kind == CORRECTIVE:
                _correct(number, problem, rules, log, work)
            _move(number, kind, problem, log, work)
        for run in range(len(work.q)):
            if work.going[run]:
                log.hands[run, number] = work.hand[run]
                fill_row(log.reached[run, number], work.q[run])
                work.previous[run] = work.hand[run]
    for run in range(len(work.q)):
        work.counts[run, COUNT.evaluations] += work.ends.evaluations[run]


@inlined
def _update(run: int, reward: float, rules: Any, tables: Any, log: Any) -> None:
    """Credit what was visited with the reward of the trial, or each goal with its return."""
    row = log.count[run]
    later = 0.0
    for number in range(log.hands.shape[1] - 1, -1, -1):
        credit = reward
        if rules.by_subtask:
            ticks = 0
            while row > 0 and log.goal[run, row - 1] == number:
                row -= 1
                ticks += log.ticks[run, row]
            credit = later = rules.discount * later - ticks
        hand = log.hands[run, number]
        before = log.hands[run, number - 1] if number > 0 and not rules.goal_alone else NO_HAND
        value = tables.value[run, number, before, hand]
        if credit > value or (rules.update_equal and credit == value):
            tables.value[run, number, before, hand] = credit
            fill_row(tables.target[run, number, before, hand], log.reached[run, number])


@inlined
def _copy(run: int, source: Any, destination: Any) -> None:
    for row in range(source.count[run]):
        destination.goal[run, row] = source.goal[run, row]
        destination.hand[run, row] = source.hand[run, row]
        destination.kind[run, row] = source.kind[run, row]
        destination.ticks[run, row] = source.ticks[run, row]
        fill_row(destination.target[run, row], source.target[run, row])
    destination.count[run] = source.count[run]


@inner
def _learn_from(trial: int, rules: Any, tables: Any, kept: Any, log: Any, work: Any) -> None:
    """Keep the rewards of a trial; where it was completed, update Q and q*."""
    others = max(1, kept.rewards.shape[1] - 1)
    part = 0 if trial == 0 else 1 + (trial - 1) * PARTS // others
    for run in range(len(work.q)):
        kept.corrections[run, part] = work.counts[run, COUNT.corrections]
        reward = -work.total[run]
        kept.rewards[run, trial] = reward
        kept.completed[run, trial] = work.going[run]
        if not work.going[run]:
            continue
        if trial == 0:
            _copy(run, log, kept.first)
        if trial > 0 or rules.first_learns:
            _update(run, float(reward), rules, tables, log)
        best = kept.best_trial[run]
        if best < 0 or reward > kept.rewards[run, best]:
            kept.best_trial[run] = trial
            _copy(run, log, kept.best)


@entry
def learn_kernel(
    first_hands: Any,
    problem: Any,
    rules: Any,
    tables: Any,
    kept: Any,
    log: Any,
    rngs: Any,
    work: Any,
) -> None:
    """All trials of N runs, each with its own generator, and the replay of what they learned.

    ``first_hands`` (G,) are those of trial 0. ``tables`` and ``kept`` are filled; ``log``
    is overwritten by every trial.
    """
    trials = kept.rewards.shape[1]
    for trial in range(trials + 1):
        replay = trial == trials
        for run in range(len(work.q) if replay else 0):  # which is not part of the runs
            fill_row(kept.counts[run], work.counts[run])
        _trial(trial == 0, not replay, first_hands, problem, rules, tables, log, rngs, work)
        if not replay:
            _learn_from(trial, rules, tables, kept, log, work)
    for run in range(len(work.q)):
        kept.replayed[run] = work.going[run]
        _copy(run, log, kept.replay)
