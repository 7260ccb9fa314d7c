"""The paper's claims under other readings and with other goals: which hold whatever is chosen.

A specification is a set of readings and a member of an ensemble. Its runs are judged as those of
the default are. Specifications are not independent samples of anything: shares of them are no
probabilities, and there is no joint p-value (Simonsohn et al. 2020,
doi:10.1038/s41562-020-0912-z).
"""

from __future__ import annotations

import math
import multiprocessing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from itertools import repeat
from typing import Any

import pandas as pd

from coartic.analysis.claims.judge import judge_claims
from coartic.analysis.claims.register import CLAIMS, Claim
from coartic.analysis.study import Study
from coartic.tasks.catalogue import is_admitted, task_of, with_members
from coartic.tasks.readings import condition_under, load_readings
from coartic.threads import begin_worker, one_thread_each, threads_for

ROW = ("readings", "task", "member", "claim", "verdict", "effect", "low", "high", "p")
PAPERS = tuple(claim for claim in CLAIMS.values() if not claim.on_random_tasks)
VERDICTS = ("supported", "not supported", "undecided")


Specification = tuple[str, str, str]
"""Choices that the paper leaves open: readings that are not the default, as ``ties=right``, with
spaces between them; the task whose goals are of a member, and the member, both empty where all
goals are the default ones."""


def judge_specifications(
    studies: Iterable[Study],
    *,
    claims: Iterable[Claim] = PAPERS,
    jobs: int = 1,
    progress: Callable[[str], None] = lambda text: None,
) -> pd.DataFrame:
    """A row a specification and claim of the paper that its runs can judge.

    Columns ``readings``, ``task``, ``member``, ``claim``, ``verdict``; ``effect``, ``low``,
    ``high`` and ``p`` of the claim's first test, positive as claimed, NaN where it has none. Of
    a member are the claims that some member's runs can judge; where another's cannot, it is
    *undecided*. p-values are not corrected: of most of a family's claims there are no runs here. In
    ``jobs`` processes; the result is the same.
    """
    rows: list[dict[str, Any]] = []
    judgeable: set[tuple[str, str]] = set()
    names = [claim.id for claim in claims]
    views = dict(view for study in studies for view in specifications(study))  # each once
    with processes(jobs, len(views)) as do:
        for specification, judged, claims_judged in do(
            judge_view, views, views.values(), repeat(names)
        ):
            rows += judged
            readings, task, member = specification
            judgeable |= {(task, name) for name in claims_judged}
            progress(", ".join(filter(None, (member, *readings.split()))) or "default")
    kept = [row for row in rows if (row["task"], row["claim"]) in judgeable]
    return pd.DataFrame(kept, columns=list(ROW))


def specifications(study: Study) -> Iterator[tuple[Specification, Study]]:
    """The specifications in a folder, each as a study of the paper's tasks under it.

    Members that are not admitted are none of them, nor are those with goals that another one has.
    Beside a member of one task are the default goals of the others, where the folder has them.
    """
    readings = " ".join(study.plan.readings)
    tasks = {name: task_of(name) for name in study.plan.tasks}
    plain = {name: name for name, task in tasks.items() if task is None}
    if plain:
        yield (readings, "", ""), study_as(study, plain)
    default = {task: task if task in tasks else f"{task}-m001" for task in with_members()}
    for task in with_members():
        others = {at: t for t, at in default.items() if t != task and at in tasks}
        for name in admitted_members(study, task):
            yield (readings, task, name), study_as(study, {name: task} | others)


def admitted_members(study: Study, task: str) -> list[str]:
    """Members in a folder that are admitted, the first of those with the same goals."""
    goals: dict[Any, str] = {}
    for name in study.plan.tasks:
        if task_of(name) == task and is_admitted(name):
            goals.setdefault(study.tasks[name].goals, name)
    return list(goals.values())


def study_as(study: Study, names: Mapping[str, str]) -> Study:
    """A study of some of its tasks alone, by other names.

    Parameters of the learner that the folder's readings set are no variants.
    """
    plan = study.plan
    fields = condition_under(load_readings(plan.readings))
    cells, variants = [], {}
    for cell in plan.cells:
        if cell.task.name not in names:
            continue
        parameters = {
            key: value for key, value in cell.parameters.items() if fields.get(key) != value
        }
        task = cell.task.model_copy(update={"name": names[cell.task.name]})
        view_cell = replace(cell, task=task, parameters=parameters)
        variants[cell.task.name, cell.method.name, cell.variant] = view_cell.variant
        cells.append(view_cell)
    runs = study.runs[study.runs.task.isin(list(names))].copy()
    keys = zip(runs.task, runs.method, runs.variant, strict=True)
    runs["variant"] = pd.Series([variants[key] for key in keys], runs.index, "string")
    runs["task"] = runs.task.map(names).astype(runs.task.dtype)
    view = replace(plan, cells=tuple(cells))
    return Study(study.folder, view, study.made_with, runs)


def judge_view(
    specification: Specification, view: Study, names: Sequence[str]
) -> tuple[Specification, list[dict[str, Any]], list[str]]:
    """Rows of a specification, and the claims that its own runs can judge."""
    task, rows, claims_judged = specification[1], [], []
    its_runs = set(view.runs.run_id[view.runs.task == task] if task else view.runs.run_id)
    # What the default goals of the other task do is no matter of a member's.
    for judged in judge_claims(view, [CLAIMS[name] for name in names], only=task):
        claim, finding = judged.claim, judged.finding
        if its_runs.intersection(judged.run_ids):
            claims_judged.append(claim.id)
        row: dict[str, Any] = dict.fromkeys(ROW, math.nan)
        row |= zip(ROW, (*specification, claim.id), strict=False)
        row["verdict"] = finding.verdict(finding.p, finding.opposite_p)
        if finding.tests:
            first = finding.tests[0]
            row |= {"effect": first.value, "low": first.low, "high": first.high, "p": first.p}
        rows.append(row)
    return specification, rows, claims_judged


def shares(table: pd.DataFrame) -> pd.DataFrame:
    """Verdicts of each claim, counted over specifications of one kind.

    ``kind`` is ``readings`` (default goals) or the task whose goals are of members.
    """
    kind = table.task.where(table.task != "", "readings")
    counts = pd.crosstab([table.claim, kind.rename("kind")], table.verdict)
    counts = counts.reindex(columns=list(VERDICTS), fill_value=0)
    order = list(dict.fromkeys(zip(table.claim, kind, strict=True)))
    counts["specifications"] = counts.sum(axis=1)
    return counts.loc[order].reset_index().rename_axis(columns=None)


@contextmanager
def processes(jobs: int, pieces: int) -> Iterator[Callable[..., Any]]:
    """``map`` in ``jobs`` processes, -1 for one a core; in this one where one is enough."""
    workers = min(threads_for(jobs), pieces)
    if workers <= 1:
        yield map
        return
    methods = multiprocessing.get_all_start_methods()
    context = multiprocessing.get_context("forkserver" if "forkserver" in methods else "spawn")
    with (
        one_thread_each(),
        ProcessPoolExecutor(workers, mp_context=context, initializer=begin_worker) as pool,
    ):
        yield pool.map
