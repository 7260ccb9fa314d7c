"""Check a results folder: execute every stored solution again.

It needs Python and NumPy, and nothing of coartic. ``python verify.py FOLDER`` opens
``FOLDER/runs.sqlite`` and checks of every run that its solution (and of a learner its first and
last trial) keeps the rules, hits every goal, and has the stored ticks, rewards, hands, corrections
and travel of the other arm; by a hash, that no joint and no trial was changed since; by its id and
its seed, that the task, method and parameters are those that it was asked for; and that the tables
and views through which reports read all this are coartic's, and show each run as what it is.

The rules (Shah, Barto & Fagg 2013, *A Dual Process Account of Coarticulation in Motor Skill
Acquisition*): A robot, a mobile base with two arms, hits goals with its hands, in their order. A
configuration q holds x and y of the base, then the angles of the left arm and of the right arm. A
movement goes from q straight to a target q^t in steps of length m; its last step, a shorter one,
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
import re
import sqlite3
import sys
import zlib
from collections import defaultdict
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
DATABASE = "runs.sqlite?mode=ro"
STATED = {  # of table results: what is said of each solution that is stored of a run
    "solution": ("reward", "hands", "solution_corrections", "other_arm_travel"),
    "initial": ("initial_reward", "initial_hands"),
    "replay": ("replay_reward", "replay_hands"),
}
SCHEMA = "01ba2a1326692168"  # of format 5: see schema
OURS = (  # of tables, then of views
    *("suite", "plan", "cells", "environments", "results", "movements", "waypoints", "learning"),
    *("asked", "solved", "runs", "solutions", "paths"),
)
# Whatever a file says, it is checked in bounded time and memory.
MOST_GOALS, LONGEST_TEXT = 256, 100_000  # of a task, and of what is stored of it in characters
MOST_TRIALS, MOST_TICKS, MOST_IN_ALL = 10_000_000, 1_000_000, 1_000_000_000  # of run, movement
UNCHECKED = (
    "Times, dates, reasons, counts of what was spent, proven bounds, and where and with what it "
    "was run are taken as stored; so is what methods declare, and what the suite was called.",
    "That tasks are those of the paper or of a family, and that the plan is that of the suite.",
    "No method is run: `coartic verify --again N` sees whether it finds these solutions again.",
)


def need(holds: Any, words: str) -> None:
    """Raises ValueError with these words where something does not hold."""
    if not holds:
        raise ValueError(words)


# One bit of a hand's position can decide where a movement stops. So all is computed in coartic's
# order and with its polynomials: IEEE arithmetic then gives the same bits on every computer.
HIGH, MIDDLE, LOW = 1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21
S3, S5, S7, S9, S11, S13, S15, S17 = ((-1) ** n / math.factorial(2 * n + 1) for n in range(1, 9))
C4, C6, C8, C10, C12, C14, C16 = ((-1) ** n / math.factorial(2 * n) for n in range(2, 9))


def cosine_and_sine(angles: Floats) -> tuple[Floats, Floats]:
    """Cosine and sine of angles in rad: less k quarters of a turn (π/2), by the Taylor series."""
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
    """x and y of the hand, for configurations in columns. On paths, by NumPy's cosine and sine."""
    joints, links, shoulder = arm
    x, y = q[0] + shoulder[0], q[1] + shoulder[1]
    angles = np.cumsum(q[joints], axis=0)  # each joint's is measured from the link before
    waves = (np.cos(angles), np.sin(angles)) if on_path else cosine_and_sine(angles)
    for length, cosine, sine in zip(links, *waves, strict=True):
        x, y = x + length * cosine, y + length * sine
    return x, y


def stored_task(definition: str, model: str) -> Any:
    """A task as it is stored, with the constants of movement, and what follows from both."""
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
    names = [f"{hand}_{k + 1}" for hand, arm in task.arms.items() for k in range(len(arm[1]))]
    task.columns = ", ".join(["base_x", "base_y", *names])
    return task


class MoveRow(NamedTuple):
    """A movement as it is stored."""

    order: int  # from 0
    goal: int  # from 1
    hand: str
    kind: str  # learned, planned, corrective, path
    ticks: int
    target: Floats
    waypoints: list[Floats]  # of a path


def line(q: Floats, target: Floats, model: Any, most: int = MOST_TICKS) -> Floats:
    """The points of a straight movement, in columns; ``most`` of them and one more."""
    difference = target - q
    distance = math.sqrt(np.cumsum(difference * difference)[-1])
    last = math.ceil(distance / model.step)
    fractions = np.arange(min(last, most) + 1) * model.step / (distance or 1.0)
    points: Floats = q[:, None] + fractions * difference[:, None]
    if last <= most:
        points[:, -1] = target
    return points


