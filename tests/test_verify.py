"""The check that imports nothing of coartic: it agrees with coartic, and finds what was edited."""

import json
import math
import re
import shutil
import sqlite3
import sys
import zlib
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import PAPER, load_task, move
from coartic.analysis import verify as checker
from coartic.motion.movement import follow
from coartic.robot import HANDS
from coartic.runs.store import RUNS_FILE
from tests.support.processes import python
from tests.support.strategies import STUCK, tiny_task, uneven_task
from tests.support.suites import KNOWN, cell_on, edit, edit_plan, moved, run_and_write


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
"""Its runs, by the ids of their results."""


def edited(true_folder, tmp_path, statement):
    """A copy in which somebody made a change by hand."""
    folder = shutil.copytree(true_folder, tmp_path / "edited")
    edit(folder, statement)
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
        assert f"{folder / RUNS_FILE}: it is damaged" in error
        assert error.count("\n") == 1


def test_nothing_is_wrong_with_what_was_not_edited(true_folder):
    report = checker.check_runs(true_folder)
    assert report.wrong == []
    assert (report.runs, report.movements > 30) == (6, True)
    assert report.unchecked[-1] == "Runs without a solution: 2."


def test_runs_that_the_plan_does_not_ask_for_are_counted(true_folder, tmp_path):
    folder = shutil.copytree(true_folder, tmp_path / "fewer")
    edit_plan(folder, "DELETE FROM plan WHERE position = 0")
    report = checker.check_runs(folder)
    assert (report.wrong, report.runs) == ([], 6)
    assert "should ask for 2 other runs, which no report shows" in report.unchecked[-1]


def result(run, change):
    """An edit of the row of a run, by the id of its result."""
    return run, f"UPDATE results SET {change} WHERE id = {run}"


def movement(run, change, part="solution", order=0):
    """An edit of one of its movements."""
    where = f"""WHERE result_id = {run} AND part = '{part}' AND "order" = {order}"""
    return run, f"UPDATE movements SET {change} {where}"


