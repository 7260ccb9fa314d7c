"""The paper's claims about all tasks, its processes, and informed search.

Each is judged on the one-armed tasks, which are printed, and apart on the two-armed ones, which
are a reconstruction.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from scipy import optimize, stats

from coartic import Hand, Task
from coartic.analysis.claims.data import BEST, CELLS, SMOOTH, UNINFORMED, Cells, Data, MissingError
from coartic.analysis.claims.evidence import all_hold, exceeds, shown
from coartic.analysis.claims.power import welch_p
from coartic.analysis.claims.register import Finding
from coartic.analysis.claims.statements import MARGINS, decides, decides_apart
from coartic.analysis.methods import LEARNER
from coartic.analysis.printed import ENTRIES, Order, Solved
from coartic.analysis.published import TRIALS, Summary, published_cell
from coartic.analysis.signatures.manifold import movable
from coartic.analysis.signatures.subtasks import postures_before
from coartic.analysis.statistics.estimates import SEED
from coartic.analysis.words import short
from coartic.learner import PARTS
from coartic.record import SEARCH
from coartic.robot import Array, Robot
from coartic.task import hands_of

STARTS = 8
"""Random starts of the search beside the given one."""
SPREAD = 0.3
"""SD of the random starts about the given one: length unit, rad."""
_PLAN = "trajectory-optimisation/"


@decides_apart("corrective-ensures", CELLS)
def _corrective_ensures(data: Data, cells: Cells) -> Finding:
    trials = failed = sequences = missed = 0
    for task, condition in cells:
        runs = data.learned(task, condition)
        trials += int(runs.trials.sum())
        failed += int(runs.failed_trials.sum())
    for task in dict.fromkeys(task for task, _ in cells):
        rewards = list(data.sequences(task).values())
        sequences += len(rewards)
        missed += sum(map(math.isnan, rewards))
    return Finding(
        not failed and not missed,
        f"{failed} of {trials} trials of the learner do not hit every goal; alone and without "
        f"any practice it completes its task with {sequences - missed} of {sequences} hand "
        "sequences",
    )


@decides_apart("corrective-near-shortest", CELLS)
def _corrective_near_shortest(data: Data, cells: Cells) -> Finding:
    parts, all_excess = [], []
    for name in dict.fromkeys(task for task, _ in cells):
        task, initial = data.task(name), data.initial(name)
        before, after = postures_before(initial, task), initial.configurations
        reaches = zip(before, hands_of(initial.hands), itertools.count(1), after, strict=False)
        shortest = np.array([shortest_reach(task, *reach, SEED) for reach in reaches])
        ways = np.linalg.norm(after - before, axis=1)
        excess = ways / shortest - 1
        all_excess += excess.tolist()
        parts.append(
            f"{name} {', '.join(f'{share:+.1%}' for share in excess)} (in all "
            f"{ways.sum() / shortest.sum() - 1:+.1%})"
        )
    return Finding(
        max(all_excess) <= MARGINS["close"],
        f"joint-space length of each subtask against the shortest: {'; '.join(parts)}",
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


@decides_apart("less-experience", BEST)
def _less_experience(data: Data, cells: Cells) -> Finding:
    parts = []
    for task, condition in cells:
        learner = data.row(task, LEARNER + condition)
        plans = {cost: data.row(task, _PLAN + cost) for cost in ("path-length", *SMOOTH)}
        better = [f"{cost} ({p.told})" for cost, p in plans.items() if p.reward >= learner.reward]
        parts.append(
            f"{task}: learner {learner.reward:.1f} after {learner.trials:.0f} trials, told "
            f"{learner.told}; as good or better without any: {', '.join(better) or 'none'}"
        )
    return Finding(None, "; ".join(parts))


@decides_apart("low-computation", BEST)
def _low_computation(data: Data, cells: Cells) -> Finding:
    parts = []
    for task, condition in cells:
        run = data.row(task, LEARNER + condition).evaluations
        informed = {label: data.row(task, label).evaluations for label in _informed(data, task)}
        if not informed:
            raise MissingError(f"this folder has no runs of informed search on {task}")
        few, many = (pick(informed, key=informed.__getitem__) for pick in (min, max))
        parts.append(
            f"{task}: learner {short(run)} in {TRIALS} trials, {short(run / TRIALS)} in one; "
            f"{len(informed)} informed methods {short(informed[few])} ({few}) to "
            f"{short(informed[many])} ({many})"
        )
    return Finding(None, "; ".join(parts))


def _informed(data: Data, task: str) -> list[str]:
    """Methods with default parameters that are told more than the learner, with solutions."""
    return [
        label
        for (name, label), cell in data.study.cells.items()
        if name == task
        and " " not in label
        and not label.startswith((LEARNER, SEARCH))
        and len(cell.good) == len(cell.runs) > 0
        and set(data.study.method_rows[task, label].told) - UNINFORMED
    ]


@decides_apart("beats-inaccurate", BEST)
def _beats_inaccurate(data: Data, cells: Cells) -> Finding:
    tests, parts = [], []
    for task, condition in cells:
        rewards = data.rewards(task, condition)
        plans = []
        for cost in SMOOTH:
            plan = data.row(task, _PLAN + cost).reward
            tests.append(exceeds(rewards, plan))
            plans.append(f"{cost} {plan:.0f}")
        parts.append(f"{task}: learner {shown(rewards)}, {', '.join(plans)}")
    holds = any(test.estimate > 0 for test in tests)
    # The claim is that there are such cases: the best of all tests, corrected for their number.
    best = min(tests, key=lambda test: math.inf if math.isnan(test.p) else test.p)
    if holds:
        best = replace(best, p=min(1.0, best.p * len(tests)))
    return Finding(holds, "; ".join(parts), (best,))


@decides("printed-p-values")
def _printed_p_values(data: Data) -> Finding:
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
    data.others["the paper's print"] = "paper"
    return Finding(all(holds), "; ".join(parts))


def _printed(task: str | None, of: Solved) -> Summary | None:
    cell = published_cell(task or "", of.condition or "")
    if cell is None:
        return None
    by_hands = {s.hands: s.summary for s in cell.sequences}
    found = by_hands.get(of.hands) if of.hands and len(by_hands) > 1 else cell.summary
    return None if found is None or found.sd is None else found


def _welch(first: Summary, second: Summary, off: float) -> float:
    """One-tailed p that the first mean is higher; ``off`` half units of their last decimals."""
    apart = sum(0.5 * 10.0 ** -(s.digits[0] if s.digits else 0) for s in (first, second))
    both = ((s.runs, s.mean, math.nan if s.sd is None else s.sd**2) for s in (first, second))
    (n, mean, variance), other = both
    return float(welch_p(n, mean + off * apart, variance, *other))


@decides_apart("not-normal", CELLS)
def _not_normal(data: Data, cells: Cells) -> Finding:
    parts = []
    for task, condition in cells:
        rewards = data.rewards(task, condition)
        p = float(stats.shapiro(rewards).pvalue) if np.ptp(rewards) else math.nan
        parts.append(f"{task} {condition} p = {p:.2g}")
    return Finding(None, "; ".join(parts))


@decides_apart("corrections", CELLS)
def _corrections(data: Data, cells: Cells) -> Finding:
    tests, parts = [], []
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
        "movements to goals that were corrected, in the first and the last tenth of the trials "
        "and in the learned solution: ",
    )
