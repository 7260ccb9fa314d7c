"""The output of commands: sentences, pairs, tables and progress, all by :func:`say`."""

from __future__ import annotations

import shutil
import sys
import textwrap
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING, TextIO

from coartic.text import counted, one_line

if TYPE_CHECKING:
    import pandas as pd

    from coartic.benchmarks.run import Progress

READABLE = 24  # characters that a column of text needs


def say(*lines: str, stream: TextIO | None = None, end: str = "\n") -> None:
    """Print lines; whatever names are in them, each is one, and prints."""
    print("\n".join(map(one_line, lines)), file=stream, end=end, flush=True)


def complain(kind: str, text: str) -> None:
    """Print an ``Error`` or a ``Warning``, line by line."""
    say(*(f"{kind}: {line}" for line in text.splitlines()), stream=sys.stderr)


def say_pairs(pairs: Iterable[tuple[str, str]]) -> None:
    """Print pairs of word and text below each other; long text is wrapped."""
    kept = list(pairs)
    indent = max((len(word) for word, _ in kept), default=0) + 2
    width = max(shutil.get_terminal_size().columns, indent + READABLE)
    for word, text in kept:
        together = text.replace(" %", "\xa0%")  # on one line
        lines = textwrap.wrap(together, width - indent, break_on_hyphens=False) or [""]
        for number, line in enumerate(lines):
            say(f"{'' if number else word:{indent}}{line}".replace("\xa0", " ").rstrip())


def show_frame(frame: pd.DataFrame) -> None:
    """Print a table."""
    say(*frame.astype(str).map(one_line).to_string(index=False).splitlines())


class Display:
    """Runs done, failures and time left, on standard error: in one line that changes on a
    terminal, and a line every half minute elsewhere."""

    EVERY_S = 30.0

    def __init__(self) -> None:
        self.done = 0
        """Runs performed now."""
        self._is_live = sys.stderr.isatty()
        self._last = time.monotonic()
        self._end = ""

    def __enter__(self) -> Display:
        return self

    def __exit__(self, *_: object) -> None:
        print(end=self._end, file=sys.stderr, flush=True)

    def update(self, progress: Progress, what: str) -> None:
        """Show the progress, and the task and method of the last run."""
        self.done, total = progress.done, counted(progress.total, "run")
        if not what:
            if progress.stale:
                count = counted(progress.stale, "run")
                self.line(f"Ignoring {count} made by a different version of the code.")
            if progress.present:
                self.line(f"{progress.present} of {total} are already there.")
        if progress.present == progress.total:
            return
        there = progress.present + progress.done
        is_finished = there == progress.total
        text = f"{there} of {total}, {progress.failed} failed"
        if progress.done and not is_finished:
            seconds, is_all = progress.time_left
            minutes, rest = divmod(round(seconds), 60)
            spoken = f"{minutes} min {rest} s" if minutes else f"{rest} s"
            text += f", {'about' if is_all else 'at least'} {spoken} left"
        if self._is_live:
            width = shutil.get_terminal_size().columns - 1
            words = one_line(f"{text}: {what or 'starting workers (the first time compiles)'}")
            print("\r", end="", file=sys.stderr)
            say(f"{words[:width]:{width}}", stream=sys.stderr, end="")
            self._end = "\n"
        elif progress.done and (is_finished or time.monotonic() - self._last >= self.EVERY_S):
            self._last = time.monotonic()
            self.line(text)

    def line(self, text: str) -> None:
        """Print a line; the progress goes on below it."""
        print(end=self._end, file=sys.stderr)
        self._end = ""
        say(text, stream=sys.stderr)
