"""Kills a suite at random times, resumes it, and checks that nothing is lost or doubled.

``python -m benchmarks.kill_resume [--kills 50] [--seed 0]`` runs a small suite once
without interruption, then again and again under SIGKILL at random times, each time going
on in the same folder, until the wanted number of kills has hit. Every folder that gets
completed is compared with the uninterrupted one: same runs, each once, and the same
tables apart from timings. Exit code 1 where anything differs.
"""

from __future__ import annotations

import argparse
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd

from benchmarks.store import Store
from coartic.tables import TIMINGS

TABLES = ("runs", "solutions", "paths", "learning", "sequences")
SUITE = ("run", "quick", "--runs", "8", "--trials", "6000")


def main() -> None:
    """Kill, resume, compare, and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole"
        clock = time.monotonic()
        _start(whole).wait()
        span = time.monotonic() - clock
        total = len(pd.read_parquet(whole / "runs.parquet"))
        print(f"uninterrupted: {total} runs in {span:.1f} s")

        kills = mid_suite = folders = differing = 0
        while kills < options.kills:
            interrupted = Path(folder) / f"folder-{folders}"
            folders += 1
            while True:
                suite = _start(interrupted)
                # Up to the length of the suite when this folder's turn still has kills.
                delay = rng.uniform(0.0, span) if kills < options.kills else None
                try:
                    code = suite.wait(delay)
                except subprocess.TimeoutExpired:
                    suite.send_signal(signal.SIGKILL)
                    suite.wait()
                    kills += 1
                    kept = len(Store(interrupted).ids())
                    mid_suite += 0 < kept < total
                    continue
                if code != 0:
                    raise SystemExit(f"resuming ended with exit code {code}")
                break
            differing += not _same(whole, interrupted, total)
            print(f"{kills} kills, {folders} folders completed, {differing} differ", flush=True)
    print(
        f"\n{kills} random SIGKILLs, each followed by a resume ({mid_suite} of them with some "
        f"runs done and some not); {folders} folders completed; lost runs, doubled runs or "
        f"different tables in {differing}."
    )
    sys.exit(differing > 0)


def _start(folder: Path) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "coartic", *SUITE, "--out", str(folder)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _same(whole: Path, interrupted: Path, total: int) -> bool:
    """Whether two folders hold the same runs, each once, and the same tables."""
    store = Store(interrupted)
    if len(store.ids()) != total or list(store.records.glob("*.part")):
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
