"""The names of ``coartic``: what they take, what they refuse, and how they show themselves."""

import inspect
import pickle
from importlib import import_module

import numpy as np
import pytest

import coartic
from coartic import load_task
from coartic.method import Information, Session
from tests.support.processes import ROOT

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


def is_ours(thing):
    if not (inspect.isclass(thing) and issubclass(thing, Exception)):
        return False
    return thing.__module__.startswith("coartic.")


def test_every_error_can_come_from_another_process():
    """A pool that cannot read the error of a worker waits for ever."""
    found = dict[str, type]()
    for folder in ("coartic", "baselines", "benchmarks", "analysis"):
        for path in (ROOT / folder).rglob("*.py"):
            if "Error(" in path.read_text(encoding="utf-8"):
                names = path.relative_to(ROOT).with_suffix("").parts
                module = import_module(".".join(["coartic", *names[folder == "coartic" :]]))
                found |= dict(inspect.getmembers(module, is_ours))
    assert {"CoarticError", "MethodError", "ArgumentError", "_StuckError"} < {*found}
    for kind in found.values():
        named = (
            ("infeasible", "in words", {"why": 1}) if kind is coartic.MethodError else ("in words",)
        )
        error = kind(*named)
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again), vars(again)) == (kind, "in words", vars(error))
