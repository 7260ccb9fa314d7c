"""What the rules can find: chances of their verdicts if the paper's numbers are exactly right.

Runs are drawn as the paper prints them: hand sequences by their counts, rewards as normal with the
printed mean and SD (of replays too, of which none are printed). Where only p < 0.01 is printed,
the difference is taken to be the least that gives it. Tests of means are Welch's here, which agree
with the bootstrap's in such samples and take no time; tests of counts are the exact ones.

*If the paper is right*, all claims of a family are drawn together and corrected together, those
without printed numbers with p = 1. *If the contrary holds*, one claim's numbers lie as far on the
other side of its bound as the printed ones lie on theirs, and nothing else is contrary.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats

from coartic.analysis.claims.register import Claim, Correction
from coartic.analysis.claims.rules import (
    FEW,
    MOST,
    Side,
    counted_hands,
    half_p,
    printed_count,
    printed_known,
    sides,
    unlike_p,
)
from coartic.analysis.methods import LEARNER
from coartic.analysis.printed import ENTRIES, Order
from coartic.analysis.published import RUNS, published_cell
from coartic.analysis.statistics.estimates import FEWEST, LEVEL, SEED
from coartic.analysis.statistics.hypotheses import holm_rows, independence_test, share_p
from coartic.analysis.statistics.instances import chance
from coartic.analysis.statistics.power import POWER
from coartic.analysis.statistics.spread import sd
from coartic.robot import Array

SIMULATIONS = 2_000
"""Of the paper's experiments; a chance is known within ± 2 % or better."""
TRIED = (20, 30, 40, 60, 80, 100, 150)
"""Numbers of runs a cell that :func:`runs_needed` tries."""

Sizes = Mapping[tuple[str, str], int]
_remembered = lru_cache(maxsize=256)
"""Folders of as many runs have the same chances."""


@dataclass(frozen=True)
class _Drawn:
    """Runs of one cell, as many times as there are simulations."""

    names: tuple[str, ...]
    """Hand sequences; one nameless where none is printed."""
    which: NDArray[np.int64]
    """Index of each run's sequence, shape ``(simulations, runs)``."""
    rewards: Array


class Chances(NamedTuple):
    """Of the verdicts of one claim."""

    supported: float
    """If the paper is exactly right."""
    refuted: float
    """Of *not supported*, if the contrary holds."""


def powers(claims: Iterable[Claim], runs: Sizes) -> dict[str, Chances]:
    """Chances of the claims whose rule takes what the paper prints, by id.

    ``claims`` make up the families; ``runs`` are those of each task and label. A cell that is not
    there is taken with the paper's 20 runs.
    """
    claims = tuple(claims)
    sizes = {(task, label.removeprefix(LEARNER)): n for (task, label), n in runs.items()}
    found: dict[str, Chances] = {}
    corrections: tuple[Correction, ...] = "paper", "beside"
    for correction in corrections:
        family = [c for c in claims if c.tested and c.correction == correction]
        drawn = {claim.id: _drawn_p(claim, sizes) for claim in family}
        known = {name: p for name, p in drawn.items() if p is not None}
        if not known:
            continue
        passed = holm_rows(np.column_stack([p[0] for p in known.values()]), len(family)) < LEVEL
        for place, (name, (_, contrary)) in enumerate(known.items()):
            p, weights = contrary
            refuted = min(1.0, float(weights[p * len(family) < LEVEL].sum()))
            found[name] = Chances(float(passed[:, place].mean()), refuted)
    return found


def seen_over_instances(samples: Sequence[Array], family: int) -> float:
    """Least true mean of all samples with which their claim has power :data:`POWER`.

    Of values of instances (n,), less their bound, in their unit. By the SDs that the samples show,
    for t-tests at the level that Holm's correction leaves the last of ``family`` claims, as if the
    tests were of different instances: those of the same ones agree more often. NaN where none
    varies, infinite where it is more than a hundred times the largest SD.
    """
    known = [(sd(values), len(values)) for values in samples]

    def short_of(effect: float) -> float:
        chances = [chance(effect, spread, n, LEVEL / family, tails=1) for spread, n in known]
        return math.prod(chances) - POWER

    most = 100 * max(spread for spread, _ in known)
    if not most > 0:
        return math.nan
    return float(optimize.brentq(short_of, 0.0, most)) if short_of(most) > 0 else math.inf


