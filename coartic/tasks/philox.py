"""A counter-based random number generator whose numbers are the same on every machine.

Philox4x32-10 (Salmon, Moraes, Dror & Shaw 2011, *Parallel random numbers: as easy as 1, 2, 3*)
turns a counter of four words and a key of two words into four random words. No state is carried
from one draw to the next. A draw therefore depends only on counter and key, and not on a library.
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
    """Return four random words of 32 bits, computed from a counter and a key.

    The counter consists of four words of 32 bits, and the key consists of two. Equal arguments give
    equal words.
    """
    a, b, c, d = counter
    left, right = key
    for _ in range(_ROUNDS):
        product_a, product_c = a * _FACTORS[0], c * _FACTORS[1]
        a, b, c, d = (
            product_c >> 32 ^ b ^ left,
            product_c & _WORD,
            product_a >> 32 ^ d ^ right,
            product_a & _WORD,
        )
        left, right = left + _WEYL[0] & _WORD, right + _WEYL[1] & _WORD
    return a, b, c, d


def hash_key(name: str) -> tuple[int, int]:
    """Return the key of a name: two words of its SHA-256.

    The words are the first two of the hash of the name in UTF-8, with 32 bits each, little-endian.
    """
    left, right = struct.unpack("<2I", hashlib.sha256(name.encode()).digest()[:8])
    return left, right


class Draws:
    """Stream of random integers; equal keys and counters give equal streams.

    Parameters
    ----------
    key : tuple of int
        Key of the generator, two words of 32 bits.
    *counter : int
        The last three words of the generator's counter, of 32 bits each. The first word is the
        number of the block of four random words, from 0.
    """

    def __init__(self, key: tuple[int, int], *counter: int) -> None:
        b, c, d = counter
        blocks = (philox4x32((block, b, c, d), key) for block in range(_WORD))
        self._pairs = (pair for a, b, c, d in blocks for pair in (a << 32 | b, c << 32 | d))

    def integer(self, least: int, largest: int) -> int:
        """Return an integer from ``least`` to ``largest``, both included.

        The probabilities of the integers are equal to within 2^-64.
        """
        return least + (next(self._pairs) * (largest - least + 1) >> 64)

    def one_of(self, choices: Sequence[Choice]) -> Choice:
        """Return one of ``choices``, drawn as :meth:`integer` draws."""
        return choices[self.integer(0, len(choices) - 1)]
