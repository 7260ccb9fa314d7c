"""The output of commands: sentences, tables, and progress."""

from __future__ import annotations

import os
import sys
import textwrap
import time
from collections.abc import Iterable
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
    print("\n".join(map(one_line, lines)), file=stream, flush=True)


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
    """Print pairs of word and text below each other; long text is wrapped."""
    kept = list(pairs)
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


class Display:
    """Runs done, failures and time left: live on a terminal, plain lines elsewhere."""

    EVERY_S = 30.0  # between plain lines

    def __init__(self, suite: str) -> None:
        from rich import progress
        from rich.console import Console
        from rich.table import Column

        self.done = 0
        self._suite = suite
        self._console = Console(stderr=True, **_AS_IT_IS)
        self._bar = progress.Progress(
            progress.BarColumn(20),
            progress.MofNCompleteColumn(),
            progress.TextColumn("{task.fields[failed]} failed"),
            progress.TextColumn("{task.fields[left]}", table_column=Column(width=24)),
            progress.TextColumn(
                "{task.description}", markup=False, table_column=Column(no_wrap=True, ratio=1)
            ),
            console=self._console,
            expand=True,
            transient=False,
        )
        self._task: TaskID | None = None
        self._last = time.monotonic()

    def __enter__(self) -> Display:
        return self

    def __exit__(self, *_: object) -> None:
        if self._task is not None:
            self._bar.stop()

    def update(self, progress: Progress, what: str) -> None:
        """Show the progress, and the task and method of the last run."""
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
                one_line(self._suite), total=progress.total - progress.present, failed=0, left=""
            )
        words = what or "starting workers (the first time compiles)"
        self._bar.update(
            self._task,
            completed=progress.done,
            failed=progress.failed,
            left=time_left(progress) if progress.done else "",
            description=one_line(words),
        )

    def _plain(self, progress: Progress) -> None:
        now = time.monotonic()
        there = progress.present + progress.done
        finished = there == progress.total
        if not progress.done or (now - self._last < self.EVERY_S and not finished):
            return
        self._last = now
        text = f"{there} of {counted(progress.total, 'run')}, {progress.failed} failed"
        self.line(text if finished else f"{text}, {time_left(progress)}")

    def line(self, text: str) -> None:
        """Show a line above the progress."""
        self._console.print(one_line(text), soft_wrap=True)


def time_left(progress: Progress) -> str:
    """How long the other runs of a plan take, in words."""
    seconds, is_all = progress.time_left
    minutes, rest = divmod(round(seconds), 60)
    spoken = f"{minutes} min {rest} s" if minutes else f"{rest} s"
    return f"{'about' if is_all else 'at least'} {spoken} left"
