"""Random numbers that stay the same: a counter-based generator in integers alone.

Philox4x32-10 (Salmon, Moraes, Dror & Shaw 2011, *Parallel random numbers: as easy as 1, 2, 3*)
turns a counter of four words and a key of two into four words. Nothing is carried from one draw to
the next, so that what is drawn depends on counter and key alone, and on no library.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Sequence
from typing import TypeVar

Choice = TypeVar("Choice")
Words = tuple[int, int, int, int]
_WORD = (1 << 32) - 1
_ROUNDS = 10
_FACTORS = 0xD2511F53, 0xCD9E8D57
_WEYL = 0x9E3779B9, 0xBB67AE85  # golden ratio, sqrt(3) - 1


def philox4x32(counter: Words, key: tuple[int, int]) -> Words:
    """Return four random words, integers of 32 bits, for a counter of four words and a key of two;
    equal arguments give equal words."""
    a, b, c, d = counter
    left, right = key
    for _ in range(_ROUNDS):
        first, second = a * _FACTORS[0], c * _FACTORS[1]
        a, b, c, d = (
            second >> 32 ^ b ^ left,
            second & _WORD,
            first >> 32 ^ d ^ right,
            first & _WORD,
        )
        left, right = left + _WEYL[0] & _WORD, right + _WEYL[1] & _WORD
    return a, b, c, d


def hash_key(name: str) -> tuple[int, int]:
    """Return the key of a name: the first two words, 32 bits each, little-endian, of the SHA-256 of
    its UTF-8."""
    first, second = struct.unpack("<2I", hashlib.sha256(name.encode()).digest()[:8])
    return first, second


class Draws:
    """Integers drawn one after the other; equal keys and places give equal integers.

    ``place`` is three words of the counter; the other word counts the blocks of four words used.
    """

    def __init__(self, key: tuple[int, int], *place: int) -> None:
        first, second, third = place
        blocks = (philox4x32((block, first, second, third), key) for block in range(_WORD))
        self._pairs = (pair for a, b, c, d in blocks for pair in (a << 32 | b, c << 32 | d))

    def integer(self, least: int, most: int) -> int:
        """Return an integer from ``least`` to ``most``, both included, drawn with equal
        probabilities to within 2^-64."""
        return least + (next(self._pairs) * (most - least + 1) >> 64)

    def one_of(self, choices: Sequence[Choice]) -> Choice:
        """Return one of ``choices``, drawn with probabilities as in :meth:`integer`."""
        return choices[self.integer(0, len(choices) - 1)]
