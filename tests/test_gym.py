"""The environments against executions and Gymnasium's own vectors; scores; the adapter."""

import doctest
import re
import shutil
import sys
from functools import partial

import matplotlib
import numpy as np
import pandas as pd
import pytest

import coartic
from coartic import (
    MotionModel,
    correct,
    corrective_trial,
    execute,
    initial_hands,
    load_task,
)
from coartic.baselines.corrective_alone import METHODS as ALONE
from coartic.estimates import mean
from coartic.learner.method import METHODS as LEARNERS
from coartic.method.optimisers import FAILED
from coartic.motion.solution import movements_of
from coartic.tasks import families
from coartic.tasks.optima import best_shipped
from coartic.tasks.task import address_of
from tests.support.processes import ROOT
from tests.support.strategies import tiny_task

gymnasium = pytest.importorskip("gymnasium")

from gymnasium import wrappers  # noqa: E402

import coartic.gym  # noqa: E402
from coartic.gym import TaskEnv, TaskVectorEnv, compare, sb3, score, scoring  # noqa: E402

TWO = "coartic/TwoArmed1-v2"
MIXED = "mixed/v1"


@pytest.fixture(scope="module", autouse=True)
def _mixed(tmp_path_factory):
    """A family whose robots differ in links and locks, but have no more links than the paper's."""
    folder = shutil.copytree(families.FAMILY_FOLDER, tmp_path_factory.mktemp("mixed") / "families")
    redundancy = (folder / "redundancy.v1.toml").read_text("utf-8")
    (folder / "mixed.v1.toml").write_text(redundancy.replace("[3, 8]", "[3, 4]"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(families, "FAMILY_FOLDER", folder)
        yield


@pytest.mark.parametrize(("task", "ahead"), [("ascending", 0), (MIXED, 2), ("one-armed/v1", 1)])
def test_the_checkers_find_nothing(task, ahead):
    from gymnasium.utils.env_checker import check_env

    check_env(gymnasium.make("coartic/Task-v2", task=task, ahead=ahead).unwrapped)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gymnasium.make("coartic/Task-v2", task=task, ahead=ahead).unwrapped)


def due_movement(task, q, goal, action, moves, links):
    """The hand and the target that an action says, from what the documentation says."""
    ends = {h: correct(task.robot, q, h, goal, locked_base=task.locked_base).q for h in task.hands}
    nearer, *others = sorted(task.hands, key=lambda hand: np.linalg.norm(ends[hand] - q))
    hand = others[0] if others and action[0] > 0.5 else nearer
    target, entries = ends[hand].copy(), 0.5 * np.clip(action[len(others) :], -1, 1)
    for entry, axis in enumerate(moves):
        target["xy".index(axis)] += 0 if axis in task.locked_base else entries[entry]
    for number, each in enumerate(task.hands):
        joints, first = task.robot.joints(each), len(moves) + links * number
        target[joints] += entries[first : first + joints.stop - joints.start]
    return hand[0].upper(), target


@pytest.mark.parametrize(
    ("name", "moves", "ahead"),
    [("ascending", "xy", 1), ("two-armed-1", "x", 5), ("long/v1/i017", "x", 0), (MIXED, "xy", 2)],
)
def test_a_trial_is_the_execution_of_its_targets(name, moves, ahead):
    """Reward, ticks of each goal and what is seen, for robots that differ, in and beyond the
    box."""
    env, rng, links = TaskEnv(name, ahead=ahead), np.random.default_rng(0), 4
    for seed in range(6):
        seen, info = env.reset(seed=seed)
        task = load_task(info["task"])
        hands, targets, q, rewards, ended = "", [], task.q0, [], False
        while True:
            arms = [q[task.robot.joints(hand)] for hand in task.hands]
            arms = [np.pad(arm, (0, links - len(arm))) for arm in arms]
            free = [axis not in task.locked_base for axis in moves]
            has = [np.arange(links) < task.robot.most_links for _ in task.hands]
            flags = np.concatenate([free, *has]) if name == MIXED else []
            there, places, rest = np.split(seen, [ahead + 1, 3 * (ahead + 1)])
            np.testing.assert_array_equal(
                rest, [*np.float32(np.concatenate([q[: len(moves)], *arms])), *flags]
            )
            due = (task.goal_array - q[:2])[len(hands) : len(hands) + ahead + 1]
            assert there.tolist() == [1] * len(due) + [0] * (ahead + 1 - len(due))
            np.testing.assert_allclose(places[: due.size], due.ravel(), rtol=1e-5)
            assert not places[due.size :].any()
            if ended:
                break
            action = rng.uniform(-1.2, 1.2, env.action_space.shape) * (0.1 if seed % 2 else 1)
            goals = task.goals[: len(hands) + 1]
            hand, target = due_movement(task, q, goals[-1], action, moves, links)
            hands, targets = hands + hand, [*targets, target]
            so_far = task.model_copy(update={"goals": goals})
            due = execute(so_far, movements_of(hands, targets))
            seen, reward, ended, _, info = env.step(action)
            rewards.append(reward)
            assert sum(rewards) == due.reward
            assert -reward == sum(each.ticks for each in due.movements if each.goal == len(hands))
            q = due.configurations[-1]
        assert len(hands) == len(task.goals)
        assert info == {"task": task.name, "is_success": True}


def what_comes_of(steps, envs, seed):
    """Arrays, infos, and what the trials that ended had last, at the reset and at each step."""
    for *arrays, info in (envs.reset(seed=seed), *map(envs.step, steps)):
        rows = np.flatnonzero(info.get("_final_obs", []))
        last = [
            [info["final_obs"][row].tolist(), *(info["final_info"][key][row] for key in OF_LAST)]
            for row in rows
        ]
        yield [(a.dtype, a.tolist()) for a in arrays], [info[key].tolist() for key in INFOS], last


INFOS = ("task", "is_success")
OF_LAST = (*INFOS, "_task", "_is_success")
FAILING = {"task": "two-armed-1", "model": MotionModel(max_iterations=150)}


@pytest.mark.parametrize("options", [FAILING, {"task": MIXED, "count": 30, "ahead": 2}])
def test_the_vector_is_as_many_single_ones(options):
    """Bit for bit, in more than one lot; episodes that fail end earlier, so that goals differ."""
    sync = {"vectorization_mode": "sync", "vector_kwargs": {"autoreset_mode": "SameStep"}}
    ours, theirs = (
        gymnasium.make_vec("coartic/Task-v2", num_envs=80, **mode, **options) for mode in ({}, sync)
    )
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"]
    spaces = [(each.action_space, each.observation_space) for each in (ours, theirs)]
    assert spaces[0] == spaces[1]
    steps = np.random.default_rng(2).uniform(-1, 1, (9, *ours.action_space.shape))
    for seed in (7, [3, None, 4, 1, 5] * 16):
        mine, due = ([*what_comes_of(steps, each, seed)] for each in (ours, theirs))
        assert mine == due
    assert len({len(last) for *_, last in mine} - {0, 80}) > 1


@pytest.mark.parametrize(
    ("options", "split"),
    [({}, "development"), ({"split": "test"}, "test"), ({"split": "fresh", "year": 2027}, "fresh")],
)
def test_splits_never_mix_and_a_seed_gives_the_same(options, split):
    env = TaskEnv("two-armed/v1", count=8, **options)
    names = [env.reset(seed=seed)[1]["task"] for seed in np.arange(60)]
    assert {address_of(name).split for name in names} == {split}
    assert len({*names}) == 8
    vector = TaskVectorEnv(3, "two-armed/v1", count=8, **options)
    for seeds in (5, np.uint8(5), np.arange(5, 8), [np.int32(5), 6, 7]):
        assert vector.reset(seed=seeds)[1]["task"].tolist() == names[5:8]
    env.reset(seed=7)  # without a seed generators go on
    assert vector.reset()[1]["task"][2] == env.reset()[1]["task"]


def test_where_the_corrective_process_fails_the_posture_takes_its_place():
    """In 50 iterations it comes near the goal, 0.3 to the right of the hand, and no further."""
    start, model = tiny_task(), MotionModel(max_iterations=50)
    x, y = start.robot.forward_kinematics(start.q0, "right")
    task = tiny_task(hands=["right"], goals=[[x + 0.3, y]])
    assert not correct(task.robot, task.q0, "right", task.goals[0], model=model).converged
    for share in (0.0, 0.6):  # of half a unit, to the right
        env, action = TaskEnv(task, model=model), [share, 0, 0, 0, 0, 0]
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset first"):
            env.step(action)
        env.reset()
        target = task.q0.copy()
        target[0] += share / 2
        due = execute(task, movements_of("R", [target]), model=model).reward
        _, reward, ended, _, info = env.step(action)
        assert (reward, ended) == (-FAILED if due is None else due, True)
        assert info["is_success"] == (due is not None) == (share > 0)
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset first"):
            env.step(action)


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"ahead": -1}, ValueError, "ahead is -1; it must be a whole number from 0"),
        ({"model": None}, TypeError, "model is None; it must be a MotionModel"),
        ({"task": "ascending", "count": 3}, ValueError, "are for families, not 'ascending'"),
        ({"render_mode": "human"}, ValueError, "it must be 'rgb_array'"),
    ],
)
def test_a_wrong_option_is_refused_with_a_sentence(options, error, words):
    for make in (TaskEnv, lambda **more: TaskVectorEnv(2, **more)):
        with pytest.raises(error, match=words):
            make(**{"task": "two-armed/v1"} | options)


