"""Readings before what is printed of the one-armed tasks, whose goals are printed as well.

The rule: a printed constant stands unless the printed results refute it. They refute a reading
under which something as unlikely as what is printed comes out less often than REFUTED, by the
reading's own runs.

A cell's runs fall into hand sequences, and the runs of each have a mean and an SD. The counts
are multinomial; mean and SD are taken together, as they come out where as many runs as were
printed are drawn from ours with the same hands. All are probabilities of what is printed, rounded
as it is, so that they can be multiplied.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from coartic import Task, builtin_tasks, corrective_trial, load_task
from coartic.analysis.topics.paper.published import entries_of
from coartic.robot import Array
from coartic.tasks.readings import condition_under, load_readings, model_under, readings
from coartic.threads import threads_for
from reconstruction.scoring import (
    Figure,
    conditions_of,
    learn_cell,
    learned_rewards,
    printed_tests,
)

REFUTED = 0.01  # chance below which a reading is refuted
DRAWS = 2_000  # samples of runs from which the distribution of mean and SD is estimated
FEWEST = 20  # runs with a hand sequence below which nothing is said about its mean and SD
JUDGING_SEEDS = 900_000_000  # seeds of runs that judge a reading begin here


class Likelihood(NamedTuple):
    """How likely something printed is."""

    what: str
    log_chance: float
    """Natural logarithm of its probability."""
    p: float
    """Chance of something as unlikely as this or less likely."""


def combinations(pairs: bool) -> Iterator[tuple[str, ...]]:
    """The default, each other choice alone, and two of different readings together.

    Every two of what the text says at its word; with ``pairs`` every two.
    """
    yield ()
    choices = {
        f"{reading.id}={choice.written}": choice.printed
        for reading in readings()
        for choice in reading.alternatives
    }
    yield from ((choice,) for choice in choices)
    for first, second in itertools.combinations(choices, 2):
        different = first.partition("=")[0] != second.partition("=")[0]
        if different and (pairs or (choices[first] and choices[second])):
            yield first, second


def judge_readings(
    combined: Iterable[Sequence[str]],
    *,
    runs: int,
    trials: int = 10_000,
    jobs: int = 2,
    progress: Callable[[str, float], None] = lambda readings, p: None,
) -> pd.DataFrame:
    """A row a combination of readings, as ``ties=right``, by runs with the same seeds for all.

    The reward of each initial solution, figures of the runs, p of everything that is printed,
    their likelihood and p together, and the verdict. On threads.
    """

    def perform(texts: Sequence[str]) -> tuple[dict[str, Any], list[Any]]:
        row, rewards = judge_reading(texts, runs=runs, trials=trials)
        progress(row["readings"], row["p"])
        return row, rewards

    with ThreadPoolExecutor(threads_for(jobs)) as pool:
        judged = list(pool.map(perform, combined))
    default = [rewards for row, rewards in judged if row["readings"] == "default"]
    for row, rewards in judged:
        if row["verdict"] == "stands" and row["readings"] != "default" and rewards in default:
            row["verdict"] = "as the default"  # one arm, or these figures, cannot tell them
    return pd.DataFrame([row for row, _ in judged])


def judge_reading(
    texts: Sequence[str], *, runs: int, trials: int
) -> tuple[dict[str, Any], list[Any]]:
    """A combination's row, and every reward behind it."""
    chosen = load_readings(texts)
    model, fields = model_under(chosen), condition_under(chosen)
    row: dict[str, Any] = {"readings": " ".join(map(str, chosen)) or "default"}
    initial: dict[str, int | None] = {}
    cells: dict[str, pd.DataFrame] = {}
    parts: list[Likelihood] = []
    for task in one_armed():
        reward = corrective_trial(task, task.initial_hands, model=model).reward
        initial[f"{task.name} initial"] = reward
        for name, condition in conditions_of(task.name, fields).items():
            seeds = range(JUDGING_SEEDS, JUDGING_SEEDS + runs)
            cell = learn_cell(task, condition, seeds, model=model, trials=trials)
            cells[f"{task.name}/{name}"] = cell
            figures = [test for test in printed_tests(task.name) if isinstance(test, Figure)]
            of_cell = likelihoods(figures, cell)
            for gain in entries_of(task.name, "test"):
                if gain.kind == "gain" and reward is not None:
                    mean = next(figure for figure in figures if figure.kind == "mean")
                    of_cell += likelihood_of_gain(float(gain.value), reward, mean)
            parts += [part._replace(what=f"{task.name} {part.what}") for part in of_cell]
    if None in initial.values():
        parts.append(Likelihood("the initial solution fails", -math.inf, 0.0))
    row |= initial
    rewards = {name: learned_rewards(cell) for name, cell in cells.items()}
    for name, values in rewards.items():
        some = len(values) > 1
        row[f"{name} runs"] = len(values)
        row[f"{name} mean"] = round(float(values.mean()), 2) if some else math.nan
        row[f"{name} sd"] = round(float(values.std(ddof=1)), 2) if some else math.nan
    row |= {f"p: {part.what}": float(f"{part.p:.3g}") for part in parts}
    joint = together(parts)
    row |= {"log likelihood": round(joint.log_chance, 2), "p": float(f"{joint.p:.3g}")}
    row["verdict"] = "refuted" if joint.p < REFUTED else "stands"
    return row, [initial, *(values.tolist() for values in rewards.values())]


