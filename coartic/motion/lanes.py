"""Many arms side by side: the arrays on which the compiled kernels work.

A lane holds one arm that moves or is corrected. Each quantity is a row over lanes, and the
innermost loop of a kernel runs over lanes, so that the compiler makes vector instructions of
it; the number of links belongs to the type of the rows, so that the loops over links are
unrolled before. No operation mixes lanes and none is reordered or fused: what a lane gives
does not depend on its neighbours, on their number or on the width of the vectors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.motion.compiled import chain_by, inlined, inner, record_type
from coartic.motion.trigonometry import LARGEST, cosine, near_cosine, near_sine, sine
from coartic.robot import BASE_DOF, Arm, Robot

LANES = 72
"""Most lanes at once: they and their rows stay in the innermost cache."""
_VECTOR = 8  # lanes that vectors hold; LANES is a multiple of it
GOING = 0.0
"""Fate of a lane that has not ended."""


class Lanes(NamedTuple):
    """Lanes and who is in them."""

    at: Any
    """The rows, by name (:func:`layout`): a record in an array of shape ``(1,)``."""
    corrected: Any
    """The rows of an arm that is corrected: the same memory, shape ``(rows, LANES)``. Only to be
    copied: some are integers."""
    moved: Any
    """The rows of an arm that moves."""


def links_for(robot: Robot) -> int:
    """Links for which kernels are compiled: four, eight, or those of an arm that has more, so that
    all robots of a family share their machine code."""
    return 4 if robot.most_links <= 4 else max(robot.most_links, 8)


def width_of(robot: Robot) -> int:
    """Figures of a configuration in records: of the robot's, and then zeros, as many as with two
    arms of :func:`links_for`, so that kernels are compiled once for a number of links."""
    return BASE_DOF + 2 * links_for(robot)


def runs_for(count: int, robot: Robot) -> NDArray[np.void]:
    """Room for so many runs that are moved and corrected, a record each."""
    return np.zeros(count, run_type(width_of(robot)))


@cache
def run_type(width: int) -> np.dtype[np.void]:
    """Type of the record of a run whose configurations have so many figures."""
    fields = {
        "q": (np.float64, width),  # where the robot is
        "target": (np.float64, width),  # where it is to go, or what a correction has found
        "goal": (np.float64, 2),  # x and y, length unit
        "hand": np.int64,  # that is to hit the goal: 0 left, 1 right
        "how": np.int64,  # it acts next: see coartic.motion.reach
        "corrects": np.bool_,  # whether the corrective process finishes what it misses
        "going": np.bool_,  # whether it has missed no goal so far
        "acting": np.bool_,  # whether the run is among those that are moved or corrected next
        "hit": np.bool_,  # whether the hand is within the goal's radius
        "converged": np.bool_,  # whether the corrective process did
        "ticks": np.int64,  # of the movement
        "iterations": np.int64,  # of the corrective process
        "evaluations": np.int64,  # of forward kinematics, in all
    }
    return record_type(fields)


def lanes_for(robot: Robot) -> Lanes:
    """Lanes for either arm of a robot; shorter ones end in links of length 0."""
    record, corrected, moved = layout(links_for(robot))
    at = np.zeros(1, record)
    rows = at.view(np.float64).reshape(-1, LANES)
    return Lanes(at, rows[corrected], rows[moved])


@cache
def layout(links: int) -> tuple[np.dtype[np.void], slice, slice]:
    """The rows of arms of so many links; which of them a correction needs, and a movement."""
    joints = (BASE_DOF + links,)
    corrected = {"q": joints}  # base x and y, then the joints of the arm
    shared = {
        "run": (),  # which is in the lane: its index
        "first": (),  # index in a configuration of the first joint of its arm
        "links": (),  # of its arm
        "length": (links,),
        "shoulder": (2,),
        "goal": (2,),
        "start": joints,
    }
    moved = {
        "target": joints,
        "rate": (links,),  # of the absolute link angles, rad a step
        "base_rate": (2,),
        "end": (2,),  # of the hand, where the target would put it
        "distance": (),  # from start to target; its square, before the arm sets off
        **dict.fromkeys(("step", "last", "slowness", "bend", "clearance"), ()),
    }
    passing = {"x": (links + 1,), "y": (links + 1,), "fate": ()}  # shoulder, joints, hand
    shapes = corrected | shared | moved | passing
    kinds = dict.fromkeys(("run", "first", "links"), np.int64)
    record = np.dtype(
        [(name, kinds.get(name, np.float64), (*shape, LANES)) for name, shape in shapes.items()]
    )
    first, last = height(corrected), height(corrected | shared)
    return record, slice(last), slice(first, last + height(moved))


def height(shapes: Mapping[str, tuple[int, ...]]) -> int:
    """Number of rows of quantities of these shapes."""
    return sum(math.prod(shape) for shape in shapes.values())


@inlined
def seat(at: Any, lane: int, run: int, arm: Any, goal: Any) -> None:
    """Copy links, shoulder and goal of a run's arm into a lane."""
    at.run[lane], at.first[lane], at.links[lane] = run, arm.first, len(arm.links)
    at.shoulder[0, lane] = arm.shoulder_x
    at.shoulder[1, lane] = arm.shoulder_y
    at.goal[0, lane], at.goal[1, lane] = goal[0], goal[1]
    for k in range(len(at.length)):
        at.length[k, lane] = arm.links[k] if k < len(arm.links) else 0.0