@pytest.mark.filterwarnings("ignore:.*out of date")
def test_what_else_is_refused():
    with pytest.raises(gymnasium.error.DeprecatedEnv, match="use `coartic/TwoArmed1-v2`"):
        gymnasium.make("coartic/TwoArmed1-v1")
    single, vector = TaskEnv("ascending"), TaskVectorEnv(2, "ascending")
    single.reset(), vector.reset()
    missing = np.zeros((2, 6))
    missing[1, 3] = np.nan
    no_environment = gymnasium.make("CartPole-v1")
    for error, words, call in (
        (ValueError, "no options, but {'task': 'long'} are",
         lambda: single.reset(options={"task": "long"})),
        (ValueError, "seed is -1; it must be a whole number from 0",
         lambda: single.reset(seed=-1)),
        (ValueError, "3 seeds for 2 environments", lambda: vector.reset(seed=[1, 2, 3])),
        (ValueError, "the action of robot 1 is not finite", lambda: vector.step(missing)),
        (ValueError, "actions is .*no masked entries",
         lambda: vector.step(np.ma.masked_invalid(missing))),
        (ValueError, r"shape \(1, 3\); it must be \(1, 6\)", lambda: single.step(np.zeros(3))),
        (ValueError, "did you mean 'coartic/Ascending-v2'", lambda: score("coartic/Ascending-v1")),
        (TypeError, "must be an environment of coartic or its id", lambda: score(no_environment)),
        *((TypeError, "task is missing: give task=", partial(make, "coartic/Task-v2"))
          for make in (gymnasium.make, gymnasium.make_vec, score)),
        (TypeError, "returned a tuple of 2; needed are the actions alone",
         lambda: score(TWO, lambda seen: (seen, None))),
    ):  # fmt: skip
        with pytest.raises(error, match=words):
            call()


