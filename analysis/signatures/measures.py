"""Signatures of coarticulation: a number for each run of a method on a task.

Notation: run i hits goal g = 1..G at configuration q(i, g) with hand h(i, g), t(i, g) ticks after
the goal before; q(i, 0) is the start of the task. The corrective process alone, with the hands of
run i, takes c(i, g) ticks for goal g. r(q, g, h) are the ticks of a reach by the corrective process
from q to goal g with hand h, and R(q, g, h) is the configuration at its end. A signature has shape
``(n,)`` for n runs, and is NaN for a run without this signature.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from coartic import Execution, Hand, Task
from coartic.analysis.solutions import Solutions, initial_solution
from coartic.internal.arguments import checked_arguments
from coartic.motion.trial import reach_goals
from coartic.robot import HANDS, Array
from coartic.tasks.task import hands_of


def _other(hand: Hand) -> Hand:
    """Return the other hand."""
    return "right" if hand == "left" else "left"


def isolated_reaches(
    task: Task, q: Array, goals: ArrayLike, hands: ArrayLike
) -> tuple[Array, Array]:
    """Return the ticks r(q, g, h) of reaches by the corrective process from configuration q to goal
    g with hand h, and the configurations R(q, g, h) at their ends.

    Parameters
    ----------
    task : Task
    q : ndarray, shape (..., dof)
        Configurations at the start, length unit and rad.
    goals, hands : array_like of int, shapes that broadcast to (...)
        Numbers of goals, from 1 (ValueError for others), and places of hands in HANDS.

    Returns
    -------
    (ndarray, shape (...), ndarray, shape (..., dof))
        Ticks, 0 if the hand is within the goal at the start, NaN if the reach ends without a hit;
        and configurations at the end.
    """
    q, numbers = np.asarray(q), 1 + np.arange(len(task.goals))
    shape = q.shape[:-1]
    try:
        fit = np.broadcast_shapes(np.shape(goals), np.shape(hands), shape) == shape
    except ValueError:
        fit = False
    if not fit or not np.isin(goals, numbers).all():
        raise ValueError(f"needed are goals from 1 to {len(numbers)} and hands for q of {q.shape}")
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


@checked_arguments
def gain_at_next(runs: Solutions) -> Array:
    """Return the ticks that the posture at each goal saves on the way to the next goal, shape
    ``(n, G − 1)``: positive where the movement to the next goal is shorter.

    r(q', g + 1, h(i, g + 1)) − r(q'', g + 1, h(i, g + 1)),

    where q' = R(q(i, g − 1), g, h(i, g)) is the posture in which the corrective process would have
    hit goal g, and q'' is q(i, g) with the joints of the idle arm as in q', so that movements of
    the idle arm do not count. NaN if a reach ends without a hit.
    """
    task, hands = runs.task, runs.hands
    goals = 1 + np.arange(len(task.goals))
    now, following = np.s_[:, :-1], np.s_[:, 1:]
    alone, there = isolated_reaches(task, runs.starts[now], goals[:-1], hands[now])
    idle = np.zeros((len(HANDS), task.robot.dof), dtype=np.bool_)
    for number, hand in enumerate(HANDS):
        idle[number, task.robot.joints(_other(hand))] = True
    hit = np.where(idle[hands[now]], there, runs.configurations[now])
    after, nearer = (
        isolated_reaches(task, q, goals[1:], hands[following])[0] for q in (there, hit)
    )
    return np.where(np.isnan(alone), np.nan, after - nearer)


@checked_arguments
def ticks_slower(runs: Solutions) -> Array:
    """Return the ticks by which each chosen hand is slower for its goal alone, shape ``(n, G)`` for
    n runs and G goals.

    r(q(i, g − 1), g, h(i, g)) − min over hands h of r(q(i, g − 1), g, h): the ticks of the
    corrective process with the hand h(i, g) from the configuration at the hit before, less the
    ticks with the fastest hand; more than 0 for a hand that is not the fastest for this goal alone.
    Infinite if the reach with the chosen hand ends without a hit.
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
    """Return the share of the way to its next goal that the idle hand covers, shape ``(G,)``, for a
    completed ``run``.

    (d_held(g) − d(g)) / d_initial(g),

    where d(g) is the distance of the idle hand to the next goal of this hand at the hit of goal g;
    d_held(g) is this distance if the idle arm had kept its joints since its own last hit (or the
    start); and d_initial(g) is the distance of the same hand to the same goal at the hit of goal g
    in ``initial``, a completed run of the corrective process alone with the task's initial hands.
    NaN if the idle hand hits no later goal (always under exploration condition 1), or d_initial(g)
    is 0; else 0 if the idle arm keeps still, whatever the base does (always under condition 3).
    """
    now, hands = run.configurations, hands_of(run.hands)
    held = np.array(now)
    own_last = dict.fromkeys(HANDS, task.q0)
    for row, hand in zip(held, hands, strict=True):
        own_last[hand] = row.copy()
        joints = task.robot.joints(_other(hand))
        row[joints] = own_last[_other(hand)][joints]
    nearer = np.full(len(task.goals), np.nan)
    for k, idle in enumerate(map(_other, hands)):
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
    """A signature of coarticulation."""

    each: Callable[[Solutions], Array]
    """Function that returns the signature of each run, shape ``(n,)``, NaN for runs without it."""
    words: str
    """The quantity that the signature measures, in words with its unit."""


@checked_arguments
def hand(runs: Solutions) -> Array:
    """Return for each run, shape ``(n,)``, the share of goals before the last whose hand is not the
    fastest for that goal alone: 1 − mean over g < G of a(i, g) of :func:`as_in_isolation`. NaN on
    a task for one hand or with one goal."""
    alike = as_in_isolation(runs)[:, :-1]
    return np.asarray(1.0 - alike.mean(axis=1)) if alike.size else np.full(len(alike), np.nan)


@checked_arguments
def as_in_isolation(runs: Solutions) -> Array:
    """Return a(i, g) for run i and goal g, shape ``(n, G)``: 1 if the chosen hand is the fastest
    for goal g alone, or else 0; NaN on a task for one hand.

    a(i, g) = [r(q(i, g − 1), g, h(i, g)) = min over h of r(q(i, g − 1), g, h)].
    """
    if not runs.runs or len(runs.task.hands) < 2:
        return np.full((len(runs.runs), len(runs.task.goals)), np.nan)
    return np.asarray(ticks_slower(runs) == 0, dtype=np.float64)


@checked_arguments
def other_arm(runs: Solutions) -> Array:
    """Return for each run, shape ``(n,)``, the share of the way to its next goal that the idle hand
    covers, a mean of :func:`preshaping` over the goals where that is not NaN.

    Negative if on the whole the idle hand moves away. NaN on a task for one hand, without an
    initial solution, and for a run without such a goal.
    """
    initial = initial_solution(runs.task)
    if not runs.runs or initial is None or len(runs.task.hands) < 2:
        return np.full(len(runs.runs), np.nan)
    values = np.array([preshaping(runs.task, run, initial) for run in runs.runs])
    means, some = np.full(len(values), np.nan), ~np.isnan(values).all(axis=1)
    means[some] = np.nanmean(values[some], axis=1)
    return means


@checked_arguments
def arm(runs: Solutions) -> Array:
    """Return for each run, shape ``(n,)``, the ticks that the postures of base and chosen arm save
    on the way to the next goal: the mean of :func:`gain_at_next` over goals g < G; NaN if a gain of
    the run is NaN, and on a task with one goal."""
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
"""Signatures by their names in claims: ``first`` is t(i, 1) − c(i, 1), and ``whole`` is
Σ_g c(i, g) − t(i, g); NaN if the corrective process does not complete the task with the hands of
the run."""
