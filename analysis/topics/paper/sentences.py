"""What became of the paper's rewards and claims, in sentences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import pandas as pd

from coartic.analysis.claims.judgements import CLAIMS as REGISTER
from coartic.analysis.claims.judgements import counts, judgements
from coartic.analysis.claims.judging import Verdict
from coartic.analysis.methods import LEARNER
from coartic.analysis.section import Section
from coartic.analysis.statistics.estimates import Estimate
from coartic.analysis.study import Study
from coartic.analysis.topics.comparison.scores import best_condition
from coartic.analysis.topics.failed import failed_runs
from coartic.analysis.topics.paper.tables import beside_paper
from coartic.analysis.words import capital, estimate, listed, marked

MOST_CHANGES = 4
"""Tasks with changed hands that a sentence names."""


def papers_claims(study: Study) -> pd.DataFrame:
    """Claims of the paper; none where the folder has no runs for any of them or its rewards."""
    judged = judgements(study)
    return judged if beside_paper(study) or judged.run_ids.any() else judged[:0]


def mostly_undecided(judged: pd.DataFrame) -> bool:
    """Whether half of the claims are undecided: they lack runs or trials."""
    return 2 * counts(judged.verdict)["undecided"] >= len(judged)


def rewards_by_verdict(study: Study) -> Counter[str]:
    """How many printed rewards of whole cells are equivalent to ours, undecided and different."""
    verdicts = [row["verdict"] for row in beside_paper(study) if not row["hands"]]
    return Counter(
        {name: verdicts.count(name) for name in ("equivalent", "undecided", "different")}
    )


def finding_of_rewards(study: Study) -> str:
    """How many printed rewards agree with ours, and which of the undecided are off."""
    if papers_claims(study).empty:
        return ""
    n = rewards_by_verdict(study)
    if not n.total():
        return (
            "Rewards are not judged: only runs with as many trials as the paper's, 10 000, compare "
            "with those that it prints."
        )
    words = (
        f"Of the {n.total()} learned rewards that the paper prints, {n['equivalent'] or 'none'} "
        f"{'agrees' if n['equivalent'] == 1 else 'agree'} with ours within 1 %, "
        f"{n['undecided'] or 'none'} {is_or_are(n['undecided'])} undecided and "
        f"{n['different'] or 'none'} {'differs' if n['different'] == 1 else 'differ'}."
    )
    for row in beside_paper(study):
        if row["verdict"] == "undecided" and not row["hands"]:
            off = Estimate(row["difference"], row["difference_low"], row["difference_high"])
            if off.low > 0 or off.high < 0:
                condition = row["cell"].label.removeprefix(LEARNER)
                task = marked(study.tasks[row["cell"].task])
                words += (
                    f" {condition} on {task} is {estimate(off, 1)} "
                    "ticks from the printed mean: its interval leaves out 0, not corrected for the "
                    "number of rewards."
                )
    return words


def finding_of_claims(study: Study) -> str:
    """Which verdicts there are: on the claims that carry the paper's point, and on the others."""
    judged = papers_claims(study)
    if judged.empty:
        return ""
    by_verdict = counts(judged.verdict)
    if mostly_undecided(judged):
        words = (
            f"These runs do not decide {by_verdict['undecided']} of {len(judged)} claims: tasks, "
            "methods, runs or trials are missing. Claims without runs are only in "
            "tables/claims.csv."
        )
    elif central := central_claims(judged):
        each = [
            f"{len(claims)} {is_or_are(len(claims))} {verdict}: {listed(claims)}"
            for verdict, claims in central.items()
        ]
        others = counts_of_others(judged)
        words = f"Of the claims that carry the paper's point {'; '.join(each)}."
        words += f" Of {sum(others.values())} others {in_numbers(others)}."
    else:
        words = f"Of {len(judged)} claims {in_numbers(by_verdict)}."
    return words


