"""Choose the test of two samples by how often candidates reject a true null hypothesis.

    python docs/scripts/calibrate_tests.py docs/stored/two-samples

The script writes ``cells.csv``, with a row for each population and pair of sizes, and
``candidates.csv``, with the number of cells in which a candidate rejects too often: more than 6 %
of samples at the level 5 %, or more than 1.5 % at the level 1 %. The package uses the candidate
with the fewest such cells. At a tie it uses the simpler candidate, which is the first in the table.

All candidates are two-sided. Their statistic t is the difference of the means divided by its
standard error, which has a separate variance for each sample. If both variances are 0, t is
infinite, or 0 if the means are equal. The candidates are

- ``exchange``: a permutation test, which exchanges the labels of values. All ways to exchange
  labels are used if there are not more of them than resamples;
- ``bootstrap``: each sample is shifted to the mean 0 and resampled. If no sample varies and the
  means differ, p is the smallest p that ``exchange`` can give for samples of the same sizes;
- ``exchange below N``: ``exchange`` if the smaller sample has fewer than N values, otherwise
  ``bootstrap``.

Columns that begin with ``greater`` or ``less`` have the one-sided ``exchange`` (the mean of the
first sample is higher, or lower) for populations with skew and unequal spread. These columns
describe the test, and do not count in the choice.

Grid, seeds and numbers were committed before the first result. The populations that have both skew
and unequal spread were added later, again before their results, and the rule is the same. As in
the package, all samples of a size have the same resamples; here there are 999 of them.
"""

import itertools
import math
import sys
from pathlib import Path

import numpy as np
import pandas as pd

SEED, SAMPLES, RESAMPLES, AT_ONCE = 0, 20_000, 999, 1_000
SIZES = [
    *((n, n) for n in (3, 4, 5, 10, 20, 50, 100, 600)),
    *((3, 20), (3, 100), (5, 100), (10, 100), (20, 100), (100, 500)),
]
SIDES = {0.05: 0.06, 0.01: 0.015}
"""Maps each level of significance to the share of rejected samples above which a test rejects too
often."""
LIMITS = {
    "exchange": math.inf, "bootstrap": 0,
    **{f"exchange below {n}": n for n in (10, 20, 50)},
}  # fmt: skip
"""Maps each candidate, the simplest first, to a limit: the candidate uses ``exchange`` if the
smaller sample has fewer values than this limit, and otherwise ``bootstrap``."""


def levels(values, shares):
    """Return a population of the given values, which occur with the given probabilities.

    A population is a function of a random generator and a shape.
    """
    return lambda rng, shape: rng.choice(np.array(values, dtype=float), size=shape, p=shares)


def skewed(rng, shape):
    """Draw values from a log-normal distribution that is shifted to the mean 0."""
    return np.exp(rng.normal(size=shape)) - math.exp(0.5)


def skewed_by(factor):
    """Return the population :func:`skewed`, with all values multiplied by a factor."""
    return lambda rng, shape: factor * skewed(rng, shape)


def normal(sd):
    """Return a normal population with the mean 0 and the standard deviation ``sd``."""
    return lambda rng, shape: rng.normal(0.0, sd, shape)


POPULATIONS = {
    **{f"rare {share:g}": (levels([0, 1], [1 - share, share]),) * 2
       for share in (0.02, 0.05, 0.1, 0.2, 0.3)},
    "three levels": (levels([-1, 0, 1], [0.1, 0.8, 0.1]),) * 2,
    "three skewed levels": (levels([0, 1, 10], [0.7, 0.25, 0.05]),) * 2,
    "normal": (normal(1),) * 2,
    "skewed": (skewed,) * 2,
    "first spread 3": (normal(3), normal(1)),
    "second spread 3": (normal(1), normal(3)),
    "levels, first spread 3": (levels([-3, 0, 3], [0.1, 0.8, 0.1]),
                               levels([-1, 0, 1], [0.1, 0.8, 0.1])),
    "skewed, first spread 3": (skewed_by(3), skewed),
    "skewed, second spread 3": (skewed, skewed_by(3)),
    "skewed against normal": (skewed, normal(1)),
    "three skewed levels, first spread 3": (levels([0, 3, 30], [0.7, 0.25, 0.05]),
                                            levels([1.5, 2.5, 11.5], [0.7, 0.25, 0.05])),
}  # fmt: skip
"""Maps names to pairs of populations with equal means, one for each of the two samples."""
ONE_TAILED = [*POPULATIONS][-4:]
"""Populations with skew and unequal spread, for which one-sided tests are described."""


def studentised(sums, squares, sizes):
    """Return the t statistic of two samples, computed from sums of their values and squares.

    ``sums`` and ``squares`` have an array for each sample, and ``sizes`` the sizes of the samples.
    If no sample varies, t is infinite, or 0 if the means are equal.
    """
    means = [total / n for total, n in zip(sums, sizes, strict=True)]
    parts = [
        np.maximum(square / n - mean**2, 0.0) / (n - 1)
        for mean, square, n in zip(means, squares, sizes, strict=True)
    ]
    difference, variance = means[0] - means[1], parts[0] + parts[1]
    scale = max(float(np.abs(squares[0]).max()), float(np.abs(squares[1]).max()), 1e-300)
    difference[np.abs(difference) < 1e-9 * math.sqrt(scale)] = 0.0
    variance[variance < 1e-12 * scale] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(difference == 0, 0.0, difference / np.sqrt(variance))


