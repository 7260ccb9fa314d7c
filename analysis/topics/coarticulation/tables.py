"""Tables of the signatures of coarticulation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pandas as pd

from coartic.analysis.methods import PLACEBO, in_order, is_search, main_methods
from coartic.analysis.signatures.between import TwoContexts
from coartic.analysis.signatures.locus import families, variants
from coartic.analysis.signatures.register import placebo_of, selects, slope_beyond_p
from coartic.analysis.signatures.register import signatures as signature_values
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.statistics.hypotheses import bootstrap_test, holm
from coartic.analysis.study import Study, one_by_one
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.words import marked

_MEANS = {
    "first": "first subtask against the same hands",
    "total": "total against the same hands",
    "as_in_isolation": "hand as in isolation",
    "preshaping": "preshaping of the other arm",
    "turning": "turning angle",
    "travel": "travel of the other arm",
}
"""Columns of :func:`signatures` and the signatures whose means over goals they have."""


@table("method, place, runs, distance, dependence, p_holm, p_placebo, equivalent, other, lead")
def contexts(study: Study) -> Rows:
    """Postures at a shared goal before different successors."""
    frame = signature_values(study)
    frame = frame[frame.against.ne("") & frame.value.notna() & frame.moving.isna()]
    rows = []
    keys = ["task", "label", "goal", "hand", "against"]
    for at, group in frame.groupby(keys, sort=False):
        task, label, goal, hand, against = map(str, at)
        by_signature = group.set_index("signature")
        value = by_signature.value
        row: Row = {
            "method": label,
            "place": f"goal {goal} of {task} and {against}",
            "runs": int(group.n.max()),
            "distance": value.get("context distance"),
            "dependence": value.get("context dependence"),
            "p_holm": by_signature.p.get("context dependence", math.nan),
            "p_placebo": placebo_p(study, label, (task, against), int(goal), hand),
            "equivalent": value.get("motor-equivalent part"),
            "other": value.get("non-motor-equivalent part"),
            "lead": value.get("lead time"),
            **runs_of(*(study.cells[name, label] for name in (task, against))),
        }
        rows.append((f"{task} {label} goal {goal} {hand}", row))
    yield from corrected(rows)


def placebo_p(study: Study, label: str, tasks: tuple[str, str], goal: int, hand: str) -> float:
    """P of the test that a method's postures lie further apart than the placebo's; NaN for one
    that selects nothing, and without a placebo that made as many trials."""
    if not selects(study, label):
        return math.nan
    first, second = (study.trajectories(task, label) for task in tasks)
    contexts = TwoContexts(first, second, goal, "left" if hand == "left" else "right")
    placebo = placebo_of(study, contexts)
    return math.nan if placebo is None else contexts.p_beyond(placebo)


def corrected(rows: list[tuple[str, Row]]) -> Iterator[tuple[str, Row]]:
    """Rows with their p-values adjusted over those of the same method (Holm)."""
    of_method: dict[str, list[int]] = {}
    for place, (_, row) in enumerate(rows):
        of_method.setdefault(row["method"], []).append(place)
    adjusted: dict[int, float] = {}
    for places in of_method.values():
        adjusted |= zip(places, holm([rows[k][1]["p_holm"] for k in places]), strict=True)
    for place, (name, row) in enumerate(rows):
        yield name, row | {"p_holm": adjusted[place]}


@table("method, place, kind, hand, runs, norm, p_holm, p_placebo, joint, slope[], goal, moving")
def slopes(study: Study) -> Rows:
    """How the posture at a goal follows a neighbouring goal that moves."""
    frame = signature_values(study)
    frame = frame[frame.moving.notna() & frame.value.notna()]
    rows = []
    keys = ["task", "label", "goal", "moving", "hand"]
    at: Any
    for at, group in frame.groupby(keys, sort=False):
        task, label, goal, moving, hand = at
        base = str(task).partition(".")[0]
        row: Row = {
            "method": label,
            "place": f"goal {goal} of {base}, goal {moving} moves",
            "goal": goal,
            "moving": moving,
            "kind": "anticipatory" if goal < moving else "carry-over",
            "hand": hand,
            "runs": int(group.n.max()),
            "norm": math.nan,
            "p_holm": math.nan,
            "p_placebo": slope_beyond_p(study, label, task, goal, moving, hand),
            "joint": "",
            **runs_of(
                *(
                    cell
                    for (name, cell_label), cell in study.cells.items()
                    if cell_label == label and name.partition(".")[0] == base
                )
            ),
        }
        for norm in group[group.signature == "locus slope norm"].head(1).itertuples():
            row |= {"norm": norm.value, "p_holm": norm.p}
        by_size = group[group.signature == "locus slope"].sort_values("value", key=abs)
        for steepest in by_size.tail(1).itertuples():
            row |= {"joint": steepest.joint, "slope": steepest.value}
            row |= {"slope_low": steepest.low, "slope_high": steepest.high}
        rows.append((f"{base} {label} goal {goal} of {moving} {hand}", row))
    yield from corrected(rows)


@table(
    "task, method, runs, first, first_p, total, as_in_isolation, preshaping, preshaping_p, "
    "turning, travel",
)
def signatures(study: Study) -> Rows:
    """The main signatures of every main method on every task, means over runs and goals.

    ``first_p`` and ``preshaping_p`` are of the tests against the placebo (:func:`sign_beyond_p`).
    """
    frame = signature_values(study)
    frame = frame[frame.value.notna()]
    for task in (name for name in study.tasks if name in one_by_one(study)):
        labels = [label for name, label in study.cells if name == task]
        for label in in_order(main_methods(labels)):
            values = frame[(frame.task == task) & (frame.label == label)]
            if len(values) and not is_search(label):
                means = values.groupby("signature").value.mean()
                cell = study.cells[task, label]
                row: Row = {
                    "task": marked(study.tasks[task].label, study.tasks[task]),
                    "method": label,
                    "runs": len(cell.good),
                    **{name: means.get(signature, math.nan) for name, signature in _MEANS.items()},
                    "first_p": sign_beyond_p(study, task, label, "first"),
                    "preshaping_p": sign_beyond_p(study, task, label, "other arm"),
                }
                yield f"{task} {label}", row | runs_of(cell)


def sign_beyond_p(study: Study, task: str, label: str, sign: str) -> float:
    """Two-tailed p of the bootstrap test of a sign of coarticulation against the placebo's.

    NaN for a method that selects nothing, and where one of both has fewer than two values.
    """
    if not selects(study, label) or (task, PLACEBO) not in study.cells:
        return math.nan
    of = SIGNS[sign].of
    ours, guesses = (of(study.trajectories(task, each)) for each in (label, PLACEBO))
    several = min(len(ours), len(guesses)) > 1
    return bootstrap_test(ours, guesses, "two-sided").p if several else math.nan


@table("task, label, signature, where, value[], p, n, unit, why_not")
def all_signatures(study: Study) -> Rows:
    """Every value of every signature, one a row, with its place, interval and test."""
    joined = variants(families(study.tasks))
    frame = signature_values(study).rename(columns={"low": "value_low", "high": "value_high"})
    for values in frame.to_dict("records"):
        row: Row = {str(name): value for name, value in values.items()}
        task, label = row["task"], row["label"]
        others = {row["against"]}
        if pd.notna(row["moving"]):
            others = set[str]().union(*(group for group in joined if task in group))
        names = [task, *sorted(others - {task, ""})]
        cells = [study.cells[name, label] for name in names if (name, label) in study.cells]
        yield f"{task} {label}, {row['signature']} {row['where']}".strip(), row | runs_of(*cells)
