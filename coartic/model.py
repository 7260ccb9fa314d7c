"""The constants of movement and of the corrective process."""

from __future__ import annotations

from typing import NamedTuple


class MotionModel(NamedTuple):
    """Constants of the paper's model; what each one rests on is in docs/model.md.

    A named tuple, so that the compiled kernels take it as it is.
    """

    step: float = 0.01
    """m: joint-space length of one movement step (printed)."""

    arrival_tolerance: float = 0.01
    """θ^a: distance at which a hand has arrived, length unit (inferred; the
    extracted text prints 0.1, which does not give the published rewards)."""

    gain: float = 0.05
    """α: step size of the corrective process (printed)."""

    correction_tolerance: float = 0.01
    """Distance to the goal's centre at which the corrective process ends, length
    unit (inferred to be θ^a; the caption of Figure 2 prints θ^g)."""

    max_iterations: int = 20_000
    """Corrective iterations after which a trial has failed (our bound)."""


PAPER = MotionModel()
