"""What a command says: sentences, tables, and how far a suite is."""

from __future__ import annotations

import os
import signal
import sys
import textwrap
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, TextIO

from coartic.text import counted, one_line

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console
    from rich.progress import TaskID

    from coartic.benchmarks.run import Progress

READABLE = 24  # characters that a column of text needs
WIDTH = 80  # columns where the output is not a terminal, and COLUMNS is not set
_AS_IT_IS: Any = {"markup": False, "emoji": False, "highlight": False}
"""Names in square brackets or between colons are no markup of rich."""


def say(*lines: str, stream: TextIO | None = None) -> None:
    """Print lines; whatever names are in them, each is one, and prints.

    Text comes to a terminal here, in :func:`show_frame` and in :class:`Display`.
    """
    print("\n".join(map(one_line, lines)), file=stream)


def complain(kind: str, text: str) -> None:
    """Print an ``Error`` or a ``Warning``, line by line."""
    say(*(f"{kind}: {line}" for line in text.splitlines()), stream=sys.stderr)


def console() -> Console:
    """Standard output, as wide as the terminal, as ``COLUMNS`` says or :data:`WIDTH`."""
    from rich.console import Console

    terminal, columns = Console(**_AS_IT_IS), os.environ.get("COLUMNS", "")
    if terminal.is_terminal:
        return terminal
    width = int(columns) if columns.isdecimal() and int(columns) else WIDTH
    return Console(width=width, **_AS_IT_IS)


def say_pairs(pairs: Iterable[tuple[str, str]]) -> None:
    """Print words and what is to be said of each, below each other; long text is wrapped."""
    kept = [(one_line(word), one_line(text)) for word, text in pairs]
    indent = max((len(word) for word, _ in kept), default=0) + 2
    width = max(console().width, indent + READABLE)
    for word, text in kept:
        together = text.replace(" %", "\xa0%")  # on one line
        lines = textwrap.wrap(together, width - indent, break_on_hyphens=False) or [""]
        for number, line in enumerate(lines):
            say(f"{'' if number else word:{indent}}{line}".replace("\xa0", " ").rstrip())


def show_frame(frame: pd.DataFrame) -> None:
    """Print a table, or nothing where it has no rows."""
    from rich import box
    from rich.table import Table

    if not len(frame):
        return
    table = Table(box=box.SIMPLE_HEAD, highlight=False)
    for name in frame.columns:
        table.add_column(one_line(str(name)), overflow="fold")
    for row in frame.astype(str).itertuples(index=False):
        table.add_row(*map(one_line, row))
    console().print(table)


@contextmanager
def performing(suite: str, folder: Path) -> Iterator[Display]:
    """The display of a suite whose runs are performed; interrupted, it ends the process."""
    with Display(suite) as display:
        try:
            yield display
        except BaseException as error:
            # Whatever else becomes of it, what comes after a Ctrl-C is its consequence.
            if not (display.interrupted or isinstance(error, KeyboardInterrupt)):
                raise
            display.close()
            done = f"{counted(display.done, 'finished run')} {'is' if display.done == 1 else 'are'}"
            say(
                f"Interrupted. {done} saved in {folder}; repeat the command to resume.",
                stream=sys.stderr,
            )
            sys.exit(130)


def _end_workers() -> None:
    import multiprocessing

    for child in multiprocessing.active_children():
        child.kill()


def if_interrupted(sentence: str) -> None:
    """What Ctrl-C says from here on, before it ends the process as ever."""

    def end(*_: object) -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        say(f"Interrupted. {sentence}", stream=sys.stderr)
        _end_workers()
        signal.raise_signal(signal.SIGINT)

    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # as it is in the background
        signal.signal(signal.SIGINT, end)


def writing(folder: Path) -> None:
    """From here on files are replaced in a folder: what Ctrl-C says of it."""
    if_interrupted(f"{folder} may be incomplete; repeat the command to finish it.")


_FROM_COMPILED = frozenset({"numba", "llvmlite", "pydantic"})
"""Packages whose compiled code calls Python in the middle of its work: it drops an exception of a
signal there, makes another one of it, or crashes."""


class Display:
    """Runs done, failures and time left: live on a terminal, plain lines elsewhere.

    While the runs are performed, Ctrl-C is a KeyboardInterrupt that does not get lost.
    """

    EVERY_S = 30.0  # between plain lines

    def __init__(self, suite: str) -> None:
        from rich import progress
        from rich.console import Console

        self.done = 0
        self.interrupted = False
        self._suite = suite
        self._console = Console(stderr=True, **_AS_IT_IS)
        self._bar = progress.Progress(
            progress.TextColumn("{task.description}", markup=False),
            progress.BarColumn(),
            progress.MofNCompleteColumn(),
            progress.TextColumn("{task.fields[failed]} failed"),
            progress.TimeRemainingColumn(),
            console=self._console,
            transient=False,
        )
        self._task: TaskID | None = None
        self._started = self._last = time.monotonic()  # set anew when work begins

    def __enter__(self) -> Display:
        self._before = signal.getsignal(signal.SIGINT)
        if self._before is not signal.SIG_IGN:  # as it is in the background
            signal.signal(signal.SIGINT, self._interrupt)
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
        signal.signal(signal.SIGINT, self._before)

    def _interrupt(self, _: int, frame: FrameType | None) -> None:
        self.interrupted = True
        while frame is not None:
            if frame.f_globals.get("__name__", "").partition(".")[0] in _FROM_COMPILED:
                return  # until the next update
            frame = frame.f_back
        raise KeyboardInterrupt

    def close(self) -> None:
        """Leave the terminal as it was."""
        if self._task is not None:
            self._bar.stop()

    def update(self, progress: Progress, what: str) -> None:
        """Show how far the plan is, and what was run last."""
        self._show(progress, what)
        if self.interrupted:  # and the exception was lost, as in a destructor
            raise KeyboardInterrupt

    def _show(self, progress: Progress, what: str) -> None:
        self.done = progress.done
        if not what:
            if progress.stale:
                count = counted(progress.stale, "run")
                self.line(f"Ignoring {count} made by a different version of the code.")
            if progress.present:
                total = counted(progress.total, "run")
                self.line(f"{progress.present} of {total} are already there.")
        if self._console.is_terminal:
            self._live(progress, what)
        else:
            self._plain(progress)

    def _live(self, progress: Progress, what: str) -> None:
        if self._task is None:
            if progress.present == progress.total:
                return
            self._bar.start()
            self._task = self._bar.add_task(
                one_line(self._suite), total=progress.total - progress.present, failed=0
            )
        words = what or "starting workers (the first time compiles)"
        self._bar.update(
            self._task,
            completed=progress.done,
            failed=progress.failed,
            description=one_line(words),
        )

    def _plain(self, progress: Progress) -> None:
        now = time.monotonic()
        if progress.done <= 1:  # the workers' start says nothing of the pace
            self._started = self._last = now
        there = progress.present + progress.done
        finished = there == progress.total
        if not progress.done or (now - self._last < self.EVERY_S and not finished):
            return
        self._last = now
        text = f"{there} of {counted(progress.total, 'run')}, {progress.failed} failed"
        if not finished:
            seconds = (now - self._started) / (progress.done - 1) * (progress.total - there)
            text += f", about {seconds:.0f} s left"
        self.line(text)

    def line(self, text: str) -> None:
        """Show a line above the progress."""
        self._console.print(one_line(text), soft_wrap=True)
