"""What coordinates have to give under the corrective process alone, to be admitted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from coartic import MotionModel, Task
from coartic.motion.sequences import CorrectiveTrials, corrective_trials
from coartic.robot import Array

Flags = NDArray[np.bool_]
_BLOCK = 500  # sets of goals a thread is given at once


@dataclass(frozen=True)
class Tried:
    """Corrective trials of N sets of goals, by hand sequence."""

    sequences: tuple[str, ...]
    trials: CorrectiveTrials
    start_x: float
    """Where the base starts, length unit."""

    def reward(self, hands: str) -> Array:
        """Total reward, ``(N,)``; NaN where the corrective process failed."""
        return np.asarray(self.trials.rewards[:, self.sequences.index(hands)])

    def base_x(self, hands: str) -> Array:
        """Where the base is when each goal is hit, ``(N, G)``, length unit."""
        return np.asarray(self.trials.reached[:, self.sequences.index(hands), :, 0])


@dataclass(frozen=True)
class _OfHands:
    """Something that is said of a hand sequence."""

    hands: str

    @property
    def sequences(self) -> tuple[str, ...]:
        """Hand sequences it needs."""
        return (self.hands,)


@dataclass(frozen=True)
class RewardIs(_OfHands):
    """The reward of a hand sequence is a printed integer."""

    value: float
    within: float = 0.0
    """Ticks, where the printed value is derived from rounded ones."""

    def holds(self, tried: Tried) -> Flags:
        """Where it does, ``(N,)``."""
        return np.asarray(np.abs(tried.reward(self.hands) - self.value) <= self.within)

    def __str__(self) -> str:
        return f"{self.hands} gives {self.value:g}"


@dataclass(frozen=True)
class Above(_OfHands):
    """A hand sequence earns more than each of some others."""

    than: tuple[str, ...]

    @property
    def sequences(self) -> tuple[str, ...]:
        """Hand sequences it needs."""
        return (self.hands, *self.than)

    def holds(self, tried: Tried) -> Flags:
        """Where it does, ``(N,)``; a sequence that fails earns nothing."""
        others = np.stack([tried.reward(hands) for hands in self.than], axis=1)
        own = tried.reward(self.hands)
        return np.asarray((~(others >= own[:, None])).all(axis=1) & np.isfinite(own))

    def __str__(self) -> str:
        than = self.than[0] if len(self.than) == 1 else f"all {len(self.than)} others"
        return f"{self.hands} earns more than {than}"


@dataclass(frozen=True)
class BaseMoves(_OfHands):
    """The base moves to one side between two goals (0 is the start)."""

    first: int
    last: int
    side: Literal["left", "right"]

    def holds(self, tried: Tried) -> Flags:
        """Where it does, ``(N,)``."""
        x = np.insert(tried.base_x(self.hands), 0, tried.start_x, axis=1)
        moved = x[:, self.last] - x[:, self.first]
        return np.asarray(moved < 0.0 if self.side == "left" else moved > 0.0)

    def __str__(self) -> str:
        begin = f"goal {self.first}" if self.first else "the start"
        return f"{self.hands}: the base moves {self.side} from {begin} to goal {self.last}"


Constraint = RewardIs | Above | BaseMoves


def sequences_of(constraints: Iterable[Constraint]) -> tuple[str, ...]:
    """The hand sequences that some constraints need, in alphabetical order."""
    return tuple(sorted({hands for each in constraints for hands in each.sequences}))


def try_sequences(
    task: Task, sequences: Sequence[str], goals: Array, *, model: MotionModel, jobs: int
) -> Tried:
    """Corrective trials of sets of goals (N, G, 2), on threads; the result is the same."""
    perform = partial(corrective_trials, task, tuple(sequences), model=model)
    blocks = [goals[first : first + _BLOCK] for first in range(0, max(len(goals), 1), _BLOCK)]
    with ThreadPoolExecutor(jobs) as pool:
        rewards, reached = zip(*pool.map(perform, blocks), strict=True)
    trials = CorrectiveTrials(np.concatenate(rewards), np.concatenate(reached))
    return Tried(tuple(sequences), trials, task.q0[0])
