"""Families as environments, scores, and the adapter for Stable-Baselines3."""

import numpy as np
import pytest
from scipy import stats

from coartic import (
    MotionModel,
    Task,
    correct,
    corrective_trial,
    execute,
    initial_hands,
    load_task,
)
from coartic.baselines.corrective_alone import METHODS as ALONE
from coartic.motion.trials import movements_of
from coartic.optimisers import FAILED
from coartic.robot import HANDS
from coartic.tasks.task import address_of

gymnasium = pytest.importorskip("gymnasium")

import coartic.gym  # noqa: E402

FAMILY = "coartic/Family-v0"
MIXED = "redundancy/v1"  # of robots that differ in links and locks


@pytest.mark.parametrize("family", [MIXED, "one-armed/v1"])
def test_the_checkers_find_nothing(family, monkeypatch):
    from gymnasium.utils.env_checker import check_env

    monkeypatch.setitem(coartic.gym.TaskEnv.metadata, "render_fps", 1000)
    check_env(gymnasium.make(FAMILY, family=family, ahead=2).unwrapped)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gymnasium.make(FAMILY, family=family, ahead=2).unwrapped)


def solution_of(arms, row):
    dof = load_task(arms.infos()["task"][row]).robot.dof
    hands = str(arms.hands[row])
    return movements_of(hands, arms.trials.targets[row, : len(hands), :dof])


def test_robots_that_differ_do_what_each_does_alone():
    """Trials of 90 robots on 60 tasks of 18 kinds, against executions of their targets."""
    vector = gymnasium.make_vec(
        FAMILY, num_envs=90, family=MIXED, count=60, autoreset_mode="Disabled"
    )
    vector.reset(seed=0)
    arms, total, rng = vector.unwrapped.arms, np.zeros(90), np.random.default_rng(0)
    tasks = [load_task(name) for name in arms.infos()["task"]]
    kinds = {(task.robot, task.locked_base) for task in tasks}
    assert len(kinds) > 12
    for _ in range(3):
        actions = rng.uniform(-1, 1, vector.action_space.shape)
        actions[rng.random(90) < 0.1, 1:] = np.nan
        _, rewards, ended, _, _ = vector.step(actions)
        total += rewards
    vector.unwrapped._ended[:] = False
    arms.step(rng.uniform(-1, 1, vector.action_space.shape), ~ended)
    total += arms.rows["reward"]
    for row, task in enumerate(tasks):
        assert arms.trials.completed[row]
        execution = execute(task, solution_of(arms, row))
        assert execution.reward == total[row] == arms.trials.rewards[row]
        assert arms.infos()["hands"][row] == execution.hands
    assert {len(task.goals) for task in tasks} == {3, 4}


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_the_vector_is_as_many_single_ones(mode):
    options = {"family": MIXED, "count": 30, "ahead": 2}
    sync = {"vectorization_mode": "sync", "vector_kwargs": {"autoreset_mode": mode}}
    ours = gymnasium.make_vec(FAMILY, num_envs=5, autoreset_mode=mode, **options)
    theirs = gymnasium.make_vec(FAMILY, num_envs=5, **sync, **options)
    rng, drawn = np.random.default_rng(1), set()
    for seed in (7, [3, 1, 4, 1, 5], None):
        results = [[each.reset(seed=seed)] for each in (ours, theirs)]
        for _ in range(9):
            actions = rng.uniform(-1, 1, ours.action_space.shape)
            for each, env in zip(results, (ours, theirs), strict=True):
                each.append(env.step(actions))
        for one, other in zip(*results, strict=True):
            for mine, due in zip(one[:-1], other[:-1], strict=True):
                np.testing.assert_array_equal(mine, due)
            assert one[-1]["task"].tolist() == other[-1]["task"].tolist()
            drawn |= {*one[-1]["task"]}
    assert len(drawn) > 10


def way_of(task, q, hand, goal):
    found = correct(task.robot, q, hand, goal, locked_base=task.locked_base)
    return found.q - q