def path(q: Floats, waypoints: list[Floats], model: Any, most: int = MOST_TICKS) -> Floats:
    """The points of a path, in columns; ``most`` of them and one more. Point k lies k steps along
    it, the last at its end."""
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
    """Make a movement from q: where it stops, after how many ticks, and whether that is a hit.
    One of more ticks than are stored ends a tick after these."""
    _, goal, hand, kind, most, target, waypoints = movement
    model, arm, on_path = task.model, task.arms[hand], kind == "path"
    points = path(q, waypoints, model, most) if on_path else line(q, target, model, most)
    x, y = hand_at(np.column_stack([points, target]), arm, on_path)
    x, y, end_x, end_y = x[:-1], y[:-1], x[-1], y[-1]
    dx, dy = task.goals[goal - 1][0] - x, task.goals[goal - 1][1] - y
    hits = (np.hypot(dx, dy) if on_path else np.sqrt(dx * dx + dy * dy)) <= task.radius
    stops = hits.copy()
    if kind in ("learned", "planned"):
        dx, dy = end_x - x, end_y - y
        stops |= np.sqrt(dx * dx + dy * dy) <= model.arrival_tolerance
    stops[-1] = True
    k = int(np.argmax(stops))  # the first
    return points[:, k], k + 1, bool(hits[k])


def recompute(task: Any, movements: list[MoveRow]) -> tuple[int, str, int, float]:
    """Reward, hands, corrections made, and travel of the arms not chosen, from hit to hit, in rad.
    Raises ValueError where a movement breaks a rule or takes other ticks than are stored."""
    check_rules(task, movements)
    q, reward, hands, corrections, travel = task.q0, 0, "", 0, 0.0
    for goal in range(1, len(task.goals) + 1):
        to_goal, before = [movement for movement in movements if movement.goal == goal], q
        stand = to_goal[0]._replace(kind="planned", target=q)  # the others are made in any case
        hit = to_goal[0].kind == "corrective" and make(task, q, stand)[2]
        for movement in to_goal:
            which, is_corrective = f"movement {movement.order}", movement.kind == "corrective"
            if hit and (is_corrective or movement is not to_goal[0]):
                # Nothing is to be done. A movement of no ticks to where it is names the hand.
                is_none = len(to_goal) == 1 and not movement.ticks and (movement.target == q).all()
                need(is_none, f"{which} is made after goal {goal} is hit")
                continue
            q, ticks, hit = make(task, q, movement)
            words = f"{which} takes {'at least ' * (ticks > movement.ticks)}{ticks} ticks"
            need(ticks == movement.ticks, f"{words}, not {movement.ticks}")
            reward, corrections = reward - ticks, corrections + is_corrective
        need(hit, f"goal {goal} is not hit")
        hands += to_goal[0].hand[0].upper()
        other = task.arms["right" if to_goal[0].hand == "left" else "left"][0]
        travel += math.dist(q[other], before[other])
    return reward, hands, corrections, travel


def check_rules(task: Any, movements: list[MoveRow]) -> None:
    """Raises ValueError where movements break a rule, whatever comes of them."""
    goals = [movement.goal for movement in movements]
    hands = sorted({(movement.goal, movement.hand) for movement in movements})
    need(goals == sorted(goals), f"its goals are out of order: {goals}")
    need([goal for goal, _ in hands] == [*range(1, len(task.goals) + 1)], "a goal has not one hand")
    for place, (order, _, hand, kind, _, target, waypoints) in enumerate(movements):
        which, corners = f"movement {order}", np.array([*waypoints, target])
        need(order == place, f"movement {place} is missing")
        need(hand in task.hands, f"{which} uses the {hand} hand, which the task does not have")
        need(kind in ("learned", "planned", "corrective", "path"), f"{which} is of no known kind")
        need(bool(waypoints) == (kind == "path"), f"{which}: a path, and no other, has waypoints")
        need((np.abs(corners) <= 1e5).all(), f"{which} has an entry that is no number up to 1e5")
        need((corners[-2:] == target).all(), f"{which} does not end at its last waypoint")
        need((corners == task.q0)[:, task.locked].all(), f"{which} moves a locked base")


class Report(NamedTuple):
    """Result of the check."""

    runs: int  # checked
    movements: int  # executed
    wrong: list[str]  # what differs, a sentence each
    unchecked: list[str]  # what was not checked, a sentence each


def check_runs(folder: Path) -> Report:
    """Check all runs of a folder, asked for last or not. sqlite3.Error: it cannot be read."""
    with closing(sqlite3.connect(f"{folder.absolute().as_uri()}/{DATABASE}", uri=True)) as db:
        db.row_factory = sqlite3.Row
        return check_all(db)


