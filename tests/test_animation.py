"""Films of stored runs: what a frame shows, how long it stands, and what is refused."""

import itertools
import os
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib import rc_context
from PIL import Image

from coartic import (
    PAPER,
    CoarticError,
    Movement,
    corrective_trial,
    execute,
    initial_hands,
    load_task,
    trajectory,
)
from coartic.analysis.figures.animation import Panel, _figure, animate, timing
from coartic.analysis.figures.robot import MARKERS
from coartic.benchmarks.registry import registry
from coartic.benchmarks.reproduce import trajectory_of
from coartic.benchmarks.store import Store
from coartic.benchmarks.suites import Cell
from coartic.codec import decode, encode, lines
from coartic.scores import solved
from tests.support.commands import call
from tests.support.packs import pack_of
from tests.support.suites import BROKEN, run_and_write

TASK = load_task("two-armed-1")


def initial(task):
    return trajectory(task, corrective_trial(task, initial_hands(task)).movements)


@pytest.fixture(scope="module")
def moves():
    return initial(TASK)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two learned runs, a path, and one that failed; with its ids by method."""
    known = registry([BROKEN])
    cells = [Cell(TASK, known["dual-process/EC3"])]
    cells += [
        Cell(load_task("ascending"), known[name])
        for name in ("dual-process/EC1", "nullspace-qp/none", "test/unexecutable")
    ]
    found = run_and_write(tmp_path_factory.mktemp("runs"), cells, runs=1, trials=30)
    return found.folder, found.runs.set_index("method").run_id.to_dict()


def test_timing():
    for ticks, speed in itertools.product((1, 2, 7, 125, 319, 500, 670, 5000), (None, 1, 60, 900)):
        timed = timing(ticks, speed)
        rows = np.array(timed.rows)
        assert (rows[0], rows[-1]) == (0, ticks - 1)
        assert set(np.diff(rows[:-1])) <= {timed.stride}
        assert ((np.diff(rows) > 0) & (np.diff(rows) <= timed.stride)).all()
        assert round(100 * timed.interval_s) == pytest.approx(100 * timed.interval_s)
        assert timed.interval_s >= 0.02
        shown = timed.stride / timed.interval_s  # ticks per second
        if speed:
            assert shown == pytest.approx(speed, rel=0.07)
        if timed.interval_s < 1:
            assert timed.held * timed.interval_s == pytest.approx(2.0, abs=timed.interval_s)
    for ticks in range(300, 671):
        timed = timing(ticks)
        assert 8 < len(timed.rows) * timed.interval_s < 12


def test_a_frame_shows_the_robot_at_its_tick(moves):
    figure, (scene,) = _figure([Panel("x", moves)], 400)
    (axes,) = figure.axes
    for row in (0, *moves.hits, moves.hits[1] - 1, moves.ticks - 1, moves.ticks + 50):
        scene.show(row)
        at = min(row, moves.ticks - 1)
        q = moves.configurations[at]
        base, *goals = axes.patches
        assert np.array_equal(base.get_xy()[:4], TASK.robot.base_outline(q))
        filled = [goal.get_facecolor()[3] == 1 for goal in goals]
        assert filled == [hit <= at for hit in moves.hits]
        arms = {line.get_marker(): line for line in axes.lines if line.get_marker() in "so"}
        for hand in ("left", "right"):
            arm = arms[MARKERS[hand]["marker"]]
            assert np.array_equal(arm.get_xydata(), TASK.robot.joint_positions(q, hand))
        text = axes.texts[-1].get_text()
        assert text.startswith(f"reward −{at + 1} ")
        assert text.endswith("done") == all(filled)
    scene.show(moves.ticks)
    assert axes.texts[-1].get_text().startswith(f"reward −{-moves.execution.reward} ")


def test_without_a_tick_for_arrival_the_start_costs_nothing():
    model = PAPER._replace(arrival_tick=0)
    alone = corrective_trial(TASK, "RRRR", model=model)
    shown = trajectory(TASK, alone.movements, model)
    figure, (scene,) = _figure([Panel("x", shown)], 400)
    (axes,) = figure.axes
    for row, spent in ((0, "0"), (1, "−1"), (shown.ticks, f"−{-alone.reward}")):
        scene.show(row)
        assert axes.texts[-1].get_text().startswith(f"reward {spent} ")
        base = axes.patches[0].get_xy()[:4]
        assert np.array_equal(base, TASK.robot.base_outline(shown.configurations[row]))
    assert axes.texts[-1].get_text().endswith("done")
    assert np.array_equal(shown.configurations[0], TASK.q0)


def test_nothing_leaves_the_picture(moves):
    other = initial(load_task("ascending"))
    figure, scenes = _figure([Panel("a", moves), Panel("b", other)], 600)
    for axes, shown in zip(figure.axes, (moves, other), strict=True):
        left, right = axes.get_xlim()
        low, high = axes.get_ylim()
        for hand in shown.task.hands:
            points = shown.task.robot.joint_positions(shown.configurations, hand).reshape(-1, 2)
            assert ((left < points[:, 0]) & (points[:, 0] < right)).all()
            assert ((low < points[:, 1]) & (points[:, 1] < high)).all()
    assert figure.axes[0].get_xlim() == figure.axes[1].get_xlim()
    assert len(scenes) == 2


def test_gif(moves, tmp_path):
    panels = [Panel("a", moves), Panel("b", initial(load_task("ascending")))]
    timed = animate(panels, tmp_path / "a.gif", speed=2000, width=300)
    animate(panels, tmp_path / "b.gif", speed=2000, width=300)
    assert (tmp_path / "a.gif").read_bytes() == (tmp_path / "b.gif").read_bytes()
    with Image.open(tmp_path / "a.gif") as film:
        assert film.width == 300
        durations = []
        for frame in range(film.n_frames):
            film.seek(frame)
            durations.append(film.info["duration"])
    assert len(durations) == len(timed.rows) >= moves.ticks / timed.stride
    assert set(durations[:-1]) == {round(1000 * timed.interval_s)}
    assert 2000 <= durations[-1] <= 2000 + 2000 * timed.interval_s


def test_mp4_goes_to_ffmpeg(moves, tmp_path, capfd):
    """Every frame, with even sides, through a program that keeps what it is given."""
    fake = tmp_path / "ffmpeg"
    fake.write_text('#!/bin/sh\nfor out; do :; done\necho "$@" >"$0.args"\ncat >"$out"\n')
    fake.chmod(0o755)
    with rc_context({"animation.ffmpeg_path": str(fake)}):
        timed = animate([Panel("a", moves)], tmp_path / "a.mp4", speed=2000, width=301)
    words = (tmp_path / "ffmpeg.args").read_text().split()
    width, height = map(int, words[words.index("-s") + 1].split("x"))
    assert (width % 2, height % 2) == (0, 0)
    frames = len(timed.rows) + timed.held
    assert (tmp_path / "a.mp4").stat().st_size == frames * width * height * 4
    assert float(words[words.index("-framerate") + 1]) == pytest.approx(1 / timed.interval_s)
    fake.write_text("#!/bin/sh\ncat >/dev/null\necho no such codec >&2\nexit 1\n")
    with (
        rc_context({"animation.ffmpeg_path": str(fake)}),
        pytest.raises(CoarticError, match="ffmpeg failed: .*no such codec"),
    ):
        animate([Panel("a", moves)], tmp_path / "b.mp4", speed=2000, width=300)
    assert sorted(os.listdir(tmp_path)) == ["a.mp4", "ffmpeg", "ffmpeg.args"]


def test_a_record_gives_its_own_trajectory(folder):
    place, ids = folder
    store = Store(place)
    for method in ("dual-process/EC3", "dual-process/EC1", "nullspace-qp/none"):
        record = store.read(ids[method])
        found = trajectory_of(record)
        assert -found.ticks == record.solution.reward
        assert found.execution.hands == record.solution.hands
    with pytest.raises(CoarticError, match="has no solution to show: solver-failed"):
        trajectory_of(store.read(ids["test/unexecutable"]))


def test_a_path_is_followed_from_its_waypoints(folder):
    """A detour: the corrective solution of goal 1, by way of another posture."""
    task = load_task("ascending")
    ends = corrective_trial(task, "RRR").configurations
    detour = task.q0 + 0.2
    movements = [
        Movement(1, "right", "path", waypoints=np.array([detour, ends[0]])),
        *(Movement(k, "right", "planned", ends[k - 1]) for k in (2, 3)),
    ]
    place, ids = folder
    record = Store(place).read(ids["nullspace-qp/none"])
    record = record.model_copy(update={"solution": solved(task, movements, PAPER)})
    found = trajectory_of(
        next(decode(line) for pack in encode([record]) for line in lines(pack)[0])
    )
    assert found.ticks == -record.solution.reward == -execute(task, movements).reward
    assert np.abs(found.configurations - detour).max(axis=1).min() < 0.01


def test_command(folder, tmp_path, monkeypatch, capsys):
    place, ids = folder
    one, other = ids["dual-process/EC3"], ids["dual-process/EC1"]
    out = tmp_path / "a.gif"
    fast = ("--in", place, "--out", out, "--speed", 3000, "--width", 240)
    code, text, _ = call(monkeypatch, capsys, "animate", one[:9], other, *fast)
    assert code == 0
    assert text.startswith(
        "two-armed-1: dual-process/EC3, run 0 beside ascending: dual-process/EC1, run 0 in"
    )
    with Image.open(out) as film:
        assert film.width == 240
    before = out.read_bytes()
    code, _, error = call(monkeypatch, capsys, "animate", one, "--initial", *fast)
    assert (code, out.read_bytes()) == (2, before)
    assert f"{out} is there already; add --replace to write over it" in error
    code, text, _ = call(monkeypatch, capsys, "animate", one, "--initial", *fast, "--replace")
    assert code == 0
    assert out.read_bytes() != before
    out = tmp_path / "b.gif"
    assert text.startswith("two-armed-1: initial solution beside two-armed-1: dual-process/EC3")
    broken = tmp_path / "damaged" / "records"
    broken.mkdir(parents=True)
    pack = pack_of(place, one)
    (broken / pack.name).write_bytes(pack.read_bytes()[:-9])
    with rc_context({"animation.ffmpeg_path": str(tmp_path / "no-ffmpeg")}):
        for arguments, words in (
            (("abcdef", "--in", place, "--out", out), "no run 'abcdef' below"),
            ((one, "abcdef", "--in", place, "--out", out), "no run 'abcdef' below"),
            ((one, "--in", tmp_path / "nowhere", "--out", out), "no run"),
            ((one, "--in", place, "--out", "a.png"), "must end in .gif, .mp4, .svg"),
            ((one, "--in", place, "--out", "a.mp4"), "MP4 needs ffmpeg; install it, or"),
            ((one, "--in", place, "--out", "/dev/null/a.gif"), "cannot write /dev/null/a.gif"),
            ((one, other, "--initial", "--in", place, "--out", out), "give one run id"),
            ((ids["test/unexecutable"], "--in", place, "--out", out), "has no solution to show"),
            ((one, "--in", broken.parent, "--out", out), "is damaged"),
            ((one, "--in", place, "--out", out, "--speed", 0), "Invalid value for '--speed'"),
        ):
            before = sorted(os.listdir(tmp_path))
            code, _, error = call(monkeypatch, capsys, "animate", *arguments)
            assert code == 2, arguments
            assert words in " ".join(error.replace("│", " ").split())
            assert sorted(os.listdir(tmp_path)) == before


def test_a_moving_picture(moves, tmp_path):
    """Its frames are the film's: base, arms and goals where they are, at the time they are."""
    timed = animate([Panel("<here> & there", moves)], tmp_path / "a.svg", speed=300, width=400)
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    assert root[0].text == "<here> & there"
    drawn = {kind: root.findall(f".//*[@class='{kind}']") for kind in ("base", "arm", "goal")}
    assert {kind: len(found) for kind, found in drawn.items()} == {"base": 1, "arm": 2, "goal": 4}
    frames = len(timed.rows) + timed.held
    for element in (*drawn["base"], *drawn["arm"]):
        values = element[0].get("values").split(";")
        assert len(values) == frames
        assert values[-1] == element.get("points")  # the end, where nothing moves
    q = moves.configurations[-1]
    joints = moves.task.robot.joint_positions(q, "right")
    shown = np.array([point.split(",") for point in drawn["arm"][1].get("points").split()], float)
    scale = np.ptp(shown[:, 0]) / np.ptp(joints[:, 0])
    assert shown[:, 0] - shown[0, 0] == pytest.approx(
        scale * (joints[:, 0] - joints[0, 0]), abs=0.2
    )
    assert shown[:, 1] - shown[0, 1] == pytest.approx(
        scale * (joints[0, 1] - joints[:, 1]), abs=0.2
    )
    hit = [float(goal[0].get("keyTimes").split(";")[1]) for goal in drawn["goal"]]
    rows = np.array([*timed.rows, *timed.rows[-1:] * timed.held])
    for when, row in zip(hit, moves.hits, strict=True):
        first = round(when * frames)
        assert rows[first] >= row
        assert first == 0 or rows[first - 1] < row
