"""A step of the environments (:mod:`coartic.gym`): N robots side by side, each at a goal of its own
trial; from actions to rewards and observations."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.method.optimisers import FAILED
from coartic.motion.batch import SLOTS, Batch, RobotRecord, RunRecord, squared_distance
from coartic.motion.compile import entry, fill_row, inlined
from coartic.motion.trial import (
    MOVE,
    account,
    begin,
    find_corrections,
    make_corrections,
    move_runs,
    set_off,
)
from coartic.robot import Array, Configs, Hands, Points

Integers = NDArray[np.int64]


class VectorState(NamedTuple):
    """State of N environments, each on one of T tasks with G goals at most, and work space."""

    task: Integers
    """Number of the task, from 0, shape ``(N,)``."""
    goal: Integers
    """Index of the next goal, from 0, shape ``(N,)``."""
    q: Configs
    """Configurations, shape ``(N, dof)``, length unit and rad."""
    going: NDArray[np.bool_]
    """True where the trial goes on, shape ``(N,)``."""
    actions: Array
    """Shape ``(N, A)``: an entry for the hand, if there are two, and one for each joint."""
    rewards: Array
    """Rewards of the step, ticks, shape ``(N,)``."""
    seen: NDArray[np.float32]
    """Observations, shape ``(N, O)`` (:func:`observe`)."""
    parameters: NDArray[np.void]
    """Robot parameters of each kind of robot (links, locks and radius), shape ``(K,)``."""
    kinds: Integers
    """Index in ``parameters`` of each task's robot, shape ``(T,)``; -1 for a task that is not
    loaded."""
    goals: Points
    """Centres of goals, shape ``(T, G, 2)``; a task has the first ``counts``."""
    counts: Integers
    """Number of goals of each task, shape ``(T,)``."""
    movable: NDArray[np.bool_]
    """True where the robot of a task can move a joint, shape ``(T, E)``."""
    joints: Integers
    """Indices in a configuration of the joints that are seen and moved, shape ``(E,)``."""
    sides: Hands
    """The hands that all robots have, 0 left or 1 right, shape ``(H,)``."""
    ahead: int
    """Number of goals that are seen beyond the next goal."""
    reach: float
    """Half the width of the box of targets, length unit (base) and rad (joints)."""
    runs: NDArray[np.void]
    """Runs, with each hand, of a lot: robots of a kind that move together, shape ``(H, SLOTS)``."""
    at: NDArray[np.void]
    """Rows of the slots of these robots (:class:`Batch`)."""
    corrected: Array
    """The rows in ``at`` that a correction needs, shape ``(rows, SLOTS)``."""
    moved: Array
    """The rows in ``at`` that a movement needs, shape ``(rows, SLOTS)``."""
    accounts: NDArray[np.void]
    """Accounts of the goals of the robots of a lot, shape ``(SLOTS,)``."""
    indices: Integers
    """Numbers, from 0, of the robots of a lot, shape ``(SLOTS,)``."""


@inlined
def _aim_by_action(
    run: RunRecord, other: RunRecord, movable: Any, action: Any, state: VectorState
) -> None:
    """Set ``hand``, ``target``, ``converged`` and ``action`` (MOVE) of ``run``, in place, from an
    action ``(A,)``, as :class:`.TaskVectorEnv` says. ``run`` and, with two hands, ``other`` have
    the solutions of the corrective process; ``movable``, ``(E,)``, is True for joints that move."""
    if len(state.sides) > 1:
        is_farther = not run.converged or squared_distance(other) < squared_distance(run)
        if (other.converged and is_farther) != (action[0] > 0.5):
            run.hand, run.converged = other.hand, other.converged
            fill_row(run.target, other.target)
    if not run.converged:
        fill_row(run.target, run.q)
    for k in range(len(state.joints)):
        if movable[k]:
            share = min(max(action[len(state.sides) - 1 + k], -1.0), 1.0)
            run.target[state.joints[k]] += state.reach * share
    run.action = MOVE


@inlined
def _step_lot(count: int, robot: RobotRecord, state: VectorState) -> None:
    """Let the robots whose numbers are the first ``count`` of ``state.indices``, at most 72 and all
    of the kind that record ``robot`` describes, reach for their next goal by ``state.actions``;
    change ``q``, ``goal``, ``rewards``, ``going`` and work space of ``state`` in place."""
    for h in range(len(state.sides)):
        for i in range(count):
            n, run = state.indices[i], state.runs[h, i]
            set_off(run, state.q[n])
            begin(run, state.goals[state.task[n], state.goal[n]])
            run.hand = state.sides[h]
        batch = Batch(state.runs[h], state.at, state.corrected, state.moved)
        find_corrections(count, robot, batch)
    batch = Batch(state.runs[0], state.at, state.corrected, state.moved)
    others = state.runs[len(state.sides) - 1]
    for i in range(count):
        n = state.indices[i]
        _aim_by_action(
            batch.runs[i], others[i], state.movable[state.task[n]], state.actions[n], state
        )
    move_runs(count, robot, batch)
    for i in range(count):
        state.accounts[i].moved = batch.runs[i].ticks
    find_corrections(count, robot, batch)
    make_corrections(count, robot, batch)
    for i in range(count):
        n, goal = state.indices[i], state.accounts[i]
        account(batch.runs[i], goal.moved, goal)
        fill_row(state.q[n], goal.q)
        state.goal[n] += goal.hit
        state.rewards[n] = -goal.ticks if goal.hit else -FAILED
        state.going[n] = goal.hit and state.goal[n] < state.counts[state.task[n]]


@entry
def observe(*fields: Any) -> None:
    """Fill in the observations ``seen`` of a :class:`VectorState`, in place, as
    :class:`.TaskVectorEnv` says; ``fields`` are the entries of the state, in order."""
    state = VectorState(*fields)
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
def step_robots(*fields: Any) -> int:
    """Let all robots whose trial goes on reach for their next goal; change arrays among
    ``fields``, the entries of a :class:`VectorState`, in place. Return the number of trials that
    make their first step; -1 - n, without a movement, if robot n, from 0, is the first whose action
    is not finite."""
    state = VectorState(*fields)
    last, begun = len(state.task) - 1, 0
    for n in range(last + 1):
        begun += state.going[n] and state.goal[n] == 0
        for k in range(state.actions.shape[1]):
            if not math.isfinite(state.actions[n, k]):
                return -1 - n
    for kind in range(len(state.parameters)):  # robots of a kind are moved together
        count = 0
        for n in range(last + 1):
            if state.going[n] and state.kinds[state.task[n]] == kind:
                state.indices[count] = n
                count += 1
            if count == SLOTS or (n == last and count > 0):
                _step_lot(count, state.parameters[kind], state)
                count = 0
    observe(*state)
    return begun