STANDING = f"path = '{[0.0] * 10}', ticks = 1"
EDITS = {  # what is said: of which run, and what was edited
    "reward is ": result(LEARNER, "reward = reward + 1"),
    "best_trial is ": result(LEARNER, "best_trial = 301"),
    "initial_reward is -": result(LEARNER, "initial_reward = -9"),
    "hands is RR, not LL": result(TINY, "hands = 'LL'"),
    "solution_corrections is 1": result(TINY, "solution_corrections = 2"),
    "other_arm_travel is": result(PATH, "other_arm_travel = 1e-8"),
    "status is timeout": result(TINY, "status = 'timeout', reward = NULL, hands = NULL"),
    "its cell is not there": (TINY, "DELETE FROM cells WHERE task = 'tiny'"),
    "of environments that is not there": (None, "UPDATE results SET environment = 99"),
    " ticks, not ": movement(LEARNER, f"path = {moved('$[7]', 0.02)}", order=1),
    "other_arm_travel": movement(OTHER, f"path = {moved('$[3]', 1e-4)}", order=1),
    "moves a locked base": movement(OTHER, f"path = {moved('$[1]', 0.02)}", part="replay"),
    "no number up to": movement(TINY, f"path = {moved('$[0]', 9e9)}"),
    "a joint or a trial": movement(OTHER, f"path = {moved('$[9]', 1e-9)}", part="replay"),
    "is no number": movement(TINY, "path = json_set(path, '$[0]', NULL)"),
    "not a number for each joint": movement(TINY, "path = json_remove(path, '$[0]')"),
    "has no such points": movement(TINY, "path = '[]'"),
    "goal 1 is not hit": movement(TINY, STANDING),
    "the left hand, which": movement(PATH, "hand = 'left'"),
    "has not one hand": movement(LEARNER, "goal = 2"),
    "out of order": (PATH, "UPDATE movements SET goal = 4 - goal WHERE kind = 'path'"),
    "which is no count": movement(OTHER, "ticks = ticks + 0.5"),
    "is made after goal 2": movement(TINY, "ticks = 1", order=1),
    "of no known kind": movement(TINY, "kind = 'magic'"),
    "movement 1 is missing": movement(TINY, 'ticks = 0, "order" = 7', order=1),
    "'other'": movement(TINY, "part = 'other'"),
    "path has no such points": movement(TINY, "kind = 'path'"),
    "planned has no such points": movement(PATH, "kind = 'planned'"),
    "solution is too long": movement(PATH, "path = path || hex(zeroblob(5000000))"),
    "too big": movement(PATH, "path = path || hex(zeroblob(6500000))"),
    "model were changed": (PATH, "UPDATE cells SET method = 'other' WHERE task = 'ascending'"),
    "its task is not": (PATH, "UPDATE cells SET task = 'descending' WHERE task = 'ascending'"),
    "that its id says": result(FAILED, "run = 60"),
    "its seed is not": result(TINY, "seed = seed + 1"),
    "at least 2 ticks, not 1": movement(TINY, "ticks = 1"),
    "no count up to": movement(TINY, "ticks = 1000000000"),
    "the rewards of its 300 trials are damaged": (
        LEARNER,
        f"UPDATE learning SET rewards = x'{zlib.compress(bytes(999)).hex()}'",
    ),
    "rewards of its 1 trials are damaged": (TINY, "UPDATE learning SET rewards = 'x'"),
    "the task is too long": (
        TINY,
        """UPDATE cells SET definition = json_set(definition,
        '$.title', hex(zeroblob(60000))) WHERE task = 'tiny'""",
    ),
    # Of no run: the tables and views through which others read the runs.
    "Two tasks are called tiny": (None, "UPDATE cells SET task = 'tiny' WHERE task = 'ascending'"),
    "Row 4 of table cells: its parameters are not": (
        None,
        "UPDATE cells SET setting = '' WHERE id = 4",
    ),
    # Of the plan: what it asks for is there.
    "asks for 6 runs, of which the folder has 5": (None, "DELETE FROM results WHERE id = 2"),
    "asks for 6 runs, of which the folder has 0": (None, "UPDATE suite SET seed = 1"),
    "asks for 7 runs, of which the folder has 6": (None, "UPDATE plan SET runs = 3 WHERE cell = 1"),
    **{
        f"The plan is not as it was written{' ' * number}": (None, statement)
        for number, statement in enumerate(
            (
                "DELETE FROM suite",
                "DELETE FROM plan WHERE position = 0",
                "UPDATE cells SET information = 'goals'",
                "UPDATE environments SET content = '{'",
            )
        )
    },
    "its packages are not": (None, "UPDATE environments SET packages = 'x'"),
}


@pytest.mark.parametrize("words", EDITS)
def test_an_edit_is_found(true_folder, tmp_path, monkeypatch, words):
    monkeypatch.setattr(checker, "LONGEST_VALUE", 12_000_000)
    run, statement = EDITS[words]
    with closing(sqlite3.connect(true_folder / RUNS_FILE)) as db:
        query = "SELECT max(run_id) FROM results WHERE id = ?"
        (run_id,) = db.execute(query, [run]).fetchone()
    report = checker.check_runs(edited(true_folder, tmp_path, statement))
    said = [*report.wrong, *report.unfinished]
    assert any((run_id or "") in sentence and words.strip() in sentence for sentence in said), said


def test_a_folder_that_was_begun_is_unfinished_and_not_wrong(true_folder, tmp_path):
    """As a command leaves it that is killed before its plan is there."""
    folder = edited(true_folder, tmp_path, "DELETE FROM plan")
    with closing(sqlite3.connect(folder / RUNS_FILE)) as db:
        for table in ("suite", "results", "movements", "learning", "cells", "environments"):
            db.execute(f"DELETE FROM {table}")
        db.commit()
    report = checker.check_runs(folder)
    assert report.wrong == []
    assert report.unfinished == ["It has no plan yet: repeat the `coartic run` command."]


def test_a_movement_of_endless_steps_is_made_as_far_as_its_ticks():
    task = checker.stored_task(
        tiny_task().model_dump_json(), json.dumps(PAPER.for_radius()._asdict())
    )
    task.model.step = 1e-12
    far = np.full((1, 10), 1e4)
    for kind in ("learned", "path"):
        _, ticks, hit = checker.make(task, task.q0, checker.MoveRow(0, 1, "right", kind, 7, far))
        assert (ticks, hit) == (8, False)


