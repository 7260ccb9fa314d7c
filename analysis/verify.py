"""Check a results folder: execute every stored solution again.

This file needs only Python and NumPy, and does not import coartic. ``python verify.py FOLDER``
opens ``FOLDER/runs.sqlite`` and checks that

- the solution of each run (and the first trial and the replay of a learner) obeys the rules, hits
  all goals, and has the stored ticks, reward and hands;
- the stored hash of each run is that of its movements and of the rewards of its trials;
- the id, the seed and the labels of each run fit the task, method, parameters and world;
- the folder has all runs that the plan asks for.

The rules (Shah, Barto & Fagg 2013, *A Dual Process Account of Coarticulation in Motor Skill
Acquisition*):

- A robot, a mobile base with two arms, hits goals with its hands, in order. Each goal has one hand.
- A configuration q has x and y of the base, the angles of the left arm, and those of the right arm.
- A movement goes straight from q to a target q^t in steps of length m. Its last step, which can be
  shorter, ends at q^t.
- Before each step the robot checks whether to stop. It stops if its hand is within the radius of
  the goal (a hit). In a learned or planned movement, it also stops if its hand is within the
  tolerance θ^a of the position that the hand would have at q^t (arrival).
- A step costs one tick, and stopping costs one more. The reward is minus the sum of all ticks.
- The first movement for a goal is always made, unless it is corrective. Any other movement is only
  made if the goal is not hit yet.
- A movement of kind *path* leads through waypoints. It stops on a hit, or at the last waypoint.
- The targets of corrective movements are stored; the corrective process is not run again.
- With motor noise, only goals, hands and targets are checked. A run then stores no ticks.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import sqlite3
import sys
import zlib
from contextlib import closing
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
BLOCK = 2**16  # points of a movement that are in memory at the same time
STATED = {  # columns of table results that describe each part of a run
    "solution": ("reward", "hands", "solution_corrections", "other_arm_travel"),
    "initial": ("initial_reward", "initial_hands"),
    "replay": ("replay_reward", "replay_hands"),
}


def need(holds: Any, words: str) -> None:
    """Raise ValueError with the message ``words`` if ``holds`` is false."""
    if not holds:
        raise ValueError(words)


WORLD = {"motor_noise": 0.0, "norm": "euclidean", "base_weight": 1.0, "radius": None}
"""Constants of the paper's world. A stored cell leaves a constant out if it has this value."""

# One bit of a hand's position can decide where a movement stops. Therefore it is computed in the
# same order and with the same polynomials as in coartic: IEEE arithmetic then gives the same
# bits on all computers.
HIGH, MIDDLE, LOW = 1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21
S3, S5, S7, S9, S11, S13, S15, S17 = ((-1) ** n / math.factorial(2 * n + 1) for n in range(1, 9))
C4, C6, C8, C10, C12, C14, C16 = ((-1) ** n / math.factorial(2 * n) for n in range(2, 9))


def _cosine_and_sine(angles: Floats) -> tuple[Floats, Floats]:
    """Return the cosine and the sine of angles from -1e5 to 1e5 rad.

    Each angle is divided into k quarter turns (π/2) and a remainder. The cosine and the sine of the
    remainder are computed from their Taylor series.
    """
    quarters = np.rint(angles * (2.0 / math.pi))
    x = ((angles - quarters * HIGH) - quarters * MIDDLE) - quarters * LOW
    z, k = x * x, quarters.astype(np.int64)
    z2, z4 = z * z, (z * z) * (z * z)
    odd = (S3 + z * S5) + z2 * (S7 + z * S9) + z4 * ((S11 + z * S13) + z2 * (S15 + z * S17))
    even = (C4 + z * C6) + z2 * (C8 + z * C10) + z4 * ((C12 + z * C14) + z2 * C16)
    sine, cosine = x + (x * z) * odd, 1.0 - (0.5 * z - z2 * even)
    cosine, sine = np.where(k & 1, sine, cosine), np.where(k & 1, cosine, sine)
    cosine, sine = np.where((k + 1) & 2, -cosine, cosine), np.where(k & 2, -sine, sine)
    return cosine, sine


