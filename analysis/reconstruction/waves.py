"""Which admissible coordinates give what is printed about learning: waves of learning runs.

Each wave performs more runs of fewer points, with seeds that no other wave uses; between the
waves the neighbourhood of the best is searched. Figures to report come from seeds that have
selected nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.reconstruction.scoring import (
    Compared,
    Learned,
    Test,
    compared,
    distance,
    learned,
)
from analysis.reconstruction.search import Search

Array = NDArray[np.float64]
_SEEDS = 1_000_000  # of a wave begin at a multiple of this
REPORTED = 0
"""The wave whose seeds select nothing."""


@dataclass(frozen=True)
class Wave:
    """A step of the search."""

    points: int
    """Of how many points, the best of the wave before; the first wave takes a spread."""
    runs: int
    """Runs a condition."""
    around: int = 0
    """Further points, in random steps from them."""
    step: float = 0.0
    """SD of these steps, length unit."""


PLAN = (
    Wave(points=600, runs=6),
    Wave(points=100, runs=20),
    Wave(points=20, runs=20, around=120, step=0.1),
    Wave(points=20, runs=20, around=120, step=0.03),
    Wave(points=30, runs=60),
    Wave(points=8, runs=200),
)


@dataclass(frozen=True)
class Scored:
    """A point, what was learned there, and how far that is from what is printed."""

    point: Array
    cells: Mapping[str, Learned]
    comparisons: Sequence[Compared]

    @property
    def distance(self) -> float:
        """Root mean square over the printed figures, standard errors."""
        return distance(self.comparisons)


def scored(
    search: Search,
    points: Array,
    tests: Sequence[Test],
    *,
    conditions: Sequence[str],
    wave: int,
    runs: int,
    trials: int = 10_000,
    progress: Callable[[], None] = lambda: None,
) -> list[Scored]:
    """Learning runs at points ``(N, P)``, with the seeds of a wave; in their order."""
    seeds = range(_SEEDS * wave, _SEEDS * wave + runs)

    def score(point: Array) -> Scored:
        task = search.task_at(point)
        cells = {
            condition: learned(task, condition, seeds, model=search.model, trials=trials)
            for condition in conditions
        }
        progress()
        return Scored(point, cells, compared(tests, cells))

    with ThreadPoolExecutor(search.jobs) as pool:
        return list(pool.map(score, points))


def best_of_waves(
    search: Search,
    points: Array,
    tests: Sequence[Test],
    *,
    conditions: Sequence[str],
    plan: Sequence[Wave] = PLAN,
    report: Callable[[str], None] = lambda text: None,
) -> list[Scored]:
    """Points by their distance to what is printed, the nearest first; those of the last wave.

    ``points`` (N, P) are admissible and spread out, the first ones most.
    """
    for number, wave in enumerate(plan, 1):
        points = points[: wave.points]
        if wave.around:
            rng = np.random.default_rng([number, wave.around])
            found = search.spread(points, wave.around, rng, wave.step)
            points = np.concatenate([points, found])
        results = scored(search, points, tests, conditions=conditions, wave=number, runs=wave.runs)
        results.sort(key=lambda each: each.distance)
        points = np.array([each.point for each in results])
        report(
            f"wave {number}: {len(results)} points, {wave.runs} runs a condition; "
            f"distances {results[0].distance:.2f} to {results[-1].distance:.2f}"
        )
    return results
