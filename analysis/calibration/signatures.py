"""What the signatures' tests and intervals do: ``python -m
coartic.analysis.calibration.signatures``.

Every row simulates 2000 data sets and prints a share with its exact binomial interval. Nulls:
nothing to find, tested at 5 %, how often a test rejects. Planted effects: of a known size, how
often it is found. Intervals: of nominal 95 %, how often they hold the true value. The robot is
the paper's, postures scatter about the start of task ascending. Takes some three minutes.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterator
from functools import cache, partial
from importlib import import_module

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from coartic import Movement, corrective_trial, execute, hand_sequences, load_task
from coartic.analysis.calibration.simulation import Check, Draw, simulate
from coartic.analysis.signatures.context import lead_time, permutation_p
from coartic.analysis.signatures.locus import locus_slopes, slope_norm
from coartic.analysis.signatures.manifold import movable, subspaces, synergy
from coartic.analysis.signatures.subtasks import ROUNDING, change_from, sacrifice_p, sacrifices
from coartic.analysis.signatures.trajectories import entropy
from coartic.analysis.statistics import intervals
from coartic.analysis.statistics.estimates import LEVEL
from coartic.analysis.statistics.intervals import Interval
from coartic.robot import Array

ALPHA = LEVEL
SIMULATIONS = 2000
SEED = 20131
RESAMPLES = 199

_TASK = load_task("ascending")
_JOINTS = movable(_TASK, "right")
_POSTURE = _TASK.q0[_JOINTS] + np.array([0.0, 0.0, 0.3, -0.4, 0.5, 0.2])
_WHOLE = np.array(_TASK.q0)
_WHOLE[_JOINTS] = _POSTURE
JACOBIAN = _TASK.robot.jacobian(_WHOLE, "right")[:, _JOINTS]
NULLSPACE, RANGE = subspaces(JACOBIAN)
_SD = 0.05  # of a joint over runs

Family = Callable[[np.random.Generator], tuple[Array, Array]]
"""Draws postures of a family of tasks, shape ``(n, k)``, and the position of each."""
Infer = Callable[[np.random.Generator], Interval]
Seen = Callable[[np.random.Generator], bool]


def correlated(rng: np.random.Generator, n: int) -> Array:
    """Unequal variances within either subspace, equal per dimension between them."""
    within = rng.standard_normal((n, 4)) * np.sqrt([2.5, 1.0, 0.4, 0.1])
    across = rng.standard_normal((n, 2)) * np.sqrt([1.8, 0.2])
    return _SD * (within @ NULLSPACE.T + across @ RANGE.T)


SCATTERS: dict[str, Draw] = {
    "normal": lambda rng, n: _SD * rng.standard_normal((n, len(_JOINTS))),
    "correlated": correlated,
    "heavy": lambda rng, n: _SD * rng.standard_t(5, (n, len(_JOINTS))),
    "skewed": lambda rng, n: _SD * rng.standard_exponential((n, len(_JOINTS))),
}
"""Of joints over runs, independent and of equal variance but for one; heavy tails are Student's
with 5 degrees of freedom, skewed ones exponential."""
_PARTS = {"motor-equivalent part": NULLSPACE, "non-motor-equivalent part": RANGE}
TICKS: dict[str, Draw] = {
    "normal": lambda rng, n: 5.0 * rng.standard_normal(n),
    "skewed": lambda rng, n: 5.0 * (rng.standard_exponential(n) - 1.0),
    "skewed the other way": lambda rng, n: 5.0 * (1.0 - rng.standard_exponential(n)),
    "two levels (70 and 30 %)": lambda rng, n: np.where(rng.random(n) < 0.3, 7.0, -3.0),
}
"""Ticks of a subtask about their mean, SD about 5, as the learner's over runs on ascending."""
PLACES = np.linspace(-1.5, 1.0, 6)
"""Positions of a moving goal, as in suite ``locus``."""
LOCI: dict[str, tuple[float, float, tuple[int, ...]]] = {
    "": (0.0, 0.0, (20,) * 6),
    ", clusters": (2.0, 0.0, (20,) * 6),
    ", curved": (0.0, 4.0, (20,) * 6),
    ", clusters, uneven": (2.0, 0.0, (20, 20, 20, 60, 20, 20)),
    ", one run each": (0.0, 0.0, (1,) * 6),
}
"""What else there may be in a family of tasks: SD of what the runs of one task share and height
of a parabola without slope, both in SDs of a joint, and runs of each task."""
VALUES: dict[str, tuple[Draw, float]] = {
    "normal": (lambda rng, n: rng.standard_normal(n), 0.0),
    "skewed (exponential)": (lambda rng, n: rng.standard_exponential(n), 1.0),
    "counts (Poisson, 0.5)": (lambda rng, n: rng.poisson(0.5, n).astype(np.float64), 0.5),
    "counts (Poisson, 0.1)": (lambda rng, n: rng.poisson(0.1, n).astype(np.float64), 0.1),
    "two levels (70 and 30 %)": (
        lambda rng, n: 3.0 * (rng.random(n) < 0.3) + 0.5 * rng.standard_normal(n),
        0.9,
    ),
}
"""Values of one run as signatures have them, with their true mean."""


