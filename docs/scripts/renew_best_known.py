"""Renew the best known rewards of the families' first 40 test instances, and their bounds.

``renew_best_known.py FOLDER ...`` reads results folders: an instance gets the best reward of any
run, if that is better than what stands in ``coartic/tasks/best_known.csv``, and its solution in
``tests/best_known_solutions.json.xz``.

``renew_best_known.py --nodes 10000`` proves bounds with so many nodes for every instance that has
no proof and whose bound was made with fewer, those with few goals first; with ``--within 5`` only
where the bound is within 5 % of the reward. It takes hours; what an instance gave is written at
once, and what was done is not done again.
"""

from __future__ import annotations

import argparse
import csv
import io
import json
import lzma
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from coartic import CoarticError, Movement, Task, execute, load_task
from coartic.analysis.optima import restrictions
from coartic.analysis.study import Study, load
from coartic.baselines.certificate import certify
from coartic.internal.files import write_atomically
from coartic.internal.text import one_line
from coartic.model import PAPER
from coartic.runs.store import open_store
from coartic.tasks.families import shipped_families
from coartic.tasks.optima import BASE, BEST_KNOWN, essence
from coartic.tasks.task import address_of

MOST = 40
"""Instances of each family."""
SOLUTIONS = Path(__file__).parents[2] / "tests" / "best_known_solutions.json.xz"
COLUMNS = ["instance", "reward", "bound", "nodes", "hands", "essence"]
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
    """Take over what a folder's runs better; number of instances that changed."""
    changed = 0
    solved = study.runs[study.runs.status == "ok"]
    solved = solved[restrictions(solved).base == BASE]
    with open_store(study.folder) as store:
        for name, runs in solved.groupby("task"):
            address = address_of(str(name))
            if address is None or address.family not in shipped_families():
                continue
            if address.split != "test" or address.number >= MOST:
                continue
            task, best = study.tasks[str(name)], runs.loc[runs.reward.astype(int).idxmax()]
            row = rows.get(str(name), {"instance": name, "bound": "", "nodes": ""})
            if "reward" not in row or int(best.reward) > int(row["reward"]):
                movements = store.run(best.run_id).scores["solution"].movements
                solutions[str(name)] = solution_in_short(task, movements, int(best.reward))
                new = {"reward": int(best.reward), "hands": best.hands, "essence": essence(task)}
                rows[str(name)] = row | new
                changed += 1
    return changed


def to_be_proven(
    rows: dict[str, dict[str, Any]], nodes: int, within: float | None
) -> Iterable[dict[str, Any]]:
    """Rows without a proof whose bound was made with fewer nodes, those with few goals first."""
    for row in sorted(rows.values(), key=lambda row: (len(row["hands"]), row["instance"])):
        reward, bound = int(row["reward"]), int(row["bound"] or 0)
        near = within is None or bound - reward <= within / 100 * -bound
        if bound != reward and int(row["nodes"] or 0) < nodes and near:
            yield row


def prove(row: dict[str, Any], nodes: int) -> None:
    """Prove a bound of an instance with so many nodes; the sharper bound is kept."""
    task = load_task(row["instance"])
    proof = certify(task, -int(row["reward"]), still=False, model=PAPER, most_nodes=nodes)
    if proof.ticks:
        row["bound"] = min(-proof.ticks, int(row["bound"] or 0))
    row["nodes"] = nodes


def write(rows: dict[str, dict[str, Any]], solutions: dict[str, Any]) -> None:
    """Write the table and the solutions."""
    table = io.StringIO()
    writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows[name] for name in sorted(rows))
    write_atomically(BEST_KNOWN, table.getvalue().encode("ascii"))
    text = json.dumps({name: solutions[name] for name in sorted(solutions)}).encode()
    write_atomically(SOLUTIONS, lzma.compress(text, preset=9))


def main() -> None:
    """Renew rewards by the folders that are named, or bounds."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="*", help="results folders")
    parser.add_argument("--nodes", type=int, help="prove bounds with so many nodes")
    parser.add_argument("--within", type=float, help="where the bound is so near, per cent")
    asked = parser.parse_args()
    if not asked.folders and not asked.nodes:
        parser.error("name results folders, or --nodes")
    rows, solutions = read_known()
    for folder in asked.folders:
        try:
            print(f"{folder}: {better(load(folder), rows, solutions)} instances changed")
        except CoarticError as error:
            sys.exit(one_line(str(error)))
        write(rows, solutions)
    for row in to_be_proven(rows, asked.nodes, asked.within) if asked.nodes else []:
        prove(row, asked.nodes)
        print(*row.values(), flush=True)
        write(rows, solutions)


if __name__ == "__main__":
    main()
