"""The check that imports nothing of coartic: it agrees with coartic, and finds what was edited."""

import json
import math
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import PAPER, load_task, move
from coartic.analysis import verify as checker
from coartic.motion.doors import follow
from coartic.robot import HANDS
from coartic.runs.store import RUNS_FILE
from tests.support.processes import python
from tests.support.strategies import STUCK, tiny_task, uneven_task
from tests.support.suites import KNOWN, cell_on, edit, edit_movement, run_and_write
from tests.support.worlds import WORLDS


@pytest.fixture(scope="module")
def true_folder(tmp_path_factory):
    """A folder in which all is true: of corrections, a path, a learner, and one that fails."""
    tiny = tiny_task(goals=[[5.0, 1.0], [5.0, 0.98]])  # the second one is hit on the way
    cells = [
        cell_on(load_task("two-armed-1"), KNOWN["dual-process/EC3"]),
        cell_on(tiny, KNOWN["corrective-alone/given"]),
        cell_on(load_task("ascending"), KNOWN["posture-qp/current-goal"]),
        cell_on(STUCK, KNOWN["dual-process/EC1"], noise_sd=0.1),
    ]
    return run_and_write(tmp_path_factory.mktemp("true") / "results", cells, trials=300).folder


TINY, PATH, LEARNER, OTHER, FAILED = range(1, 6)
"""Its runs, in the order in which they were written."""


def edited(true_folder, tmp_path, change, *place):
    """A copy in which somebody made a change by hand: a statement, or a change of a movement of a
    run (:func:`edit_movement`)."""
    folder = shutil.copytree(true_folder, tmp_path / "edited")
    if callable(change):
        edit_movement(folder, *place[:1], change, *place[1:])
    else:
        edit(folder, change)
    return folder


def test_a_damaged_file_is_told_from_a_wrong_one(true_folder, tmp_path, coartic):
    """One with a page of zeros in a table or an index, or text that is no UTF-8."""
    whole, size = (true_folder / RUNS_FILE).read_bytes(), 4096
    pages = [at for at in range(size, len(whole), size) if whole[at] in b"\x02\x05\x0a\x0d"]
    damaged = [whole[:at] + bytes(size) + whole[at + size :] for at in pages]
    damaged += [whole.replace(text, b"\xff" * len(text)) for text in (b"right", b"tiny")]
    for number, content in enumerate(damaged):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / RUNS_FILE).write_bytes(content)
        code, out, error = coartic("verify", folder)
        assert (code, out) == (2, "")
        assert str(folder / RUNS_FILE) in error
        assert "it is damaged" in error
        assert error.count("\n") == 1


def test_nothing_is_wrong_with_what_was_not_edited(true_folder):
    report = checker.check_runs(true_folder)
    assert report.wrong == []
    assert (report.runs, report.movements > 30) == (6, True)


def test_runs_that_the_plan_does_not_ask_for_are_checked(true_folder, tmp_path):
    folder = shutil.copytree(true_folder, tmp_path / "fewer")
    edit(folder, "UPDATE cells SET runs = NULL WHERE position = 0")
    report = checker.check_runs(folder)
    assert (report.wrong, report.unfinished, report.runs) == ([], [], 6)


def result(run, change):
    """An edit of the row of a run."""
    return (f"UPDATE results SET {change} WHERE rowid = {run}",)


def put(entry, value):
    """A change of a movement: of an entry, or by ``(4, joint)`` of a joint of its path."""

    def change(movement):
        if isinstance(entry, tuple):
            movement[4][entry[1]] += value
        else:
            movement[entry] = value

    return change


def stand(movement):
    movement[3:] = 1, [0.0] * 10


EDITS = {  # what is said, and what was edited
    "reward is ": result(LEARNER, "reward = reward + 1"),
    "initial_reward is -": result(LEARNER, "initial_reward = -9"),
    "solution_corrections is 1": result(TINY, "solution_corrections = 2"),
    "other_arm_travel is": result(PATH, "other_arm_travel = 1e-8"),
    "status is timeout": result(TINY, "status = 'timeout', reward = NULL, hands = NULL"),
    "its cell is missing": ("DELETE FROM cells WHERE task = 'tiny'",),
    " ticks, not ": (put((4, 7), 0.02), LEARNER, "solution", 1),
    "other_arm_travel": (put((4, 3), 1e-4), OTHER, "solution", 1),
    "moves a locked base": (put((4, 1), 0.02), OTHER, "replay"),
    "a joint or a trial": (put((4, 9), 1e-9), OTHER, "replay"),
    "goal 1 is not hit": (stand, TINY),
    "the task has no left hand": (put(1, "left"), PATH),
    "its goals are [3, ": (put(0, 3), PATH),
    "is made after goal 2": (put(3, 1), TINY, "solution", 1),
    "that its id says ": (
        "UPDATE cells SET content = json_set(content, '$.task.radius', 0.2) WHERE task = 'tiny'",
    ),
    "that its id says": result(FAILED, "run = 60"),
    "its seed is another": result(TINY, "seed = seed + 1"),
    "listed as a run of ('tiny', 'mine', '', '')": (
        "UPDATE cells SET method = 'mine' WHERE task = 'tiny'",
    ),
    "not of ('stuck', 'dual-process/EC1', 'noise_sd=0.1', '')": (
        "UPDATE cells SET setting = '' WHERE task = 'stuck'",
    ),
    "rewards of more or fewer trials": result(LEARNER, "trials = trials - 1"),
    # Of the plan: what it asks for is there.
    "asks for 6 runs, of which the folder has 5": ("DELETE FROM results WHERE rowid = 2",),
}


