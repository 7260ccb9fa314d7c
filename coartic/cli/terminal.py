"""Print the output of commands: lines, pairs in two columns, tables and progress."""

from __future__ import annotations

import codecs
import math
import os
import re
import shutil
import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TextIO

from coartic.errors import CoarticError
from coartic.internal.text import one_line, pluralize

if TYPE_CHECKING:
    from coartic.benchmarks.runner import Progress
    from coartic.runs.plan import Cell

_READABLE = 24  # least width of a column of text, characters
_ASCII = {"−": "-", "–": "-", "…": ".", "×": "x", "\xa0": " "}


def _replaced(error: UnicodeError) -> tuple[str, int]:
    """Replace characters that an encoding does not have by ASCII characters.

    This is an error handler for module ``codecs``. It returns the replacement, and the index at
    which encoding continues. A character that is not in :data:`_ASCII` becomes ``?``.
    """
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(_ASCII.get(c, "?") for c in lacking), error.end


codecs.register_error("replaced", _replaced)


def say(*lines: str, stream: TextIO | None = None, end: str = "\n") -> None:
    """Print lines, in which characters that are not printable are replaced (:func:`.one_line`).

    For example, a line break in a name is replaced.

    Parameters
    ----------
    *lines : str
        The lines.
    stream : file, optional
        Stream to print on, by default standard output. If another stream cannot be written, for
        example because a disk is full, the lines are lost, and no error is raised.
    end : str
        String to print after the last line.

    Raises
    ------
    CoarticError
        Standard output cannot be written, for example because a disk is full.
    BrokenPipeError
        The program that reads the stream, such as ``head``, has ended.
    """
    stream = stream or sys.stdout
    text = "\n".join(map(one_line, lines)).replace("\u202f", " ")
    try:
        print(text, file=stream, end=end, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:  # such as a full device
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), stream.fileno())  # for the rest of the buffer
        if stream is sys.stdout:
            raise CoarticError(
                f"standard output cannot be written: {error.strerror or error}"
            ) from None


def complain(kind: str, text: str) -> None:
    """Print an error message or a warning on standard error.

    ``kind`` and a colon are printed before each line of ``text``. On a terminal, long lines are
    wrapped.

    Parameters
    ----------
    kind : str
        ``"Error"`` or ``"Warning"``.
    text : str
        The message.
    """
    width = shutil.get_terminal_size().columns if sys.stderr.isatty() else sys.maxsize
    for line in text.splitlines():
        say(*_wrap(f"{kind}: {line}", width), stream=sys.stderr)


def _wrap(text: str, width: int) -> list[str]:
    """Wrap a text at spaces, and return its lines.

    A line has at most ``width`` characters, unless it contains a longer word or command. Commands
    are not wrapped, so that users can copy them. A command is a part of the text in backticks, or
    the whole text if it begins with ``coartic``. A number and its % sign stay on one line, too.
    """
    fixed = re.sub("`[^`]*`|^coartic .*", lambda found: found[0].replace(" ", "\xa0"), text)
    wrapped = textwrap.wrap(
        fixed.replace(" %", "\xa0%"), width, break_long_words=False, break_on_hyphens=False
    )
    return [line.replace("\xa0", " ") for line in wrapped]


def say_pairs(pairs: Iterable[tuple[str, str]]) -> None:
    """Print pairs of a heading and a text in two columns.

    The second column is wrapped to the width of the terminal (:func:`_wrap`).
    """
    rows = list(pairs)
    indent = max((len(word) for word, _ in rows), default=0) + 2
    width = max(shutil.get_terminal_size().columns, indent + _READABLE)
    for word, text in rows:
        for number, line in enumerate(_wrap(text, width - indent) or [""]):
            say(f"{'' if number else word:{indent}}{line}".rstrip())


