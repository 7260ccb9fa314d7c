"""Judges of claims that name what they compare or count."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from coartic.analysis.claims.data import Data
from coartic.analysis.claims.register import MARGINS, Claim, Finding
from coartic.analysis.published import (
    ENTRIES,
    Number,
    published_cell,
    published_exhaustive,
    published_initial,
)
from coartic.analysis.statistics.estimates import (
    Inference,
    difference_of_means,
    mean,
    probability_of_improvement,
)
from coartic.analysis.statistics.hypotheses import (
    Alternative,
    bootstrap_test,
    share_test,
)
from coartic.analysis.words import estimate, number, tally

FEW, MOST = MARGINS["few"], MARGINS["most"]


@dataclass(frozen=True)
class Side:
    """One side of a comparison: runs of a condition, or the corrective process alone."""

    name: str
    """Condition; ``initial`` solution, or ``best`` of all hand sequences."""
    hands: str = ""
    """Only the runs that learned this sequence, where it is named."""
    replay: bool = False
    """Noiseless replays: the learned reward, the best of all trials, is never below trial 0's."""

    @property
    def known(self) -> bool:
        """Whether its reward is one number."""
        return self.name in ("initial", "best")

    def __str__(self) -> str:
        return f"{'replay of ' * self.replay}{self.name} {self.hands}".strip()


def sides(pair: str) -> tuple[Side, Side]:
    """Both sides of a comparison such as ``replay EC2 RRRR > initial``."""
    first, second = (_side(text.split()) for text in pair.split(" > "))
    return first, second


def _side(words: list[str]) -> Side:
    replay = words[0] == "replay"
    name, *hands = words[replay:]
    return Side(name, "".join(hands), replay)


def counted_hands(text: str) -> tuple[str, str, bool]:
    """Condition, hand sequence, and whether it is runs without it that count."""
    condition, *inverse, hands = text.split()
    return condition, hands, inverse == ["not"]


def higher(data: Data, claim: Claim) -> Finding:
    """one-tailed bootstrap test of the mean reward for each comparison"""
    tests, parts = [], []
    for task, pairs in claim.pairs.items():
        for first, second in map(sides, pairs):
            a, b = _rewards(data, task, first, second), _rewards(data, task, second, first)
            tests.append(exceeds(a, b))
            if second.known:
                seen = f"{shown(a)} against {number(float(np.asarray(b)))} ({second})"
            else:
                seen = (
                    f"{shown(a)} against {shown(b)} ({second}), a difference of "
                    f"{estimate(difference_of_means(a, b), 1)} ticks; the first is better with "
                    f"probability {estimate(probability_of_improvement(a, b), 2)}"
                )
            printed = [_as_printed(task, side) for side in (first, second)]
            if None not in printed:
                seen += f"; published {printed[0]} and {printed[1]}"
            parts.append(f"{task}, {first}: {seen}")
    return all_hold(tests, parts)


def most(data: Data, claim: Claim) -> Finding:
    """exact binomial test that more than {most:.0%} of all runs do"""
    return _share(data, claim, "most")


def few(data: Data, claim: Claim) -> Finding:
    """exact binomial test that fewer than {most:.0%} of all runs do"""
    return _share(data, claim, "few")


def about(data: Data, claim: Claim) -> Finding:
    """exact binomial tests that more than {few:.0%} and fewer than {most:.0%} of all runs do; \
for the opposite: the share lies outside, and Fisher's exact test tells the counts from the \
printed ones"""
    ((task, text),) = claim.runs.items()
    condition, hands, _ = counted_hands(text)
    words, count, found = _count(data, task, text)
    total, printed = found.total(), printed_count(task, condition, hands)
    derived = any(
        (entry.kind, entry.task, entry.condition, entry.hands) == ("count", task, condition, hands)
        for entry in ENTRIES.values()
        if isinstance(entry, Number) and entry.difference_of
    )
    low, high = stats.binomtest(count, total).proportion_ci()
    share = count / total
    within = f"two one-tailed exact binomial tests, {FEW:.0%} and {MOST:.0%}"
    room, p = min(share - FEW, MOST - share), half_p(count, total)
    unlike = "Fisher's exact test, two-tailed, against the printed counts"
    apart, contrary_p = share - printed[0] / printed[1], unlike_p((count, total), printed)
    return Finding(
        FEW < share < MOST,
        f"{words} in {count} of {total} runs ({tally(found)}), {low:.0%} to {high:.0%} of all "
        f"(95 %); published {printed[0]} of {printed[1]}{' (derived)' * derived}",
        (Inference(room, (total,), within, p=p),),
        (Inference(apart, (total, printed[1]), unlike, p=contrary_p),),
    )


