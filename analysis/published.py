"""The numbers printed in Shah, Barto & Fagg (2013), from ``published.toml``."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, Literal

RUNS = 20  # runs of every experiment (printed, section *Initial Solution and Learning*)
TRIALS = 10_000  # trials of every run (printed there too)


@dataclass(frozen=True)
class Summary:
    """A printed mean reward with what is printed about its spread."""

    mean: float
    sd: float | None
    runs: int
    derived: bool = False
    """Computed from other printed numbers rather than printed itself."""
    runs_printed: bool = True
    """Whether the number of runs stands beside it; else we take it as the paper's general 20."""
    digits: tuple[int, int] | None = None
    """Decimals of mean and SD as they are printed; None for what is derived."""

    @property
    def source(self) -> Literal["paper", "derived"]:
        """What mean and SD rest on."""
        return "derived" if self.derived else "paper"

    @property
    def source_of_runs(self) -> Literal["paper", "derived", "ours"]:
        """What the number of runs rests on."""
        return self.source if self.runs_printed else "ours"


@dataclass(frozen=True)
class SequenceResult:
    """A hand sequence the paper reports for a cell."""

    hands: str
    summary: Summary

    @property
    def runs(self) -> int | None:
        """Printed number of runs that learned it."""
        return self.summary.runs if self.summary.runs_printed else None


@dataclass(frozen=True)
class PublishedCell:
    """What the paper prints about one task under one condition."""

    summary: Summary | None
    sequences: tuple[SequenceResult, ...]
    remark: str = ""


def published_initial(task: str) -> tuple[str, int, bool] | None:
    """Hands, reward and whether derived, of a task's initial solution."""
    entry = _printed(task, "initial")
    return entry and (entry["hands"], entry["reward"], entry.get("derived", False))


def published_exhaustive(task: str) -> tuple[str, int] | None:
    """Best hands and reward of the corrective process alone over all sequences."""
    entry = _printed(task, "exhaustive")
    return entry and (entry["hands"], entry["reward"])


def published_cells() -> tuple[tuple[str, str], ...]:
    """Tasks and conditions of the paper, in its order: less exploration first."""
    return tuple((task, name) for task in _PUBLISHED for name in _PUBLISHED[task] if "EC" in name)


def published_cell(task: str, condition: str) -> PublishedCell | None:
    """What is printed about a cell; None for a cell that the paper does not have."""
    entry = _printed(task, condition)
    if entry is None:
        return None
    sequences = tuple(
        SequenceResult(item["hands"], _summary(item, runs_printed="runs" in item))
        for item in entry.get("sequences", ())
    )
    remark = f"higher than {entry['better_than']}" if "better_than" in entry else ""
    whole = _summary(entry) if "reward" in entry else pooled([s.summary for s in sequences])
    return PublishedCell(whole, sequences, remark)


def pooled(parts: list[Summary]) -> Summary | None:
    """Mean and SD over all runs of several groups, from each group's own."""
    if not parts:
        return None
    if len(parts) == 1:
        return parts[0]
    runs = sum(part.runs for part in parts)
    mean = sum(part.runs * part.mean for part in parts) / runs
    if any(part.sd is None for part in parts):
        return Summary(mean, None, runs, derived=True)
    squares = sum(
        (part.runs - 1) * (part.sd or 0.0) ** 2 + part.runs * (part.mean - mean) ** 2
        for part in parts
    )
    return Summary(mean, math.sqrt(squares / (runs - 1)), runs, derived=True)


_PUBLISHED: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("published.toml").read_text("utf-8"), parse_float=Decimal
)


def _printed(task: str, what: str) -> Any:
    return _PUBLISHED.get(task, {}).get(what)


def _summary(entry: Mapping[str, Any], *, runs_printed: bool = True) -> Summary:
    mean, sd = entry["reward"], entry.get("sd")
    known = None if sd is None else float(sd)
    digits = _decimals(mean), _decimals(sd)
    whole = mean if isinstance(mean, int) else float(mean)
    runs = entry.get("runs", RUNS)
    return Summary(whole, known, runs, runs_printed=runs_printed, digits=digits)


def _decimals(printed: Decimal | int | None) -> int:
    exponent = printed.as_tuple().exponent if isinstance(printed, Decimal) else 0
    return -int(exponent)
