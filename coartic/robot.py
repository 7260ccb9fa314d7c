"""The robot and its kinematics.

The robot is planar and kinematic: a mobile base with two serial arms (paper, Figure 1). A
configuration is the vector ``q = (base_x, base_y, left_1 .. left_n, right_1 .. right_m)``. Lengths
are in the model's length unit, angles in rad. Angles are relative: each joint is measured from the
previous link, the first joint from +x.

:func:`chain` contains the formulas of the positions, and :func:`lever` contains the formula of the
Jacobian. Both functions work on NumPy arrays and on CasADi symbols, and are compiled for the
kernels. The caller of :func:`chain` passes the cosine and the sine for its type of numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from coartic.internal.limits import brief_value, real_array
from coartic.internal.validation import describe_validation_errors

Hand = Literal["left", "right"]
"""Name of a hand: ``"left"`` or ``"right"``."""
Array = NDArray[np.float64]
Configs = NDArray[np.float64]
"""Configurations, shape ``(..., dof)``: base x and y (in length units), then joint angles (in
rad)."""
Points = NDArray[np.float64]
"""Points in the plane, shape ``(..., 2)``: x and y in length units."""
Hands = NDArray[np.int64]
"""Hands as indices in :data:`HANDS`: 0 left, 1 right."""
MAX_ENTRY = 1e5
"""Largest absolute value of an entry of a configuration or goal for which movements are computed,
in length units or rad."""
MAX_NUMBER = 1e4  # largest number in a task or a robot, in length units or rad
MAX_LINKS = 100  # of an arm
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-MAX_NUMBER, le=MAX_NUMBER)]
Length = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False, le=MAX_NUMBER)]
_Lengths = Annotated[tuple[Length, ...], Field(min_length=1, max_length=MAX_LINKS)]

HANDS: tuple[Hand, Hand] = ("left", "right")  # the paper's A; at a tie the first hand is chosen
BASE_DOF = 2


class Arm(NamedTuple):
    """Geometry of an arm, in the form that the formulas and the compiled kernels read."""

    first_joint: int
    """Index in ``q`` of the angle of the arm's first joint."""
    links: Any
    """Lengths of the links from shoulder to hand, shape ``(n,)``, in length units."""
    shoulder_x: float
    """x of the shoulder, measured from the centre of the base (in length units)."""
    shoulder_y: float
    """y of the shoulder, measured from the centre of the base (in length units)."""


def chain(q: Any, arm: Arm, xs: Any, ys: Any, cos: Any, sin: Any) -> None:
    """Compute the positions of an arm's shoulder, joints and hand, in place.

    Parameters
    ----------
    q : array or sequence, shape (dof, ...)
        One configuration or many, of numbers or symbols. The first axis runs over the entries of a
        configuration.
    arm : Arm
        The arm, with n links.
    xs, ys : array or list, length n + 1
        Filled with x and y in length units. Entry 0 is the shoulder, entry n the hand.
    cos, sin : callable
        Cosine and sine for the type of ``q``.

    Notes
    -----
    Source: Craig (2004).
    """
    x = q[0] + arm.shoulder_x
    y = q[1] + arm.shoulder_y
    xs[0] = x
    ys[0] = y
    angle = 0.0
    for k in range(len(arm.links)):
        angle = angle + q[arm.first_joint + k]
        x = x + arm.links[k] * cos(angle)
        y = y + arm.links[k] * sin(angle)
        xs[k + 1] = x
        ys[k + 1] = y


def lever(xs: Any, ys: Any, joint: int, tip: int) -> tuple[Any, Any]:
    """Compute the derivative of a point of an arm with respect to a joint angle.

    A rotation about the joint moves the point at right angles to the line from the joint to the
    point. The result is a column of the geometric Jacobian.

    Parameters
    ----------
    xs, ys : array or list, length n + 1
        x and y of shoulder, joints and hand, as :func:`chain` fills them.
    joint, tip : int
        Indices in ``xs`` and ``ys`` of the joint and of the point, with ``joint <= tip``.

    Returns
    -------
    dx, dy
        Derivatives of the point's x and y, in length units per rad.
    """
    return -(ys[tip] - ys[joint]), xs[tip] - xs[joint]


