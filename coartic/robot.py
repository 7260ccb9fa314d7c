"""The robot: the one kinematic module of the project.

A planar, kinematic robot of a mobile base and two serial arms (paper, Figure 1).
A configuration is the vector ``q = (base_x, base_y, left_1 .. left_n, right_1 ..
right_n)``; lengths are in the model's length unit, angles in rad. Angles are
relative: each joint is measured from the previous link, the first one from +x.

The formulas stand once, in :func:`chain` and :func:`lever`, and are written so
that one source serves three worlds: NumPy arrays (vectorised over leading axes),
CasADi symbols, and the compiled kernels. The caller hands in the cosine and sine
of its world. No other module takes a cosine of a joint angle.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

Hand = Literal["left", "right"]
Array = NDArray[np.float64]
LARGEST = 1e4  # of any figure: far beyond use, and exact in all that follows
MOST_LINKS = 100  # of an arm
Finite = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Length = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False, le=LARGEST)]
_Links = Annotated[tuple[Length, ...], Field(min_length=1, max_length=MOST_LINKS)]

HANDS: tuple[Hand, Hand] = ("left", "right")  # A, in the order that breaks ties
BASE_DOF = 2


class Arm(NamedTuple):
    """One arm as the formulas and the compiled kernels read it."""

    first: int  # index in q of the first joint
    links: Any  # (n,) link lengths, length unit
    shoulder_x: float  # shoulder from the centre of the base, length unit
    shoulder_y: float


def chain(q: Any, arm: Arm, xs: Any, ys: Any, cos: Any, sin: Any) -> None:
    """Forward kinematics: fill ``xs, ys`` with shoulder, joints and hand.

    Entry 0 is the shoulder, entry ``n`` (the number of links) the hand. Works on
    anything that can be indexed and added: ``q`` is indexed by joint first.
    Source: Craig (2004), planar serial chain.
    """
    x = q[0] + arm.shoulder_x
    y = q[1] + arm.shoulder_y
    xs[0] = x
    ys[0] = y
    angle = 0.0
    for k in range(len(arm.links)):
        angle = angle + q[arm.first + k]
        x = x + arm.links[k] * cos(angle)
        y = y + arm.links[k] * sin(angle)
        xs[k + 1] = x
        ys[k + 1] = y


def lever(xs: Any, ys: Any, joint: int, tip: int) -> tuple[Any, Any]:
    """Derivative of point ``tip`` of a chain by the angle of ``joint`` (0-based).

    A rotation about a joint moves the tip at right angles to the line between
    them: a column of the geometric Jacobian, in length unit per rad.
    """
    return -(ys[tip] - ys[joint]), xs[tip] - xs[joint]


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Robot:
    """Geometry of a two-armed planar robot; the default is the paper's.

    Four unit links an arm on a box 1 wide and 0.2 high are printed (Figure 1).
    Shoulders on the top corners of the box are inferred: only a height of +0.1
    gives the published initial rewards of the one-armed tasks (docs/model.md).
    """

    left_links: _Links = (1.0, 1.0, 1.0, 1.0)
    right_links: _Links = (1.0, 1.0, 1.0, 1.0)
    left_shoulder: tuple[Finite, Finite] = (-0.5, 0.1)
    right_shoulder: tuple[Finite, Finite] = (0.5, 0.1)
    base_size: tuple[Length, Length] = (1.0, 0.2)

    @property
    def dof(self) -> int:
        """Number of degrees of freedom, the length of ``q``."""
        return BASE_DOF + len(self.left_links) + len(self.right_links)

    @property
    def shoulder_height(self) -> float:
        """Of both shoulders above the base's centre; ValueError where they differ."""
        (_, left), (_, right) = self.left_shoulder, self.right_shoulder
        if left != right:
            raise ValueError(f"the left shoulder is at {left}, the right one at {right}")
        return left

    @property
    def most_links(self) -> int:
        """Number of links of the longer arm."""
        return max(len(self.left_links), len(self.right_links))

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the entries of ``q``: base_x, base_y, left_1, ..., right_n."""
        left = (f"left_{k + 1}" for k in range(len(self.left_links)))
        right = (f"right_{k + 1}" for k in range(len(self.right_links)))
        return ("base_x", "base_y", *left, *right)

    @cached_property
    def _arms(self) -> dict[str, Arm]:
        def links(lengths: tuple[float, ...]) -> Array:
            array = np.array(lengths, dtype=np.float64)
            array.setflags(write=False)
            return array

        right_first = BASE_DOF + len(self.left_links)
        return {
            "left": Arm(BASE_DOF, links(self.left_links), *map(float, self.left_shoulder)),
            "right": Arm(right_first, links(self.right_links), *map(float, self.right_shoulder)),
        }

    def arm(self, hand: Hand) -> Arm:
        """The arm that carries ``hand``."""
        try:
            return self._arms[hand]
        except KeyError:
            raise ValueError(f"unknown hand {hand!r}: a hand is 'left' or 'right'") from None

    def joints(self, hand: Hand) -> slice:
        """The part of ``q`` that holds the joints of one arm, without the base."""
        arm = self.arm(hand)
        return slice(arm.first, arm.first + len(arm.links))

    def reach(self, hand: Hand) -> tuple[float, float]:
        """Nearest and farthest distance of the hand from its shoulder, length unit."""
        links = self.left_links if hand == "left" else self.right_links
        return max(0.0, 2 * max(links) - sum(links)), math.fsum(links)

    def forward_kinematics(self, q: ArrayLike, hand: Hand) -> Array:
        """Hand position F_a(q), shape ``(..., 2)``, for ``q`` of shape ``(..., dof)``."""
        array = self._configuration(q)
        return self._hand(*self._numpy_chain(array, hand), array)

    def joint_positions(self, q: ArrayLike, hand: Hand) -> Array:
        """Positions of shoulder, joints and hand, shape ``(..., n + 1, 2)``."""
        xs, ys = self._numpy_chain(self._configuration(q), hand)
        return np.stack([np.stack(xs, axis=-1), np.stack(ys, axis=-1)], axis=-1)

    def jacobian(self, q: ArrayLike, hand: Hand) -> Array:
        """Jacobian of the hand position by all of ``q``, shape ``(..., 2, dof)``.

        Columns of the other arm's joints are zero. Units: length unit per length
        unit (base) or per rad (joints).
        """
        return self.linearised(q, hand)[1]

    def linearised(self, q: ArrayLike, hand: Hand) -> tuple[Array, Array]:
        """:meth:`forward_kinematics` and :meth:`jacobian` of the same ``q``, of one chain."""
        array = self._configuration(q)
        xs, ys = self._numpy_chain(array, hand)
        arm, tip = self.arm(hand), len(xs) - 1
        result = np.zeros((*array.shape[:-1], 2, self.dof))
        result[..., 0, 0] = 1.0
        result[..., 1, 1] = 1.0
        for k in range(tip):
            result[..., 0, arm.first + k], result[..., 1, arm.first + k] = lever(xs, ys, k, tip)
        return self._hand(xs, ys, array), result

    def base_outline(self, q: ArrayLike) -> Array:
        """Corners of the base, counter-clockwise from lower left, shape ``(..., 4, 2)``."""
        array = self._configuration(q)
        half = np.array(self.base_size) / 2
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        return array[..., None, :BASE_DOF] + corners

    def symbolic_hand(self, q: Any, hand: Hand) -> Any:
        """Hand position as a CasADi expression, 2 x 1, for a CasADi ``q`` (dof x 1)."""
        import casadi

        return casadi.vertcat(*self.symbolic_joints(q, hand)[-1])

    def symbolic_joints(self, q: Any, hand: Hand) -> list[tuple[Any, Any]]:
        """Positions of shoulder, joints and hand, as :meth:`symbolic_hand`, x and y of each."""
        import casadi

        arm = self.arm(hand)
        if q.numel() != self.dof:
            raise ValueError(f"symbolic q has {q.numel()} entries; this robot needs {self.dof}")
        xs: list[Any] = [None] * (len(arm.links) + 1)
        ys: list[Any] = [None] * (len(arm.links) + 1)
        # Plain floats: a NumPy scalar times a CasADi symbol would call NumPy first.
        plain = arm._replace(links=[float(length) for length in arm.links])
        chain(q, plain, xs, ys, casadi.cos, casadi.sin)
        return list(zip(xs, ys, strict=True))

    def _configuration(self, q: ArrayLike) -> Array:
        array = np.asarray(q, dtype=np.float64)
        if array.ndim == 0 or array.shape[-1] != self.dof:
            raise ValueError(
                f"configuration has shape {array.shape}; this robot needs (..., {self.dof})"
            )
        return array

    def _numpy_chain(self, q: Array, hand: Hand) -> tuple[list[Any], list[Any]]:
        arm = self.arm(hand)
        xs: list[Any] = [None] * (len(arm.links) + 1)
        ys: list[Any] = [None] * (len(arm.links) + 1)
        by_joint = q if q.ndim == 1 else np.moveaxis(q, -1, 0)
        chain(by_joint, arm, xs, ys, np.cos, np.sin)
        return xs, ys

    @staticmethod
    def _hand(xs: list[Any], ys: list[Any], q: Array) -> Array:
        """The end of a chain, shape ``(..., 2)``."""
        position = np.empty((*q.shape[:-1], 2))
        position[..., 0], position[..., 1] = xs[-1], ys[-1]
        return position


def directions(angles: ArrayLike) -> Array:
    """Unit vectors of links at absolute angles (rad), shape ``(..., 2)``."""
    absolute = np.asarray(angles, dtype=np.float64)
    return np.stack([np.cos(absolute), np.sin(absolute)], axis=-1)
