"""Better the best known rewards of instances by results folders, whose paths are given.

Reads folders with tasks of families. Each of the first 40 test instances of a family gets
the best reward of any run and the lowest proven bound in ``coartic/tasks/best_known.csv``, if this
is better than what stands there, and its solution in ``tests/best_known_solutions.json.xz``.
"""

from __future__ import annotations

import csv
import io
import json
import lzma
import sys
from pathlib import Path
from typing import Any

import numpy as np

from coartic import CoarticError, Movement, Task, execute
from coartic.analysis.optima import from_runs, restrictions
from coartic.analysis.study import Study, load
from coartic.internal.files import write_atomically
from coartic.internal.text import one_line
from coartic.runs.plan import SEARCH
from coartic.runs.store import open_store
from coartic.tasks.families import shipped_families
from coartic.tasks.optima import BASE, BEST_KNOWN, essence
from coartic.tasks.task import address_of

MOST = 40
"""Instances of each family."""
SOLUTIONS = Path(__file__).parents[2] / "tests" / "best_known_solutions.json.xz"
COLUMNS = ["instance", "reward", "bound", "hands", "essence"]
_DIGITS = 5  # of joints, where this does not change the reward


def read_known() -> tuple[dict[str, dict[str, Any]], dict[str, Any]]:
    """What stands in the table and in the file of solutions, by instance."""
    if not BEST_KNOWN.exists():
        return {}, {}
    with BEST_KNOWN.open(encoding="ascii", newline="") as lines:
        rows = {row["instance"]: row for row in csv.DictReader(lines)}
    return dict(rows), json.loads(lzma.decompress(SOLUTIONS.read_bytes()))


def solution_in_short(task: Task, movements: tuple[Movement, ...], reward: int) -> list[Any]:
    """A solution as ``[goal, hand, kind, target, waypoints]`` for each movement.

    Raises CoarticError where it does not come to the reward.
    """
    for digits in (_DIGITS, 17):

        def short(joints: Any, digits: int = digits) -> Any:
            return None if joints is None else np.round(joints, digits).tolist()

        content = [
            [each.goal, each.hand, each.kind, short(each.target), short(each.waypoints)]
            for each in movements
        ]
        if execute(task, movements_of(content)).reward == reward:
            return content
    raise CoarticError(f"{task.name}: the solution does not come to {reward}")


def movements_of(content: list[Any]) -> tuple[Movement, ...]:
    """The movements of :func:`solution_in_short`."""
    return tuple(
        Movement(
            goal,
            hand,
            kind,
            None if target is None else np.array(target, dtype=np.float64),
            waypoints=None if waypoints is None else np.array(waypoints, dtype=np.float64),
        )
        for goal, hand, kind, target, waypoints in content
    )


def better(study: Study, rows: dict[str, dict[str, Any]], solutions: dict[str, Any]) -> int:
    """Better what is known by a folder's runs; number of instances that changed."""
    changed = 0
    solved = study.runs[study.runs.status == "ok"]
    asked = restrictions(solved)
    free = (asked.base == BASE) & (asked.other_arm == "free")
    searches = solved[solved.method.str.startswith(SEARCH) & free]
    with open_store(study.folder) as store:
        for name, runs in solved.groupby("task"):
            address = address_of(str(name))
            if address is None or address.family not in shipped_families():
                continue
            if address.split != "test" or address.number >= MOST:
                continue
            task, best = study.tasks[str(name)], runs.loc[runs.reward.astype(int).idxmax()]
            of_search = searches[searches.task == name]
            bound = from_runs(of_search).bound if len(of_search) else None
            old = rows.get(str(name))
            row = dict(old) if old else {"instance": name, "reward": -sys.maxsize, "bound": ""}
            if int(best.reward) > int(row["reward"]):
                movements = store.run(best.run_id).scores["solution"].movements
                solutions[str(name)] = solution_in_short(task, movements, int(best.reward))
                row |= {"reward": int(best.reward), "hands": best.hands, "essence": essence(task)}
            if bound is not None and (row["bound"] == "" or bound < int(row["bound"])):
                row["bound"] = bound
            rows[str(name)] = row
            changed += row != old
    return changed


def main() -> None:
    """Better the table and the solutions by the folders that are named."""
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        sys.exit("usage: python docs/scripts/renew_best_known.py RESULTS_FOLDER ...")
    rows, solutions = read_known()
    for folder in sys.argv[1:]:
        try:
            print(f"{folder}: {better(load(folder), rows, solutions)} instances changed")
        except CoarticError as error:
            sys.exit(one_line(str(error)))
    table = io.StringIO()
    writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows[name] for name in sorted(rows))
    write_atomically(BEST_KNOWN, table.getvalue().encode("ascii"))
    text = json.dumps({name: solutions[name] for name in sorted(solutions)}).encode()
    write_atomically(SOLUTIONS, lzma.compress(text, preset=9))


if __name__ == "__main__":
    main()
