"""What a reader wants first: the learner on every task, verdicts counted, all tasks together."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from analysis.claims.register import Judged, Verdict
from analysis.comparisons.paper import paper_rows
from analysis.methods import LEARNER
from analysis.published import published_cell
from analysis.report.document import Bullets, Column, DataTable, Estimate, Row
from analysis.statistics.estimates import SEED, mean
from analysis.words import typographic

if TYPE_CHECKING:
    from analysis.study import Study

_CONDITION = re.compile(rf"{LEARNER}EC[1-4]")
_VERDICTS: tuple[Verdict, ...] = ("supported", "not supported", "cannot tell")


def best_condition(study: Study, task: str) -> str | None:
    """Label of the learner's own condition (no variant) with the highest mean reward."""
    rewards = {
        label: row.reward
        for (name, label), row in study.method_rows.items()
        if name == task and _CONDITION.fullmatch(label) and not math.isnan(row.reward)
    }
    return max(rewards, key=lambda label: rewards[label]) if rewards else None


def tasks_table(study: Study) -> DataTable | None:
    """One row a task: initial, learned, published and best possible reward."""
    rows = []
    for name, task in study.results.tasks.items():
        label = best_condition(study, name)
        if label is None:
            continue
        good = study.cells[name, label].good
        found = mean(good.reward.to_numpy(dtype=np.float64), seed=SEED)
        interval = () if math.isnan(found.low) else (found.low, found.high)
        initial = good.initial_reward.dropna()
        paper = published_cell(name, label.removeprefix(LEARNER))
        printed = paper.summary if paper else None
        best = study.optima.get((name, "free"))
        share = (best.reward - found.estimate) / -best.reward if best and best.reward else None
        rows.append(
            Row(
                name,
                (
                    f"{name} †" if task.reconstructed else name,
                    float(initial.iloc[0]) if len(initial) else None,
                    label.removeprefix(LEARNER),
                    Estimate(found.estimate, None, *interval),
                    Estimate(printed.mean, printed.sd) if printed else None,
                    best.reward if best else None,
                    ("proven" if best.proven else "best known") if best else None,
                    share,
                ),
                ((name, label),),
                dict.fromkeys(("optimum", "proof"), best.cells) if best else {},
            )
        )
    if not rows:
        return None
    return DataTable(
        "tasks-in-short",
        "The learner's best condition on every task.",
        (
            Column("task", "task"),
            Column("initial", "initial", "number", "ticks", 0, rests_on=("runs",)),
            Column("condition", "condition"),
            Column("learned", "learned", "number", "ticks", 1, rests_on=("runs",)),
            Column("published", "published", "number", "ticks", 1, rests_on=("paper",)),
            Column("optimum", "optimum", "number", "ticks", 0, rests_on=("optimum",)),
            Column("proof", "known as", rests_on=("optimum",)),
            Column("gap", "gap", "share", digits=1, rests_on=("runs", "optimum")),
        ),
        tuple(rows),
        (
            "Rewards are means over runs, −1 for every control tick: the nearer 0, the better. "
            "Learned: the best of a run's trials, exploration noise included (a noiseless "
            "replay of what is kept gets a little less, see Limitations). "
            "Initial: the corrective process alone. Published: mean ± SD of the same condition. "
            "Optimum: with all joints free. Gap: from the learned reward to it, as a share of it.",
        ),
    )


def verdicts(judged: Sequence[Judged], claims: str) -> Bullets:
    """The paper's claims counted by verdict; ``claims`` is the id of the section with them."""
    paper = [entry for entry in judged if entry.claim.place]
    items = []
    for name, entries in (
        ("independent tests", [e for e in paper if not e.claim.fitted]),
        (
            "no independent tests, as they rest on reconstructed tasks †",
            [e for e in paper if e.claim.fitted],
        ),
    ):
        found = Counter(entry.verdict for entry in entries)
        counts = ", ".join(f"{found[verdict]} {verdict}" for verdict in _VERDICTS)
        items.append(f"[{len(entries)} claims of the paper](#{claims}), {name}: {counts}.")
    refuted = [entry for entry in paper if entry.verdict == "not supported"]
    if refuted:
        names = ", ".join(f"[{e.claim.id}](#claim-{e.claim.id})" for e in refuted)
        items.append(f"Not supported here: {names}.")
    beyond = len(judged) - len(paper)
    if beyond:
        items.append(f"[{beyond} comparisons](#{claims}) that the paper does not make: measured.")
    return Bullets(tuple(items))


def unlike_printed(study: Study) -> list[str]:
    """The paper's cells whose learned reward differs from the printed one, in words."""
    found = []
    for row in paper_rows(study):
        if row.verdict == "different" and row.paper.summary is not None:
            found.append(
                f"{row.cell.task} {row.cell.label.removeprefix(LEARNER)}: learned reward "
                f"{typographic(f'{row.rewards.mean():.1f}')}, published "
                f"{typographic(f'{row.paper.summary.mean:.1f}')}"
            )
    return found


def without_variants(table: DataTable) -> tuple[DataTable, DataTable | None]:
    """A table of methods as one of the methods themselves and a folded one of their variants.

    Variants are what was run with other parameters, and ablations of the learner.
    """
    variants = [row for row in table.rows if _is_variant(row.key)]
    if not variants or len(variants) == len(table.rows):
        return table, None
    kept = tuple(row for row in table.rows if not _is_variant(row.key))
    caption = f"{table.caption.removesuffix('.')}: variants of parameters, ablations."
    folded = replace(
        table, id=f"{table.id}-variants", caption=caption, rows=tuple(variants), folded=True
    )
    return replace(table, rows=kept), folded


def _is_variant(method: str) -> bool:
    return "=" in method or bool(re.search(r"\bEC\d-", method))