@pytest.mark.parametrize("words", EDITS)
def test_an_edit_is_found(true_folder, tmp_path, words):
    report = checker.check_runs(edited(true_folder, tmp_path, *EDITS[words]))
    said = [*report.wrong, *report.unfinished]
    assert any(words.strip() in sentence for sentence in said), said


def test_the_program_says_what_it_found(true_folder, tmp_path, capsys, monkeypatch):
    wrong = edited(true_folder, tmp_path, *result(TINY, "reward = -1"))
    for code, (folder, words) in enumerate([(true_folder, "Nothing differs."), (wrong, "not -1")]):
        monkeypatch.setattr(sys, "argv", ["verify.py", str(folder)])
        assert checker.main() == code
        assert words in capsys.readouterr().out


def test_it_stands_on_its_own():
    """A quarter of an hour's reading, and nothing of the project that it judges."""
    text = Path(checker.__file__).read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 336
    roots = set(re.findall(r"^ *(?:import|from) (\w+)", text, re.MULTILINE))
    assert roots <= {"numpy", *sys.stdlib_module_names}


@settings(max_examples=50)
@given(
    seed=st.integers(0, 2**32),
    hand=st.sampled_from(HANDS),
    kind=st.sampled_from(["learned", "corrective", "path"]),
    task=st.sampled_from([tiny_task(), uneven_task([0.1], [0.1] * 4)]),
    aim=st.tuples(st.floats(0, 1), st.sampled_from([-1, 0, 1])),
    scale=st.sampled_from([1e-3, 0.1, 1.0, 9e3]),
    step=st.sampled_from([0.01, 0.037]),
    world=st.sampled_from(WORLDS),
    block=st.sampled_from([1, 3, 2**16]),
)
def test_a_movement_ends_as_in_coartic(seed, hand, kind, task, aim, scale, step, world, block):
    """Exactly, with a goal whose rim runs through a point of the movement, or a bit beside it; also
    where there is no way to go."""
    robot, on_path = task.robot, kind == "path"
    length = {"norm": world.norm, "base_weight": world.base_weight}
    model = PAPER.for_radius()._replace(step=step * max(scale, 1.0), **length)
    q, middle, target = np.random.default_rng(seed).uniform(-scale, scale, (3, robot.dof))
    target = q if aim[0] == 0.0 and not on_path else target
    content = {"task": task.model_dump(mode="json"), "model": model._asdict()}
    content |= {"method": {"name": "", "defaults": {}}, "parameters": {}}
    judge = checker.stored_task(json.dumps(content))
    points = (
        checker.path(q, [middle, target], model)
        if on_path
        else checker.straight_path_points(q, target, model)
    )
    through = round(aim[0] * (len(points.T) - 1))
    x, y = (row[through] for row in checker.hand_at(points, judge.arms[hand]))
    judge.goals[0] = goal = [x + 0.061, y - 0.083]
    radius = math.sqrt((goal[0] - x) ** 2 + (goal[1] - y) ** 2)
    judge.radius = np.nextafter(radius, radius + aim[1])
    if on_path:
        due = follow(robot, q, np.array([middle, target]), hand, goal, judge.radius, model=model)
    else:
        stops = kind == "learned"
        due = move(robot, q, target, hand, goal, judge.radius, stop_on_arrival=stops, model=model)
    corners = np.array([middle, target][not on_path :])
    with pytest.MonkeyPatch.context() as patch:  # also if a movement is made in parts
        patch.setattr(checker, "BLOCK", max(block, len(points.T) // 50))
        stopped, *rest = checker.make(judge, q, 1, hand, kind, corners)
    assert ([*stopped], *rest) == ([*due.q], due.ticks, due.hit)


@pytest.mark.process
def test_a_folder_is_sound_under_another_kernel_of_blas(true_folder):
    """One without the fused operations that this machine's kernel has."""
    done = python(checker.__file__, true_folder, OPENBLAS_CORETYPE="Prescott")
    assert "Nothing differs" in done.stdout