def runs_needed(claims: Sequence[Claim]) -> dict[str, int | None]:
    """Fewest of :data:`TRIED` runs a cell for which both chances are :data:`POWER`, by claim.

    None: more than the most that are tried.
    """
    needed: dict[str, int | None] = {}
    for n in TRIED:
        every = {(task, LEARNER + name): n for task, name in _cells(claims)}
        for name, chances in powers(claims, every).items():
            if needed.get(name) is None:
                needed[name] = n if min(chances) >= POWER else None
    return needed


def _cells(claims: Iterable[Claim]) -> Iterable[tuple[str, str]]:
    for claim in claims:
        for task, pairs in claim.pairs.items():
            for side in (side for pair in pairs for side in sides(pair)):
                yield task, side.name
        for task, text in claim.runs.items():
            yield task, counted_hands(text)[0]


Drawn = tuple[Array, tuple[Array, Array]]
"""p-values (simulations,) if the paper is right; p-values of the contrary and their weights."""


def _drawn_p(claim: Claim, sizes: Sizes) -> Drawn | None:
    if claim.rule == "higher":
        parts = [
            _mean_p(task, *pair, *(_size(sizes, task, side.name) for side in pair))
            for task, pairs in claim.pairs.items()
            for pair in map(sides, pairs)
        ]
        known = [p for p in parts if p is not None]
        if len(known) < len(parts):
            return None
        p = np.array(known)
        # Mirrored about 0, the contrary's p-values are distributed as these are.
        contrary = np.minimum(1.0, p.min(axis=0) * len(p))
        return p.max(axis=0), (contrary, np.full(SIMULATIONS, 1 / SIMULATIONS))
    if claim.rule in ("most", "few", "about"):
        ((task, text),) = claim.runs.items()
        return _share_p(claim.rule, task, text, _size(sizes, task, counted_hands(text)[0]))
    if claim.rule == "differ":
        ((task, text),) = claim.runs.items()
        names = text.split()
        return _differ_p(task, *((name, _size(sizes, task, name)) for name in names))
    return None


def _size(sizes: Sizes, task: str, name: str) -> int:
    return sizes.get((task, name), RUNS)


@_remembered
def _differ_p(task: str, *named: tuple[str, int]) -> Drawn | None:
    """``named``: conditions with their runs."""
    cells = [_draw(task, name, runs) for name, runs in named]
    if None in cells:
        return None
    names = sorted({name for cell in cells if cell for name in cell.names})
    counts = [_counts(cell, names) for cell in cells if cell]
    tables, of_table = np.unique(np.stack(counts, 1), axis=0, return_inverse=True)
    p = np.array([independence_test(*table.tolist()).p for table in tables])
    # The contrary: both keep one sequence in all runs, one of the two things that refute it.
    kept = max(float(share_p(n, n, MOST, "greater")) for n in tables[0].sum(axis=1))
    return p[of_table.ravel()], (np.array([2 * kept]), np.ones(1))


def _counts(cell: _Drawn, names: list[str]) -> NDArray[np.int64]:
    """Runs by sequence, shape ``(simulations, names)``."""
    own = [cell.names.index(name) if name in cell.names else -1 for name in names]
    return np.stack([(cell.which == index).sum(axis=1) for index in own], axis=1)


@_remembered
def _share_p(rule: str, task: str, text: str, n: int) -> Drawn | None:
    condition, hands, inverse = counted_hands(text)
    drawn = _draw(task, condition, n)
    if drawn is None or hands not in drawn.names:
        return None
    seen = drawn.which == drawn.names.index(hands)
    counts = (~seen if inverse else seen).sum(axis=1)
    (count, total) = printed_count(task, condition, hands)
    share = 1 - count / total if inverse else count / total
    every = np.arange(n + 1)
    if rule == "about":
        bound = FEW if share - FEW < MOST - share else MOST
        p = half_p(every, n)
        outside = (every <= FEW * n) | (every >= MOST * n)
        contrary = np.ones(n + 1)
        contrary[outside] = [unlike_p((k, n), (count, total)) for k in every[outside].tolist()]
    else:
        bound, most = MOST, rule == "most"
        p, contrary = share_p(every, n, MOST, "greater"), share_p(every, n, MOST, "less")
        p, contrary = (p, contrary) if most else (contrary, p)
    mirrored = min(1.0, max(0.0, 2 * bound - share))
    return p[counts], (contrary, stats.binom.pmf(every, n, mirrored))


