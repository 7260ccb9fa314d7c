"""Tables of the signatures of coarticulation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from statistics import fmean

import numpy as np

from coartic.analysis.methods import in_order, is_search
from coartic.analysis.settings import shown_methods
from coartic.analysis.signatures.signs import SIGNS, as_in_isolation, preshaping_of_the_other_arm
from coartic.analysis.statistics.hypotheses import holm
from coartic.analysis.study import Study, one_by_one
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics.coarticulation import placebo
from coartic.analysis.topics.coarticulation.shared_goals import shared_goals
from coartic.analysis.words import marked
from coartic.robot import Array


@table("method, place, runs, distance, dependence, p_holm, p_placebo, equivalent, other")
def contexts(study: Study) -> Rows:
    """Postures at a shared goal before different successors."""
    rows = []
    for shared in shared_goals(study):
        first, second = shared.tasks
        row: Row = {
            "method": shared.method,
            "place": f"goal {shared.goal} of {first.label} and {second.label}",
            "runs": shared.n,
            "distance": shared.apart,
            "dependence": shared.spreads,
            "p_holm": math.nan if math.isnan(shared.spreads) else shared.p,
            "p_placebo": placebo.context_beyond_p(study, shared),
            "equivalent": shared.parts[0],
            "other": shared.parts[1],
            **runs_of(*(study.cells[task.name, shared.method] for task in shared.tasks)),
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
    for task in (name for name in study.tasks if name in one_by_one(study)):
        labels = [label for name, label in study.cells if name == task]
        for label in in_order(shown_methods(study, labels)):
            cell, runs = study.cells[task, label], study.executed(task, label)
            if runs.runs and not is_search(label):
                row: Row = {
                    "task": marked(study.tasks[task]),
                    "method": label,
                    "runs": len(cell.good),
                    "first": mean_of_goals(SIGNS["first"].each(runs)[:, None]),
                    "first_p": placebo.sign_beyond_p(study, task, label, "first"),
                    "total": mean_of_goals(runs.against_same_hands.sum(axis=1)[:, None]),
                    "as_in_isolation": mean_of_goals(as_in_isolation(runs)),
                    "preshaping": mean_of_goals(preshaping_of_the_other_arm(runs)),
                    "preshaping_p": placebo.sign_beyond_p(study, task, label, "other arm"),
                }
                yield f"{task} {label}", row | runs_of(cell)


def mean_of_goals(values: Array) -> float:
    """Mean over goals of the means over runs that have a value, ``(n, G)``; NaN without any."""
    there = [of_goal[np.isfinite(of_goal)] for of_goal in values.T]
    means = [of_goal.mean() for of_goal in there if len(of_goal)]
    return fmean(means) if means else math.nan
