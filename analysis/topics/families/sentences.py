"""What was found on random tasks, in sentences."""

from __future__ import annotations

from typing import Any

from coartic.analysis.methods import name_of
from coartic.analysis.section import Section
from coartic.analysis.study import Study
from coartic.analysis.topics.families import tables
from coartic.analysis.topics.families.instances import sample
from coartic.analysis.words import interval_in_words, number

MOST_GAPS = 4
"""Methods whose gaps a sentence tells."""


def finding_of_families(study: Study) -> str:
    """How far the nearest methods end from the best known reward, over families with two arms."""
    instances = sample(study)
    if not instances.references:
        return ""
    families = len(instances.families)
    where = "1 family" if families == 1 else f"{families} families"
    gaps: Any = tables.family_gaps(study).dropna(subset="gap").head(MOST_GAPS)
    ends = [
        f"{'the learner' if row.method == 'learner' else name_of(row.method)} ends "
        f"{number(100 * row.gap, 1)} %"
        for row in gaps.itertuples()
    ]
    if ends:
        ends[0] += " from the best known reward"
        words = f", {', '.join(ends)} (mean over families with two arms)"
    else:
        words = " methods are compared by how far they end from the best known reward"
    proven = sum(reference.proven for reference in instances.references.values())
    return (
        f"On {len(instances.references)} random tasks from {where}{words}. The best known reward "
        f"is proven to be the optimum on {proven or 'none'} of them."
    )


def finding_of_exploration(study: Study) -> str:
    """What each condition gains on the one below it, over all families."""
    rows: Any = tables.exploration(study)
    initial = rows.contrast.astype(str).str.endswith(tables.INITIAL_SOLUTION)
    rows = rows[(rows.family == tables.ALL) & ~initial]
    gains = []
    for row in rows.itertuples():
        gain = interval_in_words(row._asdict(), "gain", " %", scale=100)
        gains.append(
            f"{row.contrast} gains {gain} and is better on {row.better} of {row.instances} tasks"
        )
    return f"Over all families, {'; '.join(gains)}." if gains else ""


FAMILIES = Section(
    "families",
    short="Random tasks",
    title="What holds on random tasks?",
    caption="Gap to the best known reward, in per cent of it: mean over instances",
    finding=finding_of_families,
    figure="gaps-by-family",
    table="family-gaps",
)

EXPLORATION = Section(
    "exploration",
    short="Exploration",
    title="Does more exploration pay on random tasks?",
    caption="More exploration against less, in per cent of the best known reward",
    finding=finding_of_exploration,
    table="exploration",
    note=(
        "By hands: the part of the gain that comes from the hand sequences, if each run had the "
        "best reward that is known for its hands."
    ),
)

SIGNS = Section(
    "signs",
    short="Signs",
    title="Does coarticulation show on random tasks?",
    caption="Signs of coarticulation over instances",
    table="family-signs",
)
