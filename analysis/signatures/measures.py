"""Signatures of coarticulation: one number for each run of a method on a task.

Claims compare them, and families of random tasks count them. In formulas, run i hits goal g at
configuration q(i, g) after t(i, g) ticks since the goal before; q(i, 0) is the start; c(i, g) are
the ticks of the corrective process alone with the hands of run i; G is the number of goals. A
signature has shape ``(n,)``, and is NaN where a run has none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coartic import Execution, Hand, Task
from coartic.analysis.solutions import Solutions, initial_solution
from coartic.motion.trial import reach_goals
from coartic.robot import HANDS, Array
from coartic.tasks.task import hands_of


def other(hand: Hand) -> Hand:
    """The hand that is not chosen."""
    return "right" if hand == "left" else "left"


def isolated_reaches(
    task: Task, q: Array, goals: NDArray[np.int64], hands: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Ticks in which hands reach goals from ``q`` by the corrective process alone, and where.

    ``q`` has shape ``(..., dof)``; ``goals``, which count from 1, and ``hands``, places in HANDS,
    have the shape before it or one that spreads to it. 0 ticks and ``q`` where the hand is there;
    NaN ticks where the corrective process brings it to no hit.
    """
    shape = q.shape[:-1]
    reached = reach_goals(
        task.robot,
        q.reshape(-1, q.shape[-1]),
        np.broadcast_to(hands, shape).ravel(),
        task.goal_array[np.broadcast_to(goals, shape).ravel() - 1],
        task.radius,
        locked_base=task.locked_base,
    )
    ticks = np.where(reached.hit, reached.ticks, np.nan)
    return ticks.reshape(shape), reached.q.reshape(q.shape)


def gain_at_next(runs: Solutions) -> Array:
    """Ticks that the posture at each goal saves at the next, shape ``(n, G − 1)``.

    How much sooner the corrective process reaches the next goal from where base and chosen arm of
    the run hit this one than from where it would have hit it itself, from the same posture before
    and with the hands of the run; what the other arm does meanwhile is left out. NaN where the
    corrective process does not hit.
    """
    task, hands = runs.task, runs.hands
    goals = 1 + np.arange(len(task.goals))
    now, following = np.s_[:, :-1], np.s_[:, 1:]
    alone, there = isolated_reaches(task, runs.starts[now], goals[:-1], hands[now])
    idle = np.zeros((len(HANDS), task.robot.dof), dtype=np.bool_)
    for number, hand in enumerate(HANDS):
        idle[number, task.robot.joints(other(hand))] = True
    hit = np.where(idle[hands[now]], there, runs.configurations[now])
    after, nearer = (
        isolated_reaches(task, q, goals[1:], hands[following])[0] for q in (there, hit)
    )
    return np.where(np.isnan(alone), np.nan, after - nearer)


def ticks_slower(runs: Solutions) -> Array:
    """Ticks by which each goal's hand is slower for that goal alone, shape ``(n, G)``.

    Slower than the hand with which the corrective process alone reaches the goal in the fewest
    ticks from the posture before; 0 for that hand and one as quick. Where it is above 0, the choice
    of hand serves other goals than its own. Infinite where the corrective process does not reach
    the goal with the hand.
    """
    goals = 1 + np.arange(len(runs.task.goals))
    alone = np.full((len(HANDS), *runs.hands.shape), np.inf)
    for hand in map(HANDS.index, runs.task.hands):
        reached, _ = isolated_reaches(runs.task, runs.starts, goals, np.array(hand))
        alone[hand] = np.where(np.isnan(reached), np.inf, reached)
    chosen = np.take_along_axis(alone, runs.hands[None], axis=0)[0]
    slower: Array = np.full_like(chosen, np.inf)
    np.subtract(chosen, alone.min(axis=0), out=slower, where=chosen < np.inf)
    return slower


