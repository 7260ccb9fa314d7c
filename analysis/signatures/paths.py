"""The form of a movement: reversals of the base, turns in joint space, smoothness.

Solutions move at constant joint speed along straight lines in joint space and stop for a
tick at the end of each movement. Smoothness of the hand's path therefore says little about
one solution by itself, and nothing that compares with human recordings: compare methods.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import integrate

from coartic import Trajectory
from coartic.robot import Array

REVERSAL = 0.01
"""Way back that makes a reversal, length unit: the model's step m."""
TICK_RATE = 100.0
"""Ticks a second that smoothness assumes, so that its cut-off is in Hz; ours."""
_CUT_OFF, _THRESHOLD = 10.0, 0.05  # of the spectrum: Hz, of its peak
_LEAST_ROWS = 6  # below that a third derivative says nothing
_ROUNDING = 1e-10  # of the peak speed: jerk below it is rounding
_NO_LENGTH = 1e-9  # of a displacement in joint space


def base_reversals(positions: Array) -> int:
    """How often a base coordinate changes the sign of its velocity, ≥ 0.

    ``positions`` has shape ``(ticks,)``, length unit. A change of sign counts once the base
    has gone back by more than :data:`REVERSAL`; what is smaller is jitter.
    """
    reversals = direction = 0
    low, high = math.inf, -math.inf
    for x in positions.tolist():
        low, high = min(low, x), max(high, x)
        if direction <= 0 and x - low > REVERSAL:
            reversals -= direction
            direction, high = 1, x
        elif direction >= 0 and high - x > REVERSAL:
            reversals += direction
            direction, low = -1, x
    return reversals


def turning_angles(postures: Array) -> Array:
    """Angles between successive displacements in joint space, rad, shape ``(G - 1,)``.

    ``postures`` has shape ``(G + 1, dof)``: the start and the configuration at each hit. 0
    goes straight on, π turns back. NaN next to a displacement of no length. The base's length
    unit and the joints' rad count alike, as in the model's joint-space distance.
    """
    steps = np.diff(postures, axis=0)
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    units = np.divide(steps, lengths, out=np.full_like(steps, np.nan), where=lengths > _NO_LENGTH)
    # Accurate near 0 and π, unlike the arc cosine.
    apart = np.linalg.norm(units[1:] - units[:-1], axis=1)
    along = np.linalg.norm(units[1:] + units[:-1], axis=1)
    angles: Array = 2 * np.arctan2(apart, along)
    return angles


def spectral_arc_length(hand_path: Array) -> float:
    """SPARC of a hand path's speed profile: -∞ to 0, smoother nearer 0.

    The negative length of the amplitude spectrum's curve, amplitude and frequency both scaled to
    1, up to the last frequency below 10 Hz with an amplitude of at least 0.05. Dimensionless and
    independent of amplitude and duration; about -1.4 for one smooth movement. ``hand_path`` has
    shape ``(ticks, 2)``. NaN for paths that are too short or do not move. Zero padding by a
    factor of 16 or more. Source: Balasubramanian, Melendez-Calderon, Roby-Brami & Burdet (2015),
    doi:10.1186/s12984-015-0090-9.
    """
    speed = np.linalg.norm(np.diff(hand_path, axis=0), axis=1) * TICK_RATE
    if len(hand_path) < _LEAST_ROWS or not speed.any():
        return math.nan
    size = 2 ** (math.ceil(math.log2(len(speed))) + 4)
    frequencies = np.fft.rfftfreq(size, 1 / TICK_RATE)
    amplitudes = np.abs(np.fft.rfft(speed, size))
    amplitudes /= amplitudes.max()
    last = int(np.flatnonzero((frequencies <= _CUT_OFF) & (amplitudes >= _THRESHOLD))[-1])
    if last == 0:
        return math.nan
    across = np.diff(frequencies[: last + 1]) / frequencies[last]
    return -float(np.hypot(across, np.diff(amplitudes[: last + 1])).sum())


def dimensionless_jerk(hand_path: Array) -> float:
    """T³/v² ∫‖jerk‖² dt of a hand path, T its duration and v its peak speed; ≥ 0.

    Independent of amplitude and duration; 204.8 for a minimum-jerk reach, the least between
    points at rest, and 0 at constant velocity. Ends count as they are: the jump from and to
    rest is not part of it. ``hand_path`` has shape ``(ticks, 2)``. The jerk is taken by
    differences, so that any corner's share grows with the sampling. NaN for paths that are
    too short or do not move. Source: Hogan & Sternad (2009), doi:10.3200/35-09-004-RC.
    """
    if len(hand_path) < _LEAST_ROWS:
        return math.nan
    peak = float(np.linalg.norm(np.diff(hand_path, axis=0), axis=1).max())
    if peak == 0:
        return math.nan
    jerk = np.linalg.norm(np.diff(hand_path, n=3, axis=0), axis=1) / peak
    jerk[jerk < _ROUNDING] = 0.0
    return float((len(hand_path) - 1) ** 3 * integrate.trapezoid(jerk**2))


def smoothness(path: Trajectory) -> tuple[float, float]:
    """SPARC and log dimensionless jerk of the chosen hand's path, over subtasks.

    SPARC is the mean over subtasks. The log dimensionless jerk is -ln of the mean of
    :func:`dimensionless_jerk` (logarithm: Balasubramanian et al. 2015): smoother is larger,
    -∞ to ∞, -5.3 for a minimum-jerk reach; ∞ where there is no jerk at all. Subtasks of fewer
    than six rows and those without motion of the hand are left out.
    """
    of_subtasks = []
    for number, hand in enumerate(path.hands, 1):
        hand_path = path.task.robot.forward_kinematics(path.subtask(number), hand)
        values = spectral_arc_length(hand_path), dimensionless_jerk(hand_path)
        if not np.isnan(values).any():
            of_subtasks.append(values)
    if not of_subtasks:
        return math.nan, math.nan
    sparc, jerk = np.array(of_subtasks).mean(axis=0).tolist()
    return sparc, -math.log(jerk) if jerk else math.inf
