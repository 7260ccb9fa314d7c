"""The paper's claims judged on a results folder: tests corrected together, one verdict each.

- *Supported*: what the claim says is seen, and the largest p-value of its tests, which must all
  hold (intersection-union test), is below 5 % after Holm's correction; tests over random tasks
  also without the task that speaks most for the claim.
- *Not supported*: it is not seen, and the opposite of one of its tests is significant (smallest
  p-value of the opposites times their number, below 5 % after Holm's correction).
- *Depends on the goals*: it would be supported at our goals, but at most half of the sets of goals
  that the paper's text admits support it.
- *Undecided*: none of these, or the folder lacks the runs.

What is counted exactly, or shows no spread over runs, needs no test. Corrections are over fixed
groups of claims: those on the paper's own seven cells, those that take other runs beside them,
and those on families of random tasks. A claim that a folder cannot test
counts in its group all the same, so that what is decided stays decided whatever else is run.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import get_args

import pandas as pd

from coartic.analysis.claims.claim import Claim
from coartic.analysis.claims.families import CLAIMS_ON_FAMILIES
from coartic.analysis.claims.judging import Finding, Verdict, judge
from coartic.analysis.claims.paper import CLAIMS_OF_THE_PAPER
from coartic.analysis.claims.reader import MissingError, Reader
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, table
from coartic.analysis.topics.rewards import beside_paper
from coartic.analysis.topics.scores import failed_runs
from coartic.analysis.words import capital, listed, number, spelled
from coartic.tasks.families import shipped_families
from coartic.tasks.task import shipped_tasks

CLAIMS = {claim.id: claim for claim in (*CLAIMS_OF_THE_PAPER, *CLAIMS_ON_FAMILIES)}
"""Every claim by its id."""


@cached
def judgements(study: Study) -> pd.DataFrame:
    """The claims on the folder's tasks, the paper's or random ones, as :func:`judge_claims`."""
    drawn = {task.family is not None for task in study.tasks.values()}
    paper = CLAIMS_OF_THE_PAPER if drawn != {True} else []
    return judge_claims(study, [*paper, *(CLAIMS_ON_FAMILIES if True in drawn else [])])


def judge_claims(study: Study, claims: Iterable[Claim]) -> pd.DataFrame:
    """The claims judged, each corrected over those of its group among ``claims``.

    A row a claim, as :func:`~coartic.analysis.judge` has it, and ``run_ids``, of the runs that were
    read, and ``failed``, the cells that it lacks as some of their runs failed.
    """
    groups: dict[str, dict[str, tuple[str, str, Finding]]] = {}
    rows = []
    ids = "|".join(re.escape(name) for name in sorted(study.tasks, key=len, reverse=True))
    task_name = re.compile(rf"(?<![\w.-])({ids})(?![\w-]|\.\w)")
    for claim in claims:
        read = Reader(study)
        try:
            finding = claim.judge(read)
        except MissingError as missing:
            finding, read.run_ids = Finding(None, str(missing)), []
        # People's names of tasks in place of their ids.
        evidence = task_name.sub(lambda match: study.tasks[match[1]].label, finding.evidence)
        finding = replace(finding, evidence=evidence)
        groups.setdefault(claim.group, {})[claim.id] = claim.text, claim.test, finding
        run_ids = " ".join(dict.fromkeys(read.run_ids))
        rows.append((claim.id, run_ids, tuple(dict.fromkeys(read.failed)), claim.depends))
    columns = ["claim", "run_ids", "failed", "depends"]
    read_of = pd.DataFrame(rows, columns=columns).set_index("claim")
    judged = read_of.join(pd.concat(map(judge, groups.values())))
    goals = judged.pop("depends") & (judged.verdict == "supported")
    return judged.assign(verdict=judged.verdict.mask(goals, "depends on the goals"))


def counts(verdicts: Iterable[str]) -> Mapping[Verdict, int]:
    """Number of claims with each verdict, including 0."""
    numbers = Counter(verdicts)
    return {verdict: numbers[verdict] for verdict in get_args(Verdict)}


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


def too_few(judged: pd.DataFrame) -> bool:
    """Return whether half of the claims are undecided, as a folder lacks runs or trials, and not
    all of the central ones are supported."""
    central = central_verdicts(judged)
    all_hold = bool(len(central)) and (central == "supported").all()
    return bool(2 * (judged.verdict == "undecided").sum() >= len(judged) and not all_hold)


def central_verdicts(judged: pd.DataFrame) -> pd.Series:
    """Return the verdicts on the claims that carry the paper's point, by their short words."""
    short = judged.verdict.rename(lambda name: CLAIMS[name].short)
    return short[short.index != ""]


def verdicts_in_words(judged: pd.DataFrame) -> str:
    """Say how many claims are supported, of all and of those that carry the paper's point, and how
    many have each verdict."""
    n, central = counts(judged.verdict), central_verdicts(judged)
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
    each = ", ".join(f"{verdict} {count}" for verdict, count in n.items() if count)
    words = [
        f"{capital(verdict)}: {listed(names.index)}."
        for verdict, names in central.groupby(central, sort=False)
    ]
    lacking = judged.evidence.str.startswith("Not judged").sum()
    words.append(f"Of all {len(judged)} claims: {each}.")
    words += [f"Of the undecided, {number(lacking)} lack runs here."] * bool(lacking)
    return f"{card}.\n{' '.join(words)}"


def claims_hold(study: Study) -> str:
    """Say whether the paper is reproduced, by its claims; nothing of too few runs where the folder
    has tasks that no claim is about."""
    judged = papers_claims(study)
    if judged.empty or (too_few(judged) and has_own_tasks(study)):
        return ""
    failed = (study.cells[key] for keys in judged.failed for key in keys)
    return verdicts_in_words(judged) + failed_runs(failed, ", which leaves claims undecided")


def has_own_tasks(study: Study) -> bool:
    """Return whether a task is neither the paper's, also changed, nor of a shipped family."""
    shipped = {*shipped_tasks(), *shipped_families()}
    return any(
        (task.family or name.partition(".")[0]) not in shipped for name, task in study.tasks.items()
    )
