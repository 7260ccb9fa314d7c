"""Cosine and sine for the compiled kernels, computed only by basic IEEE arithmetic.

The cosines and sines of C libraries differ between systems in the last bit, and a difference of one
bit can end a movement one step earlier. The functions here use only +, -, * and rounding, so that
the kinematics in the kernels are the same on all systems. :func:`near_cosine` and :func:`near_sine`
have no branches, so that the compiler can use vector instructions.

The angle is reduced by multiples of π/2 in three parts (Cody & Waite 1980, *Software Manual for the
Elementary Functions*). The Taylor series follows; its truncation error on [-π/4, π/4] is below
3e-18. The total error is below 2e-16 for |angle| < 1e5 rad (tested). For larger angles the C
library's functions are called.
"""

from __future__ import annotations

import math

import numpy as np

from coartic.motion.kernels.compile import scalar

MAX_ANGLE = 1e5  # rad; up to here k * _HIGH and k * _MIDDLE below are exact

# π/2 in parts: the two leading ones have 33 significant bits each.
_HIGH = 1.57079632673412561417
_MIDDLE = 6.07710050630396597660e-11
_LOW = 2.02226624879595063154e-21
_PER_QUARTER = 2.0 / math.pi

_S3, _S5, _S7, _S9, _S11, _S13, _S15, _S17 = (
    (-1) ** n / math.factorial(2 * n + 1) for n in range(1, 9)
)
_C4, _C6, _C8, _C10, _C12, _C14, _C16 = ((-1) ** n / math.factorial(2 * n) for n in range(2, 9))


@scalar
def _reduced(angle: float) -> tuple[float, float, int]:
    """Divide an angle into quarter turns and a remainder from -π/4 to π/4.

    The angle is in rad, |angle| < 1e5. Return the sine of the remainder, the cosine of the
    remainder, and the number of quarter turns modulo 4.
    """
    quarters = np.rint(angle * _PER_QUARTER)
    x = ((angle - quarters * _HIGH) - quarters * _MIDDLE) - quarters * _LOW
    # Estrin's order: short chains of dependent operations.
    z = x * x
    z2 = z * z
    z4 = z2 * z2
    odd = (_S3 + z * _S5) + z2 * (_S7 + z * _S9)
    odd += z4 * ((_S11 + z * _S13) + z2 * (_S15 + z * _S17))
    even = (_C4 + z * _C6) + z2 * (_C8 + z * _C10)
    even += z4 * ((_C12 + z * _C14) + z2 * _C16)
    sine = x + (x * z) * odd
    cosine = 1.0 - (0.5 * z - z2 * even)
    return sine, cosine, int(quarters) & 3


@scalar
def near_cosine(angle: float) -> float:
    """Return cos(angle), the same bits on every system, for |angle| < :data:`MAX_ANGLE`."""
    sin, cos, quarter = _reduced(angle)
    value: float = sin if quarter & 1 else cos
    return -value if (quarter + 1) & 2 else value


@scalar
def near_sine(angle: float) -> float:
    """Return sin(angle), the same bits on every system, for |angle| < :data:`MAX_ANGLE`."""
    sin, cos, quarter = _reduced(angle)
    value: float = cos if quarter & 1 else sin
    return -value if quarter & 2 else value


@scalar
def cosine(angle: float) -> float:
    """Return the cosine of an angle in rad.

    The bits are the same on every system for |angle| < 1e5.
    """
    return near_cosine(angle) if abs(angle) < MAX_ANGLE else math.cos(angle)


@scalar
def sine(angle: float) -> float:
    """Return the sine of an angle in rad.

    The bits are the same on every system for |angle| < 1e5.
    """
    return near_sine(angle) if abs(angle) < MAX_ANGLE else math.sin(angle)
