"""The report's player: its JavaScript against the robot and the trajectories."""

import json
import shutil
import subprocess
from importlib.resources import files

import numpy as np
import pytest

from coartic import Movement, Robot, corrective_trial, load_task, trajectory
from coartic.analysis.report.player import (
    TOLERANCE,
    _movement,
    key_frames,
    nearest_to_median,
    player_json,
    rounding_unit,
)
from coartic.analysis.signatures.trajectories import Trajectories
from coartic.analysis.study import Study
from coartic.model import PAPER
from coartic.robot import HANDS
from tests.support.suites import run_and_write

# Reads tasks as the page does and says where everything is at every tick.
DRIVER = """
const player = require(process.argv[1]);
const data = JSON.parse(require("fs").readFileSync(0, "utf8"));
const played = data.tasks.map((task) => [...task.initials, ...task.movements].map((coded) => {
  const movement = player.decode(coded, task.unit, player.degrees(task.robot));
  const rows = [...Array(movement.rows.at(-1) + 1).keys()];
  return {
    points: rows.map((row) => {
      const { left, right } = player.arms(task.robot, player.configuration(movement, row));
      return [...left, ...right];
    }),
    moments: [...Array(movement.ticks + 3).keys()].map((spent) => player.moment(movement, spent)),
  };
}));
console.log(JSON.stringify(played));
"""


