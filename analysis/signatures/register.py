"""Every signature of coarticulation, and all of a study: applied to every method and task.

To add one: a function that computes it, in the file of its concept, a measure of it
(:mod:`~.within` one method's runs on one task, :mod:`~.between` tasks), and a row of
``register.toml``, which says how it is measured and what it says. Rows are in its order.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain, groupby
from operator import attrgetter

import pandas as pd
from pydantic import BaseModel, ConfigDict

from coartic.analysis.generality.sample import one_by_one
from coartic.analysis.signatures.between import Members, TwoContexts
from coartic.analysis.signatures.locus import LEAST, families
from coartic.analysis.signatures.rows import COLUMNS, PLACE, Rows, Signature, without
from coartic.analysis.signatures.shared_goal import pairs_of_contexts
from coartic.analysis.signatures.within import measured_within
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


def rows_of_cells(study: Study) -> Rows:
    """Every signature of every method and task of a study.

    Differences between contexts stand with the first task of the pair and name the other; tasks
    that locus families join are no pairs, their slopes say how each depends on the others.
    """
    alone = one_by_one(study)
    trajectories = {key: study.trajectories(*key) for key in study.cells if key[0] in alone}
    groups, pairs = families(study.tasks), pairs_of_contexts(study)
    for (task, label), cell in trajectories.items():
        of_method = {name: its for (name, whose), its in trajectories.items() if whose == label}
        moving = [group for group in groups if task in group.tasks]
        rows = [measured_within(cell, WITHIN)]
        partners = [p for p in pairs if task in p[:2] and {*p[:2]} <= of_method.keys()]
        for first, second, shared in partners:
            if first == task:
                rows.append(of_pair(cell, of_method[second], shared))
        if not partners:
            rows.append(without(CONTEXTS, IN_FAMILY if moving else NO_CONTEXT))
        for group in moving:
            cells = {name: of_method[name] for name in group.tasks if name in of_method}
            if task == next(iter(cells)):
                rows.append(measured(FAMILIES, Members(group, cells)))
        if not moving:
            rows.append(without(FAMILIES, NO_FAMILY))
        identity = {"task": task, "method": cell.method, "variant": cell.variant, "label": label}
        yield from ({**row, **identity} for row in chain(*rows))


def of_pair(first: Trajectories, second: Trajectories, shared: int) -> Rows:
    """Of every shared goal with every hand that hit it in both contexts."""
    for goal in range(1, shared + 1):
        by_hand = [TwoContexts(first, second, goal, hand) for hand in HANDS]
        in_both = [contexts for contexts in by_hand if all(contexts.runs)]
        for contexts in in_both:
            yield from measured(CONTEXTS, contexts)
        if not in_both:
            place = {"goal": goal, "against": second.task.name}
            yield from without(CONTEXTS, "no hand hit the goal in both contexts", place)


def measured(signatures: Iterable[Signature], what: TwoContexts | Members) -> Rows:
    """Values of all signatures, those with the same measure together."""
    for measure, alike in groupby(signatures, attrgetter("measure")):
        yield from measure(what, *alike)


@cached
def signatures(study: Study) -> pd.DataFrame:
    """Every signature of every method and task of a study, a value a row.

    Columns ``task``, ``method``, ``variant``, those of :data:`~.rows.COLUMNS` (``where``: the place
    in words) and of :data:`~.rows.PLACE`, and ``label``. Signatures over runs are means with
    Student's interval, shares of runs have Wilson's.
    """
    frame = pd.DataFrame(
        rows_of_cells(study), columns=["task", "method", "variant", *COLUMNS, *PLACE, "label"]
    )
    return frame.astype(dict.fromkeys(("goal", "moving", "longest"), "Int64"))
