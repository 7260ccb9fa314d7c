"""Processes that methods run in, and the clock outside them.

A :class:`Sandbox` is a worker process under a guard (:mod:`coartic.benchmarks.guard`); it answers
questions, one JSON line each. Where it takes too long, says too much or dies, that is a
:class:`Failure`, and the worker ends with all that it has started. A :class:`Keeper` performs
jobs in one sandbox after another: methods of this project share one, any other method has one
that no other method's run is ever performed in.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import queue
import secrets
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import IO, Any

import psutil

from coartic.benchmarks.guard import THREADS, end, end_below
from coartic.errors import CoarticError
from coartic.learner.learning import METHOD_PREFIX
from coartic.text import plain

MARK = "COARTIC_SANDBOX"
"""Environment variable that a sandbox's processes can be told by."""
LARGEST_ANSWER = 128 << 20
"""Bytes of one answer."""
LAST_WORDS = 4096
"""Bytes that are kept of what a process prints."""
_END_LIMIT_S = 10.0
_CHUNK = 1 << 20  # bytes that a line is put together of: by Python, each part waits its turn
_LOOK_S = 0.1  # between looks at the clock
_LAST_S = 1.0  # for what a process had said when it ended
_RETRIES = 2  # fresh processes for a run whose process was killed
_START_LIMIT_S = 300.0  # imports and a cold compilation, on a slow machine


class SandboxError(CoarticError):
    """The worker cannot even start: no run would do better."""


@dataclass(frozen=True)
class Failure:
    """Why there is no answer."""

    outcome: str
    """``timeout`` or ``crashed``."""
    reason: str
    wall_s: float
    disturbed: bool = False
    """Maybe from outside: by a signal (out of memory, an operator), by another's words."""


