"""What the paper leaves open: the table against the code, and how a choice is written."""

import pytest
from pydantic import ValidationError

from coartic.errors import CoarticError
from coartic.exploration import CONDITIONS
from coartic.model import PAPER, checked_model
from coartic.readings import Reading, load_reading, readings
from coartic.robot import Robot
from coartic.task import builtin_tasks, load_task

# Readings whose parameter the code does not have yet.
NOT_YET = [
    "corrective-arrival", "arrival-tick", "last-step", "first-step", "shoulder-height",
    "joint-angles", "learned-reward", "ties", "equal-distance", "first-trial", "unknown-target",
    "update", "state",
]  # fmt: skip
APPLIED = {
    "model": [PAPER],
    "condition": list(CONDITIONS.values()),
    "robot": [Robot(), *(load_task(name).robot for name in builtin_tasks())],
}
by_id = pytest.mark.parametrize("reading", readings(), ids=lambda reading: reading.id)


@by_id
def test_defaults_are_those_of_the_code(reading):
    for applied in APPLIED[reading.part]:
        if reading.id in NOT_YET:
            assert not hasattr(applied, reading.field), (
                f"{reading.id} is there: take it off NOT_YET"
            )
        else:
            assert getattr(applied, reading.field) == reading.default.value


def test_every_question_and_parameter_is_there_once():
    assert len({reading.parameter for reading in readings()}) == len(readings()) >= 12
    assert {reading.part for reading in readings()} == set(APPLIED)
    assert set(NOT_YET) < {reading.id for reading in readings()}


@by_id
def test_a_choice_is_loaded_as_it_is_written(reading):
    for choice in reading.choices:
        chosen = load_reading(f"{reading.id}={choice.written}")
        assert (chosen.parameter, chosen.value) == (reading.parameter, choice.value)
        assert type(chosen.value) is type(choice.value)
        assert load_reading(str(chosen)) == chosen


def test_numbers_may_be_written_otherwise():
    assert load_reading("arrival-tolerance = 1e-1").value == 0.1
    assert load_reading("shoulder-height=0").value == 0.0
    with pytest.raises(CoarticError, match=r"'1' is none of its choices, which are false, true"):
        load_reading("corrective-arrival=1")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("ties", "'ties': a reading is written id=value, such as ties=right"),
        ("tie=left", "unknown reading 'tie'; known: .*, state; did you mean 'ties'"),
        ("ties=rigth", "'rigth' is none of its choices, .* did you mean 'right'"),
        ("ties=", "'' is none of its choices"),
        ("arrival-tolerance=nan", "which are 0.01, 0.1$"),
        ("ties=\x1b[2J", r"'\\x1b\[2J' is none"),
    ],
)
def test_what_cannot_be_loaded_is_said(text, says):
    with pytest.raises(CoarticError, match=says):
        load_reading(text)


def test_the_rim_is_as_near_to_it_as_a_correction_may_end():
    radius = load_task("ascending").radius
    rim = load_reading("correction-tolerance=0.099").value
    checked_model(PAPER._replace(correction_tolerance=rim), radius=radius)
    with pytest.raises(ValueError, match="outside the goal"):
        checked_model(PAPER._replace(correction_tolerance=round(rim + 1e-3, 3)), radius=radius)


@pytest.mark.parametrize("other", [{"value": "left"}, {"value": 1}])
def test_choices_differ_and_are_of_one_type(other):
    row = readings()[0].model_dump() | {"default": {"value": "left", "says": "left"}}
    with pytest.raises(ValidationError, match="choices left, (left|1) are not"):
        Reading.model_validate(row | {"alternatives": [{"says": "other", **other}]})
