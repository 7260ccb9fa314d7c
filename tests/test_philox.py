"""The counter-based generator behind random tasks."""

from itertools import islice

import pytest

from coartic.tasks.philox import Draws, hash_key, philox4x32

ONES = 0xFFFFFFFF
# Of the authors' file of known answers (Random123, kat_vectors: philox4x32 10).
KNOWN = [
    ((0, 0, 0, 0), (0, 0), "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ((ONES,) * 4, (ONES, ONES), "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        "d16cfe09 94fdcceb 5001e420 24126ea1",
    ),
]


@pytest.mark.parametrize(("counter", "key", "words"), KNOWN)
def test_known_answers(counter, key, words):
    assert philox4x32(counter, key) == tuple(int(word, 16) for word in words.split())


def test_draws_are_the_words_of_counters_that_follow():
    key, draws = (5, 6), Draws((5, 6), 7, 8, 9)
    drawn = [draws.integer(0, 2**64 - 1) for _ in range(4)]
    blocks = [philox4x32((block, 7, 8, 9), key) for block in range(2)]
    assert drawn == [a << 32 | b for w in blocks for a, b in (w[:2], w[2:])]


def test_every_integer_is_as_likely():
    draws = Draws(hash_key("any"), 0, 0, 0)
    counts = [0] * 7
    for _ in range(7000):
        counts[draws.integer(-3, 3) + 3] += 1
    chi2 = sum((count - 1000) ** 2 / 1000 for count in counts)
    assert chi2 < 22.5  # p = 0.001 at 6 degrees of freedom


def test_places_of_a_counter_have_draws_of_their_own():
    def first(key, *place):
        draws = Draws(key, *place)
        return tuple(islice(iter(lambda: draws.integer(0, 2**64 - 1), None), 2))

    keys = [hash_key(name) for name in ("a", "b")]
    places = [(number, attempt, part) for number in range(9) for attempt in (0, 1) for part in "xy"]
    beginnings = {first(key, n, a, "xy".index(p)) for key in keys for n, a, p in places}
    assert len(beginnings) == 2 * len(places)
