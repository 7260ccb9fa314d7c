"""A real Dask scheduler and two workers, one of which is killed mid-suite."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress

import pytest

from benchmarks.executors import Dask
from coartic import CoarticError

from .test_harness import paper_cells, run_and_write, same_tables


@contextmanager
def started(tmp_path, name, *command):
    """A process with its output in a file; killed with its group at the end."""
    log = tmp_path / f"{name}.log"
    with log.open("wb") as output:
        process = subprocess.Popen(
            [sys.executable, "-m", *command],
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            env={**os.environ, "DASK_DISTRIBUTED__WORKER__DAEMON": "False"},
        )
    try:
        yield process, log
    finally:
        kill(process)


def kill(process):
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def wait_for(log, pattern, seconds=60):
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        found = re.search(pattern, log.read_text(errors="replace"))
        if found:
            return found
        time.sleep(0.1)
    raise AssertionError(f"{pattern} not in {log.read_text(errors='replace')}")


@contextmanager
def cluster(tmp_path):
    """Address of a scheduler on loopback, its process, and those of its two workers."""
    arguments = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show")
    with started(tmp_path, "scheduler", "distributed.cli.dask_scheduler", *arguments) as (
        scheduler,
        log,
    ):
        address = wait_for(log, r"Scheduler at:\s+(tcp://127\.0\.0\.1:\d+)")[1]
        options = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1")
        worker = ("distributed.cli.dask_worker", address, *options)
        with (
            started(tmp_path, "one", *worker) as (one, log_one),
            started(tmp_path, "two", *worker) as (two, log_two),
        ):
            for log in (log_one, log_two):
                wait_for(log, r"Registered to:")
            yield address, [scheduler, one, two]


def test_results_equal_the_local_ones_though_a_worker_dies(tmp_path):
    cells = paper_cells(tasks=["two-armed-1", "ascending"])
    local = run_and_write(tmp_path / "local", cells, runs=6, trials=1500)
    seen = []
    with cluster(tmp_path) as (address, (_, *workers)):

        def watch(progress, spec):
            if spec is not None:
                seen.append(spec.run_id)
            if len(seen) == 5 and workers[0].poll() is None:
                threading.Thread(target=kill, args=(workers[0],)).start()

        far = run_and_write(
            tmp_path / "far", cells, runs=6, trials=1500, executor=Dask(address), watch=watch
        )
        assert workers[0].poll() is not None
        assert workers[1].poll() is None
    assert len(seen) == len(set(seen)) == 24
    same_tables(far, local)


def test_a_scheduler_that_goes_away_is_said_so(tmp_path):
    cells = paper_cells(tasks=["two-armed-1"])
    with cluster(tmp_path) as (address, processes):
        seen = []

        def watch(progress, spec):
            seen.append(spec)
            if len(seen) == 3:
                kill(processes[0])

        with pytest.raises(CoarticError, match="lost the Dask scheduler"):
            run_and_write(
                tmp_path / "far", cells, runs=8, trials=4000, executor=Dask(address), watch=watch
            )
    assert len(list((tmp_path / "far" / "records").glob("*.json"))) >= 2


def test_no_scheduler_is_said_so(tmp_path):
    with pytest.raises(CoarticError, match="no Dask scheduler at tcp://127.0.0.1:1"):
        run_and_write(tmp_path, runs=1, trials=1, executor=Dask("tcp://127.0.0.1:1", timeout_s=2))
