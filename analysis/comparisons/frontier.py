"""Reward against what it costs: anytime curves, times to a target, Pareto sets.

Spends are trials, control ticks, forward-kinematics evaluations and solve time
(:data:`analysis.comparisons.progress.SPENDS`); Pareto sets also count Jacobians and information.
``steps`` is what :func:`analysis.comparisons.progress.progress` read, for those who need it
more than once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from analysis.comparisons.methods import STILL, solve_times
from analysis.comparisons.progress import SPENDS, Progress, progress
from analysis.results.folder import CellRuns, Results
from analysis.results.optima import METHODS as OPTIMUM
from analysis.results.optima import locks_base, optima
from analysis.statistics import spread
from analysis.statistics.estimates import CONFIDENCE
from analysis.statistics.survival import kaplan_meier_median
from coartic.robot import Array

if TYPE_CHECKING:
    from analysis.study import Study

SHARES = (0.05, 0.02, 0.01)
"""Distances from the optimum that count as reached, as shares of it."""
RESAMPLES = 2000
POINTS = 60
"""Budgets on an anytime curve."""
TIME_TOLERANCE = 0.1
"""Relative difference up to which two solve times are a tie."""
OtherArm = Literal["free", "still"]
OTHER_ARMS: tuple[OtherArm, ...] = ("free", "still")
Steps = Mapping[str, Progress]
LABELS = {
    "trials": "trials",
    "movement_ticks": "ticks",
    "forward_kinematics": "kinematics",
    "solve_s": "solve s",
    "jacobians": "Jacobians",
    "information": "information",
}


def anytime_frame(results: Results, steps: Steps | None = None, *, seed: int = 0) -> pd.DataFrame:
    """Best reward so far within a budget: one row per task, method, spend and budget.

    Columns: ``task``, ``method``, ``spend``, ``kind`` (``curve`` for methods that learn by
    trial; ``point``, at the median spend of a whole run, for the others), ``budget``,
    ``runs``, ``solved`` (runs that have a solution within the budget), ``mean`` reward with
    the interval ``low`` to ``high``, and ``median`` reward.

    A curve starts where the first run has a solution and ends where the first run ends, so
    that nothing is extrapolated. The mean is missing until every run has a solution, never
    one of the faster runs alone; the median counts a run without one as worse than any.
    Intervals are 95 % percentile bootstrap intervals of the mean over runs (Efron &
    Tibshirani, 1993), pointwise, not a band around the whole curve; they are missing for
    a single run. ``seed`` is that of the resampling; a cell's rows do not depend on other
    cells. Runs whose time is not taken (:func:`analysis.comparisons.methods.solve_times`) have
    no part in the curve over time, nor methods with a base that a parameter locks in any.
    """
    rows: list[dict[str, Any]] = []
    for cell, spend, runs in _selected(results, steps):
        learns = any(run.learns for run in runs)
        budgets = _budgets(runs, spend) if learns else _whole(runs, spend)
        if not len(budgets):
            continue
        values = np.array([run.best(spend, budgets) for run in runs])
        if not learns:  # the spread of what planners spend is not one of their reward
            values = np.array([run.best(spend, np.array([math.inf])) for run in runs])
        solved = np.isfinite(values)
        mean, low, high = _bootstrap_mean(np.where(solved.all(axis=0), values, math.nan), seed)
        median = np.median(values, axis=0)
        rows.extend(
            {
                "task": cell.task,
                "method": cell.label,
                "spend": spend,
                "kind": "curve" if learns else "point",
                "budget": budgets[i],
                "runs": len(runs),
                "solved": int(solved[:, i].sum()),
                "mean": mean[i],
                "low": low[i],
                "high": high[i],
                "median": median[i] if math.isfinite(median[i]) else math.nan,
            }
            for i in range(len(budgets))
        )
    columns = "task method spend kind budget runs solved mean low high median"
    return pd.DataFrame(rows, columns=columns.split())


def for_both_arms(
    frame: Callable[..., pd.DataFrame], results: Results, steps: Steps | None = None
) -> pd.DataFrame:
    """:func:`area_frame` or :func:`targets_frame` of both optima, one below the other."""
    parts = [frame(results, steps, other_arm=other_arm) for other_arm in OTHER_ARMS]
    return pd.concat(parts, ignore_index=True)


def area_frame(
    results: Results,
    steps: Steps | None = None,
    *,
    other_arm: OtherArm = "free",
    seed: int = 0,
) -> pd.DataFrame:
    """Area under the anytime curve: one row per task, method and spend.

    The area of a run is its gap to the optimum R*, averaged over the logarithm of the
    budget B from ``start`` to ``end``:

        1 / ln(end / start) · ∫ min(1, (R* − best reward within B) / |R*|) d ln B,

    with a gap of 1 where there is no solution yet. It lies between 0 (optimal from
    ``start`` on) and 1; 0.1 means 10 % from the optimum on average, each doubling of the
    budget counting alike. A run that has ended keeps its best reward. ``end`` is the largest
    whole spend of a run that learns by trial, over all methods of the task, and ``start`` is
    ``end`` over the number of trials, one average trial: areas compare within a task, a
    spend and a folder only. The steps are integrated exactly.

    Columns: ``task``, ``method``, ``other_arm`` (which optimum), ``spend``, ``start``, ``end``,
    ``runs``, mean ``area`` with its percentile bootstrap interval ``low`` to ``high``. Tasks
    without a known optimum, spends without a run that learns, and methods with a base that a
    parameter locks have no rows; with ``other_arm="still"`` neither have methods that move the
    arm that is not chosen.
    """
    references = optima(results)
    selected = list(_selected(results, steps))
    ends: dict[tuple[str, str], float] = {}
    for cell, spend, runs in selected:
        totals = [run.total[spend] for run in runs if run.learns and run.solved]
        ends[cell.task, spend] = max([ends.get((cell.task, spend), 0.0), *totals])
    rows: list[dict[str, Any]] = []
    for cell, spend, runs in selected:
        optimum = references.get((cell.task, other_arm))
        end, trials = ends[cell.task, spend], ends[cell.task, "trials"]
        if optimum is None or not optimum.reward or not runs:  # nothing to fall short of
            continue
        if trials <= 1 or not _comparable(cell, other_arm):
            continue
        start = end / trials
        areas = np.array([[_area(run, spend, optimum.reward, start, end)] for run in runs])
        mean, low, high = _bootstrap_mean(areas, seed)
        rows.append(
            {
                "task": cell.task,
                "method": cell.label,
                "other_arm": other_arm,
                "spend": spend,
                "start": start,
                "end": end,
                "runs": len(runs),
                "area": mean[0],
                "low": low[0],
                "high": high[0],
            }
        )
    columns = "task method other_arm spend start end runs area low high"
    return pd.DataFrame(rows, columns=columns.split())


def targets_frame(
    results: Results,
    steps: Steps | None = None,
    *,
    other_arm: OtherArm = "free",
    shares: Sequence[float] = SHARES,
) -> pd.DataFrame:
    """Spend to come near the optimum R*: one row per task, method, spend and share.

    A run reaches a share when its gap, R* − reward, is at most that share of |R*|.
    Columns: ``task``, ``method``, ``other_arm`` (which optimum), ``spend``, ``share``,
    ``target`` (the reward that this takes), ``runs``, ``reached`` (how many runs),
    ``reached_low`` and ``reached_high`` (exact 95 % interval of the probability to reach it,
    Clopper & Pearson, 1934), ``median`` spend to reach it with the interval ``low`` to ``high``
    (:func:`analysis.statistics.survival.kaplan_meier_median`), and ``horizon``.

    The median is over all runs, infinite where half of them did not reach the target; so
    are limits that the runs do not bound. Runs that could have gone on are right-censored,
    all at the horizon: the least spend at which one of them ended. (Each at its own end
    would make censoring depend on the outcome: worse trials take more ticks. Lin et al.,
    1997, on costs.) What was reached behind the horizon counts in ``reached`` only. A run
    could have gone on if its budget of trials stopped it (:attr:`Progress.stopped
    <analysis.comparisons.progress.Progress.stopped>`). Runs that ended by themselves never reach a
    target that they missed: a planner's, an exhaustive search's that tried all it had, one
    without a solution. The horizon is infinite where all runs ended by themselves. Runs
    whose time is not taken have no part in those over time.

    Tasks without a known optimum have no rows, nor have methods with a base that a parameter
    locks, for which it is no optimum; with ``other_arm="still"`` neither have methods that
    move the arm that is not chosen.
    """
    references = optima(results)
    rows: list[dict[str, Any]] = []
    for cell, spend, runs in _selected(results, steps):
        optimum = references.get((cell.task, other_arm))
        if optimum is None or not runs or not _comparable(cell, other_arm):
            continue
        for share in shares:
            target = math.ceil(optimum.reward - share * abs(optimum.reward) - 1e-9)
            times, horizon = _times(runs, spend, target)
            count = int(np.isfinite(times).sum())
            chance = binomtest(count, len(runs)).proportion_ci(CONFIDENCE, method="exact")
            seen = np.minimum(times, horizon)
            median = kaplan_meier_median(seen, np.isfinite(times) & (times <= horizon), CONFIDENCE)
            rows.append(
                {
                    "task": cell.task,
                    "method": cell.label,
                    "other_arm": other_arm,
                    "spend": spend,
                    "share": share,
                    "target": target,
                    "runs": len(runs),
                    "reached": count,
                    "reached_low": chance.low,
                    "reached_high": chance.high,
                    "median": median.value,
                    "low": median.low,
                    "high": median.high,
                    "horizon": horizon,
                }
            )
    columns = "task method other_arm spend share target runs reached reached_low reached_high"
    return pd.DataFrame(rows, columns=f"{columns} median low high horizon".split())


def pareto_frame(study: Study, *, seed: int = 0) -> pd.DataFrame:
    """Mean reward against spend: one row per task, method and spend, best reward first.

    A method is on the front if no other has a mean reward as high for as little spend, with
    either one better; ties are all on it. Times within :data:`TIME_TOLERANCE` of each other
    are ties: they vary between machines and between runs. Columns: ``task``, ``method``,
    ``told`` (a letter for each kind of information,
    :data:`analysis.comparisons.methods.TOLD`), ``runs``,
    ``solved``, mean ``reward``, ``spend`` (:data:`LABELS`; ``information`` is the number of
    kinds of information told, which does not weigh them), ``amount`` (median over runs),
    ``front``, ``front_share`` (of :data:`RESAMPLES` bootstrap resamples, in how many it is on
    the front), and ``front_told`` and ``told_share``: the same among methods that were told
    nothing that it was not.

    Runs are resampled within their cell, reward and spend of a run together, by run number:
    methods that did the same in every run stay tied, as methods that share their seeds may.
    A method with a single run is taken as it is. Methods with runs that have no solution are
    left out: a mean of the others flatters them. So are the optimum's searches, which are
    references, and methods with a base that a parameter locks.
    """
    methods = study.methods
    methods = methods[(methods.solved == methods.runs) & (methods.runs > 0)]
    methods = methods.assign(method=(methods.method + " " + methods.variant).str.strip())
    cells = {
        (cell.task, cell.label): cell
        for cell in study.results.cells
        if not cell.method.startswith(OPTIMUM) and not locks_base(cell.runs)
    }
    kept = [key in cells for key in zip(methods.task, methods.method, strict=True)]
    methods = methods[np.array(kept, dtype=bool)]  # an empty list would choose columns
    parts = []
    for task, rows in methods.groupby("task", sort=False):
        chosen = [cells[str(task), label] for label in rows.method]
        told = [frozenset(letters) for letters in rows.told]
        no_more = np.array([[other <= own for other in told] for own in told])
        rewards = [cell.runs.reward.to_numpy(dtype=np.float64) for cell in chosen]
        mean = rows.reward.to_numpy()
        means = np.stack([_resampled(values, seed).mean(axis=-1) for values in rewards], axis=-1)
        for spend in LABELS:
            spent = [
                _spent(cell, spend, letters) for cell, letters in zip(chosen, told, strict=True)
            ]
            amount = np.array([float(_median(values)) for values in spent])
            amounts = np.stack([_median(_resampled(values, seed)) for values in spent], axis=-1)
            tolerance = TIME_TOLERANCE if spend == "solve_s" else 0.0
            worse = dominated(mean, amount, tolerance)
            again = dominated(means, amounts, tolerance)
            known, seen = ~np.isnan(amount), ~np.isnan(amounts)
            parts.append(
                rows[["task", "method", "told", "runs", "solved", "reward"]].assign(
                    spend=spend,
                    amount=amount,
                    front=~worse.any(axis=-1) & known,
                    front_share=(~again.any(axis=-1) & seen).mean(axis=0),
                    front_told=~(worse & no_more).any(axis=-1) & known,
                    told_share=(~(again & no_more).any(axis=-1) & seen).mean(axis=0),
                )
            )
    columns = "task method told runs solved reward spend amount front front_share"
    columns += " front_told told_share"
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns.split())


def dominated(
    reward: Array, amount: Array, tolerance: float = 0.0
) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Whether method i is dominated by method j, shape ``(..., n, n)``.

    ``reward`` and ``amount`` have shape ``(..., n)``. Amounts whose ratio is at most
    1 + ``tolerance`` are ties. Domination has no cycles all the same: along one the reward
    could not change, and amounts would only fall.
    """
    own, other = reward[..., :, None], reward[..., None, :]
    spent, others = amount[..., :, None], amount[..., None, :]
    room = 1 + tolerance
    as_good = (other >= own) & (others <= spent * room)
    better = (other > own) | (others * room < spent)
    return as_good & better


