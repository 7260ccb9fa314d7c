"""The check that imports nothing of coartic: it agrees with coartic, and finds what was edited."""

import json
import math
import os
import re
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coartic import PAPER, Movement, execute, learn, load_task, move
from coartic.analysis import verify as checker
from coartic.benchmarks.outcome import result_of
from coartic.motion.movement import follow
from coartic.motion.solution import other_arm_travel
from coartic.robot import HANDS
from coartic.runs.plan import DeclaredMethod, Plan, PlannedCell
from coartic.runs.store import FILE, PARTS, RESULTS, Environment, Run, writing
from coartic.tasks.task import hands_of
from tests.support.strategies import tiny_task, uneven_task

NOWHERE = Environment({}, None, "")
NARROW = {5: {"other_arm": "still"}, 6: {"base": "y"}}


def corrected(*hands):
    return [Movement(goal, hand, "corrective") for goal, hand in enumerate(hands, 1)]


def along_paths(task):
    """Paths to where the corrective process would end, and beyond, by way of somewhere else."""
    reached = [task.q0, *execute(task, corrected(*["right"] * 3)).configurations]
    for goal, (before, after) in enumerate(pairwise(reached), 1):
        beyond, aside = after + 0.02 * (after - before), (before + after) / 2
        aside[3] += 0.1
        yield Movement(goal, "right", "path", waypoints=np.array([aside, beyond]))


