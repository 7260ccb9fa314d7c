"""All signatures of a study: the measures of the register, applied to every method and task."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

import pandas as pd

from analysis.signatures.between import Contexts, Members, contexts_of
from analysis.signatures.context import context_pairs
from analysis.signatures.locus import LEAST, families, variants
from analysis.signatures.register import CONTEXTS, FAMILIES, WITHIN
from analysis.signatures.rows import Measure, Signature, SignatureRow, Value
from analysis.signatures.trajectories import Trajectories

if TYPE_CHECKING:
    from analysis.study import Study

NO_CONTEXT = "the method did no other task that shares the start and the first goals"
IN_FAMILY = "the tasks that share its first goals are variants of it: see the locus slopes"
NO_FAMILY = f"fewer than {LEAST} tasks of the folder are the same but for one goal"


def signature_rows(study: Study) -> list[SignatureRow]:
    """Every signature of every method and task of a study.

    Differences between contexts stand with the first task of the pair and name the other; tasks
    that locus families join are no pairs, their slopes say how each depends on the others.
    """
    groups = families(study.tasks)
    joined = variants(groups)
    pairs = [
        pair
        for pair in context_pairs(study.tasks)
        if not any(set(pair[:2]) <= names for names in joined)
    ]
    rows: list[SignatureRow] = []
    for (task, label), cell in study.trajectories.items():
        values = [*_measured(WITHIN, cell)]
        partners = [
            (first, second, shared)
            for first, second, shared in pairs
            if task in (first, second)
            and {(first, label), (second, label)} <= study.trajectories.keys()
        ]
        for first, second, shared in partners:
            if task == first:
                values += _of_pair(cell, study.trajectories[second, label], shared)
        if not partners:
            slopes = any(task in names for names in joined)
            values += _without(CONTEXTS, IN_FAMILY if slopes else NO_CONTEXT)
        own = [group for group in groups if task in group.tasks]
        for group in own:
            cells = {
                name: study.trajectories[name, label]
                for name in group.tasks
                if (name, label) in study.trajectories
            }
            if task == next(iter(cells)):
                values += _measured(FAMILIES, Members(group, cells))
        if not own:
            values += _without(FAMILIES, NO_FAMILY)
        rows += [value.of(task, cell.method, cell.variant) for value in values]
    return rows


def _of_pair(first: Trajectories, second: Trajectories, shared: int) -> Iterator[Value]:
    for contexts in contexts_of(first, second, shared):
        if contexts.hand is None:
            why = "no hand hit the goal in both contexts"
            yield from (signature.without(why, contexts.place) for signature in CONTEXTS)
        else:
            yield from _measured(CONTEXTS, contexts)


def _measured(
    signatures: Sequence[Signature], what: Trajectories | Contexts | Members
) -> Iterator[Value]:
    """Values of all signatures, those with the same measure together."""
    measures: dict[Measure, list[Signature]] = {}
    for signature in signatures:
        measures.setdefault(signature.measure, []).append(signature)
    for measure, measured in measures.items():
        yield from measure(what, *measured)


def _without(signatures: Sequence[Signature], why: str) -> Iterator[Value]:
    return (signature.without(why) for signature in signatures)


def signatures_table(rows: Sequence[SignatureRow]) -> pd.DataFrame:
    """The rows as ``signatures.csv`` has them, and ``label``.

    Columns: ``task``, ``method``, ``variant``, ``signature``, ``where`` (the place, in words),
    ``value``, ``low`` and ``high`` (95 % interval), ``p`` (uncorrected), ``n`` (runs that went
    into it), ``unit``, ``why_not`` (why there is no value, or no test; empty where all is
    there), then the place's own: ``goal``, ``hand``, ``hands``, ``against``, ``moving``,
    ``joint``, ``neutral``, ``longest`` (:class:`~.rows.Place`). Signatures over runs are means
    with Student's interval, shares of runs have Wilson's.
    """
    first = ("task", "method", "variant", "signature")
    last = ("value", "low", "high", "p", "n", "unit", "why_not")
    frame = pd.DataFrame(
        {
            **{name: getattr(row, name) for name in first},
            "where": str(row.place),
            **{name: getattr(row, name) for name in last},
            **asdict(row.place),
            "label": row.label,
        }
        for row in rows
    )
    return frame.astype(dict.fromkeys(("goal", "moving", "longest"), "Int64"))