def _spent(cell: CellRuns, spend: str, told: frozenset[str]) -> Array:
    """What each run spent (n,); NaN for times that are not taken."""
    if spend == "information":
        return np.full(len(cell.runs), float(len(told)))
    if spend == "solve_s":
        times = solve_times(cell.good)
        return times.reindex(cell.runs.index).to_numpy(dtype=np.float64, na_value=np.nan)
    return cell.runs[spend].to_numpy(dtype=np.float64, na_value=np.nan)


def _median(values: Array) -> Array:
    """Median over the last axis of the values that are known; NaN where none is."""
    ordered = np.sort(values, axis=-1)  # NaN last
    count = np.isfinite(ordered).sum(axis=-1, keepdims=True)
    sides = [np.maximum(count - 1, 0) // 2, np.minimum(count // 2, values.shape[-1] - 1)]
    middle: Array = np.concatenate(
        [np.take_along_axis(ordered, side, axis=-1) for side in sides], axis=-1
    ).mean(axis=-1)
    return middle


def _selected(
    results: Results, steps: Steps | None
) -> Iterator[tuple[CellRuns, str, list[Progress]]]:
    """Every cell and spend with the runs whose steps are known.

    Without cells whose parameters lock the base: they solve another problem than the task.
    """
    steps = progress(results) if steps is None else steps
    for cell in results.cells:
        if locks_base(cell.runs):
            continue
        runs = [steps[str(run_id)] for run_id in cell.runs.run_id]
        for spend in SPENDS:
            yield cell, spend, [run for run in runs if run.known(spend)]


def _comparable(cell: CellRuns, other_arm: OtherArm) -> bool:
    """Whether a method's solutions keep to the restriction of an optimum."""
    return other_arm == "free" or bool((cell.good.other_arm_travel <= STILL).all())


def _budgets(runs: Sequence[Progress], spend: str) -> Array:
    """Log-spaced budgets from the first solution to the first end of a run."""
    solved = [run for run in runs if run.solved]
    if not solved:
        return np.empty(0)
    first = min(run.spent[spend][0] for run in solved)
    end = min(run.total[spend] for run in solved)
    if not 0 < first <= end:
        return np.empty(0)
    budgets = np.geomspace(first, end, POINTS)
    budgets[[0, -1]] = first, end
    return np.unique(budgets if spend == "solve_s" else np.ceil(budgets))


def _whole(runs: Sequence[Progress], spend: str) -> Array:
    """Median spend of whole runs, where there is one."""
    totals = np.array([run.total[spend] for run in runs])
    totals = totals[np.isfinite(totals)]
    return np.array([np.median(totals)]) if len(totals) else np.empty(0)


def _bootstrap_mean(values: Array, seed: int) -> tuple[Array, Array, Array]:
    """Mean over runs and its percentile interval, for each column of ``values`` (n, k)."""
    if len(values) < 2:
        nothing = np.full(values.shape[1], math.nan)
        return values.mean(axis=0), nothing, nothing
    drawn = [np.bincount(draw, minlength=len(values)) for draw in _draws(len(values), seed)]
    weights = np.array(drawn) / len(values)
    means = spread.within(weights @ values, values)
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(means, [tail, 1 - tail], axis=0)
    return spread.mean(values), low, high


@cache
def _draws(n: int, seed: int) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Which of n runs are in each bootstrap resample, shape ``(RESAMPLES, n)``."""
    return np.random.default_rng(seed).integers(n, size=(RESAMPLES, n))


def _resampled(values: Array, seed: int) -> Array:
    """Bootstrap resamples of values (n,), shape ``(RESAMPLES, n)``."""
    resamples: Array = values[_draws(len(values), seed)]
    return resamples


def _area(run: Progress, spend: str, optimum: float, start: float, end: float) -> float:
    gaps = np.minimum(1.0, (optimum - np.concatenate([[-np.inf], run.rewards])) / abs(optimum))
    edges = np.clip(np.concatenate([[start], run.spent[spend], [end]]), start, end)
    return float(np.average(gaps, weights=np.diff(np.log(edges))))


def _times(runs: Sequence[Progress], spend: str, target: float) -> tuple[Array, float]:
    """Spend of each run to reach a reward, infinite where it did not, and the horizon."""
    places = [int(np.searchsorted(run.rewards, target)) for run in runs]
    times = [
        float(run.spent[spend][place]) if place < len(run.rewards) else math.inf
        for run, place in zip(runs, places, strict=True)
    ]
    ends = [run.total[spend] for run in runs if run.stopped and run.solved]
    return np.array(times), min(ends, default=math.inf)
