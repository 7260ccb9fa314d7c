"""From a layout to an ensemble: everything a search did and found."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.reconstruction.ensemble import features, spread_out
from analysis.reconstruction.layout import layouts
from analysis.reconstruction.scoring import Figure
from analysis.reconstruction.search import Search
from analysis.reconstruction.targets import conditions_of, constraints_of, tests_of
from analysis.reconstruction.waves import PLAN, REPORTED, Scored, Wave, best_of_waves, scored
from coartic import PAPER, CoarticError, MotionModel, load_task
from coartic.text import did_you_mean

Array = NDArray[np.float64]
DECIMALS = 3
"""Of coordinates."""
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
    plan: Sequence[Wave] = PLAN
    trials: int = 10_000


FULL = Effort()


@dataclass(frozen=True)
class Reconstruction:
    """What a search for one task's goals found."""

    search: Search
    nearest: Scored
    """The point that is nearest to what is printed, by seeds that selected nothing."""
    members: pd.DataFrame
    """A row a member: coordinates, figures and distances; the nearest one is the first."""
    pool: int
    """Admissible points among which the members are spread."""

    @property
    def tried(self) -> pd.DataFrame:
        """What was tried: stage, number of sets of goals."""
        return pd.DataFrame(self.search.tried.items(), columns=["stage", "sets of goals"])

    def write(self, folder: Path) -> list[Path]:
        """Write both tables into a folder; their paths."""
        folder.mkdir(parents=True, exist_ok=True)
        name = self.search.task.name
        paths = [folder / f"{name}-members.csv", folder / f"{name}-tried.csv"]
        self.members.to_csv(paths[0], index=False, lineterminator="\n")
        self.tried.to_csv(paths[1], index=False, lineterminator="\n")
        return paths


def search_for(task: str, *, model: MotionModel = PAPER, jobs: int = 2) -> Search:
    """A search for the goals of a task; CoarticError for one whose goals are printed."""
    known = layouts()
    if task not in known:
        raise CoarticError(
            f"there is nothing to reconstruct of task {task!r}; tasks with goals that are not "
            f"printed: {', '.join(known)}{did_you_mean(task, known)}"
        )
    found = load_task(task)
    return Search(found, known[task], constraints_of(found), model=model, jobs=jobs)


def reconstruct(
    search: Search,
    *,
    effort: Effort = FULL,
    named: Mapping[str, Array] | None = None,
    report: Callable[[str], None] = lambda text: None,
    progress: Callable[[int, int], None] = lambda done, size: None,
) -> Reconstruction:
    """Search, choose and score: the admissible region, the point nearest to what is printed,
    and an ensemble spread over the region.

    ``named`` sets of goals (G, 2) are scored beside it, admissible or not. The result depends
    on the arguments and on nothing else.
    """
    name = search.task.name
    tests, conditions = tests_of(name), conditions_of(name)
    pool = _pool(search, report, progress)
    hands = tuple(sorted({c.hands for c in search.printed}))
    order = spread_out(features(search.every_sequence(pool), hands), len(pool))
    pool = pool[order]
    ranked = best_of_waves(
        search, pool, tests, conditions=conditions, plan=effort.plan, report=report,
        trials=effort.trials,
    )  # fmt: skip
    best = ranked[0]
    others = pool[~(pool == best).all(axis=1)][: effort.members - 1]
    members = {f"m{k:03d}": point for k, point in enumerate([best, *others], 1)}
    goals = {member: search.layout.places(point[None])[0] for member, point in members.items()}
    goals |= named or {}
    results = scored(
        search, goals.values(), tests, conditions=conditions, wave=REPORTED,
        runs=effort.runs, trials=effort.trials,
    )  # fmt: skip
    report(f"{len(results)} members, {effort.runs} runs a condition")
    rows = [_row(*pair) for pair in zip(goals.items(), results, strict=True)]
    return Reconstruction(search, results[0], pd.DataFrame(rows), len(pool))


def _pool(
    search: Search, report: Callable[[str], None], progress: Callable[[int, int], None]
) -> Array:
    """Admissible points with rounded coordinates, without repetitions."""
    rng = np.random.default_rng(0)
    exact, near = search.grid(progress)
    report(f"{len(exact)} round sets of goals meet every constraint, {len(near)} come near")
    near = near[rng.permutation(len(near))[:_MOST_NEAR]]
    found = np.concatenate([exact, search.admitted(search.solve(near), "moved")])
    if not len(found):
        raise CoarticError(f"no set of goals of {search.task.name} meets every constraint")
    steps = search.spread(found, _MOST_STEPS, rng, _STEP)
    found = np.unique(np.round(np.concatenate([found, steps]), DECIMALS), axis=0)
    found = search.admitted(found[search.layout.allowed(found)], "rounded")
    found = np.concatenate([exact, found[rng.permutation(len(found))]])
    _, first = np.unique(found, axis=0, return_index=True)
    found = found[np.sort(first)]
    report(f"{len(found)} sets of goals with {DECIMALS} decimals meet every constraint")
    return found[:_POOL]


def _row(member: tuple[str, Array], result: Scored) -> dict[str, Any]:
    name, goals = member
    row: dict[str, Any] = {"member": name}
    for number, (x, y) in enumerate(goals.tolist(), 1):
        row |= {f"x{number}": round(x, DECIMALS), f"y{number}": round(y, DECIMALS)}
    row["distance"] = round(result.distance, 3)
    for each in result.comparisons:
        digits = 3 if isinstance(each.test, Figure) and each.test.kind == "share" else 2
        row[each.test.label] = round(each.ours, digits)
        row[f"{each.test.label}, distance"] = round(each.distance, 2)
    return row
