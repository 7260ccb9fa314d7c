"""What the paper leaves open: the table against the code, and how a choice is written."""

import itertools
import json
from dataclasses import replace
from typing import get_args

import pytest
from pydantic import ValidationError

from coartic import learn
from coartic.analysis.verify import stored_task
from coartic.errors import CoarticError
from coartic.learner.conditions import (
    CONDITIONS,
    ExplorationCondition,
    FirstTrial,
    State,
    Ties,
    UnknownTarget,
)
from coartic.learner.method import DualProcessParameters
from coartic.model import PAPER, stored_model
from coartic.robot import HANDS
from coartic.tasks.catalogue import load_task
from coartic.tasks.readings import (
    ChosenReading,
    condition_under,
    load_reading,
    load_readings,
    model_under,
    readings,
)
from tests.support.strategies import tiny_task, uneven_task
from tests.test_learner import assert_equals_reference

APPLIED = {"model": [PAPER], "condition": list(CONDITIONS.values())}
by_id = pytest.mark.parametrize("reading", readings(), ids=lambda reading: reading.id)


@by_id
def test_defaults_are_those_of_the_code(reading):
    for applied in APPLIED[reading.part]:
        assert getattr(applied, reading.field) == reading.default.value


@by_id
def test_a_choice_is_loaded_as_it_is_written(reading):
    values = [choice.value for choice in reading.choices]
    assert len({choice.written for choice in reading.choices}) == len(values) > 1
    assert len(set(map(type, values))) == 1
    for choice in reading.choices:
        chosen = load_reading(f"{reading.id}={choice.written}")
        assert chosen == (reading, choice)
        assert load_reading(str(chosen)) == chosen


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        (["ties"], "'ties': write it as NAME=VALUE"),
        (["tie=left"], "unknown reading 'tie'; did you mean 'ties'"),
        (["ties=rigth"], "'rigth' is not one of its choices .* did you mean 'right'"),
        (["arrival-tick=0"], "refuted by the printed results .* Version 1.0.0"),
        (["ties=left", "shoulder-height=-0.1"], "shoulder-height=-0.1 is refuted"),
        (["corrective-arrival=1"], r"'1' is not one of its choices \(false, true\)"),
        (["ties=\x1b[2J"], r"'\\x1b\[2J'"),
        (["ties=left", "ties=right"], "cannot both hold"),
        ([1], "reading 1: "),
        (["model.gain=x"], "model.gain=x: it must be a number"),
        (["model.max_iterations=2.5"], "model.max_iterations=2.5: it must be a whole number"),
        (["model.gain=0"], "model.gain is 0.0; it must be a number from 1e-06"),
        (["model.gian=1"], "did you mean 'model.gain'"),
        ("ties=right", "must be a list of texts"),
        (7, "must be a list of texts"),
    ],
)
def test_what_cannot_be_loaded_is_said(texts, says):
    with pytest.raises(CoarticError, match=says):
        load_readings(texts)


def test_what_the_text_says_if_it_is_taken_at_its_word():
    said = [
        str(ChosenReading(r, choice)) for r in readings() for choice in r.choices if choice.printed
    ]
    assert said == [
        "corrective-arrival=true", "equal-distance=random", "first-trial=learns",
        "state=previous-hand",
    ]  # fmt: skip


def test_the_default_choice_is_no_reading():
    assert [str(each) for each in load_readings(["ties=left", "state=goal"])] == ["state=goal"]


def test_constants_of_the_model_are_set_as_readings_are():
    chosen = load_readings(["model.gain=0.1", "ties=right", "model.step=0.01"])
    assert [str(each) for each in chosen] == ["ties=right", "model.gain=0.1"]
    assert model_under(chosen) == PAPER._replace(gain=0.1)
    assert load_readings(map(str, chosen)) == chosen


ALTERNATIVES = [
    f"{reading.id}={choice.written}" for reading in readings() for choice in reading.alternatives
]


@pytest.mark.parametrize("text", [*ALTERNATIVES, "corrective-arrival=true, near the rim"])
def test_the_learner_is_the_slow_one_under_every_reading(text):
    text, _, near_rim = text.partition(", ")
    chosen = load_readings([text])
    model, fields = model_under(chosen), condition_under(chosen)
    if near_rim:  # now and then a correction misses
        model = model._replace(correction_tolerance=0.099, arrival_tolerance=0.04)
    task, plain = load_task("two-armed-1"), CONDITIONS["EC2" if text in SELDOM_OF_EC3 else "EC3"]
    condition = replace(plain, **fields)
    assert_equals_reference(task, condition, 5, seed=42, model=model)
    fast = learn(task, condition, seed=42, trials=5, model=model)
    default = learn(task, plain, seed=42, trials=5)
    differs = fast.rewards.tolist() != default.rewards.tolist() or fast.reward != default.reward
    assert differs or text in SELDOM


# Readings that make no difference in a few trials: of condition 3, and of any.
SELDOM_OF_EC3 = {"whole-last-step=true", "equal-distance=computed"}
SELDOM = {"corrective-arrival=true", "first-step=true"}


FORGETFUL = ExplorationCondition(
    "forgetful", HANDS, True, True, "random", epsilon=0.5, first_trial="forgotten"
)


FIELDS = {
    "ties": get_args(Ties),
    "state": get_args(State),
    "unknown_target": get_args(UnknownTarget),
    "corrects": (True, False),
    "first_trial": get_args(FirstTrial),
}
# Any four of the fields in every combination, by half of those of all five.
TOGETHER = [
    dict(zip(FIELDS, values, strict=True))
    for values in itertools.product(*FIELDS.values())
    if sum(choices.index(v) for choices, v in zip(FIELDS.values(), values, strict=True)) % 2 == 0
]


def test_the_learner_is_the_slow_one_whatever_is_read_together():
    task = uneven_task(
        [1.0],
        [0.5, -0.5, 0.2, 0.1],
        goals=[[1.6, 0.9], [1.2, 1.1], [1.7, 0.7]],
        initial_hands="RLR",
    )
    failed = 0
    for seed, fields in enumerate(TOGETHER):
        condition = replace(FORGETFUL, noise_sd=0.02, **fields)
        failed += (~assert_equals_reference(task, condition, 3, seed=seed).completed).sum()
    assert failed > 20


def test_a_learned_replay_is_the_replay():
    task = load_task("ascending")
    run = learn(task, replace(CONDITIONS["EC1"], learned="replay"), seed=3, trials=25)
    assert run.reward == run.replay_reward != max(run.rewards)
    assert run.execute().reward == run.reward


def test_what_version_1_stored_is_read_unless_its_reading_is_gone():
    fields = PAPER._asdict()
    assert stored_model(fields) == stored_model(fields | {"arrival_tick": 1}) == PAPER
    with pytest.raises(CoarticError, match="reading arrival-tick=0.* Version 1.0.0"):
        stored_model(fields | {"arrival_tick": 0})
    with pytest.raises(ValueError, match="arrival took no tick"):
        stored_task(tiny_task().model_dump_json(), json.dumps(fields | {"arrival_tick": 0}))
    old = {"trials": 5, "update": "greater", "learned": "best"}
    assert DualProcessParameters(**old) == DualProcessParameters(trials=5)
    with pytest.raises(ValidationError, match="update"):
        DualProcessParameters(update="not-less")
