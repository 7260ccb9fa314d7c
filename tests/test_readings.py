"""What the paper leaves open: the table against the code, and how a choice is written."""

import itertools
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from coartic import Movement, corrective_trial, learn, trajectory
from coartic.errors import CoarticError
from coartic.learner.conditions import (
    CONDITIONS,
    ExplorationCondition,
    FirstTrial,
    State,
    Ties,
    UnknownTarget,
)
from coartic.model import PAPER
from coartic.motion.movement import follow
from coartic.robot import HANDS, Robot
from coartic.tasks.catalogue import builtin_tasks, load_task
from coartic.tasks.readings import (
    condition_under,
    load_reading,
    load_readings,
    model_under,
    readings,
    task_under,
)
from tests.support import reference
from tests.support.strategies import tiny_task, uneven_task

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


@by_id
def test_a_choice_is_loaded_as_it_is_written(reading):
    values = [choice.value for choice in reading.choices]
    assert len({choice.written for choice in reading.choices}) == len(values) > 1
    assert len(set(map(type, values))) == 1
    for choice in reading.choices:
        chosen = load_reading(f"{reading.id}={choice.written}")
        assert chosen == (reading, choice)
        assert load_reading(str(chosen)) == chosen


def test_numbers_may_be_written_otherwise():
    assert load_reading("arrival-tolerance = 1e-1").choice.value == 0.1
    assert load_reading("shoulder-height=0").choice.value == 0.0


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        (["ties"], "'ties': write it as NAME=VALUE"),
        (["tie=left"], "unknown reading 'tie'; did you mean 'ties'"),
        (["ties=rigth"], "'rigth' is not one of its choices .* did you mean 'right'"),
        (["arrival-tolerance=nan"], "0.01, 0.1"),
        (["corrective-arrival=1"], r"'1' is not one of its choices \(false, true\)"),
        (["ties=\x1b[2J"], r"'\\x1b\[2J'"),
        (["ties=left", "ties=right"], "cannot both hold"),
        ([1], "reading 1: "),
        ("ties=right", "must be a list of texts"),
        (7, "must be a list of texts"),
    ],
)
def test_what_cannot_be_loaded_is_said(texts, says):
    with pytest.raises(CoarticError, match=says):
        load_readings(texts)


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
    task, plain = load_task("two-armed-1"), CONDITIONS["EC2" if text in SELDOM_OF_EC3 else "EC3"]
    condition = replace(plain, **fields)
    fast = learn(task, condition, seed=42, trials=5, model=model)
    slow = reference.learn(task, condition, seed=42, trials=5, model=model)
    np.testing.assert_array_equal(fast.completed, slow.completed)
    np.testing.assert_array_equal(fast.rewards[fast.completed], slow.rewards[slow.completed])
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
        fast = learn(task, condition, seed=seed, trials=3)
        slow = reference.learn(task, condition, seed=seed, trials=3)
        np.testing.assert_array_equal(fast.rewards.data, slow.rewards)
        np.testing.assert_array_equal(fast.completed, slow.completed)
        assert fast.counters.corrections == slow.corrections
        assert np.isfinite(fast.values).sum() == len(slow.values)
        failed += fast.counters.failed_trials
    assert failed > 20


def test_a_learned_replay_is_the_replay():
    task = load_task("ascending")
    run = learn(task, replace(CONDITIONS["EC1"], learned="replay"), seed=3, trials=25)
    assert run.reward == run.replay_reward != max(run.rewards)
    assert run.execute().reward == run.reward


def test_shoulders_are_at_the_height_that_is_read():
    chosen = load_readings(["shoulder-height=-0.1", "ties=left"])
    assert [str(each) for each in chosen] == ["shoulder-height=-0.1"]  # ties=left is the default
    task = task_under(chosen, load_task("ascending"))
    assert task.robot.shoulder_height == -0.1
    assert (
        corrective_trial(task, "RRR").reward
        != corrective_trial(load_task("ascending"), "RRR").reward
    )


@pytest.mark.parametrize("tick", [0, 1])
def test_rows_of_a_trajectory_start_where_the_robot_does(tick):
    """Two lines of 3 and 2 steps and a goal hit where the robot stands, counted by hand."""
    model = PAPER._replace(arrival_tick=tick)
    task = tiny_task(goals=[[4.5, 0.1], [4.625, 0.1], [4.645, 0.1]], initial_hands="RRR")
    ahead = [np.array([x, *[0.0] * 9]) for x in (0.06, 0.08)]
    path = trajectory(
        task,
        [
            Movement(1, "right", "corrective"),
            Movement(2, "right", "planned", ahead[0]),
            Movement(3, "right", "planned", ahead[1]),
        ],
        model,
    )
    stands = {0: [0, 1, 2, 3, 4, 5], 1: [0, 1, 2, 3, 3, 4, 5]}[tick]
    np.testing.assert_allclose(100 * path.configurations[:, 0], stands, atol=1e-12)
    np.testing.assert_allclose(path.subtask(1)[:, 0], [0.0])


@pytest.mark.parametrize("first_step", [False, True])
@pytest.mark.parametrize("whole_last_step", [False, True])
def test_a_path_of_one_line_is_the_movement_under_the_same_readings(first_step, whole_last_step):
    model = PAPER._replace(first_step=first_step, whole_last_step=whole_last_step)
    rng, hits = np.random.default_rng(5), 0
    for _ in range(30):
        q, target = rng.uniform(-1, 1, (2, 10))
        near = target if rng.random() < 0.5 else q
        goal = tuple(Robot().forward_kinematics(near, "left") + rng.uniform(-0.11, 0.11, 2))
        path = follow(Robot(), q, target[None], "left", goal, 0.1, model=model)
        line = reference.move(
            Robot(), q, target, "left", goal, 0.1, stop_on_arrival=False, model=model
        )
        assert (path.ticks, path.hit) == (line.ticks, line.hit)
        np.testing.assert_allclose(path.q, line.q, atol=1e-12)
        hits += path.hit
    assert 10 < hits < 30
