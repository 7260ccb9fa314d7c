"""Robot, constants and options for kernels, in one record.

Numba looks at every field of a tuple and of a NumPy scalar each time a kernel is called. An array
of one record is one argument, whatever the record holds.
"""

from __future__ import annotations

from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coartic.model import PAPER, MotionModel
from coartic.motion.compiled import inlined, record_type
from coartic.motion.lanes import links_for
from coartic.robot import HANDS, Arm, Robot


@cache
def setup_type(links: int) -> np.dtype[np.void]:
    """Type of the record for robots with so many links (:func:`coartic.motion.lanes.links_for`)."""
    arm = {"first": np.int64, "count": np.int64, "links": (np.float64, links)}
    shoulder = dict.fromkeys(("shoulder_x", "shoulder_y"), np.float64)
    model = dict.fromkeys(MotionModel._fields, np.float64) | {"max_iterations": np.int64}
    fields = {
        "arms": (record_type(arm | shoulder), len(HANDS)),
        "model": record_type(model),
        "radius": np.float64,  # of the goals, length unit
        "free_x": np.bool_,  # whether the corrective process moves the base in x
        "free_y": np.bool_,
        "looks": np.bool_,  # whether an arm without a target may be in its goal already
    }
    return record_type(fields)


@lru_cache(maxsize=1024)
def setup_for(
    robot: Robot,
    radius: float = 0.0,
    *,
    locked_base: tuple[str, ...] = (),
    model: MotionModel = PAPER,
    looks: bool = True,
) -> NDArray[np.void]:
    """Robot, constants and options for kernels, a record in an array of shape ``(1,)``."""
    setup = np.zeros(1, setup_type(links_for(robot)))
    for hand, arm in zip(HANDS, setup["arms"][0], strict=True):
        first, links, *shoulder = robot.arm(hand)
        arm["first"], arm["count"], arm["links"][: len(links)] = first, len(links), links
        arm["shoulder_x"], arm["shoulder_y"] = shoulder
    setup["model"], setup["radius"] = model, radius
    setup["free_x"], setup["free_y"] = "x" not in locked_base, "y" not in locked_base
    setup["looks"] = looks
    return setup


@inlined
def arm_of(setup: Any, hand: int) -> Any:
    """The arm of a hand: 0 left, 1 right."""
    arm = setup.arms[hand]
    return Arm(arm.first, arm.links[: arm.count], arm.shoulder_x, arm.shoulder_y)