def test_robots_side_by_side_have_the_pictures_of_each(monkeypatch):
    """Before a goal is hit, after it, and when trials have begun again."""
    monkeypatch.setitem(matplotlib.rcParams, "figure.dpi", 50)
    one = gymnasium.make(TWO, render_mode="rgb_array")
    many = gymnasium.make_vec(TWO, num_envs=2, render_mode="rgb_array")
    assert gymnasium.make_vec(TWO, num_envs=2).render() is None
    action = np.zeros(one.action_space.shape, np.float32)
    begun = one.reset()[0], many.reset()
    assert begun[0].shape == one.observation_space.shape
    for hit in (0, 1):
        first, second = many.render()
        assert (first == second).all()
        assert first.shape == (400, 600, 3)
        assert (one.render() == first).all(), hit
        one.step(action), many.step(np.tile(action, (2, 1)))


def names_of_program(title):
    """What a program of the page defines."""
    page = ROOT / "docs" / "howto" / "agents.md"
    (text,) = re.findall(rf'```python\n("""{title}.*?)```', page.read_text("utf-8"), re.DOTALL)
    names = {}
    exec(text.replace("40_000", "4096"), names)
    return names


def test_the_first_program_of_the_page_learns():
    table = score(TWO, names_of_program("REINFORCE")["policy"], ahead=3)
    assert table.reward["policy"] > -475  # the corrective process alone: -532


