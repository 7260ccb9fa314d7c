"""Test the learner's rule for hands: a table by state against a centre for each hand sequence.

    PYTHONPATH=studies python studies/memory/hands.py results/memory-hands

runs suite hands.toml, and then random search with the final hands of each run of the learner. It
writes hands.csv.xz, with a row for each run, and hands.csv, with a row for each family. Stored runs
are not made again. All takes about half an hour on one core.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from coartic import load_task
from coartic.analysis import load
from coartic.analysis.statistics import task_mean
from coartic.baselines.random_search import RandomSearch
from coartic.benchmarks.runner import run_suite
from coartic.method import Session
from common.judging import two_sided_tests

HERE = Path(__file__).parent
TRIALS, RESAMPLES = 10_000, 99_999
CELLS = {
    "dual-process/EC4": "table",
    "hill-climbing begin=best": "centres",
    "hill-climbing": "as shipped",
}
"""Names of the suite's cells by label. A fourth cell, ``given``, has the hands of ``table``."""


def run_given(task, hands, seed):
    """Return the best reward of random search with fixed hands and as many stages as trials."""
    method = RandomSearch(RandomSearch.Parameters(trials=TRIALS, stages=TRIALS, hands=hands))
    session = Session(load_task(task), seed, RandomSearch.information)
    method.solve(session)
    return max(reward for reward in session.rewards if reward is not None)


def given(learner, folder):
    """Return the runs of cell ``given``, with the learner's hands.

    The runs on a task are read from its file in ``folder``. If there is none, they are made.
    """
    folder.mkdir(parents=True, exist_ok=True)
    tables = []
    for task, of_task in learner.groupby("task", sort=False):
        file = folder / f"{task.replace('/', '.')}.csv"
        if not file.exists():
            rewards = [*map(run_given, of_task.task, of_task.hands, of_task.seed)]
            of_task.assign(cell="given", reward=rewards).to_csv(file, index=False)
        tables.append(pd.read_csv(file))
    return pd.concat(tables)


def measure_runs(folder):
    """Return the runs of all four cells, with a row for each run."""
    runs = load(folder).runs
    runs = runs.assign(cell=runs.label.map(CELLS), family=runs.task.str.partition("/")[0])
    columns = ["family", "task", "cell", "run", "seed", "hands", "reward", "corrective_best"]
    runs = runs[columns].astype({"reward": float, "seed": "int64"})
    of_given = given(runs[runs.cell == "table"], folder / "given")
    return pd.concat([runs, of_given])


def tabulate(runs):
    """Tabulate the mean gains (in ticks) of each cell, with a row for each family.

    ``more`` is by how much the table gains more than the centres, with tests. ``over_shipped`` and
    ``over_given`` compare the table with the other two cells. ``same`` is the mean of ``more`` over
    the runs in which table and centres end with the same hands, and ``same_runs`` their number.
    """
    runs = runs.assign(gain=runs.reward - runs.corrective_best)
    gains = runs.pivot_table("gain", ["family", "task"], "cell")
    rows, samples = {}, {}
    by_run = runs.set_index(["family", "task", "run", "cell"]).unstack("cell")  # noqa: PD010
    same = by_run.hands.table == by_run.hands.centres
    more_of_same = (by_run.gain.table - by_run.gain.centres)[same]
    for family, of_family in gains.groupby("family", sort=False):
        more = of_family.table - of_family.centres
        samples[family] = more
        row = {"tasks": len(of_family), **of_family.mean().to_dict(), "median_more": more.median()}
        for name, values in {
            "more": more,
            "over_shipped": of_family.table - of_family["as shipped"],
            "over_given": of_family.table - of_family.given,
        }.items():
            row |= task_mean([values]).columns(name)
        of_same = more_of_same[family]
        rows[family] = row | {"same": of_same.mean(), "same_runs": len(of_same)}
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("family")
    tests = two_sided_tests(samples, RESAMPLES)
    table[["p", "p_without"]] = tests[["p", "p_without"]]
    table["verdict"] = np.where(tests.differs, np.where(table.more > 0, "pays", "costs"), "open")
    return table


def main(folder="results/memory-hands"):
    """Make the runs and write both tables."""
    print(run_suite(HERE / "hands.toml", folder), flush=True)
    runs = measure_runs(Path(folder))
    runs.to_csv(HERE / "hands.csv.xz", index=False, float_format="%.6g")
    tabulate(runs).to_csv(HERE / "hands.csv", float_format="%.6g")


if __name__ == "__main__":
    main(*sys.argv[1:])
