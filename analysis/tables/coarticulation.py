"""Tables of section *Coarticulation*: one goal in two contexts, signatures, saved ticks."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from coartic.analysis.control import (
    contexts_of_control,
    control_of,
    explores_idle_arm,
    selects,
    shared_goals,
    with_control,
)
from coartic.analysis.signatures import SAME, SIGNATURES, Signature, TwoContexts
from coartic.analysis.statistics import (
    exchange_test,
    holm,
)
from coartic.analysis.study import Study, shared_cells, solved
from coartic.analysis.tables.language import Row, Rows, named, run_ids, table
from coartic.estimates import (
    LEVEL,
    difference_of_means,
    mean,
)

ROUNDING = 1e-9
"""Largest posture difference, in length units and rad, that can be due to rounding."""


@table(
    "Postures at a goal that two tasks share",
    """
    method                  | method                                                | | tex
    place                   | shared goal                                           | | tex
    verdict                 | verdict
    runs                    | runs                                                  | | tex
    distance[]              | posture difference                                    | 2 | tex
    distance_base[]         | of the base (length units)                            | 2
    distance_joints[]       | of the joints (rad)                                   | 2
    lean[]                  | lean (share of the way to the next posture)           | 2 | tex
    lean_base[]             | lean of the base                                      | 2 | tex
    lean_joints[]           | lean of the joints                                    | 2 | tex
    lean_start              | lean at the start
    lean_runs               | runs of the lean
    next_apart
    next_apart_base
    next_apart_joints
    standardised_difference
    p_holm                  | p (corrected)                                         | p | tex
    control                 | random search                                         | 2 | tex
    control_runs            | its runs
    p_random_search         | p beyond random search                                | p | tex
    equivalent
    other
    """,
    with_settings=True,
)
def list_contexts(study: Study) -> Rows:
    """Yield a row for each method, pair of tasks, shared goal, and hand (:func:`.shared_goals`).

    A row contains, among other columns,

    - the posture difference between the two tasks and the lean (:func:`.lean`), for the whole
      posture, for the base alone (``_base``) and for the joints alone (``_joints``);
    - ``verdict``: a verdict on the posture difference in words;
    - ``p_holm``: p-value of the permutation test of the posture difference, Holm-adjusted over the
      rows of the method;
    - ``control`` and ``p_random_search``: posture difference of random search, and p-value of the
      test against random search (:meth:`.TwoContexts.p_beyond`), which is not adjusted. Both are
      NaN if there is no such random search (:func:`.contexts_of_control`).
    """
    for label in study.methods.index:
        contexts = list(shared_goals(study, label))
        spreads = [shared.standardised_posture_difference for shared in contexts]
        tested = zip(contexts, np.isnan(spreads).tolist(), strict=True)
        p = holm([math.nan if no_spread else shared.p for shared, no_spread in tested])
        for shared, adjusted in zip(contexts, p, strict=True):
            first, second = shared.tasks
            row: Row = {
                "method": label,
                "place": f"goal {shared.goal} of {first.label} and {second.label}",
                "runs": shared.n,
                **shared.difference.columns("distance"),
                **shared.lean.more.columns("lean"),
                **_columns_by_part(shared),
                "lean_start": shared.lean.at_start,
                "lean_runs": sum(shared.lean.more.n),
                "next_apart": shared.lean.apart,
                "standardised_difference": shared.standardised_posture_difference,
                "p_holm": adjusted,
                "equivalent": shared.parts[0],
                "other": shared.parts[1],
                **dict.fromkeys(("control", "control_runs", "p_random_search"), math.nan),
                **run_ids(*(shared_cells(study)[task.name, label] for task in shared.tasks)),
            }
            if (control := contexts_of_control(study, shared)) is not None:
                row["control"], row["control_runs"] = control.posture_difference, control.n
                row["p_random_search"] = shared.p_beyond(control)
            row["verdict"] = _verdict_of(study, shared, row)
            yield f"{first.name} {second.name} {label} goal {shared.goal} {shared.hand}", row


def _columns_by_part(shared: TwoContexts) -> Row:
    """Return the columns of a comparison for the base alone and for the joints alone.

    The columns contain the posture difference and the lean, both with their intervals, and the
    distance between the mean next postures.
    """
    row: Row = {}
    for part in ("base", "joints"):
        of_part = shared.of_part(part)
        row |= of_part.difference.columns(f"distance_{part}")
        row |= of_part.lean.more.columns(f"lean_{part}")
        row[f"next_apart_{part}"] = of_part.lean.apart
    return row


def _columns_of(signature: Signature) -> str:
    """Return the lines that define the columns of a signature, for :func:`table`."""
    name, decimals = signature.column, signature.decimals
    tex, of_control = (
        ("tex" if part in signature.in_latex else "") for part in ("value", "control")
    )
    return f"""
    {name}[]            | {signature.heading} | {decimals} | {tex}
    {name}_control      | random search | {decimals} | {of_control}
    {name}_difference[]
    {name}_p            | p | p | {tex}
    {name}_control_runs
    """


@table(
    "Signatures of coarticulation, means over runs, next to random search",
    """
    task             | task                       | | tex
    method           | method                     | | tex
    hands            | hands                      | | tex
    runs             | runs                       | | tex
    control_runs
    control_idle_arm
    """
    + "".join(map(_columns_of, SIGNATURES.values())),
)
def list_signatures(study: Study) -> Rows:
    """Yield the mean signatures of each method on each individual task.

    Searches for the optimum are left out. For each other method on each task, there are

    - a row for each hand sequence for which at least one signature is compared: at least a tenth of
      the method's solved runs have the hand sequence and a value of this signature
      (:func:`.with_control`);
    - a row for the choice of hands itself, with an empty entry in column ``hands``, if the task is
      for two arms and has at least two goals.

    Signatures are means over runs. If a method selects its solution from trials
    (:func:`.selects`), and the study has runs of random search to compare with, the rows also
    contain the mean signatures of random search and the p-value of the one-sided exchange test,
    which is not adjusted for multiple tests. If the task is for two arms, column
    ``control_idle_arm`` then says how random search treats the idle arm: ``with noise``, or
    ``still`` as under EC3.
    """
    labels = study.methods.index[~study.methods.is_search]
    # The row of the choice of hands is above those of hand sequences.
    ordered = sorted(SIGNATURES.values(), key=lambda signature: signature.by_hands)
    columns = {signature.name: signature.column for signature in ordered}
    endings = "_low", "_high", "_control", "_difference", "_difference_low", "_difference_high"
    none = {
        f"{column}{ending}": math.nan
        for column in columns.values()
        for ending in ("", *endings, "_p", "_control_runs")
    }
    for name, label in itertools.product(study.individual_tasks, labels):
        cell = shared_cells(study).get((name, label))
        if cell is None or not len(solved(cell)):
            continue
        rows = dict[str, Row]()
        for signature, column in columns.items():
            for hands, (values, control) in with_control(study, signature, name, label).items():
                row = rows.setdefault(hands, {"runs": len(values), "control_runs": len(control)})
                row |= mean(values).columns(column) | {f"{column}_control_runs": len(control)}
                if len(control) and selects(study, label):
                    row |= {
                        f"{column}_control": control.mean(),
                        **difference_of_means(values, control).columns(f"{column}_difference"),
                        f"{column}_p": exchange_test(values, control).p,
                    }
        for hands, row in rows.items():
            search = control_of(study, name, label, hands) if selects(study, label) else ""
            row["control_idle_arm"] = None
            if search and len(study.tasks[name].hands) > 1:
                explored = explores_idle_arm(study, name, search)
                row["control_idle_arm"] = "with noise" if explored else "still"
            key = " ".join(filter(None, (name, label, hands)))
            yield key, none | named(study, cell) | row | {"hands": hands}


def _verdict_of(study: Study, shared: TwoContexts, row: Row) -> str:
    """Return the verdict on whether the posture at a shared goal depends on later goals.

    - The postures of a stochastic method differ if the permutation test is significant after the
      Holm adjustment. They are the same if the bootstrap test shows that their difference is below
      :data:`.SAME`. If both hold, the postures are different, but the difference is negligible.
    - The postures of a deterministic method differ if their difference exceeds :data:`ROUNDING`.
      They are the same if their difference is below :data:`.SAME`.
    - If postures differ by more than a negligible difference, and the method selects its solution
      from trials, the difference must also be significantly larger than that of random search.

    Parameters
    ----------
    study : Study
    shared : TwoContexts
        The runs on two tasks at the shared goal.
    row : dict
        The other columns of the row of :func:`list_contexts`.

    Returns
    -------
    str
        The verdict, such as ``different postures``, ``the same posture`` or ``too few runs``.
    """
    method: Any = study.methods.loc[shared.method]
    if method.stochastic:
        if math.isnan(shared.p):
            return "too few runs"
        differs = (shared.p if math.isnan(row["p_holm"]) else row["p_holm"]) < LEVEL
        is_same = shared.p_same < LEVEL
    else:
        differs = shared.posture_difference > ROUNDING
        is_same = shared.posture_difference < SAME
    if is_same:
        return "different, negligible" if differs else "the same posture"
    if not differs:
        return "no significant difference"
    if not selects(study, shared.method):
        return "different postures"
    if math.isnan(row["control"]):
        return "undecided: no random search of as many trials"
    if math.isnan(row["p_random_search"]):
        return "undecided: too few runs of random search"
    is_beyond = row["p_random_search"] < LEVEL
    return "different postures" if is_beyond else "no more than random search"


@table(
    "Ticks of each movement less those of the corrective process alone with the same hands, means "
    "over runs",
    """
    task         | task
    method       | method
    runs         | runs
    by_goal_[*]  | goal {} | 1
    sum[]        | sum | 1
    """,
)
def list_saved(study: Study) -> Rows:
    """Yield the ticks of each method for each goal, minus those of the corrective process alone.

    There is a row for each individual task and each method that solved a run on the task; searches
    for the optimum are left out. Columns ``by_goal_1``, ``by_goal_2`` and so on, and their sum in
    column ``sum``, are means over runs: the ticks of the run minus the ticks of the corrective
    process alone with the same hand sequence. Only the first 500 solved runs are used. A run is
    left out if the corrective process does not complete the task with the hands of the run. A row
    without runs is left out.
    """
    for (task, label), runs in shared_cells(study).items():
        if (
            task not in study.individual_tasks
            or study.methods.is_search[label]
            or not len(solved(runs))
        ):
            continue
        changes = study.executed(task, label).against_same_hands
        changes = changes[~np.isnan(changes).any(axis=1)]
        if len(changes):
            row: Row = {"task": task, "method": label, "runs": len(changes)}
            for goal, ticks in enumerate(changes.T, 1):
                row |= mean(ticks).columns(f"by_goal_{goal}")
            row |= mean(changes.sum(axis=1)).columns("sum")
            yield f"{task} {label}", row | run_ids(runs)
