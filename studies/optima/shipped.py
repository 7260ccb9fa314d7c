"""Read and write the shipped best known rewards, with their bounds and solutions.

``coartic/tasks/optima.json`` has entries for the paper's tasks. ``best_known.csv`` has rows for
instances of families, whose solutions are in ``solutions.json.xz`` in this folder.
``best_in_noise.csv`` has rows in a world with motor noise, and ``in_noise.json.xz`` solutions.
"""

import contextlib
import csv
import json
import lzma
from pathlib import Path

import numpy as np

from coartic import CoarticError, Movement, execute, load_task
from coartic.tasks.optima import BASE, BEST_IN_NOISE, BEST_KNOWN, DATA, entries

SOLUTIONS = Path(__file__).with_name("solutions.json.xz")
SOLUTIONS_IN_NOISE = SOLUTIONS.with_name("in_noise.json.xz")
FREE = (BASE, "free")
"""Base and other arm of entries without a restriction."""
OUT, LOG = Path("results", "optima"), "proofs.jsonl"
"""Default folder of the log of proofs, and name of the log."""
_NUMBERS = ("reward", "bound", "nodes")
_COLUMNS = ("instance", *_NUMBERS, "hands", "essence")
_COLUMNS_IN_NOISE = (
    "task", "motor_noise", "mean_ticks", "standard_error", "hands", "method", "essence"
)  # fmt: skip
_DIGITS = 5  # decimals of joints in a solution, if rounding does not change the reward


def read():
    """Return all entries, including rows of instances, by task, lock of the base and other arm."""
    known = entries()
    solutions = json.loads(lzma.decompress(SOLUTIONS.read_bytes()))
    with BEST_KNOWN.open(encoding="ascii", newline="") as lines:
        for row in csv.DictReader(lines):
            name = row["instance"]
            row |= {key: int(row[key]) if row[key] else None for key in _NUMBERS}
            row |= {"task": name, "base": BASE, "other_arm": "free", "solution": solutions[name]}
            known.append(row)
    return {key_of(entry): entry for entry in known}


def key_of(entry):
    """Return task, lock of the base and other arm of an entry."""
    return entry["task"], entry["base"], entry["other_arm"]


def read_log(folder):
    """Return the rows of a log of proofs. Lines that were cut off are left out.

    The list is empty if there is no log.
    """
    rows, log = [], folder / LOG
    for line in log.read_text(encoding="ascii").splitlines() if log.exists() else ():
        with contextlib.suppress(json.JSONDecodeError):
            rows.append(json.loads(line))
    return rows


def take_proof(known, row):
    """Copy a better solution and a sharper bound of a logged proof into ``known``.

    Returns True if an entry changed. Raises CoarticError for a solution that does not give its
    reward, and for a bound below a reward, because one of the two must be wrong.
    """
    entry = known.get(key_of(row), {})
    before = entry.get("reward"), entry.get("bound")
    if before[0] is None:
        return False
    if row["reward"] > entry["reward"]:
        execution = execute(load_task(row["task"]), movements_of(row["solution"]))
        if (execution.reward, execution.hands) != (row["reward"], row["hands"]):
            raise CoarticError(
                f"{row['task']}: the solution has reward {execution.reward} with hands "
                f"{execution.hands}; it must have {row['reward']} with {row['hands']}"
            )
        entry |= {key: row[key] for key in ("reward", "hands", "solution")}
        if "searches" in entry:
            entry["searches"] |= {"studies/optima": row["reward"]}
    if row["bound"] < entry["reward"]:
        raise CoarticError(
            f"{row['task']}: bound is {row['bound']}; it must not be below the reward "
            f"{entry['reward']}"
        )
    if before[1] is None or row["bound"] < before[1]:
        entry |= {"bound": row["bound"], "nodes": row["nodes"]}
    return before != (entry["reward"], entry["bound"])


def write(known):
    """Write all entries into their files."""
    ranked = [known[key] for key in sorted(known)]
    rows = [entry | {"instance": entry["task"]} for entry in ranked if "/" in entry["task"]]
    with BEST_KNOWN.open("w", encoding="ascii", newline="") as file:
        writer = csv.DictWriter(file, _COLUMNS, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    solutions = json.dumps({row["task"]: row["solution"] for row in rows}).encode()
    SOLUTIONS.write_bytes(lzma.compress(solutions, preset=9))
    optima = {"optima": [entry for entry in ranked if "/" not in entry["task"]]}
    DATA.write_text(f"{json.dumps(optima, indent=1, ensure_ascii=False)}\n", encoding="utf-8")


def read_in_noise():
    """Return the entries of the world with motor noise 0.01, by task: dictionaries with the columns
    of ``best_in_noise.csv`` and ``solution``."""
    if not SOLUTIONS_IN_NOISE.exists():
        return {}
    solutions = json.loads(lzma.decompress(SOLUTIONS_IN_NOISE.read_bytes()))
    with BEST_IN_NOISE.open(encoding="ascii", newline="") as lines:
        rows = [*csv.DictReader(lines)]
    return {row["task"]: row | {"solution": solutions[row["task"]]} for row in rows}


def write_in_noise(known):
    """Write the entries of the world with motor noise into their files."""
    with BEST_IN_NOISE.open("w", encoding="ascii", newline="") as file:
        writer = csv.DictWriter(file, _COLUMNS_IN_NOISE, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(known[task] for task in sorted(known))
    content = json.dumps({task: known[task]["solution"] for task in sorted(known)}).encode()
    SOLUTIONS_IN_NOISE.write_bytes(lzma.compress(content, preset=9))


def answer_in_short(movements):
    """Return what to do next as ``[goal, hand, kind, target, waypoints]`` for each movement.

    The joints are rounded. None stands for a joint that keeps still.
    """
    content = []
    for each in movements:
        targets = [each.target, *(each.waypoints if each.waypoints is not None else ())]
        short = [
            None if q is None else [None if np.isnan(x) else round(float(x), _DIGITS) for x in q]
            for q in targets
        ]
        content.append([each.goal, each.hand, each.kind, short[0], short[1:] or None])
    return content


def solution_in_short(task, movements, reward):
    """Return a solution as ``[goal, hand, kind, target, waypoints]`` for each movement.

    Raises CoarticError if its execution does not give the reward.
    """
    for digits in (_DIGITS, 17):
        content = []
        for each in movements:
            joints = (each.target, each.waypoints)
            short = [None if q is None else np.round(q, digits).tolist() for q in joints]
            content.append([each.goal, each.hand, each.kind, *short])
        if execute(task, movements_of(content)).reward == reward:
            return content
    raise CoarticError(
        f"{task.name}: the solution does not have reward {reward}, at any number of decimals"
    )


def movements_of(content):
    """Return the movements of :func:`solution_in_short`."""
    movements = []
    for *which, target, waypoints in content:
        q, path = (None if each is None else np.array(each, float) for each in (target, waypoints))
        movements.append(Movement(*which, q, waypoints=path))
    return tuple(movements)
