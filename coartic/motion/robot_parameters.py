"""Robot parameters: robot, constants and options for kernels, in one record.

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
from coartic.motion.slots import links_for
from coartic.robot import HANDS, Arm, Robot


@cache
def robot_parameters_type(links: int) -> np.dtype[np.void]:
    """Type of the record for robots with so many links (:func:`coartic.motion.slots.links_for`)."""
    arm = {"first": np.int64, "count": np.int64, "links": (np.float64, links)}
    shoulder = dict.fromkeys(("shoulder_x", "shoulder_y"), np.float64)
    model = dict.fromkeys(MotionModel._fields, np.float64) | {"max_iterations": np.int64}
    fields = {
        "arms": (record_type(arm | shoulder), len(HANDS)),
        "model": record_type(model),
        "radius": np.float64,  # of the goals, length unit
        "free_x": np.bool_,  # whether the corrective process moves the base in x
        "free_y": np.bool_,
        "checks": np.bool_,  # whether an arm without a target may be in its goal already
    }
    return record_type(fields)


@lru_cache(maxsize=1024)
def robot_parameters_for(
    robot: Robot,
    radius: float = 0.0,
    *,
    locked_base: tuple[str, ...] = (),
    model: MotionModel = PAPER,
    checks: bool = True,
) -> NDArray[np.void]:
    """Robot, constants and options for kernels, a record in an array of shape ``(1,)``."""
    robot_parameters = np.zeros(1, robot_parameters_type(links_for(robot)))
    for hand, arm in zip(HANDS, robot_parameters["arms"][0], strict=True):
        first, links, *shoulder = robot.arm(hand)
        arm["first"], arm["count"], arm["links"][: len(links)] = first, len(links), links
        arm["shoulder_x"], arm["shoulder_y"] = shoulder
    robot_parameters["model"], robot_parameters["radius"] = model, radius
    robot_parameters["free_x"], robot_parameters["free_y"] = (
        "x" not in locked_base,
        "y" not in locked_base,
    )
    robot_parameters["checks"] = checks
    return robot_parameters


@inlined
def arm_of(robot_parameters: Any, hand: int) -> Any:
    """The arm of a hand: 0 left, 1 right."""
    arm = robot_parameters.arms[hand]
    return Arm(arm.first, arm.links[: arm.count], arm.shoulder_x, arm.shoulder_y)
