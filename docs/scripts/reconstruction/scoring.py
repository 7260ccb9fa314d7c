"""How near learned results are to the printed ones.

Every printed mean, SD and number of runs is one figure; its distance is the difference in
units of its own uncertainty and that of our runs (the implausibility of history matching:
Craig et al. 1997; Gonçalves et al. 2020, doi:10.7554/eLife.56261).

Runs are a table: ``reward`` of each (NaN where it completed no trial) and ``hands``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import pandas as pd
from scipy import special, stats

from coartic import CONDITIONS, PAPER, MotionModel, Task, learn_many
from coartic.analysis.topics.paper.published import RUNS, entries_of
from coartic.learner.conditions import ExplorationCondition
from coartic.robot import Array

FARTHEST = 5.0
"""Standard errors that a figure counts at most, and where too few runs learned its hands: a
sequence that is not learned is as bad as one with a figure far off, never better."""


@dataclass(frozen=True)
class Figure:
    """A printed figure of a cell, and how it was got."""

    condition: str
    kind: Literal["mean", "sd", "share"]
    value: float
    runs: int
    """Runs that it rests on; of a share, those of the experiment."""
    hands: str | None = None
    """Hand sequence of the runs that count; None for all runs."""
    sd: float | None = None
    """Printed SD of the runs, for a mean."""
    digits: int = 0
    """Decimals that are printed."""
    counted: bool = True
    """Not where it follows from others, as the mean of all runs from those of their parts."""

    @property
    def label(self) -> str:
        """Such as ``EC2 RRLR mean``."""
        return " ".join(filter(None, (self.condition, self.hands, self.kind)))

    def compare(self, cells: Mapping[str, pd.DataFrame]) -> tuple[float, float]:
        """This figure of our runs, and its difference to the printed one in standard errors.

        ``cells``: runs by condition. NaN where too few runs learned the sequence.
        """
        runs, rewards = cells[self.condition], learned_rewards(cells[self.condition], self.hands)
        if not len(runs):
            return math.nan, math.nan
        rounding = 10.0**-self.digits / math.sqrt(12.0)
        if self.kind == "share":
            ours = len(rewards) / len(runs)
            pooled = (self.value * self.runs + len(rewards) + 1.0) / (self.runs + len(runs) + 2.0)
            variance = pooled * (1.0 - pooled) * (1.0 / self.runs + 1.0 / len(runs))
            return ours, (ours - self.value) / math.sqrt(variance)
        if len(rewards) < 2:
            mean = float(rewards.mean()) if self.kind == "mean" and len(rewards) else math.nan
            return mean, math.nan
        if self.kind == "mean":
            ours = float(rewards.mean())
            spread = self.sd or float(rewards.std(ddof=1))
            error = spread**2 / self.runs + rewards.var(ddof=1) / len(rewards) + rounding**2
            return ours, (ours - self.value) / math.sqrt(error)
        ours = float(rewards.std(ddof=1))
        # Variance of the logarithm of an SD of n runs, to first order (delta method), with the
        # kurtosis that ours have: 1 / (2 (n - 1)) for normal ones, and never taken as less.
        tails = max(3.0, float(stats.kurtosis(rewards, fisher=False)) if np.ptp(rewards) else 3.0)
        error = sum((tails - (n - 3) / (n - 1)) / (4 * n) for n in (self.runs, len(rewards)))
        error += (rounding / self.value) ** 2
        return ours, math.log(max(ours, 1e-3) / self.value) / math.sqrt(error)


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
    counted: bool = True

    @property
    def label(self) -> str:
        """Such as ``EC4 above EC3``."""
        first = " ".join(filter(None, (self.condition, self.hands)))
        second = " ".join(filter(None, (self.than, self.than_hands)))
        return f"{first} above {second}"

    def compare(self, cells: Mapping[str, pd.DataFrame]) -> tuple[float, float]:
        """Difference of our means, and how far the printed test falls short of its p.

        In SDs of its z, ours being as uncertain as our runs are; 0 where it would not on
        average. NaN with too few runs.
        """
        above = learned_rewards(cells[self.condition], self.hands)
        below = learned_rewards(cells[self.than], self.than_hands)
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


def printed_tests(task: str) -> tuple[Test, ...]:
    """What learning runs are compared with: means, SDs, shares of hand sequences, orders."""
    entries = entries_of(task, "test")
    spreads = {(e.condition, e.hands): float(e.value) for e in entries if e.kind == "sd"}
    counts = {(e.condition, e.hands): int(e.value) for e in entries if e.kind == "count"}
    tests: list[Test] = []
    for entry in entries:
        condition, hands = entry.condition, entry.hands
        if condition is None:
            continue
        runs = counts.get((condition, hands), RUNS)
        told_apart = sum(n for (name, _), n in counts.items() if name == condition)
        counted = hands is not None or told_apart != RUNS
        if entry.kind == "reward":
            mean, sd = float(entry.value), spreads.get((condition, hands))
            tests.append(Figure(condition, "mean", mean, runs, hands, sd, entry.digits, counted))
        elif entry.kind == "sd":
            sd = float(entry.value)
            tests.append(Figure(condition, "sd", sd, runs, hands, None, entry.digits, counted))
        elif entry.kind == "count":
            tests.append(Figure(condition, "share", runs / RUNS, RUNS, hands))
        elif entry.kind == "hand sequences" and len(entry.sequences) == 1:
            tests.append(Figure(condition, "share", 1.0, RUNS, entry.sequences[0]))
        elif entry.kind == "order" and not (entry.sample or entry.goal):
            than = entry.than
            if than.condition is not None:
                both = runs, counts.get((than.condition, than.hands), RUNS)
                p_below = None if entry.p_below is None else float(entry.p_below)
                tests.append(Order(condition, than.condition, both, hands, than.hands, p_below))
    return tuple(dict.fromkeys(tests))


def conditions_of(
    task: str, fields: Mapping[str, Any] | None = None
) -> dict[str, ExplorationCondition]:
    """Exploration conditions of which something is printed, with these fields of readings."""
    names = sorted({entry.condition for entry in entries_of(task, "test") if entry.condition})
    return {name: replace(CONDITIONS[name], **(fields or {})) for name in names}


def learn_cell(
    task: Task,
    condition: str | ExplorationCondition,
    seeds: Iterable[int],
    *,
    model: MotionModel = PAPER,
    trials: int = 10_000,
    jobs: int = 1,
) -> pd.DataFrame:
    """Learned ``reward`` and ``hands`` of runs with these seeds, a row a run."""
    runs = learn_many(task, condition, seeds=seeds, trials=trials, model=model, jobs=jobs)
    rewards = [math.nan if run.reward is None else float(run.reward) for run in runs]
    hands = pd.Series([run.hands or "" for run in runs], dtype=object)
    return pd.DataFrame({"reward": rewards, "hands": hands})


def learned_rewards(runs: pd.DataFrame, hands: str | None = None) -> Array:
    """Rewards of the runs that completed a trial; with ``hands``, of those that learned them."""
    rewards = runs["reward"].to_numpy()
    chosen = np.isfinite(rewards)
    if hands is not None:
        chosen &= runs["hands"].to_numpy() == hands
    return np.asarray(rewards[chosen])


def compare(tests: Sequence[Test], cells: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """A row for each printed figure, by its label: ``ours``, ``distance`` and ``counted``.

    Distances are in standard errors, positive where ours is the larger.
    """
    rows = [(*test.compare(cells), test.counted) for test in tests]
    labels = [test.label for test in tests]
    return pd.DataFrame(rows, labels, columns=["ours", "distance", "counted"])


def distance(comparisons: pd.DataFrame) -> float:
    """Root mean square of the distances, standard errors; none counts as more than FARTHEST.

    What follows from other figures is not counted a second time.
    """
    values = comparisons.distance[comparisons.counted].abs().fillna(FARTHEST)
    squares = [min(value, FARTHEST) ** 2 for value in values]
    return math.sqrt(sum(squares) / len(squares))


def distance_error(
    tests: Sequence[Test], cells: Mapping[str, pd.DataFrame], resamples: int = 200
) -> float:
    """Standard error of :func:`distance` by the bootstrap over the runs of each cell."""
    rng = np.random.default_rng(0)
    distances = []
    for _ in range(resamples):
        numbers = {name: rng.integers(len(runs), size=len(runs)) for name, runs in cells.items()}
        sample = {name: runs.iloc[numbers[name]] for name, runs in cells.items()}
        distances.append(distance(compare(tests, sample)))
    return float(np.std(distances, ddof=1))
