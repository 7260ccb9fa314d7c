"""The motion model: constants of movements and of the corrective process."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple, get_args

from coartic.internal.limits import brief_value, check_limits

MODEL_VERSION = 1
"""Version of the code that computes results: robot, movements, session, objective, optimisers and
scoring. It is increased with each change of this code that changes results."""
PAPER_RADIUS = 0.1
"""θ^g: radius of the goals of the paper's tasks (in length units)."""
Norm = Literal["euclidean", "maximum"]
WORLD = ("motor_noise", "norm", "base_weight", "radius")
"""Names of the constants that define a *world*, that is, the cost of movements, their motor noise
and the size of the goals. The other constants of a motion model belong to the rules of the paper's
robot."""


class MotionModel(NamedTuple):
    """Constants of movement and of the corrective process.

    ``docs/model.md`` says where each default comes from. To change a constant, write
    ``MotionModel(gain=0.1)`` or ``PAPER._replace(gain=0.1)``.
    """

    step: float = 0.01
    """m: length of a step of a movement in joint space (published). A length unit of the base
    counts as much as a rad of a joint, unless ``base_weight`` changes that. The last step of a
    movement may be shorter."""

    arrival_tolerance: float | None = None
    """θ^a: a hand has arrived if it is within this distance (in length units) of the position that
    it has in the target configuration. None stands for a tenth of the goals' radius, which is 0.01
    in the paper's tasks (inferred: the extracted text of the paper has 0.1, which does not give the
    published rewards).
    """

    gain: float = 0.05
    """α: step size of the corrective process, ``q += α Jᵀ e``, where e is the vector from the hand
    to the goal (published). α has no unit for the base; for the joints its unit is rad² per squared
    length unit."""

    correction_tolerance: float | None = None
    """Distance of the hand from the goal's centre (in length units) at which the corrective process
    has converged. None stands for a tenth of the goals' radius (inferred to equal θ^a; the caption
    of Figure 2 has θ^g).
    """

    max_iterations: int = 20_000
    """Largest number of iterations of the corrective process for one correction (our bound). A
    trial fails if a correction needs more iterations."""

    motor_noise: float = 0.0
    """s: standard deviation of the Gaussian noise that displaces the target of a movement in the
    coordinates that move, in length units (base) and rad (joints). Short corrections have less
    noise. The paper's robot has no motor noise. The rule is in ``docs/model.md``, section *Motor
    noise*."""

    norm: Norm = "euclidean"
    """Norm of joint space in which a step has the length ``step``:

    - ``"euclidean"`` (published);
    - ``"maximum"``: the coordinate that moves farthest, after base coordinates are multiplied by
      ``base_weight``, moves by ``step``."""

    base_weight: float = 1.0
    """w: in the length of a movement, a length unit of the base counts as much as w rad of a joint.
    The weight changes only the cost of moving the base; exploration, corrective process and
    tolerances do not depend on it."""

    radius: float | None = None
    """θ^g: radius of the goals, in length units. None stands for the radius of each task."""

    def for_radius(self, radius: float = PAPER_RADIUS) -> MotionModel:
        """Return a copy in which tolerances that are None are replaced by numbers.

        The number is a tenth of the goals' radius: that of the model, or else ``radius`` (in length
        units).

        Examples
        --------
        >>> MotionModel().for_radius(0.2).arrival_tolerance
        0.02
        """
        arrival, correction = self.tolerances(radius)
        return self._replace(arrival_tolerance=arrival, correction_tolerance=correction)

    def tolerances(self, radius: float) -> tuple[float, float]:
        """Return the tolerances of arrival and of correction, in length units.

        If a tolerance of the model is None, a tenth of the goals' radius is returned for it.
        ``radius`` is the radius of the task's goals, in length units; the radius of the model, if
        there is one, takes its place.
        """
        radius = radius if self.radius is None else self.radius
        tenth, arrival, correction = radius / 10, self.arrival_tolerance, self.correction_tolerance
        return (
            tenth if arrival is None else arrival,
            tenth if correction is None else correction,
        )

    def without_noise(self) -> MotionModel:
        """Return a model without motor noise and with the same other constants."""
        return self if self.motor_noise == 0.0 else self._replace(motor_noise=0.0)

    def stored(self, radius: float) -> dict[str, Any]:
        """Return a dict that maps constants to values, as stored in files.

        Tolerances that are None are replaced by those for goals of ``radius`` (in length units).
        Constants of :data:`WORLD` that are equal to the paper's constants are left out, so that the
        ids of runs do not change when a new constant is added.
        """
        constants = self.for_radius(radius)._asdict()
        return {
            name: value
            for name, value in constants.items()
            if name not in WORLD or value != MotionModel._field_defaults[name]
        }


