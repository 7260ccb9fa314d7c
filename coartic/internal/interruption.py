"""End an interrupted command with one line, and exit code 130 or 143.

Ctrl-C, SIGTERM and SIGHUP raise KeyboardInterrupt, so that each ``with`` ends its workers and
removes its temporary folders.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

ENDING = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
"""Signals by which people and systems end a program."""
_CLEANING_S = 5.0  # in which another signal is ignored
_heard: list[tuple[int, float]] = []  # each signal that was raised, and when
_words = ["Interrupted."]


def catch_signals() -> None:
    """Have the signals :data:`ENDING` (Ctrl-C, SIGTERM, SIGHUP) raise KeyboardInterrupt from now
    on, and unblock all signals. For 5 s after a signal has done so others are ignored. A signal
    that was ignored before, as by ``nohup``, stays so."""

    def interrupt(number: int, _: object) -> None:
        if not _heard or time.monotonic() > _heard[-1][1] + _CLEANING_S:
            _heard.append((number, time.monotonic()))
            raise KeyboardInterrupt

    signal.pthread_sigmask(signal.SIG_SETMASK, ())  # where all are blocked, no process would end
    for number in ENDING:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, interrupt)


@contextmanager
def interruptible(sentence: Callable[[], str]) -> Iterator[None]:
    """Call ``sentence`` if KeyboardInterrupt ends the block of this context, and note the text that
    it returns, for :func:`end_if_interrupted` to print; the exception passes."""
    try:
        yield
    except KeyboardInterrupt:
        _words.append(sentence())
        raise


def end_if_interrupted() -> None:
    """Exit if a signal has interrupted this process: print ``Interrupted.`` and the texts noted by
    :func:`interruptible` on stderr, and exit with code 130 if the first signal was Ctrl-C, else
    143. Otherwise return. The signals :data:`ENDING` are ignored from now on."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    if _heard:
        with suppress(OSError):  # stderr may be closed
            os.write(2, f"{' '.join(_words)}\n".encode())
        sys.exit(130 if _heard[0][0] == signal.SIGINT else 143)


@contextmanager
def blocked_signals() -> Iterator[None]:
    """Block the signals :data:`ENDING` (Ctrl-C, SIGTERM, SIGHUP) for this thread in the block of
    this context, also for processes that it starts there."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
