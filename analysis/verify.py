"""Check a results folder: execute every stored solution again.

It needs Python and NumPy, and nothing of coartic. ``python verify.py FOLDER`` opens
``FOLDER/runs.sqlite`` and checks of every run that its solution (and of a learner its first trial
and its replay) keeps the rules, hits every goal, and has the stored ticks, reward and hands, and
the solution the stored corrections and travel of the other arm; by a hash, that no joint and no
trial was changed since; by its id and its seed, that it is of its task, method and parameters; and
that the tables and views through which reports read all this are coartic's.

The rules (Shah, Barto & Fagg 2013, *A Dual Process Account of Coarticulation in Motor Skill
Acquisition*): A robot, a mobile base with two arms, hits goals with its hands, in their order. A
configuration q holds x and y of the base, then the angles of the left arm and of the right arm. A
movement goes from q straight to a target q^t in steps of length m; its last step, often shorter,
ends at q^t. Before each step the robot looks. It stops if its hand is within the radius of the
goal (a hit); in a learned or planned movement, also if its hand is within θ^a of where q^t would
put it (arrival). k steps cost k ticks, and stopping costs one. The reward is minus all ticks. Each
goal has one hand. The first movement for a goal, unless corrective, is always made, the others only
while the goal is not hit. A path leads through waypoints and stops on a hit or at its end. The
targets of corrective movements are stored; the corrective process is not run again.
"""

from __future__ import annotations

import hashlib
import json
import math
import sqlite3
import sys
import zlib
from collections.abc import Iterator
from contextlib import closing
from itertools import chain
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
DATABASE = "runs.sqlite?mode=rw"  # SQLite checks no values of a file that it opens as read-only
STATED = {  # columns of table results on each part of a run whose movements are stored
    "solution": ("reward", "hands", "solution_corrections", "other_arm_travel"),
    "initial": ("initial_reward", "initial_hands"),
    "replay": ("replay_reward", "replay_hands"),
}
SCHEMA = "4be4698e3d72c02c"  # of format 6: hash of the statements that make OURS, and of triggers
OURS = (  # of tables, then of views
    *("suite", "plan", "cells", "environments", "results", "movements", "learning"),
    *("asked", "runs", "solutions"),
)
EMPTY = zlib.compress(bytes(4))  # no rewards
PLANNED = (  # all that a plan says
    """SELECT name, seed, time_limit_s, command, date, content FROM suite
    JOIN environments ON environments.id = environment""",
    "SELECT * FROM plan JOIN cells ON cells.id = cell ORDER BY position",
)
# Whatever a file says, it is checked in bounded time and memory.
MOST_GOALS, LONGEST_TEXT, LONGEST_PATH = 256, 100_000, 10_000_000  # characters of tasks, solutions
MOST_TRIALS, MOST_TICKS, MOST_IN_ALL = 10_000_000, 1_000_000, 1_000_000_000  # of run, movement
LONGEST_VALUE = 50_000_000  # bytes of a value in the file
NO_PLAN = "It has no plan yet: repeat the `coartic run` command."
UNCHECKED = (
    "Times, dates, reasons, counts of what was spent, and where and with what it was run are taken "
    "as stored; so is what methods declare, and what the suite was called.",
    "That tasks are those of the paper or of a family, and that the plan is that of the suite.",
    "No method is run: `coartic verify --again N` sees whether it finds these solutions again.",
)


def need(holds: Any, words: str) -> None:
    """Raise ValueError with the message ``words`` if ``holds`` is false."""
    if not holds:
        raise ValueError(words)


# One bit of a hand's position can decide where a movement stops. So lines are computed in coartic's
# order and with its polynomials: IEEE arithmetic then gives the same bits on every computer.
HIGH, MIDDLE, LOW = 1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21
S3, S5, S7, S9, S11, S13, S15, S17 = ((-1) ** n / math.factorial(2 * n + 1) for n in range(1, 9))
C4, C6, C8, C10, C12, C14, C16 = ((-1) ** n / math.factorial(2 * n) for n in range(2, 9))


