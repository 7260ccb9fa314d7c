"""Rules that many claims share: comparisons of means, over runs or random tasks, and counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import stats

from coartic.analysis.claims.data import Data, LearnedHands, Measurement, MissingError, RunCount
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.statistics.estimates import (
    FEWEST,
    Estimate,
    difference_of_means,
    mean,
)
from coartic.analysis.statistics.hypotheses import bootstrap_test, share_test
from coartic.analysis.topics.families.sample import sample
from coartic.analysis.topics.paper.published import published_cell
from coartic.analysis.words import capital, estimate, number
from coartic.tasks.optima import KnownOptimum

RESAMPLES_OF_FAMILIES = 99_999
"""More than elsewhere: some verdicts on families are close, and samples are small."""

TEST_OF_MEANS = "one-tailed bootstrap test of the mean reward for each comparison"
TEST_OF_FAMILIES = (
    "one-tailed bootstrap tests over instances of the mean difference, as a share of the best "
    "known reward, in each family"
)
TEST_OF_HALF = (
    "exact binomial tests that more than {few:.0%} and fewer than {most:.0%} of all runs do; for "
    "the opposite: the share lies outside, and Fisher's exact test tells the counts from the "
    "printed ones. 20 runs are too few to pass it after Holm's correction"
)


OPPOSITE: dict[str, Literal["greater", "less"]] = {"greater": "less", "less": "greater"}
EvidenceParts = list[tuple[str, str]]
"""EvidenceParts of the evidence, each after what is measured."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """One mean beside another; without another, beside 0."""

    first: Measurement
    second: Measurement | None
    margin: float
    """By more than this the first is claimed to be higher."""

    @property
    def test(self) -> Estimate:
        """One-tailed bootstrap test of the difference, less the margin."""
        other = 0.0 if self.second is None else self.second.numbers
        return bootstrap_test(self.first.numbers - self.margin, other)

    @property
    def difference(self) -> float:
        """Difference of the means."""
        other = 0.0 if self.second is None else self.second.numbers.mean()
        return float(self.first.numbers.mean() - other)

    @property
    def against(self) -> str:
        """The other side in words, with the difference, and what the paper prints of both."""
        first, second = self.first, self.second
        if second is None:
            return ""
        words = f" against {second} ({second.who})"
        if second.numbers.ndim:
            apart = difference_of_means(first.numbers, second.numbers)
            in_ticks = first.in_ticks
            words += f", a difference of {estimate(apart, 1 if in_ticks else 3)}"
            words += " ticks" * in_ticks
        if first.printed and second.printed:
            words += f"; published {first.printed} and {second.printed}"
        return words


def higher(first: Measurement, second: Measurement | None = None, *, by: float = 0.0) -> Comparison:
    """The claim that the mean of the first is higher by more than a margin."""
    return Comparison(first, second, by)


def all_of(comparisons: Iterable[Comparison], shown: Iterable[Measurement] = ()) -> Finding:
    """Whether every comparison is as claimed; ``shown``: values that the evidence has as well."""
    tests: list[Estimate] = []
    parts: EvidenceParts = []
    before: Measurement | None = None
    for each in comparisons:
        tests.append(each.test)
        value = "" if each.first is before else f": {each.first}"  # said once
        parts.append((each.first.quantity, f"{each.first.name}{value}{each.against}"))
        before = each.first
    parts += [(values.quantity, f"{values.name}: {values}") for values in shown]
    return all_positive(tests, parts)


def some_of(comparisons: Iterable[Comparison]) -> Finding:
    """Whether one comparison or more is as claimed: smallest p times their number."""
    every = all_of(comparisons)
    best = min(every.tests, key=lambda test: math.inf if math.isnan(test.p) else test.p)
    holds = any(test.value > 0 for test in every.tests)
    if holds:
        best = replace(best, p=min(1.0, best.p * len(every.tests)))
    return Finding(holds, every.evidence, (best,))


def there(reads: Iterable[Callable[[], Measurement]]) -> Iterator[Measurement]:
    """What the folder has of some values."""
    for read in reads:
        with suppress(MissingError):
            yield read()


def all_positive(tests: Sequence[Estimate], parts: EvidenceParts) -> Finding:
    """Whether every test points as claimed; the evidence has its parts by what is measured."""
    by_quantity: dict[str, list[str]] = {}
    for quantity, part in parts:
        by_quantity.setdefault(f"{capital(quantity)}: " if quantity else "", []).append(part)
    evidence = " ".join(f"{words}{'; '.join(each)}." for words, each in by_quantity.items())
    return Finding(all(test.value > 0 for test in tests), evidence, tuple(tests))


def in_every_family(
    data: Data,
    families: Iterable[str],
    *comparisons: tuple[str, Callable[[str], Comparison]],
) -> Finding:
    """Whether comparisons are as claimed in the mean over the instances of each family.

    Each has a name, which stands behind that of the family, and is made for the name of a task.
    Rewards are in per cent of the best known.
    """
    tests: list[Estimate] = []
    parts: EvidenceParts = []
    for name, compare in comparisons:
        for family in families:
            each = compare_instances(data, family, compare)
            first, margin = each[0][0].first, each[0][0].margin
            values = np.array([
                (1.0 if first.quantity else 100 / abs(best.reward)) * comparison.difference
                for comparison, best in each
            ])  # fmt: skip
            tests.append(bootstrap_test(values, margin, resamples=RESAMPLES_OF_FAMILIES))
            seen = estimate(mean(values), 2 if first.quantity else 1) + " %" * (not first.quantity)
            parts.append((first.quantity, f"{family}{name}: {seen} on {len(each)} instances"))
    return all_positive(tests, parts)


def compare_instances(
    data: Data, family: str, compare: Callable[[str], Comparison]
) -> list[tuple[Comparison, KnownOptimum]]:
    """A comparison on each instance of a family that has the runs, beside the best known."""
    each = []
    for name, best in reported_instances(data, family).items():
        with suppress(MissingError):
            each.append((compare(name), best))
    if len(each) < FEWEST:
        raise MissingError(f"fewer than {FEWEST} instances of {family} can be judged")
    return each


def reported_instances(data: Data, family: str) -> dict[str, KnownOptimum]:
    """The best known of a family's instances but for those of development, for tuning."""
    instances = sample(data.study)
    names = instances.families.get(family, ())
    reported = [name for name in names if data.task(name).split != "development"]
    if not reported:
        raise MissingError(f"this folder has no instances of {family} that can be judged")
    return {name: instances.references[name] for name in reported}


