"""Processes forked from one that has imported what they need, which takes most of their time.

So begin the guards and workers of sandboxes (:mod:`coartic.benchmarks.sandbox`), kernels loaded.
What the system says of them, command line and first environment, is the nursery's: tests of how
processes are told by it use ``sandboxes_by_themselves``.

``python -m tests.support.nursery SOCKET MODULE...`` imports the modules; it does the ``main`` of
one in a fork for each message, and says how one has ended.
"""

import gc
import importlib
import json
import os
import random
import socket
import subprocess
import sys
import threading
import time
import traceback
from types import SimpleNamespace

from coartic.benchmarks.guard import THREADS

_MESSAGE = 1 << 18  # bytes, of an environment above all
_PYTHON = sys.executable


class Nursery:
    """Starts what is in ``modules``; those of sandboxes, in place of :mod:`subprocess` there."""

    PIPE, TimeoutExpired = subprocess.PIPE, subprocess.TimeoutExpired

    def __init__(self, modules=("coartic.benchmarks.guard", "coartic.benchmarks.worker")):
        self._modules = modules
        self._line, self._process, self._lock = None, None, threading.Lock()

    @property
    def pid(self):
        """Of the process, which is started when first asked for."""
        if self._process is None:
            self._line, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            with other:
                self._process = subprocess.Popen(
                    [_PYTHON, "-P", "-m", __name__, str(other.fileno()), *self._modules],
                    stdin=subprocess.DEVNULL,
                    pass_fds=[other.fileno()],
                    env={**os.environ, **THREADS, "PYTHONPATH": os.pathsep.join(sys.path)},
                    start_new_session=True,
                )
        return self._process.pid

    def Popen(self, command, **options):  # noqa: N802
        """A guard, or whatever else is to be started."""
        if command[:4] != [_PYTHON, "-P", "-m", "coartic.benchmarks.guard"]:
            return subprocess.Popen(command, **options)
        return _Guard(self, command[3:], options["env"])

    def start(self, command, environment, streams):
        """A process in a session of its own: module and arguments, and its three streams."""
        return _Process(self, command, environment, streams)

    def ask(self, question, streams=()):
        """The answer to one message."""
        with self._lock:
            assert self.pid
            socket.send_fds(self._line, [json.dumps(question).encode()], streams)
            return json.loads(self._line.recv(_MESSAGE))

    def close(self):
        """End the process."""
        if self._process is not None:
            self._line.close()
            self._process.wait()


class _Process:
    """As a Popen of it."""

    def __init__(self, nursery, command, environment, streams):
        self._nursery, self._command, self.returncode = nursery, command, None
        start = {"command": command, "environment": environment, "folder": os.getcwd()}
        self.pid = nursery.ask(start, streams)

    def poll(self):
        if self.returncode is None:
            self.returncode = self._nursery.ask(self.pid)
        return self.returncode

    def wait(self, timeout=None):
        return _waited_for(self.poll, self._command, timeout)


class _Guard(_Process):
    def __init__(self, nursery, command, environment):
        (theirs, stdin), (stdout, out), (stderr, error) = os.pipe(), os.pipe(), os.pipe()
        try:
            super().__init__(nursery, command, environment, [theirs, out, error])
        finally:
            for number in (theirs, out, error):
                os.close(number)
        self.stdin = os.fdopen(stdin, "wb")
        self.stdout, self.stderr = os.fdopen(stdout, "rb"), os.fdopen(stderr, "rb")


class _Worker:
    """As a Popen of it, in a guard."""

    def __init__(self, command, *, start_new_session):
        assert start_new_session
        self._command, self._pid = command, os.fork()
        if not self._pid:
            os.setsid()
            _end_with(_work)

    def wait(self, timeout):
        return _waited_for(lambda: _ended(self._pid), self._command, timeout)


def _waited_for(code, command, timeout):
    """Exit code, once there is one; as often looked for as by :mod:`subprocess`."""
    deadline = float("inf") if timeout is None else time.monotonic() + timeout
    delay = 0.0005
    while (found := code()) is None:
        if (left := deadline - time.monotonic()) <= 0:
            raise subprocess.TimeoutExpired(command, timeout)
        delay = min(2 * delay, left, 0.05)
        time.sleep(delay)
    return found


def _work():
    from coartic.benchmarks import worker

    random.seed()
    worker.main()


def _begin(start, streams):
    """What a fork of the nursery does."""
    from coartic.benchmarks import guard

    os.setsid()
    for target, stream in enumerate(streams):
        os.dup2(stream, target)
        os.close(stream)
    os.chdir(start["folder"])
    os.environ.clear()
    os.environ.update(start["environment"])
    sys.argv = start["command"]
    if sys.argv[0] == guard.__name__:
        sys.path[:] = os.environ["PYTHONPATH"].split(os.pathsep)  # all of it
        guard.subprocess = SimpleNamespace(Popen=_Worker, TimeoutExpired=subprocess.TimeoutExpired)
    if "dask" in sys.modules:
        sys.modules["dask"].config.refresh()  # it is in the environment
    importlib.import_module(sys.argv[0]).main()


def _end_with(what):
    """Do that and end as a program that is that does."""
    code = 1
    try:
        what()
        code = 0
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else bool(stop.code)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


_codes = {}


def _ended(pid):
    """Exit code of a child, as Popen has it, or None; however often it is asked for: two threads
    may ask at once."""
    if pid not in _codes:
        found, status = os.waitpid(pid, os.WNOHANG)
        if not found:
            return None
        _codes[pid] = os.waitstatus_to_exitcode(status)
    return _codes[pid]


def main():
    gc.disable()
    for module in sys.argv[2:]:
        importlib.import_module(module)
    if "coartic.benchmarks.worker" in sys.argv:
        coartic = sys.modules["coartic"]
        sys.modules["coartic.learner.learning"].warm_up(coartic.load_task("ascending"))
    gc.freeze()
    with socket.socket(fileno=int(sys.argv[1])) as line:
        while True:
            message, streams, *_ = socket.recv_fds(line, _MESSAGE, 3)
            if not message:
                break
            question = json.loads(message)
            if isinstance(question, int):
                answer = _ended(question)
            elif not (answer := os.fork()):
                line.close()
                _end_with(lambda: _begin(question, streams))  # noqa: B023
            else:
                _codes.pop(answer, None)  # of an earlier child by that number
            for stream in streams:
                os.close(stream)
            line.send(json.dumps(answer).encode())


if __name__ == "__main__":
    main()