def _cosine_and_sine(angles: Floats) -> tuple[Floats, Floats]:
    """Return cosine and sine of angles, rad, by the Taylor series of what is left after k quarters
    of a turn (π/2); from ±1e5 rad on by the C library."""
    quarters = np.rint(angles * (2.0 / math.pi))
    x = ((angles - quarters * HIGH) - quarters * MIDDLE) - quarters * LOW
    z, k = x * x, quarters.astype(np.int64)
    z2, z4 = z * z, (z * z) * (z * z)
    odd = (S3 + z * S5) + z2 * (S7 + z * S9) + z4 * ((S11 + z * S13) + z2 * (S15 + z * S17))
    even = (C4 + z * C6) + z2 * (C8 + z * C10) + z4 * ((C12 + z * C14) + z2 * C16)
    sine, cosine = x + (x * z) * odd, 1.0 - (0.5 * z - z2 * even)
    cosine, sine = np.where(k & 1, sine, cosine), np.where(k & 1, cosine, sine)
    cosine, sine = np.where((k + 1) & 2, -cosine, cosine), np.where(k & 2, -sine, sine)
    far = np.abs(angles) >= 1e5  # rad; three parts of π/2 are too few: the C library's
    if far.any():
        cosine[far], sine[far] = np.transpose([(math.cos(a), math.sin(a)) for a in angles[far]])
    return cosine, sine


def hand_at(q: Floats, arm: Any, on_path: bool = False) -> tuple[Floats, Floats]:
    """Return x and y of the hand of ``arm`` (slice of joints, lengths of links, shoulder's place)
    for n configurations in the columns of ``q``, ``(n,)`` each; ``on_path``: by NumPy's cosine."""
    joints, links, shoulder = arm
    x, y = q[0] + shoulder[0], q[1] + shoulder[1]
    angles = np.cumsum(q[joints], axis=0)  # each joint's is measured from the link before
    waves = (np.cos(angles), np.sin(angles)) if on_path else _cosine_and_sine(angles)
    for length, cosine, sine in zip(links, *waves, strict=True):
        x, y = x + length * cosine, y + length * sine
    return x, y


def stored_task(definition: str, model: str) -> Any:
    """Return a task from its stored JSON, with its constants of movement (``model``), start
    (``q0``), locked coordinates, arms. Raises ValueError for 0 or over 256 goals, or long text."""
    need(len(f"{definition}{model}") <= LONGEST_TEXT, "the task is too long")
    task = json.loads(definition, object_hook=lambda content: SimpleNamespace(**content))
    task.model = SimpleNamespace(**json.loads(model))
    need(1 <= len(task.goals) <= MOST_GOALS, "the task has too many goals")
    task.q0 = np.array([*task.start.base, *task.start.left, *task.start.right], dtype=np.float64)
    task.locked = ["xy".index(coordinate) for coordinate in task.locked_base]
    robot, middle = task.robot, 2 + len(task.robot.left_links)
    task.arms = {  # place in q, lengths of the links, and the shoulder's place on the base
        "left": (slice(2, middle), robot.left_links, robot.left_shoulder),
        "right": (slice(middle, None), robot.right_links, robot.right_shoulder),
    }
    return task


class MoveRow(NamedTuple):
    """A movement as it is stored."""

    order: int  # from 0
    goal: int  # from 1
    hand: str
    kind: str  # learned, planned, corrective, path
    ticks: int
    corners: Floats  # a row each: the target, or the waypoints of a path


def line(q: Floats, target: Floats, model: Any, most: int = MOST_TICKS) -> Floats:
    """Return points of a straight movement from ``q``, columns ``(dof, points)``, a step of
    ``model`` apart in joint space, at most ``most`` + 1; the last, mostly less far, is always the
    target."""
    difference = target - q
    distance = math.sqrt(np.cumsum(difference * difference)[-1])
    last = math.ceil(distance / model.step)
    fractions = np.arange(min(last, most) + 1) * model.step / (distance or 1.0)
    points: Floats = q[:, None] + fractions * difference[:, None]
    points[:, -1] = target
    return points


