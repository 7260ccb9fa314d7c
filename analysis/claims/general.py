"""Judges of the paper's claims about the processes, informed search, and its own statistics."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy import optimize, stats

from coartic import Hand, Task
from coartic.analysis.claims.data import SMOOTH, Data
from coartic.analysis.claims.register import MARGINS, Claim, Finding
from coartic.analysis.claims.rules import all_hold, exceeds, shown
from coartic.analysis.methods import name_of
from coartic.analysis.published import ENTRIES, Order, Solved, Summary, published_cell
from coartic.analysis.signatures.manifold import movable
from coartic.analysis.signatures.subtasks import postures_before
from coartic.analysis.statistics.estimates import SEED
from coartic.analysis.words import number
from coartic.learner.kernel import PARTS
from coartic.robot import Array, Robot
from coartic.tasks.task import hands_of

STARTS = 8
"""Random starts of the search beside the given one."""
SPREAD = 0.3
"""SD of the random starts about the given one: length unit, rad."""
_PLAN = "trajectory-optimisation/"


def corrective_ensures(data: Data, claim: Claim) -> Finding:
    """Whether no trial fails, and the corrective process completes every hand sequence."""
    trials = failed = sequences = missed = 0
    for task, conditions in claim.cells.items():
        for condition in conditions:
            runs = data.learned(task, condition)
            trials += int(runs.trials.sum())
            failed += int(runs.failed_trials.sum())
        rewards = list(data.sequences(task).values())
        sequences += len(rewards)
        missed += sum(map(math.isnan, rewards))
    return Finding(
        not failed and not missed,
        f"{failed} of {number(trials)} trials of the learner fail to hit every goal. Without any "
        f"experience, the corrective process completes {sequences - missed} of {sequences} hand "
        "sequences.",
    )


def corrective_near_shortest(data: Data, claim: Claim) -> Finding:
    """Whether no subtask of the initial solution is much longer than the shortest path."""
    parts, all_excess = [], []
    for name in claim.cells:
        task, initial = data.task(name), data.initial(name)
        before, after = postures_before(initial, task), initial.configurations
        reaches = zip(before, hands_of(initial.hands), itertools.count(1), after, strict=False)
        shortest = np.array([shortest_reach(task, *reach, SEED) for reach in reaches])
        ways = np.linalg.norm(after - before, axis=1)
        excess = ways / shortest - 1
        all_excess += excess.tolist()
        parts.append(
            f"{name} {', '.join(f'{share:.1%}' for share in excess)} (in all "
            f"{ways.sum() / shortest.sum() - 1:.1%})"
        )
    return Finding(
        max(all_excess) <= MARGINS["close"],
        f"By so much each subtask is longer than the shortest path: {'; '.join(parts)}.",
    )


def shortest_reach(task: Task, q: Array, hand: Hand, goal: int, guess: Array, seed: int) -> float:
    """Least joint-space distance from ``q`` to a configuration that hits a goal.

    ``goal`` counts from 1; ``guess`` is a configuration near one that hits it, shape
    ``(dof,)``. Sequential quadratic programming (Kraft 1988, scipy's SLSQP) on the joints
    that can move the hand, from ``guess`` and random starts about it: the best local minimum,
    so at least as long as the global one. Infinite where none is found. Length unit and rad
    mixed.
    """
    joints = tuple(movable(task, hand).tolist())
    disc = (*task.goals[goal - 1], task.radius)
    return _shortest(task.robot, hand, joints, disc, tuple(q), tuple(guess), seed)


@lru_cache(maxsize=1000)  # all folders of a task share its initial solution
def _shortest(
    robot: Robot,
    hand: Hand,
    joints: tuple[int, ...],
    disc: tuple[float, float, float],
    q: tuple[float, ...],
    guess: tuple[float, ...],
    seed: int,
) -> float:
    """:func:`shortest_reach` of a disc: x, y, radius."""
    own, before = list(joints), np.array(q)
    centre, radius = np.array(disc[:2]), disc[2]

    def moved(change: Array) -> Array:
        result = before.copy()
        result[own] += change
        return result

    def miss(change: Array) -> Array:
        return np.asarray(robot.forward_kinematics(moved(change), hand) - centre)

    def inside(change: Array) -> float:
        off = miss(change)
        return float(radius**2 - off @ off)

    def inside_gradient(change: Array) -> Array:
        jacobian = robot.jacobian(moved(change), hand)[:, own]
        return np.asarray(-2 * miss(change) @ jacobian)

    first = (np.array(guess) - before)[own]
    rng = np.random.default_rng(seed)
    best = math.inf
    for start in (first, *(first + rng.normal(0, SPREAD, (STARTS, len(own))))):
        found = optimize.minimize(
            lambda change: (change @ change, 2 * change),
            start,
            jac=True,
            method="SLSQP",
            constraints=[{"type": "ineq", "fun": inside, "jac": inside_gradient}],
            options={"ftol": 1e-12, "maxiter": 300},
        )
        if inside(found.x) >= -1e-8:
            best = min(best, float(np.linalg.norm(found.x)))
    return best


def beats_inaccurate(data: Data, claim: Claim) -> Finding:
    """Whether the learner beats a plan for smoothness on some task."""
    tests, parts = [], []
    for task, (condition,) in claim.cells.items():
        rewards = data.rewards(task, condition)
        plans = []
        for label in (_PLAN + cost for cost in SMOOTH):
            plan = data.runs(task, label).reward.mean()
            tests.append(exceeds(rewards, plan))
            plans.append(f"{name_of(label)} {number(plan, 0)}")
        parts.append(f"{task}: learner {shown(rewards)}, {', '.join(plans)}")
    holds = any(test.estimate > 0 for test in tests)
    # The claim is that there are such cases: the best of all tests, corrected for their number.
    best = min(tests, key=lambda test: math.inf if math.isnan(test.p) else test.p)
    if holds:
        best = replace(best, p=min(1.0, best.p * len(tests)))
    return Finding(holds, f"{'; '.join(parts)}.", (best,))


def printed_p_values(_: Data, claim: Claim) -> Finding:
    """Welch's test on what is printed of both sides, as far apart as rounding lets them be."""
    parts, holds = [], []
    for entry in ENTRIES.values():
        if not isinstance(entry, Order) or entry.p_below is None:
            continue
        first, second = _printed(entry.task, entry), _printed(entry.task, entry.than)
        if first is None or second is None:
            continue
        p = [_welch(first, second, off) for off in (0.0, 1.0)]
        holds.append(p[1] < entry.p_below)
        parts.append(f"{entry.id} p = {p[0]:.2g} ({p[1]:.2g} at best, printed < {entry.p_below})")
    return Finding(all(holds), f"{'; '.join(parts)}.")


def _welch_p(n: int, mean: float, variance: float, m: int, other: float, spread: float) -> float:
    """One-tailed p of Welch's t-test that ``mean`` of n values is above ``other`` of m."""
    one, two = variance / n, spread / m
    freedom = (one + two) ** 2 / (one**2 / (n - 1) + two**2 / (m - 1))
    return float(stats.t.sf((mean - other) / math.sqrt(one + two), freedom))


def _printed(task: str | None, of: Solved) -> Summary | None:
    cell = published_cell(task or "", of.condition or "")
    if cell is None:
        return None
    by_hands = cell.sequences
    found = by_hands.get(of.hands) if of.hands and len(by_hands) > 1 else cell.summary
    return None if found is None or found.sd is None else found


def _welch(first: Summary, second: Summary, off: float) -> float:
    """One-tailed p that the first mean is higher; ``off`` half units of their last decimals."""
    apart = sum(0.5 * 10.0**-s.digits for s in (first, second))
    both = ((s.runs, s.mean, math.nan if s.sd is None else s.sd**2) for s in (first, second))
    (n, mean, variance), other = both
    return _welch_p(n, mean + off * apart, variance, *other)


def corrections(data: Data, claim: Claim) -> Finding:
    """Whether fewer movements are corrected in the last tenth of the trials than in the first."""
    tests, parts = [], []
    cells = ((task, name) for task, names in claim.cells.items() for name in names)
    for task, condition in cells:
        runs = data.learned(task, condition)
        movements = (runs.trials - 1) * len(data.task(task).goals) / PARTS
        early, late = (
            (runs[name] / movements).to_numpy(dtype=np.float64)
            for name in ("early_corrections", "late_corrections")
        )
        tests.append(exceeds(early - late, 0.0))
        last = runs.solution_corrections.mean() / len(data.task(task).goals)
        parts.append(f"{task} {condition} {early.mean():.1%}, {late.mean():.1%}, {last:.0%}")
    return all_hold(
        tests,
        parts,
        "Movements that were corrected, in the first and the last tenth of the trials and in the "
        "learned solution: ",
    )
