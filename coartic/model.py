"""The constants of movement and of the corrective process."""

from __future__ import annotations

from typing import NamedTuple

from coartic.internal.limits import brief_value, check_limits

MODEL_VERSION = 1
"""Version of the code that all results come from: robot, movement, session, objective, optimisers,
scoring. It is raised with every change of results."""
PAPER_RADIUS = 0.1
"""θ^g of the paper's tasks, length unit."""


class MotionModel(NamedTuple):
    """Constants of the paper's model; docs/model.md says where each default comes from.
    ``MotionModel(gain=0.1)`` has another gain, as has ``PAPER._replace(gain=0.1)``."""

    step: float = 0.01
    """m: length of a step of a movement in joint space, in which a length unit of the base counts
    as much as a rad of a joint (published); the last step may be shorter."""

    arrival_tolerance: float | None = None
    """θ^a: a hand has arrived within this distance of where its target puts it, length unit; None
    for a tenth of the goals' radius, 0.01 in the paper's tasks (inferred; the extracted text has
    0.1, which does not give the published rewards)."""

    gain: float = 0.05
    """α: step size of the corrective process, ``q += α Jᵀ e`` (published). For the base it has no
    unit; for the joints its unit is rad² per squared length unit."""

    correction_tolerance: float | None = None
    """Distance to the goal's centre at which the corrective process ends, length unit; None for a
    tenth of the goals' radius (inferred to be θ^a; the caption of Figure 2 has θ^g)."""

    max_iterations: int = 20_000
    """Corrective iterations for a goal after which the trial has failed (our bound)."""

    def for_radius(self, radius: float = PAPER_RADIUS) -> MotionModel:
        """Return a copy of the model for goals of ``radius``, length unit: a tolerance of None (of
        arrival or of correction) becomes a tenth of ``radius``."""
        arrival, correction = self.tolerances(radius)
        return self._replace(arrival_tolerance=arrival, correction_tolerance=correction)

    def tolerances(self, radius: float) -> tuple[float, float]:
        """Return the tolerances of arrival and of correction, length unit, for goals of ``radius``,
        length unit: a tolerance of None is a tenth of ``radius``."""
        tenth, arrival, correction = radius / 10, self.arrival_tolerance, self.correction_tolerance
        return (
            tenth if arrival is None else arrival,
            tenth if correction is None else correction,
        )


PAPER = MotionModel()
_BOUNDS = {
    "step": (1e-6, 1e6),
    "arrival_tolerance": (0.0, 1e6),
    "gain": (1e-6, 1e6),
    "correction_tolerance": (1e-6, 1e6),
    "max_iterations": (0, 10**9),
}


def check_model(model: MotionModel, *, radius: float | None = None) -> MotionModel:
    """Return the model itself. Raises TypeError if it is no MotionModel, and ValueError if one of
    its constants is out of bounds or if ``radius``, the radius of the goals, length unit, is given
    and ``correction_tolerance`` is not below it."""
    if not isinstance(model, MotionModel):
        raise TypeError(f"model is {brief_value(model)}; it must be a MotionModel")
    for name, (least, most) in _BOUNDS.items():
        value = getattr(model, name)
        if value is not None or not name.endswith("_tolerance"):
            check_limits(f"model.{name}", value, least, most)
    if radius is not None and (model.correction_tolerance or 0.0) >= radius:
        raise ValueError(
            f"model.correction_tolerance {model.correction_tolerance} is not below the goals' "
            f"radius {radius}, so the corrective process would end outside the goal; None is a "
            "tenth of the radius"
        )
    return model
