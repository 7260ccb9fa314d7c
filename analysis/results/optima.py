"""The optimum of each task: the best reward known, and what is proven about it.

``optimum.json`` holds what suite ``optimum`` found for the shipped tasks, with the run ids
and the solutions; ``python -m analysis.results.optima FOLDER`` makes it from the results folder of
that suite. Optimum runs in a results folder of the user's own count as well, so a table for
the user's own task has gaps as soon as the task's optimum is among its runs.
"""

from __future__ import annotations

import hashlib
import json
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.results.laws import BASE
from analysis.results.folder import Results, load_results
from coartic import CoarticError, Task
from coartic.record import SEARCH
from coartic.text import one_line

METHODS = SEARCH  # methods that search for it
DATA = Path(__file__).with_name("optima.json")


@dataclass(frozen=True)
class Optimum:
    """The best reward known for one task under one restriction."""

    reward: int
    hands: str
    bound: int | None
    """Reward that no solution exceeds; None where nothing is proven."""
    searches: tuple[tuple[str, int], ...] = ()
    """Reward that each search found, by method."""

    @property
    def proven(self) -> bool:
        """Whether no solution can be better."""
        return self.bound == self.reward


def optima(results: Results) -> dict[tuple[str, str], Optimum]:
    """Optimum by task and other arm (``"free"``, ``"still"``) for the tasks of a folder.

    What the shipped data say where the task is the same in all that matters, bettered by
    what the folder's own optimum runs found.
    """
    found: dict[tuple[str, str], Optimum] = {}
    shipped = _shipped()
    own = results.runs[results.runs.method.str.startswith(METHODS) & (results.runs.status == "ok")]
    restriction = own.parameters.map(json.loads)
    base = restriction.map(lambda parameters: parameters.get("base", BASE))
    arm = restriction.map(lambda parameters: parameters.get("other_arm", "free"))
    for name, task in results.tasks.items():
        for other_arm in ("free", "still"):
            runs = own[(own.task == name) & (base == BASE) & (arm == other_arm)]
            candidates = [_from_runs(runs)] if len(runs) else []
            known = shipped.get((essence(task), other_arm, BASE))
            if known is not None:
                candidates.append(_from_entry(known))
            if candidates:
                found[name, other_arm] = _best(candidates)
    return found


def locks_base(runs: pd.DataFrame) -> bool:
    """Whether a parameter of these runs locks the base: another problem, another optimum."""
    locks = runs.parameters.map(lambda text: json.loads(text).get("base", BASE))
    return bool((locks != BASE).any())


def essence(task: Task) -> str:
    """Hash of what makes a task: start, goals, radius, hands, locks, robot."""
    content = task.model_dump(mode="json")
    kept = ("start", "goals", "radius", "hands", "locked_base", "robot")
    text = json.dumps({key: content[key] for key in kept}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def entries() -> list[dict[str, Any]]:
    """The shipped data, one entry per task and restriction."""
    content: dict[str, Any] = json.loads(DATA.read_text(encoding="utf-8"))
    rows: list[dict[str, Any]] = content["optima"]
    return rows


def collect(results: Results) -> list[dict[str, Any]]:
    """Entries of ``optimum.json`` from a results folder of suite ``optimum``.

    Raises CoarticError where the folder has no optimum runs.
    """
    runs = results.runs[results.runs.method.str.startswith(METHODS)].copy()
    if not len(runs):
        raise CoarticError(f"{results.folder}: has no runs of methods {METHODS}*")
    parameters = runs.parameters.map(json.loads)
    runs["other_arm"] = parameters.map(lambda values: values["other_arm"])
    runs["base"] = parameters.map(lambda values: values["base"])
    movements = results.solutions()
    environment = results.manifest.environment.model_dump(mode="json")
    keys = ("coartic", "commit", "model_code", "python", "date")
    made_by = {key: environment[key] for key in keys}
    rows = []
    for key, group in runs.groupby(["task", "base", "other_arm"], sort=False):
        name, base, arm = map(str, key)
        task = results.tasks[name]
        good = group[group.status == "ok"]
        entry: dict[str, Any] = {
            "task": name,
            "essence": essence(task),
            "base": base,
            "other_arm": arm,
            "run_ids": sorted(group.run_id),
            "made_by": made_by,
        }
        if len(good):
            best = good.iloc[int(good.reward.astype(int).argmax())]
            optimum = _from_runs(good)
            entry |= {
                "reward": optimum.reward,
                "hands": optimum.hands,
                "bound": optimum.bound,
                "searches": dict(optimum.searches),
                "solution": _movements(movements[movements.run_id == best.run_id]),
            }
        else:
            entry["infeasible"] = group.reason.iloc[0]
        rows.append(entry)
    return rows


def _movements(rows: pd.DataFrame) -> list[dict[str, Any]]:
    """Movements as ``coartic.frames.movements_from`` reads them, in full precision."""
    return [
        {str(key): value for key, value in row.items()}
        for row in rows.drop(columns="run_id").to_dict("records")
    ]


def _from_runs(runs: pd.DataFrame) -> Optimum:
    best = runs.iloc[int(runs.reward.astype(int).argmax())]
    bounds = runs.proven_bound.dropna()
    searches = runs.groupby("method").reward.max()
    return Optimum(
        reward=int(best.reward),
        hands=str(best.hands),
        bound=int(bounds.min()) if len(bounds) else None,
        searches=tuple((str(method), int(reward)) for method, reward in searches.items()),
    )


def _from_entry(entry: dict[str, Any]) -> Optimum:
    searches = tuple(entry["searches"].items())
    return Optimum(entry["reward"], entry["hands"], entry["bound"], searches)


def _best(candidates: list[Optimum]) -> Optimum:
    best = max(candidates, key=lambda optimum: optimum.reward)
    bounds = [optimum.bound for optimum in candidates if optimum.bound is not None]
    return Optimum(best.reward, best.hands, min(bounds, default=None), best.searches)


@cache
def _shipped() -> dict[tuple[str, str, str], dict[str, Any]]:
    return {
        (entry["essence"], entry["other_arm"], entry["base"]): entry
        for entry in entries()
        if "reward" in entry
    }


def main() -> None:
    """``python -m analysis.results.optima FOLDER``: renew entries of ``optimum.json``."""
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(
            "usage: python -m analysis.results.optima RESULTS_FOLDER\n"
            f"Renews in {DATA} what the folder's optimum runs cover; the rest stays."
        )
    try:
        new = collect(load_results(Path(sys.argv[1])))
    except CoarticError as error:
        sys.exit(one_line(str(error)))

    def key(entry: dict[str, Any]) -> tuple[str, str, str]:
        return entry["task"], entry["base"], entry["other_arm"]

    renewed = {key(entry) for entry in new}
    kept = [entry for entry in entries() if key(entry) not in renewed]
    content = {"optima": sorted([*kept, *new], key=key)}
    DATA.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"{DATA}: {len(new)} optima renewed, {len(kept)} kept")


if __name__ == "__main__":
    main()
