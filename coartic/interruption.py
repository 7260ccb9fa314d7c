"""How a command ends that is interrupted: with one sentence, whatever it is doing.

Nothing is raised. A thread hears of the signal, lets what is unbroken be done, ends workers,
removes temporary folders, says so, and ends the process. Runs that are stored stay stored. Only
commands do so: in Python, Ctrl-C is a KeyboardInterrupt as everywhere.
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

ENDING = {
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
}
"""Signals by which people and systems end a program."""
_PATIENCE_S = 2.0  # for what is unbroken
_SHOW_CURSOR = "\x1b[?25h\n"  # a progress bar hides it
_ending = threading.Event()
_sentences: list[Callable[[], str]] = []
_at_end: list[Callable[[], None]] = []

unbroken = threading.RLock()
"""Held while something is done that is to be done before the process ends."""


def catch_signals() -> None:
    """From here on, Ctrl-C and what else asks the process to end is heard. What the caller of the
    process ignores stays ignored, as ``nohup`` has it."""
    caught = [number for number in ENDING if signal.getsignal(number) != signal.SIG_IGN]
    told, tell = os.pipe()
    os.set_blocking(tell, False)
    signal.set_wakeup_fd(tell, warn_on_full_buffer=False)
    for number in caught:
        signal.signal(number, lambda *_: None)
    threading.Thread(target=end_when_told, args=(told, caught), daemon=True).start()


def end_when_told(told: int, caught: list[int]) -> None:
    """End the process at the first signal: 130 after Ctrl-C, else 143."""
    while (number := os.read(told, 1)[0]) not in caught:
        pass
    _ending.set()
    unbroken.acquire(timeout=_PATIENCE_S)
    terminal, nobody = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # whatever else would be said now is a consequence
        os.dup2(nobody, stream)
    for end in reversed(_at_end):
        end()
    if "multiprocessing.util" in sys.modules:
        shutil.rmtree(sys.modules["multiprocessing.util"].get_temp_dir(), ignore_errors=True)
    words = " ".join(["Interrupted.", *(sentence() for sentence in _sentences[-1:])])
    with suppress(OSError):  # nobody may be there to read it
        os.write(terminal, f"{_SHOW_CURSOR * os.isatty(terminal)}{words}\n".encode())
    os._exit(130 if number == signal.SIGINT else 143)


def wait_if_ending() -> None:
    """Leave the end of the process to a signal, where one has come."""
    while _ending.is_set():
        time.sleep(1.0)


@contextmanager
def at_end(do: Callable[[], None]) -> Iterator[None]:
    """Have this done when the process is ended before the block is."""
    _at_end.append(do)
    try:
        yield
    finally:
        _at_end.remove(do)


@contextmanager
def temporary_folder() -> Iterator[str]:
    """A new folder, which is removed at the end of the block or of the process. Others may write
    into it meanwhile."""
    with (
        tempfile.TemporaryDirectory(prefix="coartic-", ignore_cleanup_errors=True) as folder,
        at_end(lambda: shutil.rmtree(folder, ignore_errors=True)),
    ):
        yield folder


@contextmanager
def explain(sentence: Callable[[], str]) -> Iterator[None]:
    """What is said where the block is interrupted; the sentence is made when that happens."""
    _sentences.append(sentence)
    try:
        yield
    finally:
        _sentences.remove(sentence)


@contextmanager
def blocked_signals() -> Iterator[None]:
    """A process that begins meanwhile is not told to end: Ctrl-C tells all that a terminal has."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
