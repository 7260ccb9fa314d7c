"""Section on the paper's claims and their verdicts."""

from __future__ import annotations

from collections import Counter
from typing import get_args

import pandas as pd

from coartic.analysis.claims.judgements import CLAIMS, judgements
from coartic.analysis.claims.judging import Verdict
from coartic.analysis.sections.rewards import published_and_ours
from coartic.analysis.standings import failed_runs
from coartic.analysis.study import Study
from coartic.analysis.table import Row, Rows, table
from coartic.analysis.words import capital, listed, number, spelled
from coartic.tasks.families import shipped_families
from coartic.tasks.task import shipped_tasks


def papers_claims(study: Study) -> pd.DataFrame:
    """Return the judged claims; no rows if the folder has no runs for claims."""
    judged = judgements(study)
    return judged if published_and_ours(study) or judged.run_ids.any() else judged[:0]


@table(
    "statement: claim; verdict; evidence: -; test: -; p_holm: p (corrected) .p; "
    "opposite_p_holm: -; sets: sets of goals in which it holds; place: where; quote: -"
)
def list_claims(study: Study) -> Rows:
    """List the paper's claims with their verdicts, if the folder has runs for any of them."""
    for name, judged in papers_claims(study).iterrows():
        claim = CLAIMS[str(name)]
        row: Row = {
            "statement": claim.text + " †" * claim.fitted,
            "sets": claim.sets or "not counted" * claim.fitted,
            "place": claim.place,
            "quote": claim.quote,
        }
        yield claim.id, {**judged, **row}


def too_few(judged: pd.DataFrame) -> bool:
    """Return whether half of the claims are undecided and not all central claims are supported."""
    central = central_verdicts(judged)
    all_hold = bool(len(central)) and (central == "supported").all()
    return bool(2 * (judged.verdict == "undecided").sum() >= len(judged) and not all_hold)


def central_verdicts(judged: pd.DataFrame) -> pd.Series:
    """Return the verdicts on the central claims, by their short words."""
    short = judged.verdict.rename(lambda name: CLAIMS[name].short)
    return short[short.index != ""]


def verdicts_in_words(judged: pd.DataFrame) -> str:
    """Say how many claims, and how many central claims, are supported or have other verdicts."""
    n, central = Counter(judged.verdict), central_verdicts(judged)
    if too_few(judged):
        return (
            f"Too few runs to judge the paper: {n['undecided']} of {len(judged)} claims are "
            f"undecided.\nSupported: {n['supported']}. Tasks, methods, runs or trials are missing."
        )
    verb = "is" if n["supported"] == 1 else "are"
    card = f"{n['supported']} of {len(judged)} claims {verb} supported"
    if len(central):
        held, of = int((central == "supported").sum()), spelled(len(central))
        some = of if held == len(central) else f"{spelled(held)} of the {of}"
        card += f", among them {'the ' * (some == of)}{some} central ones"
    each = ", ".join(f"{verdict} {n[verdict]}" for verdict in get_args(Verdict) if n[verdict])
    words = [
        f"{capital(verdict)}: {listed(names.index)}."
        for verdict, names in central.groupby(central, sort=False)
    ]
    lacking = judged.lacks_runs.sum()
    words.append(f"Of all {len(judged)} claims: {each}.")
    words += [f"Of the undecided, {number(lacking)} lack runs here."] * bool(lacking)
    return f"{card}.\n{' '.join(words)}"


def claims_hold(study: Study) -> str:
    """Say whether the paper's claims hold.

    Empty for too few runs in a folder with other tasks, which is not about the paper.
    """
    judged = papers_claims(study)
    if judged.empty or (too_few(judged) and has_own_tasks(study)):
        return ""
    failed = (study.cells[key] for keys in judged.failed for key in keys)
    return verdicts_in_words(judged) + failed_runs(study, failed, ", which leaves claims undecided")


def has_own_tasks(study: Study) -> bool:
    """Return whether some task is neither the paper's, changed or not, nor of a shipped family."""
    shipped = {*shipped_tasks(), *shipped_families()}
    return any(
        (task.family or name.partition(".")[0]) not in shipped for name, task in study.tasks.items()
    )
