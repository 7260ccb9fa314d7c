"""Tables of the signatures of coarticulation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from coartic.analysis.methods import in_order, is_search
from coartic.analysis.settings import shown_methods
from coartic.analysis.signatures.between import TwoContexts
from coartic.analysis.statistics.hypotheses import holm
from coartic.analysis.study import Study, one_by_one
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics.coarticulation import placebo
from coartic.analysis.topics.coarticulation.values import signature_values
from coartic.analysis.words import marked

COLUMN_OF = {
    "first": "first subtask against the same hands",
    "total": "total against the same hands",
    "as_in_isolation": "hand as in isolation",
    "preshaping": "preshaping of the other arm",
}
"""Columns of :func:`signatures` and the signatures whose means over goals they have."""


@table("method, place, runs, distance, dependence, p_holm, p_placebo, equivalent, other")
def contexts(study: Study) -> Rows:
    """Postures at a shared goal before different successors."""
    frame = signature_values(study)
    frame = frame[frame.against.ne("")]
    rows = []
    at: Any
    for at, group in frame.groupby(["task", "label", "goal", "hand", "against"], sort=False):
        task, label, goal, hand, against = at
        value, p = (group.set_index("signature")[column] for column in ("value", "p"))
        first, second = (study.trajectories(name, label) for name in (task, against))
        shared = TwoContexts(first, second, goal, hand)
        row: Row = {
            "method": label,
            "place": f"goal {goal} of {study.tasks[task].label} and {study.tasks[against].label}",
            "runs": int(group.n.max()),
            "distance": value.get("context distance"),
            "dependence": value.get("context dependence"),
            "p_holm": p.get("context dependence", math.nan),
            "p_placebo": placebo.context_beyond_p(study, shared),
            "equivalent": value.get("motor-equivalent part"),
            "other": value.get("non-motor-equivalent part"),
            **runs_of(*(study.cells[name, label] for name in (task, against))),
        }
        rows.append((shared.row, row))
    yield from adjust_p(rows)


def adjust_p(rows: list[tuple[str, Row]]) -> Iterator[tuple[str, Row]]:
    """Rows with their p-values adjusted over those of the same method (Holm)."""
    p: dict[str, list[float]] = {}
    for _, row in rows:
        p.setdefault(row["method"], []).append(row["p_holm"])
    adjusted = {method: iter(holm(of_method)) for method, of_method in p.items()}
    for name, row in rows:
        yield name, row | {"p_holm": next(adjusted[row["method"]])}


@table("task, method, runs, first, first_p, total, as_in_isolation, preshaping, preshaping_p")
def signatures(study: Study) -> Rows:
    """The main signatures of every main method on every task, means over runs and goals.

    ``first_p`` and ``preshaping_p`` are of the tests against the placebo.
    """
    frame = signature_values(study)
    for task in (name for name in study.tasks if name in one_by_one(study)):
        labels = [label for name, label in study.cells if name == task]
        for label in in_order(shown_methods(study, labels)):
            values = frame[(frame.task == task) & (frame.label == label)]
            if len(values) and not is_search(label):
                means = values.groupby("signature").value.mean()
                cell = study.cells[task, label]
                row: Row = {
                    "task": marked(study.tasks[task]),
                    "method": label,
                    "runs": len(cell.good),
                    **{
                        name: means.get(signature, math.nan)
                        for name, signature in COLUMN_OF.items()
                    },
                    "first_p": placebo.sign_beyond_p(study, task, label, "first"),
                    "preshaping_p": placebo.sign_beyond_p(study, task, label, "other arm"),
                }
                yield f"{task} {label}", row | runs_of(cell)


@table("task, label, signature, where, value[], p, n, unit")
def all_signatures(study: Study) -> Rows:
    """Every value of every signature, one a row, with its place, interval and test."""
    frame = signature_values(study).rename(columns={"low": "value_low", "high": "value_high"})
    for values in frame.to_dict("records"):
        row: Row = {str(name): value for name, value in values.items()}
        task, label = row["task"], row["label"]
        cells = [study.cells[name, label] for name in (task, row["against"]) if name]
        yield f"{task} {label}, {row['signature']} {row['where']}".strip(), row | runs_of(*cells)