def hand_at(q: Floats, arm: Any) -> tuple[Floats, Floats]:
    """Return x and y of a hand (length units) for n configurations, shape ``(n,)`` each.

    ``q``, shape ``(dof, n)``, contains a configuration in each column. ``arm`` contains the slice
    of the arm's joints, the lengths of its links, and the position of its shoulder on the base.
    """
    joints, links, shoulder = arm
    x, y = q[0] + shoulder[0], q[1] + shoulder[1]
    angles = np.cumsum(q[joints], axis=0)  # a joint's angle is measured from the previous link
    for length, cosine, sine in zip(links, *_cosine_and_sine(angles), strict=True):
        x, y = x + length * cosine, y + length * sine
    return x, y


@cache
def stored_task(content: str) -> Any:
    """Return the task of a cell, read from the cell's stored JSON.

    Attributes are added: constants of the motion model (``model``), start (``q0``), indices of
    ``locked`` coordinates, ``arms``, and the cell's ``digest`` (hash) and ``labels``.
    """
    plain = json.loads(content)
    cell = json.loads(content, object_hook=lambda values: SimpleNamespace(**values))
    task = cell.task
    task.model = SimpleNamespace(**WORLD | vars(cell.model))
    task.radius = task.model.radius or task.radius
    method, given = plain["method"], plain["parameters"]
    changed = [f"{n}={x}" for n, x in given.items() if repr(x) != repr(method["defaults"].get(n))]
    world = [f"{name}={x}" for name, x in vars(task.model).items() if x != WORLD.get(name, x)]
    task.labels = task.name, method["name"], ", ".join(changed), ", ".join(world)
    plain["method"] = method["name"]
    text = json.dumps(plain, sort_keys=True, separators=(",", ":"))
    task.digest = hashlib.sha256(text.encode()).hexdigest()
    task.q0 = np.array([*task.start.base, *task.start.left, *task.start.right], dtype=np.float64)
    task.locked = ["xy".index(coordinate) for coordinate in task.locked_base]
    robot, middle = task.robot, 2 + len(task.robot.left_links)
    task.arms = {  # slice of q, lengths of the links, and the shoulder's position on the base
        "left": (slice(2, middle), robot.left_links, robot.left_shoulder),
        "right": (slice(middle, None), robot.right_links, robot.right_shoulder),
    }
    return task


def scaled(changes: Floats, model: Any) -> Floats:
    """Return the absolute changes, those of the base multiplied by its weight: ``(..., dof)``."""
    sizes = np.abs(changes)
    sizes[..., :2] *= model.base_weight
    return sizes


def straight_path_points(
    q: Floats, target: Floats, model: Any, part: slice = slice(None)
) -> Floats:
    """Return the points of a straight movement from ``q`` to a target, shape ``(dof, points)``.

    The points are spaced by ``model.step`` in joint space; the last step can be shorter. A
    coordinate whose entry in the target is NaN does not move. ``part`` selects points.
    """
    target = np.where(np.isnan(target), q, target)
    difference = target - q
    sizes = scaled(difference, model)
    is_euclidean = model.norm == "euclidean"
    distance = math.sqrt(np.cumsum(sizes * sizes)[-1]) if is_euclidean else sizes.max()
    last = math.ceil(distance / model.step)
    numbers = np.arange(last + 1)[part]
    fractions = numbers * model.step / (distance or 1.0)
    points: Floats = q[:, None] + fractions * difference[:, None]
    points[:, numbers == last] = target[:, None]
    return points


def path(q: Floats, waypoints: Floats, model: Any, part: slice = slice(None)) -> Floats:
    """Return the points of a path from ``q`` through waypoints, shape ``(dof, points)``.

    ``waypoints`` has shape ``(W, dof)``. The points are spaced by ``model.step`` along the path;
    the last point is the last waypoint, and the step to it can be shorter. ``part`` selects points.
    """
    corners = np.array([q, *waypoints])
    sizes = scaled(np.diff(corners, axis=0), model)
    is_euclidean = model.norm == "euclidean"
    lengths = np.sqrt((sizes**2).sum(axis=1)) if is_euclidean else sizes.max(axis=1)
    ends = np.append(0.0, np.cumsum(lengths))
    along = np.append(np.arange(math.ceil(ends[-1] / model.step)) * model.step, ends[-1])[part]
    points = np.array([np.interp(along, ends, joint) for joint in corners.T])
    points[:, along == ends[-1]] = corners[-1][:, None]
    return points


