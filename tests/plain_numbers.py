"""Twenty numbers of the findings, computed from the shipped runs of suite comparison in plain
NumPy: ``python tests/plain_numbers.py``. Nothing of coartic is imported."""

import json
import lzma
import sqlite3
import tempfile
from pathlib import Path

import numpy as np

SHIPPED = Path(__file__).parents[1] / "benchmarks" / "shipped" / "comparison.sqlite.xz"
BEST = {"ascending": -292, "descending": -304, "two-armed-1": -451, "two-armed-2": -300}
"""Best known rewards, as page *tasks* has them."""
ALONE = {"ascending": -319, "descending": -333, "two-armed-1": -532, "two-armed-2": -357}
"""Rewards of the corrective process alone with its best hands."""


def read(path):
    """Rows of view ``runs`` and of view ``solutions``, as dictionaries."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "runs.sqlite"
        file.write_bytes(lzma.decompress(path.read_bytes()))
        base = sqlite3.connect(file)
        base.row_factory = sqlite3.Row
        tables = [
            [dict(row) for row in base.execute(f"SELECT * FROM {view}")]
            for view in ("runs", "solutions")
        ]
        base.close()
    return tables


def numbers(path=SHIPPED):
    """Return the numbers by name."""
    runs, movements = read(path)
    ticks = {}
    for move in movements:
        ticks.setdefault(move["run_id"], {}).setdefault(move["goal"], []).append(move["ticks"])

    def of(method, task, setting=""):
        key = method, task, setting
        return [r for r in runs if (r["method"], r["task"], r["setting"]) == key]

    def rewards(*cell):
        return np.array([run["reward"] for run in of(*cell)], dtype=float)

    def first(method, task):
        (alone,) = of("corrective-alone/given", task)
        before = sum(ticks[alone["run_id"]][1])
        return np.mean([sum(ticks[run["run_id"]][1]) - before for run in of(method, task)])

    def mean_over_tasks(score, one, two):
        return np.mean([score(one if task in ("ascending", "descending") else two, task)
                        for task in BEST])  # fmt: skip

    def gap(method, task):
        return (BEST[task] - rewards(method, task).mean()) / abs(BEST[task])

    def share(method, task):
        return (rewards(method, task).mean() - ALONE[task]) / (BEST[task] - ALONE[task])

    learner = "dual-process/EC1", "dual-process/EC4"
    result = {}
    for task in ("ascending", "descending"):
        for method in (learner[0], "random-search"):
            result[f"first {task} {method}"] = first(method, task)
            result[f"whole {task} {method}"] = rewards(method, task).mean() - ALONE[task]
    for name, methods in (("learner", learner), ("cma", ("cma-es/bandit",) * 2),
                          ("hill climbing", ("hill-climbing",) * 2),
                          ("random search", ("random-search",) * 2)):  # fmt: skip
        result[f"gap {name}"] = mean_over_tasks(gap, *methods)
        result[f"share {name}"] = mean_over_tasks(share, *methods)
    ec2 = [run["hands"] for run in of("dual-process/EC2", "two-armed-1")]
    result["EC2 RRLR"] = ec2.count("RRLR")
    ec3 = [run["hands"] for run in of("dual-process/EC3", "two-armed-2")]
    result["EC3 RLRR"] = ec3.count("RLRR")
    result["RLRR random search"] = rewards("random-search", "two-armed-2", "hands=RLRR").mean()
    result["EC4 two-armed-2"] = rewards(learner[1], "two-armed-2").mean()
    return {name: float(value) for name, value in result.items()}


if __name__ == "__main__":
    print(json.dumps(numbers(), indent=1))
