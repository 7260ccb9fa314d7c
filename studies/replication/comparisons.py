"""Compare means, as most claims do, and put the comparisons into words."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from judging import Finding
from published import Summary

from coartic.analysis import interval, mean, number
from coartic.analysis.statistics import bootstrap_test, exchange_test
from coartic.estimates import difference_of_means


def written(value, digits):
    """Write an estimate with its interval, ``2.1 [1.3, 2.9]``."""
    return interval(value.columns("of"), "of", digits)


@dataclass(frozen=True, eq=False)
class Measurement:
    """Values of runs, or a single number, with the words that name them in the evidence."""

    task: str
    """Title of the task."""
    who: str
    """Method, as in ``EC2``, ``replay of EC1``, ``initial``, ``random search``."""
    numbers: np.ndarray
    """Values, shape ``(runs,)``. A single number has shape ``()`` and is exact."""
    quantity: str = ""
    """Measured quantity in words; empty for rewards."""
    published: Summary | None = None
    """Reward that the paper publishes; None if the paper publishes no such reward."""

    @property
    def name(self):
        """Title of the task, and method."""
        return f"{self.task}, {self.who}"

    @property
    def in_ticks(self):
        """True for rewards and numbers of ticks."""
        return not self.quantity or "ticks by which" in self.quantity

    def __str__(self):
        """Return the number, or the mean with its BCa interval, as a string."""
        if not self.numbers.ndim:
            return number(float(self.numbers))
        return written(mean(self.numbers), 1 if self.in_ticks else 3)


class Higher(NamedTuple):
    """Claimed order of means: the first mean exceeds the second mean (or 0) by a margin."""

    first: Measurement
    second: Measurement | None = None
    by: float = 0.0
    """Margin, in the unit of the measurements."""


def all_higher(comparisons, shown=()):
    """Test by one-tailed tests that all ``comparisons`` hold. Each is a :class:`Higher`.

    The evidence also has the values of ``shown``, and the rewards that the paper publishes.
    """
    pairs, parts, before = [], [], None
    for first, second, by in comparisons:
        pairs.append((first.numbers - by, 0.0 if second is None else second.numbers))
        words = first.name if first is before else f"{first.name}: {first}"  # said once
        if second is not None:
            words += f" against {second} ({second.who})"
            if second.numbers.ndim:
                difference = difference_of_means(first.numbers, second.numbers)
                words += f", a difference of {written(difference, 1 if first.in_ticks else 3)}"
                words += " ticks" if first.in_ticks else ""
            if first.published and second.published:
                words += f"; published {said(first.published)} and {said(second.published)}"
        parts.append((first.quantity, words))
        before = first
    parts += [(values.quantity, f"{values.name}: {values}") for values in shown]
    return all_positive(pairs, parts)


def said(published):
    """Write a published mean, followed by "(derived)" if it is computed from other numbers."""
    return f"{number(published.mean)}{' (derived)' if published.derived else ''}"


def difference_test(first, other, alternative):
    """Test the difference between the mean of ``first`` and that of ``other``, or a number."""
    if np.ndim(other):
        return exchange_test(first, other, alternative)
    return bootstrap_test(first, float(other), alternative)


def all_positive(pairs, parts):
    """Return the finding that the first mean exceeds the second one in all pairs.

    A pair has the values of two samples, or the values of one sample and a number. ``parts`` of the
    evidence are pairs of a measured quantity and words.
    """
    pairs = list(pairs)
    tests = tuple(difference_test(*pair, "greater") for pair in pairs)
    less = (difference_test(*pair, "less") for pair in pairs)
    against = tuple(replace(test, value=-test.value) for test in less)
    evidence = describe_parts(parts)
    return Finding(all(test.value > 0 for test in tests), evidence, tests, against)


def describe_parts(parts):
    """Join parts of the evidence (pairs of a measured quantity and words), grouped by quantity."""
    seen = pd.DataFrame(parts, columns=["quantity", "words"]).groupby("quantity", sort=False)
    return ". ".join(
        (f"{quantity[:1].upper()}{quantity[1:]}: " if quantity else "") + "; ".join(words)
        for quantity, words in seen.words
    )
