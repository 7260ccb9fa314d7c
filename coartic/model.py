"""The constants of movement and of the corrective process."""

from __future__ import annotations

from typing import NamedTuple

from coartic.internal.limits import brief_value, check_limits

MODEL_VERSION = 1
"""Version of the code that computes results: robot, movement, session, objective, optimisers,
scoring. Every change of the code that changes results raises this number."""
PAPER_RADIUS = 0.1
"""θ^g of the paper's tasks (in length units)."""


class MotionModel(NamedTuple):
    """Constants of movement and of the corrective process.

    ``docs/model.md`` says where each default comes from. To change a constant, write
    ``MotionModel(gain=0.1)`` or ``PAPER._replace(gain=0.1)``.
    """

    step: float = 0.01
    """m: length of a step of a movement in joint space, where a length unit of the base counts as
    much as a rad of a joint (published). The last step may be shorter."""

    arrival_tolerance: float | None = None
    """θ^a: a hand has arrived if it is within this distance (in length units) of the position to
    which its target brings it. None stands for a tenth of the goals' radius, which is 0.01 in the
    paper's tasks (inferred: the extracted text has 0.1, which does not give the published rewards).
    """

    gain: float = 0.05
    """α: step size of the corrective process, ``q += α Jᵀ e`` (published). α has no unit for the
    base; for the joints its unit is rad² per squared length unit."""

    correction_tolerance: float | None = None
    """Distance from the goal's centre (in length units) at which the corrective process ends. None
    stands for a tenth of the goals' radius (inferred to be θ^a; the caption of Figure 2 has θ^g).
    """

    max_iterations: int = 20_000
    """Largest number of iterations of the corrective process for a goal (our bound). A trial that
    needs more fails."""

    def for_radius(self, radius: float = PAPER_RADIUS) -> MotionModel:
        """Return a copy with the tolerances for goals of a given radius.

        ``radius`` is in length units. In the copy a tenth of ``radius`` takes the place of a
        tolerance of None.
        """
        arrival, correction = self.tolerances(radius)
        return self._replace(arrival_tolerance=arrival, correction_tolerance=correction)

    def tolerances(self, radius: float) -> tuple[float, float]:
        """Return the tolerances of arrival and of correction, in length units.

        ``radius`` is that of the goals, in length units. Where the model's tolerance is None, a
        tenth of ``radius`` is returned.
        """
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
    """Check a model, and return it unchanged.

    Parameters
    ----------
    model : MotionModel
    radius : float, optional
        Radius of the goals (in length units). If you pass it, ``correction_tolerance`` has to be
        below it.

    Raises
    ------
    TypeError
        ``model`` is not a MotionModel.
    ValueError
        A constant is out of bounds, or ``correction_tolerance`` is not below ``radius``.
    """
    if not isinstance(model, MotionModel):
        raise TypeError(f"model is {brief_value(model)}; it must be a MotionModel")
    for name, (least, largest) in _BOUNDS.items():
        value = getattr(model, name)
        if value is not None or not name.endswith("_tolerance"):
            check_limits(f"model.{name}", value, least, largest)
    if radius is not None and (model.correction_tolerance or 0.0) >= radius:
        raise ValueError(
            f"model.correction_tolerance is {model.correction_tolerance}; it must be below the "
            f"goals' radius {radius}, or the corrective process would end outside the goal (None "
            "stands for a tenth of the radius)"
        )
    return model