def exceeds(values: ArrayLike, bound: ArrayLike | float) -> Inference:
    """One-tailed bootstrap test that the mean is above a number, or above another sample's."""
    return bootstrap_test(values, bound)


def shown(values: ArrayLike, digits: int = 1) -> str:
    """The mean with its BCa interval."""
    return estimate(mean(values), digits)


def all_hold(tests: Sequence[Inference], parts: Sequence[str], before: str = "") -> Finding:
    """What is seen where every test points as claimed; ``parts`` of a sentence say so."""
    seen = all(test.estimate > 0 for test in tests)
    return Finding(seen, f"{before}{'; '.join(parts)}.", tuple(tests))


def nearly_all(
    words: str, count: int, total: int, rule: Literal["most", "few"] = "most"
) -> Finding:
    """Whether most runs do something; ``few``: whether it is not most of them."""
    greater = rule == "most"
    alternative: Literal["greater", "less"] = "greater" if greater else "less"
    found = stats.binomtest(count, total, alternative=alternative).proportion_ci()
    bound = f"at least {found.low:.0%}" if greater else f"at most {found.high:.0%}"
    return Finding(
        count > MOST * total if greater else count < MOST * total,
        f"{words} in {count} of {total} runs, {bound} of all (95 %)",
        (share_test(count, total, MOST, alternative),),
        (share_test(count, total, MOST, "less" if greater else "greater"),),
    )


def half_p(count: int, total: int) -> float:
    """p that a share lies between few and most: the larger of two exact tests."""
    bounds: tuple[tuple[float, Alternative], ...] = (FEW, "greater"), (MOST, "less")
    return max(share_test(count, total, bound, side).p for bound, side in bounds)


def unlike_p(ours: tuple[int, int], printed: tuple[int, int]) -> float:
    """Fisher's exact p of two counts, each out of so many runs."""
    return float(stats.fisher_exact([[k, n - k] for k, n in (ours, printed)]).pvalue)


def printed_count(task: str, condition: str, hands: str) -> tuple[int, int]:
    """Runs that the paper prints for a hand sequence, and out of how many."""
    cell = published_cell(task, condition)
    assert cell is not None
    known = {name: summary.runs for name, summary in cell.sequences.items()}
    return known[hands], sum(known.values())


def printed_known(task: str, side: Side) -> float | None:
    """Printed reward of the corrective process alone."""
    printed = published_initial(task) if side.name == "initial" else published_exhaustive(task)
    return None if printed is None else printed[1]


def _as_printed(task: str, side: Side) -> str | None:
    """Mean reward of one side as the paper has it, in words."""
    if side.known:
        initial = published_initial(task)
        derived = side.name == "initial" and initial is not None and initial.derived
        value = printed_known(task, side)
    else:
        cell = published_cell(task, side.name)
        of_hands = cell.sequences if cell else {}
        summary = of_hands.get(side.hands) if side.hands else cell and cell.summary
        value, derived = (summary.mean, summary.derived) if summary else (None, False)
    return None if value is None else f"{number(value)}{' (derived)' * derived}"


def _rewards(data: Data, task: str, side: Side, other: Side) -> ArrayLike:
    hands = side.hands or None
    if side.name == "initial":
        return data.initial_reward(task, other.name, other.hands or None)
    if side.name == "best":
        return data.best_sequences(task)[1]
    return (data.replays if side.replay else data.rewards)(task, side.name, hands)


def _count(data: Data, task: str, text: str) -> tuple[str, int, Counter[str]]:
    """What is counted in words, how often, and all hand sequences."""
    condition, hands, inverse = counted_hands(text)
    found = data.hands(task, condition)
    count, words = found[hands], f"{condition} {hands}"
    if inverse:
        count, words = found.total() - count, f"{condition} other hands than {hands}"
    return words, count, found


def _share(data: Data, claim: Claim, rule: Literal["most", "few"]) -> Finding:
    ((task, text),) = claim.runs.items()
    words, count, found = _count(data, task, text)
    return nearly_all(f"{words} ({tally(found)})", count, found.total(), rule)
