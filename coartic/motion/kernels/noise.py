"""Motor noise: standard normal numbers from a counter-based random number generator.

The generator has no state. Each number is a function of

- the seed of the noise, and the number of the draw, such as the number of the trial;
- the goal, and the number of the movement that is made for this goal, from 0;
- the coordinate of the configuration.

So no number depends on the order of trials, on the other runs of a batch or on the number of
threads. Two solutions that are executed with the same seed and the same draw are executed with the
same noise (*common random numbers*).

SplitMix64 (Steele, Lea & Flood 2014, *Fast splittable pseudorandom number generators*, OOPSLA)
hashes the arguments one after another. Algorithm AS 241, which computes the quantile function of
the normal distribution, converts the hash to a normal number (Wichura 1988, *The percentage points
of the normal distribution*, Applied Statistics 37:477-484; relative error 1e-16). The logarithm in
this algorithm is computed as a series, because the logarithms of C libraries differ between systems
in the last bit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from coartic.motion.kernels.compile import inlined, inner
from coartic.motion.kernels.slots import RobotRecord, RunRecord, squared_distance

STAYS = 1e-9
"""Largest change of a coordinate that does not count as movement, in length units or rad."""
MAX_CORRECTIONS = 50
"""Largest number of corrective movements for one goal where movements are noisy."""
_WORD = np.uint64
_GOLDEN = _WORD(0x9E3779B97F4A7C15)  # 2^64 divided by the golden ratio
_FIRST, _SECOND = _WORD(0xBF58476D1CE4E5B9), _WORD(0x94D049BB133111EB)
_30, _27, _31, _12 = _WORD(30), _WORD(27), _WORD(31), _WORD(12)
_UNIT = 2.0**-52
_LN_2 = math.log(2.0)


@inner
def hashed(word: Any, number: int) -> Any:
    """Hash a 64-bit word and a non-negative integer by SplitMix64."""
    mixed = word + _GOLDEN * (_WORD(number) + _WORD(1))
    mixed = (mixed ^ (mixed >> _30)) * _FIRST
    mixed = (mixed ^ (mixed >> _27)) * _SECOND
    return mixed ^ (mixed >> _31)


@inner
def _logarithm(x: float) -> float:
    """Return the natural logarithm of a number between 0 and 1.

    x = 2^k m with m from √½ to √2, and ln m = 2 (s + s³/3 + s⁵/5 + ...) with s = (m - 1) / (m + 1).
    """
    halvings = 0
    while x < 0.7071067811865476:
        x, halvings = x + x, halvings + 1
    s = (x - 1.0) / (x + 1.0)
    square, series = s * s, 0.0
    for k in range(21, 0, -2):
        series = series * square + 1.0 / k
    return 2.0 * s * series - halvings * _LN_2


@inner
def normal_of(word: Any) -> float:
    """Convert a uniformly distributed 64-bit word to a standard normal number."""
    uniform = (float(word >> _12) + 0.5) * _UNIT  # between 0 and 1, exact
    centred = uniform - 0.5
    if abs(centred) <= 0.425:
        r = 0.180625 - centred * centred
        above = ((((((2509.0809287301226727 * r + 33430.575583588128105) * r
            + 67265.770927008700853) * r + 45921.953931549871457) * r
            + 13731.693765509461125) * r + 1971.5909503065514427) * r
            + 133.14166789178437745) * r + 3.387132872796366608  # fmt: skip
        below = ((((((5226.495278852854561 * r + 28729.085735721942674) * r
            + 39307.89580009271061) * r + 21213.794301586595867) * r
            + 5394.1960214247511077) * r + 687.1870074920579083) * r
            + 42.313330701600911252) * r + 1.0  # fmt: skip
        return centred * above / below
    r = math.sqrt(-_logarithm(min(uniform, 1.0 - uniform)))
    if r <= 5.0:
        r -= 1.6
        above = ((((((7.7454501427834140764e-4 * r + 0.0227238449892691845833) * r
            + 0.24178072517745061177) * r + 1.27045825245236838258) * r
            + 3.64784832476320460504) * r + 5.7694972214606914055) * r
            + 4.6303378461565452959) * r + 1.42343711074968357734  # fmt: skip
        below = ((((((1.05075007164441684324e-9 * r + 5.475938084995344946e-4) * r
            + 0.0151986665636164571966) * r + 0.14810397642748007459) * r
            + 0.68976733498510000455) * r + 1.6763848301838038494) * r
            + 2.05319162663775882187) * r + 1.0  # fmt: skip
    else:
        r -= 5.0
        above = ((((((2.01033439929228813265e-7 * r + 2.71155556874348757815e-5) * r
            + 0.0012426609473880784386) * r + 0.026532189526576123093) * r
            + 0.29656057182850489123) * r + 1.7848265399172913358) * r
            + 5.4637849111641143699) * r + 6.6579046435011037772  # fmt: skip
        below = ((((((2.04426310338993978564e-15 * r + 1.4215117583164458887e-7) * r
            + 1.8463183175100546818e-5) * r + 7.868691311456132591e-4) * r
            + 0.0148753612908506148525) * r + 0.13692988092273580531) * r
            + 0.59983220655588793769) * r + 1.0  # fmt: skip
    return math.copysign(above / below, centred)


@inner
def _key_of_movement(run: RunRecord) -> Any:
    """Return the key of the noise of a run's next movement, and count the movement."""
    key = hashed(hashed(run.world, run.number), run.made)
    run.made += 1
    return key


