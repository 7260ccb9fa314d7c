"""The register of claims: as a page of its own, and claim by claim for the report."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import replace

from coartic.analysis.claims.catalogue import family_sizes
from coartic.analysis.claims.register import CHOSEN, FITTED, RULES, Claim, Judged
from coartic.analysis.markup import code, escaped
from coartic.analysis.report.document import (
    Block,
    Bullets,
    DataTable,
    Document,
    Prose,
    Section,
    Value,
)
from coartic.analysis.report.summary import verdicts
from coartic.analysis.report.tables.layout import LAYOUTS, with_legends
from coartic.analysis.report.tables.main import verdict_rows
from coartic.analysis.statistics.power import POWER
from coartic.analysis.study import Study
from coartic.analysis.words import NONE, slugs


def claims_table(study: Study) -> DataTable | None:
    """Every claim with its verdict, p-values and place; rows lead to the claims' sections."""
    layout, sizes = LAYOUTS["claims"], family_sizes()
    own: list[dict[str, Value]] = [
        {
            "claim": claim.id,
            "reconstructions": claim.reconstructions or None,
            "place": _place(claim) or None,
        }
        for claim in (entry.claim for entry in study.judged)
    ]
    return layout.table(
        verdict_rows(study, layout, study.judged, own),
        rules=RULES,
        paper=sizes["paper"],
        beside=sizes["beside"],
        families=sizes["families"],
        tested=sum(not math.isnan(entry.p) for entry in study.judged),
        fitted=FITTED,
        chosen=CHOSEN,
    )


def claims_document(study: Study) -> Document:
    """The register as a document: counts, a table of verdicts, then claim by claim."""
    specification = study.results.manifest.specification
    table = claims_table(study)
    # The claims' own sections say the rest.
    shown = [table.only(lambda column: column.printed)] if table else []
    groups = [
        (title, list(own))
        for title, own in itertools.groupby(study.judged, key=lambda entry: entry.claim.section)
    ]
    names = slugs([title for title, _ in groups])
    return Document(
        "Claims",
        (
            Section("verdicts", "Verdicts", (verdicts(study.judged), *shown)),
            *(
                Section(names[title], title, (), tuple(map(claim_section, own)))
                for title, own in groups
            ),
        ),
        f"What Shah, Barto & Fagg (2013) say of their model, tested on suite "
        f"{code(specification.suite)}: {specification.runs} runs of "
        f"{specification.trials} trials, seed {specification.seed}. Run ids of every claim "
        "are in `claims.csv`.",
        study.run_ids,
    )


def claim_section(entry: Judged, figures: Mapping[str, str] | None = None) -> Section:
    """All that is known of a claim; ``figures``: ids of ours by the paper's that they are like."""
    claim = entry.claim
    where = _place(claim) or "not in the paper"
    quote = f": “{claim.quote}”" if claim.quote else ""
    ours = (figures or {}).get(claim.figure)
    see = f" Ours: [figure {ours}](#{ours})." if ours else ""
    items = [f"Seen: {escaped(entry.evidence)}.", f"Test: {claim.test}."]
    if claim.tested and entry.methods:
        items.append(
            f"p = {_p(entry.p)}, adjusted {_p(entry.adjusted_p)}; of the contrary "
            f"{_p(entry.contrary_p)}, adjusted {_p(entry.adjusted_contrary_p)}; "
            f"{escaped('; '.join(entry.methods))}."
        )
    if not math.isnan(entry.power):
        items.append(
            f"With so many runs it is supported with a chance of {entry.power:.0%} if the paper's "
            f"numbers are exactly right, refuted with {entry.contrary_power:.0%} if the contrary "
            "holds."
        )
    if math.isfinite(entry.visible):
        items.append(
            f"With so many instances it is supported with a chance of {POWER:.0%} if the true "
            f"effect is {entry.visible:.2g} {claim.unit} in each family."
        )
    runs = [f"{len(entry.run_ids)} runs"] if entry.run_ids else []
    basis = ", ".join([*runs, *entry.sources]) or "nothing in this folder"
    items.append(f"Place: {escaped(f'{where}{quote}')}. Rests on: {escaped(basis)}.{see}")
    if claim.reconstructions:
        items.append(
            f"With other admissible goals it is supported in {claim.reconstructions}: what was "
            "chosen is no sample, and this no probability."
        )
    if claim.selected:
        items.append("Goals were admitted by it: that it holds is no support.")
    blocks: list[Block] = [Prose((escaped(claim.statement),)), Bullets(tuple(items))]
    if entry.table is not None:
        columns = tuple(replace(column, how=f"{claim.test}.") for column in entry.table.columns)
        blocks.append(with_legends(replace(entry.table, columns=columns)))
    title = f"{claim.id}: {entry.marked}"
    return Section(f"claim-{claim.id}", title, tuple(blocks), folded=True)


def _place(claim: Claim) -> str:
    return ", ".join(filter(None, (claim.place, claim.figure)))


def _p(value: float) -> str:
    return NONE if math.isnan(value) else f"{value:.2g}"
