"""Trajectories: their rows by hand, their table and their film."""

import numpy as np
import pytest
from PIL import Image, ImageSequence

from coartic import CoarticError, Movement, Task, corrective_trial, movements_of, trajectory
from coartic.film import set_stage
from tests.support.strategies import posture, tiny_task

TASK = Task(goals=[(3.0, 2.0), (4.5, 2.0)], q0=[0, 0, 2, -0.5, 0, 0, 1, 0.5, 0, 0])


@pytest.fixture
def mine():
    return trajectory(TASK, movements_of("RR", corrective_trial(TASK, "RR").configurations))


def test_the_table_has_each_tick(mine):
    frame = mine.to_frame()
    assert len(frame) == mine.ticks == -mine.reward
    assert (frame.goal == 1).sum() == mine.hits[0] + 1
    assert set(frame.hand) == {"right"}
    units = frame.attrs["units"]
    assert {*units} == {*frame.columns[2:]}
    assert (units["base_y"], units["left_x"], units["left_1"]) == (*["length unit"] * 2, "rad")
    joints = frame[list(TASK.robot.joint_names)].to_numpy()
    for hand in ("left", "right"):
        places = frame[[f"{hand}_x", f"{hand}_y"]].to_numpy()
        assert places == pytest.approx(TASK.robot.forward_kinematics(joints, hand))


def test_a_film_and_a_picture(tmp_path):
    near = Task(goals=[(4.65, 0.1), (4.75, 0.1)])  # 5 steps along the base, then 10
    mine = trajectory(near, corrective_trial(near, "RR").movements)
    mine.animate(tmp_path / "mine.gif", width=200)
    with Image.open(tmp_path / "mine.gif") as film:
        lasts = [frame.info["duration"] for frame in ImageSequence.Iterator(film)]
        assert sum(ms > 400 for ms in lasts) == len(mine.hits)  # it stands where a goal is hit
    figure, (show,) = set_stage([("Mine", mine)], 200)
    for row, words in ((0, "1 tick"), (1, "2 ticks")):
        show(row)
        assert words in [each.get_text() for each in figure.axes[0].texts]
    mine.plot().savefig(tmp_path / "mine.png")
    with pytest.raises(ValueError, match="goal is 0; it must be a whole number from 1 to 2"):
        mine.subtask(0)
    with pytest.raises(CoarticError, match="there already"):
        mine.animate(tmp_path / "mine.gif")


def test_rows_of_a_trajectory_by_hand():
    """A goal hit at the start, two lines of 3 and 2 steps, q + k m (target - q)/distance."""
    task = tiny_task(goals=[[4.5, 0.1], [4.625, 0.1], [4.645, 0.1]])
    ahead = [Movement(n, "right", "planned", posture(x)) for n, x in ((2, 0.06), (3, 0.08))]
    path = trajectory(task, [Movement(1, "right", "corrective"), *ahead])
    np.testing.assert_allclose(path.configurations[:, 0], np.array([0, 1, 2, 3, 3, 4, 5]) / 100)
    np.testing.assert_allclose(path.hand_path("right")[:, 0], path.configurations[:, 0] + 4.5)
    assert path.hits.tolist() == [0, 3, 6]
    assert [len(path.subtask(goal)) for goal in (1, 2, 3)] == [1, 4, 4]
    only = tiny_task(goals=[[4.5, 0.1]])
    idle = trajectory(only, [Movement(1, "right", "corrective")])
    assert (idle.configurations.shape, idle.hits.tolist()) == ((0, 10), [0])
