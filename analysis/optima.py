"""The optimum of each task: the best reward known, what is proven about it, and by which runs.

``optima.json`` holds what suite ``optimum`` found for the shipped tasks, with the run ids and the
solutions; ``python -m coartic.analysis.renew_optima FOLDER`` makes it from the results folder of
that suite. Searches for the optimum in a results folder of the user's own count as well, so a
table for the user's own task has gaps as soon as the task's optimum is among its runs.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

import pandas as pd
from pydantic import BaseModel, ConfigDict

from coartic import PAPER, MotionModel, Task
from coartic.runs.plan import SEARCH, label_of

BASE = "task"
"""Base locked as the task has it: the case that rewards compare with."""
DATA = Path(__file__).with_name("optima.json")
SHIPPED = f"shipped data (analysis/{DATA.name})"

OtherArm = Literal["free", "still"]
ARMS: tuple[OtherArm, ...] = ("free", "still")
"""Whether the arm that is not chosen may move, or is kept still."""
KEPT = ("start", "radius", "hands", "locked_base", "robot")
"""What makes a task beside its goals."""


class ShippedOptimum(BaseModel):
    """What is shipped of one task under one restriction: a reward, or why there is none."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    task: str
    essence: str
    """Of the task, as :func:`essence` has it."""
    base: str
    """Directions in which the base is locked; ``task``: as the task locks it."""
    other_arm: OtherArm
    run_ids: tuple[str, ...]
    made_by: dict[str, Any]
    reward: int | None = None
    hands: str = ""
    bound: int | None = None
    """Reward that no solution exceeds; None where nothing is proven."""
    searches: dict[str, int] = {}
    """Reward that each search found, by method."""
    solution: tuple[dict[str, Any], ...] = ()
    """Movements as :func:`coartic.learner.rows.movements_from` reads them, in full precision."""
    infeasible: str = ""
    """Why no search has a solution."""

    @property
    def key(self) -> tuple[str, str, str]:
        """What it is about: task, lock of the base, other arm."""
        return self.task, self.base, self.other_arm


@dataclass(frozen=True)
class KnownOptimum:
    """The best reward known for one task under one restriction, and what it rests on."""

    reward: int
    hands: str
    bound: int | None
    """Reward that no solution exceeds; None where nothing is proven."""
    searches: tuple[tuple[str, int], ...] = ()
    """Reward that each search found, by method."""
    source: str = ""
    """The runs that give the reward and its bound, in words."""
    cells: tuple[tuple[str, str], ...] = ()
    """Task and label of the folder's own searches among them."""

    @property
    def proven(self) -> bool:
        """Whether no solution can be better."""
        return self.bound == self.reward

    @property
    def searched(self) -> int:
        """The best reward of any search for it."""
        return max((reward for _, reward in self.searches), default=self.reward)

    @property
    def how(self) -> str:
        """Whether it is proven, and by which runs."""
        return f"{'proven' if self.proven else 'not proven'}; {self.source}"


def known_optima(
    runs: pd.DataFrame, tasks: Mapping[str, Task], model: MotionModel
) -> dict[tuple[str, str], KnownOptimum]:
    """Optimum by task and other arm (``"free"``, ``"still"``) for the tasks of a folder.

    What the shipped data say where task and model are the same in all that matters, bettered by
    what the folder's own searches found; these are named as its source wherever they give it.
    Searches of an instance of a family are short, and any run of the folder may better them.
    """
    found: dict[tuple[str, str], KnownOptimum] = {}
    solved = runs[runs.method.str.startswith(SEARCH) & (runs.status == "ok")]
    for name, task in tasks.items():
        own = solved[solved.task == name]
        for arm in ARMS:
            searches = dict(_searches(own, arm))
            candidates = [from_runs(pd.concat(list(searches.values())))] if searches else []
            entry = _shipped().get((essence(task), arm)) if model == PAPER else None
            if entry is not None and entry.reward is not None:
                best = tuple(entry.searches.items())
                candidates.append(KnownOptimum(entry.reward, entry.hands, entry.bound, best))
            if candidates:
                stored = f"{SHIPPED}, runs {', '.join(entry.run_ids if entry else ())}"
                found[name, arm] = _best(candidates, searches, stored)
        if task.family is not None and (name, "free") in found:
            found[name, "free"] = _bettered(found[name, "free"], runs[runs.task == name])
    return found


