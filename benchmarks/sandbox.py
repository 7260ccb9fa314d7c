"""Processes that runs are performed in, and the clock outside them.

:func:`supervise` performs one job in a child process that lives on from job to job, until
one of them times out or ends it. The child speaks JSON lines over pipes. Where a job
exceeds its time limit, or the child dies, the child is killed and the outcome is data; a
run whose child was killed by a signal is tried again in a fresh one first. Standard
library only: workers of any executor import this module, and must do so fast.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import selectors
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import IO, Any

# One run, one core: BLAS and OpenMP threads would only get in each other's way.
THREADS = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "NUMBA_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
    ),
    "1",
)
_END_LIMIT_S = 5.0
_RETRIES = 2  # fresh processes for a run whose process was killed
_START_LIMIT_S = 300.0  # imports and a cold compilation, on a slow machine


class SandboxError(RuntimeError):
    """The child cannot even start: no run would do better."""


class Sandbox:
    """One child process."""

    def __init__(self) -> None:
        self._messages: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the child
        self._process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.worker", str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._messages,
            env={**os.environ, **THREADS},
            start_new_session=True,  # Ctrl-C is for the parent
        )
        self._buffer = b""
        self._said_before = 0
        ready = self._read_line(_START_LIMIT_S)
        if ready != b"ready":
            self.close()
            raise SandboxError(f"a worker process did not start: {self._last_words()}")

    @property
    def alive(self) -> bool:
        """Whether the child still runs."""
        return self._process.poll() is None

    def perform(self, job: dict[str, Any]) -> dict[str, Any]:
        """One job: status and record (as text), or how it failed, which ends the child."""
        assert self._process.stdin is not None
        self._said_before = os.fstat(self._messages.fileno()).st_size
        clock = time.perf_counter()
        try:
            self._process.stdin.write(json.dumps(job).encode() + b"\n")
            self._process.stdin.flush()
            line = self._read_line(job["time_limit_s"])
        except BrokenPipeError:
            line = b""
        except BaseException:  # Ctrl-C: never read one job's answer as the next one's
            self.close()
            raise
        wall = time.perf_counter() - clock
        if line is None:
            self.close()
            reason = f"time limit of {job['time_limit_s']:g} s exceeded"
            return {"failure": "timeout", "reason": reason, "wall_s": wall}
        if not line:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_END_LIMIT_S)  # it closed its output: it is ending
            code = self._process.poll() or 0
            how = f"killed by {_signal_name(-code)}" if code < 0 else f"exit code {code}"
            reason = f"the worker process ended ({how}): {self._last_words()}"
            self.close()
            return {"failure": "crashed", "reason": reason, "wall_s": wall, "killed": code < 0}
        answer: dict[str, Any] = json.loads(line)
        record = self._read_line(_START_LIMIT_S)
        if not record:
            self.close()
            reason = "the worker process ended before it had handed over its record"
            return {"failure": "crashed", "reason": reason, "wall_s": wall}
        return {**answer, "record": record.decode()}

    def close(self) -> None:
        """End the child at once."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout, self._messages):
            with contextlib.suppress(OSError):  # a job it never read may be left in the pipe
                if stream is not None:
                    stream.close()

    def _read_line(self, limit: float | None) -> bytes | None:
        """One line; None where the limit passed, empty where the child ended."""
        assert self._process.stdout is not None
        deadline = None if limit is None else time.monotonic() + limit
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            while b"\n" not in self._buffer:
                left = None if deadline is None else max(0.0, deadline - time.monotonic())
                if not selector.select(left):
                    return None
                chunk = os.read(self._process.stdout.fileno(), 1 << 20)
                if not chunk:
                    return b""
                self._buffer += chunk
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line

    def _last_words(self) -> str:
        self._messages.seek(self._said_before)  # the child is gone: the offset is ours
        lines = self._messages.read().decode(errors="replace").strip().splitlines()
        return " | ".join(lines[-3:]) or "it left no message"


_local = threading.local()
_all: list[Sandbox] = []
_lock = threading.Lock()


def supervise(job: dict[str, Any]) -> dict[str, Any]:
    """Perform one job in this thread's sandbox."""
    sandbox: Sandbox | None = getattr(_local, "sandbox", None)
    if sandbox is None or not sandbox.alive:
        if sandbox is not None:
            sandbox.close()
        sandbox = _new_sandbox()
    answer = sandbox.perform(job)
    for _ in range(_RETRIES):
        if not answer.get("killed"):
            break
        # From outside (out of memory, an operator), or by its own fault: tried again.
        answer = _new_sandbox().perform(job)
    return {"run_id": job["run_id"], **answer}


def _new_sandbox() -> Sandbox:
    _local.sandbox = sandbox = Sandbox()
    with _lock:
        _all[:] = [other for other in _all if other.alive]
        _all.append(sandbox)
    return sandbox


@atexit.register
def _close_all() -> None:
    with _lock:
        for sandbox in _all:
            sandbox.close()


def die_with_parent(parent: int) -> None:
    """Have the kernel end this process when its parent (a process id) ends (Linux)."""
    if sys.platform != "linux":
        return
    import ctypes

    set_death_signal = 1  # PR_SET_PDEATHSIG
    ctypes.CDLL(None, use_errno=True).prctl(set_death_signal, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before we asked
        os._exit(1)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
