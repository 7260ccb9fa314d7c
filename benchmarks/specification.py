"""What a run is: everything its result depends on, and the id that follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from benchmarks.provenance import command
from benchmarks.registry import Entry
from coartic import PAPER, MotionModel, Task
from coartic.record import RECORD_FORMAT, Specification


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
        return self.entry.name

    @property
    def model(self) -> MotionModel:
        """The constants of movement."""
        return PAPER

    @property
    def all_parameters(self) -> dict[str, Any]:
        """All parameters, defaults included, as plain data."""
        return self.entry.complete(dict(self.parameters))

    @property
    def specification(self) -> Specification:
        """Everything the result depends on, but for the code.

        The time limit is not part of it: it decides whether there is a result, not
        which.
        """
        return Specification(
            format=RECORD_FORMAT,
            task=self.task.model_dump(mode="json"),
            method=self.method,
            parameters=self.all_parameters,
            model=self.model._asdict(),
            seed=self.seed,
            trial_budget=self.limits.trials,
        )

    @cached_property
    def key(self) -> str:
        """Hash of the specification."""
        return self.specification.key()

    @property
    def run_id(self) -> str:
        """Address of the run's record: specification, then code."""
        return f"{self.key}-{self.entry.code}"

    def job(self) -> dict[str, Any]:
        """What a worker needs to perform the run, as plain data."""
        foreign = self.entry.foreign
        return {
            "run_id": self.run_id,
            "specification": self.specification.model_dump(mode="json"),
            "code": self.entry.code,
            "told": list(self.entry.declared.told),
            "time_limit_s": self.limits.time_s,
            "foreign": None if foreign is None else foreign.model_dump(mode="json"),
            "owner": None if foreign is None else f"{self.method} {self.entry.code}",
            "command": command(),
            "reach": True,
        }
