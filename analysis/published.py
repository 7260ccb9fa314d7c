"""The numbers printed in Shah, Barto & Fagg (2013), put together by task and condition."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeVar

from coartic.analysis.printed import (
    ENTRIES,
    Best,
    Count,
    Entry,
    InitialHands,
    Order,
    Reward,
    Sd,
    constant,
)

RUNS = int(constant("runs"))  # of every experiment
TRIALS = int(constant("trials"))  # of every run


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


class InitialSolution(NamedTuple):
    """What the paper prints of a task's initial solution."""

    hands: str
    reward: float
    derived: bool
    """Whether the reward is computed from other printed numbers."""
    place: str
    """Section of the paper."""


def published_initial(task: str) -> InitialSolution | None:
    """Of a task; None where the paper prints nothing of it."""
    for entry in _said(task, InitialHands):
        reward = _corrective_reward(task, entry.hands)
        return InitialSolution(entry.hands, reward.number, reward.derived, reward.place)
    return None


def published_exhaustive(task: str) -> tuple[str, float] | None:
    """Best hands and reward of the corrective process alone over all sequences."""
    for entry in _said(task, Best):
        return entry.hands, _corrective_reward(task, entry.hands).number
    return None


def published_cells() -> tuple[tuple[str, str], ...]:
    """Tasks and conditions of the paper, in its order: less exploration first."""
    cells = ((e.task, e.condition) for e in ENTRIES.values() if e.task and e.condition)
    return tuple(dict.fromkeys(cells))


def published_cell(task: str, condition: str) -> PublishedCell | None:
    """What is printed about a cell; None for a cell that the paper does not have."""
    if (task, condition) not in published_cells():
        return None
    rewards = [entry for entry in _said(task, Reward) if entry.condition == condition]
    sequences = tuple(SequenceResult(e.hands, _summary(e)) for e in rewards if e.hands)
    over_all = [_summary(entry) for entry in rewards if entry.hands is None]
    whole = over_all[0] if over_all else pooled([s.summary for s in sequences])
    lower = [e.than.condition for e in _said(task, Order) if e.condition == condition]
    remark = f"higher than {lower[-1]}" if whole is None and lower else ""
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


Kind = TypeVar("Kind", bound=Entry)


def _said(task: str, kind: type[Kind]) -> Iterator[Kind]:
    """Entries of one kind on a task."""
    return (e for e in ENTRIES.values() if isinstance(e, kind) and e.task == task)


def _corrective_reward(task: str, hands: str) -> Reward:
    """What is printed of the corrective process alone with the hands."""
    (reward,) = (e for e in _said(task, Reward) if (e.condition, e.hands) == (None, hands))
    return reward


def _summary(reward: Reward) -> Summary:
    """A reward with the SD and the number of runs that are printed beside it."""
    sd, count = _beside(reward, Sd), _beside(reward, Count)
    return Summary(
        reward.number,
        float(sd.value) if sd else None,
        int(count.value) if count else RUNS,
        runs_printed=count is not None or reward.hands is None,
        digits=(reward.digits, sd.digits if sd else 0),
    )


def _beside(reward: Reward, kind: type[Kind]) -> Kind | None:
    """The entry of a kind that is said of the same runs."""
    same = {"task", "condition", "hands"}
    of = reward.model_dump(include=same)
    found = (e for e in _said(reward.task or "", kind) if e.model_dump(include=same) == of)
    return next(found, None)
