"""What the signatures' tests and intervals do: ``python -m analysis.calibration.signatures``.

Every row simulates 2000 data sets and prints a share with its exact binomial interval. Nulls:
nothing to find, tested at 5 %, how often a test rejects. Planted effects: of a known size, how
often it is found. Intervals: of nominal 95 %, how often they hold the true value. The robot is
the paper's, postures scatter about the start of task ascending. Takes some three minutes.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np
from scipy import stats

from analysis.calibration.simulation import Check, Draw, arguments, lines
from analysis.signatures import intervals
from analysis.signatures.context import lead_time, permutation_p
from analysis.signatures.locus import locus_slopes, slope_norm
from analysis.signatures.manifold import movable, subspaces, synergy
from analysis.signatures.recruitment import entropy
from analysis.signatures.subtasks import ROUNDING, change_from, sacrifice_p, sacrifices
from coartic import Movement, corrective_trial, execute, hand_sequences, load_task
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
JACOBIAN = _TASK.robot.jacobian(_WHOLE, "right")[:, _JOINTS]
NULLSPACE, RANGE = subspaces(JACOBIAN)
_SD = 0.05  # of a joint over runs

Family = Callable[[np.random.Generator], tuple[Array, Array]]


def normal(rng: np.random.Generator, n: int) -> Array:
    """Independent joints of equal variance."""
    return _SD * rng.standard_normal((n, len(_JOINTS)))


def correlated(rng: np.random.Generator, n: int) -> Array:
    """Unequal variances within either subspace, equal per dimension between them."""
    within = rng.standard_normal((n, 4)) * np.sqrt([2.5, 1.0, 0.4, 0.1])
    across = rng.standard_normal((n, 2)) * np.sqrt([1.8, 0.2])
    return _SD * (within @ NULLSPACE.T + across @ RANGE.T)


def heavy(rng: np.random.Generator, n: int) -> Array:
    """Joints with heavy tails (Student's t, 5 degrees of freedom)."""
    return _SD * rng.standard_t(5, (n, len(_JOINTS)))


def skewed(rng: np.random.Generator, n: int) -> Array:
    """Joints with one-sided tails (exponential)."""
    return _SD * rng.standard_exponential((n, len(_JOINTS)))


SCATTERS: tuple[Draw, ...] = (normal, correlated, heavy, skewed)
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
    in place (non-motor-equivalent part: that moves it); the lead is of all 12 ticks or of the
    last 6. ΔV z: standard deviations that move the hand are half, or twice, the others. Locus:
    1 SD of a joint per length unit (4 where a family is not plain, :data:`LOCI`). Sacrifice: the
    first subtask is 5 ticks longer, its SD, and the whole 7 shorter, its SD.
    """
    found: list[Check] = []

    def add(subject: str, data: str, seen: Callable[..., bool], *about: Any) -> None:
        nominal = None if planted else ALPHA
        found.append(Check(subject, data, partial(seen, *about), nominal))

    away = {name: 1.25 * _SD * basis[:, 0] * planted for name, basis in _PARTS.items()}
    still = away["motor-equivalent part"]
    ratios = ((20, 0.5), (20, 2.0)) if planted else ((10, 1.0), (20, 1.0))
    for scatter in SCATTERS:
        kind = scatter.__name__
        for first, second in ((20, 20), (20, 8)):
            data = f"{kind}, {first} and {second} runs"
            add("context dependence", data, _context, scatter, first, second, None, still)
        for part, basis in _PARTS.items():
            add(part, kind, _context, scatter, 20, 20, basis, away[part])
        add("lead time", f"any, {kind}" if planted else kind, _lead, scatter, still)
        for runs, ratio in ratios:
            size = f", {ratio:g} of the SD" if planted else ""
            add("ΔV z", f"{kind}, {runs} runs{size}", _synergy, scatter, runs, ratio)
        for what, (shared, curve, counts) in LOCI.items():
            slope = (4.0 if what else 1.0) * _SD if planted else 0.0
            family = partial(_family, scatter, slope, shared, curve, counts)
            add("locus slope", f"{kind}{what}", _locus, family)
            add("locus slope norm", f"{kind}{what}", _norm, family)
    for kind, draw in TICKS.items():
        if planted:
            add("sacrifice", kind, _sacrifice, draw, 5.0, -7.0)
        else:
            threshold = f"{kind}, first at the threshold"
            add("sacrifice", threshold, _sacrifice, draw, ROUNDING, -30.0)
            add("sacrifice", f"{kind}, whole as before", _sacrifice, draw, 30.0, 0.0)
    if not planted:
        add("sacrifice", "no regard for later goals", _shortsighted)
    return found


def single() -> list[Check]:
    """The yes or no of one run where there is nothing, and where there is something."""
    subject = "first subtask sacrificed"
    return [
        Check(subject, "other hands, ± a tick", _other_hands),
        Check(subject, "no regard for later goals", _one_shortsighted),
        Check(subject, "+7 of ± 5, -16 of ± 7 ticks", _one_sacrifice),
    ]


def coverage() -> list[Check]:
    """Every interval of a signature, by kind of value: whether it holds the true one."""
    found: list[Check] = []

    def add(subject: str, data: str, seen: Callable[..., bool], *about: Any) -> None:
        found.append(Check(subject, data, partial(seen, *about), 1 - ALPHA))

    for name, (draw, mean) in VALUES.items():
        for runs in (10, 20):
            add("mean", f"{name}, {runs} runs", _mean_held, draw, mean, runs)
    for chance in (0.5, 0.9, 0.98):
        for runs in (10, 20):
            add("share", f"of {chance:g}, {runs} runs", _share_held, chance, runs)
    for scatter in SCATTERS:
        kind = scatter.__name__
        for ratio in (1.0, 0.5):
            data = f"{kind}, 20 runs, {ratio:g} of the SD"
            add("ΔV z", data, _synergy_held, scatter, ratio)
        for what, (shared, curve, counts) in LOCI.items():
            family = partial(_family, scatter, _SD, shared, curve, counts)
            add("locus slope", f"{kind}{what}", _slope_held, family)
    return found


def seed_of(number: int, check: Check, seed: int = SEED) -> list[int]:
    """A seed of its own for each check, whatever else is simulated."""
    return [seed, zlib.crc32(check.name.encode())]


def entropies(simulations: int, runs: int = 20, seed: int = SEED) -> list[tuple[float, float]]:
    """True hand entropy, bit, and the mean of its estimate, for three sets of sequences.

    It has no interval: where every run has the same hands, nothing says what else there is.
    """
    found = []
    for chances in ((0.95, 0.05), (0.7, 0.3), (0.73, 0.17, 0.1)):
        rng = np.random.default_rng([seed, runs, len(chances)])
        draws = rng.choice(len(chances), p=chances, size=(simulations, runs))
        estimates = [entropy(map(str, row)) for row in draws.tolist()]
        found.append((float(stats.entropy(chances, base=2)), float(np.mean(estimates))))
    return found


def _mean_held(draw: Draw, truth: float, runs: int, rng: np.random.Generator) -> bool:
    _, low, high = intervals.mean(draw(rng, runs))
    return low <= truth <= high


def _share_held(chance: float, runs: int, rng: np.random.Generator) -> bool:
    _, low, high = intervals.share((rng.random(runs) < chance).tolist())
    return low <= chance <= high


def _synergy_held(scatter: Draw, ratio: float, rng: np.random.Generator) -> bool:
    """Equal variances per dimension, those that move the hand times the ratio's square."""
    found = synergy(_POSTURE + _squeezed(scatter(rng, 20), ratio), JACOBIAN)
    return found.low <= found.neutral - math.log(ratio) <= found.high


def _slope_held(family: Family, rng: np.random.Generator) -> bool:
    postures, places = family(rng)
    slope = locus_slopes(postures[:, :1], places)[0]
    return slope.low <= _SD <= slope.high


def _squeezed(postures: Array, ratio: float) -> Array:
    """Deviations that move the hand, times a ratio."""
    across: Array = postures @ RANGE @ RANGE.T
    return postures + (ratio - 1.0) * across


def _context(
    scatter: Draw,
    first: int,
    second: int,
    basis: Array | None,
    shift: Array,
    rng: np.random.Generator,
) -> bool:
    groups = scatter(rng, first) + shift, scatter(rng, second)
    return permutation_p(*groups, rng, basis=basis, resamples=RESAMPLES) <= ALPHA


def _lead(scatter: Draw, shift: Array, rng: np.random.Generator) -> bool:
    """Movements of 12 ticks from a common start: whether there is any lead at all."""
    way = np.linspace(0.0, 1.0, 12)[:, None]
    ends = np.stack([scatter(rng, 20) + shift, scatter(rng, 20)])
    groups = way * ends[:, :, None, :]
    first, second = groups + 0.005 * rng.standard_normal(groups.shape)
    return lead_time(first, second, rng, alpha=ALPHA, resamples=RESAMPLES) is not None


def _synergy(scatter: Draw, runs: int, ratio: float, rng: np.random.Generator) -> bool:
    return synergy(_POSTURE + _squeezed(scatter(rng, runs), ratio), JACOBIAN).p <= ALPHA


def _family(
    scatter: Draw,
    slope: float,
    shared: float,
    curve: float,
    runs: tuple[int, ...],
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Postures of a family of tasks, shape ``(n, k)``, and positions; the first joint follows."""
    middle = PLACES.mean()
    bend = (PLACES - middle) ** 2
    bend *= curve * _SD / bend.max()
    of_task = shared * scatter(rng, len(PLACES))
    of_task[:, 0] += slope * (PLACES - middle) + bend
    places = np.repeat(np.arange(len(PLACES)), runs)
    return of_task[places] + scatter(rng, len(places)), PLACES[places]


def _locus(family: Family, rng: np.random.Generator) -> bool:
    """The first joint alone is looked at."""
    postures, places = family(rng)
    return locus_slopes(postures[:, :1], places)[0].p <= ALPHA


def _norm(family: Family, rng: np.random.Generator) -> bool:
    return slope_norm(*family(rng), rng).p <= ALPHA


def _sacrifice(draw: Draw, first: float, total: float, rng: np.random.Generator) -> bool:
    """20 runs of two subtasks whose mean changes are known."""
    changes = np.stack([first + draw(rng, 20), total - first + draw(rng, 20)], axis=1)
    return _sacrificed(changes, rng)


def _sacrificed(changes: Array, rng: np.random.Generator) -> bool:
    seed = int(rng.integers(2**32))
    return sacrifice_p(changes, seed=seed, resamples=RESAMPLES) <= ALPHA


@cache
def _without_regard(seed: int = SEED) -> Array:
    """Changes of runs that have no regard for later goals, shape ``(160, 4)``.

    On two-armed task 1, ten with every hand sequence: the corrective process's postures with
    noise (0.05, as the learner's), against the corrective process with the same hands.
    """
    task, rng = load_task("two-armed-1"), np.random.default_rng(seed)
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
    changes = _without_regard()
    return _sacrificed(changes[rng.integers(len(changes), size=20)], rng)


def _one_shortsighted(rng: np.random.Generator) -> bool:
    changes = _without_regard()
    return sacrifices(changes[rng.integers(len(changes))])


def _other_hands(rng: np.random.Generator) -> bool:
    """The corrective process with hands at random, a tick more or less in every subtask."""
    return sacrifices(rng.integers(-1, 2, size=4))


def _one_sacrifice(rng: np.random.Generator) -> bool:
    first, rest = 5.0 * rng.standard_normal(2)
    return sacrifices(np.round([7.0 + first, -23.0 + rest]))


def main() -> None:
    """Print one line per check; what departs from its nominal rate is marked."""
    given = arguments(__doc__, SIMULATIONS, SEED)
    sections = {
        f"Nulls: rejected at {ALPHA:.0%}": tests(planted=False),
        "Planted effects: detected": tests(planted=True),
        "Yes or no of one run: yes": single(),
        f"Intervals of {1 - ALPHA:.0%}: hold the true value": coverage(),
    }
    rule = partial(seed_of, seed=given.seed)
    for line in lines(sections, given.simulations, rule, jobs=given.jobs):
        print(line, flush=True)
    print("\nHand entropy of 20 runs, bit: true, mean estimate")
    for truth, estimate in entropies(given.simulations, seed=given.seed):
        print(f"{truth:.3f}  {estimate:.3f}")


if __name__ == "__main__":
    main()
