"""Perform shipped runs again, and compare rewards, hands, ticks and counts with the shipped ones.

    python docs/scripts/check_shipped.py

A cell is a task and a method with its setting. The script performs one run of each cell of suite
``comparison``. Of suite ``families``, it performs one run of each method on each family, in the
cell that costs the least time. With ``--all`` it performs one run of each cell of both suites,
which takes an hour. Runs by an earlier version of their method are not performed; the script prints
how many there are, and with ``--release`` it fails if there are any.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence

import pandas as pd

from coartic.benchmarks.registry import built_in
from coartic.benchmarks.reproduce import compare_again
from coartic.runs.record import Row
from coartic.runs.shipped import open_shipped, shipped_hashes

CELL = ["suite", "task", "method", "setting"]


def shipped_runs() -> pd.DataFrame:
    """Return all shipped runs that have a solution, the cheapest first.

    The frame has two additional columns: ``family`` is the family of the task, or the name of a
    task of the paper; ``is_current`` is True if the run was made by the version of the method that
    is installed here.
    """
    frames = []
    for suite in shipped_hashes():
        with open_shipped(suite) as store:
            frames.append(store.runs())
    runs = pd.concat(frames)
    runs = runs[runs.status == "ok"].sort_values(["cpu_s", "run_id"])
    here = {name: info.code for name, info in built_in().items()}
    return runs.assign(
        is_current=runs.code == runs.method.map(here),
        family=runs.task.str.partition("/")[0],
    )


def chosen(runs: pd.DataFrame, *, every: bool = False) -> pd.DataFrame:
    """Return the runs that are performed again.

    These are the first run of each cell of suite ``comparison``, and of the other suites the first
    run of the cheapest cell of each method (with its setting) on each family. If ``every`` is True,
    they are the first run of each cell.
    """
    cells = runs.sort_values("run", kind="stable").groupby(CELL, sort=False).head(1)
    if every:
        return cells
    random = cells[cells.suite != "comparison"].sort_values("cpu_s")
    cheapest = random.groupby(["method", "setting", "family"], sort=False).head(1)
    return pd.concat([cells[cells.suite == "comparison"], cheapest])


def differences(rows: pd.DataFrame) -> Iterator[str]:
    """Perform shipped runs again, and yield a sentence for each run whose result differs.

    ``rows`` are rows of :func:`shipped_runs`. Runs by earlier versions of their method
    (``is_current`` is False) are left out.
    """
    runs = list[Row]()
    for suite, of_suite in rows[rows.is_current].groupby("suite"):
        with open_shipped(str(suite)) as store:
            runs += map(store.run, of_suite.run_id)
    for run, changes in compare_again(runs, built_in(), postures=False):
        if changes:
            yield (
                f"{run.cell.label} on {run.cell.task.name}, run {run['run']} ({run['run_id']}), no "
                f"longer reproduces: {changes[0]}. Fix your change, or raise the version of the "
                "method and make its runs again"
            )


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the runs that the command line asks for, and print the result.

    Returns 1 if a run differs, or, with ``--release``, if a run is by an earlier version of its
    method; otherwise 0.
    """
    parser = argparse.ArgumentParser(prog="python docs/scripts/check_shipped.py")
    parser.add_argument("--all", action="store_true", help="one run of each cell (an hour)")
    parser.add_argument("--release", action="store_true", help="fail if a run has an old version")
    options = parser.parse_args(arguments)
    runs = shipped_runs()
    rows = chosen(runs, every=options.all)
    found = list(differences(rows))
    old = runs[~runs.is_current]
    print(f"{rows.is_current.sum()} shipped runs performed again: {len(found) or 'none'} differ.")
    print(*(f"- {sentence}" for sentence in found), sep="\n", end=("\n" if found else ""))
    print(f"Runs by earlier versions, to be made again: {len(old) or 'none'} of {len(runs)}.")
    for (suite, method, version), rows_of in old.groupby(["suite", "method", "code"]):
        print(f"- {suite}: {len(rows_of)} of {method} {version}; here {built_in()[method].code}")
    return int(bool(found) or (options.release and len(old) > 0))


if __name__ == "__main__":
    sys.exit(main())
