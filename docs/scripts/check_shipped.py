"""Perform shipped runs again, and compare rewards, hands and ticks with the shipped ones.

    python docs/scripts/check_shipped.py

A cell is a task and a method with its setting. The script performs one run of each cell of suite
``comparison``. Of suite ``families``, it performs one run of each method on each family, in the
cell that costs the least time. With ``--all`` it performs one run of each cell of both suites,
which takes an hour. Runs by an earlier version of their method are not performed; the script prints
how many there are.

With ``--release`` the script also names the methods and families for which nothing shows whether a
later version changes them, and the entries that they need in :data:`SHORT_RUNS` and
:data:`FAMILIES`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections.abc import Iterator, Sequence

import pandas as pd

from coartic import execute, load_task
from coartic.benchmarks.registry import built_in
from coartic.benchmarks.reproduce import perform_runs_again
from coartic.method import run_method
from coartic.runs.record import PREFIXES, Row
from coartic.runs.shipped import open_shipped, shipped_hashes
from coartic.tasks.families import instance, shipped_families
from coartic.tasks.task import task_text

SHORT_RUNS = {
    "dual-process/EC1-uncorrected": ("two-armed-2", -357, "RRRR", 384_054),
    "dual-process/EC4-uncorrected": ("two-armed-2", -357, "RRRR", 406_895),
    "dual-process/custom": ("two-armed-2", -357, "RRRR", 821_009),
    "trajectory-optimisation/path-length": ("descending", -304, "RRR", 306),
    "trajectory-optimisation/squared-displacement": ("ascending", -298, "RRR", 94),
    "trajectory-optimisation/acceleration": ("descending", -319, "RRR", 128),
    "trajectory-optimisation/jerk": ("ascending", -323, "RRR", 23),
    "trajectory-optimisation/hand-jerk": ("descending", -409, "RRR", 44),
    "receding-horizon": ("ascending", -299, "RRR", 74),
    "optimum/search": ("ascending", -292, "RRR", 46),
    "optimum/in-model": ("ascending", -292, "RRR", 46),
}
"""Maps methods to the results of short runs with seed 1: task, reward, hands, and either the ticks
of all movements or the number of iterations of the solver. These are methods without a shipped run,
with 2,000 trials, and planners whose cheapest shipped run takes seconds, with the parameters of a
quick check."""
FAMILIES = {
    "aligned/v1": "7d54471d916711ce",
    "long/v1": "f1f48d64e2a1d1ee",
    "many-goals/v1": "431e6d2a591657a2",
    "one-armed/v1": "85c1cafe81ce2bc4",
    "redundancy/v1": "74dc928d21a32f17",
    "two-armed/v1": "3c581b274307a7ab",
}
"""Maps released families to their hashes (:func:`family_hash`). A family never changes, because
results on tasks of the same name would not be comparable. A family with another distribution gets a
new version."""
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
    for run, repeated in perform_runs_again(runs, built_in()):
        if (shipped := result_of(run)) != (result := result_of(repeated)):
            yield (
                f"{run.cell.label} on {run.cell.task.name}, run {run['run']} ({run['run_id']}), no "
                f"longer reproduces. It is shipped with {shipped} and has {result} here: fix your "
                "change, or raise the version of the method and make its runs again"
            )


def short_run(name: str, task: str) -> tuple[str, int, str, int]:
    """Perform the short run of a method, and return its entry in :data:`SHORT_RUNS`."""
    info = built_in()[name]
    trials = {"trials": 2000} if "trials" in info.defaults else {}
    parameters = info.configure(trials | info.load().quick)
    result, session = run_method(parameters, load_task(task), seed=1)
    execution, meter = execute(task, result.solution), session.meter
    effort = meter.movement_ticks or meter.solver_iterations
    return task, int(execution.reward), execution.hands, int(effort)


def family_hash(name: str) -> str:
    """Return a hash (16 hex digits) of a family and a task of each split."""
    family = json.dumps(shipped_families()[name].model_dump(mode="json"), sort_keys=True)
    drawn = [task_text(instance(f"{name}/{number}")) for number in ("i017", "d003", "2027-041")]
    return hashlib.sha256("".join([family, *drawn]).encode()).hexdigest()[:16]


def missing_entries(runs: pd.DataFrame) -> Iterator[str]:
    """Yield a sentence for each method and family that later versions could change unnoticed.

    ``runs`` are the shipped runs. A sentence has the entry that is missing in :data:`SHORT_RUNS` or
    :data:`FAMILIES`.
    """
    known = {*runs.method, *SHORT_RUNS}
    for name, info in built_in().items():
        if name not in known:
            tasks = ("two-armed-2", "ascending")
            task = next(task for task in tasks if info.inapplicable_reason(load_task(task)) is None)
            yield f'{name} has no shipped run: add "{name}": {short_run(name, task)} to SHORT_RUNS'
    for name in shipped_families():
        if name not in FAMILIES:
            yield f'{name} is new: add "{name}": "{family_hash(name)}" to FAMILIES'


def result_of(run: Row) -> str:
    """Return the reward, the hands and the ticks of a run's parts as a string.

    The ticks are those of each movement.
    """
    parts = [part for part in PREFIXES if part in run.movements]
    ticks = [[movement.ticks for movement in run.part(part)] for part in parts]
    words = [
        f"{part} {run[f'{PREFIXES[part]}reward']} ({run[f'{PREFIXES[part]}hands']})"
        for part in parts
    ]
    return f"{', '.join(words) or run['status']}, ticks {ticks}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Check the runs that the command line asks for, and print the result.

    Returns 1 if a run differs, or, with ``--release``, if a run is by an earlier version of its
    method or an entry is missing (:func:`missing_entries`); otherwise 0.
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
    missing = [*missing_entries(runs)] if options.release else []
    print(*(f"- {sentence}" for sentence in missing), sep="\n", end=("\n" if missing else ""))
    return int(bool(found) or bool(missing) or (options.release and len(old) > 0))


if __name__ == "__main__":
    sys.exit(main())
