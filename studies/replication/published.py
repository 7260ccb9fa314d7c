"""Look up rewards that Shah, Barto & Fagg (2013) publish (``published.toml``)."""

import math
import tomllib
from pathlib import Path
from typing import NamedTuple

ENTRIES = {
    f"{task}.{name}": {"task": task, **entry}
    for task, entries in tomllib.loads(
        Path(__file__).with_name("published.toml").read_text("utf-8")
    ).items()
    for name, entry in entries.items()
}
"""Entries of ``published.toml`` by id, with their task, in the paper's order of tasks."""
for _entry in ENTRIES.values():
    if "difference_of" in _entry:
        _first, _second = (ENTRIES[name]["value"] for name in _entry["difference_of"])
        _entry["value"] = _first - _second
RUNS = ENTRIES["general.runs"]["value"]
"""Number of runs of every experiment of the paper."""
TRIALS = ENTRIES["general.trials"]["value"]
"""Number of trials of every run of the paper."""


class Summary(NamedTuple):
    """A published reward, or the mean of several published rewards, with its spread."""

    mean: float
    sd: float | None = None
    runs: int = RUNS
    """Number of runs: published with the reward, or the paper's general 20."""
    published_runs: int | None = None
    """Number of runs with the hand sequence, if the paper publishes it with the mean."""
    derived: bool = False
    """True if the reward is computed from other published numbers."""


def published_alone(task, kind):
    """Return the published reward of the corrective process alone on a task, or None.

    ``kind`` is ``initial hands`` or ``best of all sequences``.
    """
    of_task = [entry for entry in ENTRIES.values() if entry["task"] == task]
    hands = next((entry["hands"] for entry in of_task if entry["kind"] == kind), None)
    for entry in of_task:
        if entry["kind"] == "reward" and "condition" not in entry and entry["hands"] == hands:
            return Summary(entry["value"], derived="difference_of" in entry)
    return None


def published_cell(task, condition):
    """Return the published rewards of a cell by hand sequence, with ``""`` for all runs.

    For some cells the paper has rewards by hand sequence, and for one cell it has only hands. The
    result is None for a cell that the paper does not mention.
    """
    entries = {
        (entry["kind"], entry.get("hands", "")): entry
        for entry in ENTRIES.values()
        if (entry["task"], entry.get("condition")) == (task, condition)
    }
    if not entries:
        return None
    summaries = {}
    for (kind, hands), entry in entries.items():
        if kind == "reward":
            count = entries.get(("count", hands), {})
            summaries[hands] = Summary(
                entry["value"],
                entries.get(("sd", hands), {}).get("value"),
                count.get("value", RUNS),
                count.get("value") if hands else RUNS,
            )
    if summaries and "" not in summaries:
        summaries[""] = pooled([*summaries.values()])
    return summaries


def pooled(parts):
    """Return mean and SD over all runs of several groups, from mean and SD of each group."""
    if len(parts) == 1:
        return parts[0]
    runs = sum(part.runs for part in parts)
    mean = sum(part.runs * part.mean for part in parts) / runs
    if any(part.sd is None for part in parts):
        return Summary(mean, None, runs, derived=True)
    squares = sum((part.runs - 1) * part.sd**2 + part.runs * (part.mean - mean) ** 2
                  for part in parts)  # fmt: skip
    return Summary(mean, math.sqrt(squares / (runs - 1)), runs, derived=True)
