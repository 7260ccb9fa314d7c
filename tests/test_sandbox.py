"""Time limits and dying workers, seen from outside the method."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import ClassVar

import psutil
import pytest

from coartic import CoarticError, load_task
from coartic.benchmarks import executors, sandbox
from coartic.benchmarks import registry as registry_module
from coartic.benchmarks.executors import Local
from coartic.benchmarks.harness import record_of
from coartic.benchmarks.registry import registry
from coartic.benchmarks.reproduce import perform_once
from coartic.benchmarks.sandbox import Failure, Keeper, Sandbox, close_all
from coartic.benchmarks.specification import Limits
from coartic.benchmarks.store import Store
from tests.support.packs import packs_of
from tests.support.suites import InProcess, ask_here, perform_plan, spec_of

TASK = load_task("ascending").model_dump(mode="json")
SPECIFICATION = {"method": "dual-process/EC1", "task": TASK}
JOB = {
    "run_id": "x",
    "owner": None,
    "time_limit_s": 1.0,
    "specification": SPECIFICATION,
    "links": 4,
}
PREPARE = {"question": "prepare", "task": TASK, "learns": True}
ROOT = Path(__file__).parent.parent
BROKEN = ROOT / "tests" / "plugins" / "broken.py"


@pytest.fixture(scope="module")
def known():
    """Methods, those of the broken file among them: asked here, performed in sandboxes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry_module, "_ask", ask_here)
        yield registry([BROKEN])


def performed_here(spec):
    """The record of a run that needs no sandbox."""
    (answer,) = InProcess().perform([spec.job()])
    return record_of(answer, spec)