def preshaping(task: Task, run: Execution, initial: Execution) -> Array:
    """Share of the way to its next goal that a hand covers while it waits, shape ``(G,)``.

    (d_held - d)/d_initial: d is the distance of the hand that is not chosen to the next goal it
    will hit, at the moment the current goal is hit; d_held the same if the arm had kept its joints
    since its own last hit (since the start, before any), with the base where it is; d_initial that
    of ``initial`` (the corrective process alone with the task's hands). -∞ to ∞: 0 where the arm
    keeps still, whatever the base does (always under the exploration conditions 1 and 3). NaN
    where the other hand hits no later goal.
    """
    now, hands = run.configurations, hands_of(run.hands)
    held = np.array(now)
    own_last = dict.fromkeys(HANDS, task.q0)
    for row, hand in zip(held, hands, strict=True):
        own_last[hand] = row.copy()
        joints = task.robot.joints(other(hand))
        row[joints] = own_last[other(hand)][joints]
    nearer = np.full(len(task.goals), np.nan)
    for k, idle in enumerate(map(other, hands)):
        if idle in hands[k:]:
            goal = task.goals[hands.index(idle, k)]
            reached, kept, initially = (
                np.linalg.norm(task.robot.forward_kinematics(q[k], idle) - goal)
                for q in (now, held, initial.configurations)
            )
            if initially > 0:
                nearer[k] = (1 - reached / initially) - (1 - kept / initially)
    return nearer


@dataclass(frozen=True)
class Signature:
    """A signature of coarticulation and its words."""

    each: Callable[[Solutions], Array]
    """The signature of each run, shape ``(n,)``; NaN where a run has none."""
    words: str

    def of(self, runs: Solutions) -> Array:
        """The signature of each run that has one, shape ``(k,)``."""
        values = self.each(runs)
        return values[np.isfinite(values)]


def hand(runs: Solutions) -> Array:
    """Share of the goals g < G at which the hand is not as in isolation."""
    alike = as_in_isolation(runs)[:, :-1]
    return np.asarray(1.0 - alike.mean(axis=1)) if alike.size else np.full(len(alike), np.nan)


def as_in_isolation(runs: Solutions) -> Array:
    """a(i, g) = [r(h) = min over hands of r], for the ticks r of a reach to g from q(i, g - 1).

    Shape ``(n, G)``; NaN on a task for one hand.
    """
    if not runs.runs or len(runs.task.hands) < 2:
        return np.full((len(runs.runs), len(runs.task.goals)), np.nan)
    return np.asarray(ticks_slower(runs) == 0, dtype=np.float64)


def other_arm(runs: Solutions) -> Array:
    """The mean of :func:`preshaping_of_the_other_arm` over the goals that have it."""
    values = preshaping_of_the_other_arm(runs)
    means, some = np.full(len(values), np.nan), ~np.isnan(values).all(axis=1)
    # The last goal counts as a missing value: the order of summation decides the last bit.
    padded = np.pad(values[some], ((0, 0), (0, 1)), constant_values=np.nan)
    means[some] = np.nanmean(padded, axis=1)
    return means


def preshaping_of_the_other_arm(runs: Solutions) -> Array:
    """(d_held(i, g) - d(i, g)) / d_initial(g), g < G, as :func:`preshaping` says.

    Shape ``(n, G - 1)``; NaN on a task for one hand, and without an initial solution.
    """
    initial = initial_solution(runs.task)
    if not runs.runs or initial is None or len(runs.task.hands) < 2:
        return np.full((len(runs.runs), len(runs.task.goals) - 1), np.nan)
    return np.array([preshaping(runs.task, run, initial)[:-1] for run in runs.runs])


def arm(runs: Solutions) -> Array:
    """r(i, g + 1) - r'(i, g + 1), mean over g < G, as :func:`gain_at_next` says."""
    if not runs.runs or len(runs.task.goals) < 2:
        return np.full(len(runs.runs), np.nan)
    return np.asarray(gain_at_next(runs).mean(axis=1))


SIGNATURES = {
    "hand": Signature(
        hand,
        "share of the goals that others follow which are hit with the slower hand for them alone",
    ),
    "arm": Signature(
        arm,
        "ticks by which the posture of base and chosen arm leaves the next goal nearer, with the "
        "idle arm where it was (mean over goals)",
    ),
    "other arm": Signature(
        other_arm,
        "share of the initial distance to its next goal by which the idle arm brings its hand "
        "nearer (mean over goals)",
    ),
    "first": Signature(
        lambda runs: runs.against_same_hands[:, 0],
        "ticks by which the first movement is longer than the corrective process's with the same "
        "hands",
    ),
    "whole": Signature(
        lambda runs: -runs.against_same_hands.sum(axis=1),
        "ticks by which the whole task is shorter than the corrective process's",
    ),
}
"""Every signature by its name in claims, in the order of the tables: ``first`` is t(i, 1) -
c(i, 1), ``whole`` Σ_g c(i, g) - t(i, g); both are NaN where the corrective process fails with the
hands."""
