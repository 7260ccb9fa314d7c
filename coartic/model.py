"""The constants of movement and of the corrective process."""

from __future__ import annotations

import math
from typing import NamedTuple

from coartic.internal.limits import brief_value, check_limits


class MotionModel(NamedTuple):
    """Constants of the paper's model; docs/model.md says where each comes from.

    Another one is made with keyword arguments, ``MotionModel(gain=0.1)``, or from one:
    ``PAPER._replace(gain=0.1)``.
    """

    step: float = 0.01
    """m: length of one movement step in joint space, in which a length unit of the base counts as
    much as a rad of a joint (published)."""

    arrival_tolerance: float = 0.01
    """θ^a: distance at which a hand has arrived, length unit (inferred; the
    extracted text has 0.1, which does not give the published rewards)."""

    gain: float = 0.05
    """α: step size of the corrective process, ``q += α Jᵀ e`` (published). For the base it has no
    unit; for the joints it is rad per squared length unit, which cancels the unit of ``Jᵀ e``."""

    correction_tolerance: float = 0.01
    """Distance to the goal's centre at which the corrective process ends, length
    unit (inferred to be θ^a; the caption of Figure 2 has θ^g)."""

    max_iterations: int = 20_000
    """Corrective iterations after which a trial has failed (our bound)."""


PAPER = MotionModel()
_BOUNDS = {
    "step": (1e-6, 1e6),
    "arrival_tolerance": (0.0, 1e6),
    "gain": (1e-6, 1e6),
    "correction_tolerance": (1e-6, 1e6),
    "max_iterations": (0, math.inf),
}


def check_model(model: MotionModel, *, radius: float | None = None) -> MotionModel:
    """The model itself; ValueError for constants no movement can be made with,
    TypeError for what is no model.

    ``radius`` of the goals, where known: a corrective process that ends farther from a
    goal's centre than that never hits it.
    """
    if not isinstance(model, MotionModel):
        raise TypeError(f"model is {brief_value(model)}; it must be a MotionModel")
    for name, (least, most) in _BOUNDS.items():
        check_limits(f"model.{name}", getattr(model, name), least, most)
    if radius is not None and model.correction_tolerance >= radius:
        raise ValueError(
            f"model.correction_tolerance {model.correction_tolerance} is not below the goals' "
            f"radius {radius}: the corrective process would end outside the goal"
        )
    return model