class Sandbox:
    """One worker process."""

    def __init__(self) -> None:
        self._mark = secrets.token_hex(8)
        try:
            self._guard = subprocess.Popen(
                [sys.executable, "-P", "-m", "coartic.benchmarks.guard", str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, **THREADS, "PYTHONPATH": _path(), MARK: self._mark},
                bufsize=_CHUNK,
                start_new_session=True,  # Ctrl-C is for the parent
            )
        except OSError as error:
            raise SandboxError(f"a worker process did not start: {error.strerror}") from None
        self._questions: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._answers: queue.Queue[bytes | None] = queue.Queue(2)  # a flood has to wait
        self._said = bytearray()
        self._worker: psutil.Process | None = None
        _, _, self._listener = (
            _started(carry, stream)
            for carry, stream in (
                (self._write_questions, self._guard.stdin),
                (self._read_answers, self._guard.stdout),
                (self._read_messages, self._guard.stderr),
            )
        )
        with _lock:
            _open[:] = [other for other in _open if other.alive]
            _open.append(self)
        started = self._answer(_START_LIMIT_S)
        if isinstance(started, Failure):
            self.close()
            raise SandboxError(f"a worker process did not start: {started.reason}")
        with contextlib.suppress(psutil.Error, ValueError):
            self._worker = psutil.Process(int(started))

    @property
    def alive(self) -> bool:
        """Whether the worker still runs."""
        return self._guard.poll() is None

    def ask(
        self, question: dict[str, Any], limit_s: float | None, *, patient: bool = False
    ) -> bytes | Failure:
        """One answer as it was given, or why there is none, which ends the worker.

        The limit does not count while this process was stopped or asleep, nor, where it is
        ``patient``, while the worker was stopped. A method that nobody has read can stop itself.
        """
        self._said.clear()
        self._discard_answers()  # to questions that nobody asked
        token = secrets.token_hex(8)
        self._questions.put(json.dumps({**question, "token": token}).encode() + b"\n")
        try:
            answer = self._answer(limit_s, patient)
        except BaseException:  # Ctrl-C: never read one question's answer as the next one's
            self.close()
            raise
        if isinstance(answer, bytes):
            said, _, answer = answer.partition(b" ")
            if said != token.encode():
                answer = Failure(
                    "crashed", "it answered what nobody had asked", 0.0, disturbed=True
                )
        if isinstance(answer, Failure):
            self.close()
        return answer

    def close(self) -> None:
        """End the worker at once, with all that it has started."""
        guarded = self.alive
        with contextlib.suppress(psutil.Error):
            guard = psutil.Process(self._guard.pid)
            end_below(guard)
            end([guard])
        if not guarded:  # it may have been ended so that something is left
            end(filter(self._is_ours, psutil.process_iter()))
        if self._worker is not None and self._worker.is_running():  # it has lost its guard
            end_below(self._worker)
            end([self._worker])
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._guard.wait(_END_LIMIT_S)
        self._questions.put(None)
        self._discard_answers()

    def _is_ours(self, process: psutil.Process) -> bool:
        try:
            return bool(process.environ().get(MARK) == self._mark)
        except (psutil.Error, OSError):
            return False

    def _discard_answers(self) -> None:
        with contextlib.suppress(queue.Empty):
            while self._answers.get_nowait() is not None:
                pass
            self._answers.put(None)  # there will be none

    def _answer(self, limit_s: float | None, patient: bool = False) -> bytes | Failure:
        clock = before = time.monotonic()
        had = 0.0
        while True:
            left = _LOOK_S if limit_s is None else min(_LOOK_S, max(limit_s - had, 0.0))
            try:
                answer = self._answers.get(timeout=left)
            except queue.Empty:
                now = time.monotonic()
                if not (patient and self._stopped()):
                    had += min(now - before, 2 * _LOOK_S)
                before = now
                if limit_s is not None and had >= limit_s:
                    reason = f"time limit of {limit_s:g} s exceeded"
                    return Failure("timeout", reason, now - clock)
                if self.alive:
                    continue
                answer = self._last_answer()
            if answer is None:
                return self._end_of_worker(time.monotonic() - clock)
            if len(answer) >= LARGEST_ANSWER:
                reason = f"it answered with more than {LARGEST_ANSWER >> 20} MiB"
                return Failure("crashed", reason, time.monotonic() - clock)
            return answer

    def _last_answer(self) -> bytes | None:
        """What was said before the end, if it was."""
        try:
            return self._answers.get(timeout=_LAST_S)
        except queue.Empty:  # somebody else holds the stream open
            return None

    def _end_of_worker(self, wall_s: float) -> Failure:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._guard.wait(_END_LIMIT_S)  # it closed its output: it is ending
        self._listener.join(_LAST_S)
        code = self._guard.poll()
        number = 0 if code is None else code - 128 if code > 128 else -code if code < 0 else 0
        how = f"killed by {_signal_name(number)}" if number else f"exit code {code or 0}"
        return Failure(
            "crashed",
            f"the worker process ended ({how}): {self._last_words()}",
            wall_s,
            disturbed=bool(number),
        )

    def _stopped(self) -> bool:
        try:
            return self._worker is not None and self._worker.status() == psutil.STATUS_STOPPED
        except psutil.Error:
            return False

    def _last_words(self) -> str:
        lines = bytes(self._said).decode(errors="replace").strip().splitlines()
        return plain("\n".join(lines[-3:]), 1000) or "it left no message"

    def _write_questions(self, stream: IO[bytes]) -> None:
        """Apart from who asks, who would wait without end for a worker that does not read."""
        with contextlib.suppress(OSError), stream:
            while (question := self._questions.get()) is not None:
                stream.write(question)
                stream.flush()

    def _read_answers(self, stream: IO[bytes]) -> None:
        with stream:
            while line := stream.readline(LARGEST_ANSWER):
                if not line.endswith(b"\n") and len(line) < LARGEST_ANSWER:
                    break  # cut short: no answer
                self._answers.put(line)
                if len(line) >= LARGEST_ANSWER:
                    break
        self._answers.put(None)

    def _read_messages(self, stream: IO[bytes]) -> None:
        with stream:
            while chunk := stream.read1(1 << 16):  # type: ignore[attr-defined]
                self._said += chunk
                del self._said[:-LAST_WORDS]


