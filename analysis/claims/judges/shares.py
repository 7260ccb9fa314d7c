"""How often runs find a hand sequence."""

from __future__ import annotations

from collections import Counter

from scipy import stats

from analysis.claims.data import Data
from analysis.claims.register import Finding
from analysis.published import published_cell
from analysis.statistics.equivalence import shares
from analysis.statistics.estimates import Inference
from analysis.statistics.hypotheses import share_test
from analysis.words import tally

MARGIN = 0.25
"""Shares of runs this near are "about as often"."""
NEARLY_ALL = 1 - MARGIN
"""Share of runs that "in all runs" and "reliably" must exceed: all, by the same margin.

It was 0.8 before these tests had a part in Holm's correction: then 20 of 20 runs (p = 0.012)
could not pass it. docs/findings.md says so.
"""
AS_OFTEN = (
    f"equivalence of the shares, ours and published, within ± {MARGIN:.0%} (Newcombe's interval); "
    "the contrary: Fisher's exact test"
)
MOST = f"exact binomial test that more than {NEARLY_ALL:.0%} of all runs do"


def as_often(data: Data, task: str, condition: str, hands: str) -> Finding:
    """Whether runs find a hand sequence about as often as in the paper."""
    found = Counter(map(str, data.learned(task, condition).hands))
    printed = published_cell(task, condition)
    assert printed is not None
    known = {s.hands: s.runs or 0 for s in printed.sequences}
    ours, theirs = (found[hands], found.total()), (known[hands], sum(known.values()))
    near = shares(ours, theirs, MARGIN)
    table = [[count, total - count] for count, total in (ours, theirs)]
    p = float(stats.fisher_exact(table).pvalue)
    neither = Counter({name: count for name, count in found.items() if name not in known})
    of_others = f" ({tally(neither)})" if neither else ""
    return Finding(
        abs(near.estimate) < MARGIN,
        f"{', '.join(f'{name} {found[name]}' for name in known)}, neither {neither.total()}"
        f"{of_others} of {found.total()} runs, published {tally(known)}; share of {hands} "
        f"{near.estimate:+.0%} [{near.low:+.0%}, {near.high:+.0%}]",
        (Inference(MARGIN - abs(near.estimate), near.n, f"equivalence, {near.method}", p=near.p),),
        (Inference(near.estimate, near.n, "Fisher's exact test of the contrary", p=p),),
    )


def nearly_all(count: int, total: int) -> Finding:
    """Whether something happens in nearly all runs."""
    return Finding(
        count > NEARLY_ALL * total,
        f"{count} of {total} runs, at least {_bound(count, total, 'greater'):.0%} of all (95 %)",
        (share_test(count, total, NEARLY_ALL, "greater"),),
        (share_test(count, total, NEARLY_ALL, "less"),),
    )


def not_nearly_all(count: int, total: int) -> Finding:
    """Whether something does not happen in nearly all runs."""
    return Finding(
        count < NEARLY_ALL * total,
        f"{count} of {total} runs, at most {_bound(count, total, 'less'):.0%} of all (95 %)",
        (share_test(count, total, NEARLY_ALL, "less"),),
        (share_test(count, total, NEARLY_ALL, "greater"),),
    )


def _bound(count: int, total: int, alternative: str) -> float:
    """Exact one-sided 95 % bound of a share."""
    found = stats.binomtest(count, total, alternative=alternative).proportion_ci()
    return float(found.low if alternative == "greater" else found.high)