def test_the_agent_of_the_page_trains():
    pytest.importorskip("stable_baselines3")
    table = score(TWO, names_of_program("Train PPO")["agent"])
    assert -531 < table.reward["policy"] < -480


def test_the_example_of_score():
    assert doctest.testmod(scoring) == (0, 2)


def test_a_family_is_scored_on_its_test_instances():
    """Whatever an environment trains on; beside what executions and scipy give."""
    tasks = [load_task(f"two-armed/v1/i{number:03}") for number in range(10)]
    alone = np.array([corrective_trial(task, initial_hands(task)).reward for task in tasks])
    best = np.array([best_shipped(task).reward for task in tasks])
    env = TaskEnv("two-armed/v1", split="development", count=3)
    zeros = {"zeros": lambda seen: np.zeros((len(seen), 11)), "method": ALONE[0]()}
    table = score(env, zeros, episodes=2)
    gap = mean((alone - best) / best)
    due = [alone.mean(), gap.value, gap.low, gap.high, 1]
    for name in ("method", "corrective process"):
        np.testing.assert_allclose(table.loc[name], due, rtol=1e-9)
    assert table.gap["best known"] == 0 < table.gap["zeros"] < table.gap["random actions"]
    assert best.mean() == table.reward["best known"]


def test_a_single_task_is_scored():
    """The known rewards of the paper's first task; a policy that fails has no mean."""
    table = score("coartic/Ascending-v2", lambda seen: np.zeros((1, 6)))
    assert table.reward["best known"] == -292
    assert table.reward["policy"] == table.reward["corrective process"] == -319
    assert table.gap["policy"] == pytest.approx(27 / 292)
    assert table.gap_low["random actions"] < table.gap["random actions"] > table.gap["policy"]
    other = score(TWO, model=MotionModel(max_iterations=60))
    assert np.isnan(other.reward["best known"])


class Peeping(ALONE[0]):
    """Inherits from a method of this project, but is none."""

    def solve(self, session):
        session.reveal(*self.information)
        return super().solve(session)


class Forged(Peeping):
    """Says that it is a method of this project."""

    __module__ = "coartic.baselines.corrective_alone"


def test_methods_of_others_have_the_information_that_they_declare():
    for method in (Peeping(), Forged()):
        with pytest.raises(coartic.UndeclaredError):
            score("coartic/Ascending-v2", method)
    learner = LEARNERS[0](LEARNERS[0].Parameters(trials=20))  # to which the task is revealed
    assert score("coartic/Ascending-v2", learner).reward["policy"] >= -319


