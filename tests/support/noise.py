"""The noise of a world, number by number: slow and obvious.

Integers are Python's, and the inverse of the normal distribution is scipy's; no code is shared with
:mod:`coartic.motion.kernels.noise`.
"""

import numpy as np
from scipy.special import ndtri

WORD = 2**64
PRACTICE, JUDGE = (int.from_bytes(word, "big") for word in (b"prac", b"judg"))


def hashed(word, number):
    """A step of SplitMix64 from a state that depends on a word and a number."""
    word = (word + 0x9E3779B97F4A7C15 * (number + 1)) % WORD
    word = (word ^ (word >> 30)) * 0xBF58476D1CE4E5B9 % WORD
    word = (word ^ (word >> 27)) * 0x94D049BB133111EB % WORD
    return word ^ (word >> 31)


def normal(seed, draw, goal, movement, coordinate):
    """z of a coordinate in a movement for a goal, both from 0, in a draw of a world's seed."""
    word = seed
    for number in (0, draw, goal, movement, coordinate):
        word = hashed(word, number)
    return ndtri(((word >> 12) + 0.5) / 2**52)


class World:
    """Where movements end that aim at targets, in one trial; its seed is a child of ``seed``."""

    def __init__(self, model, seed=0, draw=0, *, judge=False, grows=False):
        child = np.random.SeedSequence(seed, spawn_key=(JUDGE if judge else PRACTICE,))
        self.seed = int(child.generate_state(1, np.uint64)[0])
        self.sd, self.draw, self.grows = model.motor_noise, draw, grows
        self.goal = self.made = 0

    def begin(self, goal):
        """Begin the movements for a goal, from 0."""
        self.goal, self.made = goal, 0

    def end_of(self, q, corners):
        """Corners of a movement with noise: a row with its target, or a row for each waypoint."""
        corners = np.array(corners, dtype=np.float64)
        if self.sd == 0.0:
            return np.where(np.isnan(corners), q, corners)
        moves = (np.abs(corners - q) > 1e-9).any(axis=0)  # NaN is no number, and does not move
        last = np.where(np.isnan(corners[-1]), q, corners[-1])
        misses = self._misses(q, last, self.grows)
        shares = np.arange(1, len(corners) + 1)[:, None] / len(corners)
        return np.where(moves, corners + shares * misses, q)

    def end_of_correction(self, q, found, free):
        """Where a correction to the posture ``found`` ends; coordinates that are ``free`` miss."""
        if self.sd == 0.0:
            return found
        return np.where(free, found + self._misses(q, found, True), found)

    def _misses(self, q, target, grows):
        scale = min(1.0, np.linalg.norm(target - q)) if grows else 1.0
        movement, self.made = self.made, self.made + 1
        draws = [normal(self.seed, self.draw, self.goal, movement, c) for c in range(len(q))]
        return self.sd * scale * np.array(draws)
