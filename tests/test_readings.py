"""What the paper leaves open: the table against the code, and how a choice is written."""

import itertools
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from pydantic import ValidationError

from coartic import Movement, corrective_trial, learn, trajectory
from coartic.errors import CoarticError, TaskError
from coartic.learner.conditions import (
    CONDITIONS,
    ExplorationCondition,
    FirstTrial,
    State,
    Ties,
    UnknownTarget,
)
from coartic.model import PAPER, checked_model
from coartic.motion.movement import follow, path_points
from coartic.robot import HANDS, Robot
from coartic.tasks.catalogue import builtin_tasks, load_task
from coartic.tasks.readings import (
    Reading,
    condition_under,
    load_reading,
    load_readings,
    model_under,
    readings,
    task_under,
)
from coartic.tasks.task import checked_task
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
    with pytest.raises(CoarticError, match=r"'1' is not one of its choices \(false, true\)"):
        load_reading("corrective-arrival=1")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("ties", "'ties': write it as NAME=VALUE"),
        ("tie=left", "unknown reading 'tie'; known: .*, state.*did you mean 'ties'"),
        ("ties=rigth", "'rigth' is not one of its choices .* did you mean 'right'"),
        ("ties=", "'' is not one of its choices"),
        ("arrival-tolerance=nan", "0.01, 0.1"),
        ("ties=\x1b[2J", r"'\\x1b\[2J'"),
    ],
)
def test_what_cannot_be_loaded_is_said(text, says):
    with pytest.raises(CoarticError, match=says):
        load_reading(text)


@pytest.mark.parametrize(
    ("texts", "says"),
    [
        ([1], "reading 1: "),
        ([None], "reading None: "),
        (["ties=right", ("ties", "left")], r"reading \('ties', 'left'\): "),
        ("ties=right", "must be a list of texts"),
        (7, "must be a list of texts"),
    ],
)
def test_readings_are_a_list_of_texts(texts, says):
    with pytest.raises(CoarticError, match=says):
        load_readings(texts)


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
        fast = learn(task, condition, seed=42, trials=5, model=model)
        slow = reference.learn(task, condition, seed=42, trials=5, model=model)
        np.testing.assert_array_equal(fast.completed, slow.completed)
        np.testing.assert_array_equal(fast.rewards[fast.completed], slow.rewards[slow.completed])
        default = learn(task, plain, seed=42, trials=5)
        differs |= (
            fast.rewards.tolist() != default.rewards.tolist() or fast.reward != default.reward
        )
    assert differs or text in SELDOM


# Readings that make no difference in a few trials.
SELDOM = {"corrective-arrival=true", "first-step=true"}


FORGETFUL = ExplorationCondition(
    "forgetful", HANDS, True, True, "random", epsilon=0.5, first_trial="forgotten"
)


@pytest.mark.parametrize("state", ["previous-hand", "goal"])
@pytest.mark.parametrize("ties", ["left", "previous", "right"])
def test_a_tie_falls_to_the_hand_that_hit_the_goal_before(ties, state):
    """A trial that knows nothing: every greedy choice is a tie. Its draws are repeated here."""
    condition = replace(FORGETFUL, ties=ties, state=state)
    task, after_right = tiny_task(), 0
    for seed in range(24, 30):
        rng, hands = np.random.default_rng(seed), []
        for _ in task.goals:
            before = hands[-1] if hands else 0
            tied = {"left": 0, "right": 1, "previous": before}[ties]
            explored = rng.random() < 0.5
            hands.append(int(rng.random() * 2) if explored else tied)
            after_right += before == 1 and not explored
        run = learn(task, condition, seed=seed, trials=2)
        slow = reference.learn(task, condition, seed=seed, trials=2)
        visited = [(0, 2, hands[0]), (1, 2 if state == "goal" else hands[0], hands[1])]
        assert list(zip(*np.nonzero(np.isfinite(run.values)), strict=True)) == visited
        assert [(goal, HANDS.index(hand)) for (goal, _), hand in slow.values] == [
            (goal, hand) for goal, _, hand in visited
        ]
    assert after_right


def test_without_correction_a_pair_that_has_no_target_is_still_corrected():
    """Trial 1 explores from where the robot stands and misses; only later misses are failures."""
    condition = replace(
        FORGETFUL, hand_exploration="none", corrects=False, unknown_target="explores"
    )
    task = tiny_task()
    for seed in range(2):
        run = learn(task, condition, seed=seed, trials=12)
        slow = reference.learn(task, condition, seed=seed, trials=12)
        assert run.completed[:2].all()
        assert not run.completed[2:].all()
        assert run.counters.corrections == slow.corrections == 2 * len(task.goals)
        np.testing.assert_array_equal(run.completed, slow.completed)
        np.testing.assert_array_equal(run.rewards.data, slow.rewards)


READ = {
    "ties": get_args(Ties),
    "state": get_args(State),
    "unknown_target": get_args(UnknownTarget),
    "corrects": (True, False),
    "first_trial": get_args(FirstTrial),
}


def read_together():
    """Any four of the fields in every combination, by half of those of all five."""
    for places in itertools.product(*(range(len(choices)) for choices in READ.values())):
        if sum(places) % 2 == 0:
            yield {
                field: choices[place]
                for (field, choices), place in zip(READ.items(), places, strict=True)
            }


