"""Twenty numbers of the findings, computed from the shipped runs of suite comparison in plain
NumPy: ``python tests/plain_numbers.py``. Nothing of coartic is imported."""

import json
import lzma
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np

SHIPPED = Path(__file__).parents[1] / "benchmarks" / "shipped" / "comparison.sqlite.xz"
BEST = {"ascending": -292, "descending": -304, "two-armed-1": -451, "two-armed-2": -300}
"""Best known rewards, as page *tasks* has them."""
ALONE = {"ascending": -319, "descending": -333, "two-armed-1": -532, "two-armed-2": -357}
"""Rewards of the corrective process alone with its best hands."""


LEARNER = "dual-process/EC1", "dual-process/EC4"
METHODS = {
    "learner": LEARNER, "cma": ("cma-es/bandit",) * 2,
    "hill climbing": ("hill-climbing",) * 2, "random search": ("random-search",) * 2,
}  # fmt: skip
"""Methods on tasks with one arm and with two."""


def numbers(path=SHIPPED):
    """Return the numbers by name."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "runs.sqlite"
        file.write_bytes(lzma.decompress(path.read_bytes()))
        with closing(sqlite3.connect(file)) as base:
            return {name: float(value) for name, value in computed(base)}


def computed(base):
    """Yield the numbers with their names, from views ``runs`` and ``solutions``."""

    def of(column, method, task, setting=""):
        where = "world = '' AND method = ? AND task = ? AND setting = ?"
        query = f"SELECT {column} FROM runs WHERE {where}"
        return np.array([value for (value,) in base.execute(query, (method, task, setting))])

    def first(method, task):
        ticks = "SELECT sum(ticks) FROM solutions s WHERE s.run_id = runs.run_id AND goal = 1"
        return of(f"({ticks})", method, task).mean()

    def reward(*cell):
        return of("reward", *cell).mean()

    for task in ("ascending", "descending"):
        for method in (LEARNER[0], "random-search"):
            yield (
                f"first {task} {method}",
                first(method, task) - first("corrective-alone/given", task),
            )
            yield f"whole {task} {method}", reward(method, task) - ALONE[task]
    for name, methods in METHODS.items():
        mean = {task: reward(methods["armed" in task], task) for task in BEST}
        yield f"gap {name}", np.mean([mean[task] / best - 1 for task, best in BEST.items()])
        yield f"share {name}", np.mean([
            (mean[task] - ALONE[task]) / (best - ALONE[task]) for task, best in BEST.items()
        ])  # fmt: skip
    yield "EC2 RRLR", (of("hands", "dual-process/EC2", "two-armed-1") == "RRLR").sum()
    yield "EC3 RLRR", (of("hands", "dual-process/EC3", "two-armed-2") == "RLRR").sum()
    yield "RLRR random search", reward("random-search", "two-armed-2", "hands=RLRR")
    yield "EC4 two-armed-2", reward(LEARNER[1], "two-armed-2")


if __name__ == "__main__":
    print(json.dumps(numbers(), indent=1))