def tests(*, planted: bool) -> list[Check]:
    """Every test of a signature on every kind of scatter: without an effect, or with one.

    Planted shifts between contexts are of 1.25 SD of a joint, in a direction that leaves the hand
    in place (non-motor-equivalent part: that moves it). ΔV z: standard deviations that move the
    hand are half, or twice, the others. Locus: 1 SD of a joint per length unit (4 where a family
    is not plain, :data:`LOCI`). Sacrifice: the first subtask is 5 ticks longer, its SD, and the
    whole 7 shorter, its SD.
    """
    found: list[Check] = []

    def add(subject: str, data: str, seen: Seen) -> None:
        found.append(Check(subject, data, seen, None if planted else ALPHA))

    away = {name: 1.25 * _SD * basis[:, 0] * planted for name, basis in _PARTS.items()}
    still = away["motor-equivalent part"]
    ratios = ((20, 0.5), (20, 2.0)) if planted else ((10, 1.0), (20, 1.0))
    for kind, scatter in SCATTERS.items():
        for second in (20, 8):
            context = partial(_context, scatter, still, second, None)
            add("context dependence", f"{kind}, 20 and {second} runs", context)
        for part, basis in _PARTS.items():
            add(part, kind, partial(_context, scatter, away[part], 20, basis))
        add("lead time", f"any, {kind}" if planted else kind, partial(_lead, scatter, still))
        for runs, ratio in ratios:
            size = f", {ratio:g} of the SD" if planted else ""
            rejects = _rejects(partial(_synergy, scatter, runs, ratio))
            add("ΔV z", f"{kind}, {runs} runs{size}", rejects)
        for what in LOCI:
            slope = (4.0 if what else 1.0) * _SD if planted else 0.0
            family = _family(scatter, slope, what)
            add("locus slope", f"{kind}{what}", _rejects(partial(_slope, family)))
            add("locus slope norm", f"{kind}{what}", _rejects(partial(_norm, family)))
    for kind, draw in TICKS.items():
        if planted:
            add("sacrifice", kind, partial(_sacrifice, draw, 5.0, -7.0))
        else:
            threshold = f"{kind}, first at the threshold"
            add("sacrifice", threshold, partial(_sacrifice, draw, ROUNDING, -30.0))
            add("sacrifice", f"{kind}, whole as before", partial(_sacrifice, draw, 30.0, 0.0))
    if not planted:
        add("sacrifice", "no regard for later goals", _shortsighted)
    return found