def test_the_learner_is_the_slow_one_whatever_is_read_together():
    task = uneven_task(
        [1.0],
        [0.5, -0.5, 0.2, 0.1],
        goals=[[1.6, 0.9], [1.2, 1.1], [1.7, 0.7]],
        initial_hands="RLR",
    )
    failed, together = 0, list(read_together())
    for seed, fields in enumerate(together):
        condition = replace(FORGETFUL, noise_sd=0.02, **fields)
        fast = learn(task, condition, seed=seed, trials=4)
        slow = reference.learn(task, condition, seed=seed, trials=4)
        np.testing.assert_array_equal(fast.rewards.data, slow.rewards)
        np.testing.assert_array_equal(fast.completed, slow.completed)
        assert fast.counters.corrections == slow.corrections
        assert np.isfinite(fast.values).sum() == len(slow.values)
        failed += fast.counters.failed_trials
    assert failed > 30


def test_a_goal_is_as_far_as_the_correction_of_a_reading_ends():
    """0.05 out of reach of the outstretched arm: within the rim, beyond the paper's accuracy."""
    task = tiny_task(
        goals=[[4.55, 0.1]],
        initial_hands="R",
        locked_base=["x", "y"],
        start={"base": [0.0, 0.0], "left": [0.0] * 4, "right": [0.3, -0.2, 0.3, -0.2]},
    )
    near = model_under(load_readings(["correction-tolerance=0.099"]))
    assert corrective_trial(checked_task(task, near), "R", model=near).completed
    with pytest.raises(
        TaskError, match=r"goals\[0\] \(4.55, 0.1\) is out of reach .* 0.04 too far"
    ):
        checked_task(task)
    assert not corrective_trial(task, "R").completed


def test_a_radius_is_held_against_the_model_that_is_read():
    small = tiny_task(radius=0.005)
    with pytest.raises(TaskError, match="'tiny': model.correction_tolerance 0.01 is not below"):
        checked_task(small)
    exact = PAPER._replace(correction_tolerance=1e-3, arrival_tolerance=1e-3)
    assert corrective_trial(checked_task(small, exact), "RR", model=exact).completed


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
    assert made.ticks == -run.reward
    assert len(made.configurations) == made.ticks + 1 - model.arrival_tick
    np.testing.assert_array_equal(made.configurations[0], run.task.q0)
    execution = run.execute()
    np.testing.assert_array_equal(made.configurations[made.hits], execution.configurations)


@pytest.mark.parametrize("tick", [0, 1])
def test_rows_of_a_trajectory_start_where_the_robot_does(tick):
    """Two lines of 3 and 2 steps and a goal hit where the robot stands, counted by hand."""
    model = PAPER._replace(arrival_tick=tick)
    task = tiny_task(goals=[[4.5, 0.1], [4.625, 0.1], [4.645, 0.1]], initial_hands="RRR")
    ahead = [np.array([x, *[0.0] * 9]) for x in (0.06, 0.08)]
    made = trajectory(
        task,
        [
            Movement(1, "right", "corrective"),
            Movement(2, "right", "planned", ahead[0]),
            Movement(3, "right", "planned", ahead[1]),
        ],
        model,
    )
    stands = {0: [0, 1, 2, 3, 4, 5], 1: [0, 1, 2, 3, 3, 4, 5]}[tick]
    np.testing.assert_allclose(100 * made.configurations[:, 0], stands, atol=1e-12)
    np.testing.assert_allclose(made.subtask(1)[:, 0], [0.0])


LINE = [np.array([x, *[0.0] * 9]) for x in (0.1, 0.1, 0.125)]


def test_a_path_follows_the_readings_of_its_steps():
    far, at_start = (9.0, 0.0), (4.5, 0.1)
    q, path = np.zeros(10), np.array([LINE[1], LINE[2], LINE[2]])
    plain = path_points(Robot(), q, path)
    np.testing.assert_allclose(plain[:, 0], [*np.arange(13) * 0.01, 0.125])
    whole = PAPER._replace(whole_last_step=True)
    np.testing.assert_allclose(path_points(Robot(), q, path, whole)[:, 0], np.arange(14) * 0.01)
    around = np.array([LINE[0], [0.1, 0.025, *[0.0] * 8], [0.1, 0.025, *[0.0] * 8]])
    end = path_points(Robot(), q, around, whole)[-1]
    np.testing.assert_allclose(end[:3], [0.1, 0.03, 0.0], atol=1e-12)  # on along the last line
    np.testing.assert_array_equal(path_points(Robot(), q, q[None], whole), q[None])
    goal_behind_the_end = (4.5 + 0.228, 0.1)
    assert not follow(Robot(), q, path, "right", goal_behind_the_end, 0.1).hit
    assert follow(Robot(), q, path, "right", goal_behind_the_end, 0.1, model=whole).hit
    first = PAPER._replace(first_step=True)
    for model, ticks in ((PAPER, 1), (first, 2)):
        found = follow(Robot(), q, path, "right", at_start, 0.1, model=model)
        assert (found.ticks, found.hit) == (ticks, True)
    assert follow(Robot(), q, q[None], "right", at_start, 0.1, model=first).ticks == 1
    assert follow(Robot(), q, path, "right", far, 0.1, model=first).ticks == 14


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
