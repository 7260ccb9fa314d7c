"""One rule for all models: agreement lies beyond the bound and exceeds random search."""

import numpy as np
import pandas as pd
import pytest

from coartic.estimates import Estimate
from tests.support.processes import programs

(HUMAN,) = programs("human", "study")


def estimate(low, high):
    return Estimate((low + high) / 2, low, high)


@pytest.mark.parametrize(
    ("test", "seen", "over", "tasks", "verdict"),
    [
        ({"above": 1}, (2, 3), (0.5, 1), 10, "agrees"),
        ({"above": 1}, (2, 3), (-0.5, 1), 10, "undecided"),
        ({"above": 1}, (2, 3), (np.nan, np.nan), 10, "agrees"),  # nothing to compare with
        ({"above": 1}, (2, 3), (0.5, 1), 9, "undecided"),
        ({"above": 1}, (0.5, 3), (0.5, 1), 10, "undecided"),
        ({"above": 1}, (0, 0.5), (-2, -1), 10, "disagrees"),
        ({"below": 1}, (0, 0.5), (-2, -1), 10, "agrees"),
        ({"below": 1}, (0, 0.5), (-2, 1), 10, "undecided"),
        ({"below": 3, "disagree": 4}, (3.2, 3.8), (-2, -1), 10, "undecided"),
        ({"above": 1}, (np.nan, np.nan), (np.nan, np.nan), 0, "no cases"),
    ],
)
def test_agreement_exceeds_random_search(test, seen, over, tasks, verdict):
    decided, because = HUMAN.decide(test, estimate(*seen), estimate(*over), tasks, "")
    assert decided == verdict
    assert (because == HUMAN.NOT_BEYOND) == (over[0] * over[1] < 0)


@pytest.mark.parametrize(("low", "verdict"), [(0.9, "agrees"), (0.7, "undecided")])
def test_stored_intervals_of_planners_lie_apart(low, verdict):
    """Where no difference to random search was stored: [0.2, 0.8]."""
    rows = [("two goals ahead", low, 1.2), ("random search", 0.2, 0.8)]
    effects = pd.DataFrame(rows, columns=["model", "value_low", "value_high"]).assign(
        finding="two-ahead", measure="m", bound="above 0.01", of_test="agrees", because="",
        over_random_search=np.nan,
    )  # fmt: skip
    judged = HUMAN.judge_stored(effects).set_index("model")
    assert judged.verdict.to_dict() == {"two goals ahead": verdict, "random search": "agrees"}