def path(q: Floats, waypoints: Floats, model: Any, most: int = MOST_TICKS) -> Floats:
    """Return points along a path from ``q`` through ``waypoints``, a row each, as columns,
    shape ``(dof, points)``. Point k, from 0, lies k steps of ``model`` along the path, and the
    last point at its end; of a longer path only the first ``most`` + 1 points are returned."""
    corners = np.array([q, *waypoints])
    ends = np.append(0.0, np.cumsum(np.sqrt((np.diff(corners, axis=0) ** 2).sum(axis=1))))
    last = math.ceil(ends[-1] / model.step)
    along = np.append(np.arange(min(last, most + 1)) * model.step, ends[-1])
    points = np.array([np.interp(along, ends, joint) for joint in corners.T])
    if last > most:
        return points[:, :-1]
    points[:, -1] = corners[-1]
    return points


def make(task: Any, q: Floats, movement: MoveRow) -> tuple[Floats, int, bool]:
    """Return the configuration where a movement from ``q`` stops, its ticks, and True if the hand
    hits its goal there. A movement that takes more ticks than are stored is cut one tick later."""
    _, goal, hand, kind, most, corners = movement
    model, arm, on_path = task.model, task.arms[hand], kind == "path"
    points = path(q, corners, model, most) if on_path else line(q, corners[-1], model, most)
    x, y = hand_at(points, arm, on_path)
    dx, dy = task.goals[goal - 1][0] - x, task.goals[goal - 1][1] - y
    hits = (np.hypot(dx, dy) if on_path else np.sqrt(dx * dx + dy * dy)) <= task.radius
    stops = hits.copy()
    if kind in ("learned", "planned"):
        dx, dy = x[-1] - x, y[-1] - y
        stops |= np.sqrt(dx * dx + dy * dy) <= model.arrival_tolerance
    stops[-1] = True
    k = int(np.argmax(stops))  # the first
    return points[:, k], k + 1, bool(hits[k])


def _recompute(task: Any, movements: list[MoveRow]) -> tuple[int, str, int, float]:
    """Return reward, letters of hands, number of corrections, and joint travel of idle arms from
    start and hit to hit, rad. Raises ValueError if a rule is broken or ticks are not as stored."""
    _check_rules(task, movements)
    q, reward, hands, corrections, travel = task.q0, 0, "", 0, 0.0
    for goal in range(1, len(task.goals) + 1):
        to_goal, before, hit = [each for each in movements if each.goal == goal], q, False
        for movement in to_goal:
            which, is_corrective = f"movement {movement.order}", movement.kind == "corrective"
            end, ticks, hits = make(task, q, movement)
            if hit or (is_corrective and hits and ticks == 1):
                # Nothing is to be done. A movement of no ticks to where it is names the hand.
                is_none = len(to_goal) == 1 and not movement.ticks and (movement.corners == q).all()
                need(is_none, f"{which} is made after goal {goal} is hit")
                hit = True
                continue
            q, hit = end, hits
            words = f"{which} takes {'at least ' * (ticks > movement.ticks)}{ticks} ticks"
            need(ticks == movement.ticks, f"{words}, not {movement.ticks}")
            reward, corrections = reward - ticks, corrections + is_corrective
        need(hit, f"goal {goal} is not hit")
        hands += to_goal[0].hand[0].upper()
        other = task.arms["right" if to_goal[0].hand == "left" else "left"][0]
        travel += math.dist(q[other], before[other])
    return reward, hands, corrections, travel


def _check_rules(task: Any, movements: list[MoveRow]) -> None:
    """Raise ValueError if movements break a rule that is checked without making the movements."""
    goals = [movement.goal for movement in movements]
    hands = sorted({(movement.goal, movement.hand) for movement in movements})
    need(goals == sorted(goals), f"its goals are out of order: {goals}")
    need([goal for goal, _ in hands] == [*range(1, len(task.goals) + 1)], "a goal has not one hand")
    for order, _, hand, kind, _, corners in movements:
        which = f"movement {order}"
        need(corners.shape[1:] == task.q0.shape, f"{which} has not a number for each joint")
        need(hand in task.hands, f"{which} uses the {hand} hand, which the task does not have")
        need(kind in ("learned", "planned", "corrective", "path"), f"{which} is of no known kind")
    every = np.concatenate([each.corners for each in movements])
    need((np.abs(every) <= 1e5).all(), "a movement has an entry that is no number up to 1e5")
    need((every == task.q0)[:, task.locked].all(), "a movement moves a locked base")


