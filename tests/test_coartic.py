"""The names of ``coartic``: what they take, what they refuse, and how they show themselves."""

import numpy as np
import pytest

import coartic
from coartic import load_task
from coartic.method import Information, Session

TASK = load_task("two-armed-2")


@pytest.mark.parametrize(
    "call",
    [
        lambda task, hands: coartic.corrective_trial(task, hands),
        lambda task, hands: coartic.objective(task, hands),
        lambda task, hands: Session(task, 0, Information).trials(hands, np.zeros((1, 3, 10))),
    ],
)
def test_a_wrong_hand_sequence_is_refused_with_the_choices(call):
    for wrong in ("rrr", "LLL", "RR", 3):
        with pytest.raises(ValueError, match="do not fit task 'ascending': .* R for each of 3"):
            call(load_task("ascending"), wrong)
    for wrong in ("left", (), ["L"]):
        with pytest.raises(ValueError, match="'left' and 'right'"):
            coartic.hand_sequences(TASK, wrong)


def test_conditions_are_shown_as_they_are_written():
    names = {name: getattr(coartic, name) for name in coartic.__all__}
    for condition in (coartic.CONDITIONS | coartic.ABLATIONS).values():
        assert eval(repr(condition), names) == condition
