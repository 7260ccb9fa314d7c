"""An ensemble of admissible goals, and the one of them nearest to what is printed of learning.

The ensemble is spread by what the corrective process alone does. The nearest is found in waves of
learning runs that begin there: each performs further runs of fewer points, with seeds that no
other wave uses, and a point is judged by all its runs so far. Between the waves the neighbourhood
of the best is searched.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from coartic import CoarticError, hand_sequences
from coartic.learner.learning import TRIALS
from coartic.motion.sequences import CorrectiveTrials
from coartic.robot import Array
from coartic.tasks.readings import condition_under
from coartic.threads import threads_for
from reconstruction.scoring import (
    Test,
    compare,
    conditions_of,
    distance,
    distance_error,
    learn_cell,
    printed_tests,
)
from reconstruction.search import Search

DECIMALS = 3  # of coordinates
STEP = 0.15  # SD of the random steps, length unit
POOL = 8_000  # points among which members are spread
WAVE_SEEDS = 1_000_000  # seeds of a wave begin at a multiple of this
ENSEMBLE, LAST = 0, 99
"""Waves that score the members of the ensemble, and the nearest point beside one that stands."""
CLEARLY = 2.0  # standard errors by which another point has to be nearer


class Effort(NamedTuple):
    """How thoroughly is searched; the defaults gave the shipped ensembles."""

    members: int = 240
    """Sets of goals that are kept."""
    runs: int = 20
    """Runs of each set and condition."""
    trials: int = TRIALS
    """Trials of each run."""
    most_near: int = 20_000
    """Points of the grid, drawn at random, that are moved to where the printed rewards come out."""
    random_steps: int = 4_000
    waves: tuple[tuple[int, int, int, float], ...] = (
        (60, 20, 0, 0.0),
        (12, 20, 60, 0.1),
        (12, 20, 60, 0.03),
        (16, 60, 0, 0.0),
        (5, 200, 0, 0.0),
    )
    """The waves of the search for the nearest point. Of each: number of points, the best of the
    wave before; further runs a condition; further points, in random steps from those; SD of these
    steps, length unit."""
    last_runs: int = 300
    """Runs a condition of the nearest point and of one that stands, to choose between them."""


QUICK = Effort(4, 2, 30, 30, 100, ((3, 2, 0, 0.0), (2, 2, 2, 0.01)), 2)
"""To try the search out."""


class Score(NamedTuple):
    """A point ``(P,)``, what was learned there, and how far that is from what is printed."""

    point: Array
    cells: Mapping[str, pd.DataFrame]
    """Runs by condition."""
    comparisons: pd.DataFrame
    distance: float
    """Root mean square over the printed figures, standard errors."""


def reconstruct(
    search: Search,
    effort: Effort,
    report: Callable[[str], None] = lambda text: None,
) -> pd.DataFrame:
    """Search, spread, score and choose.

    A row a member: coordinates, distance, and every figure of its runs with its distance. The
    first is the nearest set that was found; each of the others is as far as possible from those
    before it. The layout's earlier sets of goals compete where they meet every constraint, and
    come last; the first of them stands unless another one is nearer beyond chance, by further
    runs. The result depends on the arguments and on nothing else.
    """
    layout = search.layout
    goals = np.array(list(layout.earlier.values())).reshape(-1, len(layout.goals), 2)
    earlier = layout.points(goals)
    compete = search.admitted(earlier[layout.allowed(earlier)], "known")
    pool = admissible_points(search, effort, report)
    pool = np.concatenate([compete[:1], exclude(pool, compete[:1])])
    sequences = hand_sequences(search.task)
    printed = [sequences.index(hands) for hands in search.rewards]
    apart = features(search.attempt(pool, sequences), printed)
    spread = pool[farthest_first(apart, effort.members, 0 if len(compete) else None)]

    begin = np.concatenate([spread, exclude(compete, spread)])
    results = score(search, begin, effort.trials, wave=ENSEMBLE, runs=effort.runs)
    report(summary(results, effort.runs))
    nearest = best_of_waves(search, effort, results, report).point[None]
    if len(compete) and not (nearest == compete[:1]).all():
        both = np.concatenate([nearest, compete[:1]])
        challenger, standing = score(search, both, effort.trials, wave=LAST, runs=effort.last_runs)
        better = clearly_nearer(challenger, standing, printed_tests(search.task.name))
        report(
            f"the nearest {challenger.distance:.2f}, the one that stands {standing.distance:.2f}, "
            f"{effort.last_runs} runs a condition: {'it is replaced' if better else 'it stands'}"
        )
        nearest = nearest if better else compete[:1]

    chosen = np.concatenate([nearest, exclude(spread, nearest)])
    names = [*(f"m{k:03d}" for k in range(1, len(chosen) + 1)), *layout.earlier]
    points = np.concatenate([chosen, earlier])
    fresh = np.unique(exclude(points, begin), axis=0)
    others = score(search, fresh, effort.trials, wave=ENSEMBLE, runs=effort.runs)
    by_point = {result.point.tobytes(): result for result in (*results, *others)}
    rows = [
        member_row(name, places, by_point[point.tobytes()])
        for name, places, point in zip(names, layout.places(points), points, strict=True)
    ]
    if search.readings:
        rows = [{"readings": " ".join(map(str, search.readings))} | row for row in rows]
    return pd.DataFrame(rows)


def admissible_points(search: Search, effort: Effort, report: Callable[[str], None]) -> Array:
    """Admissible points with rounded coordinates, without repetitions, in random order."""
    rng = np.random.default_rng(0)
    exact, near = search.grid(report)
    report(f"{len(exact)} round sets of goals meet every constraint, {len(near)} come near")
    near = near[rng.permutation(len(near))[: effort.most_near]]
    points = np.concatenate([exact, search.admitted(search.solve(near), "moved")])
    if len(points):
        points = np.concatenate([points, search.spread(points, effort.random_steps, rng, STEP)])
    points = np.unique(np.round(points, DECIMALS), axis=0)
    points = search.admitted(points[search.layout.allowed(points)], "rounded")
    report(f"{len(points)} sets of goals with {DECIMALS} decimals meet every constraint")
    if not len(points):
        raise CoarticError(f"no set of goals of {search.task.name} meets every constraint")
    return points[rng.permutation(len(points))[:POOL]]


def features(trials: CorrectiveTrials, printed: Sequence[int]) -> Array:
    """What members are told apart by, ``(N, F)``: rewards and postures, which weigh the same.

    The reward of every hand sequence by the corrective process alone, and the postures in which
    some of them (``printed``, by number) hit the goals. Each group has a variance of 1 in all.
    """
    rewards = np.nan_to_num(trials.rewards, nan=-2e3)
    groups = []
    for values in (rewards, trials.reached[:, printed].reshape(len(rewards), -1)):
        spread = values.std(axis=0)
        varying = spread > 1e-9
        scaled = (values - values.mean(axis=0))[:, varying] / spread[varying]
        groups.append(scaled / np.sqrt(max(scaled.shape[1], 1)))
    return np.hstack(groups)


def farthest_first(points: Array, count: int, first: int | None = None) -> NDArray[np.int64]:
    """Indices of ``count`` points, each as far as possible from those before it.

    They begin with ``first``, or with the one nearest to the mean; then greedily the farthest
    (Gonzalez 1985, doi:10.1016/0304-3975(85)90224-5), so that the first k are spread for every k.
    """
    if first is None:
        first = int(np.argmin(((points - points.mean(axis=0)) ** 2).sum(axis=1)))
    chosen, gap = [first], np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        gap = np.minimum(gap, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(np.argmax(gap)))
    return np.array(chosen, dtype=np.int64)


def score(
    search: Search,
    points: Array,
    trials: int,
    *,
    wave: int,
    runs: int,
    before: Mapping[bytes, Score] = MappingProxyType({}),
) -> list[Score]:
    """Learning runs at points ``(N, P)``, with the seeds of a wave, beside what is printed.

    Under the conditions of which something is printed. Runs ``before``, by the bytes of the
    point, count with them.
    """
    seeds = range(WAVE_SEEDS * wave, WAVE_SEEDS * wave + runs)
    conditions = conditions_of(search.task.name, condition_under(search.readings))
    tests = printed_tests(search.task.name)

    def score_point(point: Array, goals: Array) -> Score:
        task, earlier, cells = search.task_with(goals), before.get(point.tobytes()), {}
        for name, condition in conditions.items():
            cell = learn_cell(task, condition, seeds, model=search.model, trials=trials)
            cells[name] = cell if earlier is None else pd.concat([earlier.cells[name], cell])
        comparisons = compare(tests, cells)
        return Score(point, cells, comparisons, distance(comparisons))

    with ThreadPoolExecutor(threads_for(search.jobs)) as pool:
        return list(pool.map(score_point, points, search.layout.places(points)))


def best_of_waves(
    search: Search,
    effort: Effort,
    results: Sequence[Score],
    report: Callable[[str], None],
) -> Score:
    """The point that is nearest to what is printed after some waves, which begin with these."""
    before = {result.point.tobytes(): result for result in results}
    for number, (best_points, runs, around_them, step) in enumerate(effort.waves, ENSEMBLE + 1):
        best = sorted(results, key=lambda result: result.distance)[:best_points]
        points = np.array([result.point for result in best])
        if around_them:
            rng = np.random.default_rng([number, around_them])
            around = np.round(search.spread(points, around_them, rng, step), DECIMALS)
            around = search.admitted(around[search.layout.allowed(around)], "around the best")
            points = np.unique(np.concatenate([points, around]), axis=0)
        results = score(search, points, effort.trials, wave=number, runs=runs, before=before)
        before |= {result.point.tobytes(): result for result in results}
        report(f"wave {number}: {summary(results, runs)}")
    return min(results, key=lambda result: result.distance)


def clearly_nearer(challenger: Score, standing: Score, tests: Sequence[Test]) -> bool:
    """Whether a point is nearer to what is printed than one that stands, beyond chance."""
    errors = [distance_error(tests, each.cells) for each in (challenger, standing)]
    return standing.distance - challenger.distance > CLEARLY * math.hypot(*errors)


def summary(results: Sequence[Score], runs: int) -> str:
    """How many sets of goals were scored, by how many further runs, and how far they are."""
    distances = [result.distance for result in results]
    return (
        f"{len(results)} sets of goals, {runs} runs a condition; "
        f"distances {min(distances):.2f} to {max(distances):.2f}"
    )


def exclude(points: Array, others: Array) -> Array:
    """The points that are none of the others."""
    return np.asarray(points[~(points[:, None] == others).all(axis=2).any(axis=1)])


def member_row(name: str, goals: Array, result: Score) -> dict[str, Any]:
    """A member's row of the table of an ensemble."""
    row: dict[str, Any] = {"member": name}
    for number, (x, y) in enumerate(goals.tolist(), 1):
        row |= {f"x{number}": round(x, DECIMALS), f"y{number}": round(y, DECIMALS)}
    row["distance"] = round(result.distance, 3)
    for label, ours, apart in result.comparisons[["ours", "distance"]].itertuples():
        row[label] = round(ours, 3 if label.endswith(" share") else 2)
        row[f"{label}, distance"] = round(apart, 2)
    return row
