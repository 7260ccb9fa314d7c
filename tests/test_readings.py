"""What the paper leaves open: the table against the code, and how a choice is written."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from coartic import corrective_trial, learn, reference, trajectory
from coartic.errors import CoarticError
from coartic.exploration import CONDITIONS
from coartic.model import PAPER, checked_model
from coartic.readings import (
    Reading,
    condition_under,
    load_reading,
    load_readings,
    model_under,
    readings,
    task_under,
)
from coartic.robot import Robot
from coartic.task import builtin_tasks, load_task

APPLIED = {
    "model": [PAPER],
    "condition": list(CONDITIONS.values()),
    "robot": [Robot(), *(load_task(name).robot for name in builtin_tasks())],
}
by_id = pytest.mark.parametrize("reading", readings(), ids=lambda reading: reading.id)


@by_id
def test_defaults_are_those_of_the_code(reading):
    for applied in APPLIED[reading.part]:
        assert getattr(applied, reading.field) == reading.default.value


def test_every_question_and_parameter_is_there_once():
    assert len({reading.parameter for reading in readings()}) == len(readings()) >= 12
    assert {reading.part for reading in readings()} == set(APPLIED)


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
        ("tie=left", "unknown reading 'tie'; known: .*, state.*did you mean 'ties'"),
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


LEARNED = [
    text
    for reading in readings()
    if reading.part != "robot"
    for text in (f"{reading.id}={choice.written}" for choice in reading.alternatives)
]


@pytest.mark.parametrize("text", [*LEARNED, "correction-tolerance=0.099 corrective-arrival=true"])
def test_the_learner_is_the_slow_one_under_every_reading(text):
    chosen = load_readings(text.split())
    model, fields = model_under(chosen), condition_under(chosen)
    if len(chosen) > 1:
        model = model._replace(arrival_tolerance=0.04)  # now and then a correction misses
    task, differs = load_task("two-armed-1"), False
    for name in ("EC2", "EC3"):
        plain = CONDITIONS[name]
        condition = replace(plain, **fields)
        fast = learn(task, condition, seed=4, trials=14, model=model)
        slow = reference.learn(task, condition, seed=4, trials=14, model=model)
        np.testing.assert_array_equal(fast.completed, slow.completed)
        np.testing.assert_array_equal(fast.rewards[fast.completed], slow.rewards[slow.completed])
        default = learn(task, plain, seed=4, trials=14)
        differs |= (
            fast.rewards.tolist() != default.rewards.tolist() or fast.reward != default.reward
        )
    assert differs or text in SELDOM


# Readings that make no difference in a few trials.
SELDOM = {
    "ties=nearest",
    "ties=previous",
    "corrective-arrival=true",
    "first-step=true",
    "update=not-less",
    "whole-last-step=true",
}


def test_a_learned_replay_is_the_replay():
    task = load_task("ascending")
    run = learn(task, replace(CONDITIONS["EC1"], learned="replay"), seed=3, trials=25)
    assert run.reward == run.replay_reward != max(run.rewards)
    assert run.execute().reward == run.reward


def test_shoulders_are_at_the_height_that_is_read():
    chosen = load_readings(["shoulder-height=-0.1", "ties=left"])
    assert [str(each) for each in chosen] == ["shoulder-height=-0.1"]
    task = task_under(chosen, load_task("ascending"))
    assert task.robot.shoulder_height == -0.1
    assert (
        corrective_trial(task, "RRR").reward
        != corrective_trial(load_task("ascending"), "RRR").reward
    )
    with pytest.raises(CoarticError, match="cannot both hold"):
        load_readings(["ties=left", "ties=right"])


@pytest.mark.parametrize(
    "model", [PAPER._replace(arrival_tick=0), PAPER._replace(whole_last_step=True)]
)
def test_a_trajectory_has_a_row_a_tick(model):
    run = learn(load_task("two-armed-1"), "EC4", seed=2, trials=20, model=model)
    made = trajectory(run.task, run.solution, model)
    assert len(made.configurations) == -run.reward
    execution = run.execute()
    np.testing.assert_array_equal(made.configurations[made.hits], execution.configurations)