PAPER = MotionModel()
_BOUNDS = {
    "step": (1e-6, 1e6),
    "arrival_tolerance": (0.0, 1e6),
    "gain": (1e-6, 1e6),
    "correction_tolerance": (1e-6, 1e6),
    "max_iterations": (0, 10**9),
    "motor_noise": (0.0, 100.0),
    "base_weight": (1e-6, 1e3),  # the base then takes 100,000 ticks for a length unit
    "radius": (1e-5, 1e6),
}
_OPTIONAL = ("arrival_tolerance", "correction_tolerance", "radius")


def check_model(model: MotionModel, *, radius: float | None = None) -> MotionModel:
    """Check the constants of a model, and return the model with its numbers as floats.

    Parameters
    ----------
    model : MotionModel
    radius : float, optional
        Radius of the goals (in length units). If it is passed, ``correction_tolerance`` must be
        smaller than the radius: that of the model, if it has one.

    Returns
    -------
    MotionModel
        The same constants. Numbers are of type ``float``, ``max_iterations`` is an ``int``, and
        ``norm`` a ``str``, so that a world has one name and one id, whether 4 or 4.0 was written.
        A model that has these types is returned itself.

    Raises
    ------
    TypeError
        ``model`` is not a MotionModel.
    ValueError
        A constant has a wrong type or is out of bounds, or ``correction_tolerance`` is not below
        ``radius``.
    """
    if not isinstance(model, MotionModel):
        raise TypeError(f"model is {brief_value(model)}; it must be a MotionModel")
    constants: dict[str, Any] = {"norm": str(model.norm)}
    for name, (least, largest) in _BOUNDS.items():
        value = getattr(model, name)
        if value is not None or name not in _OPTIONAL:
            check_limits(f"model.{name}", value, least, largest)
            constants[name] = type(least)(value)
    if model.norm not in get_args(Norm):
        raise ValueError(
            f"model.norm is {brief_value(model.norm)}; it must be 'euclidean' or 'maximum'"
        )
    radius = radius if model.radius is None else float(model.radius)
    if radius is not None and (model.correction_tolerance or 0.0) >= radius:
        raise ValueError(
            f"model.correction_tolerance is {model.correction_tolerance}; it must be below the "
            f"goals' radius {radius}, or the corrective process would end outside the goal (None "
            "stands for a tenth of the radius)"
        )
    has_types = all(type(getattr(model, name)) is type(constants[name]) for name in constants)
    return model if has_types else model._replace(**constants)


def check_exact(model: MotionModel, *, radius: float | None = None) -> MotionModel:
    """Check a model for a function that draws no random numbers (:func:`check_model`).

    Raises the errors of :func:`check_model`, and ValueError if the model has motor noise.
    """
    checked = check_model(model, radius=radius)
    refuse_noise(checked)
    return checked


def refuse_noise(model: MotionModel) -> None:
    """Raise ValueError if a model has motor noise.

    The error message says that the calling function draws no random numbers.
    """
    if model.motor_noise > 0.0:
        raise ValueError(
            f"model.motor_noise is {model.motor_noise:g}; it must be 0 here, because this function "
            "draws no random numbers: call coartic.execute_noisy, or make trials in a session, an "
            "objective or an environment"
        )


def model_from(constants: MotionModel | Mapping[str, Any]) -> MotionModel:
    """Return the paper's model with some constants changed.

    Parameters
    ----------
    constants : mapping of str to object, or MotionModel
        Dict that maps the names of the changed constants to their values. A MotionModel is only
        checked (:func:`check_model`).

    Returns
    -------
    MotionModel

    Raises
    ------
    TypeError
        ``constants`` is neither a mapping nor a MotionModel.
    ValueError
        A constant is unknown, has a wrong type or is out of bounds.

    Examples
    --------
    >>> model_from({"motor_noise": 0.01}) == PAPER._replace(motor_noise=0.01)
    True
    """
    if isinstance(constants, MotionModel) or not isinstance(constants, Mapping):
        return check_model(constants)
    if others := [name for name in constants if name not in MotionModel._fields]:
        raise ValueError(
            f"model has no constant {brief_value(others[0])}; it has "
            f"{', '.join(MotionModel._fields)}"
        )
    return check_model(MotionModel(**constants))


def same_world(first: MotionModel, second: MotionModel, radius: float) -> bool:
    """Return whether two models have equal constants for goals of a given radius.

    Tolerances that are None are compared as a tenth of ``radius`` (in length units).
    """
    return first.for_radius(radius) == second.for_radius(radius)


def differences(model: MotionModel) -> dict[str, Any]:
    """Return the constants in :data:`WORLD` that differ from the paper's values.

    The result is a dict that maps the name of each such constant to its value in ``model``.

    Examples
    --------
    >>> differences(MotionModel(motor_noise=0.01, gain=0.1))
    {'motor_noise': 0.01}
    """
    return {
        name: getattr(model, name) for name in WORLD if getattr(model, name) != getattr(PAPER, name)
    }
