"""How a command ends that is interrupted: with one sentence, whatever it is doing.

A signal raises :class:`Interrupted` once, and the blocks that it leaves put things in order.
Whatever takes too long then, the process ends all the same: a thread looks after that.
"""

from __future__ import annotations

import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

from coartic.threads import ENDING

GRACE_S = 2.0
"""Time to put things in order."""
_LATER_S = 0.02
_sentences: list[Callable[[], str]] = []
_said = threading.Lock()


class Interrupted(BaseException):
    """Somebody wants the process to end; its argument is the number of the signal."""


def catch_signals() -> None:
    """From here on, Ctrl-C and what else asks the process to end raise Interrupted; later ones do
    nothing. What the caller of the process ignores stays ignored, as ``nohup`` has it."""
    caught = [number for number in ENDING if signal.getsignal(number) != signal.SIG_IGN]
    told, tell = os.pipe()
    os.set_blocking(tell, False)

    def interrupt(number: int, _: Any) -> None:
        for each in caught:
            signal.signal(each, ignore)
        raise Interrupted(number)

    def ignore(number: int, _: Any) -> None:
        """Nothing: but the signal is not handed down to new processes, as SIG_IGN is."""

    def again(lost: Any) -> None:
        """What compiled code has called cannot raise: once more, when it has returned."""
        if not isinstance(lost.exc_value, Interrupted):
            sys.__unraisablehook__(lost)
            return
        number = lost.exc_value.args[0]
        signal.signal(number, interrupt)
        threading.Timer(_LATER_S, os.kill, (os.getpid(), number)).start()

    sys.unraisablehook = again
    for number in caught:
        signal.signal(number, interrupt)
    if hasattr(signal, "pthread_sigmask"):  # where signals are told of by numbers in a pipe
        signal.set_wakeup_fd(tell, warn_on_full_buffer=False)
        threading.Thread(target=end_in_time, args=(told, set(caught)), daemon=True).start()


def end_in_time(told: int, caught: set[int]) -> None:
    """End the process a while after a signal."""
    while (number := os.read(told, 1)[0]) not in caught:
        pass
    time.sleep(GRACE_S)
    say_interrupted()
    for end in _at_end:
        end()
    if "multiprocessing.util" in sys.modules:
        shutil.rmtree(sys.modules["multiprocessing.util"].get_temp_dir(), ignore_errors=True)
    os._exit(exit_code(number))


_at_end: list[Callable[[], None]] = []
"""What is done where a process ends without leaving its blocks."""


def exit_code(number: int) -> int:
    """130 after Ctrl-C, else 143."""
    return 130 if number == signal.SIGINT else 143


def end_interrupted(interrupted: Interrupted) -> NoReturn:
    """Say so and end the process."""
    say_interrupted()
    sys.exit(exit_code(interrupted.args[0]))


def ignore_signals() -> None:
    """From here on the process ends by itself."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


@contextmanager
def at_end(do: Callable[[], None]) -> Iterator[None]:
    """Have this done when the process is ended before the block is."""
    _at_end.append(do)
    try:
        yield
    finally:
        _at_end.remove(do)


@contextmanager
def explain(sentence: Callable[[], str]) -> Iterator[None]:
    """What is said where the block is interrupted; the sentence is made when that happens."""
    _sentences.append(sentence)
    try:
        yield
    except Interrupted:
        say_interrupted()
        raise
    finally:
        _sentences.remove(sentence)


def say_interrupted() -> None:
    """Say so, once."""
    if _said.acquire(blocking=False):
        words = " ".join(["Interrupted.", *(sentence() for sentence in _sentences[-1:])])
        with suppress(OSError, ValueError):  # nobody may be there to read it
            print(words, file=sys.stderr, flush=True)
