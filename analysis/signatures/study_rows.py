"""All signatures of a study: the measures of the register, applied to every method and task."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import pandas as pd

from analysis.signatures.between import Contexts, Members
from analysis.signatures.context import context_pairs
from analysis.signatures.locus import LEAST, families, variants
from analysis.signatures.register import CONTEXTS, FAMILIES, WITHIN
from analysis.signatures.rows import Measure, Place, Signature, SignatureRow
from analysis.signatures.trajectories import Trajectories
from coartic.robot import HANDS

if TYPE_CHECKING:
    from analysis.study import Study

NO_CONTEXT = "the method did no other task that shares the start and the first goals"
IN_FAMILY = "the tasks that share its first goals are variants of it: see the locus slopes"
NO_FAMILY = f"fewer than {LEAST} tasks of the folder are the same but for one goal"
_NOWHERE = Place()


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
        done = {name: its for (name, whose), its in study.trajectories.items() if whose == label}
        values = [*_measured(WITHIN, cell)]
        partners = [pair for pair in pairs if task in pair[:2] and {*pair[:2]} <= done.keys()]
        for first, second, shared in partners:
            if task == first:
                values += _of_pair(cell, done[second], shared)
        if not partners:
            slopes = any(task in names for names in joined)
            values += _without(CONTEXTS, IN_FAMILY if slopes else NO_CONTEXT)
        own = [group for group in groups if task in group.tasks]
        for group in own:
            cells = {name: done[name] for name in group.tasks if name in done}
            if task == next(iter(cells)):
                values += _measured(FAMILIES, Members(group, cells))
        if not own:
            values += _without(FAMILIES, NO_FAMILY)
        rows += [
            replace(row, task=task, method=cell.method, variant=cell.variant) for row in values
        ]
    return rows


def _of_pair(first: Trajectories, second: Trajectories, shared: int) -> Iterator[SignatureRow]:
    """Of every shared goal with every hand that hit it in both contexts."""
    for goal in range(1, shared + 1):
        every = [Contexts(first, second, goal, hand) for hand in HANDS]
        found = [contexts for contexts in every if all(contexts.runs)]
        for contexts in found:
            yield from _measured(CONTEXTS, contexts)
        if not found:
            place = Place(goal=goal, against=second.task.name)
            yield from _without(CONTEXTS, "no hand hit the goal in both contexts", place)


def _measured(
    signatures: Sequence[Signature], what: Trajectories | Contexts | Members
) -> Iterator[SignatureRow]:
    """Values of all signatures, those with the same measure together."""
    measures: dict[Measure, list[Signature]] = {}
    for signature in signatures:
        measures.setdefault(signature.measure, []).append(signature)
    for measure, measured in measures.items():
        yield from measure(what, *measured)


def _without(
    signatures: Sequence[Signature], why: str, place: Place = _NOWHERE
) -> Iterator[SignatureRow]:
    return (signature.without(why, place) for signature in signatures)


def signatures_table(rows: Sequence[SignatureRow]) -> pd.DataFrame:
    """The rows as ``signatures.csv`` has them, and ``label``.

    Columns are the fields of :class:`~.rows.SignatureRow`, with the place in words (``where``),
    then those of its :class:`~.rows.Place`. Signatures over runs are means with Student's
    interval, shares of runs have Wilson's.
    """
    frame = pd.DataFrame(
        {**vars(row), "place": str(row.place), **vars(row.place), "label": row.label}
        for row in rows
    ).rename(columns={"place": "where"})
    return frame.astype(dict.fromkeys(("goal", "moving", "longest"), "Int64"))
