"""What a run is: everything its result depends on, and the id that follows from it."""

from __future__ import annotations

import hashlib
import json
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.methods import Entry, Plugin, build
from coartic import PAPER, Task

STORE_FORMAT = 1


@dataclass(frozen=True)
class Limits:
    """Bounds enforced from outside a method."""

    time_s: float | None = None
    """Wall time of one run; beyond it the run is ended and counted as ``timeout``."""
    trials: int | None = None
    """Physical trials of one run."""


UNLIMITED = Limits()


@dataclass(frozen=True)
class RunSpec:
    """One run: a method with parameters on a task with a seed."""

    task: Task
    entry: Entry
    parameters: tuple[tuple[str, Any], ...]
    """Parameters that differ from the method's defaults."""
    run: int
    """Number of the run, from 0."""
    seed: int
    limits: Limits = UNLIMITED

    @property
    def method(self) -> str:
        """Id of the method."""
        return self.entry.method.name

    @cached_property
    def all_parameters(self) -> dict[str, Any]:
        """All parameters, defaults included, as plain data."""
        parameters: dict[str, Any] = build(
            self.entry, dict(self.parameters)
        ).parameters.model_dump(mode="json")
        return parameters

    @cached_property
    def specification(self) -> dict[str, Any]:
        """Everything the result depends on, but for the code, as plain data.

        The time limit is not part of it: it decides whether there is a result, not
        which.
        """
        return {
            "format": STORE_FORMAT,
            "task": self.task.model_dump(mode="json"),
            "method": self.method,
            "parameters": self.all_parameters,
            "model": PAPER._asdict(),
            "seed": self.seed,
            "trial_budget": self.limits.trials,
        }

    @cached_property
    def key(self) -> str:
        """Hash of the specification."""
        return content_hash(self.specification)[:16]

    @property
    def run_id(self) -> str:
        """Address of the run's record: specification, then code."""
        return f"{self.key}-{self.entry.code}"

    def job(self) -> dict[str, Any]:
        """What a worker needs to perform the run, as plain data."""
        plugin: Plugin | None = self.entry.plugin
        return {
            "run_id": self.run_id,
            "run": self.run,
            "specification": self.specification,
            "code": self.entry.code,
            "time_limit_s": self.limits.time_s,
            "plugin": None if plugin is None else [plugin.filename, plugin.source],
            "origin": self.entry.origin,
            "command": [Path(sys.argv[0]).name, *sys.argv[1:]],
            "reach": True,
        }


def content_hash(content: Any) -> str:
    """SHA-256 of plain data in canonical form."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def run_seed(root: int, task: str, run: int) -> int:
    """Seed of one run, from the suite's seed, the task and the run's number alone.

    Every method gets the same seed for the same task and run, so runs are paired.
    """
    words = np.frombuffer(hashlib.sha256(task.encode()).digest()[:16], dtype="<u4")
    sequence = np.random.SeedSequence(root, spawn_key=(*map(int, words), run))
    return int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(1))
