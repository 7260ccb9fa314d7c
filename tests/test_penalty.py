"""Penalties: what a task's reward loses beside its ticks, at every door, against a slow loop."""

import json
import sqlite3
import tomllib
from contextlib import closing

import numpy as np
import pytest

from coartic import CONDITIONS, VARIANTS, Task, execute, learn, load_task, parse_task
from coartic.analysis import verify as checker
from coartic.benchmarks.run import run_suite
from coartic.motion.trials import make_trials, movements_of
from coartic.tasks.families import task_text
from coartic.tasks.optima import essence
from coartic.tasks.task import hands_of
from tests.support import reference
from tests.support.strategies import sample, uneven_task
from tests.support.suites import InProcess
from tests.test_learner import assert_equals_reference

TERMS = {
    "joints": {"joints": 80.0, "costly": "right-arm"},
    "base": {"joints": 80.0, "costly": "base"},
    "region": {"region": 90.0, "radius": 2.5},
    "distinct": {"distinct": 70.0, "apart": 1.5},
    "all": {"joints": 30.0, "region": 40.0, "centre": [2.0, 1.5], "radius": 3.0, "distinct": 50.0},
}
UNEVEN = uneven_task()


def with_penalty(task, **penalty):
    """A task with a penalty."""
    task = task if isinstance(task, Task) else load_task(task)
    return parse_task({**task.model_dump(mode="json"), "penalty": penalty}, "test")


@pytest.mark.parametrize("task", ["ascending", "two-armed-1", UNEVEN], ids=str)
@pytest.mark.parametrize("terms", TERMS)
def test_trials_and_executions_lose_what_the_slow_loop_says(task, terms):
    plain = task if isinstance(task, Task) else load_task(task)
    task = with_penalty(plain, **TERMS[terms])
    hands, targets = sample(plain, 20)
    with_it, without = make_trials(task, hands, targets), make_trials(plain, hands, targets)
    lost = []
    for n in np.flatnonzero(with_it.completed).tolist():
        names = list(hands_of(hands[n]))
        lost.append(sum(reference.penalty(task, list(with_it.reached[n]), names)))
        execution = execute(task, movements_of(hands[n], targets[n]))
        assert execution.penalty == with_it.penalties[n] == lost[-1]
        assert execution.reward == with_it.rewards[n] == -execution.ticks - lost[-1]
    assert len({*lost}) > 5
    np.testing.assert_array_equal(with_it.ticks, without.ticks)  # the movements are the same
    np.testing.assert_array_equal(with_it.reached, without.reached)
    assert not without.penalties.any()


@pytest.mark.parametrize(
    ("task", "condition"),
    [
        ("ascending", CONDITIONS["EC1"]),
        ("two-armed-1", CONDITIONS["EC4"]),
        ("two-armed-1", VARIANTS["EC4-subtask"]),
        (UNEVEN, CONDITIONS["EC4"]),
    ],
    ids=str,
)
def test_the_learner_feels_them_as_the_slow_learner_does(task, condition):
    task = with_penalty(task, **TERMS["all"])
    slow = assert_equals_reference(task, condition, trials=6, seed=36)
    run = learn(task, condition, seed=36, trials=300)
    ticks = sum(movement.ticks for movement in run.solution)
    assert run.reward == run.execute().reward < -ticks
    assert run.replay_reward == execute(task, run.replay).reward
    assert slow.rewards[0] == run.initial_reward


def test_a_penalty_of_no_ticks_changes_nothing():
    plain, nothing = load_task("two-armed-2"), with_penalty("two-armed-2")
    runs = [learn(task, "EC4", seed=3, trials=300) for task in (plain, nothing)]
    np.testing.assert_array_equal(*(run.rewards for run in runs))
    np.testing.assert_array_equal(*(run.values for run in runs))
    assert "penalty" not in json.loads(plain.model_dump_json())
    assert "penalty" in nothing.model_dump()
    assert essence(plain) != essence(nothing)


def test_environments_pay_at_the_goal_that_costs():
    gym = pytest.importorskip("coartic.gym")
    task = with_penalty("two-armed-1", **TERMS["all"])
    execution = learn(task, "EC4", seed=0, trials=300).execute()
    env = gym.TaskEnv(task, scale=8.0)
    env.reset()
    first = {m.goal: m for m in reversed(execution.movements)}
    rewards = [
        env.step(env.action_for(first[goal].hand, first[goal].target))[1] for goal in sorted(first)
    ]
    hits, hands = list(execution.configurations), list(hands_of(execution.hands))
    lost = np.add(execution.ticks_by_goal(), reference.penalty(task, hits, hands))
    assert [-reward for reward in rewards] == lost.tolist()
    assert env.arms.trials.rewards.tolist() == [execution.reward]


def test_files_say_them_and_nothing_that_cannot_be():
    task = with_penalty("two-armed-1", **TERMS["all"])
    for same in (task, with_penalty("two-armed-1", region=5.0)):
        assert parse_task(tomllib.loads(task_text(same)), "test") == same
    assert "penalty" not in task_text(load_task("two-armed-1"))


SUITE = """
title = "x"
description = "x"
runs = 2
trials = 60
[[cells]]
tasks = ["two-armed-1"]
methods = ["dual-process/EC4", "corrective-alone/given"]
penalties = [{ distinct = 50.0 }, { distinct = 100.0 }, { region = 50.0, radius = 2.0 }]
"""


def test_a_suite_has_variants_of_tasks_and_its_folder_can_be_checked(tmp_path):
    (tmp_path / "own.toml").write_text(SUITE)
    folder = tmp_path / "results"
    run_suite(tmp_path / "own.toml", folder, executor=InProcess())
    report = checker.check_runs(folder)
    assert (report.wrong, report.runs) == ([], 9)
    with closing(sqlite3.connect(folder / "runs.sqlite", isolation_level=None)) as db:
        names = {name for (name,) in db.execute("SELECT name FROM tasks")}
        words = ("distinct-50", "distinct-100", "region-50-radius-2")
        assert names == {f"two-armed-1.{n}" for n in words}
        db.execute("UPDATE settings SET definition = replace(definition, '100.0', '200.0')")
    wrong = [words for words in checker.check_runs(folder).wrong if words.startswith("Run ")]
    assert len(wrong) == 3  # those of one of three tasks
    assert all("reward is " in sentence for sentence in wrong)
