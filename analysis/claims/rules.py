"""Judges of the rules that ``claims.toml`` states by what they compare or count."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from coartic.analysis.claims.data import Data
from coartic.analysis.claims.evidence import all_hold, exceeds, shown
from coartic.analysis.claims.register import Claim, Finding
from coartic.analysis.claims.statements import JUDGED, MARGINS, STATEMENTS
from coartic.analysis.printed import ENTRIES, Count
from coartic.analysis.published import published_cell, published_exhaustive, published_initial
from coartic.analysis.statistics.estimates import (
    Inference,
    difference_of_means,
    probability_of_improvement,
)
from coartic.analysis.statistics.hypotheses import Alternative, share_p, share_test
from coartic.analysis.words import interval, tally
from coartic.robot import Array

FEW, MOST = MARGINS["few"], MARGINS["most"]
IN_WORDS = {
    "higher": "one-tailed bootstrap test of the mean reward, each",
    "most": f"exact binomial test that more than {MOST:.0%} of all runs do",
    "few": f"exact binomial test that fewer than {MOST:.0%} of all runs do",
    "about": f"exact binomial tests that more than {FEW:.0%} and fewer than {MOST:.0%} of all "
    "runs do; the contrary: the share lies outside, and Fisher's exact test tells the counts from "
    "the printed ones",
}
"""What the rules of this module test."""


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
        return f"{self.name} {self.hands}".strip()


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
        of_hands = {s.hands: s.summary for s in cell.sequences} if cell else {}
        summary = of_hands.get(side.hands) if side.hands else cell and cell.summary
        value, derived = (summary.mean, summary.derived) if summary else (None, False)
    return None if value is None else f"{value:.4g}{' (derived)' * derived}"


def _rewards(data: Data, task: str, side: Side, other: Side) -> Array | float:
    hands = side.hands or None
    if side.name == "initial":
        return data.initial_reward(task, other.name, other.hands or None)
    if side.name == "best":
        return data.best_sequences(task)[1]
    if side.replay:
        return data.replays(task, side.name, hands)
    return data.rewards(task, side.name, hands)


def _higher(data: Data, claim: Claim) -> Finding:
    tests, parts = [], []
    for task, pairs in claim.pairs.items():
        for first, second in map(sides, pairs):
            a, b = _rewards(data, task, first, second), _rewards(data, task, second, first)
            assert not isinstance(a, float)
            tests.append(exceeds(a, b))
            if isinstance(b, float):
                found = f"{shown(a)} against {b:.0f} ({second})"
            else:
                chance = probability_of_improvement(a, b)
                found = (
                    f"{shown(a)} in {len(a)} runs against {second} {shown(b)} in {len(b)}: "
                    f"{interval(difference_of_means(a, b))}, "
                    f"P(higher) {interval(chance, '.2f')}"
                )
            printed = [_as_printed(task, side) for side in (first, second)]
            if None not in printed:
                found += f"; published {' and '.join(map(str, printed))}"
            parts.append(f"{task} {'replay of ' * first.replay}{first} {found}")
    return all_hold(tests, parts)


def _count(data: Data, task: str, text: str) -> tuple[str, int, Counter[str]]:
    """What is counted in words, how often, and all hand sequences."""
    condition, hands, inverse = counted_hands(text)
    found = data.hands(task, condition)
    count, words = found[hands], f"{condition} {hands}"
    if inverse:
        count, words = found.total() - count, f"{condition} other hands than {hands}"
    return words, count, found


def nearly_all(
    words: str, count: int, total: int, rule: Literal["most", "few"] = "most"
) -> Finding:
    """Whether most runs do something; ``few``: whether it is not most of them."""
    most = rule == "most"
    alternative: Literal["greater", "less"] = "greater" if most else "less"
    found = stats.binomtest(count, total, alternative=alternative).proportion_ci()
    bound = f"at least {found.low:.0%}" if most else f"at most {found.high:.0%}"
    return Finding(
        count > MOST * total if most else count < MOST * total,
        f"{words} in {count} of {total} runs, {bound} of all (95 %)",
        (share_test(count, total, MOST, alternative),),
        (share_test(count, total, MOST, "less" if most else "greater"),),
    )


def _share(data: Data, claim: Claim) -> Finding:
    ((task, text),) = claim.runs.items()
    words, count, found = _count(data, task, text)
    rule: Literal["most", "few"] = "most" if claim.rule == "most" else "few"
    return nearly_all(f"{words} ({tally(found)})", count, found.total(), rule)


def half_p(count: ArrayLike, total: int) -> Array:
    """p that a share lies between :data:`FEW` and :data:`MOST`: the larger of two exact tests."""
    bounds: tuple[tuple[float, Alternative], ...] = (FEW, "greater"), (MOST, "less")
    return np.maximum(*(share_p(count, total, bound, side) for bound, side in bounds))


def unlike_p(ours: tuple[int, int], printed: tuple[int, int]) -> float:
    """Fisher's exact p of two counts, each out of so many runs."""
    return float(stats.fisher_exact([[k, n - k] for k, n in (ours, printed)]).pvalue)


def printed_count(task: str, condition: str, hands: str) -> tuple[int, int]:
    """Runs that the paper prints for a hand sequence, and out of how many."""
    cell = published_cell(task, condition)
    assert cell is not None
    known = {s.hands: s.summary.runs for s in cell.sequences}
    return known[hands], sum(known.values())


def _about(data: Data, claim: Claim) -> Finding:
    ((task, text),) = claim.runs.items()
    condition, hands, _ = counted_hands(text)
    words, count, found = _count(data, task, text)
    total, printed = found.total(), printed_count(task, condition, hands)
    derived = any(
        (entry.task, entry.condition, entry.hands) == (task, condition, hands)
        for entry in ENTRIES.values()
        if isinstance(entry, Count) and entry.derived
    )
    low, high = stats.binomtest(count, total).proportion_ci()
    share = count / total
    within = f"two one-tailed exact binomial tests, {FEW:.0%} and {MOST:.0%}"
    room, p = min(share - FEW, MOST - share), float(half_p(count, total))
    unlike = "Fisher's exact test, two-tailed, against the printed counts"
    apart, contrary_p = share - printed[0] / printed[1], unlike_p((count, total), printed)
    return Finding(
        FEW < share < MOST,
        f"{words} in {count} of {total} runs ({tally(found)}), {low:.0%} to {high:.0%} of all "
        f"(95 %); published {printed[0]} of {printed[1]}{' (derived)' * derived}",
        (Inference(room, (total,), within, p=p),),
        (Inference(apart, (total, printed[1]), unlike, p=contrary_p),),
    )


_JUDGES = {"higher": _higher, "most": _share, "few": _share, "about": _about}


def _enter(name: str) -> None:
    said = STATEMENTS[name]
    if said.rule not in _JUDGES:
        return
    what = "; ".join(
        f"{task} {', '.join([own] if isinstance(own, str) else own)}"
        for task, own in (said.pairs or said.runs).items()
    )
    judge = _JUDGES[said.rule]
    test = f"{IN_WORDS[said.rule]}: {what}"
    JUDGED[name] = said.claim(name, test, lambda data: judge(data, JUDGED[name]))


def of_task(claim: Claim, task: str) -> Claim:
    """A claim of comparisons on one task alone; other claims as they are."""
    if claim.pairs.keys() <= {task}:
        return claim
    own = replace(
        claim, pairs={name: pairs for name, pairs in claim.pairs.items() if name == task}
    )
    return replace(own, judge=lambda data: _JUDGES[own.rule](data, own)) if own.pairs else claim


for _name in STATEMENTS:
    _enter(_name)