def single() -> list[Check]:
    """The yes or no of one run where there is nothing, and where there is something."""
    drawn: dict[str, Callable[[np.random.Generator], ArrayLike]] = {
        # The corrective process with hands at random, a tick more or less in every subtask.
        "other hands, ± a tick": lambda rng: rng.integers(-1, 2, size=4),
        "no regard for later goals": lambda rng: rng.choice(_without_regard()),
        "+7 of ± 5, -16 of ± 7 ticks": lambda rng: np.round(
            [7.0, -23.0] + 5.0 * rng.standard_normal(2)
        ),
    }
    check = partial(Check, "first subtask sacrificed")
    return [check(data, partial(_sacrificing, draw)) for data, draw in drawn.items()]


def coverage() -> Iterator[Check]:
    """Every interval of a signature, by kind of value: whether it holds the true one."""
    check = partial(Check, nominal=1 - ALPHA)
    for name, (draw, mean) in VALUES.items():
        for runs in (10, 20):
            yield check("mean", f"{name}, {runs} runs", _holds(partial(_mean, draw, runs), mean))
    for chance in (0.5, 0.9, 0.98):
        for runs in (10, 20):
            held = _holds(partial(_share, chance, runs), chance)
            yield check("share", f"of {chance:g}, {runs} runs", held)
    neutral = 0.5 * math.log(NULLSPACE.shape[1] / RANGE.shape[1])
    for kind, scatter in SCATTERS.items():
        for ratio in (1.0, 0.5):
            held = _holds(partial(_synergy, scatter, 20, ratio), neutral - math.log(ratio))
            yield check("ΔV z", f"{kind}, 20 runs, {ratio:g} of the SD", held)
        for what in LOCI:
            held = _holds(partial(_slope, _family(scatter, _SD, what)), _SD)
            yield check("locus slope", f"{kind}{what}", held)


def _rejects(infer: Infer) -> Seen:
    return lambda rng: infer(rng).p <= ALPHA


def _holds(infer: Infer, truth: float) -> Seen:
    return lambda rng: (found := infer(rng)).low <= truth <= found.high


def seed_of(seed: int, number: int, check: Check) -> list[int]:
    """A seed of its own for each check, whatever else is simulated."""
    return [seed, zlib.crc32(check.name.encode())]


def entropies(simulations: int, seed: int = SEED) -> list[tuple[float, float]]:
    """True hand entropy, bit, and the mean of its estimate by 20 runs, for three distributions.

    It has no interval: where every run has the same hands, nothing says what else there is.
    """
    found = []
    for chances in ((0.95, 0.05), (0.7, 0.3), (0.73, 0.17, 0.1)):
        rng = np.random.default_rng([seed, 20, len(chances)])
        draws = rng.choice(len(chances), p=chances, size=(simulations, 20))
        estimates = [entropy(map(str, row)) for row in draws.tolist()]
        found.append((float(stats.entropy(chances, base=2)), float(np.mean(estimates))))
    return found


def _mean(draw: Draw, runs: int, rng: np.random.Generator) -> Interval:
    return intervals.mean(draw(rng, runs))


def _share(chance: float, runs: int, rng: np.random.Generator) -> Interval:
    return intervals.share((rng.random(runs) < chance).tolist())


def _context(
    scatter: Draw, shift: Array, second: int, basis: Array | None, rng: np.random.Generator
) -> bool:
    groups = scatter(rng, 20) + shift, scatter(rng, second)
    return bool(permutation_p(*groups, rng, basis=basis, resamples=RESAMPLES) <= ALPHA)


def _lead(scatter: Draw, shift: Array, rng: np.random.Generator) -> bool:
    """Movements of 12 ticks from a common start: whether there is any lead at all."""
    way = np.linspace(0.0, 1.0, 12)[:, None]
    ends = np.stack([scatter(rng, 20) + shift, scatter(rng, 20)])
    groups = way * ends[:, :, None, :]
    first, second = groups + 0.005 * rng.standard_normal(groups.shape)
    return lead_time(first, second, rng, alpha=ALPHA, resamples=RESAMPLES) is not None