def run_of(task, number, parts, **changes):
    """A run that made these movements, as it is stored."""
    row = {name: "" if "NOT NULL" in kind else None for name, kind in RESULTS.items()}
    row |= {"run": number, "seed": 0, "suite_seed": 0, "run_id": f"{task.name}-{number}"}
    done = {part: execute(task, movements) for part, movements in parts.items()}
    for part, own in done.items():
        row |= dict(zip(checker.COLUMNS[part], (own.reward, own.hands), strict=False))
    if own := done.get("solution"):
        travel = other_arm_travel(task, hands_of(own.hands), own.configurations)
        row |= {"solution_corrections": own.corrections, "other_arm_travel": travel}
    row |= {"status": "ok", "details": "{}"} | changes
    del row["setting"], row["environment"]
    row["result"] = result_of(row, {part: own.movements for part, own in done.items()}, [])
    return Run(row, NOWHERE, {part: own.movements for part, own in done.items()})


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A folder in which all is true: learners, corrections, paths, two searches, one failed."""
    folder = tmp_path_factory.mktemp("whole") / "results"
    two_armed, straight = load_task("two-armed-1"), load_task("ascending")
    tiny = tiny_task(goals=[[5.0, 1.0], [5.0, 0.98]])  # the second one is hit on the way
    learners = [learn(two_armed, "EC3", seed=seed, trials=300) for seed in range(2)]
    best = max(run.reward for run in learners)
    parts = [{part: getattr(run, part) for part in PARTS} for run in learners]
    solved, failed = {"solution": learners[0].solution}, {"status": "timeout", "proven_bound": -999}
    cells = [
        (two_armed, {}, [run_of(two_armed, number, own) for number, own in enumerate(parts)]),
        (tiny, {}, [run_of(tiny, 2, {"solution": corrected("right", "right")})]),
        (straight, {}, [run_of(straight, 3, {"solution": along_paths(straight)})]),
        (two_armed, {"other_arm": "free"}, [run_of(two_armed, 4, solved, proven_bound=best)]),
        *((two_armed, own, [run_of(two_armed, run, {}, **failed)]) for run, own in NARROW.items()),
    ]
    method = DeclaredMethod("", "", (), (), True, {}, "", "code")
    planned = [PlannedCell(task.name, "method", "", own, own, 7) for task, own, _ in cells]
    tasks = {task.name: task.model_dump(mode="json") for task, _, _ in cells}
    with writing(folder) as store:
        plan = Plan("suite", 0, 7, 300, (), None, None, tasks, {"method": method}, tuple(planned))
        store.ask(plan, NOWHERE, [], "")
        for position, (_, _, runs) in enumerate(cells):
            store.write(position, runs)
    return folder


def edited(whole, tmp_path, statement):
    """A copy in which somebody made a change by hand."""
    folder = shutil.copytree(whole, tmp_path / "edited")
    with closing(sqlite3.connect(folder / FILE)) as db:
        assert db.execute(statement).rowcount
        db.commit()
    return folder


def test_nothing_is_wrong_with_what_was_not_edited(whole):
    report = checker.verify(whole)
    assert report.wrong == []
    assert (report.runs, report.movements > 30) == (7, True)
    assert report.unchecked[-1] == "Runs without a solution: 2."


def of(run, part="solution", order=0):
    own = f"(SELECT id FROM results WHERE run = {run})"
    return f"""WHERE result_id = {own} AND part = '{part}' AND "order" = {order}"""


STANDING = "base_x = 0, base_y = 0, right_1 = 0, right_2 = 0, right_3 = 0, right_4 = 0, ticks = 1"
EDITS = {  # what is said: of which run, and what was edited
    "reward is ": (0, "UPDATE results SET reward = reward + 1 WHERE run = 0"),
    "hands is RR, not LL": (2, "UPDATE results SET hands = 'LL' WHERE run = 2"),
    "solution_corrections is 1": (2, "UPDATE results SET solution_corrections = 2 WHERE run = 2"),
    "other_arm_travel is": (3, "UPDATE results SET other_arm_travel = 1e-8 WHERE run = 3"),
    "status is ok": (5, "UPDATE results SET status = 'ok' WHERE run = 5"),
    "must be str": (2, "DELETE FROM settings WHERE task = 'tiny'"),
    " ticks, not ": (0, f"UPDATE movements SET right_2 = right_2 + 0.02 {of(0, order=1)}"),
    "other_arm_travel": (1, f"UPDATE movements SET left_2 = left_2 + 0.02 {of(1, order=1)}"),
    "moves a locked base": (1, f"UPDATE movements SET base_y = base_y + 0.02 {of(1, 'replay')}"),
    "no number up to": (2, f"UPDATE movements SET base_x = 9e9 {of(2)}"),
    "a joint or a trial": (1, f"UPDATE movements SET right_4 = right_4 + 1e-9 {of(1, 'replay')}"),
    "is no number": (2, f"UPDATE movements SET base_x = NULL {of(2)}"),
    "goal 1 is not hit": (2, f"UPDATE movements SET {STANDING} {of(2)}"),
    "the left hand, which": (3, f"UPDATE movements SET hand = 'left' {of(3)}"),
    "has not one hand": (0, f"UPDATE movements SET goal = 2 {of(0)}"),
    "out of order": (3, "UPDATE movements SET goal = 4 - goal WHERE kind = 'path'"),
    "which is no count": (1, f"UPDATE movements SET ticks = ticks + 0.5 {of(1)}"),
    "is made after goal 2": (2, f"UPDATE movements SET ticks = 1 {of(2, order=1)}"),
    "of no known kind": (2, f"UPDATE movements SET kind = 'magic' {of(2)}"),
    "movement 1 is missing": (2, f'UPDATE movements SET ticks = 0, "order" = 7 {of(2, order=1)}'),
    "'other'": (2, f"UPDATE movements SET part = 'other' {of(2)}"),
    "its last waypoint": (3, f"UPDATE movements SET right_1 = 1 {of(3)}"),
    "lacks a waypoint": (3, 'DELETE FROM waypoints WHERE "order" = 1 AND waypoint = 0'),
    "a path, and no other": (3, 'DELETE FROM waypoints WHERE "order" = 1'),
    "of no movement": (3, 'UPDATE waypoints SET "order" = 9 WHERE "order" = 1'),
    "better than bound": (4, "UPDATE results SET proven_bound = -999 WHERE run = 4"),
}


@pytest.mark.parametrize("words", EDITS)
def test_an_edit_is_found(whole, tmp_path, words):
    run, statement = EDITS[words]
    wrong = checker.verify(edited(whole, tmp_path, statement)).wrong
    assert any(f"-{run}" in sentence and words in sentence for sentence in wrong), wrong


def test_the_command_says_what_it_found(whole, tmp_path, capsys, monkeypatch):
    wrong = edited(whole, tmp_path, "UPDATE results SET reward = -1 WHERE run = 0")
    said = {
        whole: "Nothing differs.",
        wrong: "not -1",
        tmp_path: f"{tmp_path} cannot be read",
    }
    for code, (folder, words) in enumerate(said.items()):
        monkeypatch.setattr(sys, "argv", ["verify.py", str(folder)])
        assert checker.main() == code
        assert words in capsys.readouterr().out


def test_it_stands_on_its_own():
    """Ten minutes' reading, and nothing of the project that it judges."""
    text = Path(checker.__file__).read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 300
    roots = set(re.findall(r"^ *(?:import|from) (\w+)", text, re.MULTILINE))
    assert roots <= {"numpy", *sys.stdlib_module_names}