def test_an_environment_in_wrappers_is_taken_as_it_is():
    """Wrappers that Gymnasium adds by itself change nothing."""
    made, vector = gymnasium.make(TWO), gymnasium.make_vec(TWO, num_envs=2)
    weights = np.random.default_rng(0).standard_normal((15, 10))

    def policy(scale, seen):
        return np.float32(scale * 0.125) * np.sin(seen @ weights).astype(np.float32)

    due = score(TWO, partial(policy, 1.0))
    for env in (made, made.unwrapped, vector):
        pd.testing.assert_frame_equal(score(env, partial(policy, 1.0)), due)
    half = np.float32([-0.5, 0.5])
    for env in (
        wrappers.RescaleAction(made, *half),
        wrappers.vector.RescaleAction(vector, *half),
        wrappers.NormalizeReward(gymnasium.make(TWO)),
    ):
        scale = 1.0 if isinstance(env, wrappers.NormalizeReward) else 0.5
        pd.testing.assert_frame_equal(score(env, partial(policy, scale)), due)
    short = score(gymnasium.make(TWO, max_episode_steps=2), partial(policy, 1.0))
    assert short.completed["policy"] == 0
    assert np.isnan(short.reward["policy"])
    with pytest.raises(ValueError, match="ahead: make the environment in the wrappers with this"):
        score(wrappers.RescaleAction(made, *half), ahead=2)
    learns = wrappers.NormalizeObservation(gymnasium.make(TWO))
    count = learns.obs_rms.count
    score(learns, partial(policy, 1.0))
    assert (learns.obs_rms.count, learns.update_running_mean) == (count, True)


def test_the_instances_of_a_family_in_wrappers_are_its_own():
    options = {"task": "two-armed/v1", "count": 4}
    zeros = {"zeros": lambda seen: np.zeros((len(seen), 11), np.float32)}
    due = score("coartic/Task-v2", zeros, split="development", **options)
    one = gymnasium.make("coartic/Task-v2", **options)
    side = gymnasium.make_vec("coartic/Task-v2", num_envs=3, **options)
    for env in (
        wrappers.RescaleAction(one, *np.float32([-2, 2])),
        wrappers.vector.RescaleAction(side, *np.float32([-2, 2])),
    ):
        pd.testing.assert_frame_equal(score(env, zeros), due)


def test_an_agent_is_scored_as_it_was_trained(tmp_path):
    """In VecNormalize as there; in other wrappers if the environment has them; from a file, too."""
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common import vec_env

    robots = partial(coartic.gym.sb3, TWO, num_envs=2)
    norm = vec_env.VecNormalize(robots())
    small = {"n_steps": 64, "seed": 0, "device": "cpu"}
    agent = sb3.PPO("MlpPolicy", norm, **small).learn(256)
    policies = {
        "agent": agent,
        "by hand": lambda seen: agent.predict(norm.normalize_obs(seen), deterministic=True)[0],
        "as seen": lambda seen: agent.predict(seen, deterministic=True)[0],
    }
    rewards = score(TWO, policies, episodes=1).reward
    assert rewards["agent"] == rewards["by hand"] != rewards["as seen"]
    of_norm = score(norm, {"agent": agent, "by hand": policies["as seen"]}, episodes=1).reward
    assert of_norm["agent"] == of_norm["by hand"] == rewards["agent"]
    assert score(robots(), policies, episodes=1).reward.equals(rewards)
    score(TWO, sb3.PPO("MlpPolicy", gymnasium.make(TWO), **small), episodes=1)
    # From a file: its observations as there, or a warning.
    agent.save(tmp_path / "agent")
    norm.save(tmp_path / "norm")
    loaded = partial(sb3.PPO.load, tmp_path / "agent", device="cpu")
    for given in (norm, tmp_path / "norm", str(tmp_path / "norm")):
        again = score(TWO, loaded(), episodes=1, vec_normalize=given).reward
        assert again["policy"] == rewards["agent"]
    with pytest.warns(UserWarning, match="give score vec_normalize=FILE"):
        assert score(TWO, loaded(), episodes=1).reward["policy"] == rewards["as seen"]
    score(TWO, loaded(env=robots()), episodes=1)
    for wrong, words in ((tmp_path / "agent.zip", "no VecNormalize.save wrote"), (0, "it must be")):
        with pytest.raises(TypeError, match=words):
            score(TWO, loaded(), vec_normalize=wrong)
    with pytest.raises(ValueError, match="in a VecNormalize already"):
        score(vec_env.VecFrameStack(norm, 2), agent, vec_normalize=norm)
    # In wrappers that change what it sees or does.
    scaled = wrappers.RescaleAction(gymnasium.make(TWO), *np.float32([-2, 2]))
    stacked = vec_env.VecFrameStack(robots(), 2)
    for number, env in enumerate((stacked, scaled)):
        agent = sb3.PPO("MlpPolicy", env, **small)
        due = score(env, agent, episodes=1).reward["policy"]
        agent.save(tmp_path / str(number))
        loaded = sb3.PPO.load(tmp_path / str(number), device="cpu")
        for each in (agent, loaded):
            with pytest.raises(TypeError, match=r"the agent's \w+_space is Box"):
                score(TWO, each)
        with pytest.warns(UserWarning, match="no environment"):
            assert score(env, loaded, episodes=1).reward["policy"] == due
    agent = sb3.PPO("MlpPolicy", gymnasium.make(TWO, max_episode_steps=4), **small)
    with pytest.raises(TypeError, match="is wrapped in TimeLimit: score the agent in"):
        score(TWO, agent)