@pytest.mark.parametrize(("family", "ahead"), [(MIXED, 0), ("one-armed/v1", 3)])
def test_what_is_seen_ahead(family, ahead):
    """Against the table of the page, entry by entry; and the hand that an action chooses."""
    env = gymnasium.make(FAMILY, family=family, ahead=ahead).unwrapped
    most = coartic.gym.load_family(family).links[1]
    rng = np.random.default_rng(0)
    for seed in range(6):
        seen, info = env.reset(seed=seed)
        task, ended = load_task(info["task"]), False
        for goal in range(len(task.goals)):
            q, base = env.arms.q[0, : task.robot.dof], env.arms.q[0, :2]
            changes = {h: way_of(task, q, h, task.goals[goal]) for h in HANDS if h in task.hands}
            ways = {hand: np.linalg.norm(change) for hand, change in changes.items()}
            nearer = min(ways, key=ways.get)
            before = [info["hands"][-1:] == letter for letter in "LR"]
            due = [(len(task.goals) - goal) / 10, *before]
            due += [axis not in task.locked_base for axis in "xy"] + [nearer == "right"]
            for hand, change in changes.items():
                joints, pad = task.robot.joints(hand), np.zeros(most)
                links = joints.stop - joints.start
                due += [links / 8, *(task.robot.forward_kinematics(q, hand) - base) / 4]
                due += [ways[hand] / 4, *change[:2] / 4]
                for values in (q[joints], change[joints]):
                    due += [*values, *pad[links:]]
            for number in range(goal, goal + ahead + 1):
                there = number < len(task.goals)
                due += [1, *(task.goal_array[number] - base) / 4] if there else [0, 0, 0]
            np.testing.assert_allclose(seen, due, rtol=1e-5, atol=1e-6)
            action = rng.uniform(-1, 1, env.action_space.shape)
            seen, _, ended, _, info = env.step(action)
            if len(task.hands) == 2:
                other = {"left": "right", "right": "left"}[nearer]
                due_hand = other if action[0] > 0.5 else nearer
                assert info["hands"][-1] == due_hand[0].upper()
        assert ended


def test_splits_never_mix():
    drawn = {}
    for split, more in (("development", {}), ("test", {}), ("fresh", {"year": 2027})):
        env = gymnasium.make(FAMILY, split=split, count=8, **more)
        names = {env.reset(seed=seed)[1]["task"] for seed in range(60)}
        assert {address_of(name).split for name in names} == {split}
        assert len(names) == 8
        drawn[split] = names
    assert not drawn["development"] & drawn["test"]
    assert address_of(gymnasium.make(FAMILY).reset(seed=0)[1]["task"]).split == "development"


def test_an_agent_of_a_family_is_scored_on_test_instances():
    """Whatever it was trained on; beside what executions and scipy give."""
    tasks = [load_task(f"two-armed/v1/i{number:03}") for number in range(10)]
    alone = np.array([corrective_trial(task, initial_hands(task)).reward for task in tasks])
    env = gymnasium.make(FAMILY, split="development", hands="initial")
    policies = {"none": lambda seen: np.full((len(seen), 10), np.nan), "method": ALONE[0]()}
    table = coartic.gym.score(env, policies, episodes=2)
    best = coartic.gym.best_known(tasks)
    gaps = 100 * (alone - best) / best
    low, high = stats.t.interval(0.95, 9, gaps.mean(), stats.sem(gaps))
    for name in ("none", "method", "corrective process"):
        due = [alone.mean(), gaps.mean(), low, high, 1.0]
        np.testing.assert_allclose(table.loc[name], due, rtol=1e-9)
    assert table.gap["best known"] == 0 < gaps.min() < gaps.mean() < table.gap["random actions"]
    assert best.mean() == table.reward["best known"]


def test_a_single_task_is_scored():
    """The known rewards of the paper's first task; a policy that fails is left out of means."""
    table = coartic.gym.score("coartic/Ascending-v1", lambda seen: np.zeros((1, 6)))
    assert table.reward["best known"] == -292
    assert table.reward["corrective process"] == -319
    assert table.gap["corrective process"] == pytest.approx(100 * 27 / 292)
    assert -330 < table.reward["policy"] < -300
    assert table.reward["random actions"] < table.reward["policy"]
    assert table.gap_low["random actions"] < table.gap["random actions"]
    failing = coartic.gym.score(
        "coartic/Ascending-v1", lambda seen: -np.ones((1, 6)), around=None, hands=None,
        scale=8.0, model=MotionModel(max_iterations=100),
    )  # fmt: skip
    assert failing.completed["policy"] == 0
    assert failing.reward[["policy", "best known"]].isna().all()


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"split": "train"}, ValueError, "split is 'train'; it is one of 'development', 'test'"),
        ({"split": "fresh"}, ValueError, "year is None; fresh instances need one"),
        ({"year": 2027}, ValueError, "year is 2027; fresh instances need one, .* others none"),
        ({"split": "fresh", "year": "2027"}, ValueError, "year is '2027'; it must be a whole"),
        ({"count": 0}, ValueError, "count is 0; it must be a whole number from 1"),
        ({"ahead": -1}, ValueError, "ahead is -1; it must be a whole number from 0"),
        ({"family": "two-armed"}, coartic.TaskError, "unknown family 'two-armed'"),
        ({"around": "LR"}, TypeError, "unknown option 'around'"),
        ({"scale": 0}, ValueError, "scale is 0"),
    ],
)
def test_a_wrong_option_is_refused_with_a_sentence(options, error, words):
    for make in (coartic.gym.TaskEnv, lambda **more: coartic.gym.TaskVectorEnv(2, **more)):
        with pytest.raises(error, match=words):
            make(**{"family": "two-armed/v1"} | options)
    with pytest.raises(TypeError, match="task is None; it must be a Task, the name of one"):
        gymnasium.make("coartic/Task-v1")