@pytest.mark.usefixtures("no_sandbox_before")
def test_hung_and_dying_methods_do_not_hang_or_kill_the_suite(known, tmp_path, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")  # a worker has one all the same
    store = Store(tmp_path)
    hung = spec_of(known, "test/sleeps", Limits(0.5))
    dying = spec_of(known, "test/dies")
    good = spec_of(known, "dual-process/EC1", runs=2)
    clock = time.monotonic()
    progress = perform_plan([*hung, *dying, *good], store, Local(2))
    assert time.monotonic() - clock < 60
    assert (progress.done, progress.failed) == (4, 2)
    for spec in hung:
        record = store.read(spec.run_id)
        assert (record.status, record.reason) == ("timeout", "time limit of 0.5 s exceeded")
        assert 0.5 <= record.timing.wall_s < 10.0
    for spec in dying:
        record = store.read(spec.run_id)
        assert record.status == "crashed"
        assert record.reason == "the worker process ended (exit code 7): last words"
    for spec in good:
        record = store.read(spec.run_id)
        assert record.status == "ok"
        assert record.environment.threads["OMP_NUM_THREADS"] == "1"


@pytest.fixture
def no_sandbox_before():
    """Sandboxes of earlier tests are not taken for those of this one."""
    close_all()


@pytest.mark.usefixtures("no_sandbox_before")
def test_a_killed_worker_is_a_crash_with_its_signal(known):
    sandbox = Sandbox()
    (worker,) = workers()
    os.kill(worker, signal.SIGKILL)
    answer = sandbox.ask(PREPARE, 60.0)
    assert isinstance(answer, Failure)
    assert answer.disturbed
    assert "killed by SIGKILL" in answer.reason
    assert not sandbox.alive


@pytest.mark.usefixtures("sandboxes_by_themselves")
def test_a_worker_does_not_outlive_its_guard(monkeypatch):
    """Nor does what went away from below it, which is told by its mark."""
    monkeypatch.setattr(sandbox, "_LAST_S", 0.1)  # the worker holds its stream open
    own = Sandbox()
    (worker,) = map(psutil.Process, workers())
    mark = {sandbox.MARK: worker.environ()[sandbox.MARK]}
    gone_away = subprocess.Popen(["sleep", "60"], env=os.environ | mark)
    worker.suspend()  # it would answer still
    worker.parent().kill()
    answer = own.ask(PREPARE, 60.0)
    assert isinstance(answer, Failure)
    assert answer.disturbed
    assert "killed by SIGKILL" in answer.reason
    assert not worker.is_running() or worker.status() == psutil.STATUS_ZOMBIE
    ended = not psutil.pid_exists(gone_away.pid)
    gone_away.kill()
    gone_away.wait(30)
    assert ended


@pytest.mark.usefixtures("no_sandbox_before")
def test_a_question_that_nobody_reads_is_not_waited_for():
    """It is larger than what a pipe holds, and its worker stands still."""
    own = Sandbox()
    (worker,) = workers()
    os.kill(worker, signal.SIGSTOP)
    clock = time.monotonic()
    answer = own.ask({"question": "x" * 10_000_000}, 0.3)
    assert time.monotonic() - clock < 20
    assert isinstance(answer, Failure)
    assert (answer.outcome, answer.reason) == ("timeout", "time limit of 0.3 s exceeded")
    assert not own.alive


@pytest.mark.usefixtures("no_sandbox_before")
def test_a_worker_killed_from_outside_loses_nothing(known, tmp_path):
    """The run that it was at is performed again in a fresh process, and nobody can tell."""
    store = Store(tmp_path)

    class Killing(Local):
        def perform(self, jobs):
            for index, answer in enumerate(super().perform(jobs)):
                if index == 0:  # the next run has begun
                    (worker,) = workers()
                    os.kill(worker, signal.SIGKILL)
                yield answer

    progress = perform_plan(spec_of(known, "test/naps", runs=2), store, Killing(1))
    assert (progress.done, progress.failed) == (2, 0)


def workers():
    """Process ids of the workers at work below this process."""
    return [one._worker.pid for one in sandbox._open if one.alive]


@pytest.fixture(scope="module")
def shared(known):
    """Performs runs of any method in one process, and in another one where that has ended: a
    start takes longer than they do."""
    keeper = Keeper()
    yield lambda spec: record_of(keeper.perform({**spec.job(), "owner": None}), spec)
    keeper.close()


def test_one_sandbox_performs_many_jobs_and_says_warm(known, shared):
    records = [shared(spec) for spec in spec_of(known, "dual-process/EC1", runs=3)]
    assert [record.timing.warm for record in records] == [False, True, True]
    assert all(record.status == "ok" for record in records)


def test_the_clock_stops_where_the_run_is_stopped(known, shared):
    (spec,) = spec_of(known, "test/naps", Limits(1.0))
    stop = threading.Timer(0.3, lambda: [os.kill(p, signal.SIGSTOP) for p in workers()])
    go_on = threading.Timer(1.6, lambda: [os.kill(p, signal.SIGCONT) for p in workers()])
    (warm,) = spec_of(known, "test/good")
    shared(warm)
    stop.start()
    go_on.start()
    record = shared(spec)
    assert record.status == "ok"
    assert record.timing.wall_s > 1.1


def test_a_score_is_what_the_solution_gives_elsewhere(known, shared):
    """Whatever the method does to its own process."""
    (honest,) = spec_of(known, "test/good")
    (cheat,) = spec_of(known, "test/stepper")
    assert shared(cheat).solution == performed_here(honest).solution
    (prover,) = spec_of(known, "test/prover")
    assert "states a bound, which is for methods optimum/*" in performed_here(prover).reason


def test_a_method_that_kills_its_own_process_is_data(known, shared, monkeypatch):
    monkeypatch.setattr(sandbox, "_RETRIES", 0)
    (spec,) = spec_of(known, "test/segfaults")
    record = shared(spec)
    assert record.status == "crashed"
    assert "killed by SIGSEGV" in record.reason


def test_what_is_kept_of_a_run_is_bounded(known, shared, monkeypatch):
    (spec,) = spec_of(known, "test/chatterbox")
    record = shared(spec)
    assert record.status == "crashed"
    assert "exit code 3" in record.reason
    assert len(record.reason) < 1100
    assert "\x1b" not in record.reason
    (spec,) = spec_of(known, "test/hoarder")
    assert "at most 65536 are kept" in performed_here(spec).reason
    monkeypatch.setattr(sandbox, "LARGEST_ANSWER", 1 << 20)
    assert "it answered with more than 1 MiB" in shared(spec).reason


class Suite:
    """A command that runs many short lots: something is kept soon, and minutes are left to do,
    for a disk may be busy for seconds before it keeps the first.

    It begins as a fork, or by itself.
    """

    COMMAND = ("run", "paper", "--tasks", "ascending", "--runs", "20000", "--trials", "1000")

    def __init__(self, folder, jobs, *, by_itself):
        self._folder, self._mark = folder, f"COARTIC_TEST_MARK={folder}".encode()
        self._log = folder.with_name(f"{folder.name}.log")
        environment = os.environ | {"COARTIC_TEST_MARK": str(folder)}
        words = [*self.COMMAND, "--out", str(folder), "--jobs", str(jobs)]
        with self._log.open("wb") as log, open(os.devnull, "r+b") as nothing:
            if by_itself:
                self.process = subprocess.Popen(
                    [sys.executable, "-m", "coartic", *words],
                    stdout=nothing, stderr=log, env=environment,
                )  # fmt: skip
            else:
                streams = [file.fileno() for file in (nothing, nothing, log)]
                command = ["coartic.cli", *words]
                self.process = sandbox.subprocess.start(command, environment, streams)

    @property
    def error(self):
        return self._log.read_text(encoding="utf-8")

    def marked(self, name=""):
        """Processes of this suite, from it on down, or that it has left, with their commands;
        those of a name."""
        found = {}
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                if self._mark in (entry / "environ").read_bytes():
                    command = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode()
                    found[int(entry.name)] = command
            except OSError:
                continue
        return {
            pid: command for pid, command in found.items()
            if name in command and "resource_tracker" not in command
        }  # fmt: skip

    def await_processes(self, name, number, seconds):
        """So many processes of that name, or as many as there are after some seconds."""
        deadline = time.monotonic() + seconds
        while len(found := self.marked(name)) < number and time.monotonic() < deadline:
            assert self.process.poll() is None, self.error
            time.sleep(0.01)
        return found

    def await_records(self):
        deadline = time.monotonic() + 300  # as long as a worker may take to start
        while not packs_of(self._folder):
            assert self.process.poll() is None, self.error
            assert time.monotonic() < deadline
            time.sleep(0.05)


@pytest.mark.parametrize("moment", ["at work", "starting"])
@pytest.mark.parametrize("word", [signal.SIGKILL, signal.SIGINT])
def test_no_worker_outlives_its_suite(moment, word, tmp_path):
    """Killed or interrupted at work or as it starts, a suite takes its workers along.

    ``python -m coartic.benchmarks.kill_resume`` does it at a hundred moments.
    """
    in_order = word == signal.SIGINT
    jobs = 2 if in_order and moment == "starting" else 1  # each of them has to be ended
    suite = Suite(tmp_path / "out", jobs, by_itself=in_order and moment == "at work")
    try:
        if moment == "at work":
            suite.await_records()
            # There is none between two workers, on a machine at its limits.
            for worker in suite.await_processes("coartic.benchmarks.worker", 1, 10):
                if not in_order:
                    os.kill(worker, signal.SIGSTOP)  # or it would see that nobody asks
        else:
            assert suite.await_processes("coartic.benchmarks.guard", jobs, 300)
        assert suite.marked()
    finally:
        with contextlib.suppress(ProcessLookupError):  # it has ended, as its code will say
            os.kill(suite.process.pid, word)
        code = suite.process.wait(120)
    deadline = time.monotonic() + 60  # however long it took to get to work
    assert code == (130 if in_order else -signal.SIGKILL), suite.error
    if in_order:
        assert "Interrupted. " in suite.error
    while suite.marked():
        assert time.monotonic() < deadline, suite.marked()
        time.sleep(0.05)


def sleepers():
    """Processes that methods have left behind."""
    return [p for p in psutil.process_iter(["cmdline"]) if "61.7" in (p.info["cmdline"] or [])]


def test_what_a_method_starts_ends_with_it(known, tmp_path):
    """Also where it has left for a session of its own, and whether its run ends or is ended."""
    store = Store(tmp_path)
    left = spec_of(known, "test/leaver")
    stayed = spec_of(known, "test/stayer", Limits(0.5))
    perform_plan([*left, *stayed], store, Local(1))
    assert [store.read(spec.run_id).status for spec in (*left, *stayed)] == ["ok", "timeout"]
    close_all()
    assert sleepers() == []


class Counted:
    """Sandboxes in name only, each with what it was asked to perform."""

    made: ClassVar[list["Counted"]] = []
    answers = staticmethod(lambda question: b"done")
    preparations: ClassVar[list[bytes | Failure]] = [b"ready"]

    def __init__(self):
        self.jobs, self.prepared, self.alive = [], 0, True
        self.made.append(self)

    def ask(self, question, limit_s, *, patient=False):
        assert self.alive
        if question["question"] == "prepare":
            self.prepared += 1
            return self.preparations[min(self.prepared, len(self.preparations)) - 1]
        self.jobs.append(question["run_id"])
        answer = self.answers(question)
        self.alive = isinstance(answer, bytes)
        return answer

    def close(self):
        self.alive = False


@pytest.fixture
def counted(monkeypatch):
    monkeypatch.setattr(Counted, "made", [])
    monkeypatch.setattr(sandbox, "Sandbox", Counted)
    return Counted


def test_a_method_that_is_not_built_in_has_a_process_of_its_own(counted):
    keeper = Keeper()
    reusable = []
    for number, owner in enumerate(["a", "a", "b", None, None, "a"]):
        answer = keeper.perform({**JOB, "run_id": number, "owner": owner})
        assert answer == {"run_id": number, "outcome": "done"}
        reusable.append(keeper.reusable)
        assert [one.alive for one in counted.made] == [False] * (len(counted.made) - 1) + [True]
    # None is used for another method, and none of theirs for whoever is next.
    assert [one.jobs for one in counted.made] == [[0, 1], [2], [3, 4], [5]]
    assert reusable == [False, False, False, True, True, False]


def test_kernels_are_compiled_before_the_first_run_that_needs_them(counted):
    keeper, other = Keeper(), {**SPECIFICATION, "method": "corrective-alone/given"}
    jobs = [JOB, JOB, {**JOB, "links": 3}, {**JOB, "specification": other}, {**JOB, "links": 3}]
    seen = []
    for job in jobs:
        keeper.perform(job)
        seen.append(counted.made[0].prepared)
    assert seen == [1, 1, 2, 3, 3]
    assert len(counted.made) == 1


def test_a_worker_that_cannot_be_prepared_again_loses_that_run_alone(counted, monkeypatch):
    """A method that was there before may be why: the suite goes on."""
    failed = Failure("timeout", "time limit of 300 s exceeded", 300.0)
    monkeypatch.setattr(counted, "preparations", [b"ready", failed])
    keeper = Keeper()
    assert keeper.perform(JOB)["outcome"] == "done"
    answer = keeper.perform({**JOB, "links": 3})
    assert answer["failure"] == "crashed"
    assert "could not be prepared: time limit of 300 s" in answer["reason"]


@pytest.mark.parametrize(("disturbed", "tries"), [(True, 3), (False, 1)])
def test_a_run_that_was_disturbed_is_tried_again_in_fresh_processes(
    counted, monkeypatch, disturbed, tries
):
    failed = Failure("crashed", "killed", 0.5, disturbed=disturbed)
    monkeypatch.setattr(counted, "answers", staticmethod(lambda question: failed))
    answer = Keeper().perform(JOB)
    assert answer == sandbox.failure("x", "crashed", "killed", 0.5)
    assert [one.jobs for one in counted.made] == [["x"]] * tries


@pytest.mark.usefixtures("no_sandbox_before")
def test_a_line_from_elsewhere_is_no_answer():
    """Whoever may write into a worker's stream does not know what it was asked."""
    own = Sandbox()
    try:
        (worker,) = workers()
        os.kill(worker, signal.SIGSTOP)  # it would answer first
        stream = next(
            path for path in Path(f"/proc/{worker}/fd").iterdir()
            if os.readlink(path) == os.readlink(f"/proc/self/fd/{own._guard.stdout.fileno()}")
        )  # fmt: skip
        line = b'{"error": null, "answer": 1}\n'
        other = threading.Timer(0.05, lambda: stream.write_bytes(line))
        other.start()
        answer = own.ask(PREPARE, 60.0)
        other.join()
    finally:
        own.close()
    assert isinstance(answer, Failure)
    assert answer.reason == "it answered what nobody had asked"


class Quick:
    """Answers at once."""

    def __init__(self):
        self.begun = []

    def perform(self, job):
        self.begun.append(job["run_id"])
        return job

    def dismiss(self):
        pass


def test_workers_run_little_ahead_of_who_takes_their_answers(monkeypatch):
    """Of a million runs the answers would fill the memory."""
    quick, others = Quick(), threading.active_count()
    monkeypatch.setattr(executors, "keeper", lambda: contextlib.nullcontext(quick))
    answers = Local(2).perform([{"run_id": number} for number in range(500)])
    for taken in range(1, 30):
        next(answers)
        time.sleep(0.002)
        assert len(quick.begun) <= taken + 8
    assert len(list(answers)) == 471
    assert sorted(quick.begun) == list(range(500))
    assert list(Local(2).perform([])) == []
    ended = Local(2).perform([{"run_id": number} for number in range(500)])
    next(ended)
    ended.close()
    for _ in range(100):
        if threading.active_count() == others:
            break
        time.sleep(0.02)
    assert threading.active_count() == others
    assert len(quick.begun) <= 500 + 9 + 2


def test_a_worker_that_cannot_start_is_a_sentence(known, monkeypatch):
    monkeypatch.setattr(sandbox.sys, "executable", "/bin/false")
    (spec,) = spec_of(known, "dual-process/EC1")
    close_all()
    with pytest.raises(CoarticError, match=r"a worker process did not start: .*\(exit code 1\)"):
        perform_once(spec)
    monkeypatch.setattr(sandbox.sys, "executable", "/no/such/python")
    with pytest.raises(CoarticError, match="did not start: No such file or directory"):
        list(Local(1).perform([spec.job()]))