def play(data):
    if not shutil.which("node"):
        pytest.skip("node is not installed")
    script = files("coartic.analysis.report") / "player.js"
    done = subprocess.run(
        ["node", "-e", DRIVER, str(script)],
        input=json.dumps(data), capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def all_points(run):
    robot = run.task.robot
    return np.concatenate(
        [robot.joint_positions(run.configurations, hand) for hand in HANDS], axis=1
    )


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return Study(run_and_write(tmp_path_factory.mktemp("player")))


def test_javascript_plays_what_was_executed(study):
    data = json.loads(player_json(study))
    assert [task["name"] for task in data["tasks"]] == list(study.results.tasks)
    for task, played in zip(data["tasks"], play(data), strict=True):
        runs = [
            trajectory(
                study.results.tasks[task["name"]],
                corrective_trial(study.results.tasks[task["name"]], initial["hands"]).movements,
            )
            for initial in task["initials"]
        ]
        for movement in task["movements"]:
            key = (task["name"], movement["label"])
            index = list(study.cells[key].good.run_id).index(movement["run"])
            runs.append(study.trajectories[key].runs[index])
            assert -movement["ticks"] == study.cells[key].good.reward.iloc[index]
            first = study.cells[key].good.initial_reward.iloc[index]
            assert first in [-initial["ticks"] for initial in task["initials"]]
        assert len(runs) == len(played) > 1
        for run, shown in zip(runs, played, strict=True):
            points = np.array(shown["points"])
            off = np.linalg.norm(points - all_points(run), axis=2)
            assert off.shape[0] == run.ticks
            assert off.max() <= TOLERANCE
            check_moments(run, shown["moments"])


def check_moments(run, moments):
    """Reward, goals hit and hand after every number of ticks."""
    for spent, shown in enumerate(moments):
        ticks = min(spent, run.ticks)
        hit = int((run.hits + 1 <= ticks).sum())
        assert (shown["ticks"], shown["hit"]) == (ticks, hit)
        assert shown["row"] == max(ticks - 1, 0)
        assert shown.get("hand") == (run.hands[hit] if hit < len(run.hands) else None)
    assert moments[-1]["hit"] == len(run.hits)


def test_a_crooked_path_of_an_uneven_robot_is_followed():
    task = load_task("two-armed-1")
    robot = Robot(
        left_links=(1.5, 0.5), right_links=(0.7, 1.1, 0.9), left_shoulder=(-0.4, 0.2),
        right_shoulder=(0.6, -0.1), base_size=(1.2, 0.4),
    )  # fmt: skip
    start = task.start.model_copy(update={"left": (1.0, 0.5), "right": (0.2, 0.3, -0.4)})
    task = type(task).model_validate(
        {**task.model_dump(), "robot": robot, "start": start.model_dump(), "locked_base": ()}
    )
    generator = np.random.default_rng(4)
    waypoints = task.q0 + np.cumsum(generator.normal(0, 0.1, (60, robot.dof)), axis=0)
    movements = [Movement(1, "left", "path", waypoints[-1], waypoints=waypoints)]
    movements += [Movement(goal, "right", "corrective") for goal in range(2, 5)]
    run = trajectory(task, movements)
    unit = rounding_unit(robot)
    rows, frames = key_frames(run, unit)
    between = np.stack(
        [np.interp(np.arange(run.ticks), rows, joint) for joint in frames.T * unit], axis=1
    )
    drawn = np.concatenate([robot.joint_positions(between, hand) for hand in HANDS], axis=1)
    off = np.linalg.norm(drawn - all_points(run), axis=2).max()
    assert off <= TOLERANCE
    assert off > TOLERANCE / 10  # no finer than it need be
    assert len(rows) < run.ticks
    arms = {
        hand: {"shoulder": list(shoulder), "links": list(links)}
        for hand, shoulder, links in (
            ("left", robot.left_shoulder, robot.left_links),
            ("right", robot.right_shoulder, robot.right_links),
        )
    }
    coded = {
        "hands": run.execution.hands, "ticks": run.ticks, "hits": run.hits.tolist(),
        "rows": np.diff(rows, prepend=0).tolist(),
        "frames": np.diff(frames, axis=0, prepend=0).ravel().tolist(),
    }  # fmt: skip
    shown = play({"tasks": [{"robot": arms, "unit": unit, "initials": [], "movements": [coded]}]})[
        0
    ][0]
    np.testing.assert_allclose(shown["points"], drawn, atol=1e-9)
    check_moments(run, shown["moments"])


def test_without_a_tick_for_arrival_no_tick_shows_the_start():
    task, model = load_task("ascending"), PAPER._replace(arrival_tick=0)
    run = trajectory(task, corrective_trial(task, "RRR", model=model).movements, model)
    unit = rounding_unit(task.robot)
    arms = {
        hand: {"shoulder": getattr(task.robot, f"{hand}_shoulder"),
               "links": getattr(task.robot, f"{hand}_links")}
        for hand in HANDS
    }  # fmt: skip
    coded = _movement({}, run, unit)
    data = {"tasks": [{"robot": arms, "unit": unit, "initials": [], "movements": [coded]}]}
    ((shown,),) = play(data)
    for spent, moment in enumerate(shown["moments"]):
        ticks = min(spent, run.ticks)
        assert (moment["ticks"], moment["row"]) == (ticks, ticks)
        assert moment["hit"] == int((run.hits <= ticks).sum())
    assert (len(shown["points"]), shown["moments"][-1]["hit"]) == (run.ticks + 1, 3)


def test_a_straight_movement_needs_two_frames():
    run = trajectory(
        load_task("ascending"), corrective_trial(load_task("ascending"), "RRR").movements
    )
    rows, _ = key_frames(run, rounding_unit(run.task.robot))
    # Ends of three movements, the first row of each repeating the one before.
    assert len(rows) <= 6


@pytest.mark.parametrize(("ticks", "index"), [((9, 5, 7), 2), ((4, 8, 6, 5), 2), ((3,), 0)])
def test_the_run_nearest_the_median(ticks, index):
    class Run:
        def __init__(self, ticks):
            self.ticks = ticks

    assert nearest_to_median(Trajectories(None, "m", "", tuple(map(Run, ticks)))) == index


def test_the_same_study_gives_the_same_text(study):
    key = next(iter(study.trajectories))
    again = Study(study.results)
    assert player_json(study, [key]) == player_json(again, [key])
    (task,) = json.loads(player_json(study, [key]))["tasks"]
    assert [movement["label"] for movement in task["movements"]] == [key[1]]
    with pytest.raises(KeyError):
        player_json(study, [("ascending", "no-such-method")])
