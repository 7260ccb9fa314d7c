"""From a layout to an ensemble: everything a search did and found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from coartic import CoarticError, load_task
from coartic.analysis.reconstruction.constraints import Tried
from coartic.analysis.reconstruction.layout import layouts
from coartic.analysis.reconstruction.scoring import Figure
from coartic.analysis.reconstruction.search import Search
from coartic.analysis.reconstruction.targets import constraints_of
from coartic.analysis.reconstruction.waves import (
    DECIMALS,
    ENSEMBLE,
    LAST,
    PLAN,
    Scored,
    Wave,
    best_of_waves,
    clearly_nearer,
    described,
    scored,
)
from coartic.robot import Array
from coartic.tasks.readings import load_readings, task_under
from coartic.text import did_you_mean

_MOST_NEAR = 20_000  # points of the grid, drawn at random, that are moved into the region
_MOST_STEPS = 4_000  # random steps from what was found
_STEP = 0.15  # their SD, length unit
_POOL = 8_000  # points among which members are spread


@dataclass(frozen=True)
class Effort:
    """How much a search does."""

    members: int = 240
    runs: int = 20
    """A condition, for the figures of each member."""
    last: int = 300
    """A condition, for the nearest set beside the one that stands."""
    plan: Sequence[Wave] = PLAN
    trials: int = 10_000


FULL = Effort()


@dataclass(frozen=True)
class Reconstruction:
    """What a search for one task's goals found."""

    search: Search
    nearest: Scored
    """The point that was chosen, by the seeds of the ensemble."""
    members: pd.DataFrame
    """A row a member: coordinates, figures and distances. That point is the first, each of the
    others as far as possible from those before it; known sets of goals come last."""
    pool: int
    """Admissible points among which the members are spread."""

    @property
    def tried(self) -> pd.DataFrame:
        """What was tried: stage, number of sets of goals."""
        return pd.DataFrame(self.search.tried.items(), columns=["stage", "sets of goals"])


def search_for(task: str, *, readings: Sequence[str] = (), jobs: int = 2) -> Search:
    """A search for the goals of a task under readings, as ``ties=right``.

    Raises CoarticError for a task whose goals are printed, and for readings that are none.
    """
    known = layouts()
    if task not in known:
        raise CoarticError(
            f"the paper prints the goals of task {task!r}; tasks with goals that are not "
            f"printed: {', '.join(known)}{did_you_mean(task, known)}"
        )
    chosen = load_readings(readings)
    found = task_under(chosen, load_task(task))
    return Search(found, known[task], constraints_of(found), chosen, jobs)


def reconstruct(
    search: Search,
    *,
    effort: Effort = FULL,
    report: Callable[[str], None] = lambda text: None,
) -> Reconstruction:
    """Search, spread, score and choose.

    The admissible region, an ensemble spread over it by what the corrective process alone
    does, and by waves from there the point nearest to what is printed.

    The layout's known sets of goals compete where they meet every constraint, and are scored
    beside it; the first of them stands unless another one is nearer beyond chance. The result
    depends on the arguments and on nothing else.
    """
    layout = search.layout
    known = np.array(list(layout.known.values())).reshape(-1, len(layout.goals), 2)
    compete = layout.points(known)
    compete = search.admitted(compete[layout.allowed(compete)], "known")
    pool = _pool(search, report)
    pool = np.concatenate([compete[:1], _without(pool, compete[:1])])
    hands = tuple(sorted({c.hands for c in search.printed}))
    apart = features(search.every_sequence(pool), hands)
    spread = pool[spread_out(apart, effort.members, 0 if len(compete) else None)]
    scores: dict[bytes, Scored] = {}

    def score(places: Array) -> list[Scored]:
        fresh = {goals.tobytes(): goals for goals in places if goals.tobytes() not in scores}
        found = scored(
            search, fresh.values(), wave=ENSEMBLE, runs=effort.runs, trials=effort.trials
        )
        scores.update(zip(fresh, found, strict=True))
        return [scores[goals.tobytes()] for goals in places]

    begin = np.concatenate([spread, _without(compete, spread)])
    results = score(layout.places(begin))
    report(described(results, effort.runs))
    nearest = best_of_waves(
        search, begin, results, plan=effort.plan, trials=effort.trials, report=report
    )[:1]
    if len(compete) and not (nearest == compete[:1]).all():
        both = layout.places(np.concatenate([nearest, compete[:1]]))
        found, standing = scored(search, both, wave=LAST, runs=effort.last, trials=effort.trials)
        better = clearly_nearer(found, standing)
        report(
            f"the nearest {found.distance:.2f}, the one that stands {standing.distance:.2f}, "
            f"{effort.last} runs a condition: {'it is replaced' if better else 'it stands'}"
        )
        nearest = nearest if better else compete[:1]
    members = np.concatenate([nearest, _without(spread, nearest)])
    names = [*(f"m{k:03d}" for k in range(1, len(members) + 1)), *layout.known]
    goals = np.concatenate([layout.places(members), known])
    results = score(goals)
    rows = [_row(*each) for each in zip(names, goals, results, strict=True)]
    if search.readings:
        rows = [{"readings": " ".join(map(str, search.readings))} | row for row in rows]
    return Reconstruction(search, results[0], pd.DataFrame(rows), len(pool))