class _Report(NamedTuple):
    """Result of :func:`check_runs`."""

    runs: int  # checked
    movements: int  # executed
    wrong: list[str]  # what differs, a sentence each
    unfinished: list[str]  # what is missing of the plan, a sentence if anything is
    unchecked: list[str]  # what was not checked, a sentence each


def check_runs(folder: Path) -> _Report:
    """Execute the stored movements of a results folder, check its tasks, methods and plan, and
    report what differs, is missing or is unchecked. No method is run.

    Runs that the last plan does not ask for are checked, too. Raises an error, such as
    sqlite3.Error, if the folder cannot be read.
    """
    with closing(sqlite3.connect(f"{folder.absolute().as_uri()}/{DATABASE}", uri=True)) as db:
        db.row_factory = sqlite3.Row
        return _check_all(db)


def _check_all(db: sqlite3.Connection) -> _Report:
    """Return the report of :func:`check_runs` on an open database; no run is checked if a table or
    view is not as coartic makes it. Raises ValueError for another format."""
    db.execute("PRAGMA trusted_schema = OFF")
    db.execute("PRAGMA query_only = ON")
    db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LONGEST_VALUE)
    if not db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
        return _Report(0, 0, [], [NO_PLAN], [])
    for name, ours in (("application_id", 0x636F6172), ("user_version", 6)):
        (there,) = db.execute(f"PRAGMA {name}").fetchone()
        need(there == ours, f"its {name} is {there}, and {ours} in a file of coartic of format 6")
    query = f"""SELECT sql FROM sqlite_master WHERE sql IS NOT NULL
        AND (type = 'trigger' OR name IN ({", ".join("?" for _ in OURS)})) ORDER BY type, name"""
    if hash_of([sql for (sql,) in db.execute(query, OURS)])[:16] != SCHEMA:
        foreign = "Tables or views are not as coartic makes them, so that they may say anything."
        return _Report(0, 0, [foreign], [], ["The runs."])
    wrong = [f"Damage: {row[0]}." for row in db.execute("PRAGMA integrity_check") if row[0] != "ok"]
    tasks = dict[int, Any]()
    wrong += [*_check_cells(db, tasks), *_check_plan(db)]
    runs = movements = unsolved = spent = 0
    query = """SELECT results.id AS number, * FROM results
        LEFT JOIN cells ON cells.id = cell LEFT JOIN learning ON result_id = results.id"""
    for row in db.execute(query):
        run, runs, unsolved = row["run_id"], runs + 1, unsolved + (row["status"] != "ok")
        where = f"Run {run}"
        try:
            task = tasks.get(row["cell"], "its cell is not there")
            need(not isinstance(task, str), task)
            _check_identity(row)
            parts, stored = _read_movements(db, row["number"])
            need(bool(parts["solution"]) == (row["status"] == "ok"), f"status is {row['status']}")
            spent += sum(move.ticks for moves in parts.values() for move in moves)
            spent += row["trials"] or 0
            need(spent <= MOST_IN_ALL, "it and those before have too many ticks and trials")
            for part, moves in parts.items():
                where, movements = f"Run {run}, {part}", movements + len(moves)
                outcome = _recompute(task, moves) if moves else (None, None, None, None)
                for name, now in zip(STATED[part], outcome, strict=False):
                    close = name == "other_arm_travel" and moves and abs(row[name] - now) <= 1e-9
                    need(close or row[name] == now, f"{name} is {now}, not {row[name]}")
            where = f"Run {run}"
            content = json.dumps([row["status"], *stored])
            result = hashlib.sha256(content.encode() + _check_rewards(row)).hexdigest()[:16]
            need(row["result"] == result, "a joint or a trial was changed")
        except Exception as problem:  # whatever keeps a run from being executed
            wrong.append(f"{where}: {problem}.")
    empty = [f"Runs without a solution: {unsolved}."] if unsolved else []
    (asked,) = db.execute("SELECT count(*) FROM asked").fetchone()
    others = [f"If the plan should ask for {runs - asked} other runs, which no report shows."]
    more = [*UNCHECKED, *empty, *others * (runs > asked)]
    return _Report(runs, movements, wrong, [*_missing(db)], more)


