"""Trajectories: their table and their film; test_trial has their rows."""

import pytest
from PIL import Image, ImageSequence

from coartic import CoarticError, Movement, Task, corrective_trial, movements_of, trajectory
from coartic.pictures import film
from coartic.pictures.film import stage, write_film
from tests.support.strategies import tiny_task

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


def test_a_film_and_a_picture(tmp_path, monkeypatch):
    for pause in ("HOLD", "PAUSE"):
        monkeypatch.setattr(film, pause, 2)  # each frame takes long to draw
    near = Task(goals=[(4.62, 0.1), (4.65, 0.1)])  # 2 steps along the base, then 3
    mine = trajectory(near, corrective_trial(near, "RR").movements)
    mine.animate(tmp_path / "mine.gif", width=200)
    with Image.open(tmp_path / "mine.gif") as made:
        lasts = [frame.info["duration"] for frame in ImageSequence.Iterator(made)]
        assert sum(ms > 100 for ms in lasts) == len(mine.hits)  # it stands where a goal is hit
    figure, show = stage([("Mine", mine)], 200)
    for row, words in ((0, "1 tick"), (1, "2 ticks")):
        show(row)
        assert figure.axes[0].get_title("right") == words
    assert len(mine.plot().axes[0].lines) > 2
    with pytest.raises(ValueError, match="goal is 0; it must be an integer from 1 to 2"):
        mine.subtask(0)
    for name, words in (("mine.gif", "mine.gif exists"), ("mine.txt", "must end in .gif or .mp4")):
        with pytest.raises(CoarticError, match=words):
            mine.animate(tmp_path / name)


def test_a_trajectory_where_the_hand_is_in_the_goal_has_no_row(tmp_path):
    idle = trajectory(tiny_task(goals=[[4.5, 0.1]]), [Movement(1, "right", "corrective")])
    assert (idle.configurations.shape, idle.hits.tolist()) == ((0, 10), [0])
    moved = trajectory(TASK, corrective_trial(TASK, "RR").movements)
    with pytest.raises(CoarticError, match="the film has no movement to draw"):
        write_film([("Idle", idle), ("Moved", moved)], tmp_path / "both.gif")
