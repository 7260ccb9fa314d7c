"""Print the output of commands: sentences, pairs, tables and progress, all by :func:`say`."""

from __future__ import annotations

import codecs
import os
import shutil
import sys
import textwrap
import threading
import time
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, TextIO

from coartic.errors import CoarticError
from coartic.internal.text import counted, one_line, plain

if TYPE_CHECKING:
    from coartic.benchmarks.runner import Progress
    from coartic.runs.plan import Cell

_READABLE = 24  # least width of a column of text, characters
_ASCII = {"−": "-", "–": "-", "…": ".", "×": "x", "\xa0": " "}


def _replaced(error: UnicodeError) -> tuple[str, int]:
    """Return ASCII for the characters that a terminal lacks (``-`` for a minus sign, ``?`` for a
    character without a counterpart) and the index after them: an error handler for ``codecs``."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(_ASCII.get(c, "?") for c in lacking), error.end


codecs.register_error("replaced", _replaced)


def say(*lines: str, stream: TextIO | None = None, end: str = "\n") -> None:
    """Print lines on ``stream``, by default standard output, and then ``end``; characters that do
    not print, such as line breaks in names, are replaced; streams replace characters that the
    terminal lacks (:func:`coartic.cli.main`). Raises CoarticError if standard output cannot be
    written, BrokenPipeError if the reader of ``stream`` has ended; if another stream cannot be
    written, the lines are lost."""
    stream = stream or sys.stdout
    text = "\n".join(map(one_line, lines)).replace("\u202f", " ")
    try:
        print(text, file=stream, end=end, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:  # such as a full device
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), stream.fileno())  # what is left to be written
        if stream is sys.stdout:
            words = f"the standard output cannot be written: {error.strerror or error}"
            raise CoarticError(words) from None


def complain(kind: str, text: str) -> None:
    """Print each line of ``text`` on stderr after ``kind``, ``Error`` or ``Warning``, and a colon;
    on a terminal lines are broken between words."""
    width = shutil.get_terminal_size().columns if sys.stderr.isatty() else sys.maxsize
    wrap = textwrap.TextWrapper(width, break_long_words=False, break_on_hyphens=False).wrap
    for line in text.splitlines():
        say(*wrap(f"{kind}: {line}"), stream=sys.stderr)


def say_pairs(pairs: Iterable[tuple[str, str]]) -> None:
    """Print pairs of a word and a text, a pair a line; long texts are wrapped."""
    kept = list(pairs)
    indent = max((len(word) for word, _ in kept), default=0) + 2
    width = max(shutil.get_terminal_size().columns, indent + _READABLE)
    for word, text in kept:
        together = text.replace(" %", "\xa0%")  # a number and its % stay on one line
        lines = textwrap.wrap(together, width - indent, break_on_hyphens=False) or [""]
        for number, line in enumerate(lines):
            say(f"{'' if number else word:{indent}}{line}".replace("\xa0", " ").rstrip())


def say_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows of text below their headings, the first column to the left, other columns to the
    right; nothing without rows."""
    if rows:
        widths = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
        for first, *others in (headings, *rows):
            cells = [f"{text:>{width}}" for text, width in zip(others, widths[1:], strict=True)]
            say("  ".join([f"{first:{widths[0]}}", *cells]))


class Display:
    """Progress of a command on standard error, such as runs done, failures and time left. On a
    terminal one line changes; elsewhere a line appears about every ten seconds (:meth:`show`).
    What takes longer is shown again, with its time so far."""

    EVERY_S = 10.0

    def __init__(self) -> None:
        self._is_live = sys.stderr.isatty()
        self._doing = self._end = ""
        self._since = self._last = time.monotonic()  # begin of what is done, and last line
        self._over, self._one_line = threading.Event(), threading.Lock()

    def __enter__(self) -> Display:
        threading.Thread(target=self._remind, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self.line()

    def show(self, doing: str, *, at_once: bool = False) -> None:
        """Note what the command is ``doing`` from now on, and print it: on a terminal or with
        ``at_once`` always, else if ten seconds have passed since the last such line or the
        beginning. The time so far goes on where both texts begin with one word and a colon."""
        now, (before, same, _) = time.monotonic(), self._doing.partition(":")
        if not (same and doing.startswith(f"{before}:")):
            self._since = now
        self._doing = doing
        if self._is_live or at_once or now - self._last >= self.EVERY_S:
            self._print(doing)

    def line(self, *texts: str) -> None:
        """Print lines on stderr, below the line of progress, which stays as it is."""
        with self._one_line:
            say("", stream=sys.stderr, end=self._end)
            self._end = ""
            for text in texts:
                say(text, stream=sys.stderr)

    def _print(self, text: str) -> None:
        self._last = time.monotonic()
        if not self._is_live:
            self.line(text)
            return
        with self._one_line:
            width = shutil.get_terminal_size().columns - 1
            say("", stream=sys.stderr, end="\r")
            say(f"{plain(text, width):{width}}", stream=sys.stderr, end="")
            self._end = "\n"

    def _remind(self) -> None:
        while not self._over.wait(self.EVERY_S / 10):
            now = time.monotonic()
            if self._doing and now - self._last >= self.EVERY_S:
                self._print(f"{self._doing} ({now - self._since:.0f} s so far)")

    def update(self, progress: Progress, cell: Cell | None) -> None:
        """Show the progress, on a terminal with the cell of the last run, unless no run was
        missing; before the first run (``cell`` None) first show which runs are there already."""
        from coartic.analysis.methods import title_of

        total = progress.total
        if cell is None:
            for sentence in progress.unused:
                self.line(sentence)
            if progress.others:
                others = counted(progress.others, "other run")
                words = "which this command does not ask for: they are kept, and not reported"
                self.line(f"{progress.folder} holds {others}, {words}.")
            if progress.present:
                coming = counted(total - progress.present, "run")
                self.line(f"Already there: {progress.present} of {total}; to come: {coming}.")
                for sentences in progress.marks.values():
                    self.line(f"{'; '.join(sentences)}.")
        if progress.present == total:
            return
        there, seconds, left = progress.present + progress.done, progress.time_left, ""
        if seconds > 0:  # False for NaN
            left = f"{seconds / 60:.0f} min left" if seconds > 99 else f"{seconds:.0f} s left"
        failed = f"{progress.failed} failed" * bool(progress.failed)
        again = ""
        if progress.repeats:
            again = f"{counted(progress.repeats, 'run')} again, to see whether results repeat"
        last = "starting processes"
        if cell is not None:
            last = f"{cell.task.label}, {title_of(cell.method)}"
        parts = [f"Runs: {there}/{total}", failed, again, left, last * self._is_live]
        self.show("  ".join(filter(None, parts)), at_once=there == total)
