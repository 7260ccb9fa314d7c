"""Suites run into folders, in this process where processes are not what is tested."""

import json
from pathlib import Path

import pandas as pd

from coartic import CoarticError, load_task
from coartic.analysis.results.folder import load_results
from coartic.analysis.results.laws import read_manifest
from coartic.benchmarks.declaration import MethodFileError, brief
from coartic.benchmarks.harness import perform_missing
from coartic.benchmarks.registry import registry
from coartic.benchmarks.run import plan_cells
from coartic.benchmarks.sandbox import failure
from coartic.benchmarks.specification import Limits
from coartic.benchmarks.suites import Cell, cell_plans, load_suite, select_cells
from coartic.benchmarks.worker import answer, perform
from coartic.runs.tables import TIMINGS

ROOT = Path(__file__).parents[2]


KNOWN = registry()


def run_specs(cells, **options):
    """Every run of every cell, in order, as :func:`coartic.benchmarks.suites.cell_plans` has
    them."""
    return [(plan.cell, spec) for plan in cell_plans(cells, **options) for spec in plan.specs()]


BROKEN = ROOT / "tests" / "plugins" / "broken.py"


def ask_here(foreign, **question):
    """As :mod:`coartic.benchmarks.registry` asks a method that is not built in, without a
    process."""
    try:
        return answer({**question, "foreign": foreign.model_dump(mode="json")})
    except Exception as error:
        said = str(error) if isinstance(error, CoarticError) else brief(error)
        raise MethodFileError(said) from None


def performed(job):
    """The answer to a job, without a process for it."""
    said = {"error": None, "answer": perform(json.loads(json.dumps(job)))}
    return {"run_id": job["run_id"], "outcome": json.dumps(said)}


class InProcess:
    """An executor without processes, for tests of everything else."""

    def __init__(self, jobs=1):
        pass

    def perform(self, jobs):
        yield from map(performed, jobs)


class Failing(InProcess):
    """An executor that loses the workers of some runs, by their number in the plan."""

    def __init__(self, *numbers):
        self.numbers = numbers

    def perform(self, jobs):
        for number, job in enumerate(jobs):
            if number in self.numbers:
                yield failure(job["run_id"], "crashed", "exit code 9", 1.0)
            else:
                yield from super().perform([job])


def paper_cells(**selection):
    return select_cells(load_suite("paper"), KNOWN, **selection)


def suite_of(tmp_path, *blocks):
    path = tmp_path / "own.toml"
    head = 'title = "x"\ndescription = "x"\nruns = 3\ntrials = 30\n'
    path.write_text(head + "".join(f"[[cells]]\n{block}\n" for block in blocks))
    return select_cells(load_suite(str(path)), KNOWN)


def perform_plan(specs, store, executor, **options):
    """Runs without a suite around them."""
    with store.locked():
        return perform_missing(specs, store, executor, **options)


def run_and_write(folder, cells=None, runs=2, trials=150, seed=0, executor=None, **options):
    limits = options.pop("limits", Limits(300.0))
    plan = plan_cells(
        load_suite("paper"),
        cells or paper_cells(),
        runs=runs,
        trials=trials,
        seed=seed,
        limits=limits,
    )
    plan.perform(folder, executor=executor or InProcess(), **options)
    return load_results(folder)


def same_tables(a, b):
    pd.testing.assert_frame_equal(
        a.runs.drop(columns=list(TIMINGS)), b.runs.drop(columns=list(TIMINGS))
    )
    for table in ("solutions", "paths", "learning"):
        pd.testing.assert_frame_equal(getattr(a, table)(), getattr(b, table)())
    pd.testing.assert_frame_equal(a.sequences, b.sequences)


def spec_of(known, name, limits=Limits(60.0), runs=1):  # noqa: B008
    cell = Cell(load_task("ascending"), known[name])
    return [spec for _, spec in run_specs([cell], runs=runs, seed=0, trials=5, limits=limits)]


def with_environment(folder):
    """The folder as if somebody had asked for it by the command line, at home."""
    manifest = read_manifest(folder)
    command = ("coartic", "run", "paper", "--out", "/home/somebody/results/x")
    environment = manifest.environment.model_copy(update={"command": command})
    manifest = manifest.model_copy(update={"environment": environment})
    (folder / "manifest.json").write_text(manifest.text(), encoding="utf-8")
    return load_results(folder)


def traced_cells():
    """Of the paper, beside planners, a search without a corrective process, and a variant."""
    found = [
        Cell(load_task(task), KNOWN[method])
        for task, methods in (
            ("ascending", ["dual-process/EC1", "trajectory-optimisation/path-length"]),
            ("descending", ["dual-process/EC1", "corrective-alone/given"]),
            ("two-armed-1", ["dual-process/EC3", "dual-process/EC4", "corrective-alone/given",
                             "random-search/pure"]),
        )
        for method in methods
    ]  # fmt: skip
    return [*found, Cell(found[-1].task, KNOWN["dual-process/EC4"], (("noise_sd", 0.1),))]