def make(
    task: Any, q: Floats, goal: int, hand: str, kind: str, corners: Floats
) -> tuple[Floats, int, bool]:
    """Make a movement from ``q``; return the configuration at its end, its ticks, and if it hits.

    ``corners`` has shape ``(rows, dof)``. For a path, its rows are the waypoints; for any other
    movement, its only row is the target. ``goal`` is the number of the goal, from 1.
    """
    model, arm = task.model, task.arms[hand]
    end_x, end_y = hand_at(np.where(np.isnan(corners[-1]), q, corners[-1])[:, None], arm)
    for begin in itertools.count(0, BLOCK):  # all points would need much memory if the base is dear
        part = slice(begin, begin + BLOCK + 1)  # one more, so that no part is empty
        if kind == "path":
            points = path(q, corners, model, part)
        else:
            points = straight_path_points(q, corners[-1], model, part)
        x, y = hand_at(points, arm)
        dx, dy = task.goals[goal - 1][0] - x, task.goals[goal - 1][1] - y
        hits = np.sqrt(dx * dx + dy * dy) <= task.radius
        stops = hits.copy()
        if kind in ("learned", "planned"):
            dx, dy = end_x - x, end_y - y
            stops |= np.sqrt(dx * dx + dy * dy) <= model.arrival_tolerance
        if points.shape[1] <= BLOCK:
            stops[-1] = True
        if stops.any():
            break
    k = int(np.argmax(stops))  # the first point at which the movement stops
    return points[:, k], begin + k + 1, bool(hits[k])


def _recompute(task: Any, movements: list[list[Any]]) -> tuple[Any, ...]:
    """Make all movements of a part of a run again; with motor noise, only check them.

    Each movement is a list of its goal (from 1), hand, kind, ticks, and path as JSON. Raises
    ValueError if a rule is broken, or if ticks differ from the stored ticks.

    Returns reward, letters of the hands, number of corrective movements that take ticks, and joint
    travel of the idle arm (rad), summed over goals. With noise, returns None and the letters.
    """
    goals = [movement[0] for movement in movements]
    order = [*range(1, len(task.goals) + 1)]
    need(goals == sorted(goals) and sorted({*goals}) == order, f"its goals are {goals}")
    q, reward, letters, corrections, travel = task.q0, 0, "", 0, 0.0
    is_noisy = task.model.motor_noise > 0.0
    for goal in order:
        to_goal, before, hit = [move for move in movements if move[0] == goal], q, False
        hand = to_goal[0][1]
        need(hand in task.hands, f"the task has no {hand} hand")
        for _, same_hand, kind, stored, text in to_goal:
            need(same_hand == hand, f"goal {goal} has two hands")
            numbers = json.loads(text) if text else [math.nan] * len(task.q0)
            corners = np.atleast_2d(np.array(numbers, dtype=np.float64))
            is_locked = ((corners == task.q0) | np.isnan(corners))[:, task.locked].all()
            need(is_locked, "a movement moves a locked base")
            if is_noisy:
                hit, is_aim = True, not (np.isnan(corners).all() or np.isinf(corners).any())
                is_answer = stored is None and is_aim == (kind != "corrective")
                need(is_answer, f"a movement to goal {goal} is no answer in noise")
                continue
            end, ticks, hits = make(task, q, goal, hand, kind, corners)
            if hit or (kind == "corrective" and hits and ticks == 1):
                # The hand is in the goal already. A movement of 0 ticks without change names it.
                is_none = len(to_goal) == 1 and not stored and (corners == q).all()
                need(is_none, f"a movement is made after goal {goal} is hit")
                hit = True
                continue
            need(ticks == stored, f"a movement to goal {goal} takes {ticks} ticks, not {stored}")
            q, hit, reward = end, hits, reward - ticks
            corrections += kind == "corrective"
        need(hit, f"goal {goal} is not hit")
        letters += hand[0].upper()
        other = task.arms["right" if hand == "left" else "left"][0]
        travel += math.dist(q[other], before[other])
    return (None, letters) if is_noisy else (reward, letters, corrections, travel)


