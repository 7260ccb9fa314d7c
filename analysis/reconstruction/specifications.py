"""The paper's claims under other readings and with other goals: which hold whatever is chosen.

A specification is a set of readings and a member of an ensemble. Its runs are judged as those of
the default are. Specifications are not independent samples of anything: shares of them are no
probabilities, and there is no joint p-value (Simonsohn et al. 2020,
doi:10.1038/s41562-020-0912-z).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import repeat
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.claims.judge import Judged, by_tests, judge, opposite_p, p_of
from coartic.analysis.claims.register import CLAIMS, Claim
from coartic.analysis.processes import processes
from coartic.analysis.reconstruction.constraints import sequences_of, try_sequences
from coartic.analysis.reconstruction.reconstruct import search_for
from coartic.analysis.study import Study
from coartic.runs.plan import variant_of
from coartic.tasks.members import task_of, with_members
from coartic.tasks.readings import condition_under, load_readings

COLUMNS = ("readings", "task", "member", "claim", "verdict", "effect", "low", "high", "p")
PAPERS = tuple(claim for claim in CLAIMS.values() if not claim.families)
VERDICTS = ("supported", "not supported", "undecided")


@dataclass(frozen=True)
class Assumptions:
    """Choices that the paper leaves open."""

    readings: tuple[str, ...]
    """Those that are not the default, as ``ties=right``."""
    task: str
    """Whose goals are of a member; empty where all goals are the default ones."""
    member: str

    @property
    def label(self) -> str:
        """Such as ``two-armed-1-m017, ties=right``; ``default`` where nothing differs."""
        return ", ".join(filter(None, (self.member, *self.readings))) or "default"


def specifications(study: Study) -> Iterator[tuple[Assumptions, Study]]:
    """The specifications in a folder, each as a study of the paper's tasks under it.

    Members that are not admitted are none of them, nor are those with goals that another one has.
    Beside a member of one task are the default goals of the others, where the folder has them.
    """
    plan = study.plan
    own = {name: task_of(name) for name in plan.tasks}
    members = {name: own[name] or "" for name in _admitted(study)}
    plain = tuple(name for name, task in own.items() if task is None)
    if plain:
        yield Assumptions(plan.readings, "", ""), _seen_as(study, {name: name for name in plain})
    default = {task: task if task in own else f"{task}-m001" for task in with_members()}
    for name, task in members.items():
        others = {at: t for t, at in default.items() if t != task and at in own}
        yield Assumptions(plan.readings, task, name), _seen_as(study, {name: task} | others)


def _admitted(study: Study) -> Iterator[str]:
    """Members in a folder that meet every constraint, the first of those with the same goals."""
    for task in with_members():
        names = [name for name in study.plan.tasks
                 if task_of(name) == task]  # fmt: skip
        known = {study.tasks[name].goals: name for name in reversed(names)}
        if not known:
            continue
        search = search_for(task, jobs=1)
        goals = np.array(list(known))
        needed = sequences_of(search.constraints)
        tried = try_sequences(search.task, needed, goals, model=search.model, jobs=1)
        fits = np.all([constraint.holds(tried) for constraint in search.constraints], axis=0)
        kept = {name for name, fit in zip(known.values(), fits, strict=True) if fit}
        yield from (name for name in names if name in kept)


def _seen_as(study: Study, names: Mapping[str, str]) -> Study:
    """A study of some of its tasks alone, by other names.

    Parameters of the learner that the folder's readings set are no variants.
    """
    plan = study.plan
    fields = condition_under(load_readings(plan.readings))
    cells, variants = [], {}
    for cell in plan.cells:
        if cell.task not in names:
            continue
        parameters = {
            key: value for key, value in cell.parameters.items() if fields.get(key) != value
        }
        variant = variant_of(parameters, plan.methods[cell.method].defaults)
        variants[cell.task, cell.method, cell.variant] = variant
        task = names[cell.task]
        cells.append(replace(cell, task=task, variant=variant, parameters=parameters))
    runs = study.runs[study.runs.task.isin(list(names))].copy()
    keys = zip(runs.task, runs.method, runs.variant, strict=True)
    runs["variant"] = pd.Series([variants[key] for key in keys], runs.index, "string")
    runs["task"] = runs.task.map(names).astype(runs.task.dtype)
    tasks = {new: {**plan.tasks[name], "name": new} for name, new in names.items()}
    seen = replace(plan, tasks=tasks, cells=tuple(cells))
    return Study(study.folder, seen, study.made_with, runs)


def judged_specifications(
    studies: Iterable[Study],
    *,
    claims: Iterable[Claim] = PAPERS,
    jobs: int = 1,
    progress: Callable[[Assumptions], None] = lambda spec: None,
) -> pd.DataFrame:
    """A row a specification and claim of the paper that its runs can judge.

    Columns ``readings``, ``task``, ``member``, ``claim``, ``verdict``; ``effect``, ``low``,
    ``high`` and ``p`` of the claim's first test, positive as claimed, NaN where it has none. Of
    a member are the claims that some member's runs can judge; where another's cannot, it is
    *undecided*. p-values are not corrected: of most of a family's claims there are no runs here. In
    ``jobs`` processes; the result is the same.
    """
    known: set[tuple[str, str]] = set()
    rows: list[dict[str, Any]] = []
    wanted = [claim.id for claim in claims]
    views = (view for study in studies for view in specifications(study))
    distinct = dict(views)  # a folder may be named twice
    with processes(jobs, len(distinct)) as do:
        for spec, found, own in do(_judged, distinct, distinct.values(), repeat(wanted)):
            rows += found
            known |= {(spec.task, name) for name in own}
            progress(spec)
    kept = [row for row in rows if (row["task"], row["claim"]) in known]
    return pd.DataFrame(kept, columns=list(COLUMNS))


def _judged(
    spec: Assumptions, seen: Study, claims: Collection[str]
) -> tuple[Assumptions, list[dict[str, Any]], list[str]]:
    """Rows of a specification, and the claims that its own runs can judge."""
    rows: list[dict[str, Any]] = []
    known: list[str] = []
    own = set(seen.runs.run_id[seen.runs.task == spec.task] if spec.task else seen.runs.run_id)
    wanted = [CLAIMS[name] for name in claims]
    if spec.task:  # what the default goals of the other task do is no matter of a member's
        wanted = [_of_task(claim, spec.task) for claim in wanted]
    for judged in judge(seen, wanted):
        if own.intersection(judged.run_ids):
            known.append(judged.claim.id)
        rows.append(dict(_row(spec, judged)))
    return spec, rows, known


def _of_task(claim: Claim, task: str) -> Claim:
    """A claim of comparisons on one task alone; other claims as they are."""
    if task not in claim.pairs:
        return claim
    fields = {"pairs": claim.pairs, "shown": claim.shown}
    return claim.model_copy(
        update={
            name: {at: texts for at, texts in by_task.items() if at == task}
            for name, by_task in fields.items()
        }
    )


def _row(spec: Assumptions, judged: Judged) -> Iterator[tuple[str, Any]]:
    yield "readings", " ".join(spec.readings)
    yield "task", spec.task
    yield "member", spec.member
    yield "claim", judged.claim.id
    claim, finding = judged.claim, judged.finding
    yield "verdict", by_tests(finding, p_of(claim, finding), opposite_p(claim, finding))
    first = finding.tests[0] if finding.tests else None
    for name in ("estimate", "low", "high", "p"):
        column = "effect" if name == "estimate" else name
        yield column, math.nan if first is None else getattr(first, name)


def shares(table: pd.DataFrame) -> pd.DataFrame:
    """Verdicts of each claim, counted over specifications of one kind.

    ``kind`` is ``readings`` (default goals) or the task whose goals are of members.
    """
    kind = table.task.where(table.task != "", "readings")
    found = pd.crosstab([table.claim, kind.rename("kind")], table.verdict)
    found = found.reindex(columns=list(VERDICTS), fill_value=0)
    order = list(dict.fromkeys(zip(table.claim, kind, strict=True)))
    found["specifications"] = found.sum(axis=1)
    return found.loc[order].reset_index().rename_axis(columns=None)