def test_what_is_not_installed_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "coartic.gym.stable_baselines", None)
    with pytest.raises(coartic.CoarticError, match=r"needs: pip install 'coartic\[rl\]'"):
        sb3(TWO)


def test_a_policy_that_fails_once_has_no_mean():
    """In one of many trials, on one of many tasks."""
    earned = np.array([[-320.0, -320.0], [-330.0, np.nan], [-310.0, -310.0]])
    table = compare({"policy": earned}, np.array([[-300.0], [-300.0], [np.nan]]))
    assert table.loc["policy", ["reward", "gap", "gap_low"]].isna().all()
    assert table.completed["policy"] == 5 / 6
    solved = compare({"policy": earned[[0, 2]]}, np.array([[-300.0], [np.nan]]))
    assert solved.reward["policy"] == -315
    assert solved.gap["policy"] == pytest.approx(20 / 300)


def test_robots_for_stable_baselines():
    pytest.importorskip("stable_baselines3")
    family = {"task": "one-armed/v1", "count": 20}  # whose initial hands are the only ones
    envs = sb3("coartic/Task-v2", num_envs=6, **family)
    envs.seed(3)
    vector = TaskVectorEnv(6, **family)
    np.testing.assert_array_equal(envs.reset(), vector.reset(seed=[3, 4, 5, 6, 7, 8])[0])
    nothing, sums, names, ends = np.zeros((6, 6)), np.zeros(6), vector.reset(seed=3)[1]["task"], 0
    for _ in range(12):
        seen, rewards, ended, infos = envs.step(nothing)
        sums += rewards
        for row in np.flatnonzero(ended):
            ends += 1
            assert sums[row] == pytest.approx(-1, rel=1e-6)  # the corrective process alone
            task = load_task(names[row])
            reward = corrective_trial(task, initial_hands(task)).reward
            assert infos[row]["episode"] == {"r": reward, "l": len(task.goals), "t": 0}
            assert infos[row]["terminal_observation"][0] == 0 < seen[row][0]
        sums[ended] = 0
        names = vector.step(nothing)[4]["task"]
    assert ends > 12
    # A task of 0 ticks for the corrective process.
    envs = sb3("coartic/Task-v2", 2, task=tiny_task(goals=[[4.5, 0.1]]))
    envs.reset()
    rewards = envs.step(np.full((2, *envs.action_space.shape), 0.5))[1]
    assert np.isfinite(rewards).all()
    assert (rewards < 0).all()
    fails = sb3("coartic/TwoArmed2-v2", 50, model=MotionModel(max_iterations=100))
    fails.reset()
    steps = map(fails.step, np.random.default_rng(0).choice([-1.0, 1.0], (4, 50, 11)))
    failed = {each for _, rewards, _, infos in steps
              for each, info in zip(rewards, infos, strict=True)
              if info and info["episode"]["r"] <= -FAILED}  # fmt: skip
    assert failed == {-2.0}
    fails.set_options({"goals": 2})
    with pytest.raises(ValueError, match="reset takes no options, but {'goals': 2} are given"):
        fails.reset()
    fails.reset()
