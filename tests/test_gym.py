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
pytestmark = pytest.mark.filterwarnings("ignore:.*out of date")


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
    env.reset()
    with pytest.raises(ValueError, match="not finite"):
        env.step(np.array([np.nan, 0, 0, 0, 0, 0]))
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
    table = names["coartic"].gym.score(
        "coartic/TwoArmed1-v1", lambda seen: names["mean"][seen[:, :4].argmax(axis=1)], hands="LRLR"
    )
    assert table.reward["policy"] > -475
    assert table.reward["corrective process"] == -532


def test_the_agent_of_the_page_trains(capsys):
    pytest.importorskip("stable_baselines3")
    names = {}
    exec(program_of_page("Train PPO").replace("40_000", "4096"), names)
    table = names["coartic"].gym.score(names["NAME"], names["agent"], hands=names["HANDS"])
    assert -531 < table.reward["policy"] < -480  # the corrective process alone: -532


@pytest.mark.parametrize("far", [1.5, -3.0, 1e30, np.inf])
def test_actions_are_clipped_to_the_box(far):
    env, vector = gymnasium.make(TWO), gymnasium.make_vec(TWO, num_envs=2)
    env.reset(), vector.reset()
    near = gymnasium.make(TWO)
    near.reset()
    for _ in range(4):
        reward = near.step(np.full(10, np.sign(far)))[1]
        assert env.step(np.full(10, far))[1] == reward
        assert vector.step(np.full((2, 10), far))[1].tolist() == [reward] * 2


def test_targets_outside_of_the_box_have_no_action():
    env = gymnasium.make(TWO, scale=0.5).unwrapped
    q = env.arms.task.q0
    assert np.abs(env.action_for("left", q + 0.5)[1:]).max() == pytest.approx(1)
    with pytest.raises(ValueError, match="outside of the box: it needs a scale of 0.6"):
        env.action_for("left", q - 0.6)
    with pytest.raises(ValueError, match=r"target has shape \(3,\); it must be \(10,\)"):
        env.action_for("left", q[:3])
    with pytest.raises(ValueError, match="hand is 'middle'; it must be one of"):
        env.action_for("middle", q)


@pytest.mark.parametrize("model", [{}, {"model": MotionModel(max_iterations=2)}])
def test_a_step_needs_a_trial_that_goes_on(model):
    env = gymnasium.make(TWO, **model).unwrapped
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset first"):
        env.step(np.zeros(10))
    for _ in range(2):
        env.reset()
        while not env.step(np.zeros(10))[2]:
            pass
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset first"):
            env.step(np.zeros(10))


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        *(({"scale": v}, ValueError, "scale is") for v in (0, -1.0, np.nan, "1", None, True, 1e9)),
        *(({"around": np.full((4, 10), v)}, ValueError, "not finite") for v in (np.nan, 1e300)),
        ({"around": ["L", "R", "L", "R"]}, ValueError, "around is .*; needed are real numbers"),
        ({"scal": 1}, TypeError, "unknown option 'scal'; did you mean 'scale'"),
        ({"render_mode": "ascii"}, ValueError, "render_mode is 'ascii'; it must be one of"),
        ({"model": None}, TypeError, "model is None; it must be a MotionModel"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*render")
def test_a_wrong_option_is_refused_with_a_sentence(options, error, words):
    for make in (
        coartic.gym.TaskEnv,
        lambda task, **more: coartic.gym.TaskVectorEnv(2, task, **more),
    ):
        with pytest.raises(error, match=words):
            make("two-armed-1", **options)
    for count in (0, 1.5, "2", True):
        with pytest.raises(ValueError, match="num_envs is .*; it must be a whole number"):
            coartic.gym.TaskVectorEnv(count, "two-armed-1")


def both_vectors(mode):
    """Robots of ours and of Gymnasium, which fail now and then."""
    model = MotionModel(max_iterations=150)
    ours = gymnasium.make_vec(TWO, num_envs=5, autoreset_mode=mode, model=model)
    theirs = gymnasium.make_vec(
        TWO, num_envs=5, model=model,
        vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode},
    )  # fmt: skip
    return ours, theirs


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_episodes_begin_anew_as_in_gymnasium(mode):
    ours, theirs = both_vectors(mode)
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"]
    seen = [each.reset(seed=[3, None, 1, 2, 0]) for each in (ours, theirs)]
    finals = 0
    for _ in range(12):
        np.testing.assert_array_equal(seen[0][0], seen[1][0])
        actions = np.random.default_rng(finals).uniform(-1, 1, (5, 10))
        (one, *rest, info), (other, *their_rest, their_info) = (
            each.step(actions) for each in (ours, theirs)
        )
        np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(rest, their_rest)
        ended = rest[1]
        assert ("final_obs" in info) == ("final_obs" in their_info)
        if "final_obs" in info:
            finals += 1
            for key in ("_final_obs", "_final_info"):
                np.testing.assert_array_equal(info[key], their_info[key])
            for row in np.flatnonzero(ended):
                np.testing.assert_array_equal(info["final_obs"][row], their_info["final_obs"][row])
                for key in ("hands", "corrections", "is_success"):
                    assert info["final_info"][key][row] == their_info["final_info"][key][row]
        seen = [(one, info), (other, their_info)]
        if mode == "Disabled" and ended.any():
            with pytest.raises(gymnasium.error.ResetNeeded, match="reset them first"):
                ours.step(actions)
            seen = [each.reset(options={"reset_mask": ended.copy()}) for each in (ours, theirs)]
            np.testing.assert_array_equal(seen[0][1]["_hands"], seen[1][1]["_hands"])
    assert bool(finals) == (mode == "SameStep")


def test_what_a_reset_of_the_vector_takes():
    vector = gymnasium.make_vec(TWO, num_envs=3, render_mode="rgb_array")
    vector.reset(seed=[1, None, 2])
    vector.step(np.zeros((3, 10)))
    seen, info = vector.reset(options={"reset_mask": np.array([True, False, True])})
    assert seen[:, 0].tolist() == [1, 0, 1]
    assert info["_hands"].tolist() == [True, False, True]
    first, second, third = vector.render()
    assert first.shape == (400, 600, 3)
    assert (first == third).all()
    assert (first != second).any()
    with pytest.raises(ValueError, match="2 seeds for 3 environments"):
        vector.reset(seed=[1, 2])
    with pytest.raises(gymnasium.error.Error, match="[Ss]eed"):
        vector.reset(seed=[1, -1, 2])
    for mask in ([True, False, True], np.array([1, 0, 1]), np.array([True]), np.zeros(3, bool)):
        with pytest.raises(ValueError, match="reset_mask must be an array of 3 booleans"):
            vector.reset(options={"reset_mask": mask})
