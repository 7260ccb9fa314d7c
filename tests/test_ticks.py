"""A movement of one's own: its table, its film, and others beside it."""

import numpy as np
import pytest
from PIL import Image

from coartic import (
    CoarticError,
    Task,
    corrective_trial,
    learn_many,
    load_task,
    movements_of,
    trajectory,
)

TASK = Task(goals=[(3.0, 2.0), (4.5, 2.0)], q0=[0, 0, 2, -0.5, 0, 0, 1, 0.5, 0, 0])


@pytest.fixture
def mine():
    return trajectory(TASK, movements_of("RR", corrective_trial(TASK, "RR").configurations))


def test_the_table_has_each_tick(mine):
    frame = mine.to_frame()
    assert len(frame) == mine.ticks == -mine.reward
    assert (frame.goal == 1).sum() == mine.hits[0] + 1
    assert set(frame.hand) == {"right"}
    joints = frame[list(TASK.robot.joint_names)].to_numpy()
    for hand in ("left", "right"):
        places = frame[[f"{hand}_x", f"{hand}_y"]].to_numpy()
        assert places == pytest.approx(TASK.robot.forward_kinematics(joints, hand))
    for goal, row in zip(TASK.goals, mine.hits, strict=True):
        assert np.hypot(*(frame.loc[row, ["right_x", "right_y"]] - np.array(goal))) <= TASK.radius


def test_others_stand_beside_it(mine):
    beside = mine.compare("EC4", "corrective process", mine, runs=2, trials=60)
    runs = learn_many(TASK, "EC4", seeds=range(2), trials=60)
    alone = corrective_trial(TASK, "RR").reward
    learned = np.mean([run.reward for run in runs])
    assert beside.reward.tolist() == [mine.reward, learned, alone, mine.reward]
    assert beside.this_is_better_by.tolist() == [0, mine.reward - learned, mine.reward - alone, 0]
    assert beside.runs.tolist() == [1, 2, 1, 1]


@pytest.mark.parametrize(
    ("task", "name", "reward"),
    [("ascending", "optimum", -292), ("two-armed-1", "best known", -451)],
)
def test_the_best_known_movement(task, name, reward):
    hands = load_task(task).initial_hands
    alone = corrective_trial(task, hands)
    assert trajectory(task, alone.movements).compare("optimum").reward[name] == reward


def test_a_film_and_a_picture(tmp_path):
    near = Task(goals=[(4.8, 0.1)])  # 20 steps along the base
    mine = trajectory(near, corrective_trial(near, "R").movements)
    mine.animate(tmp_path / "mine.gif", width=200)
    with Image.open(tmp_path / "mine.gif") as film:
        assert film.n_frames > 5
    mine.plot().savefig(tmp_path / "mine.png")
    with pytest.raises(CoarticError, match="there already"):
        mine.animate(tmp_path / "mine.gif")


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda mine: mine.compare("EC9"), "did you mean 'EC4'"),
        (lambda mine: mine.compare("optimum"), "no optimum of task 'unnamed' is known"),
        (
            lambda mine: movements_of("RRR", mine.execution.configurations),
            "a row for each of the 3",
        ),
        (lambda mine: movements_of("RX", mine.execution.configurations), "hands is 'RX'"),
        (lambda mine: movements_of("RR", "x"), "targets"),
    ],
)
def test_what_cannot_be_is_said(mine, call, words):
    with pytest.raises((CoarticError, ValueError), match=words):
        call(mine)
