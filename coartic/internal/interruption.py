"""End an interrupted command with a short message, and exit code 130 or 143.

After :func:`catch_signals`, the signals SIGINT (Ctrl-C), SIGTERM and SIGHUP raise
KeyboardInterrupt, so that ``with`` blocks can end worker processes and remove temporary folders
before the command ends.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

ENDING = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
"""Signals that end a program: SIGINT (Ctrl-C), SIGTERM and SIGHUP."""
_CLEANING_S = 5.0  # time after a signal in which other signals are ignored
_received: list[tuple[int, float]] = []  # signals that raised KeyboardInterrupt, and their times
_message = ["Interrupted."]


def catch_signals() -> None:
    """Make SIGINT (Ctrl-C), SIGTERM and SIGHUP raise KeyboardInterrupt, and unblock all signals.

    For 5 s after one of the three signals has raised KeyboardInterrupt, further ones are ignored. A
    signal that the process ignores already, such as SIGHUP under ``nohup``, is still ignored.
    """

    def interrupt(number: int, _: object) -> None:
        if not _received or time.monotonic() > _received[-1][1] + _CLEANING_S:
            _received.append((number, time.monotonic()))
            raise KeyboardInterrupt

    signal.pthread_sigmask(signal.SIG_SETMASK, ())  # the parent may have blocked signals
    for number in ENDING:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, interrupt)


def raise_if_interrupted() -> None:
    """Raise KeyboardInterrupt if a signal has raised it before.

    The program may still run after the signal, because Python drops an exception that a signal
    handler raises inside a finaliser or a callback of a library.
    """
    if _received:
        raise KeyboardInterrupt


@contextmanager
def interruptible(sentence: Callable[[], str]) -> Iterator[None]:
    """Add a sentence to the final message if a ``with`` block is interrupted.

    If the block raises KeyboardInterrupt, the function ``sentence`` is called, which returns the
    sentence, and the error is raised again. :func:`end_if_interrupted` prints the final message.
    """
    try:
        yield
    except KeyboardInterrupt:
        _message.append(sentence())
        raise


def end_if_interrupted() -> None:
    """Exit with a message on standard error if a signal has interrupted this process.

    The exit code is 130 if the first signal was SIGINT (Ctrl-C), and otherwise 143. If there was no
    signal, the function returns. In both cases the process ignores the signals :data:`ENDING` from
    then on.
    """
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    if _received:
        with suppress(OSError):  # stderr may be closed
            os.write(2, f"{' '.join(_message)}\n".encode())
        sys.exit(130 if _received[0][0] == signal.SIGINT else 143)


@contextmanager
def blocked_signals() -> Iterator[None]:
    """Block the signals :data:`ENDING` in a ``with`` block.

    The signals are blocked in this thread, and in the processes that the thread starts in the
    block.
    """
    old_mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, old_mask)
