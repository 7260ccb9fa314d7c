"""Time limits and dying workers, seen from outside the method."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from benchmarks.executors import Local
from benchmarks.harness import perform_plan
from benchmarks.methods import registry
from benchmarks.sandbox import Sandbox
from benchmarks.specification import Limits
from benchmarks.store import Store
from benchmarks.suites import Cell, run_specs
from coartic import load_task

ROOT = Path(__file__).parent.parent
BROKEN = ROOT / "tests" / "plugins" / "broken.py"


@pytest.fixture(scope="module")
def known():
    return registry([BROKEN])


def spec_of(known, name, limits=Limits(60.0), runs=1):  # noqa: B008
    cell = Cell(load_task("ascending"), known[name])
    return [spec for _, spec in run_specs([cell], runs=runs, seed=0, trials=5, limits=limits)]


def test_hung_and_dying_methods_do_not_hang_or_kill_the_suite(known, tmp_path):
    store = Store(tmp_path)
    hung = spec_of(known, "test/sleeps", Limits(1.0), runs=2)
    dying = spec_of(known, "test/dies", runs=2)
    good = spec_of(known, "dual-process/EC1", runs=3)
    clock = time.monotonic()
    progress = perform_plan([*hung, *dying, *good], store, Local(2))
    assert time.monotonic() - clock < 60
    assert (progress.done, progress.failed) == (7, 4)
    for spec in hung:
        record = store.read(spec.run_id)
        assert (record["status"], record["reason"]) == ("timeout", "time limit of 1 s exceeded")
        assert 1.0 <= record["timing"]["wall_s"] < 10.0
    for spec in dying:
        record = store.read(spec.run_id)
        assert record["status"] == "crashed"
        assert record["reason"] == "the worker process ended (exit code 7): last words"
    for spec in good:
        record = store.read(spec.run_id)
        assert record["status"] == "ok"
        assert record["environment"]["threads"]["OMP_NUM_THREADS"] == "1"


def test_a_killed_worker_is_a_crash_with_its_signal(known):
    sandbox = Sandbox()
    (spec,) = spec_of(known, "test/sleeps")
    os.kill(sandbox._process.pid, signal.SIGKILL)
    answer = sandbox.perform(spec.job())
    assert answer["failure"] == "crashed"
    assert "killed by SIGKILL" in answer["reason"]
    assert not sandbox.alive


def test_one_sandbox_performs_many_jobs_and_says_warm(known):
    sandbox = Sandbox()
    try:
        records = [
            json.loads(sandbox.perform(spec.job())["record"])
            for spec in spec_of(known, "dual-process/EC1", runs=3)
        ]
    finally:
        sandbox.close()
    assert [record["timing"]["warm"] for record in records] == [False, True, True]
    assert all(record["status"] == "ok" for record in records)


def test_no_worker_outlives_a_killed_suite(tmp_path):
    """SIGKILL to the suite's own process; its workers go with it."""
    suite = subprocess.Popen(
        [sys.executable, "-m", "coartic", "run", "paper", "--out", tmp_path, "--jobs", "2"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "COARTIC_TEST_MARK": str(tmp_path)},
    )

    def marked():
        found = []
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                if f"COARTIC_TEST_MARK={tmp_path}".encode() in (entry / "environ").read_bytes():
                    found.append((entry / "cmdline").read_bytes().replace(b"\0", b" ").decode())
            except OSError:
                continue
        return [command for command in found if "resource_tracker" not in command]

    deadline = time.monotonic() + 120
    while not list(tmp_path.glob("records/*.json")):
        assert suite.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert sum("benchmarks.worker" in command for command in marked()) == 2
    suite.kill()
    suite.wait()
    while marked():
        assert time.monotonic() < deadline, marked()
        time.sleep(0.05)
