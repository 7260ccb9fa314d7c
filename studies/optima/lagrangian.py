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

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TURN = 2.0 * math.pi
_PARABOLAS = 4  # steps by which an interval's end moves inwards


class Lagrangian(NamedTuple):
    """Lower bound on every path of interest: ``constant`` plus a term of each link angle.

    The terms are ``slope φ + size cos(φ - towards)``, over the links of a box.
    """

    constant: float
    slopes: Array
    sizes: Array
    towards: Array

    def at(self, angles):
        """Return the term of each link at its angle, shape ``(..., links)``."""
        return self.slopes * angles + self.sizes * np.cos(angles - self.towards)

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
        size = np.maximum(self.sizes, 1e-12)
        inwards = np.array([[1.0], [-1.0]])
        ends = box.T
        for _ in range(_PARABOLAS):
            excess = np.maximum(self.at(ends) - limit, 0.0)
            rise = inwards * (self.slopes - self.sizes * np.sin(ends - self.towards))
            safe = (rise + np.sqrt(rise**2 + 2.0 * size * excess)) / size
            ends = np.where(excess > 0.0, ends + inwards * safe, ends)
        return ends.T


def least(slopes, sizes, towards, low, high):
    """Return the least values of ``slope φ + size cos(φ - towards)`` from low to high, exactly.

    The term is least at an end or in a valley. Valleys are one turn apart: the first one is the
    lowest if the slope is upwards, else the last one.
    """
    steep = np.clip(slopes / np.maximum(sizes, 1e-300), -1.0, 1.0)
    valley = towards + (math.pi - np.arcsin(steep))
    first = valley + _TURN * np.ceil((low - valley) / _TURN)
    last = valley + _TURN * np.floor((high - valley) / _TURN)
    inside = np.clip(np.where(slopes >= 0.0, first, last), low, high)
    ends = np.broadcast_arrays(low, inside, high)
    return np.min(slopes * ends + sizes * np.cos(ends - towards), axis=0)
