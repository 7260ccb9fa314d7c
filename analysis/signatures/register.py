"""Every signature of coarticulation, and all of a study: applied to every method and task.

To add one: a function that computes it, in the file of its concept, a measure of it
(:mod:`~.within` one method's runs on one task, :mod:`~.between` tasks), and a row of
``register.toml``, which says how it is measured and what it says. Rows are in its order.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields, replace
from functools import partial
from itertools import groupby
from operator import attrgetter

import pandas as pd
from pydantic import BaseModel, ConfigDict

from coartic.analysis.generality.sample import one_by_one
from coartic.analysis.signatures.between import Members, TwoContexts
from coartic.analysis.signatures.context import context_pairs
from coartic.analysis.signatures.locus import LEAST, families, variants
from coartic.analysis.signatures.rows import Place, Rows, Signature, SignatureRow, without
from coartic.analysis.study import Study, cached
from coartic.analysis.trajectories import Trajectories
from coartic.analysis.words import read_beside
from coartic.robot import HANDS

NO_CONTEXT = "the method did no other task that shares the start and the first goals"
IN_FAMILY = "the tasks that share its first goals are variants of it: see the locus slopes"
NO_FAMILY = f"fewer than {LEAST} tasks of the folder are the same but for one goal"


class _Kinds(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    within: tuple[Signature, ...]
    contexts: tuple[Signature, ...]
    families: tuple[Signature, ...]


_KINDS = _Kinds.model_validate(read_beside(__file__))
WITHIN = _KINDS.within
"""Of one method's runs on one task."""
CONTEXTS = _KINDS.contexts
"""Of one goal in two contexts."""
FAMILIES = _KINDS.families
"""Of tasks that differ in one goal."""
REGISTER = {signature.name: signature for signature in (*WITHIN, *CONTEXTS, *FAMILIES)}
"""All signatures by name."""
for _signature in (*WITHIN, *CONTEXTS, *FAMILIES):
    if REGISTER[_signature.name] is not _signature:
        raise ValueError(f"register.toml has two signatures {_signature.name!r}")


@cached
def signature_rows(study: Study) -> list[SignatureRow]:
    """Every signature of every method and task of a study.

    Differences between contexts stand with the first task of the pair and name the other; tasks
    that locus families join are no pairs, their slopes say how each depends on the others.
    """
    alone = one_by_one(study)
    trajectories = {key: study.trajectories(*key) for key in study.cells if key[0] in alone}
    groups = families(study.tasks)
    joined = variants(groups)
    pairs = context_pairs(study.tasks)
    pairs = [pair for pair in pairs if not any({*pair[:2]} <= names for names in joined)]
    rows: list[SignatureRow] = []
    for (task, label), cell in trajectories.items():
        done = {name: its for (name, whose), its in trajectories.items() if whose == label}
        own = [group for group in groups if task in group.tasks]
        values = list(_measured(WITHIN, cell))
        partners = [pair for pair in pairs if task in pair[:2] and {*pair[:2]} <= done.keys()]
        for _, second, shared in (pair for pair in partners if pair[0] == task):
            values += _of_pair(cell, done[second], shared)
        if not partners:
            values += without(CONTEXTS, IN_FAMILY if own else NO_CONTEXT)
        for group in own:
            cells = {name: done[name] for name in group.tasks if name in done}
            if task == next(iter(cells)):
                values += _measured(FAMILIES, Members(group, cells))
        if not own:
            values += without(FAMILIES, NO_FAMILY)
        of_cell = partial(replace, task=task, method=cell.method, variant=cell.variant)
        rows += map(of_cell, values)
    return rows


def _of_pair(first: Trajectories, second: Trajectories, shared: int) -> Rows:
    """Of every shared goal with every hand that hit it in both contexts."""
    for goal in range(1, shared + 1):
        every = [TwoContexts(first, second, goal, hand) for hand in HANDS]
        found = [contexts for contexts in every if all(contexts.runs)]
        for contexts in found:
            yield from _measured(CONTEXTS, contexts)
        if not found:
            place = Place(goal=goal, against=second.task.name)
            yield from without(CONTEXTS, "no hand hit the goal in both contexts", place)


def _measured(signatures: Iterable[Signature], what: Trajectories | TwoContexts | Members) -> Rows:
    """Values of all signatures, those with the same measure together."""
    for measure, measured in groupby(signatures, attrgetter("measure")):
        yield from measure(what, *measured)


@cached
def signatures(study: Study) -> pd.DataFrame:
    """The rows of :func:`signature_rows` as a table, with ``label``.

    Columns are the fields of :class:`~.rows.SignatureRow`, with the place in words (``where``),
    then those of its :class:`~.rows.Place`. Signatures over runs are means with Student's
    interval, shares of runs have Wilson's.
    """
    own = [field.name for part in (SignatureRow, Place) for field in fields(part)]
    frame = pd.DataFrame(
        [
            {**vars(row), "place": str(row.place), **vars(row.place), "label": row.label}
            for row in signature_rows(study)
        ],
        columns=[*own, "label"],
    ).rename(columns={"place": "where"})
    return frame.astype(dict.fromkeys(("goal", "moving", "longest"), "Int64"))
