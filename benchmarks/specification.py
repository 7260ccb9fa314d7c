"""What a run is: everything its result depends on, and the id that follows from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from coartic import PAPER, MotionModel, Task
from coartic.benchmarks.code_identity import built_in_sources
from coartic.benchmarks.provenance import command
from coartic.benchmarks.registry import MODULE_OF, Entry
from coartic.runs.record import RECORD_FORMAT, Asked, Specification


@dataclass(frozen=True)
class Limits:
    """Bounds enforced from outside a method."""

    time_s: float | None = None
    """Wall time of one run; beyond it the run is ended and counted as ``timeout``."""
    trials: int | None = None
    """Physical trials of one run."""


UNLIMITED = Limits()


@dataclass(frozen=True)
class Setting:
    """What the runs of a cell share: a method with parameters on a task, under limits."""

    task: Task
    entry: Entry
    parameters: tuple[tuple[str, Any], ...]
    """Parameters that differ from the method's defaults."""
    limits: Limits = UNLIMITED
    model: MotionModel = PAPER

    @cached_property
    def all_parameters(self) -> dict[str, Any]:
        """All parameters, defaults included, as plain data."""
        return self.entry.complete(dict(self.parameters))

    @cached_property
    def asked(self) -> Asked:
        """Everything that results depend on, but for seed and code.

        The time limit is not part of it: it decides whether there is a result, not
        which.
        """
        return Asked(
            format=RECORD_FORMAT,
            task=self.task.model_dump(mode="json"),
            method=self.entry.name,
            parameters=self.all_parameters,
            model=self.model._asdict(),
            trial_budget=self.limits.trials,
        )

    @cached_property
    def most_together(self) -> int:
        """Runs, at most, that one process performs side by side."""
        return self.entry.most_together(self.all_parameters)

    @cached_property
    def _shared(self) -> dict[str, Any]:
        foreign, name, code = self.entry.foreign, self.entry.name, self.entry.code
        return {
            "specification": self.asked.model_dump(mode="json"),
            "code": code,
            "module": None if foreign else MODULE_OF[name],
            "sources": built_in_sources(code),
            "links": self.task.robot.most_links,
            "told": list(self.entry.declared.told),
            "foreign": None if foreign is None else foreign.model_dump(mode="json"),
            "owner": None if foreign is None else f"{name} {code}",
            "command": command(),
            "reach": True,
        }

    def job(self, specs: Sequence[RunSpec]) -> dict[str, Any]:
        """What a worker needs to perform runs of this setting side by side, as plain data.

        It is named after the first of them, and has the time of one: what takes longer side by
        side is performed again alone, so that a run's fate does not depend on who is beside it.
        """
        return {
            **self._shared,
            "run_id": specs[0].run_id,
            "seeds": [spec.seed for spec in specs],
            "time_limit_s": self.limits.time_s,
        }

    def specs(self, seeds: Sequence[int]) -> Iterator[RunSpec]:
        """The runs with these seeds, numbered from 0."""
        for run, (seed, key) in enumerate(zip(seeds, self.asked.keys(seeds), strict=True)):
            yield RunSpec(self, run, seed, f"{key}-{self.entry.code}")

    def spec(self, run: int, seed: int) -> RunSpec:
        """One run."""
        (key,) = self.asked.keys([seed])
        return RunSpec(self, run, seed, f"{key}-{self.entry.code}")


@dataclass(frozen=True, slots=True)
class RunSpec:
    """One run: a setting with a seed."""

    setting: Setting
    run: int
    """Number of the run, from 0."""
    seed: int
    run_id: str
    """Address of the run's record: hash of its specification, then of the code."""

    @property
    def task(self) -> Task:
        """The task."""
        return self.setting.task

    @property
    def entry(self) -> Entry:
        """The method."""
        return self.setting.entry

    @property
    def method(self) -> str:
        """Id of the method."""
        return self.entry.name

    @property
    def limits(self) -> Limits:
        """Bounds enforced from outside."""
        return self.setting.limits

    @property
    def model(self) -> MotionModel:
        """The constants of movement."""
        return self.setting.model

    @property
    def specification(self) -> Specification:
        """Everything the result depends on, but for the code."""
        return self.setting.asked.with_seed(self.seed)

    def job(self) -> dict[str, Any]:
        """What a worker needs to perform the run alone, as plain data."""
        return self.setting.job([self])