def _check_identity(row: Any) -> None:
    """Raise ValueError if the id or the seed of a run does not follow from its cell (the seed: from
    the task's name), the suite's seed and the run's number; the id ends with the code."""
    suite_seed, run = row["suite_seed"], row["run"]
    digits = hashlib.sha256(f"{row['digest']} {suite_seed} {run}".encode()).hexdigest()[:16]
    need(row["run_id"] == f"{digits}-{row['code']}", "it is not the run that its id says")
    words = np.frombuffer(hashlib.sha256(row["task"].encode()).digest()[:16], "<u4").tolist()
    (state,) = np.random.SeedSequence(suite_seed, spawn_key=(*words, run)).generate_state(1, "u8")
    need(row["seed"] == int(state) >> 1, f"its seed is not {row['seed']}")


def _check_cells(db: sqlite3.Connection, tasks: dict[int, Any]) -> Iterator[str]:
    """Yield a sentence for each row that refers to a missing row, each cell or environment that
    contradicts itself or cannot be read, and each name of two tasks in the plan. ``tasks`` gets the
    task of each cell by id, or words on what is wrong with the cell."""
    for table, number, missing, _ in db.execute("PRAGMA foreign_key_check"):
        yield f"Row {number} of table {table} names a row of {missing} that is not there."
    for row in db.execute("SELECT * FROM cells"):
        try:
            tasks[row["id"]] = task = stored_task(row["definition"], row["model"])
            names = ("definition", "model", "parameters", "defaults")
            definition, model, parameters, defaults = (json.loads(row[name]) for name in names)
            cell = {"task": definition, "model": model, "parameters": parameters}
            cell |= {name: row[name] for name in ("method", "trial_budget")}
            same = row["digest"] == hash_of(cell)
            need(same, "its task, method, parameters or model were changed")
            need(row["task"] == task.name, f"its task is not {row['task']}")
            changed = {k: v for k, v in parameters.items() if k not in defaults or v != defaults[k]}
            setting = ", ".join(f"{k}={v}" for k, v in changed.items())
            need(row["setting"] == setting, f"its parameters are not {row['setting']}")
        except Exception as problem:
            tasks[row["id"]] = str(problem)
            yield f"Row {row['id']} of table cells: {problem}."
    for row in db.execute("SELECT * FROM environments"):
        try:
            content = json.loads(row["content"])
            packages = hash_of([content.get("python"), content.get("packages")])[:8]
            need(row["packages"] == packages, f"its packages are not {row['packages']}")
        except Exception as problem:
            yield f"Row {row['id']} of table environments: {problem}."
    query = """SELECT task FROM plan JOIN cells ON cells.id = cell
        GROUP BY task HAVING count(DISTINCT definition) > 1"""
    yield from (f"Two tasks are called {name}." for (name,) in db.execute(query))


def _check_plan(db: sqlite3.Connection) -> Iterator[str]:
    """Yield a sentence if the hash of the plan is not the hash that was stored with it."""
    hashes = [row[0] for row in db.execute("SELECT plan_hash FROM suite")]
    rows = [[*row] for query in PLANNED for row in db.execute(query)]
    if hashes != [hash_of(rows)] and (hashes or rows):
        words = "what suite, plan, cells and environments say of it was changed"
        yield f"The plan is not as it was written: {words}. No report can be made."


def _missing(db: sqlite3.Connection) -> Iterator[str]:
    """Yield a sentence if no plan is stored, or if runs of the plan are not stored."""
    if not db.execute("SELECT count(*) FROM suite").fetchone()[0]:
        yield NO_PLAN
    query = """SELECT runs, count(run), min(run) FROM plan LEFT JOIN asked USING (position)
        GROUP BY position"""
    counts = db.execute(query).fetchall()
    planned, there = (sum(row[k] for row in counts) for k in (0, 1))
    firsts = {first if first == runs - count else None for runs, count, first in counts}
    if len(firsts) == 1 and (first := firsts.pop()):
        yield f"It has a part of the runs, from run {first} on: `--include` joins all parts."
    elif there != planned:
        yield f"The plan asks for {planned} runs, of which the folder has {there}."


