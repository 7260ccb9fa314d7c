"""Which admissible coordinates give what is printed about learning: waves of learning runs.

They begin with the ensemble; each wave performs further runs of fewer points, with seeds that no
other wave uses, and a point is judged by all its runs so far. Between the waves the neighbourhood
of the best is searched.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from coartic import CONDITIONS
from coartic.analysis.reconstruction.scoring import (
    Compared,
    Learned,
    compared,
    distance,
    distance_error,
    learned,
)
from coartic.analysis.reconstruction.search import Search
from coartic.analysis.reconstruction.targets import conditions_of, tests_of
from coartic.robot import Array
from coartic.tasks.readings import condition_under

_SEEDS = 1_000_000  # of a wave begin at a multiple of this
ENSEMBLE, LAST = 0, 99
"""Waves that score the members of the ensemble, and the nearest point beside one that stands."""
DECIMALS = 3
"""Of coordinates."""
CLEARLY = 2.0
"""Standard errors by which another point has to be nearer."""


@dataclass(frozen=True)
class Wave:
    """A step of the search."""

    points: int
    """Of how many points, the best of the wave before."""
    runs: int
    """Further runs a condition."""
    around: int = 0
    """Further points, in random steps from them."""
    step: float = 0.0
    """SD of these steps, length unit."""


PLAN = (
    Wave(points=60, runs=20),
    Wave(points=12, runs=20, around=60, step=0.1),
    Wave(points=12, runs=20, around=60, step=0.03),
    Wave(points=16, runs=60),
    Wave(points=5, runs=200),
)


@dataclass(frozen=True)
class Scored:
    """Goals, what was learned there, and how far that is from what is printed."""

    goals: Array
    cells: Mapping[str, Learned]
    comparisons: Sequence[Compared]

    @property
    def distance(self) -> float:
        """Root mean square over the printed figures, standard errors."""
        return distance(self.comparisons)


def scored(
    search: Search,
    goals: Iterable[Array],
    *,
    wave: int,
    runs: int,
    trials: int = 10_000,
    before: Mapping[bytes, Scored] = MappingProxyType({}),
) -> list[Scored]:
    """Learning runs at sets of goals (G, 2), with the seeds of a wave; in their order.

    Under the conditions of which something is printed, beside what is. Runs ``before``, by the
    bytes of the goals, count with them.
    """
    seeds = range(_SEEDS * wave, _SEEDS * wave + runs)
    name, fields = search.task.name, condition_under(search.readings)
    explored = {own: replace(CONDITIONS[own], **fields) for own in conditions_of(name)}
    tests = tests_of(name)

    def score(places: Array) -> Scored:
        task = search.task_with(places)
        cells = {
            name: learned(task, condition, seeds, model=search.model, trials=trials)
            for name, condition in explored.items()
        }
        if (known := before.get(places.tobytes())) is not None:
            cells = {name: known.cells[name].beside(own) for name, own in cells.items()}
        return Scored(places, cells, compared(tests, cells))

    with ThreadPoolExecutor(search.jobs) as pool:
        return list(pool.map(score, goals))


def best_of_waves(
    search: Search,
    points: Array,
    results: Sequence[Scored],
    *,
    plan: Sequence[Wave] = PLAN,
    trials: int = 10_000,
    report: Callable[[str], None] = lambda text: None,
) -> Array:
    """Points by their distance to what is printed, the nearest first; those of the last wave.

    ``points`` (N, P) are admissible and scored before; coordinates are rounded to
    :data:`DECIMALS`.
    """
    known = {result.goals.tobytes(): result for result in results}
    for number, wave in enumerate(plan, ENSEMBLE + 1):
        points = points[_by_distance(results)[: wave.points]]
        if wave.around:
            rng = np.random.default_rng([number, wave.around])
            found = np.round(search.spread(points, wave.around, rng, wave.step), DECIMALS)
            found = search.admitted(found[search.layout.allowed(found)], "around the best")
            points = np.unique(np.concatenate([points, found]), axis=0)
        goals = search.layout.places(points)
        results = scored(search, goals, wave=number, runs=wave.runs, trials=trials, before=known)
        known |= {result.goals.tobytes(): result for result in results}
        report(f"wave {number}: {described(results, wave.runs)}")
    return points[_by_distance(results)]


def clearly_nearer(found: Scored, standing: Scored) -> bool:
    """Whether a point is nearer to what is printed than one that stands, beyond chance."""
    errors = [
        distance_error([each.test for each in scored.comparisons], scored.cells)
        for scored in (found, standing)
    ]
    return standing.distance - found.distance > CLEARLY * math.hypot(*errors)


def _by_distance(results: Sequence[Scored]) -> NDArray[np.intp]:
    return np.argsort([result.distance for result in results], kind="stable")


def described(results: Sequence[Scored], runs: int) -> str:
    """How many sets of goals were scored, by how many further runs, and how far they are."""
    distances = [result.distance for result in results]
    return (
        f"{len(results)} sets of goals, {runs} runs a condition; "
        f"distances {min(distances):.2f} to {max(distances):.2f}"
    )
