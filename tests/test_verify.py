"""The check that imports nothing of coartic: it agrees with coartic, and finds what was edited."""

import json
import math
import re
import shutil
import sqlite3
import sys
import zlib
from contextlib import closing
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import PAPER, Movement, execute, learn, load_task, move
from coartic.analysis import verify as checker
from coartic.motion.movement import follow
from coartic.motion.solution import other_arm_travel
from coartic.robot import HANDS
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Cell, Job
from coartic.runs.record import PARTS, Outcome, Run, Score
from coartic.runs.store import RUNS_FILE, writing
from coartic.tasks.task import hands_of
from tests.support.processes import python
from tests.support.strategies import tiny_task, uneven_task
from tests.support.suites import edit, edit_plan, moved


def corrected(*hands):
    return [Movement(goal, hand, "corrective") for goal, hand in enumerate(hands, 1)]


def along_paths(task):
    """Paths to where the corrective process would end, and beyond, by way of somewhere else."""
    reached = [task.q0, *execute(task, corrected(*["right"] * 3)).configurations]
    for goal, (before, after) in enumerate(pairwise(reached), 1):
        beyond, aside = after + 0.02 * (after - before), (before + after) / 2
        aside[3] += 0.1
        yield Movement(goal, "right", "path", waypoints=np.array([aside, beyond]))


def run_of(job, number, parts, status="ok"):
    """A run that made these movements, as it is stored."""
    task = job.cell.task
    done = {part: execute(task, movements) for part, movements in parts.items()}
    scores = {part: Score(e.reward, e.hands, e.movements) for part, e in done.items()}
    if solution := done.get("solution"):
        travel = other_arm_travel(task, hands_of(solution.hands), solution.configurations)
        scores["solution"] = scores["solution"]._replace(
            corrections=solution.corrections, other_arm_travel=travel
        )
    outcome = Outcome(status, environment={})
    return Run(replace(job, numbers=(number,)), outcome, scores, "")


@pytest.fixture(scope="module")
def true_folder(tmp_path_factory):
    """A folder in which all is true: learners, corrections, paths, and two runs that failed."""
    folder = tmp_path_factory.mktemp("true") / "results"
    two_armed, straight = load_task("two-armed-1"), load_task("ascending")
    tiny = tiny_task(goals=[[5.0, 1.0], [5.0, 0.98]])  # the second one is hit on the way
    learners = [learn(two_armed, "EC3", seed=seed, trials=300) for seed in range(2)]
    parts = [{part: getattr(run, part) for part in PARTS} for run in learners]
    solved, failed = {"solution": learners[0].solution}, {"status": "timeout"}
    asked = [
        (two_armed, {}, [(number, movements, {}) for number, movements in enumerate(parts)]),
        (tiny, {}, [(0, {"solution": corrected("right", "right")}, {})]),
        (straight, {}, [(0, {"solution": along_paths(straight)}, {})]),
        (two_armed, {"other_arm": "free"}, [(0, solved, {})]),
    ]
    asked += [(two_armed, {"other": number}, [(0, {}, failed)]) for number in range(2)]
    method = MethodInfo("method", "", "", (), True, {}, "", "code")
    plan = [
        Job(Cell(task, method, each), 0, range(len(runs)), suite="suite")
        for task, each, runs in asked
    ]
    with writing(folder) as store:
        store.replace_plan(plan, {"command": [], "date": ""})
        for job, (_, _, runs) in zip(plan, asked, strict=True):
            store.write(run_of(job, number, made, **more) for number, made, more in runs)
    return folder


def edited(true_folder, tmp_path, statement):
    """A copy in which somebody made a change by hand."""
    folder = shutil.copytree(true_folder, tmp_path / "edited")
    edit(folder, statement)
    return folder


@pytest.mark.parametrize("damage", ["zeros", "no UTF-8"])
def test_a_damaged_file_is_told_from_a_wrong_one(true_folder, tmp_path, coartic, damage):
    whole, size = (true_folder / RUNS_FILE).read_bytes(), 4096
    if damage == "zeros":
        starts = range(size, len(whole), 2 * size)
        damaged = [whole[:at] + bytes(size) + whole[at + size :] for at in starts]
    else:
        damaged = [whole.replace(text, b"\xff" * len(text)) for text in (b"right", b"tiny")]
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
    assert (report.runs, report.movements > 30) == (7, True)
    assert report.unchecked[-1] == "Runs without a solution: 2."


def test_runs_that_the_plan_does_not_ask_for_are_counted(true_folder, tmp_path):
    folder = shutil.copytree(true_folder, tmp_path / "fewer")
    edit_plan(folder, "DELETE FROM plan WHERE position = 0")
    report = checker.check_runs(folder)
    assert (report.wrong, report.runs) == ([], 7)
    assert "should ask for 2 other runs, which no report shows" in report.unchecked[-1]


def result(run, change):
    """An edit of the row of a run, by its place among the runs."""
    return run, f"UPDATE results SET {change} WHERE id = {run + 1}"


def movement(run, change, part="solution", order=0):
    """An edit of one of its movements."""
    where = f"""WHERE result_id = {run + 1} AND part = '{part}' AND "order" = {order}"""
    return run, f"UPDATE movements SET {change} {where}"