@inlined
def miss_target(run: RunRecord, robot: RobotRecord) -> None:
    """Displace the ``end`` of a run's aimed movement by noise, in place.

    Coordinate c moves if its target t_c differs by more than 1e-9 from its present value. A
    coordinate that moves ends at t_c + s z_c. All other coordinates keep their present values. If
    ``robot.grows`` is True, s min(1, L) takes the place of s. Here L is the Euclidean distance from
    the present configuration to the target.
    """
    sd, key = robot.model.motor_noise, _key_of_movement(run)
    if robot.grows:
        sd *= min(1.0, math.sqrt(squared_distance(run)))
    for j in range(len(run.q)):
        moves = abs(run.target[j] - run.q[j]) > STAYS
        run.end[j] = run.target[j] + sd * normal_of(hashed(key, j)) if moves else run.q[j]


@inlined
def displace_path(run: RunRecord, waypoints: Any, robot: RobotRecord) -> None:
    """Draw the noise of a path: the displacement of its last waypoint, in place.

    The displacement becomes the ``end`` of the run. It is s z_c in each coordinate c that any of
    the ``waypoints``, shape ``(W, dof)``, moves, and NaN in all other coordinates. If
    ``robot.grows`` is True, s min(1, L) takes the place of s. Here L is the Euclidean distance from
    the present configuration to the last waypoint. The caller has set the ``target`` of the run to
    the last waypoint.
    """
    sd, key = robot.model.motor_noise, _key_of_movement(run)
    if robot.grows:
        sd *= min(1.0, math.sqrt(squared_distance(run)))
    for j in range(len(run.q)):
        moves = False
        for k in range(len(waypoints) if j < waypoints.shape[1] else 0):
            moves |= abs(waypoints[k, j] - run.q[j]) > STAYS
        run.end[j] = sd * normal_of(hashed(key, j)) if moves else math.nan


@inlined
def miss_correction(run: RunRecord, robot: RobotRecord) -> None:
    """Displace the ``end`` of a run's corrective movement by noise, in place.

    The target is the configuration **a** that the corrective process found. Coordinate c of the
    base and the chosen arm ends at a_c + s min(1, L) z_c. Here s is the motor noise, z_c is a
    standard normal number, and L is the Euclidean distance from the present configuration to **a**.
    A locked base coordinate and the idle arm end at a_c.
    """
    sd = robot.model.motor_noise * min(1.0, math.sqrt(squared_distance(run)))
    key, arm = _key_of_movement(run), robot.arms[run.hand]
    for j in range(len(run.q)):
        k = j - arm.first_joint
        free = robot.free_x if j == 0 else robot.free_y if j == 1 else 0 <= k < arm.count
        noise = sd * normal_of(hashed(key, j)) if free else 0.0
        run.end[j] = run.target[j] + noise
