"""False-positive rates of the signatures' tests: ``python -m analysis.signature_nulls [N]``.

Every row simulates N data sets (2000 by default) in which there is nothing to find, tests
each at 5 %, and prints the share of rejections with its exact binomial interval. The robot is
the paper's, postures scatter about the start of task ascending. Takes a few minutes.
"""

from __future__ import annotations

import sys
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy import stats

from analysis.signatures.context import lead_time, permutation_p
from analysis.signatures.locus import locus_slopes
from analysis.signatures.manifold import movable, subspaces, synergy
from coartic import load_task
from coartic.robot import Array

ALPHA = 0.05
SIMULATIONS = 2000
SEED = 20131
RESAMPLES = 199

_TASK = load_task("ascending")
_JOINTS = movable(_TASK, "right")
_POSTURE = _TASK.q0[_JOINTS] + np.array([0.0, 0.0, 0.3, -0.4, 0.5, 0.2])
_WHOLE = np.array(_TASK.q0)
_WHOLE[_JOINTS] = _POSTURE
_JACOBIAN = _TASK.robot.jacobian(_WHOLE, "right")[:, _JOINTS]
_NULLSPACE, _RANGE = subspaces(_JACOBIAN)

Scatter = Callable[[np.random.Generator, int], Array]


def normal(rng: np.random.Generator, n: int) -> Array:
    """Independent joints of equal variance."""
    return 0.05 * rng.standard_normal((n, len(_JOINTS)))


def correlated(rng: np.random.Generator, n: int) -> Array:
    """Unequal variances within either subspace, equal per dimension between them."""
    within = rng.standard_normal((n, 4)) * np.sqrt([2.5, 1.0, 0.4, 0.1])
    across = rng.standard_normal((n, 2)) * np.sqrt([1.8, 0.2])
    return 0.05 * (within @ _NULLSPACE.T + across @ _RANGE.T)


def heavy(rng: np.random.Generator, n: int) -> Array:
    """Joints with heavy tails (Student's t, 5 degrees of freedom)."""
    return 0.05 * rng.standard_t(5, (n, len(_JOINTS)))


def skewed(rng: np.random.Generator, n: int) -> Array:
    """Joints with one-sided tails (exponential)."""
    return 0.05 * rng.standard_exponential((n, len(_JOINTS)))


@dataclass(frozen=True)
class Null:
    """One way of having nothing to find."""

    name: str
    rejects: Callable[[np.random.Generator], bool]
    """Simulate once and test."""


def nulls() -> list[Null]:
    """Every test of a signature on every kind of scatter that it should stand."""
    found = []
    for scatter in (normal, correlated, heavy, skewed):
        kind = scatter.__name__
        for first, second in ((20, 20), (20, 8)):
            found.append(
                Null(
                    f"context dependence, {kind}, {first} and {second} runs",
                    partial(_context, scatter, first, second, None),
                )
            )
        for part, basis in (("motor-equivalent", _NULLSPACE), ("non-motor-equivalent", _RANGE)):
            found.append(Null(f"{part} part, {kind}", partial(_context, scatter, 20, 20, basis)))
        found.append(Null(f"lead time, {kind}", partial(_lead, scatter)))
        for runs in (10, 20):
            found.append(Null(f"ΔV z, {kind}, {runs} runs", partial(_synergy, scatter, runs)))
        found.append(Null(f"locus slope, {kind}", partial(_locus, scatter)))
    return found


def _context(
    scatter: Scatter, first: int, second: int, basis: Array | None, rng: np.random.Generator
) -> bool:
    groups = scatter(rng, first), scatter(rng, second)
    return permutation_p(*groups, rng, basis=basis, resamples=RESAMPLES) <= ALPHA


def _lead(scatter: Scatter, rng: np.random.Generator) -> bool:
    """Movements of 12 ticks from a common start: any lead at all is an error."""
    way = np.linspace(0.0, 1.0, 12)[:, None]
    groups = [way * scatter(rng, 20)[:, None, :] for _ in range(2)]
    jitter = [0.005 * rng.standard_normal(group.shape) for group in groups]
    first, second = (group + noise for group, noise in zip(groups, jitter, strict=True))
    return lead_time(first, second, rng, alpha=ALPHA, resamples=RESAMPLES) is not None


def _synergy(scatter: Scatter, runs: int, rng: np.random.Generator) -> bool:
    return synergy(_POSTURE + scatter(rng, runs), _JACOBIAN).p <= ALPHA


def _locus(scatter: Scatter, rng: np.random.Generator) -> bool:
    """Five tasks of four runs each; the first joint alone is looked at."""
    places = np.repeat(np.linspace(-1.0, 1.0, 5), 4)
    return locus_slopes(scatter(rng, len(places))[:, :1], places)[0].p <= ALPHA


def rate(null: Null, simulations: int, seed: int = SEED) -> tuple[float, float, float]:
    """Share of rejections and its exact 95 % interval."""
    rng = np.random.default_rng([seed, zlib.crc32(null.name.encode())])
    rejected = sum(bool(null.rejects(rng)) for _ in range(simulations))
    low, high = stats.binomtest(rejected, simulations).proportion_ci(0.95, method="exact")
    return rejected / simulations, float(low), float(high)


def main() -> None:
    """Print one line per null."""
    simulations = int(sys.argv[1]) if len(sys.argv) > 1 else SIMULATIONS
    print(f"{simulations} simulated nulls each, tested at {ALPHA:.0%}; interval at 95 %")
    for null in nulls():
        share, low, high = rate(null, simulations)
        mark = "" if low <= ALPHA <= high else "  below" if high < ALPHA else "  ABOVE"
        print(f"{null.name:55} {share:6.2%}  [{low:.2%}, {high:.2%}]{mark}", flush=True)


if __name__ == "__main__":
    main()
