"""A claim, and comparisons of means of runs, from which most claims are made."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from coartic.analysis.claims.judging import Finding
from coartic.analysis.claims.reader import Measurement, Reader
from coartic.analysis.statistics.hypotheses import bootstrap_test
from coartic.analysis.words import capital, estimate, number
from coartic.estimates import Estimate, difference_of_means


@dataclass(frozen=True)
class Claim:
    """One statement of the paper, and how it is judged.

    Runs of the learner are judged with 10,000 trials, and at least three of them. The whole paper,
    sentence by sentence, is accounted for in ``docs/sentences.toml``.
    """

    id: str
    text: str
    place: str
    """Section of the paper that says it, and the figure that shows it, where one does."""
    quote: str
    """A few words of the paper by which the place can be found."""
    test: str
    """The test, in words."""
    judge: Callable[[Reader], Finding]
    group: Literal["paper", "beside", "families", "exact"] = "beside"
    """With which claims it is corrected: with those on the paper's seven cells; those that take
    runs beside them, so that they change no verdict on those cells; those on families of random
    tasks; with none, as it is counted exactly."""
    fitted: bool = False
    """Whether it rests on goals that the paper does not publish."""
    sets: str = ""
    """Of such a claim: how many of the sets of goals that the paper's text admits support it
    (docs/reconstruction.md); not of one that chose them, or that takes other runs."""
    depends: bool = False
    """Whether at most half of them do, on some task."""
    short: str = ""
    """In a few words; the three claims that carry the paper's point have it."""


class Higher(NamedTuple):
    """The mean of the first is claimed to be higher, than 0 or than that of a second."""

    first: Measurement
    second: Measurement | None = None
    by: float = 0.0
    """It is to be higher by more than this."""


def all_higher(comparisons: Iterable[Higher], shown: Iterable[Measurement] = ()) -> Finding:
    """Whether every mean is as claimed, by one-tailed bootstrap tests.

    ``shown``: values that the evidence has as well. What the paper publishes of both stands there
    too.
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
    """Whether every test points as claimed; the evidence has its parts by what is measured."""
    by_quantity: dict[str, list[str]] = {}
    for quantity, part in parts:
        by_quantity.setdefault(f"{capital(quantity)}: " if quantity else "", []).append(part)
    evidence = ". ".join(f"{words}{'; '.join(each)}" for words, each in by_quantity.items())
    return Finding(all(test.value > 0 for test in tests), evidence, tuple(tests))


def no_trial_fails(read: Reader, cells: Iterable[tuple[str, str]]) -> Finding:
    """Whether all trials of the learner hit every goal."""
    trials = failed = 0
    for task, label in cells:
        runs = read.runs(task, label)
        trials += int(runs.trials.sum())
        failed += int(runs.failed_trials.sum())
    words = f"{failed} of {number(trials)} trials of the learner fail to hit every goal"
    return Finding(not failed, words)