def exchanges(sizes, rng):
    """Return ways to exchange the values of two samples of the given sizes.

    Returns
    -------
    ndarray, shape (values, ways)
        1 for each value that is in the first sample after the exchange, otherwise 0.
    bool
        True if these are all possible ways; otherwise they are random.
    """
    n, first = sum(sizes), sizes[0]
    if math.comb(n, first) <= RESAMPLES:
        chosen = np.array([*itertools.combinations(range(n), first)])
    else:
        chosen = np.argsort(rng.random((RESAMPLES, n)), axis=1)[:, :first]
    members = np.zeros((n, len(chosen)))
    members[chosen.T, np.arange(len(chosen))] = 1
    return members, math.comb(n, first) <= RESAMPLES


def draws(sizes, rng):
    """Return, for each sample, how often each bootstrap sample draws each of its n values.

    The arrays have shape ``(n, RESAMPLES)``.
    """
    return [rng.multinomial(n, np.full(n, 1 / n), RESAMPLES).T.astype(float) for n in sizes]


def p_by_test(samples, members, exact, drawn):
    """Return a dict that maps each test to the p-values of all pairs of samples.

    An array of p-values has shape ``(pairs,)``. The tests are ``exchange`` and ``bootstrap``
    (two-sided), and ``greater`` and ``less`` (one-sided ``exchange``). ``samples`` has an array for
    each of the two samples, shape ``(pairs, n)``. The other arguments are those of
    :func:`exchanges` and :func:`draws`.
    """
    sizes = [sample.shape[1] for sample in samples]
    both = np.concatenate(samples, axis=1)
    both = both - both.mean(axis=1, keepdims=True)
    # The first column leaves the labels as they are.
    ways = np.column_stack([np.arange(len(members)) < sizes[0], members])
    first = [values @ ways for values in (both, both**2)]
    whole = [values.sum(axis=1, keepdims=True) for values in (both, both**2)]
    parts = [(one, total - one) for one, total in zip(first, whole, strict=True)]
    exchanged = studentised(*parts, sizes)
    observed, exchanged = exchanged[:, :1], exchanged[:, 1:]

    def extreme(null, seen):
        return ((null >= seen) | np.isclose(null, seen, rtol=1e-9)).sum(axis=1)

    sides = {
        "exchange": (np.abs(exchanged), np.abs(observed)),
        "greater": (exchanged, observed),
        "less": (-exchanged, -observed),
    }
    counts = {side: extreme(*each) for side, each in sides.items()}
    ways = members.shape[1]
    p = {side: n / ways if exact else (1 + n) / (1 + ways) for side, n in counts.items()}
    shifted = [sample - sample.mean(axis=1, keepdims=True) for sample in samples]
    sums = [each @ places for each, places in zip(shifted, drawn, strict=True)]
    squares = [each**2 @ places for each, places in zip(shifted, drawn, strict=True)]
    null, seen = np.abs(studentised(sums, squares, sizes)), np.abs(observed)
    boot = (1 + extreme(null, seen)) / (1 + RESAMPLES)
    still = np.all([np.ptp(sample, axis=1) == 0 for sample in samples], axis=0)
    least = max(2 / math.comb(sum(sizes), sizes[0]), 1 / (1 + RESAMPLES))
    return p | {"bootstrap": np.where(still, np.where(seen[:, 0] > 0, least, 1.0), boot)}


def cell(name, sizes):
    """Return the share of rejected pairs of samples of a cell, by test and level.

    ``name`` is the name of the populations, and ``sizes`` are the sizes of the two samples.
    """
    rng = np.random.default_rng([SEED, [*POPULATIONS].index(name), *sizes])
    members, exact = exchanges(sizes, rng)
    drawn, found = draws(sizes, rng), []
    for _ in range(SAMPLES // AT_ONCE):
        each = zip(POPULATIONS[name], sizes, strict=True)
        samples = [population(rng, (AT_ONCE, n)) for population, n in each]
        found.append(pd.DataFrame(p_by_test(samples, members, exact, drawn)))
    rejected = pd.concat(found)
    row = {"population": name, "first": sizes[0], "second": sizes[1]}
    one_tailed = ("greater", "less") if name in ONE_TAILED else ()
    for test in ("exchange", "bootstrap", *one_tailed):
        row |= {f"{test} at {100 * level:g} %": (rejected[test] < level).mean() for level in SIDES}
    return row


def candidates(cells):
    """Return the number of cells in which each candidate rejects a true hypothesis too often."""
    small = cells[["first", "second"]].min(axis=1)
    rows = {}
    for name, limit in LIMITS.items():
        row = rows[name] = {}
        for level, most in SIDES.items():
            at = f"at {100 * level:g} %"
            shares = cells[f"exchange {at}"].where(small < limit, cells[f"bootstrap {at}"])
            row[f"too often {at}"] = int((shares > most).sum())
            row[f"largest {at}"] = float(shares.max())
        row["too often"] = sum(row[f"too often at {100 * level:g} %"] for level in SIDES)
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("candidate")


def main(folder):
    """Write both tables, and print the second."""
    folder.mkdir(parents=True, exist_ok=True)
    cells = pd.DataFrame([cell(*each) for each in itertools.product(POPULATIONS, SIZES)])
    cells.to_csv(folder / "cells.csv", index=False, float_format="%.5g")
    table = candidates(cells)
    table.to_csv(folder / "candidates.csv", float_format="%.5g")
    print(table.to_string())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
