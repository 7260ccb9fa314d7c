"""Bound the length of a path from below, with any multipliers.

With any multipliers p_g of the movements, ‖p_g‖ <= 1, and λ_g of the hands at their goals, every
path obeys

    ‖Δq_g‖ >= p_g · Δq_g   and   0 >= λ_g · (hand_g − goal_g) − radius ‖λ_g‖.

So a path is at least as long as the smallest value of the sum of the right sides. The sum has a
linear term for each joint, and a term ``slope φ + l λ · (cos φ, sin φ)`` for each link, whose
smallest value over an interval has a closed form. Joints that do not belong to a link angle change
by at most the length of the path.
"""

import math
from typing import NamedTuple

import numpy as np

from coartic.motion.kernels.compile import import_numba

numba = import_numba()  # with the kernels' settings; without them the kernels are compiled again
_TURN = 2.0 * math.pi
_PARABOLAS = 4  # steps by which an interval's end moves inwards


class Lagrangian(NamedTuple):
    """Lower bound on every path of interest: ``constant`` plus a term for each link angle φ.

    The term of a link of a box is ``slope φ + size cos(φ - towards)``.
    """

    constant: float
    slopes: np.ndarray
    sizes: np.ndarray
    towards: np.ndarray

    def bound(self, box):
        """Return the bound on paths with link angles in a box, shape ``(links, 2)``, in rad."""
        return self.constant + float(least(*self[1:], *box.T).sum())

    def within(self, box, slack):
        """Return the part of a box in which no term exceeds its minimum by more than ``slack``.

        If the bound plus ``slack`` is the longest path of interest, no path of interest has other
        angles. An end of an interval moves inwards as long as a parabola below the term is above
        this limit. (The second derivative of a term is at most its size.) If a low end is above the
        high end, nothing of the box is left.
        """
        limit = least(*self[1:], *box.T) + slack
        inwards = np.array([[1.0], [-1.0]])
        return moved_inwards(*self[1:], limit, inwards, box.T).T


@numba.vectorize
def moved_inwards(slope, size, towards, limit, inwards, end):
    """Return an end of an interval, moved as long as a parabola below the term is above ``limit``.

    ``inwards`` is the direction of the movement, 1 or -1.
    """
    bend = max(size, 1e-12)
    for _ in range(_PARABOLAS):
        excess = slope * end + size * math.cos(end - towards) - limit
        if excess > 0.0:
            rise = inwards * (slope - size * math.sin(end - towards))
            end += inwards * (rise + math.sqrt(rise * rise + 2.0 * bend * excess)) / bend
    return end


@numba.vectorize
def least(slope, size, towards, low, high):
    """Return the minimum of ``slope φ + size cos(φ - towards)`` over φ from low to high, exactly.

    The minimum is at an end or in a valley. Valleys are one turn apart. The first valley is the
    lowest if the slope is positive, otherwise the last one.
    """
    valley = towards + (math.pi - math.asin(min(1.0, max(-1.0, slope / max(size, 1e-300)))))
    if slope >= 0.0:
        valley += _TURN * math.ceil((low - valley) / _TURN)
    else:
        valley += _TURN * math.floor((high - valley) / _TURN)
    valley = min(max(valley, low), high)
    return min(
        slope * low + size * math.cos(low - towards),
        slope * valley + size * math.cos(valley - towards),
        slope * high + size * math.cos(high - towards),
    )