def _synergy(scatter: Draw, runs: int, ratio: float, rng: np.random.Generator) -> Interval:
    """Equal variances per dimension, those that move the hand times the ratio's square."""
    postures = scatter(rng, runs)
    across: Array = postures @ RANGE @ RANGE.T
    return synergy(_POSTURE + (postures + (ratio - 1.0) * across), JACOBIAN).z


def _family(scatter: Draw, slope: float, what: str) -> Family:
    """A family of :data:`LOCI` whose first joint follows the moving goal."""
    shared, curve, runs = LOCI[what]
    middle = PLACES.mean()
    bend = (PLACES - middle) ** 2
    line = slope * (PLACES - middle) + bend * (curve * _SD / bend.max())

    def drawn(rng: np.random.Generator) -> tuple[Array, Array]:
        of_task = shared * scatter(rng, len(PLACES))
        of_task[:, 0] += line
        places = np.repeat(np.arange(len(PLACES)), runs)
        return of_task[places] + scatter(rng, len(places)), PLACES[places]

    return drawn


def _slope(family: Family, rng: np.random.Generator) -> Interval:
    """Of the first joint alone."""
    postures, places = family(rng)
    return locus_slopes(postures[:, :1], places)[0]


def _norm(family: Family, rng: np.random.Generator) -> Interval:
    return slope_norm(*family(rng), rng)


def _sacrifice(draw: Draw, first: float, total: float, rng: np.random.Generator) -> bool:
    """20 runs of two subtasks whose mean changes are known."""
    changes = np.stack([first + draw(rng, 20), total - first + draw(rng, 20)], axis=1)
    return _sacrificed(changes, rng)


def _sacrificed(changes: Array, rng: np.random.Generator) -> bool:
    seed = int(rng.integers(2**32))
    return sacrifice_p(changes, seed=seed, resamples=RESAMPLES) <= ALPHA


@cache
def _without_regard() -> Array:
    """Changes of runs that have no regard for later goals, shape ``(160, 4)``.

    On two-armed task 1, ten with every hand sequence: the corrective process's postures with
    noise (0.05, as the learner's), against the corrective process with the same hands.
    """
    task, rng = load_task("two-armed-1"), np.random.default_rng(SEED)
    changes = []
    for alone in [corrective_trial(task, hands) for hands in hand_sequences(task)]:
        for _ in range(10):
            movements = []
            for own in alone.movements:
                target = np.array(own.target) + 0.05 * rng.standard_normal(task.robot.dof)
                target[1] = 0.0  # base y is locked
                planned = Movement(own.goal, own.hand, "planned", target)
                movements += [planned, Movement(own.goal, own.hand, "corrective")]
            changes.append(change_from(execute(task, movements), alone))
    return np.array(changes, dtype=np.float64)


def _shortsighted(rng: np.random.Generator) -> bool:
    return _sacrificed(rng.choice(_without_regard(), 20), rng)


def _sacrificing(
    draw: Callable[[np.random.Generator], ArrayLike], rng: np.random.Generator
) -> bool:
    return sacrifices(draw(rng))


def main() -> None:
    """Simulate and print everything."""
    sections = {
        f"Nulls: rejected at {ALPHA:.0%}": tests(planted=False),
        "Planted effects: detected": tests(planted=True),
        "Yes or no of one run: yes": single(),
        f"Intervals of {1 - ALPHA:.0%}: hold the true value": list(coverage()),
    }
    asked = simulate(__doc__, sections, SIMULATIONS, SEED, seed_of)
    print("\nHand entropy of 20 runs, bit: true, mean estimate")
    for truth, estimate in entropies(asked.simulations, seed=asked.seed):
        print(f"{truth:.3f}  {estimate:.3f}")


if __name__ == "__main__":
    # Other processes import what they are handed: by the module's name, not as __main__.
    import_module("coartic.analysis.calibration.signatures").main()
