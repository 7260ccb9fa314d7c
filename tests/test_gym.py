"""Environments against executions of the same movements; scores; robots for other libraries."""

import doctest
from functools import partial

import numpy as np
import pandas as pd
import pytest

import coartic
from coartic import (
    PAPER,
    MotionModel,
    Movement,
    correct,
    corrective_trial,
    execute,
    execute_noisy,
    initial_hands,
    load_task,
)
from coartic.baselines.corrective_alone import METHODS as ALONE
from coartic.estimates import mean
from coartic.method.optimisers import FAILED
from coartic.motion.solution import movements_of
from coartic.tasks.optima import best_shipped
from coartic.tasks.task import address_of
from tests.support import reference
from tests.support.noise import World
from tests.support.strategies import tiny_task
from tests.support.worlds import WORLDS, named

gymnasium = pytest.importorskip("gymnasium")

from gymnasium import wrappers  # noqa: E402

import coartic.gym  # noqa: E402
from coartic.gym import TaskEnv, sb3, score  # noqa: E402

TWO = "coartic/TwoArmed1-v2"
MIXED = "redundancy/v1"
"""A family whose robots differ in links and locks."""


@pytest.mark.parametrize(("task", "ahead"), [("ascending", 0), (MIXED, 2)])
def test_the_checkers_find_nothing(task, ahead):
    from gymnasium.utils.env_checker import check_env

    check_env(gymnasium.make("coartic/Task-v2", task=task, ahead=ahead).unwrapped)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gymnasium.make("coartic/Task-v2", task=task, ahead=ahead).unwrapped)


def due_movement(task, q, goal, action, moves, links, model=PAPER):
    """The hand and the target that an action says, from what the documentation says."""
    how = {"locked_base": task.locked_base, "model": model}
    ends = {hand: correct(task.robot, q, hand, goal, **how).q for hand in task.hands}
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
    env, rng, links = (
        TaskEnv(name, ahead=ahead),
        np.random.default_rng(0),
        8 if name == MIXED else 4,
    )
    locks = set()
    for seed in range(12 if name == MIXED else 6):
        seen, info = env.reset(options={"task": seed}) if name == MIXED else env.reset(seed=seed)
        task = load_task(info["task"])
        locks.add(task.locked_base)
        hands, targets, q, rewards, ended = "", [], task.q0, [], False
        while True:
            arms = [q[task.robot.joints(hand)] for hand in task.hands]
            arms = [np.pad(arm, (0, links - len(arm))) for arm in arms]
            free = [axis not in task.locked_base for axis in moves]
            has = [np.arange(links) < task.robot.max_links for _ in task.hands]
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
    assert len(locks) == (3 if name == MIXED else 1)


@pytest.mark.parametrize("world", WORLDS, ids=named)
def test_a_trial_in_any_world_is_that_of_the_slow_implementation(world):
    """``reset(seed=n)`` begins draw 0 of the world of seed n, ``reset()`` the next one."""
    world = world._replace(max_iterations=5000)
    env, task, seen = TaskEnv("two-armed-2", model=world), load_task("two-armed-2"), []
    for seed, draw in ((4, 0), (4, 1), (4, 2), (5, 0), (4, 0)):
        env.reset(seed=None if draw else seed)
        noise, q, hands, targets, rewards = World(world, seed, draw), task.q0, "", [], []
        rng = np.random.default_rng(draw)
        for goal in task.goals:
            action = 0.1 * rng.uniform(-1, 1, env.action_space.shape)
            hand, target = due_movement(task, q, goal, action, "xy", 4, world.without_noise())
            hands, targets = hands + hand, [*targets, target]
            _, reward, ended, _, _ = env.step(action)
            rewards.append(reward)
            so_far = task.model_copy(update={"goals": task.goals[: len(hands)]})
            due = reference.execute(so_far, movements_of(hands, targets), world, noise)
            if ended:
                break
            q = due.hits[-1]
        assert sum(rewards) == due.reward or (due.reward is None and not env.outcome > -np.inf)
        seen.append(sum(rewards))
    assert seen[0] == seen[-1]
    assert (len({*seen[:3]}) > 1) or world.motor_noise == 0.0


