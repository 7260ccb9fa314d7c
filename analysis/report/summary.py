"""What a reader wants first: the learner on every task, verdicts counted, all tasks together."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import get_args

import pandas as pd

from coartic.analysis.claims.register import Judged, Verdict
from coartic.analysis.comparisons.overall import variant
from coartic.analysis.comparisons.paper import paper_rows
from coartic.analysis.generality.sample import one_by_one
from coartic.analysis.methods import CONDITIONS, LEARNER
from coartic.analysis.published import published_cell
from coartic.analysis.report.document import Bullets, DataTable
from coartic.analysis.report.tables.common import estimate_as_printed, marked, mean_of
from coartic.analysis.report.tables.layout import LAYOUTS
from coartic.analysis.study import Study
from coartic.analysis.words import typographic
from coartic.record import Environment
from coartic.text import counted


def best_condition(study: Study, task: str) -> str | None:
    """Label of the learner's own condition (no variant) with the highest mean reward."""
    rewards = {
        label: row.reward
        for (name, label), row in study.method_rows.items()
        if name == task and label in CONDITIONS and not math.isnan(row.reward)
    }
    return max(rewards, key=lambda label: rewards[label]) if rewards else None


def learned(study: Study) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Tasks that the learner did, with the label of its best condition and its solved runs."""
    for task in study.tasks:
        label = best_condition(study, task)
        if label is not None:
            yield task, label, study.cells[task, label].good


def tasks_table(study: Study) -> DataTable | None:
    """One row a task: initial, learned, published and best possible reward."""
    layout, rows = LAYOUTS["tasks-in-short"], []
    for name, label, good in learned(study):
        condition, reward = label.removeprefix(LEARNER), mean_of(good.reward)
        assert reward is not None  # of the best of all means
        initial = good.initial_reward.dropna()
        paper, best = published_cell(name, condition), study.optima.get((name, "free"))
        printed = paper.summary if paper else None
        row = layout.row(
            name,
            cells=((name, label),),
            task=marked(study, name),
            initial=float(initial.iloc[0]) if len(initial) else None,
            condition=condition,
            learned=replace(reward, sd=None),
            published=estimate_as_printed(printed),
            optimum=best.reward if best else None,
            proof=("proven" if best.proven else "best known") if best else None,
            gap=(best.reward - reward.value) / -best.reward if best and best.reward else None,
        )
        searches = dict.fromkeys(("optimum", "proof"), best.cells) if best else {}
        sources = {"published": (printed.source,)} if printed else {}
        rows.append(replace(row, cells_by_column=searches, rests_on=sources))
    short = layout.model_copy(update={"folded": len(one_by_one(study)) < len(study.tasks)})
    return short.table(rows)


def verdicts(judged: Sequence[Judged]) -> Bullets:
    """The paper's claims counted by verdict."""

    def counts(entries: Iterable[Judged], thing: str, name: str) -> str:
        found = Counter(entry.verdict for entry in entries)
        by_verdict = ", ".join(f"{found[verdict]} {verdict}" for verdict in get_args(Verdict))
        return f"{counted(found.total(), thing)} {name}: {by_verdict}."

    paper, items = [entry for entry in judged if entry.claim.place], []
    for fitted, name in (
        (False, "on what is printed: independent tests, but of no number that choices rest on"),
        (True, "no independent tests, as they rest on reconstructed tasks †"),
    ):
        own = (entry for entry in paper if entry.claim.fitted == fitted)
        items.append(counts(own, "claim", f"of the paper, {name}"))
    beyond = [entry for entry in judged if not entry.claim.place]
    if beyond:
        items.append(counts(beyond, "comparison", "that the paper does not make"))
    return Bullets(tuple(items))


def unlike_printed(study: Study) -> list[str]:
    """The paper's cells whose learned reward differs from the printed one, in words."""
    found = []
    for row in paper_rows(study):
        if row.verdict == "different" and row.paper.summary is not None:
            summary = row.paper.summary
            decimals = 1 if summary.digits is None else summary.digits[0]
            ours = typographic(f"{row.rewards.mean():.1f}")
            printed = typographic(f"{summary.mean:.{decimals}f}")
            name = f"{row.cell.task} {row.cell.label.removeprefix(LEARNER)}"
            how = "derived from print" if summary.derived else "printed"
            found.append(f"{name}: learned reward {ours}, {how} {printed}")
    return found


def version_text(environment: Environment) -> str:
    """The version of this software with its commit."""
    commit = environment.commit
    at = f", commit {commit.id[:12]}{' with changes' * commit.dirty}" if commit else ""
    return f"coartic {environment.coartic}{at}"


def without_variants(of: DataTable) -> tuple[DataTable, DataTable | None]:
    """A table of methods as one of the methods themselves and a folded one of their variants.

    Variants are what was run with other parameters, and ablations of the learner.
    """
    variants = tuple(row for row in of.rows if variant(row.key))
    kept = tuple(row for row in of.rows if not variant(row.key))
    if not variants or not kept:
        return of, None
    caption = f"{of.caption.removesuffix('.')}: variants of parameters, ablations."
    folded = replace(of, id=f"{of.id}-variants", caption=caption, rows=variants, folded=True)
    return replace(of, rows=kept), folded
