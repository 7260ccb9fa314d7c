"""Verdicts on the paper's claims."""

from __future__ import annotations

import pandas as pd

from coartic.analysis.claims.judgements import CLAIMS, counts, judgements
from coartic.analysis.study import Study
from coartic.analysis.table import Row, Rows, table
from coartic.analysis.topics.rewards import beside_paper
from coartic.analysis.topics.scores import failed_runs
from coartic.analysis.words import capital, listed, number, spelled


def papers_claims(study: Study) -> pd.DataFrame:
    """Claims of the paper; none where the folder has no runs for any of them or its rewards."""
    judged = judgements(study)
    return judged if beside_paper(study) or judged.run_ids.any() else judged[:0]


@table(
    "statement, verdict, evidence, test, p_holm, opposite_p_holm, sets, place, quote",
)
def list_claims(study: Study) -> Rows:
    """The paper's claims with their verdicts, where the folder has runs for any of them."""
    for name, judged in papers_claims(study).iterrows():
        claim = CLAIMS[str(name)]
        row: Row = {
            "statement": claim.text + " †" * claim.fitted,
            "sets": claim.sets or "not counted" * claim.fitted,
            "place": claim.place,
            "quote": claim.quote,
        }
        yield claim.id, {**judged, **row}


def verdicts_in_words(judged: pd.DataFrame) -> str:
    """Verdicts on the claims that carry the paper's point, and how many of all have each."""
    n = counts(judged.verdict)
    short = judged.verdict.rename(lambda name: CLAIMS[name].short)
    central = short[short.index != ""]
    all_hold = bool(len(central)) and (central == "supported").all()
    if 2 * n["undecided"] >= len(judged) and not all_hold:  # they lack runs or trials
        return (
            f"Too few runs to judge the paper: {n['undecided']} of {len(judged)} claims are "
            f"undecided.\nSupported: {n['supported']}. Tasks, methods, runs or trials are missing."
        )
    card, each = (
        ", ".join(f"{verdict} {count}" for verdict, count in counts(verdicts).items() if count)
        for verdicts in (central, judged.verdict)
    )
    card = f"Central claims: {card}"
    if all_hold:
        card = f"All {spelled(len(central))} central claims are supported"
    words = [
        f"{capital(verdict)}: {listed(names.index)}."
        for verdict, names in central.groupby(central, sort=False)
    ]
    lacking = judged.evidence.str.startswith("Not judged").sum()
    without = f" Of the undecided, {number(lacking)} lack runs here." if lacking else ""
    return f"{card}.\n{' '.join(words)} Of all {len(judged)} claims: {each}.{without}"


def claims_hold(study: Study) -> str:
    """Whether the paper is reproduced, by its claims."""
    judged = papers_claims(study)
    if judged.empty:
        return ""
    failed = (study.cells[key] for keys in judged.failed for key in keys)
    return verdicts_in_words(judged) + failed_runs(failed, ", which leaves claims undecided")