def features(tried: Tried, hands: tuple[str, ...]) -> Array:
    """What members are told apart by, ``(N, F)``, each of unit variance.

    The reward of every hand sequence by the corrective process alone, and the postures in
    which some ``hands`` hit the goals; both groups weigh the same.
    """
    rewards = _standard(np.nan_to_num(tried.trials.rewards, nan=-2e3))
    chosen = [tried.sequences.index(name) for name in hands]
    postures = tried.trials.reached[:, chosen].reshape(len(rewards), -1)
    return np.hstack([_standard(values) for values in (rewards, postures)])


def _standard(values: Array) -> Array:
    spread = values.std(axis=0)
    varying = spread > 1e-9
    scaled = (values - values.mean(axis=0))[:, varying] / spread[varying]
    return np.asarray(scaled / np.sqrt(max(scaled.shape[1], 1)))


def spread_out(points: Array, count: int, first: int | None = None) -> NDArray[np.int64]:
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


def _pool(search: Search, report: Callable[[str], None]) -> Array:
    """Admissible points with rounded coordinates, without repetitions, in random order."""
    rng = np.random.default_rng(0)
    tenths = 0

    def progress(done: int, size: int) -> None:
        nonlocal tenths
        if 10 * done // size > tenths:
            tenths = 10 * done // size
            report(f"{10 * tenths} % of the grid")

    exact, near = search.grid(progress)
    report(f"{len(exact)} round sets of goals meet every constraint, {len(near)} come near")
    near = near[rng.permutation(len(near))[:_MOST_NEAR]]
    found = np.concatenate([exact, search.admitted(search.solve(near), "moved")])
    if len(found):
        found = np.concatenate([found, search.spread(found, _MOST_STEPS, rng, _STEP)])
    found = np.unique(np.round(found, DECIMALS), axis=0)
    found = search.admitted(found[search.layout.allowed(found)], "rounded")
    report(f"{len(found)} sets of goals with {DECIMALS} decimals meet every constraint")
    if not len(found):
        raise CoarticError(f"no set of goals of {search.task.name} meets every constraint")
    return found[rng.permutation(len(found))[:_POOL]]


def _without(points: Array, others: Array) -> Array:
    """The points that are none of the others."""
    return np.asarray(points[~(points[:, None] == others).all(axis=2).any(axis=1)])


def _row(name: str, goals: Array, result: Scored) -> dict[str, Any]:
    row: dict[str, Any] = {"member": name}
    for number, (x, y) in enumerate(goals.tolist(), 1):
        row |= {f"x{number}": round(x, DECIMALS), f"y{number}": round(y, DECIMALS)}
    row["distance"] = round(result.distance, 3)
    for each in result.comparisons:
        digits = 3 if isinstance(each.test, Figure) and each.test.kind == "share" else 2
        row[each.test.label] = round(each.ours, digits)
        row[f"{each.test.label}, distance"] = round(each.distance, 2)
    return row
