"""What a suite asks for: its tasks, methods and cells, and which runs that makes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from coartic.model import MotionModel
from coartic.tasks.readings import load_readings, model_under

BUILT_IN = "built in"
"""Origin of this project's methods."""
SEARCH = "optimum/"
"""Ids of the searches for the optimum begin so; they alone may state a bound."""
_KEY = 16  # digits of a hash


@dataclass(frozen=True)
class DeclaredMethod:
    """What a method declares of itself, and where it comes from."""

    title: str
    citation: str
    told: tuple[str, ...]
    secondary: tuple[str, ...]
    stochastic: bool
    """Whether the seed matters; the others are run once."""
    defaults: dict[str, Any]
    """Its parameters; None for one that has no default."""
    origin: str
    """``built in``, the distribution of a plug-in, or the path of a method file."""
    code: str
    """Hash of the code that its results come from."""


@dataclass(frozen=True)
class PlannedCell:
    """One method with parameters on one task."""

    task: str
    method: str
    variant: str
    """Parameters that differ from the method's defaults, such as ``noise_sd=0.1``."""
    parameters: dict[str, Any]
    """What the suite says of its parameters."""
    complete: dict[str, Any]
    """All of them."""
    runs: int

    @property
    def label(self) -> str:
        """The method with its variant."""
        return label_of(self.method, self.variant)


@dataclass(frozen=True)
class Plan:
    """What a suite asks for, all of it."""

    suite: str
    seed: int
    runs: int
    """Runs of a cell, where the suite does not say otherwise and the seed matters."""
    trials: int
    """Most trials of a run."""
    readings: tuple[str, ...]
    """Readings of the paper that are not the default, as ``ties=right``."""
    time_limit_s: float | None
    """CPU time of one run."""
    trial_budget: int | None
    """Physical trials of one run."""
    tasks: dict[str, dict[str, Any]]
    """Definitions by name."""
    methods: dict[str, DeclaredMethod]
    cells: tuple[PlannedCell, ...]

    @cached_property
    def model(self) -> MotionModel:
        """The constants of movement under these readings."""
        return model_under(load_readings(self.readings))

    @property
    def size(self) -> int:
        """Number of runs."""
        return sum(cell.runs for cell in self.cells)

    @cached_property
    def asked(self) -> tuple[str, ...]:
        """Of each cell a hash of everything that its results depend on, but for seeds and code.

        The time limit is not part of it: it decides whether there is a result, not which.
        """
        return tuple(
            hash_of(
                {
                    "task": self.tasks[cell.task],
                    "method": cell.method,
                    "parameters": cell.complete,
                    "model": self.model._asdict() | {"arrival_tick": 1},  # a field of version 1.0
                    "trial_budget": self.trial_budget,
                }
            )
            for cell in self.cells
        )

    def run_ids(self, position: int) -> list[str]:
        """Ids of the runs of the cell at this position, in their order."""
        cell = self.cells[position]
        code = self.methods[cell.method].code
        return [
            run_id(self.asked[position], self.seed, number, code) for number in range(cell.runs)
        ]


def run_id(asked: str, suite_seed: int, number: int, code: str) -> str:
    """The id of a run: a hash of what was asked for, then that of the code."""
    text = f"{asked} {suite_seed} {number}"
    return f"{hashlib.sha256(text.encode()).hexdigest()[:_KEY]}-{code}"


def run_seed(suite_seed: int, task: str, number: int) -> int:
    """The seed of a run, from the suite's seed, the task's name and the run's number alone.

    Every method gets the same seed for the same task and run, so runs are paired.
    """
    words = np.frombuffer(hashlib.sha256(task.encode()).digest()[:16], dtype="<u4")
    sequence = np.random.SeedSequence(suite_seed, spawn_key=(*map(int, words), number))
    return int(sequence.generate_state(1, np.uint64)[0] >> np.uint64(1))


def hash_of(content: Any) -> str:
    """SHA-256 of plain data."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def trials_in(parameters: Mapping[str, Any]) -> int:
    """Trials that a run with these parameters makes; 0 where they do not say."""
    trials = parameters.get("trials")
    return trials if type(trials) is int and trials > 0 else 0


def variant_of(parameters: Mapping[str, Any], defaults: Mapping[str, Any]) -> str:
    """Parameters that differ from the method's defaults, such as ``noise_sd=0.1``."""
    return ", ".join(
        f"{name}={value}"
        for name, value in parameters.items()
        if name not in defaults or value != defaults[name]
    )


def label_of(method: str, variant: str) -> str:
    """A method with its variant, as everything names it that has no room for both."""
    return f"{method} {variant}".strip()