def answer_paper(study: Study) -> str:
    """Whether the paper is reproduced, by its claims."""
    judged = papers_claims(study)
    if judged.empty:
        return ""
    by_verdict = counts(judged.verdict)
    if mostly_undecided(judged):
        decided = len(judged) - by_verdict["undecided"]
        words = (
            f"Too little to judge the paper: {decided} of {len(judged)} claims "
            f"{is_or_are(decided)} decided, {supported(by_verdict)}."
        )
    elif central := central_claims(judged):
        if list(central) == ["supported"]:
            words = f"In its main point, yes: {listed(central['supported'])}."
        else:
            words = " ".join(f"{capital(v)}: {listed(claims)}." for v, claims in central.items())
        others = counts_of_others(judged)
        words += f" Of {sum(others.values())} other claims {supported(others)}."
    else:
        words = f"Of {len(judged)} claims {in_numbers(by_verdict)}."
    failed = (cell for cells in judged.failed for cell in cells)
    return words + failed_runs(study, failed, ", which leaves claims undecided")


def central_claims(judged: pd.DataFrame) -> dict[Verdict, list[str]]:
    """The claims that carry the paper's point, in a few words, by verdict."""
    central: dict[Verdict, list[str]] = {}
    for name, verdict in judged.verdict.items():
        if REGISTER[str(name)].short:
            central.setdefault(verdict, []).append(REGISTER[str(name)].short)
    return central


def counts_of_others(judged: pd.DataFrame) -> Mapping[Verdict, int]:
    """Verdicts on the claims that do not carry the paper's point."""
    return counts(v for name, v in judged.verdict.items() if not REGISTER[str(name)].short)


def in_numbers(n: Mapping[Verdict, int]) -> str:
    """How many claims have each verdict, in words."""
    depend = n["depends on the goals"]
    words = f"{supported(n)}, {n['not supported']} {is_or_are(n['not supported'])} not, "
    if depend:
        words += f"{depend} {'depends' if depend == 1 else 'depend'} on which goals one takes, "
    return f"{words}{n['undecided']} {is_or_are(n['undecided'])} undecided"


def supported(n: Mapping[Verdict, int]) -> str:
    """How many claims are supported, in words."""
    return f"{n['supported']} {is_or_are(n['supported'])} supported"


def is_or_are(count: int) -> str:
    """The verb for a number of things."""
    return "is" if count == 1 else "are"


def finding_of_hands(study: Study) -> str:
    """On which tasks the learner's best condition ends with other hands than it began with."""
    changes: dict[str, list[str]] = {}
    tasks = 0
    for name, task in study.tasks.items():
        label = best_condition(study, name)
        good = study.cells[name, label].good if label else None
        if good is not None and good.initial_hands.notna().any():
            tasks += 1
            before, most_frequent = good.initial_hands.dropna().iloc[0], list(good.hands.mode())
            if before not in most_frequent:
                change = f"{before} to {' or '.join(most_frequent)}"
                changes.setdefault(change, []).append(marked(task))
    changed = sum(map(len, changes.values()))
    if changed > MOST_CHANGES:
        return f"On {changed} of {tasks} tasks the learner changes hands."
    if changed:
        each = (f"on {listed(where)} from {change}" for change, where in sorted(changes.items()))
        return f"The learner changes hands: {'; '.join(each)}."
    return "The learner keeps the hands of the initial solution."


PUBLISHED = Section(
    "paper",
    short="Paper",
    title="Are the paper's rewards reproduced?",
    caption="Learned rewards, published and ours (ticks)",
    finding=finding_of_rewards,
    figure="published",
    table="published",
    note=(
        "EC1 to EC4 are the paper's exploration conditions. EC1 explores the right arm only, EC2 "
        "both arms with the closest hand, EC3 the choice of hand as well but not the waiting arm,"
        " EC4 all of these. LRLR means left, right, left, right hand. † marks tasks whose goals "
        "the paper does not print: these rewards helped to choose ours, so their agreement is no "
        "evidence."
    ),
    single=True,
)

CLAIMS = Section(
    "claims",
    short="Claims",
    title="Do the claims hold?",
    caption="Claims; open one to see its evidence",
    finding=finding_of_claims,
    table="claims",
    note=(
        "p is corrected for the number of claims (Holm). Some claims of the paper rest on goals "
        "that it does not print: the third column says in how many of the sets of goals that fit "
        "its text a claim holds. A claim that our goals support, but at most half of these sets, "
        "depends on the goals. Rewards are those of the best trial of a run; a replay makes what "
        "was learned once more, without noise and exploration."
    ),
)

HANDS = Section(
    "hands",
    short="Hands",
    title="Which hands are chosen?",
    caption="Learned rewards by hand sequence, published and ours (ticks)",
    finding=finding_of_hands,
    figure="recruitment",
    table="hands",
    single=True,
)