@_remembered
def _mean_p(task: str, first: Side, second: Side, runs: int, others: int) -> Array | None:
    """One-tailed p-values that the first is higher; None where nothing is printed."""
    bound = _printed_bound(task, first, second)
    cell = published_cell(task, first.name)
    if bound is not None and (cell is None or cell.summary is None):
        return _least_p(bound, _rng(task, first, second), min(runs, others))
    a = _moments(task, first, runs)
    if second.known:
        number = printed_known(task, second)
        if a is None or number is None:
            return None
        n, mean, variance = a
        p = special.stdtr(n - 1, -(mean - number) / np.sqrt(variance / n))
        return np.where(n < FEWEST, 1.0, p)
    b = _moments(task, second, others)
    if a is None or b is None:
        return None
    return np.where(np.minimum(a[0], b[0]) < FEWEST, 1.0, welch_p(*a, *b))


def _least_p(bound: float, rng: np.random.Generator, runs: int) -> Array:
    """p-values where the true difference is the least that the paper's runs show with a bound."""
    if runs < FEWEST:
        return np.ones(SIMULATIONS)
    shift = stats.t.isf(bound, 2 * RUNS - 2) * np.sqrt(runs / RUNS)
    freedom = 2 * runs - 2
    scale = np.sqrt(rng.chisquare(freedom, SIMULATIONS) / freedom)
    return np.asarray(special.stdtr(freedom, -rng.normal(shift, 1, SIMULATIONS) / scale))


def welch_p(n: Any, mean: Any, variance: Any, m: Any, other: Any, spread: Any) -> Array:
    """One-tailed p of Welch's t-test that ``mean`` of n values is above ``other`` of m."""
    one, two = variance / n, spread / m
    freedom = (one + two) ** 2 / (one**2 / (n - 1) + two**2 / (m - 1))
    return np.asarray(special.stdtr(freedom, (other - mean) / np.sqrt(one + two)))


def _moments(task: str, side: Side, runs: int) -> tuple[Array, Array, Array] | None:
    """Number, mean and variance of the runs on one side, each of shape ``(simulations,)``."""
    drawn = _draw(task, side.name, runs)
    if drawn is None or (side.hands and side.hands not in drawn.names):
        return None
    own = np.ones_like(drawn.which, dtype=bool)
    if side.hands:
        own = drawn.which == drawn.names.index(side.hands)
    n = np.maximum(own.sum(axis=1), 2)  # fewer are not tested
    mean = np.where(own, drawn.rewards, 0.0).sum(axis=1) / n
    variance = np.where(own, (drawn.rewards - mean[:, None]) ** 2, 0.0).sum(axis=1) / (n - 1)
    return n, mean, np.maximum(variance, 1e-12)


@lru_cache(maxsize=64)
def _draw(task: str, condition: str, runs: int) -> _Drawn | None:
    """Runs of a cell as printed; None where no mean and SD are."""
    cell = published_cell(task, condition)
    if cell is not None and cell.summary is None and cell.remark:
        return _draw(task, cell.remark.removeprefix("higher than "), runs)  # at least so good
    if cell is None or cell.summary is None:
        return None
    parts = [(s.hands, s.summary) for s in cell.sequences] or [("", cell.summary)]
    names, summaries = zip(*parts, strict=True)
    if any(s.sd is None for s in summaries):
        return None
    shares = np.array([s.runs for s in summaries], dtype=np.float64)
    rng = _rng(task, condition, runs)
    which = rng.choice(len(names), size=(SIMULATIONS, runs), p=shares / shares.sum())
    means, sds = (np.array([getattr(s, of) for s in summaries]) for of in ("mean", "sd"))
    rewards = means[which] + sds[which] * rng.normal(size=which.shape)
    return _Drawn(names, which, rewards)


def _printed_bound(task: str, first: Side, second: Side) -> float | None:
    """Printed bound of the p-value of a comparison, where there is one."""
    for entry in ENTRIES.values():
        if isinstance(entry, Order) and entry.task == task and entry.p_below is not None:
            named = ((entry.condition, entry.hands), (entry.than.condition, entry.than.hands))
            if named == tuple((side.name, side.hands or None) for side in (first, second)):
                return float(entry.p_below)
    return None


def _rng(*of: object) -> np.random.Generator:
    return np.random.default_rng([SEED, zlib.crc32(" ".join(map(str, of)).encode())])