class Report(NamedTuple):
    """Result of :func:`check_runs`."""

    runs: int  # number of runs that were checked
    movements: int  # number of stored movements of the runs that do not differ
    wrong: list[str]  # a sentence for each run that differs or cannot be read
    unfinished: list[str]  # one sentence if runs of the plan are missing, otherwise empty


def check_runs(folder: Path) -> Report:
    """Execute the stored movements of a results folder, and report what differs or is missing.

    Runs that the last plan does not ask for are checked, too. No method is run. Raises an error,
    such as ValueError or sqlite3.Error, if the folder cannot be read or is damaged.
    """
    # Mode rw, because SQLite must undo an unfinished batch.
    where = f"{(folder / 'runs.sqlite').absolute().as_uri()}?mode=rw"
    with closing(sqlite3.connect(where, uri=True)) as db:
        db.row_factory = sqlite3.Row
        db.execute("PRAGMA query_only = ON")
        db.execute("PRAGMA trusted_schema = OFF")
        (version,) = db.execute("PRAGMA user_version").fetchone()
        need(version in (7, 8, 9), f"it has format {version}, not 7, 8 or 9")
        (state,) = db.execute("PRAGMA integrity_check(1)").fetchone()
        need(state == "ok", f"it is damaged: {state}")
        runs, movements, wrong = 0, 0, list[str]()
        columns = "*, '' AS world" if version == 7 else "*"  # format 7 has only the paper's world
        for row in db.execute(f"SELECT {columns} FROM results LEFT JOIN cells ON id = cell"):
            runs += 1
            try:
                movements += _check_run(row)
            except Exception as problem:  # any error is reported for its run
                wrong.append(f"Run {row['run_id']}: {problem}.")
        (asked,) = db.execute("SELECT coalesce(sum(runs), 0) FROM cells").fetchone()
        (stored,) = db.execute("SELECT count(*) FROM asked").fetchone()
        lacks = f"The plan asks for {asked} runs, of which the folder has {stored}."
        return Report(runs, movements, wrong, [lacks] if stored < asked else [])


def _check_run(row: Any) -> int:
    """Check a run, and return the number of its stored movements.

    Raises ValueError if the results differ, or if id, seed or labels belong to another run.
    """
    need(row["content"], "its cell is missing")
    task = stored_task(row["content"])
    text = f"{task.digest} {row['suite_seed']} {row['run']}"
    digits = hashlib.sha256(text.encode()).hexdigest()[:16]
    need(row["run_id"] == f"{digits}-{row['code']}", "it is not the run that its id says")
    words = np.frombuffer(hashlib.sha256(task.name.encode()).digest()[:16], "<u4").tolist()
    sequence = np.random.SeedSequence(row["suite_seed"], spawn_key=(*words, row["run"]))
    need(row["seed"] == int(sequence.generate_state(1, "u8")[0]) >> 1, "its seed is another one")
    labels = row["task"], row["method"], row["setting"], row["world"]
    need(task.labels == labels, f"it is listed as a run of {labels}, not of {task.labels}")
    parts, stored = json.loads(row["movements"]), [row["status"]]
    need(("solution" in parts) == (row["status"] == "ok"), f"its status is {row['status']}")
    for part, names in STATED.items():
        moves = parts.get(part, [])
        stored += [[part, *movement] for movement in moves]
        outcome = _recompute(task, moves) if moves else [None] * 4
        for name, now in zip(names, outcome, strict=False):
            close = name == "other_arm_travel" and moves and abs(row[name] - now) <= 1e-9
            need(close or row[name] == now, f"{part}: {name} is {now}, not {row[name]}")
    rewards = zlib.decompress(row["rewards"]) if row["rewards"] else bytes(4)
    need(row["trials"] in (None, len(rewards) // 4 - 1), "it has rewards of more or fewer trials")
    result = hashlib.sha256(json.dumps(stored).encode() + rewards).hexdigest()[:16]
    need(row["result"] == result, "a joint or a trial was changed")
    return len(stored) - 1


def main() -> int:
    """Check the folder that the command line names; return 1 if a run differs or is missing."""
    report = check_runs(Path(sys.argv[1]))
    print(f"{report.runs} runs checked, {report.movements} movements executed.")
    print(*(report.wrong or ["Nothing differs."]), *report.unfinished, sep="\n")
    return 1 if report.wrong or report.unfinished else 0


if __name__ == "__main__":
    sys.exit(main())