def most(count: RunCount) -> Finding:
    """Whether more than three quarters of the runs do something."""
    return beyond(count, MARGINS["most"], "greater")


def not_most(count: RunCount) -> Finding:
    """Whether fewer than three quarters of the runs do something."""
    return beyond(count, MARGINS["most"], "less")


def beyond(count: RunCount, bound: float, side: Literal["greater", "less"]) -> Finding:
    """Whether the share of runs lies on one side of a bound, by an exact binomial test."""
    runs = count.number, count.total
    limits = stats.binomtest(*runs, alternative=side).proportion_ci()
    if side == "greater":
        holds, limit = count.share > bound, f", at least {limits.low:.0%} of all (95 %)"
    else:
        holds, limit = count.share < bound, f", at most {limits.high:.0%} of all (95 %)"
    words = count.words + limit * bool(limits.low > 0 or limits.high < 1)
    test, against = (share_test(*runs, bound, tail) for tail in (side, OPPOSITE[side]))
    return Finding(holds, words, (test,), (against,))


def about_half(learned: LearnedHands, hands: str) -> Finding:
    """Whether neither few nor most runs learned a sequence; the printed count speaks against it."""
    few, most_ = MARGINS["few"], MARGINS["most"]
    seen = learned.are(hands, name=hands)
    count, total, share = seen.number, seen.total, seen.share
    low, high = stats.binomtest(count, total).proportion_ci()
    cell = published_cell(learned.task, learned.condition)
    assert cell is not None
    printed, of_printed = cell.sequences[hands], sum(s.runs for s in cell.sequences.values())
    more, fewer = share_test(count, total, few, "greater"), share_test(count, total, most_, "less")
    within = Estimate(min(share - few, most_ - share), n=(total,), p=max(more.p, fewer.p))
    table = [[count, total - count], [printed.runs, of_printed - printed.runs]]
    unlike = Estimate(
        share - printed.runs / of_printed,
        n=(total, of_printed),
        p=float(stats.fisher_exact(table).pvalue),
    )
    return Finding(
        few < share < most_,
        f"{seen.words}, {low:.0%} to {high:.0%} of all (95 %); published {printed.runs} of "
        f"{of_printed}{' (derived)' * printed.derived_runs}",
        (within,),
        (unlike,),
    )


def no_trial_fails(data: Data, cells: Iterable[tuple[str, str]]) -> Finding:
    """Whether all trials of the learner hit every goal."""
    trials = failed = 0
    for task, label in cells:
        runs = data.runs(task, label)
        trials += int(runs.trials.sum())
        failed += int(runs.failed_trials.sum())
    words = f"{failed} of {number(trials)} trials of the learner fail to hit every goal."
    return Finding(not failed, words)