@settings(max_examples=200)
@given(
    seed=st.integers(0, 2**32),
    hand=st.sampled_from(HANDS),
    kind=st.sampled_from(["learned", "corrective", "path"]),
    task=st.sampled_from([tiny_task(), uneven_task([0.1], [0.1] * 4)]),
    aim=st.tuples(st.floats(0, 1), st.sampled_from([-1, 0, 1])),
    scale=st.sampled_from([1e-3, 0.1, 1.0, 9e4]),
    readings=st.fixed_dictionaries(
        {name: st.booleans() for name in ("corrective_arrival", "whole_last_step", "first_step")}
        | {"arrival_tick": st.sampled_from([0, 1]), "step": st.sampled_from([0.01, 0.037])}
    ),
)
def test_a_movement_ends_as_in_coartic(seed, hand, kind, task, aim, scale, readings):
    """Exactly, with a goal whose rim runs through a point of the movement, or a bit beside it."""
    robot, model, on_path = task.robot, PAPER._replace(**readings), kind == "path"
    model = model._replace(step=model.step * max(scale, 1.0))
    q, middle, target = np.random.default_rng(seed).uniform(-scale, scale, (3, robot.dof))
    own = checker.read_task(task.model_dump_json(), json.dumps(model._asdict()))
    points = checker.path(q, [middle, target], model) if on_path else checker.line(q, target, model)
    through = round(aim[0] * (len(points.T) - 1))
    x, y = (row[through] for row in checker.hand_at(points, own.arms[hand], on_path))
    own.goals[0] = goal = [x + 0.061, y - 0.083]
    radius = math.sqrt((goal[0] - x) ** 2 + (goal[1] - y) ** 2)
    own.radius = np.nextafter(radius, radius + aim[1])
    if on_path:
        due = follow(robot, q, np.array([middle, target]), hand, goal, own.radius, model=model)
    else:
        stops = {"stop_on_arrival": kind == "learned" or model.corrective_arrival}
        due = move(robot, q, target, hand, goal, own.radius, model=model, **stops)
    movement = checker.Movement(0, 1, hand, kind, 0, target, [middle, target])
    stopped, *rest = checker.make(own, q, movement)
    assert ([*stopped], *rest) == ([*due.q], due.ticks, due.hit)


@pytest.mark.parametrize("kernel", ["Haswell", "Prescott"])
def test_a_folder_is_sound_under_other_kernels_of_blas(whole, kernel):
    """As in another lab, whose processor has them."""
    command = [sys.executable, checker.__file__, whole]
    environment = {**os.environ, "OPENBLAS_CORETYPE": kernel}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, "Nothing differs" in done.stdout) == (0, True)