def test_what_cannot_be_scored():
    for env, error, words in (
        ("coartic/Ascendin-v1", ValueError, "did you mean 'coartic/Ascending-v1'"),
        (gymnasium.make("CartPole-v1"), TypeError, "it must be an environment of coartic or its"),
    ):
        with pytest.raises(error, match=words):
            coartic.gym.score(env)
    with pytest.raises(TypeError, match="policy is 3; it must be a function of observations"):
        coartic.gym.score("coartic/Ascending-v1", 3)
    with pytest.raises(ValueError, match=r"actions have shape \(1, 2\); it must be \(1, 6\)"):
        coartic.gym.score("coartic/Ascending-v1", lambda seen: np.zeros((1, 2)))
    with pytest.raises(ValueError, match="episodes is 0"):
        coartic.gym.score("coartic/Ascending-v1", episodes=0)


def test_version_one_is_about_the_initial_hands():
    for name, task in coartic.gym.TASKS.items():
        given = {} if task else {"task": "long/v1/i003"}
        env = gymnasium.make(f"coartic/{name}-v1", **given).unwrapped
        hands = initial_hands(env.arms.task)
        env.reset()
        for posture, hand in zip(
            corrective_trial(env.arms.task, hands).configurations, hands, strict=True
        ):
            action = env.action_for("left" if hand == "L" else "right", posture)
            assert np.abs(action).max() < 1e-9
            far = np.full_like(action, 0.1)
            target = posture + 0.05 * env.arms._table.moves[0, env.arms.goal[0]]
            np.testing.assert_allclose(
                env.action_for("left" if hand == "L" else "right", target), far
            )
            info = env.step(action)[4]
        assert (info["hands"], info["is_success"]) == (hands, True)


def test_robots_for_stable_baselines():
    pytest.importorskip("stable_baselines3")
    envs = coartic.gym.sb3(FAMILY, num_envs=6, count=20, ahead=0, hands="initial")
    envs.seed(3)
    seen, vector = (
        envs.reset(),
        gymnasium.make_vec(FAMILY, num_envs=6, count=20, ahead=0, hands="initial"),
    )
    np.testing.assert_array_equal(seen, vector.reset(seed=[3, 4, 5, 6, 7, 8])[0])
    nothing, sums, steps, ends = np.full((6, 10), np.nan), np.zeros(6), np.zeros(6), 0
    for _ in range(12):
        names = envs._envs.arms.infos()["task"]
        seen, rewards, ended, infos = envs.step(nothing)
        sums, steps = sums + rewards, steps + 1
        for row in np.flatnonzero(ended):
            ends += 1
            task: Task = load_task(names[row])
            assert sums[row] == pytest.approx(-1, rel=1e-6)  # the corrective process alone
            reward = corrective_trial(task, initial_hands(task)).reward
            assert infos[row]["episode"] == {"r": reward, "l": len(task.goals), "t": 0}
            assert infos[row]["terminal_observation"][0] == 0
            assert seen[row][0] > 0
        sums[ended] = steps[ended] = 0
    assert ends > 12
    far, edge = coartic.gym.sb3(FAMILY, num_envs=2), coartic.gym.sb3(FAMILY, num_envs=2)
    for each, size in ((far, 9.0), (edge, 1.0)):
        each.seed(0), each.reset()
        each.last = each.step(np.full((2, 11), size))[1]
    assert far.last.tolist() == edge.last.tolist()
    fails = coartic.gym.sb3("coartic/Ascending-v1", num_envs=1, around=None, hands=None, scale=8.0,
                            model=MotionModel(max_iterations=100))  # fmt: skip
    fails.reset()
    _, rewards, ended, infos = fails.step(np.full((1, 6), -1.0))
    assert (rewards.tolist(), ended.tolist(), infos[0]["episode"]["r"]) == ([-2.0], [True], -FAILED)
