"""The dual-process learner: trial and error over the corrective process.

The paper's section *The Learning Process* and Figure 3. Per trial and goal: choose a
hand, perturb the stored target configuration, move, and let the corrective process
finish where the goal was missed. A trial better than any before it that passed
through the same state and hand replaces what is stored there.

One run is one call of a compiled kernel (:mod:`coartic.learning` makes it). It draws
from the NumPy generator it is given (``default_rng(seed)``, PCG64), per trial and goal
in this order: a uniform number against ε, where hands are explored; a second one that
picks a hand, where the first fell below ε and the pick is random; one standard normal
per explored joint, in the order of ``q``, where a target is stored; a bias draws
nothing. Runs share nothing, so any number of them may go on at once.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from coartic.compiled import entry, inlined, inner, joint_chain
from coartic.corrective import correct_kernel, shift_kernel
from coartic.exploration import ExplorationCondition
from coartic.movement import Scratch, move_kernel, scratch_for
from coartic.problem import arm_of, goal_of
from coartic.robot import HANDS
from coartic.task import Task

NO_HAND = 2  # ∅, the previous hand before goal 1
LEARNED, CORRECTIVE = 0, 1
_EXPLORATION = {"none": 0, "random": 1, "closest": 2}
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


class Tables(NamedTuple):
    """What is learned, by goal, previous hand (left, right, none) and hand."""

    value: Any  # Q, (G, 3, 2)
    target: Any  # q*, (G, 3, 2, dof)


class Log(NamedTuple):
    """The movements of one trial, and where it stood when each goal was hit."""

    count: Any  # (1,)
    goal: Any  # (2 G,)
    hand: Any
    kind: Any
    ticks: Any
    target: Any  # (2 G, dof)
    hands: Any  # (G,)
    reached: Any  # (G, dof)


class Kept(NamedTuple):
    """What is kept of the trials of a run."""

    rewards: Any  # (T,)
    completed: Any  # (T,)
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


class Work(NamedTuple):
    """What a trial works on."""

    q: Any  # (dof,) where the robot is
    target: Any  # (dof,) where it is to go
    counts: Any
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
    )


def empty_tables(goals: int, dof: int) -> Tables:
    """Tables in which nothing is learned."""
    return Tables(np.full((goals, 3, 2), -np.inf), np.full((goals, 3, 2, dof), np.nan))


def empty_log(goals: int, dof: int) -> Log:
    """A log without movements."""
    rows = 2 * goals
    return Log(
        count=np.zeros(1, dtype=np.int64),
        goal=np.zeros(rows, dtype=np.int64),
        hand=np.zeros(rows, dtype=np.int64),
        kind=np.zeros(rows, dtype=np.int64),
        ticks=np.zeros(rows, dtype=np.int64),
        target=np.zeros((rows, dof)),
        hands=np.zeros(goals, dtype=np.int64),
        reached=np.zeros((goals, dof)),
    )


def work_for(task: Task) -> Work:
    """Work space of one run, all counters 0."""
    q = np.empty(task.robot.dof)
    counts = np.zeros(len(COUNT), dtype=np.int64)
    return Work(q, np.empty_like(q), counts, scratch_for(task.robot))


@inlined
def _goal_distance(number: int, hand: int, problem: Any, work: Any) -> float:
    arm = arm_of(problem, hand)
    scratch = work.scratch
    joint_chain(work.q, arm, scratch.xs, scratch.ys)
    work.counts[COUNT.evaluations] += 1
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
def _random_hand(hands: Any, rng: Any) -> int:
    return int(hands[int(rng.random() * len(hands))])


@inner
def _explored_hand(number: int, values: Any, problem: Any, rules: Any, rng: Any, work: Any) -> int:
    if rules.exploration == 0 or rng.random() >= rules.epsilon:
        return int(_greedy(values, rules.hands))
    if rules.exploration == 1:
        return int(_random_hand(rules.hands, rng))
    nearest = rules.hands[0]
    nearest_distance = _goal_distance(number, nearest, problem, work)
    tie = False
    for hand in rules.hands[1:]:
        distance = _goal_distance(number, hand, problem, work)
        tie = abs(distance - nearest_distance) <= _EQUALLY_NEAR
        if distance < nearest_distance:
            nearest, nearest_distance = hand, distance
    if tie:
        return int(_random_hand(rules.hands, rng))
    return int(nearest)


@inlined
def _record(log: Any, number: int, hand: int, kind: int, ticks: int, target: Any) -> None:
    row = log.count[0]
    log.goal[row] = number
    log.hand[row] = hand
    log.kind[row] = kind
    log.ticks[row] = ticks
    log.target[row] = target
    log.count[0] = row + 1


@inlined
def _set_target(stored: Any, hand: int, explore: bool, rules: Any, rng: Any, work: Any) -> None:
    """q^t = q*(s, a) + η; joints that are not to be modified keep their current values."""
    for j in range(len(work.q)):
        work.target[j] = work.q[j] if rules.follows[hand, j] else stored[j]
        if explore and rules.explored[hand, j]:
            work.target[j] += rules.noise_sd * rng.standard_normal()


@inlined
def _shift_target(
    stored: Any, number: int, hand: int, problem: Any, rules: Any, work: Any
) -> None:
    """Move the mean of η into the direction in which **A** would step from q*(s, a)."""
    arm, goal = arm_of(problem, hand), goal_of(problem, number)
    length = rules.bias * rules.noise_sd
    shift_kernel(work.target, stored, arm, goal, rules.explored[hand], length, work.scratch)
    work.counts[COUNT.evaluations] += 1
    work.counts[COUNT.biased] += 1


@inlined
def _move(
    number: int, hand: int, kind: int, problem: Any, log: Any, work: Any
) -> tuple[int, bool]:
    """Move to the target and log it; ticks, goal hit."""
    arm, goal = arm_of(problem, hand), goal_of(problem, number)
    ticks, hit, evaluations = move_kernel(
        work.q, work.target, arm, goal, kind == LEARNED, problem.model, work.scratch
    )
    work.counts[COUNT.evaluations] += evaluations
    work.counts[COUNT.ticks] += ticks
    _record(log, number, hand, kind, ticks, work.target)
    return ticks, hit


@inlined
def _correct(number: int, hand: int, problem: Any, work: Any) -> bool:
    """Set the target to what **A** finds from here; whether it found anything."""
    work.target[:] = work.q
    arm, goal = arm_of(problem, hand), goal_of(problem, number)
    converged, iterations = correct_kernel(
        work.target, arm, goal, problem.corrector, problem.model, work.scratch
    )
    work.counts[COUNT.iterations] += iterations
    work.counts[COUNT.evaluations] += iterations + 1
    return converged


@inner
def _trial(
    forced: Any,
    explore: bool,
    problem: Any,
    rules: Any,
    tables: Any,
    log: Any,
    rng: Any,
    work: Any,
) -> tuple[bool, int]:
    """One trial into ``log``; completed, ticks. ``forced`` hands, if any, are used."""
    work.q[:] = problem.start
    log.count[0] = 0
    total = 0
    previous = NO_HAND
    for goal in range(len(problem.goals)):
        values = tables.value[goal, previous]
        if len(forced) > 0:
            hand = int(forced[goal])
        elif explore:
            hand = _explored_hand(goal, values, problem, rules, rng, work)
        else:
            hand = _greedy(values, rules.hands)

        known = values[hand] > -math.inf
        if known:
            stored = tables.target[goal, previous, hand]
            _set_target(stored, hand, explore, rules, rng, work)
            if explore and rules.bias > 0.0:
                _shift_target(stored, goal, hand, problem, rules, work)
            ticks, hit = _move(goal, hand, LEARNED, problem, log, work)
            total += ticks
        else:
            hit = _goal_distance(goal, hand, problem, work) <= problem.radius
            if hit:
                _record(log, goal, hand, CORRECTIVE, 0, work.q)
        if not hit:
            if known and not rules.corrects:
                work.counts[COUNT.failed] += 1
                return False, total
            if not _correct(goal, hand, problem, work):
                work.counts[COUNT.failed] += 1
                return False, total
            work.counts[COUNT.corrections] += 1
            # It ends inside the goal: the model's tolerance is below the radius.
            ticks, _ = _move(goal, hand, CORRECTIVE, problem, log, work)
            total += ticks
        log.hands[goal] = hand
        log.reached[goal] = work.q
        previous = hand
    return True, total


@inner
def _update(reward: float, tables: Any, log: Any) -> None:
    previous = NO_HAND
    for goal in range(len(log.hands)):
        hand = log.hands[goal]
        if reward > tables.value[goal, previous, hand]:
            tables.value[goal, previous, hand] = reward
            tables.target[goal, previous, hand] = log.reached[goal]
        previous = hand


@inner
def _copy(source: Any, destination: Any) -> None:
    for row in range(source.count[0]):
        destination.goal[row] = source.goal[row]
        destination.hand[row] = source.hand[row]
        destination.kind[row] = source.kind[row]
        destination.ticks[row] = source.ticks[row]
        destination.target[row] = source.target[row]
    destination.count[0] = source.count[0]


@entry
def learn_kernel(
    first_hands: Any,
    problem: Any,
    rules: Any,
    tables: Any,
    kept: Any,
    log: Any,
    rng: Any,
    work: Any,
) -> tuple[int, bool]:
    """All trials of one run; best trial (or -1), replay completed.

    ``first_hands`` (G,) are those of trial 0. ``tables`` and ``kept`` are filled; ``log``
    is overwritten by every trial.
    """
    free_choice = first_hands[:0]
    best_trial = -1
    for trial in range(len(kept.rewards)):
        forced = first_hands if trial == 0 else free_choice
        done, ticks = _trial(forced, True, problem, rules, tables, log, rng, work)
        kept.rewards[trial] = -ticks
        kept.completed[trial] = done
        if not done:
            continue
        if trial == 0:
            _copy(log, kept.first)
        _update(-float(ticks), tables, log)
        if best_trial < 0 or -ticks > kept.rewards[best_trial]:
            best_trial = trial
            _copy(log, kept.best)
    spent = work.counts.copy()
    replayed, _ = _trial(free_choice, False, problem, rules, tables, kept.replay, rng, work)
    work.counts[:] = spent  # the replay is not part of the run
    return best_trial, replayed
