"""How far a reconstruction's learned figures are from the printed ones.

Every printed mean, SD and number of runs is one figure; its distance is the difference in
units of its own uncertainty and that of our runs (the implausibility of history matching:
Craig et al. 1997; Gonçalves et al. 2020, doi:10.7554/eLife.56261).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from coartic import PAPER, MotionModel, Task, learn_many
from coartic.learner.conditions import ExplorationCondition


class Learned(NamedTuple):
    """What the runs of a cell learned."""

    rewards: NDArray[np.float64]
    """Learned reward of each run that completed a trial, ``(N,)``."""
    hands: tuple[str, ...]
    """The hand sequence of each."""
    failed: int = 0
    """Runs that completed no trial."""

    @property
    def runs(self) -> int:
        """All of them."""
        return len(self.hands) + self.failed

    def drawn(self, rng: np.random.Generator) -> Learned:
        """As many of its runs, drawn with replacement."""
        chosen = rng.integers(self.runs, size=self.runs)
        good = chosen[chosen < len(self.hands)]
        hands = tuple(self.hands[number] for number in good)
        return Learned(self.rewards[good], hands, len(chosen) - len(good))

    def beside(self, others: Learned) -> Learned:
        """These runs and others of the same cell."""
        rewards = np.concatenate([self.rewards, others.rewards])
        return Learned(rewards, self.hands + others.hands, self.failed + others.failed)

    def with_hands(self, hands: str | None) -> NDArray[np.float64]:
        """Rewards of the runs that learned a sequence; of all for None."""
        if hands is None:
            return self.rewards
        chosen = np.array([hands == own for own in self.hands], dtype=bool)
        return np.asarray(self.rewards[chosen])


@dataclass(frozen=True)
class Figure:
    """A printed figure of a cell, and how it was got."""

    condition: str
    kind: Literal["mean", "sd", "share"]
    value: float
    runs: int
    """Runs that it rests on; of a share, those of the experiment."""
    hands: str | None = None
    """Those runs alone that learned this sequence; None for all."""
    sd: float | None = None
    """Printed SD of the runs, for a mean."""
    digits: int = 0
    """Decimals that are printed."""
    implied: bool = False
    """It follows from others, as the mean of all runs from those of their parts: not counted."""

    @property
    def label(self) -> str:
        """Such as ``EC2 RRLR mean``."""
        return " ".join(filter(None, (self.condition, self.hands, self.kind)))

    def ours(self, learned: Learned) -> float:
        """The same figure of our runs; NaN where too few runs learned the sequence."""
        rewards = learned.with_hands(self.hands)
        if not learned.runs:
            return math.nan
        if self.kind == "share":
            return len(rewards) / learned.runs
        if self.kind == "mean":
            return float(rewards.mean()) if len(rewards) else math.nan
        return float(rewards.std(ddof=1)) if len(rewards) > 1 else math.nan

    def distance(self, learned: Learned) -> float:
        """Difference in standard errors, positive where ours is the larger; NaN as above."""
        ours, own, runs = self.ours(learned), learned.with_hands(self.hands), learned.runs
        rounding = 10.0**-self.digits / math.sqrt(12.0)
        if not runs:
            return math.nan
        if self.kind == "share":
            pooled = (self.value * self.runs + len(own) + 1.0) / (self.runs + runs + 2.0)
            variance = pooled * (1.0 - pooled) * (1.0 / self.runs + 1.0 / runs)
            return (ours - self.value) / math.sqrt(variance)
        if len(own) < 2:
            return math.nan
        if self.kind == "mean":
            spread = self.sd or float(own.std(ddof=1))
            error = spread**2 / self.runs + own.var(ddof=1) / len(own) + rounding**2
            return (ours - self.value) / math.sqrt(error)
        error = _of_log_sd(self.runs, own) + _of_log_sd(len(own), own)
        error += (rounding / self.value) ** 2
        return math.log(max(ours, 1e-3) / self.value) / math.sqrt(error)


@dataclass(frozen=True)
class Order:
    """A mean reward is printed as higher than another, of conditions or of hand sequences."""

    condition: str
    than: str
    runs: tuple[int, int] = (20, 20)
    """Printed runs of both."""
    hands: str | None = None
    than_hands: str | None = None
    p_below: float | None = None
    """What the printed p of the one-tailed test lies below; None where none is printed."""

    @property
    def label(self) -> str:
        """Such as ``EC4 above EC3``."""
        first = " ".join(filter(None, (self.condition, self.hands)))
        second = " ".join(filter(None, (self.than, self.than_hands)))
        return f"{first} above {second}"

    def seen(self, cells: Mapping[str, Learned]) -> tuple[float, float]:
        """Difference of our means, and how far the printed test falls short of its p.

        In SDs of its z, ours being as uncertain as our runs are; 0 where it would not on
        average. NaN with too few runs.
        """
        above = cells[self.condition].with_hands(self.hands)
        below = cells[self.than].with_hands(self.than_hands)
        if min(len(above), len(below)) < 2:
            return math.nan, math.nan
        difference = float(above.mean() - below.mean())
        parts = float(above.var(ddof=1)) + 1e-9, float(below.var(ddof=1)) + 1e-9
        theirs = sum(part / n for part, n in zip(parts, self.runs, strict=True))
        ours = parts[0] / len(above) + parts[1] / len(below)
        wanted = 0.0 if self.p_below is None else -float(special.ndtri(self.p_below))
        missing = difference - wanted * math.sqrt(theirs)
        return difference, min(0.0, missing / math.sqrt(theirs + ours))


Test = Figure | Order
RESAMPLES = 200
"""Of the runs, for the standard error of a distance."""
FARTHEST = 5.0
"""Standard errors that a figure counts at most, and where too few runs learned its hands: a
sequence that is not learned is as bad as one with a figure far off, never better."""


def _of_log_sd(runs: int, like: NDArray[np.float64]) -> float:
    """Variance of the logarithm of the SD of that many runs, of a kurtosis as some have.

    To first order (delta method); 1 / (2 (n - 1)) for normal ones, and never taken as less.
    """
    tails = max(3.0, float(stats.kurtosis(like, fisher=False)) if np.ptp(like) else 3.0)
    return (tails - (runs - 3) / (runs - 1)) / (4 * runs)


@dataclass(frozen=True)
class Compared:
    """A printed figure and ours."""

    test: Test
    ours: float
    distance: float
    """In standard errors; positive where ours is the larger."""


def learned(
    task: Task,
    condition: str | ExplorationCondition,
    seeds: Iterable[int],
    *,
    model: MotionModel = PAPER,
    trials: int = 10_000,
    jobs: int = 1,
) -> Learned:
    """Learned rewards and hand sequences of runs with these seeds."""
    runs = learn_many(task, condition, seeds=seeds, trials=trials, model=model, jobs=jobs)
    completed = [run for run in runs if run.reward is not None]
    return Learned(
        np.array([run.reward for run in completed], dtype=np.float64),
        tuple(run.hands or "" for run in completed),
        len(runs) - len(completed),
    )


def compared(tests: Sequence[Test], cells: Mapping[str, Learned]) -> list[Compared]:
    """Each printed figure beside that of our runs, ``cells`` by condition."""
    return [_compared(test, cells) for test in tests]


def _compared(test: Test, cells: Mapping[str, Learned]) -> Compared:
    if isinstance(test, Figure):
        cell = cells[test.condition]
        return Compared(test, test.ours(cell), test.distance(cell))
    return Compared(test, *test.seen(cells))


def distance(comparisons: Iterable[Compared]) -> float:
    """Root mean square of the distances, standard errors; none counts as more than FARTHEST.

    What follows from other figures is not counted a second time.
    """
    values = [
        abs(each.distance)
        for each in comparisons
        if not (isinstance(each.test, Figure) and each.test.implied)
    ]
    squares = [FARTHEST**2 if math.isnan(value) else min(value, FARTHEST) ** 2 for value in values]
    return math.sqrt(sum(squares) / len(squares))


def distance_error(tests: Sequence[Test], cells: Mapping[str, Learned]) -> float:
    """Standard error of :func:`distance` by the bootstrap over the runs of each cell."""
    rng = np.random.default_rng(0)
    drawn = ({name: cell.drawn(rng) for name, cell in cells.items()} for _ in range(RESAMPLES))
    return float(np.std([distance(compared(tests, own)) for own in drawn], ddof=1))