def locks_base(runs: pd.DataFrame) -> bool:
    """Whether a parameter of these runs locks the base: another problem, another optimum."""
    return any(map(_locks_base, runs.parameters.unique()))


def _locks_base(parameters: str) -> bool:
    return bool(json.loads(parameters).get("base", BASE) != BASE)


def essence(task: Task) -> str:
    """Hash of what makes a task: start, goals, radius, hands, locks, robot."""
    content = task.model_dump(mode="json")
    text = json.dumps({key: content[key] for key in ("goals", *KEPT)}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def entries() -> list[ShippedOptimum]:
    """The shipped data, one entry per task and restriction."""
    content = json.loads(DATA.read_text(encoding="utf-8"))
    return [ShippedOptimum.model_validate(entry) for entry in content["optima"]]


def _searches(solved: pd.DataFrame, arm: str) -> Iterator[tuple[tuple[str, str], pd.DataFrame]]:
    """Of solved searches those with this other arm and the task's own base, by cell."""
    if not len(solved):
        return
    asked = restrictions(solved)
    kept = solved[(asked.base == BASE) & (asked.other_arm == arm)]
    for (task, method, variant), own in kept.groupby(["task", "method", "variant"], sort=False):
        yield (str(task), label_of(str(method), str(variant))), own


def restrictions(runs: pd.DataFrame) -> pd.DataFrame:
    """Lock of the base and other arm of each run, by its parameters."""
    known = {"base": BASE, "other_arm": "free"}
    asked = {text: known | json.loads(text) for text in runs.parameters.unique()}
    return pd.DataFrame(
        {name: [asked[text][name] for text in runs.parameters] for name in known}, runs.index
    )


def from_runs(runs: pd.DataFrame) -> KnownOptimum:
    """The best of these solved runs, with the lowest bound that they prove."""
    best = runs.iloc[int(runs.reward.astype(int).argmax())]
    bounds = runs.proven_bound.dropna()
    searches = runs.groupby("method").reward.max()
    return KnownOptimum(
        reward=int(best.reward),
        hands=str(best.hands),
        bound=int(bounds.min()) if len(bounds) else None,
        searches=tuple((str(method), int(reward)) for method, reward in searches.items()),
    )


def _best(
    candidates: list[KnownOptimum], searches: Mapping[tuple[str, str], pd.DataFrame], stored: str
) -> KnownOptimum:
    """The best reward with the lowest bound of all, and where the two are from."""
    best = max(candidates, key=lambda optimum: optimum.reward)
    bounds = [optimum.bound for optimum in candidates if optimum.bound is not None]
    bound = min(bounds, default=None)
    given = [key for key, runs in searches.items() if (runs.reward == best.reward).any()]
    proving = [key for key, runs in searches.items() if (runs.proven_bound == bound).any()]
    reward, proof = ("searches of this folder" if own else stored for own in (given, proving))
    source = reward if bound is None or reward == proof else f"reward: {reward}; bound: {proof}"
    cells = tuple(dict.fromkeys(given + proving))
    return replace(best, bound=bound, source=source, cells=cells)


def _bettered(known: KnownOptimum, runs: pd.DataFrame) -> KnownOptimum:
    """With the best of all solved runs of a task, where that is more than what is known."""
    solved = runs[(runs.status == "ok") & ~runs.parameters.map(_locks_base)]
    if not len(solved) or int(solved.reward.max()) <= known.reward:
        return known
    best = solved.iloc[int(solved.reward.astype(int).argmax())]
    cell = str(best.task), label_of(str(best.method), str(best.variant))
    source = f"reward: {cell[1]} of this folder, more than by {known.source}"
    cells = tuple(dict.fromkeys([*known.cells, cell]))
    return replace(
        known, reward=int(best.reward), hands=str(best.hands), source=source, cells=cells
    )


@cache
def _shipped() -> dict[tuple[str, str], ShippedOptimum]:
    """Entries with the task's own base, by the task's essence and the other arm."""
    return {(entry.essence, entry.other_arm): entry for entry in entries() if entry.base == BASE}