def check_all(db: sqlite3.Connection) -> Report:
    """Check the runs one by one, and that none is better than another proves possible."""
    db.execute("PRAGMA trusted_schema = OFF")
    if hash_of(schema(db))[:16] != SCHEMA:
        foreign = "Tables or views are not as coartic makes them, so that they may say anything."
        return Report(0, 0, [foreign], ["The runs."])
    wrong = [f"Damage: {row[0]}." for row in db.execute("PRAGMA integrity_check") if row[0] != "ok"]
    wrong += [*check_cells(db), *check_plan(db)]
    runs = movements = unsolved = spent = 0
    rewards, bounds = defaultdict[Any, Any](list), defaultdict[Any, Any](list)  # by task
    query = """SELECT results.id AS number, * FROM results
        LEFT JOIN cells ON cells.id = cell LEFT JOIN learning ON result_id = results.id"""
    for row in db.execute(query):
        run, same, bound = row["run_id"], (row["definition"], row["model"]), row["proven_bound"]
        where, runs, unsolved = f"Run {run}", runs + 1, unsolved + (row["status"] != "ok")
        try:
            task, chosen = stored_task(*same), json.loads(row["parameters"])
            parts = read_parts(db, row["number"], task.columns)
            need(bool(parts["solution"]) == (row["status"] == "ok"), f"status is {row['status']}")
            spent += sum(move.ticks for moves in parts.values() for move in moves)
            spent += row["trials"] or 0
            need(spent <= MOST_IN_ALL, "it and those before have too many ticks and trials")
            for part, moves in parts.items():
                where, movements = f"Run {run}, {part}", movements + len(moves)
                outcome = recompute(task, moves) if moves else (None, None, None, None)
                for name, now in zip(STATED[part], outcome, strict=False):
                    close = name == "other_arm_travel" and moves and abs(row[name] - now) <= 1e-9
                    need(close or row[name] == now, f"{name} is {now}, not {row[name]}")
                rewards[same] += [(outcome[0], run)] if moves else []
            # A search of fewer movements than the task allows proves nothing of the others.
            if chosen.get("base", "task") == "task" and chosen.get("other_arm") != "still":
                bounds[same] += [(int(bound), run)] if bound is not None else []
            need(row["result"] == fingerprint(row, parts), "a joint or a trial was changed")
            check_identity(row)
        except Exception as problem:  # whatever keeps a run from being executed
            wrong.append(f"{where}: {problem}.")
    for same, proofs in bounds.items():
        bound, proof = min(proofs, default=(0, ""))
        words = f"is better than bound {bound} of run {proof}"
        wrong += [f"Run {run} {words}." for reward, run in rewards[same] if reward > bound]
    empty = [f"Runs without a solution: {unsolved}."] if unsolved else []
    (asked,) = db.execute("SELECT count(*) FROM asked").fetchone()
    others = [f"If the plan should ask for {runs - asked} other runs, which no report shows."]
    return Report(runs, movements, wrong, [*UNCHECKED, *empty, *others * (runs > asked)])


def schema(db: sqlite3.Connection) -> list[list[str]]:
    """Tables and views of coartic, without columns of joints, and all triggers."""
    query = f"""SELECT type, name, tbl_name, sql FROM sqlite_master
        WHERE type = 'trigger' OR name IN ({", ".join("?" for _ in OURS)}) ORDER BY type, name"""
    rows = db.execute(query, OURS)
    joint = re.compile(r", (base_[xy]|(left|right)_[0-9]+) REAL")
    of = {"movements": joint, "waypoints": joint}
    return [
        [kind, name, table, " ".join(re.sub(of.get(table, "$^"), "", sql or "").split())]
        for kind, name, table, sql in rows
    ]


def check_identity(row: Any) -> None:
    """Raises ValueError where a run is not that of its cell: its id is a hash of task, method,
    parameters, constants, budget, seed of the suite and number, and ends with that of the code."""
    cell = {name: json.loads(row[name]) for name in ("parameters", "model")}
    cell |= {"task": json.loads(row["definition"])}
    cell |= {name: row[name] for name in ("method", "trial_budget")}
    need(row["digest"] == hash_of(cell), "its task, method, parameters or model were changed")
    need(row["task"] == cell["task"]["name"], f"its task is not {row['task']}")
    suite_seed, run = row["suite_seed"], row["run"]
    digits = hashlib.sha256(f"{row['digest']} {suite_seed} {run}".encode()).hexdigest()[:16]
    need(row["run_id"] == f"{digits}-{row['code']}", "it is not the run that its id says")
    words = np.frombuffer(hashlib.sha256(row["task"].encode()).digest()[:16], "<u4").tolist()
    (state,) = np.random.SeedSequence(suite_seed, spawn_key=(*words, run)).generate_state(1, "u8")
    need(row["seed"] == int(state) >> 1, f"its seed is not {row['seed']}")