def test_the_command_says_what_it_found(true_folder, tmp_path, capsys, monkeypatch):
    wrong = edited(true_folder, tmp_path, "UPDATE results SET reward = -1 WHERE id = 1")
    endings = [
        (true_folder, "Nothing differs."),
        (wrong, "not -1"),
        (tmp_path, f"{tmp_path} cannot be read"),
    ]
    spoilt = {
        "PRAGMA user_version = 5": "its user_version is 5, and 6 in a file of coartic",
        "PRAGMA application_id = 7": "its application_id is 7, and",
        "UPDATE plan SET runs = 'x'": "cannot be read",
    }
    for number, (statement, words) in enumerate(spoilt.items()):
        folder = shutil.copytree(true_folder, tmp_path / str(number))
        with closing(sqlite3.connect(folder / RUNS_FILE, isolation_level=None)) as db:
            db.execute(statement)
        endings.append((folder, words))
    folder = shutil.copytree(true_folder, tmp_path / "schema")
    content = (folder / RUNS_FILE).read_bytes()
    (folder / RUNS_FILE).write_bytes(content.replace(b"CREATE TABLE", b"\xff" * 12))
    endings.append((folder, "cannot be read"))
    for code, (folder, words) in enumerate(endings):
        monkeypatch.setattr(sys, "argv", ["verify.py", str(folder)])
        assert checker.main() == min(code, 2), folder
        said = capsys.readouterr().out
        assert words in said
        assert code < 2 or said.count("\n") == 1


def test_a_file_that_a_killed_command_left_empty_is_unfinished(tmp_path):
    (tmp_path / RUNS_FILE).touch()
    report = checker.check_runs(tmp_path)
    assert (report.wrong, len(report.unfinished)) == ([], 1)


def test_it_stands_on_its_own():
    """A quarter of an hour's reading, and nothing of the project that it judges."""
    text = Path(checker.__file__).read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 440
    roots = set(re.findall(r"^ *(?:import|from) (\w+)", text, re.MULTILINE))
    assert roots <= {"numpy", *sys.stdlib_module_names}


@settings(max_examples=100)
@given(
    seed=st.integers(0, 2**32),
    hand=st.sampled_from(HANDS),
    kind=st.sampled_from(["learned", "corrective", "path"]),
    task=st.sampled_from([tiny_task(), uneven_task([0.1], [0.1] * 4)]),
    aim=st.tuples(st.floats(0, 1), st.sampled_from([-1, 0, 1])),
    scale=st.sampled_from([1e-3, 0.1, 1.0, 9e4]),
    step=st.sampled_from([0.01, 0.037]),
)
def test_a_movement_ends_as_in_coartic(seed, hand, kind, task, aim, scale, step):
    """Exactly, with a goal whose rim runs through a point of the movement, or a bit beside it; also
    where there is no way to go."""
    robot, on_path = task.robot, kind == "path"
    model = PAPER.for_radius()._replace(step=step * max(scale, 1.0))
    q, middle, target = np.random.default_rng(seed).uniform(-scale, scale, (3, robot.dof))
    target = q if aim[0] == 0.0 and not on_path else target
    judge = checker.stored_task(task.model_dump_json(), json.dumps(model._asdict()))
    points = checker.path(q, [middle, target], model) if on_path else checker.line(q, target, model)
    through = round(aim[0] * (len(points.T) - 1))
    x, y = (row[through] for row in checker.hand_at(points, judge.arms[hand], on_path))
    judge.goals[0] = goal = [x + 0.061, y - 0.083]
    radius = math.sqrt((goal[0] - x) ** 2 + (goal[1] - y) ** 2)
    judge.radius = np.nextafter(radius, radius + aim[1])
    if on_path:
        due = follow(robot, q, np.array([middle, target]), hand, goal, judge.radius, model=model)
    else:
        stops = kind == "learned"
        due = move(robot, q, target, hand, goal, judge.radius, stop_on_arrival=stops, model=model)
    corners = np.array([middle, target][not on_path :])
    movement = checker.MoveRow(0, 1, hand, kind, 10**6, corners)
    stopped, *rest = checker.make(judge, q, movement)
    assert ([*stopped], *rest) == ([*due.q], due.ticks, due.hit)


@pytest.mark.process
def test_a_folder_is_sound_under_another_kernel_of_blas(true_folder):
    """One without the fused operations that this machine's kernel has."""
    done = python(checker.__file__, true_folder, OPENBLAS_CORETYPE="Prescott")
    assert "Nothing differs" in done.stdout
