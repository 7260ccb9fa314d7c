"""Lower bound on a path from multipliers, whatever their source.

With any multipliers p_g of the movements, ‖p_g‖ <= 1, and λ_g of the hands at their goals, every
path obeys

    ‖Δq_g‖ >= p_g · Δq_g   and   0 >= λ_g · (hand_g − goal_g) − radius ‖λ_g‖,

so that it is at least as long as the least value of the sum of the right sides: a linear term of
each joint, and for each link ``slope φ + l λ · (cos φ, sin φ)``, whose least value over an interval
has a closed form. Joints that no link angle stands for change by no more than the path is long.
"""

import math
from typing import NamedTuple

import numba
import numpy as np

_TURN = 2.0 * math.pi
_PARABOLAS = 4  # steps by which an interval's end moves inwards


class Lagrangian(NamedTuple):
    """Lower bound on every path of interest: ``constant`` plus a term of each link angle.

    The terms are ``slope φ + size cos(φ - towards)``, over the links of a box.
    """

    constant: float
    slopes: np.ndarray
    sizes: np.ndarray
    towards: np.ndarray

    def bound(self, box):
        """Return the bound on paths whose link angles are in a box, shape ``(links, 2)``, rad."""
        return self.constant + float(least(*self[1:], *box.T).sum())

    def within(self, box, slack):
        """Return the part of a box in which no term exceeds its least value by more than ``slack``:
        other angles are on no path of interest, if the bound is short of the longest by that.

        An end moves inwards while a parabola below the term is above that; a term bends by no more
        than its size. A low end above the high one says that nothing is left.
        """
        limit = least(*self[1:], *box.T) + slack
        inwards = np.array([[1.0], [-1.0]])
        return moved_inwards(*self[1:], limit, inwards, box.T).T


@numba.vectorize
def moved_inwards(slope, size, towards, limit, inwards, end):
    """Return an end of an interval, moved in the direction ``inwards``, 1 or -1, while a parabola
    below the term is above ``limit``."""
    bend = max(size, 1e-12)
    for _ in range(_PARABOLAS):
        excess = slope * end + size * math.cos(end - towards) - limit
        if excess > 0.0:
            rise = inwards * (slope - size * math.sin(end - towards))
            end += inwards * (rise + math.sqrt(rise * rise + 2.0 * bend * excess)) / bend
    return end


@numba.vectorize
def least(slope, size, towards, low, high):
    """Return the least value of ``slope φ + size cos(φ - towards)`` from low to high, exactly.

    The term is least at an end or in a valley. Valleys are one turn apart: the first one is the
    lowest if the slope is upwards, else the last one.
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
