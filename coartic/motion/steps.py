"""A step of the environments (:mod:`coartic.gym`): N robots side by side, each at a goal of its own
trial; from actions to rewards and what is seen."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from coartic.motion.compiled import entry, fill_row, inlined, inner
from coartic.motion.lanes import LANES
from coartic.motion.reach import Batch, correct_missed, find_corrections, move_acting


class Fleet(NamedTuple):
    """N robots, with T tasks on which they can be, and room to work."""

    task: Any  # (N,) number of it
    goal: Any  # (N,) index of the next one
    q: Any  # (N, D)
    going: Any  # (N,) whether the trial goes on
    actions: Any  # (N, A) for the hand, if there are two, and for each joint
    rewards: Any  # (N,) of the step
    seen: Any  # (N, O) see look
    setups: Any  # (K,) records of robots, locks and radius: see setup_for
    kinds: Any  # (T,) which of them a task has
    goals: Any  # (T, G, 2), of which the task has as many as counts says
    counts: Any  # (T,)
    movable: Any  # (T, E) whether its robot can move the joints
    joints: Any  # (E,) indices in a configuration of the joints that are seen and moved
    sides: Any  # (H,) the hands of all robots: 0 left, 1 right
    ahead: int  # goals that are seen beyond the next one
    reach: float  # how far from the middle a target can be, length unit or rad
    failed: float  # reward of a step in which the corrective process fails
    runs: Any  # (H, LANES) records, for some robots with each hand: see runs_for
    lanes: Any
    members: Any  # (LANES,) which robots they are


@inner
def way(run: Any) -> float:
    """Square of the way to where the corrective process would bring the robot."""
    square = 0.0 if run.converged else math.inf
    for j in range(len(run.q)):
        square += (run.target[j] - run.q[j]) ** 2
    return square


@inlined
def step_lot(count: int, setup: Any, fleet: Any) -> None:
    """A step of as many robots as there is room for."""
    for h in range(len(fleet.sides)):
        for i in range(count):
            run, n = fleet.runs[h, i], fleet.members[i]
            fill_row(run.q, fleet.q[n])
            fill_row(run.goal, fleet.goals[fleet.task[n], fleet.goal[n]])
            run.hand, run.hit, run.going, run.corrects = fleet.sides[h], False, True, True
        find_corrections(count, setup, Batch(fleet.runs[h], fleet.lanes))
    batch, joints = Batch(fleet.runs[0], fleet.lanes), len(fleet.joints)
    for i in range(count):
        run, n = batch.runs[i], fleet.members[i]
        if len(fleet.sides) > 1:
            other = fleet.runs[1, i]
            if (way(other) < way(run)) != (fleet.actions[n, 0] > 0.5):
                run.hand, run.converged = other.hand, other.converged
                fill_row(run.target, other.target)
        if not run.converged:
            fill_row(run.target, run.q)
        for k in range(joints):
            if fleet.movable[fleet.task[n], k]:
                share = min(max(fleet.actions[n, len(fleet.sides) - 1 + k], -1.0), 1.0)
                run.target[fleet.joints[k]] += fleet.reach * share
        run.acting = True
    move_acting(count, True, setup, batch)
    for i in range(count):
        fleet.rewards[fleet.members[i]] = -batch.runs[i].ticks
    correct_missed(count, setup, batch)
    for i in range(count):
        run, n = batch.runs[i], fleet.members[i]
        fill_row(fleet.q[n], run.q)
        fleet.goal[n] += run.hit
        fleet.rewards[n] = fleet.rewards[n] - run.ticks if run.hit else fleet.failed
        fleet.going[n] = run.hit and fleet.goal[n] < fleet.counts[fleet.task[n]]


@entry
def look(fleet: Any) -> None:
    """Fill in what each robot sees: whether there is a goal, places of goals from the base, joints,
    and, where there is room for it, whether the robot can move them."""
    goals, joints = fleet.ahead + 1, len(fleet.joints)
    for n in range(len(fleet.task)):
        seen, task = fleet.seen[n], fleet.task[n]
        for k in range(goals):
            goal = fleet.goal[n] + k
            there = goal < fleet.counts[task]
            seen[k] = there
            for axis in range(2):
                place = fleet.goals[task, goal, axis] - fleet.q[n, axis] if there else 0.0
                seen[goals + 2 * k + axis] = place
        for k in range(joints):
            seen[3 * goals + k] = fleet.q[n, fleet.joints[k]]
            if len(seen) > 3 * goals + joints:
                seen[3 * goals + joints + k] = fleet.movable[task, k]


@entry
def step_robots(fleet: Any) -> int:
    """Let all robots whose trial goes on reach for their next goal.

    Returns -1; or, and then nothing is done, the number of a robot whose action has NaN.
    """
    last = len(fleet.task) - 1
    for n in range(last + 1):
        for figure in fleet.actions[n]:
            if math.isnan(figure):
                return n
    for kind in range(len(fleet.setups)):  # robots of a kind are moved together
        count = 0
        for n in range(last + 1):
            if fleet.going[n] and fleet.kinds[fleet.task[n]] == kind:
                fleet.members[count] = n
                count += 1
            if count == LANES or (n == last and count > 0):
                step_lot(count, fleet.setups[kind], fleet)
                count = 0
    look(fleet)
    return -1