def one_armed() -> tuple[Task, ...]:
    """The tasks whose goals are printed."""
    tasks = map(load_task, builtin_tasks())
    return tuple(task for task in tasks if "goals" not in task.reconstructed)


def likelihoods(figures: Sequence[Figure], runs: pd.DataFrame) -> list[Likelihood]:
    """Likelihoods of the counts of a cell, and of the printed mean and SD of each group of runs.

    A group with fewer than FEWEST of our runs is left out: that they are few lowers the
    likelihood of the counts, and that runs fail is a part of its own.
    """
    shares = [figure for figure in figures if figure.kind == "share"]
    parts = [likelihood_of_counts(shares, runs)] if shares else []
    spreads = {figure.hands: figure for figure in figures if figure.kind == "sd"}
    for mean in figures:
        if mean.kind != "mean":
            continue
        rewards = learned_rewards(runs, mean.hands)
        if mean.hands is None and len(rewards) < len(runs):
            chance = ((len(rewards) + 0.5) / (len(runs) + 1.0)) ** mean.runs
            words = f"{mean.condition}: all {mean.runs} complete"
            parts.append(Likelihood(words, math.log(chance), chance))
        if len(rewards) >= FEWEST:
            parts.append(likelihood_of_group(mean, spreads.get(mean.hands), rewards))
    return parts


def likelihood_of_gain(gain: float, initial: float, mean: Figure) -> list[Likelihood]:
    """Likelihood of a printed gain on the initial reward, given the printed mean; none if certain.

    Both are rounded from one mean: where it rounds to what is printed, the initial reward
    decides the gain but for a mean on the border.
    """
    border = 0.5 * 10.0**-mean.digits
    lowest, highest = mean.value - border, mean.value + border
    fits = max(0.0, min(highest, initial + gain + 0.5) - max(lowest, initial + gain - 0.5))
    chance = fits / (highest - lowest)
    if chance > 1.0 - 1e-9:
        return []
    if fits <= 1e-9:  # on the border: means of n runs are multiples of 1 / n
        touches = abs(highest - (initial + gain - 0.5)) < 1e-9
        touches |= abs(lowest - (initial + gain + 0.5)) < 1e-9
        chance = 1.0 / mean.runs if touches else 1e-9
    words = f"{mean.condition} gain of {gain:g} over {initial:g}"
    return [Likelihood(words, math.log(chance), chance)]


def together(parts: Sequence[Likelihood]) -> Likelihood:
    """All parts as one, by Fisher's method; they are independent."""
    p = stats.combine_pvalues([max(part.p, 1e-300) for part in parts]).pvalue
    return Likelihood("all", sum(part.log_chance for part in parts), float(p))


def likelihood_of_counts(shares: Sequence[Figure], runs: pd.DataFrame) -> Likelihood:
    """Multinomial, of printed sequences and all others; half a run more is added to each."""
    size = shares[0].runs
    printed = [round(share.value * size) for share in shares]
    ours = [len(learned_rewards(runs, share.hands)) for share in shares]
    words = ", ".join(f"{s.hands} {count}" for s, count in zip(shares, printed, strict=True))
    printed, ours = [*printed, size - sum(printed)], [*ours, len(runs) - sum(ours)]
    chances = (np.array(ours) + 0.5) / (sum(ours) + 0.5 * len(ours))
    model = stats.multinomial(size, chances)
    log_chance = float(model.logpmf(printed))
    drawn = model.logpmf(model.rvs(100_000, random_state=np.random.default_rng(0)))
    p = (1 + np.sum(drawn <= log_chance + 1e-9)) / (1 + len(drawn))
    return Likelihood(f"{shares[0].condition} counts: {words} of {size}", log_chance, float(p))


def likelihood_of_group(mean: Figure, sd: Figure | None, rewards: Array) -> Likelihood:
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
    p = float((1 + below) / (1 + judged.shape[1]))
    return Likelihood(words, log_density + float(np.log(units).sum()), p)
