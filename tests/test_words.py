"""Numbers as tables show them."""

import math

import pytest

from coartic.analysis.statistics import estimates as statistics
from coartic.analysis.words import interval, short, tally


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.214, "0.214"), (950, "950"), (999.4, "999"), (999.6, "1 k"), (12_345, "12.3 k"),
        (999_600, "1 M"), (4_980_000, "4.98 M"), (math.inf, "∞"), (math.nan, "–"),
    ],
)  # fmt: skip
def test_three_figures(value, text):
    assert short(value) == text


def test_an_interval_that_is_a_point_says_so():
    spread = statistics.mean([1.0, 2.0, 3.0, 5.0], seed=0)
    assert interval(spread) == f"2.8 [{spread.low:.1f}, {spread.high:.1f}]"
    assert interval(statistics.mean([4.0] * 20, seed=0), "+.2f") == "+4.00 (no spread in 20 runs)"
    both = statistics.difference_of_means([4.0] * 5, [3.0] * 4, seed=0)
    assert interval(both) == "1.0 (no spread in 5 and 4 runs)"
    assert interval(statistics.mean([4.0, 5.0], seed=0)) == "4.5"


def test_the_commonest_first():
    assert (
        tally({"RRLR": 3, "LRRR": 1, "LLLR": 1, "LRLR": 15}) == "LRLR 15, RRLR 3, LLLR 1, LRRR 1"
    )
    assert tally({}) == "–"