def test_score_judges_100_draws():
    """Of the same noise for all, in which nobody has practised."""
    model = {"motor_noise": 0.02, "norm": "maximum"}
    exact = MotionModel(norm="maximum")
    rows = {"still": lambda seen: np.zeros((len(seen), 6)), "planner": ALONE[0]()}
    table = score("coartic/Ascending-v2", rows, model=model, seed=3)
    alone = [Movement(n, "right", "corrective") for n in (1, 2, 3)]
    due = -execute_noisy("ascending", [alone], 0.02, 100, 3, exact).mean()
    assert table.reward["corrective process"] == table.reward["planner"] == due
    assert table.completed["still"] == 1.0
    assert table.reward["still"] != due  # it aims, and is corrected where it misses
    assert np.isnan(table.reward["best known"])
    again = score("coartic/Ascending-v2", rows, model=model, seed=3)
    pd.testing.assert_frame_equal(table, again)
    by_id = gymnasium.make("coartic/Ascending-v2", model=model)
    assert by_id.unwrapped.model == MotionModel(**model)
    with pytest.raises(ValueError, match="model has no constant 'sd'"):
        TaskEnv("ascending", model={"sd": 0.1})


@pytest.mark.parametrize(
    ("options", "split"),
    [({}, "development"), ({"split": "test"}, "test"), ({"split": "fresh", "year": 2027}, "fresh")],
)
def test_splits_never_mix_and_a_seed_gives_the_same(options, split):
    env = TaskEnv("two-armed/v1", count=8, **options)
    names = [env.reset(seed=seed)[1]["task"] for seed in range(60)]
    assert {address_of(name).split for name in names} == {split}
    assert len({*names}) == 8
    assert [env.reset(options={"task": k})[1]["task"] for k in range(8)] == sorted({*names})
    many = gymnasium.make_vec("coartic/Task-v2", 3, task="two-armed/v1", count=8, **options)
    assert [*many.reset(seed=5)[1]["task"]] == names[5:8]
    env.reset(seed=7)  # without a seed generators go on
    assert many.reset()[1]["task"][2] == env.reset()[1]["task"]


def test_where_the_corrective_process_fails_the_posture_takes_its_place():
    """In 50 iterations it comes near the goal, 0.3 to the right of the hand, and no further."""
    start, model = tiny_task(), MotionModel(max_iterations=50)
    x, y = start.robot.forward_kinematics(start.q0, "right")
    task = tiny_task(hands=["right"], goals=[[x + 0.3, y]])
    assert not correct(task.robot, task.q0, "right", task.goals[0], model=model).converged
    for share in (0.0, 0.6):  # of half a unit, to the right
        env, action = TaskEnv(task, model=model), [share, 0, 0, 0, 0, 0]
        with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
            env.step(action)
        env.reset()
        target = task.q0.copy()
        target[0] += share / 2
        due = execute(task, movements_of("R", [target]), model=model).reward
        _, reward, ended, _, info = env.step(action)
        assert (reward, ended) == (-FAILED if due is None else due, True)
        assert info["is_success"] == (due is not None) == (share > 0)
        with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
            env.step(action)


def test_what_is_refused():
    env = TaskEnv("ascending")
    env.reset()
    missing = np.zeros(6)
    missing[3] = np.nan
    several = [partial(TaskEnv, name) for name in ("ascending", "descending")]
    for error, words, call in (
        (ValueError, "are options of families", lambda: TaskEnv("ascending", count=3)),
        (ValueError, "finite, of shape", lambda: env.step(missing)),
        (ValueError, "a row for each", lambda: score(env, lambda seen: np.zeros((2, 6)))),
        (TypeError, "different options", lambda: score(gymnasium.vector.SyncVectorEnv(several))),
    ):
        with pytest.raises(error, match=words):
            call()


def test_the_example_of_score():
    assert doctest.testmod(coartic.gym.scores) == (0, 2)


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
    ):
        pd.testing.assert_frame_equal(score(env, partial(policy, 0.5)), due)
    short = score(gymnasium.make(TWO, max_episode_steps=2), partial(policy, 1.0))
    assert short.completed["policy"] == 0
    assert np.isnan(short.reward["policy"])
    learns = wrappers.NormalizeObservation(gymnasium.make(TWO))
    count = learns.obs_rms.count
    score(learns, partial(policy, 1.0))
    assert (learns.obs_rms.count, learns.update_running_mean) == (count, True)


def test_scoring_changes_no_statistics_of_any_member():
    """Also of a subclass of the wrapper, and of the members after the first."""

    class Normal(wrappers.NormalizeObservation):
        pass

    made = [Normal(gymnasium.make(TWO)) for _ in range(2)]
    vector = gymnasium.vector.SyncVectorEnv([lambda each=each: each for each in made])
    counts = [each.obs_rms.count for each in made]
    score(vector, lambda seen: np.zeros((len(seen), 10), np.float32))
    assert [each.obs_rms.count for each in made] == counts
    assert all(each.update_running_mean for each in made)


