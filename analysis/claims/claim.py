"""Claims, and the comparisons of means of runs on which most claims rest."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from coartic.analysis.claims.judging import Finding
from coartic.analysis.claims.reader import Higher, Measurement, Reader
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.words import capital, estimate, number
from coartic.estimates import Estimate, difference_of_means


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, and how it is judged.

    Judging takes at least three runs of the learner with 10,000 trials each. The file
    ``docs/sentences.toml`` says for each sentence of the paper which claim covers it.
    """

    id: str
    text: str
    place: str
    """Section of the paper with the statement, and the figure that shows it, if any."""
    quote: str
    """A few words of the paper, by which a reader finds the place."""
    test: str
    """The test, in words."""
    judge: Callable[[Reader], Finding]
    group: Literal["paper", "comparison", "families", "exact"] = "comparison"
    """Group of claims over which p-values are corrected. ``paper``: claims on the paper's seven
    cells; ``comparison``: claims that compare these cells with other runs, apart, so that other
    runs change no verdict on the seven cells; ``families``: claims on families of random tasks;
    ``exact``: no correction, as the claim is counted without a test."""
    fitted: bool = False
    """True if the claim rests on goals that the paper does not publish."""
    sets: str = ""
    """Number of the sets of goals consistent with the paper's text that support a fitted claim
    (docs/reconstruction.md); empty if the claim was used to choose the goals, or compares with
    other runs."""
    depends: bool = False
    """True if at most half of these sets support the claim, on some task."""
    short: str = ""
    """A few words for sentences; empty but for the three central claims."""


def all_higher(comparisons: Iterable[Higher], shown: Iterable[Measurement] = ()) -> Finding:
    """Test that all claimed orders of means hold, by one-tailed bootstrap tests.

    The evidence also has the values of ``shown``, and the rewards that the paper publishes.
    """
    tests, parts = [], []
    before: Measurement | None = None
    for first, second, by in comparisons:
        other = 0.0 if second is None else second.numbers
        tests.append(bootstrap_test(first.numbers - by, other))
        words = first.name if first is before else f"{first.name}: {first}"  # said once
        if second is not None:
            words += f" against {second} ({second.who})"
            if second.numbers.ndim:
                difference = difference_of_means(first.numbers, second.numbers)
                words += f", a difference of {estimate(difference, 1 if first.in_ticks else 3)}"
                words += " ticks" * first.in_ticks
            if first.published and second.published:
                words += f"; published {first.published} and {second.published}"
        parts.append((first.quantity, words))
        before = first
    parts += [(values.quantity, f"{values.name}: {values}") for values in shown]
    return all_positive(tests, parts)


def all_positive(tests: Sequence[Estimate], parts: Iterable[tuple[str, str]]) -> Finding:
    """Return the finding that all tests point as claimed.

    ``parts`` of the evidence are pairs of a measured quantity and words, grouped by quantity.
    """
    by_quantity: dict[str, list[str]] = {}
    for quantity, part in parts:
        by_quantity.setdefault(f"{capital(quantity)}: " if quantity else "", []).append(part)
    evidence = ". ".join(f"{words}{'; '.join(each)}" for words, each in by_quantity.items())
    return Finding(all(test.value > 0 for test in tests), evidence, tuple(tests))


def no_trial_fails(read: Reader, cells: Iterable[tuple[str, str]]) -> Finding:
    """Count the trials of the learner that miss a goal; the claim is that there are none."""
    trials = failed = 0
    for task, label in cells:
        runs = read.runs(task, label)
        trials += int(runs.trials.sum())
        failed += int(runs.failed_trials.sum())
    words = f"{failed} of {number(trials)} trials of the learner fail to hit every goal"
    return Finding(not failed, words)