STANDING = f"path = '{[0.0] * 10}', ticks = 1"
EDITS = {  # what is said: of which run, and what was edited
    "reward is ": result(0, "reward = reward + 1"),
    "best_trial is ": result(0, "best_trial = 301"),
    "hands is RR, not LL": result(2, "hands = 'LL'"),
    "solution_corrections is 1": result(2, "solution_corrections = 2"),
    "other_arm_travel is": result(3, "other_arm_travel = 1e-8"),
    "status is timeout": result(2, "status = 'timeout', reward = NULL, hands = NULL"),
    "its cell is not there": (2, "DELETE FROM cells WHERE task = 'tiny'"),
    "of environments that is not there": (None, "UPDATE results SET environment = 99"),
    " ticks, not ": movement(0, f"path = {moved('$[7]', 0.02)}", order=1),
    "other_arm_travel": movement(1, f"path = {moved('$[3]', 0.02)}", order=1),
    "moves a locked base": movement(1, f"path = {moved('$[1]', 0.02)}", part="replay"),
    "no number up to": movement(2, f"path = {moved('$[0]', 9e9)}"),
    "a joint or a trial": movement(1, f"path = {moved('$[9]', 1e-9)}", part="replay"),
    "is no number": movement(2, "path = json_set(path, '$[0]', NULL)"),
    "not a number for each joint": movement(2, "path = json_remove(path, '$[0]')"),
    "has no such points": movement(2, "path = '[]'"),
    "goal 1 is not hit": movement(2, STANDING),
    "the left hand, which": movement(3, "hand = 'left'"),
    "has not one hand": movement(0, "goal = 2"),
    "out of order": (3, "UPDATE movements SET goal = 4 - goal WHERE kind = 'path'"),
    "which is no count": movement(1, "ticks = ticks + 0.5"),
    "is made after goal 2": movement(2, "ticks = 1", order=1),
    "of no known kind": movement(2, "kind = 'magic'"),
    "movement 1 is missing": movement(2, 'ticks = 0, "order" = 7', order=1),
    "'other'": movement(2, "part = 'other'"),
    "path has no such points": movement(2, "kind = 'path'"),
    "planned has no such points": movement(3, "kind = 'planned'"),
    "movement 0 is too long": movement(3, "path = path || hex(zeroblob(6000000))"),
    "model were changed": (3, "UPDATE cells SET method = 'other' WHERE task = 'ascending'"),
    "its task is not": (3, "UPDATE cells SET task = 'descending' WHERE task = 'ascending'"),
    "that its id says": result(6, "run = 60"),
    "its seed is not": result(2, "seed = seed + 1"),
    "at least 2 ticks, not 1": movement(2, "ticks = 1"),
    "no count up to": movement(2, "ticks = 1000000000"),
    "the rewards of its None trials are damaged": (
        0,
        f"INSERT INTO learning VALUES (1, x'{zlib.compress(bytes(8)).hex()}')",
    ),
    "rewards of its None trials are damaged": (0, "INSERT INTO learning VALUES (1, 'x')"),
    "the task is too long": (
        2,
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
    "asks for 7 runs, of which the folder has 6": (None, "DELETE FROM results WHERE id = 2"),
    "asks for 7 runs, of which the folder has 0": (None, "UPDATE suite SET seed = 1"),
    "asks for 9 runs, of which the folder has 7": (None, "UPDATE plan SET runs = 4 WHERE runs = 2"),
    **{
        f"The plan is not as it was written{' ' * number}": (None, statement)
        for number, statement in enumerate(
            (
                "DELETE FROM suite",
                "UPDATE suite SET name = NULL",
                "DELETE FROM plan WHERE position = 0",
                "UPDATE plan SET runs = 0 WHERE position = 0",
                "UPDATE cells SET information = 'goals'",
                "UPDATE environments SET content = '{'",
            )
        )
    },
    "its packages are not": (None, "UPDATE environments SET packages = 'x'"),
    "Tables or views are not": (None, "ALTER TABLE learning ADD COLUMN base_x REAL"),
    "ables or views are not": (None, "DROP VIEW solutions"),
}


@pytest.mark.parametrize("words", EDITS)
def test_an_edit_is_found(true_folder, tmp_path, words):
    run, statement = EDITS[words]
    with closing(sqlite3.connect(true_folder / RUNS_FILE)) as db:
        query = "SELECT max(run_id) FROM results WHERE id = ? + 1"
        (run_id,) = db.execute(query, [run]).fetchone()
    wrong = checker.check_runs(edited(true_folder, tmp_path, statement)).wrong
    assert any((run_id or "") in sentence and words.strip() in sentence for sentence in wrong), (
        wrong
    )


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
    for code, (folder, words) in enumerate(endings):
        monkeypatch.setattr(sys, "argv", ["verify.py", str(folder)])
        assert checker.main() == code
        assert words in capsys.readouterr().out


def test_it_stands_on_its_own():
    """A quarter of an hour's reading, and nothing of the project that it judges."""
    text = Path(checker.__file__).read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 420
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
