"""Perform shipped runs again, and compare rewards, hands and ticks with the shipped ones.

    python docs/scripts/check_shipped.py

The script performs one run of each cell of suite ``comparison``, and one run of the cheapest cell
of each method on each family of suite ``families``. With ``--all`` it performs one run of each cell
of both suites, which takes an hour. Runs by an earlier version of their method are not performed:
the script counts them as to be made again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence

import pandas as pd

from coartic.benchmarks.registry import built_in
from coartic.benchmarks.reproduce import perform_runs_again
from coartic.runs.record import PARTS, Run
from coartic.runs.shipped import open_shipped, shipped_hashes

CELL = ["suite", "task", "method", "setting"]


def shipped_runs() -> pd.DataFrame:
    """Return all shipped runs that have a solution, the cheapest first.

    They have the additional columns ``family`` (for a task of the paper its name) and
    ``is_current`` (True if the version of the method is that of this installation).
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
    """Select the runs to perform.

    They are the first run of each cell of ``comparison``, and of the cheapest cell of each method
    on each family of the other suites. With ``every``, they are the first run of all cells.
    """
    cells = runs.sort_values("run", kind="stable").groupby(CELL, sort=False).head(1)
    if every:
        return cells
    random = cells[cells.suite != "comparison"].sort_values("cpu_s")
    cheapest = random.groupby(["method", "setting", "family"], sort=False).head(1)
    return pd.concat([cells[cells.suite == "comparison"], cheapest])


def differences(rows: pd.DataFrame) -> Iterator[str]:
    """Perform shipped runs again, and yield a sentence on each difference.

    Runs by earlier versions of their method (``is_current`` is False) are left out.
    """
    runs = list[Run]()
    for suite, of_suite in rows[rows.is_current].groupby("suite"):
        with open_shipped(str(suite)) as store:
            runs += map(store.run, of_suite.run_id)
    for run, repeated in perform_runs_again(runs, built_in()):
        if (shipped := result_of(run)) != (result := result_of(repeated)):
            yield (
                f"{run.cell.label} on {run.cell.task.name}, run {run.number} ({run.id}), no longer "
                f"reproduces. It is shipped with {shipped} and has {result} here: fix your change, "
                "or raise the version of the method and make its runs again"
            )


def result_of(run: Run) -> str:
    """Return reward, hands and ticks of each movement of the parts of a run, as a string."""
    scores = {part: run.scores[part] for part in PARTS if part in run.scores}
    ticks = [[m.ticks for m in score.movements] for score in scores.values()]
    words = [f"{part} {score.reward} ({score.hands})" for part, score in scores.items()]
    return f"{', '.join(words) or run.outcome.status}, ticks {ticks}"


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
    print(*(f"- {sentence}" for sentence in found), sep="\n", end="\n" * bool(found))
    print(f"Runs by earlier versions, to be made again: {len(old) or 'none'} of {len(runs)}.")
    for (suite, method, version), rows_of in old.groupby(["suite", "method", "code"]):
        print(f"- {suite}: {len(rows_of)} of {method} {version}; here {built_in()[method].code}")
    return int(bool(found) or (options.release and len(old) > 0))


if __name__ == "__main__":
    sys.exit(main())
