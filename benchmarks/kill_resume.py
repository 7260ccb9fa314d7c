"""Kills a suite at random times, resumes it, and checks that nothing is lost, doubled or left.

``python -m coartic.benchmarks.kill_resume [--kills 100] [--seed 0]`` runs a small suite once
without interruption, then again and again under SIGKILL at random times, each time going on in the
same folder, until the wanted number of kills has hit. Each folder has two turns: kills anywhere
in the length of a whole suite, until it is complete, and then in the later half of one whose
runs are all done, which only makes the tables and the comparison. Every folder that gets
completed is compared with the uninterrupted one: same runs, each once, the same tables apart
from timings, no half-written file. No process of a killed suite may outlive it, and nothing of
it may stay in shared memory. Exit code 1 otherwise.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, fields
from pathlib import Path

import pandas as pd

from coartic.packs import Packs
from coartic.tables import TIMINGS

TABLES = ("runs", "solutions", "paths", "learning", "sequences")
SUITE = ("run", "quick", "--tasks", "ascending,two-armed-2", "--runs", "3", "--trials", "3000")
SHARED_MEMORY = Path("/dev/shm")
_MARK = "COARTIC_KILL_RESUME"
_KILLS_A_TURN = 5
_GRACE_S = 10.0  # in which the kernel ends a killed suite's workers


@dataclass
class Counts:
    """What was done and what was found."""

    kills: int = 0
    mid_runs: int = 0
    """Kills with some runs done and some not."""
    mid_tables: int = 0
    """Kills with some tables written anew and some not."""
    folders: int = 0
    """Folders that got completed."""
    differing: int = 0
    """Folders with lost or doubled runs, different tables or half-written files."""
    outlived: int = 0
    """Kills that a process of the suite outlived."""
    shared: int = 0
    """Entries in shared memory of suites that are gone."""

    @property
    def failures(self) -> int:
        """How often something did not hold."""
        return self.differing + self.outlived + self.shared


def main() -> None:
    """Kill, resume, compare, and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        counts = _Killer(Path(folder), options.kills, random.Random(options.seed)).kill_all()
    for field in fields(counts):
        print(f"{field.name:10} {getattr(counts, field.name)}")
    sys.exit(counts.failures > 0)


class _Killer:
    def __init__(self, base: Path, kills: int, rng: random.Random) -> None:
        self.base = base
        self.kills = kills
        self.rng = rng
        self.whole = base / "whole"
        self.counts = Counts()
        self.pids: set[int] = set()
        self._time_of(base / "cold")  # compiles, which is not to count as the suite's length
        self.span = self._time_of(self.whole)
        (self.whole / "manifest.json").unlink()
        self.tables_span = self._time_of(self.whole)
        self.files = len([path for path in self.whole.iterdir() if path.is_file()])
        self.total = len(pd.read_parquet(self.whole / "runs.parquet"))
        print(
            f"uninterrupted: {self.total} runs in {self.span:.1f} s; "
            f"their tables alone {self.tables_span:.1f} s"
        )

    def kill_all(self) -> Counts:
        """Until the wanted number of kills has hit."""
        counts = self.counts
        while counts.kills < self.kills:
            folder = self.base / f"folder-{counts.folders}"
            self._until_completed(folder, 0.0, self.span)
            (folder / "manifest.json").unlink()  # or there is nothing to do
            self._until_completed(folder, self.tables_span / 2, self.tables_span)
            counts.folders += 1
            counts.differing += not _same(self.whole, folder, self.total)
            print(counts, flush=True)
        counts.shared = sum(
            not self.pids.isdisjoint(map(int, re.findall(r"\d+", path.name)))
            for path in SHARED_MEMORY.glob("*")
        )
        return counts

    def _until_completed(self, folder: Path, earliest: float, latest: float) -> None:
        """Start the suite in a folder, and kill it some times, until it ends by itself."""
        until = min(self.counts.kills + _KILLS_A_TURN, self.kills)
        while True:
            started = time.time()
            suite = self._start(folder)
            delay = self.rng.uniform(earliest, latest) if self.counts.kills < until else None
            try:
                code = suite.wait(delay)
            except subprocess.TimeoutExpired:
                suite.send_signal(signal.SIGKILL)
                suite.wait()
                self._count_kill(folder, started)
                continue
            if code != 0:
                raise SystemExit(f"resuming ended with exit code {code}")
            return

    def _count_kill(self, folder: Path, started: float) -> None:
        anew = [
            path
            for path in folder.glob("[!.]*")
            if path.is_file() and path.stat().st_mtime >= started
        ]
        self.counts.kills += 1
        self.counts.mid_runs += 0 < len(Packs(folder)) < self.total
        self.counts.mid_tables += 0 < len(anew) < self.files
        deadline = time.monotonic() + _GRACE_S
        while (left := _marked(folder)) and time.monotonic() < deadline:
            time.sleep(0.02)
        self.counts.outlived += bool(left)

    def _time_of(self, folder: Path) -> float:
        clock = time.monotonic()
        if self._start(folder).wait() != 0:
            raise SystemExit("the suite does not even run uninterrupted")
        return time.monotonic() - clock

    def _start(self, folder: Path) -> subprocess.Popen[bytes]:
        suite = subprocess.Popen(
            [sys.executable, "-m", "coartic", *SUITE, "--out", str(folder)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, _MARK: str(folder)},
        )
        self.pids.add(suite.pid)
        return suite


def _marked(folder: Path) -> list[int]:
    """Process ids of those that a suite in this folder started (Linux)."""
    mark = f"{_MARK}={folder}\0".encode()
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            if mark in (entry / "environ").read_bytes():
                found.append(int(entry.name))
        except OSError:  # gone, or another user's
            continue
    return found


def _same(whole: Path, interrupted: Path, total: int) -> bool:
    """Whether two folders hold the same runs, each once, the same tables, and no more files."""
    if len(Packs(interrupted)) != total or list(interrupted.rglob("*.part")):
        return False
    for table in TABLES:
        a, b = (pd.read_parquet(path / f"{table}.parquet") for path in (whole, interrupted))
        if table == "runs":
            a, b = (frame.drop(columns=list(TIMINGS)) for frame in (a, b))
            if not b.run_id.is_unique:
                return False
        if not a.equals(b):
            return False
    return True


if __name__ == "__main__":
    main()
