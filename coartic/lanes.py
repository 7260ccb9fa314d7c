"""Many arms side by side: what the compiled kernels work on.

A lane holds one arm that moves or is corrected. Each quantity is a row over lanes, and the
innermost loop of a kernel runs over lanes, so that the compiler makes vector instructions of
it; the number of links belongs to the type of the rows, so that the loops over links are
unrolled before. No operation mixes lanes and none is reordered or fused: what a lane gives
does not depend on its neighbours, on their number or on the width of the vectors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from coartic.compiled import inner, lanewise
from coartic.robot import BASE_DOF, Arm, Robot, chain
from coartic.trigonometry import LARGEST, cosine, near_cosine, near_sine, sine

LANES = 40
"""Most lanes at once: they and their rows stay in the innermost cache."""
_VECTOR = 8  # lanes that vectors hold; LANES is a multiple of it
GOING = 0.0
"""Fate of a lane that has not ended."""


class Lanes(NamedTuple):
    """Lanes and who is in them."""

    at: Any
    """The rows, by name; see :func:`lanes_for`."""
    corrected: Any
    """The rows of an arm that is corrected: the same memory, shape ``(rows, LANES)``."""
    moved: Any
    """Those of one that moves."""
    run: Any
    """Index of the run in each lane, shape ``(LANES,)``."""
    first: Any
    """Index in a configuration of the first joint of its arm."""
    links: Any
    """Number of links of its arm."""


class Ends(NamedTuple):
    """How the lanes of runs ended, by run."""

    hit: Any  # (N,) whether the hand is within the goal's radius
    ticks: Any  # (N,) of the movement
    converged: Any  # (N,) whether the corrective process was
    iterations: Any  # (N,) of the corrective process
    evaluations: Any  # (N,) of forward kinematics, in all


def ends_of(runs: int) -> Ends:
    """Room for the ends of so many runs."""
    flags, counts = np.zeros((2, runs), np.bool_), np.zeros((3, runs), np.int64)
    return Ends(flags[0], counts[0], flags[1], counts[1], counts[2])


def lanes_for(robot: Robot) -> Lanes:
    """Lanes for either arm of a robot; the shorter one ends in links of length 0."""
    links = robot.most_links
    joints = (BASE_DOF + links,)
    corrected = {"q": joints, "pulled": ()}  # base x and y, then the joints of the arm
    shared = {"length": (links,), "shoulder": (2,), "start": joints}
    moved = {
        "target": joints,
        "rate": (links,),  # of the absolute link angles, rad a step
        "base_rate": (2,),
        "end": (2,),  # of the hand, where the target would put it
        **dict.fromkeys(("step", "last", "whole", "distance", "speed", "bend"), ()),
    }
    passing = {"x": (links + 1,), "y": (links + 1,), "fate": ()}  # shoulder, joints, hand
    shapes = corrected | shared | moved | passing
    at = np.zeros(1, [(name, np.float64, (*shape, LANES)) for name, shape in shapes.items()])
    rows = at.view(np.float64).reshape(-1, LANES)
    first, last = _height(corrected), _height(corrected | shared)
    return Lanes(
        at[0],
        rows[:last],
        rows[first : last + _height(moved)],
        *np.zeros((3, LANES), np.int64),
    )


def _height(shapes: Mapping[str, tuple[int, ...]]) -> int:
    return sum(math.prod(shape) for shape in shapes.values())


@inner
def board(lanes: Any, lane: int, run: int, q: Any, arm: Any) -> None:
    """Put an arm into a lane, where the robot is in configuration ``q``."""
    at = lanes.at
    lanes.run[lane], lanes.first[lane], lanes.links[lane] = run, arm.first, len(arm.links)
    at.pulled[lane] = 0.0
    at.shoulder[0, lane] = arm.shoulder_x
    at.shoulder[1, lane] = arm.shoulder_y
    at.q[0, lane] = q[0]
    at.q[1, lane] = q[1]
    for k in range(len(at.length)):
        own = k < len(arm.links)
        at.length[k, lane] = arm.links[k] if own else 0.0
        at.q[BASE_DOF + k, lane] = q[arm.first + k] if own else 0.0


@inner
def leave(lanes: Any, lane: int, q: Any) -> None:
    """Copy the arm of a lane into ``q``."""
    q[0] = lanes.at.q[0, lane]
    q[1] = lanes.at.q[1, lane]
    for k in range(lanes.links[lane]):
        q[lanes.first[lane] + k] = lanes.at.q[BASE_DOF + k, lane]


@inner
def copy_lanes(source: Any, destination: Any) -> None:
    """Copy rows of every lane."""
    for j in range(len(source)):
        for i in range(LANES):
            destination[j, i] = source[j, i]


@inner
def fill(lanes: Any, rows: Any, lane: int, last: int) -> None:
    """Move ``rows`` of the last lane into one that has ended."""
    if lane == last:
        return
    lanes.run[lane] = lanes.run[last]
    lanes.first[lane] = lanes.first[last]
    lanes.links[lane] = lanes.links[last]
    for row in range(len(rows)):
        rows[row, lane] = rows[row, last]


@inner
def whole(count: int) -> int:
    """Lanes in the vectors that hold ``count``: the last ones, of no run, are worked on as well.

    A loop over whole vectors leaves no lanes over that would be worked on one by one.
    """
    return count if count < 2 else (count + _VECTOR - 1) // _VECTOR * _VECTOR


_chain = inner(chain)


@lanewise
def _near(at: Any, count: int) -> bool:
    """Whether no link's angle is too large for the kernels' own cosine."""
    far = 0
    for i in range(count):
        angle = 0.0
        for k in range(len(at.length)):
            angle = angle + at.q[BASE_DOF + k, i]
            far += 0 if abs(angle) < LARGEST else 1
    return far == 0


def _chains_by(cos: Any, sin: Any) -> Any:
    """Forward kinematics of every lane, by these functions."""

    @lanewise
    def chains(at: Any, count: int) -> None:
        for i in range(count):
            arm = Arm(BASE_DOF, at.length[:, i], at.shoulder[0, i], at.shoulder[1, i])
            _chain(at.q[:, i], arm, at.x[:, i], at.y[:, i], cos, sin)

    return chains


_near_chains = _chains_by(near_cosine, near_sine)
_far_chains = _chains_by(cosine, sine)


@inner
def place(at: Any, count: int) -> None:
    """Forward kinematics of every lane: fill ``x`` and ``y``."""
    if _near(at, whole(count)):
        _near_chains(at, whole(count))
    else:
        _far_chains(at, whole(count))
