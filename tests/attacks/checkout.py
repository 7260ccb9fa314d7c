"""The command line of a checkout, run as a user would, and what it left behind."""

from __future__ import annotations

import contextlib
import ctypes
import inspect
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PART_OF_A_FOLDER = re.compile(
    r"(runs|solutions|paths|learning|sequences)\.parquet|manifest\.json|comparison\.md"
    r"|methods\.csv|[0-9a-f]{16}-[0-9a-f]{12}"
)
"""A file or a run that a refusal names."""


@dataclass(frozen=True)
class Ended:
    """How a command ended: exit code (None where it had to be killed) and what it said."""

    code: int | None
    text: str

    @property
    def refused(self) -> bool:
        """Whether it ended with a sentence for people."""
        return (
            self.code == 2
            and "Traceback" not in self.text
            and any(line.startswith("error: ") for line in self.text.splitlines())
        )

    @property
    def names(self) -> bool:
        """Whether what it said names a part of a results folder."""
        return PART_OF_A_FOLDER.search(self.text) is not None

    @property
    def last_line(self) -> str:
        """The last line it said, shortened."""
        lines = self.text.strip().splitlines() or [""]
        return lines[-1][:150]


def run(
    root: Path, arguments: Sequence[str], folder: Path, *, limit: float, paths: Iterable[Path] = ()
) -> Ended:
    """Run a command in a folder, with home and temporary files there; kill it after ``limit`` s.

    ``paths`` go on the Python path after the checkout.
    """
    for name in ("home", "tmp"):
        (folder / name).mkdir(exist_ok=True)
    said = folder / f"said-{arguments[0]}.txt"
    with said.open("wb") as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "coartic", *arguments],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=file,
            start_new_session=True,
            env={
                **os.environ,
                "PYTHONPATH": ":".join(map(str, (root, *paths))),
                "HOME": str(folder / "home"),
                "TMPDIR": str(folder / "tmp"),
            },
        )
        try:
            code: int | None = process.wait(limit)
        except subprocess.TimeoutExpired:
            code = None
            for pid in (*descendants(), process.pid):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            process.wait()
    with said.open("rb") as file:
        head = file.read(100_000)
        file.seek(max(len(head), said.stat().st_size - 100_000))
        return Ended(code, (head + file.read()).decode(errors="replace"))


def in_process(arguments: Sequence[str]) -> tuple[int, str]:
    """Run a command in this process: its exit code, and what it said."""
    import contextlib
    import io
    import sys
    import traceback
    import warnings
    from unittest.mock import patch

    from coartic.cli import main

    said, code = io.StringIO(), 0
    with (
        patch.object(sys, "argv", ["coartic", *map(str, arguments)]),
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
        warnings.catch_warnings(),  # main has its own way of showing them
    ):
        try:
            main()
        except SystemExit as end:
            code = 0 if end.code is None else end.code if isinstance(end.code, int) else 1
        except BaseException:
            code = 1
            said.write(traceback.format_exc())
    return code, said.getvalue()


_DRIVER = f"""
from __future__ import annotations
{inspect.getsource(in_process)}
import json, sys
for line in sys.stdin:
    print(json.dumps(in_process(json.loads(line))), flush=True)
"""
ours: set[int] = set()
"""Processes that are to live on, though nothing below them is."""


class Driver:
    """One process of a checkout that runs many commands, each as if it were alone."""

    def __init__(self, root: Path, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _DRIVER],
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, "PYTHONPATH": str(root)},
        )
        ours.add(self._process.pid)

    def run(self, *arguments: str | Path) -> Ended:
        """One command."""

        print(json.dumps(list(map(str, arguments))), file=self._process.stdin, flush=True)
        line = self._process.stdout.readline()
        if not line:
            return Ended(None, "the process that runs commands has died")
        code, text = json.loads(line)
        return Ended(code, text)

    def close(self) -> None:
        """End the process."""
        ours.discard(self._process.pid)
        self._process.kill()
        self._process.wait()


def adopt_orphans() -> None:
    """Have every process below this one stay below it when its parent dies (Linux)."""
    set_child_subreaper = 36
    ctypes.CDLL(None, use_errno=True).prctl(set_child_subreaper, 1)


def descendants() -> list[int]:
    """Process ids of all that run below this process, but for :data:`ours`."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, ValueError):
            state, parent = (entry / "stat").read_text().rpartition(")")[2].split()[:2]
            if state != "Z" and int(entry.name) not in ours:
                parents[int(entry.name)] = int(parent)
    found: list[int] = []
    below = {os.getpid(), *ours}
    while below:
        below = {pid for pid, parent in parents.items() if parent in below}
        found += below
    return found


def left_behind(grace: float = 1.5) -> list[str]:
    """Commands of the processes that outlive what this process started; they are ended."""
    deadline = time.monotonic() + grace
    while descendants() and time.monotonic() < deadline:
        time.sleep(0.05)
    commands = []
    for pid in descendants():
        with contextlib.suppress(OSError):
            words = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ")
            commands.append(words.decode(errors="replace")[:80])
    deadline = time.monotonic() + 40  # some go on in others, for a while
    while (pids := descendants()) and time.monotonic() < deadline:
        for pid in pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.01)
    return commands


def size_of(folder: Path) -> int:
    """Bytes of all files below a folder."""
    return sum(p.lstat().st_size for p in folder.rglob("*") if p.is_file() or p.is_symlink())


def read_json(path: Path) -> Any:
    """A JSON file."""
    return json.loads(path.read_text(encoding="utf-8"))