class Still(TaskEnv):
    """Whatever the action, does what zeros do."""

    def step(self, action):
        return super().step(np.zeros_like(action))


def test_an_environment_of_ones_own_is_scored_itself():
    due = score(TWO, lambda seen: np.zeros((len(seen), 10))).reward["policy"]
    assert (score(Still("two-armed-1"), lambda seen: seen[:, :10]).reward[:2] == due).all()


def test_an_agent_is_scored_as_it_was_trained(tmp_path):
    """In VecNormalize as there; from a file with observations as there, or with a warning."""
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common import vec_env

    robots = partial(coartic.gym.sb3, TWO, num_envs=2)
    norm = vec_env.VecNormalize(robots())
    agent = sb3.PPO("MlpPolicy", norm, n_steps=64, seed=0, device="cpu").learn(256)
    policies = {
        "agent": agent,
        "as seen": lambda seen: agent.predict(seen, deterministic=True)[0],
    }
    count = norm.obs_rms.count
    rewards = score(robots(), policies, episodes=1).reward
    assert rewards["agent"] != rewards["as seen"]
    assert score(norm, agent, episodes=1).reward["policy"] == rewards["agent"]
    agent.save(tmp_path / "agent")
    norm.save(tmp_path / "norm")
    loaded = sb3.PPO.load(tmp_path / "agent", device="cpu")
    normalised = score(TWO, loaded, episodes=1, vec_normalize=str(tmp_path / "norm"))
    assert normalised.reward["policy"] == rewards["agent"]
    with pytest.warns(UserWarning, match="vec_normalize=FILE"):
        assert score(TWO, loaded, episodes=1).reward["policy"] == rewards["as seen"]
    assert (norm.training, norm.obs_rms.count) == (True, count)


def test_an_agent_sees_observations_as_its_own_normalisation_makes_them():
    """The normalisation of an agent, unless another one is given: here without a library."""

    class Normal:
        def __init__(self, factor):
            self.factor, self.training = factor, False

        def normalize_obs(self, seen):
            return self.factor * np.asarray(seen)

    class Agent:
        def __init__(self):
            self.seen = []

        def get_vec_normalize_env(self):
            return Normal(2.0)

        def predict(self, seen, deterministic):
            self.seen.append(float(np.abs(seen).sum()))
            return np.zeros((len(seen), 10)), None

    plain, own, given = [], Agent(), Agent()
    score(TWO, lambda seen: plain.append(float(np.abs(seen).sum())) or np.zeros((len(seen), 10)),
          episodes=1)  # fmt: skip
    score(TWO, own, episodes=1)
    score(TWO, given, episodes=1, vec_normalize=Normal(3.0))
    np.testing.assert_allclose(own.seen, 2 * np.array(plain), rtol=1e-5)
    np.testing.assert_allclose(given.seen, 3 * np.array(plain), rtol=1e-5)


def test_robots_for_stable_baselines():
    """Rewards are shares of the corrective process's ticks; episodes have theirs in ticks."""
    pytest.importorskip("stable_baselines3")
    family = {"task": "one-armed/v1", "count": 20}  # whose initial hands are the only ones
    envs, ends = sb3("coartic/Task-v2", num_envs=3, **family), 0
    envs.seed(3)
    envs.reset()
    sums = np.zeros(3)
    for _ in range(12):
        _, rewards, ended, infos = envs.step(np.zeros((3, 6)))
        sums += rewards
        for row in np.flatnonzero(ended):
            ends += 1
            assert sums[row] == pytest.approx(-1, rel=1e-6)  # the corrective process alone
            task = load_task(infos[row]["task"])
            reward = corrective_trial(task, initial_hands(task)).reward
            assert (infos[row]["episode"]["r"], infos[row]["episode"]["l"]) == (
                reward, len(task.goals)
            )  # fmt: skip
        sums[ended] = 0
    assert ends > 6
    # A task of 0 ticks for the corrective process.
    envs = sb3("coartic/Task-v2", 1, task=tiny_task(goals=[[4.5, 0.1]]))
    envs.reset()
    assert -2 <= envs.step(np.full((1, *envs.action_space.shape), 0.5))[1].item() < 0
    fails = sb3("coartic/TwoArmed2-v2", 20, model=MotionModel(max_iterations=100))
    fails.reset()
    steps = map(fails.step, np.random.default_rng(0).choice([-1.0, 1.0], (4, 20, 11)))
    failed = {each for _, rewards, _, infos in steps
              for each, info in zip(rewards, infos, strict=True)
              if info.get("episode", {}).get("r", 0) <= -FAILED}  # fmt: skip
    assert failed == {-2.0}