class Keeper:
    """Performs jobs, each in a sandbox of its method, or of all that are built in."""

    def __init__(self) -> None:
        self._sandbox: Sandbox | None = None
        self._ready: set[tuple[int, bool]] = set()
        self._owner: str | None = None
        self._dismissed = False

    @property
    def reusable(self) -> bool:
        """Whether others may go on with its sandbox."""
        return self._owner is None and self._sandbox is not None and not self._dismissed

    def perform(self, job: dict[str, Any]) -> dict[str, Any]:
        """The answer to one job: ``outcome`` as the worker states it (text), or ``failure``,
        ``reason`` and ``wall_s``. Raises SandboxError where no worker can be started.

        A run whose worker was disturbed is tried again in a fresh one first.
        """
        found = self._ask(self._suited(job), job)
        for _ in range(_RETRIES):
            if isinstance(found, bytes) or not found.disturbed:
                break
            found = self._ask(self._fresh(job), job)
        if isinstance(found, bytes):
            return {"run_id": job["run_id"], "outcome": found.decode(errors="replace")}
        return failure(job["run_id"], found.outcome, found.reason, found.wall_s)

    def close(self) -> None:
        """End the sandbox."""
        if self._sandbox is not None:
            self._sandbox.close()
        self._sandbox = None

    def dismiss(self) -> None:
        """End the sandbox, from another thread as well, and start no other."""
        self._dismissed = True
        if (sandbox := self._sandbox) is not None:
            sandbox.close()

    def _ask(self, sandbox: Sandbox, job: dict[str, Any]) -> bytes | Failure:
        unready = self._prepare(sandbox, job)
        if unready is not None:
            reason = f"its worker could not be prepared: {unready.reason}"
            return replace(unready, outcome="crashed", reason=reason)
        question = {"question": "solve", **job}
        return sandbox.ask(question, job["time_limit_s"], patient=job["owner"] is None)

    def _suited(self, job: dict[str, Any]) -> Sandbox:
        sandbox = self._sandbox
        if sandbox is None or not sandbox.alive or self._owner != job["owner"]:
            return self._fresh(job)
        return sandbox

    def _fresh(self, job: dict[str, Any]) -> Sandbox:
        self.close()
        if self._dismissed:
            raise SandboxError("the suite has ended")
        self._sandbox = sandbox = Sandbox()
        self._owner = job["owner"]
        if self._dismissed:  # while it started
            sandbox.close()
        self._ready.clear()
        unready = self._prepare(sandbox, job)
        if unready is not None:
            raise SandboxError(f"a worker process did not start: {unready.reason}")
        return sandbox

    def _prepare(self, sandbox: Sandbox, job: dict[str, Any]) -> Failure | None:
        """Have the kernels compiled that the job's runs need, on nobody's clock."""
        specification = job["specification"]
        learns = specification["method"].startswith(METHOD_PREFIX)
        kernels = job["links"], learns
        if kernels in self._ready:
            return None
        question = {"question": "prepare", "task": specification["task"], "learns": learns}
        ready = sandbox.ask(question, _START_LIMIT_S)
        if isinstance(ready, Failure):
            return ready
        self._ready.add(kernels)
        return None


def failure(run_id: str, outcome: str, reason: str, wall_s: float) -> dict[str, Any]:
    """The answer to a job that no worker gave."""
    return {"run_id": run_id, "failure": outcome, "reason": reason, "wall_s": wall_s}


_idle: list[Keeper] = []
_open: list[Sandbox] = []
_lock = threading.Lock()


@contextlib.contextmanager
def keeper() -> Iterator[Keeper]:
    """A keeper that nobody else uses; one for built-in methods is kept for whoever is next."""
    with _lock:
        own = _idle.pop() if _idle else Keeper()
    try:
        yield own
    except BaseException:
        own.close()
        raise
    if own.reusable:
        with _lock:
            _idle.append(own)
    else:
        own.close()


def supervise(job: dict[str, Any]) -> dict[str, Any]:
    """Perform one job; see :meth:`Keeper.perform`."""
    with keeper() as own:
        return own.perform(job)


@atexit.register
def close_all() -> None:
    """End every sandbox of this process."""
    with _lock:
        sandboxes = list(_open)
        _open.clear()
        _idle.clear()
    for sandbox in sandboxes:
        sandbox.close()


def _started(carry: Callable[[IO[bytes]], None], stream: IO[bytes] | None) -> threading.Thread:
    thread = threading.Thread(target=carry, args=(stream,), daemon=True)
    thread.start()
    return thread


def _path() -> str:
    """Where this process finds its modules, for one that must find the same."""
    return os.pathsep.join(os.path.abspath(folder) for folder in sys.path)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