@describe_validation_errors
@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Robot:
    """Geometry and kinematics of a planar robot with two arms, by default the paper's.

    The paper publishes four links of length 1 for each arm and a box 1 wide and 0.2 high (Figure
    1). That the shoulders are on the top corners of the box is inferred: of the heights -0.1, 0 and
    +0.1, only +0.1 gives the initial rewards of the one-armed tasks that follow from the paper
    (docs/model.md).

    A configuration ``q`` has shape ``(dof,)``: x and y of the base (in length units), the joint
    angles of the left arm and the joint angles of the right arm (in rad, each measured from the
    link before). Methods that accept arrays accept one configuration or many, shape ``(..., dof)``.
    They raise ValueError if ``q`` has a wrong shape or has entries that are not finite real
    numbers, or if a hand is neither ``"left"`` nor ``"right"``.
    """

    left_links: _Lengths = (1.0, 1.0, 1.0, 1.0)
    """Lengths of the links of the left arm from the shoulder outwards (in length units)."""
    right_links: _Lengths = (1.0, 1.0, 1.0, 1.0)
    """Lengths of the links of the right arm from the shoulder outwards (in length units)."""
    left_shoulder: tuple[Finite, Finite] = (-0.5, 0.1)
    """x and y of the left shoulder, measured from the centre of the base (in length units)."""
    right_shoulder: tuple[Finite, Finite] = (0.5, 0.1)
    """x and y of the right shoulder, measured from the centre of the base (in length units)."""
    base_size: tuple[Length, Length] = (1.0, 0.2)
    """Width and height of the base (in length units), for drawings only. The default fits arms of
    length 4 and is drawn in proportion to the shorter arm (:attr:`drawn_base`)."""

    @cached_property
    def scale(self) -> float:
        """Scale of drawings: the length of the shorter arm divided by 4.

        Both arms of the paper's robot have length 4.
        """
        return min(math.fsum(self.left_links), math.fsum(self.right_links)) / 4.0

    @property
    def drawn_base(self) -> tuple[float, float]:
        """Width and height of the base in drawings (in length units).

        If :attr:`base_size` is the default, the result is the default multiplied by :attr:`scale`.
        Otherwise the result is :attr:`base_size` itself.
        """
        width, height = self.base_size
        is_default = self.base_size == type(self).__dataclass_fields__["base_size"].default
        return (width * self.scale, height * self.scale) if is_default else (width, height)

    @cached_property
    def dof(self) -> int:
        """Number of degrees of freedom, the length of ``q``."""
        return BASE_DOF + len(self.left_links) + len(self.right_links)

    @cached_property
    def max_links(self) -> int:
        """Number of links of the arm with more links."""
        return max(len(self.left_links), len(self.right_links))

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the entries of ``q``, in order: base_x, base_y, left_1, ..., right_n."""
        left = (f"left_{k + 1}" for k in range(len(self.left_links)))
        right = (f"right_{k + 1}" for k in range(len(self.right_links)))
        return ("base_x", "base_y", *left, *right)

    @cached_property
    def _arms(self) -> dict[str, Arm]:
        arms, first_joint = dict[str, Arm](), BASE_DOF
        for hand in HANDS:
            links = np.array(getattr(self, f"{hand}_links"), dtype=np.float64)
            links.setflags(write=False)
            shoulder = map(float, getattr(self, f"{hand}_shoulder"))
            arms[hand] = Arm(first_joint, links, *shoulder)
            first_joint += len(links)
        return arms

    def arm(self, hand: Hand) -> Arm:
        """Return the :class:`Arm` of a hand.

        Raises ValueError for an unknown hand.
        """
        try:
            return self._arms[hand]
        except (KeyError, TypeError):
            raise ValueError(f"hand is {hand!r}; it must be 'left' or 'right'") from None

    def joints(self, hand: Hand) -> slice:
        """Return the slice of a configuration that holds the joint angles of a hand's arm.

        ``q[..., robot.joints("left")]`` has shape ``(..., n)`` and is in rad. Raises ValueError for
        an unknown hand.
        """
        arm = self.arm(hand)
        return slice(arm.first_joint, arm.first_joint + len(arm.links))

    def reach(self, hand: Hand) -> tuple[float, float]:
        """Return the smallest and the largest distance of a hand from its shoulder.

        Both distances are in length units; joints have no limits. Raises ValueError for an unknown
        hand.

        Examples
        --------
        >>> Robot(left_links=(3.0, 1.0)).reach("left")
        (2.0, 4.0)
        """
        links = self.arm(hand).links.tolist()
        return max(0.0, 2 * max(links) - sum(links)), math.fsum(links)

    def forward_kinematics(self, q: ArrayLike, hand: Hand) -> Array:
        """Compute the position of a hand: the forward kinematics F_a(q).

        Parameters
        ----------
        q : array_like, shape (..., dof)
        hand : {"left", "right"}

        Returns
        -------
        ndarray, shape (..., 2)
            Positions of the hand, x and y in length units.

        Raises
        ------
        ValueError
            ``q`` or ``hand`` does not fit the robot.

        Examples
        --------
        >>> Robot().forward_kinematics(np.zeros(10), "right")
        array([4.5, 0.1])
        """
        array = self._configuration(q)
        return self._hand(*self._numpy_chain(array, hand), array)

    def joint_positions(self, q: ArrayLike, hand: Hand) -> Array:
        """Compute the positions of the shoulder, the joints and the hand of an arm.

        Parameters
        ----------
        q : array_like, shape (..., dof)
        hand : {"left", "right"}

        Returns
        -------
        ndarray, shape (..., n + 1, 2)
            x and y from the shoulder to the hand of an arm with n links (in length units).

        Raises
        ------
        ValueError
            ``q`` or ``hand`` does not fit the robot.
        """
        xs, ys = self._numpy_chain(self._configuration(q), hand)
        return np.stack([np.stack(xs, axis=-1), np.stack(ys, axis=-1)], axis=-1)

    def jacobian(self, q: ArrayLike, hand: Hand) -> Array:
        """Compute the Jacobian of a hand's position.

        Parameters
        ----------
        q : array_like, shape (..., dof)
        hand : {"left", "right"}

        Returns
        -------
        ndarray, shape (..., 2, dof)
            Derivatives of x and y with respect to each entry of ``q``, in length units per length
            unit (base) and per rad (joints). Columns of the other arm's joints are zero.

        Raises
        ------
        ValueError
            ``q`` or ``hand`` does not fit the robot.
        """
        return self.linearised(q, hand)[1]

    def linearised(self, q: ArrayLike, hand: Hand) -> tuple[Array, Array]:
        """Compute the position of a hand and its Jacobian together.

        Parameters
        ----------
        q : array_like, shape (..., dof)
        hand : {"left", "right"}

        Returns
        -------
        position : ndarray, shape (..., 2)
            The result of :meth:`forward_kinematics`, in length units.
        jacobian : ndarray, shape (..., 2, dof)
            The result of :meth:`jacobian`.

        Raises
        ------
        ValueError
            ``q`` or ``hand`` does not fit the robot.
        """
        array = self._configuration(q)
        xs, ys = self._numpy_chain(array, hand)
        arm, tip = self.arm(hand), len(xs) - 1
        result = np.zeros((*array.shape[:-1], 2, self.dof))
        result[..., 0, 0] = 1.0
        result[..., 1, 1] = 1.0
        for k in range(tip):
            j = arm.first_joint + k
            result[..., 0, j], result[..., 1, j] = lever(xs, ys, k, tip)
        return self._hand(xs, ys, array), result

    def base_outline(self, q: ArrayLike) -> Array:
        """Return the positions of the four corners of the drawn base (:attr:`drawn_base`).

        Parameters
        ----------
        q : array_like, shape (..., dof)

        Returns
        -------
        ndarray, shape (..., 4, 2)
            x and y of the corners, counter-clockwise from the lower left one (in length units).

        Raises
        ------
        ValueError
            ``q`` does not fit the robot.
        """
        array = self._configuration(q)
        half = np.array(self.drawn_base) / 2
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        return array[..., None, :BASE_DOF] + corners

    def symbolic_hand(self, q: Any, hand: Hand) -> Any:
        """Return the position of a hand as a CasADi expression.

        Parameters
        ----------
        q : CasADi matrix, dof x 1
        hand : {"left", "right"}

        Returns
        -------
        CasADi matrix, 2 x 1
            x and y in length units.

        Raises
        ------
        ValueError
            ``q`` does not have ``dof`` entries, or the hand is unknown.
        """
        import casadi

        arm = self.arm(hand)
        size = getattr(q, "numel", lambda: brief_value(q))()
        if size != self.dof:
            raise ValueError(f"q has {size} symbolic entries; this robot needs {self.dof}")
        # Plain floats: a NumPy scalar times a CasADi symbol would call NumPy first.
        plain = arm._replace(links=arm.links.tolist())
        xs, ys = _points_of(q, plain, casadi.cos, casadi.sin)
        return casadi.vertcat(xs[-1], ys[-1])

    def symbolic_hand_jerk(self, q: Sequence[Any], hand: Hand) -> Any:
        """Return the third time derivative of a hand's position as a CasADi expression.

        The formula is written out by hand. If CasADi differentiates three times itself, the Hessian
        of the result needs more than twice as many operations.

        Parameters
        ----------
        q : sequence of four SX expressions of ``dof`` entries
            The configuration and its first three time derivatives.
        hand : {"left", "right"}

        Returns
        -------
        SX expression, 2 x 1
            The jerk in x and y, in length units per cubed unit of time.

        Raises
        ------
        ValueError
            The hand is unknown.
        """
        import casadi

        arm, (x, y) = self.arm(hand), (q[3][0], q[3][1])
        angles = [casadi.SX(0)] * 4  # of a link, and its derivatives
        for k, link in enumerate(arm.links.tolist()):
            turns = [derivative[arm.first_joint + k] for derivative in q]
            angles = [angle + turn for angle, turn in zip(angles, turns, strict=True)]
            angle, rate, acceleration, jerk = angles
            along, across = -3 * rate * acceleration, jerk - rate**3
            cos, sin = casadi.cos(angle), casadi.sin(angle)
            x += link * (along * cos - across * sin)
            y += link * (along * sin + across * cos)
        return casadi.vertcat(x, y)

    def _configuration(self, q: ArrayLike) -> Array:
        array = real_array("configuration", q)
        if array.ndim == 0 or array.shape[-1] != self.dof:
            raise ValueError(f"configuration has shape {array.shape}; it must be (..., {self.dof})")
        if not np.isfinite(array).all():
            raise ValueError(
                f"configuration is {brief_value(array.tolist())}; all entries must be finite"
            )
        return array

    def _numpy_chain(self, q: Array, hand: Hand) -> tuple[list[Any], list[Any]]:
        by_joint = q if q.ndim == 1 else np.moveaxis(q, -1, 0)
        return _points_of(by_joint, self.arm(hand), np.cos, np.sin)

    @staticmethod
    def _hand(xs: list[Any], ys: list[Any], q: Array) -> Array:
        """Return the positions of a hand, which are the last entries of ``xs`` and ``ys``.

        For configurations ``q`` of shape ``(..., dof)`` the result has shape ``(..., 2)``.
        """
        position = np.empty((*q.shape[:-1], 2))
        position[..., 0], position[..., 1] = xs[-1], ys[-1]
        return position


def _points_of(q: Any, arm: Arm, cos: Any, sin: Any) -> tuple[list[Any], list[Any]]:
    """Return lists of x and y of an arm's shoulder, joints and hand.

    The parameters are those of :func:`chain`.
    """
    xs: list[Any] = [None] * (len(arm.links) + 1)
    ys = [*xs]
    chain(q, arm, xs, ys, cos, sin)
    return xs, ys


def directions(angles: ArrayLike) -> Array:
    """Return the unit vectors (cos, sin) of angles that are measured from +x.

    ``angles`` has shape ``(...)``, in rad. The result has shape ``(..., 2)``.
    """
    absolute = np.asarray(angles, dtype=np.float64)
    return np.stack([np.cos(absolute), np.sin(absolute)], axis=-1)