def check_cells(db: sqlite3.Connection) -> Iterator[str]:
    """Cells that show other runs than they say, and runs that none shows, a sentence each."""
    for table, number, missing, _ in db.execute("PRAGMA foreign_key_check"):
        yield f"Row {number} of table {table} names a row of {missing} that is not there."
    for row in db.execute("SELECT * FROM cells"):
        try:
            parameters, defaults = json.loads(row["parameters"]), json.loads(row["defaults"])
            changed = {k: v for k, v in parameters.items() if k not in defaults or v != defaults[k]}
            setting = ", ".join(f"{k}={v}" for k, v in changed.items())
            need(row["setting"] == setting, f"its parameters are not {row['setting']}")
        except Exception as problem:
            yield f"Row {row['id']} of table cells: {problem}."
    query = """SELECT task FROM plan JOIN cells ON cells.id = cell
        GROUP BY task HAVING count(DISTINCT definition) > 1"""
    yield from (f"Two tasks are called {name}." for (name,) in db.execute(query))


def check_plan(db: sqlite3.Connection) -> Iterator[str]:
    """Yield a sentence for each fault of the plan, and one if its runs are missing."""
    (suites,) = db.execute("SELECT count(*) FROM suite").fetchone()
    if suites != 1:
        yield f"Table suite has {suites} rows, not one: no report can be made."
    for (position,) in db.execute("SELECT position FROM plan WHERE runs < 1"):
        yield f"Row {position} of table plan asks for no runs of its cell."
    (planned,) = db.execute("SELECT coalesce(sum(runs), 0) FROM plan").fetchone()
    (there,) = db.execute("SELECT count(*) FROM asked").fetchone()
    if there != planned:
        yield f"The plan asks for {planned} runs, of which the folder has {there}."


def hash_of(content: Any) -> str:
    """SHA-256 of plain data."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def fingerprint(row: Any, parts: dict[str, list[MoveRow]]) -> str:
    """Hash of status, bound, rewards and solutions. Raises ValueError for another best trial."""
    size = 4 * min(row["trials"] or 0, MOST_TRIALS)
    unpacked = zlib.decompressobj().decompress(row["rewards"] or zlib.compress(b""), size + 1)
    need(len(unpacked) <= size, f"it has more rewards than {row['trials']} trials")
    kept = [None if r == -(2**31) else r for r in np.frombuffer(unpacked, "<i4").tolist()]
    best = kept.index(row["reward"]) if row["reward"] in kept and row["status"] == "ok" else None
    need(row["best_trial"] == best, f"best_trial is {best}, not {row['best_trial']}")
    content = [row["status"], row["proven_bound"], kept]
    for part, moves in parts.items():
        for _, *facts, q, waypoints in moves:
            content.append([part, *facts, q.tolist(), [p.tolist() for p in waypoints] or None])
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]


def read_parts(db: sqlite3.Connection, run: int, columns: str) -> dict[str, list[MoveRow]]:
    """The movements of a run, by the solution that they belong to."""
    parts: dict[str, list[MoveRow]] = {part: [] for part in STATED}
    waypoints = defaultdict[int, list[Floats]](list)
    where = 'WHERE result_id = ? ORDER BY "order"'
    query = f'SELECT "order", waypoint, {columns} FROM waypoints {where}, waypoint'
    for order, number, *q in db.execute(query, [run]):
        need(number == len(waypoints[order]), f"movement {order} lacks a waypoint")
        waypoints[order].append(np.array(q, dtype=np.float64))
    query = f'SELECT part, "order", goal, hand, kind, ticks, {columns} FROM movements {where}'
    for part, order, goal, hand, kind, ticks, *q in db.execute(query, [run]):
        count = type(ticks) is int and 0 <= ticks <= MOST_TICKS
        need(count, f"movement {order} takes {ticks} ticks, which is no count up to {MOST_TICKS}")
        points = waypoints.pop(order, []) if part == "solution" else []
        parts[part].append(MoveRow(order, goal, hand, kind, ticks, np.array(q, float), points))
    need(not waypoints, "it has waypoints of no movement")
    return parts


def main() -> int:
    """Check the folder that the command names, this one if it names none; say what was found."""
    folder = Path(*sys.argv[1:])
    try:
        report = check_runs(folder)
    except sqlite3.Error as error:
        print(f"{folder} cannot be read: {error}.")
        return 2
    print(f"{report.runs} runs checked, {report.movements} movements executed.")
    lines = [*(report.wrong or ["Nothing differs."]), "Not checked:", *report.unchecked]
    print(*("".join(c if c.isprintable() else "?" for c in line) for line in lines), sep="\n")
    return 1 if report.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
