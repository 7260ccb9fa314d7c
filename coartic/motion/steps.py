"""A step of the environments (:mod:`coartic.gym`): N robots side by side, each at a goal of its own
trial; from actions to rewards and what is seen."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from coartic.motion.compiled import entry, fill_row, inlined, inner
from coartic.motion.reach import Batch, correct_missed, find_corrections, move_acting
from coartic.motion.slots import SLOTS


class VectorState(NamedTuple):
    """State of N environments, each on one of T tasks, and work space."""

    task: Any  # (N,) number of it
    goal: Any  # (N,) index of the next one
    q: Any  # (N, D)
    going: Any  # (N,) whether the trial goes on
    actions: Any  # (N, A) for the hand, if there are two, and for each joint
    rewards: Any  # (N,) of the step
    seen: Any  # (N, O) see look
    robot_parameters: Any  # (K,) records of robots, locks and radius: see robot_parameters_for
    kinds: Any  # (T,) which of them a task has
    goals: Any  # (T, G, 2), of which the task has as many as counts says
    counts: Any  # (T,)
    movable: Any  # (T, E) whether its robot can move the joints
    joints: Any  # (E,) indices in a configuration of the joints that are seen and moved
    sides: Any  # (H,) the hands of all robots: 0 left, 1 right
    ahead: int  # goals that are seen beyond the next one
    reach: float  # how far from the middle a target can be, length unit or rad
    failed: float  # reward of a step in which the corrective process fails
    runs: Any  # (H, SLOTS) records, for some robots with each hand: see runs_for
    slots: Any
    indices: Any  # (SLOTS,) indices of their environments


@inner
def squared_distance(run: Any) -> float:
    """Squared joint distance to the solution of the corrective process; infinite without one."""
    square = 0.0 if run.converged else math.inf
    for j in range(len(run.q)):
        square += (run.target[j] - run.q[j]) ** 2
    return square


@inlined
def step_lot(count: int, robot_parameters: Any, state: Any) -> None:
    """A step of as many robots as there is room for."""
    for h in range(len(state.sides)):
        for i in range(count):
            run, n = state.runs[h, i], state.indices[i]
            fill_row(run.q, state.q[n])
            fill_row(run.goal, state.goals[state.task[n], state.goal[n]])
            run.hand, run.hit, run.going, run.corrects = state.sides[h], False, True, True
        find_corrections(count, robot_parameters, Batch(state.runs[h], state.slots))
    batch, joints = Batch(state.runs[0], state.slots), len(state.joints)
    for i in range(count):
        run, n = batch.runs[i], state.indices[i]
        if len(state.sides) > 1:
            other = state.runs[1, i]
            if (squared_distance(other) < squared_distance(run)) != (state.actions[n, 0] > 0.5):
                run.hand, run.converged = other.hand, other.converged
                fill_row(run.target, other.target)
        if not run.converged:
            fill_row(run.target, run.q)
        for k in range(joints):
            if state.movable[state.task[n], k]:
                share = min(max(state.actions[n, len(state.sides) - 1 + k], -1.0), 1.0)
                run.target[state.joints[k]] += state.reach * share
        run.acting = True
    move_acting(count, True, robot_parameters, batch)
    for i in range(count):
        state.rewards[state.indices[i]] = -batch.runs[i].ticks
    correct_missed(count, robot_parameters, batch)
    for i in range(count):
        run, n = batch.runs[i], state.indices[i]
        fill_row(state.q[n], run.q)
        state.goal[n] += run.hit
        state.rewards[n] = state.rewards[n] - run.ticks if run.hit else state.failed
        state.going[n] = run.hit and state.goal[n] < state.counts[state.task[n]]


@entry
def look(state: Any) -> None:
    """Fill in what each robot sees: whether there is a goal, places of goals from the base, joints,
    and, where there is room for it, whether the robot can move them."""
    goals, joints = state.ahead + 1, len(state.joints)
    for n in range(len(state.task)):
        seen, task = state.seen[n], state.task[n]
        for k in range(goals):
            goal = state.goal[n] + k
            there = goal < state.counts[task]
            seen[k] = there
            for axis in range(2):
                place = state.goals[task, goal, axis] - state.q[n, axis] if there else 0.0
                seen[goals + 2 * k + axis] = place
        for k in range(joints):
            seen[3 * goals + k] = state.q[n, state.joints[k]]
            if len(seen) > 3 * goals + joints:
                seen[3 * goals + joints + k] = state.movable[task, k]


@entry
def step_robots(state: Any) -> int:
    """Let all robots whose trial goes on reach for their next goal.

    Returns -1; or, and then nothing is done, the number of a robot whose action has NaN.
    """
    last = len(state.task) - 1
    for n in range(last + 1):
        for figure in state.actions[n]:
            if math.isnan(figure):
                return n
    for kind in range(len(state.robot_parameters)):  # robots of a kind are moved together
        count = 0
        for n in range(last + 1):
            if state.going[n] and state.kinds[state.task[n]] == kind:
                state.indices[count] = n
                count += 1
            if count == SLOTS or (n == last and count > 0):
                step_lot(count, state.robot_parameters[kind], state)
                count = 0
    look(state)
    return -1
