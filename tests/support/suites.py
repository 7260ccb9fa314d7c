"""Run suites into folders, in this process unless processes are tested."""

import fcntl
import json
import lzma
import os
import sqlite3
from contextlib import closing

import pandas as pd

from coartic import load_task
from coartic.analysis.study import load
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.pool import Local
from coartic.benchmarks.registry import registry
from coartic.benchmarks.runner import perform
from coartic.benchmarks.worker import fail, perform_job
from coartic.runs.plan import Job, cell_of
from coartic.runs.store import RUNS_FILE
from tests.support.processes import ROOT

BROKEN = ROOT / "tests" / "methods" / "broken.py"
KNOWN = registry()


class InProcess(Local):
    """Executor that starts no processes, for tests of everything else."""

    workers = 1

    def __init__(self, jobs=1, verbose=False):
        self.workers = max(1, jobs)

    def perform(self, jobs, *, in_order=True):
        yield from ((job, perform_job(job)) for job in jobs)


class Failing(InProcess):
    """Executor that loses the workers of some jobs, which are named by number."""

    def __init__(self, *numbers):
        self.numbers = numbers

    def perform(self, jobs):
        for number, job in enumerate(jobs):
            lost = number in self.numbers
            yield job, fail(job, "crashed", "exit code 9") if lost else perform_job(job)


def cell_on(task, method, **parameters):
    """Return a cell with these parameters, and defaults of other parameters."""
    return cell_of(task, method, parameters)


def cells_of(suite, **selection):
    return [job.cell for job in plan_suite(suite, **selection)]


def paper_cells(**selection):
    return cells_of("paper", **selection)


def suite_of(tmp_path, *blocks):
    path = tmp_path / "own.toml"
    head = 'title = "x"\ndescription = "x"\nruns = 3\ntrials = 30\n'
    path.write_text(head + "".join(f"[[blocks]]\n{block}\n" for block in blocks))
    return cells_of(path)


def planned(cells=None, *, runs=2, trials=150, seed=0, time_limit_s=300.0, trial_budget=None):
    """Return a plan of some cells, by default those of the paper, as a part of suite ``paper``."""
    plan = []
    for each in paper_cells() if cells is None else cells:
        defaults, numbers = each.method.defaults, range(runs if each.method.stochastic else 1)
        changed = {k: v for k, v in each.parameters.items() if v != defaults.get(k)}
        whole = cell_of(each.task, each.method, changed, trials, trial_budget, each.model)
        plan.append(Job(whole, seed, numbers, time_limit_s, "paper"))
    return plan


def run_and_write(folder, cells=None, *, executor=None, **options):
    """Perform a plan of :func:`planned` into a folder, and return the study of the folder."""
    perform(planned(cells, **options), folder, executor=executor or InProcess())
    return load(folder)


def made_once(tmp_path_factory, name, make):
    """Return a folder that ``make`` fills once for all workers of pytest.

    The other workers wait for it.
    """
    root = tmp_path_factory.getbasetemp()
    root = root.parent if "PYTEST_XDIST_WORKER" in os.environ else root
    folder, made = root / name, root / f"{name}.made"
    with open(root / f"{name}.lock", "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        if not made.exists():
            make(folder)
            made.touch()
    return folder


def unpacked(place, folder):
    """Unpack the runs that are stored in folder ``place`` into a results folder."""
    packed = (place / f"{RUNS_FILE}.xz").read_bytes()
    (folder / RUNS_FILE).write_bytes(lzma.decompress(packed))
    return folder


def edit(folder, statement, *values):
    """Change a results folder with an SQL statement, which must change at least one row."""
    with closing(sqlite3.connect(folder / RUNS_FILE)) as database:
        assert database.execute(statement, values).rowcount
        database.commit()


def edit_movement(folder, run, change, part="solution", order=0):
    """Change a stored movement.

    ``run`` is the number of the run in the order of writing, from 1. ``change`` is called with a
    list of goal, hand, kind, ticks and path (a list of numbers), and changes it.
    """
    with closing(sqlite3.connect(folder / RUNS_FILE)) as database:
        query = "SELECT movements FROM results WHERE rowid = ?"
        parts = json.loads(database.execute(query, [run]).fetchone()[0])
        movement = parts[part][order]
        movement[4] = json.loads(movement[4])
        change(movement)
        movement[4] = json.dumps(movement[4], separators=(",", ":"))
    edit(folder, "UPDATE results SET movements = ? WHERE rowid = ?", json.dumps(parts), run)


def same_results(a, b):
    """Assert that two studies agree in everything but times and environments."""
    times = ["build_s", "solve_s", "wall_s", "cpu_s", "warm", "together", "process_peak_mb"]
    times += ["commit", "packages", "date"]
    pd.testing.assert_frame_equal(a.runs.drop(columns=times), b.runs.drop(columns=times))
    pd.testing.assert_frame_equal(a.solutions, b.solutions)
    for (first, ours), (second, theirs) in zip(a.rewards(), b.rewards(), strict=True):
        assert first == second
        assert ours.tolist() == theirs.tolist()


def traced_cells():
    """Return cells of learners, planners and hill climbing, and of a learner with more noise."""
    cells = [
        cell_on(load_task(task), KNOWN[method])
        for task, methods in (
            ("ascending", ["dual-process/EC1", "trajectory-optimisation/path-length"]),
            ("descending", ["dual-process/EC1", "corrective-alone/given"]),
            ("two-armed-1", ["dual-process/EC3", "dual-process/EC4", "corrective-alone/given",
                             "hill-climbing"]),
        )
        for method in methods
    ]  # fmt: skip
    return [*cells, cell_on(cells[-1].task, KNOWN["dual-process/EC4"], noise_sd=0.1)]