@inlined
def copy_arm(row: Any, lane: int, q: Any, arm: Any) -> None:
    """Copy the base and an arm's joints of a configuration into a lane."""
    row[0, lane] = q[0]
    row[1, lane] = q[1]
    for k in range(len(row) - BASE_DOF):
        row[BASE_DOF + k, lane] = q[arm.first + k] if k < len(arm.links) else 0.0


@inlined
def board(at: Any, lane: int, run: int, q: Any, arm: Any, goal: Any) -> None:
    """Put an arm into a lane, where the robot is in configuration ``q``."""
    seat(at, lane, run, arm, goal)
    copy_arm(at.q, lane, q, arm)


@inlined
def depart(at: Any, lane: int, run: int, q: Any, target: Any, arm: Any, goal: Any) -> None:
    """Put an arm into a lane that the robot is to move from ``q`` to ``target``."""
    seat(at, lane, run, arm, goal)
    copy_arm(at.start, lane, q, arm)
    copy_arm(at.target, lane, target, arm)
    square = 0.0
    for j in range(len(q)):
        delta = target[j] - q[j]
        square += delta * delta
    at.distance[lane] = square


@inlined
def leave(at: Any, lane: int, q: Any) -> None:
    """Copy the arm of a lane into ``q``."""
    q[0] = at.q[0, lane]
    q[1] = at.q[1, lane]
    for k in range(at.links[lane]):
        q[at.first[lane] + k] = at.q[BASE_DOF + k, lane]


@inlined
def fill(rows: Any, lane: int, last: int) -> None:
    """Move rows of the last lane into one that has ended."""
    if lane != last:
        for row in range(len(rows)):
            rows[row, lane] = rows[row, last]


@inner
def padded_count(count: int) -> int:
    """Lanes in the vectors that hold ``count``: the last ones, of no run, are worked on as well.

    A loop over whole vectors leaves no lanes over that would be worked on one by one.
    """
    return count if count < 2 else (count + _VECTOR - 1) // _VECTOR * _VECTOR


@inner
def near(at: Any, count: int) -> bool:
    """Whether bounds show that all angles are in the range of the fast cosine."""
    far = 0
    for i in range(padded_count(count)):
        far += 0 if winding(at.q, i) < LARGEST else 1
    return far == 0


@inlined
def winding(q: Any, lane: int) -> float:
    """Bound on the angle of every link of an arm, rad: all its joints' together."""
    total = 0.0
    for k in range(len(q) - BASE_DOF):
        total += abs(q[BASE_DOF + k, lane])
    return total


def chains_by(cos: Any, sin: Any) -> Any:
    """Forward kinematics of every lane, by these functions."""

    @inner
    def chains(at: Any, count: int) -> None:
        for i in range(count):
            arm = Arm(BASE_DOF, at.length[:, i], at.shoulder[0, i], at.shoulder[1, i])
            chain_by(at.q[:, i], arm, at.x[:, i], at.y[:, i], cos, sin)

    return chains


_near_chains = chains_by(near_cosine, near_sine)
_far_chains = chains_by(cosine, sine)


@inner
def place(at: Any, count: int, is_near: bool) -> None:
    """Forward kinematics of every lane: fill ``x`` and ``y``. ``is_near``: see :func:`near`."""
    if is_near:
        _near_chains(at, padded_count(count))
    else:
        _far_chains(at, padded_count(count))
