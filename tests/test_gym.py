"""The environments of Gymnasium against executions, and against Gymnasium's own vectors."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from coartic import MotionModel, load_task
from coartic.optimisers import FAILED

gymnasium = pytest.importorskip("gymnasium")

import coartic  # noqa: E402
import coartic.gym  # noqa: E402

TWO = "coartic/TwoArmed1-v0"


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("coartic/Ascending-v0", {}),
        (TWO, {"observe": "posture"}),
        ("coartic/Task-v0", {"task": "long/v1/i017", "around": "RRRRRR"}),
    ],
)
def test_the_checkers_find_nothing(name, options, monkeypatch):
    from gymnasium.utils.env_checker import check_env

    monkeypatch.setitem(coartic.gym.TaskEnv.metadata, "render_fps", 1000)
    check_env(gymnasium.make(name, **options).unwrapped)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gymnasium.make(name, **options).unwrapped)


def test_what_the_learner_sees_and_what_can_be_seen():
    task = load_task("two-armed-1")
    plain, full = (gymnasium.make(TWO, observe=what) for what in ("learner", "posture"))
    seen, _ = plain.reset(seed=3)
    assert seen.tolist() == [1, 0, 0, 0, 0, 0]
    assert not plain.observation_space.low.any()
    full.reset()
    left = np.full(plain.action_space.shape, -0.1)
    seen, _, _, _, info = plain.step(left)
    assert seen.tolist() == [0, 1, 0, 0, 1, 0]
    assert (info["hands"], info["corrections"]) == ("L", 1)
    seen = full.step(left)[0]
    q = full.unwrapped.arms.q[0]
    np.testing.assert_allclose(seen[6:], [*q, *task.goal_array.ravel()], rtol=1e-6)
    assert plain.step(-left)[0].tolist() == [0, 0, 1, 0, 0, 1]
    assert plain.action_space.shape == (1 + 9,)  # the base is locked in y
    assert gymnasium.make("coartic/Ascending-v0").action_space.shape == (2 + 4,)


def test_given_hands_leave_idle_arms_where_they_are():
    """As the objective does, whose points have no entries for them."""
    cost = coartic.objective("two-armed-1", "LRLR")
    env = gymnasium.make(TWO, hands="LRLR", around="LRLR").unwrapped
    of_goal = np.argwhere(cost.joints)[:, 0]  # for each entry of a point
    for away in (np.full(4, 0.02), np.array([-0.1, 0.1, 0.3, -0.3])):
        env.reset()
        steps = [env.step(np.full(9, size)) for size in away]
        assert sum(reward for _, reward, *_ in steps) == -cost(cost.x0 + away[of_goal])
        assert steps[-1][4]["hands"] == "LRLR"
    with pytest.raises(ValueError, match="do not fit"):
        gymnasium.make(TWO, hands="LR")


def test_the_action_of_no_target():
    env = gymnasium.make(TWO).unwrapped
    env.reset()
    for target in (None, np.full(10, np.nan)):
        for hand, number in (("left", -1), ("right", 1)):
            np.testing.assert_array_equal(env.action_for(hand, target), [number] + [np.nan] * 9)
    for action in ([np.nan] * 10, [1.0, 0.0] + [np.nan] * 8, [np.nan] + [0.0] * 9):
        with pytest.raises(ValueError, match="NaN is for all joints"):
            env.step(np.array(action))
    one_hand = gymnasium.make("coartic/Ascending-v0")
    one_hand.reset()
    action = one_hand.unwrapped.action_for("right", None)
    assert np.isnan(action).all()
    assert sum(one_hand.step(action)[1] for _ in range(3)) == -319  # the corrective process alone


def test_trials_that_fail_and_actions_that_are_none():
    env = gymnasium.make("coartic/Ascending-v0", model=MotionModel(max_iterations=2))
    env.reset()
    seen, reward, ended, _, info = env.step(np.zeros(6))
    assert (reward, ended, info["is_success"]) == (-FAILED, True, False)
    assert seen.tolist() == [1, 0, 0, 0, 0]  # still at the first goal
    for first in (np.nan, np.inf, 1e9):
        env.reset()
        with pytest.raises(ValueError, match="not finite, or far beyond"):
            env.step(np.array([first, 0, 0, 0, 0, 0]))
    with pytest.raises(ValueError, match=r"shape \(1, 3\); it must be \(1, 6\)"):
        env.unwrapped.step(np.zeros(3))
    with pytest.raises(ValueError, match="'XYX'; it must have L or R"):
        gymnasium.make("coartic/Ascending-v0", around="XYX")


@pytest.mark.parametrize(
    "options",
    [{}, {"around": "LRLR", "observe": "posture"}, {"model": MotionModel(max_iterations=150)}],
)
def test_the_vector_is_as_many_single_ones(options):
    """Episodes that fail end earlier, so that robots are at different goals."""
    vector, sync = (
        gymnasium.make_vec(TWO, num_envs=7, vectorization_mode=mode, **options)
        for mode in ("vector_entry_point", "sync")
    )
    assert isinstance(vector, coartic.gym.TaskVectorEnv)
    assert vector.metadata["autoreset_mode"] == sync.metadata["autoreset_mode"]
    assert vector.action_space == sync.action_space
    assert vector.observation_space == sync.observation_space
    vector.action_space.seed(0)
    results = [(vector.reset(seed=1), sync.reset(seed=1))]
    for _ in range(17):
        actions = vector.action_space.sample()
        results.append((vector.step(actions), sync.step(actions)))
    for (*ours, our_info), (*theirs, their_info) in results:
        for one, other in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(one, other)
            assert one.dtype == other.dtype
        for key in ("corrections", "is_success", "hands"):
            there = their_info[f"_{key}"]
            assert our_info[key][there].tolist() == their_info[key][there].tolist()
    ended = np.array([ours[2] for ours, _ in results[1:]])
    assert ended.any(axis=0).all()
    assert ended[:3].any() == ("model" in options)


def test_the_robot_is_drawn():
    """Goals that are hit are filled; the robot moves."""
    from matplotlib.figure import Figure

    from coartic import drawing

    task, axes = load_task("two-armed-1"), Figure().add_subplot()
    circles = drawing.draw_goals(axes, task)
    drawing.fill_goals(circles, [True, False, False, False])
    assert [circle.get_fill() for circle in circles] == [True, False, False, False]
    assert [circle.center for circle in circles] == [*map(tuple, task.goals)]
    move = drawing.draw_robot(axes, task, task.q0)
    move(task.q0 + 1.0)
    for line, hand in zip(axes.lines, ("left", "right"), strict=True):
        due = task.robot.joint_positions(task.q0 + 1.0, hand)
        np.testing.assert_array_equal(line.get_xydata(), due)
    env = gymnasium.make(TWO, render_mode="rgb_array")
    env.reset()
    before = env.render()
    env.step(np.zeros(10))
    assert (before != env.render()).any()


def test_importing_the_environments_compiles_nothing():
    code = "import sys, coartic.gym; assert not {'numba', 'matplotlib', 'torch'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def program_of_page(title):
    page = Path(__file__).parent.parent / "docs" / "howto" / "agents.md"
    (text,) = re.findall(rf'```python\n("""{title}.*?)```', page.read_text("utf-8"), re.DOTALL)
    return text


def test_the_first_program_of_the_page_learns(capsys):
    names = {}
    exec(program_of_page("REINFORCE"), names)
    assert (np.sign(names["mean"][:, 0]) == [-1, 1, -1, 1]).all()  # the hands LRLR
    assert names["total"].mean() > -490


def test_the_agent_of_the_page_trains(capsys):
    pytest.importorskip("stable_baselines3")
    text = program_of_page("Train PPO")
    names = {}
    exec(text.replace("40_000", "2048"), names)
    assert -560 < names["total"] < -480  # the corrective process alone: -532
    assert names["info"]["is_success"]
    assert all(-FAILED < episode["r"] < -480 for episode in names["agent"].ep_info_buffer)
