"""How likely what is printed of a cell is under a reading, by the reading's own runs.

A cell's runs fall into hand sequences, and the runs of each have a mean and an SD. The counts
are multinomial; mean and SD are taken together, as they come out where as many runs as were
printed are drawn from ours with the same hands. All are probabilities of what is printed, rounded
as it is, so that they can be multiplied.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from coartic.analysis.reconstruction.scoring import Figure, Learned

DRAWS = 2_000
"""Samples of runs from which the distribution of mean and SD is estimated."""
FEWEST = 20
"""Runs with a hand sequence below which nothing is said about its mean and SD."""


@dataclass(frozen=True)
class Likelihood:
    """How likely something printed is."""

    what: str
    log_chance: float
    """Natural logarithm of its probability."""
    p: float
    """Chance of something as unlikely as this or less likely."""


def likelihoods(figures: Sequence[Figure], learned: Learned) -> list[Likelihood]:
    """Of the counts of a cell, and of mean and SD of each group of runs that are printed.

    A group with fewer than FEWEST of our runs is left out: that they are few lowers the
    likelihood of the counts, and that runs fail is a part of its own.
    """
    shares = [figure for figure in figures if figure.kind == "share"]
    found = [_of_counts(shares, learned)] if shares else []
    spreads = {figure.hands: figure for figure in figures if figure.kind == "sd"}
    for mean in figures:
        if mean.kind != "mean":
            continue
        rewards = learned.with_hands(mean.hands)
        if mean.hands is None and learned.failed:
            found.append(_of_failures(mean, learned))
        if len(rewards) >= FEWEST:
            found.append(_of_group(mean, spreads.get(mean.hands), rewards))
    return found


def _of_failures(mean: Figure, learned: Learned) -> Likelihood:
    """Of as many runs as are printed, none fails."""
    chance = ((len(learned.hands) + 0.5) / (learned.runs + 1.0)) ** mean.runs
    return Likelihood(f"{mean.condition}: all {mean.runs} complete", math.log(chance), chance)


def of_gain(gain: float, initial: float, mean: Figure) -> Likelihood | None:
    """Of a printed gain over the initial solution, given the printed mean; None if certain.

    Both are rounded from one mean: where it rounds to what is printed, the initial reward
    decides the gain but for a mean on the border.
    """
    words = f"{mean.condition} gain of {gain:g} over {initial:g}"
    border = 0.5 * 10.0**-mean.digits
    lowest, highest = mean.value - border, mean.value + border
    fits = max(0.0, min(highest, initial + gain + 0.5) - max(lowest, initial + gain - 0.5))
    if fits > 1e-9:
        share = fits / (highest - lowest)
        if share > 1.0 - 1e-9:
            return None
        return Likelihood(words, math.log(share), share)
    # On the border: means of n runs are multiples of 1 / n.
    touches = abs(highest - (initial + gain - 0.5)) < 1e-9
    touches |= abs(lowest - (initial + gain + 0.5)) < 1e-9
    chance = 1.0 / mean.runs if touches else 1e-9
    return Likelihood(words, math.log(chance), chance)


def together(parts: Sequence[Likelihood]) -> Likelihood:
    """All parts as one, by Fisher's method; they are independent."""
    p = stats.combine_pvalues([max(part.p, 1e-300) for part in parts]).pvalue
    return Likelihood("all", sum(part.log_chance for part in parts), float(p))


def _of_counts(shares: Sequence[Figure], learned: Learned) -> Likelihood:
    """Multinomial, of printed sequences and all others; half a run more is added to each."""
    runs = shares[0].runs
    printed = [round(share.value * runs) for share in shares]
    own = [sum(hands == share.hands for hands in learned.hands) for share in shares]
    printed, own = [*printed, runs - sum(printed)], [*own, learned.runs - sum(own)]
    chances = (np.array(own) + 0.5) / (sum(own) + 0.5 * len(own))
    model = stats.multinomial(runs, chances)
    log_chance = float(model.logpmf(printed))
    drawn = model.logpmf(model.rvs(100_000, random_state=np.random.default_rng(0)))
    words = ", ".join(
        f"{share.hands} {count}" for share, count in zip(shares, printed, strict=False)
    )
    p = (1 + np.sum(drawn <= log_chance + 1e-9)) / (1 + len(drawn))
    return Likelihood(f"{shares[0].condition} counts: {words} of {runs}", log_chance, float(p))


def _of_group(mean: Figure, sd: Figure | None, rewards: np.ndarray) -> Likelihood:
    """Kernel estimate of the chance that mean and SD are rounded to what is printed.

    Spread evenly over a unit of the last printed digit, samples have as their density at the
    printed figures the share of those that round to them, over the size of that unit.
    """
    rng = np.random.default_rng(0)
    drawn = rng.choice(rewards, size=(2 * DRAWS, mean.runs))
    printed = [(mean, drawn.mean(axis=1))]
    if sd is not None:
        printed.append((sd, drawn.std(axis=1, ddof=1)))
    units = np.array([10.0**-figure.digits for figure, _ in printed])
    values = np.array([sample for _, sample in printed])
    values += units[:, None] * rng.uniform(-0.5, 0.5, values.shape)
    # Density from one half of the samples, its distribution from the other.
    fitted, judged = np.split(values, 2, axis=1)
    density = stats.gaussian_kde(fitted)
    log_density = float(density.logpdf([figure.value for figure, _ in printed])[0])
    below = np.sum(density.logpdf(judged) <= log_density)
    words = f"{mean.condition} {mean.hands or 'all'}: {mean.value:g}"
    words += "" if sd is None else f" ± {sd.value:g}"
    return Likelihood(
        words,
        log_density + float(np.log(units).sum()),
        float((1 + below) / (1 + judged.shape[1])),
    )