def hash_of(content: Any) -> str:
    """Return the SHA-256 of plain data as JSON, in 64 hexadecimal digits."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), default=repr)
    return hashlib.sha256(text.encode()).hexdigest()


def _check_rewards(row: Any) -> bytes:
    """Return a run's rewards as unpacked bytes: integers of four bytes, the best reward, then of
    each trial 1 plus the ticks by which it is worse (0 without a reward), the lowest bytes of all
    first. Raises ValueError for damage, and if ``best_trial`` is not the first with the reward."""
    size = 4 * (1 + min(row["trials"] or 0, MOST_TRIALS))
    try:
        content = (packed := zlib.decompressobj()).decompress(row["rewards"] or EMPTY, size + 1)
        need(len(content) <= size and packed.eof, "")
        numbers = np.frombuffer(content, "u1").reshape(4, -1)
        best = int.from_bytes(numbers[:, 0].tobytes(), "little", signed=True)
    except (zlib.error, ValueError, TypeError):
        raise ValueError(f"the rewards of its {row['trials']} trials are damaged") from None
    worse = max(best + 1 - (row["reward"] or 0), 0) % 2**32
    wanted = np.frombuffer(worse.to_bytes(4, "little"), "u1")
    found = np.flatnonzero((numbers[:, 1:] == wanted[:, None]).all(axis=0))[:1].tolist()
    first = found[0] if found and worse and row["status"] == "ok" else None
    need(row["best_trial"] == first, f"best_trial is {first}, not {row['best_trial']}")
    return content


def _read_movements(db: sqlite3.Connection, run: int) -> tuple[dict[str, list[MoveRow]], list[Any]]:
    """Return the movements of row ``run`` of table ``results``, by part, and a list of all as
    stored, which the result's hash covers. Raises an error for a missing or malformed movement."""
    parts: dict[str, list[MoveRow]] = {part: [] for part in STATED}
    query = "SELECT part, sum(length(path)) FROM movements WHERE result_id = ? GROUP BY part"
    for part, length in db.execute(query, [run]):
        need(length <= LONGEST_PATH, f"{part} is too long")
    stored: dict[str, list[Any]] = {part: [] for part in STATED}
    query = """SELECT part, "order", goal, hand, kind, ticks, path FROM movements
        WHERE result_id = ? ORDER BY "order\""""
    for part, order, goal, hand, kind, ticks, text in db.execute(query, [run]):
        need(order == len(parts[part]), f"movement {len(parts[part])} is missing")
        which, is_count = f"movement {order}", type(ticks) is int and 0 <= ticks <= MOST_TICKS
        need(is_count, f"{which} takes {ticks} ticks, which is no count up to {MOST_TICKS}")
        points = np.array(json.loads(text), dtype=np.float64)
        is_place = points.ndim == 1 + (kind == "path") and len(points)
        need(is_place, f"{which}: {kind} has no such points")
        parts[part].append(MoveRow(order, goal, hand, kind, ticks, np.atleast_2d(points)))
        stored[part].append([part, goal, hand, kind, ticks, text])
    return parts, [*chain(*stored.values())]


def main() -> int:
    """Check the folder that the command line names, or else the current folder, and print what was
    found. Return 0 if nothing differs or is missing, else 1, and 2 if it cannot be read."""
    folder = Path(*sys.argv[1:])
    try:
        report = check_runs(folder)
        code = 1 if report.wrong or report.unfinished else 0
        lines = [f"{report.runs} runs checked, {report.movements} movements executed."]
        lines += [*(report.wrong or ["Nothing differs."]), *report.unfinished, "Not checked:"]
        lines += report.unchecked
    except Exception as error:  # whatever the file holds
        code, lines = 2, [f"{folder} cannot be read: {error}."]
    print(*("".join(c if c.isprintable() else "?" for c in line) for line in lines), sep="\n")
    return code


if __name__ == "__main__":
    sys.exit(main())