def say_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table with headings.

    The first column is left-aligned, and wrapped on a narrow terminal. All other columns are
    right-aligned. If there are no rows, nothing is printed.
    """
    if not rows:
        return
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else sys.maxsize
    widths = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
    widths[0] = min(widths[0], max(_READABLE, width - sum(widths[1:]) - 2 * len(widths[1:])))
    for name, *values in (headings, *rows):
        line, *more_lines = textwrap.wrap(name, widths[0]) or [""]
        cells = [f"{text:>{width}}" for text, width in zip(values, widths[1:], strict=True)]
        say("  ".join([f"{line:{widths[0]}}", *cells]), *more_lines)


class Display:
    """Context manager that shows on standard error what a command is doing.

    On a terminal, except one with ``TERM=dumb``, one line is shown and updated. Elsewhere, for
    example in a file, progress is printed at most every ten seconds, and once more at the end of
    the runs. Other messages (:meth:`line`) are printed at once.
    """

    EVERY_S = 10.0

    def __init__(self) -> None:
        self._doing: Callable[[], str] = str
        self._last = time.monotonic()
        self._bar: Any = None

    def __enter__(self) -> Display:
        if sys.stderr.isatty() and os.environ.get("TERM") != "dumb":
            self._bar = _progress_bar(lambda: self._doing())
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()

    def show(self, doing: str) -> None:
        """Show what the command is doing now.

        If there is no line that is updated, ``doing`` is printed only if at least ten seconds have
        passed since the display was made and since progress was last printed.
        """
        self._show(lambda: doing)

    def line(self, *texts: str) -> None:
        """Print lines on standard error, above the line that is updated if there is one."""
        for text in texts:
            say(text, stream=sys.stderr)

    def _show(self, doing: Callable[[], str], *, at_once: bool = False) -> None:
        self._doing, now = doing, time.monotonic()
        if not self._bar and (at_once or now - self._last >= self.EVERY_S):
            self._last = now
            self.line(doing())

    def update(self, progress: Progress, cell: Cell | None) -> None:
        """Show the progress of runs.

        The function is passed as argument ``watch`` to :func:`coartic.benchmarks.perform`. Before
        the first run, when ``cell`` is None, it prints how many runs are stored in the folder, and
        warnings about them. If all runs of the plan were stored before, no progress is shown.
        """
        if cell is None:
            self._say_present(progress)
        if progress.present == progress.total:
            return
        finished = progress.present + progress.done
        if self._bar:
            self._bar.update(self._bar.task_ids[0], completed=finished, total=progress.total)
        failed = f"{progress.failed} failed" if progress.failed else ""
        repeats = ""
        if progress.repeats:
            repeats = f"{pluralize(progress.repeats, 'run')} again, to see whether results repeat"
        parts = [f"Runs: {finished}/{progress.total}", failed, repeats]
        self._show(
            lambda: "  ".join(filter(None, [*parts, _time_left(progress.time_left.seconds)])),
            at_once=finished == progress.total and progress.time_left.seconds == 0,
        )

    def _say_present(self, progress: Progress) -> None:
        self.line(*progress.unused)
        if progress.others > 0:
            others = pluralize(progress.others, "run")
            self.line(
                f"{progress.folder} also has {others} of earlier commands, which this command "
                "does not report."
            )
        if progress.present:
            missing = pluralize(progress.total - progress.present, "run")
            self.line(
                f"Already stored: {progress.present} of {progress.total}; missing: {missing}."
            )
            self.line(*(f"{'; '.join(sentences)}." for sentences in progress.marks.values()))


def _progress_bar(doing: Callable[[], str]) -> Any:
    """Return a progress bar of the package ``rich``.

    The bar calls ``doing`` twice a second for the text beside it.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task
    from rich.table import Column
    from rich.text import Text

    class Doing(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(one_line(doing()), no_wrap=True, overflow="ellipsis")

    class Done(BarColumn):
        def render(self, task: Task) -> Any:
            return super().render(task) if task.total else Text()

    bar = Progress(
        SpinnerColumn(),
        Done(20),
        Doing(Column(ratio=1, no_wrap=True)),
        console=Console(stderr=True),
        redirect_stdout=sys.stdout.isatty(),
        refresh_per_second=2,
        transient=True,
        expand=True,
    )
    bar.add_task("", total=None)
    return bar


def _time_left(seconds: float) -> str:
    """Return a phrase for the time that is left, such as ``about 40 s left``.

    ``seconds`` is the time in s. The phrase is empty for NaN, and for times that are not above 0.
    """
    if not seconds > 0:  # True for NaN
        return ""
    if seconds < 10:
        return "less than 10 s left"
    if seconds < 100:
        return f"about {10 * round(seconds / 10)} s left"
    minutes = math.ceil(seconds / 60)
    return f"about {minutes} min left" if minutes < 100 else f"about {minutes / 60:.0f} h left"
