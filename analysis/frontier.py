"""Reward against what it costs: anytime curves, times to a target, Pareto sets.

Spends are trials, control ticks, forward-kinematics evaluations and solve time
(:data:`analysis.progress.SPENDS`); Pareto sets also count Jacobians and information.
``steps`` is what :func:`analysis.progress.progress` read, for those who need it more than
once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any, Literal

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from analysis.methods import STILL, methods_frame
from analysis.optimum import METHODS as OPTIMUM
from analysis.optimum import optima
from analysis.progress import SPENDS, Array, Progress, progress
from analysis.results import CellRuns, Results
from analysis.survival import kaplan_meier_median
from analysis.table import NONE, Table

SHARES = (0.05, 0.02, 0.01)
"""Distances from the optimum that count as reached, as shares of it."""
CONFIDENCE = 0.95
RESAMPLES = 2000
POINTS = 60
"""Budgets on an anytime curve."""
OtherArm = Literal["free", "still"]
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
    cells. Runs whose time is not taken (:func:`analysis.methods.solve_times`) have no part
    in the curve over time.
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

    Columns: ``task``, ``method``, ``spend``, ``start``, ``end``, ``runs``, mean ``area`` with
    its percentile bootstrap interval ``low`` to ``high``. Tasks without a known optimum and
    spends without a run that learns have no rows; with ``other_arm="still"`` neither have
    methods that move the arm that is not chosen.
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
                "spend": spend,
                "start": start,
                "end": end,
                "runs": len(runs),
                "area": mean[0],
                "low": low[0],
                "high": high[0],
            }
        )
    columns = "task method spend start end runs area low high"
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
    Columns: ``task``, ``method``, ``spend``, ``share``, ``target`` (the reward that this
    takes), ``runs``, ``reached`` (how many runs), ``reached_low`` and ``reached_high`` (exact
    95 % interval of the probability to reach it, Clopper & Pearson, 1934), ``median`` spend
    to reach it with the interval ``low`` to ``high``
    (:func:`analysis.survival.kaplan_meier_median`), and ``horizon``.

    The median is over all runs, infinite where half of them did not reach the target; so
    are limits that the runs do not bound. Runs that could have gone on are right-censored,
    all at the horizon: the least spend at which one of them ended. (Each at its own end
    would make censoring depend on the outcome: worse trials take more ticks. Lin et al.,
    1997, on costs.) What was reached behind the horizon counts in ``reached`` only. Runs
    that ended by themselves never reach a target that they missed: a planner's, one
    without a solution, one with fewer trials than others of its cell. The horizon of
    planners is infinite. Runs whose time is not taken have no part in those over time.

    Tasks without a known optimum have no rows; with ``other_arm="still"`` neither have
    methods that move the arm that is not chosen.
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
    columns = "task method spend share target runs reached reached_low reached_high"
    return pd.DataFrame(rows, columns=f"{columns} median low high horizon".split())


def pareto_frame(results: Results) -> pd.DataFrame:
    """Mean reward against spend: one row per task, method and spend, best reward first.

    A method is on the front if no other has a mean reward as high for as little spend, with
    either one better; ties are all on it. Columns: ``task``, ``method``, ``told`` (a letter
    for each kind of information, :data:`analysis.methods.TOLD`), ``runs``, ``solved``, mean
    ``reward``, ``spend`` (:data:`LABELS`; ``information`` is the number of kinds of
    information told, which does not weigh them), ``amount`` (median over runs), ``front``,
    and ``front_told``: whether it is on the front among methods that were told nothing that
    it was not.

    Methods with runs that have no solution are left out: a mean of the others flatters
    them. So are the optimum's searches, which are references. Means are taken as they are,
    without their sampling error.
    """
    methods = methods_frame(results)
    methods = methods[(methods.solved == methods.runs) & (methods.runs > 0)]
    methods = methods[~methods.method.str.startswith(OPTIMUM)]
    methods = methods.assign(
        method=(methods.method + " " + methods.variant).str.strip(),
        information=methods.told.str.len().astype(float),
    )
    parts = []
    for _, rows in methods.groupby("task", sort=False):
        reward, told = rows.reward.to_numpy(), [frozenset(letters) for letters in rows.told]
        no_more = np.array([[other <= own for other in told] for own in told])
        for spend in LABELS:
            amount = rows[spend].to_numpy(dtype=np.float64)
            worse = dominated(reward, amount)
            parts.append(
                rows[["task", "method", "told", "runs", "solved", "reward"]].assign(
                    spend=spend,
                    amount=amount,
                    front=~worse.any(axis=1) & ~np.isnan(amount),
                    front_told=~(worse & no_more).any(axis=1) & ~np.isnan(amount),
                )
            )
    columns = "task method told runs solved reward spend amount front front_told"
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns.split())


def dominated(reward: Array, amount: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Whether method i is dominated by method j, shape ``(n, n)``: rewards and amounts (n,)."""
    as_good = (reward[None] >= reward[:, None]) & (amount[None] <= amount[:, None])
    better = (reward[None] > reward[:, None]) | (amount[None] < amount[:, None])
    return as_good & better


def targets_tables(
    results: Results,
    steps: Steps | None = None,
    *,
    spend: str = "trials",
    other_arm: OtherArm = "free",
) -> list[Table]:
    """:func:`targets_frame` over one spend as a table of text per task.

    A cell is: runs that reached the target of all runs, median spend [95 % interval]; the
    median is greater than the horizon where too few reached it within that.
    """
    frame = targets_frame(results, steps, other_arm=other_arm)
    tables = []
    for name, rows in frame[frame.spend == spend].groupby("task", sort=False):
        targets = rows.drop_duplicates("share")
        columns = [
            f"within {share:.3g} %: {target}"
            for share, target in zip(100 * targets.share, targets.target, strict=True)
        ]
        lines = [
            (str(method), *map(_target_cell, own.to_dict("records")))
            for method, own in rows.groupby("method", sort=False)
        ]
        title = f"{name}: {LABELS[spend]} to come near the optimum, other arm {other_arm}"
        tables.append(Table(title, ("method", *columns), tuple(lines)))
    return tables


def pareto_tables(results: Results) -> list[Table]:
    """The methods on some front of :func:`pareto_frame`, as a table of text per task.

    ● is on the front of all methods, ○ on that of the methods told no more.
    """
    frame = pareto_frame(results)
    tables = []
    for name, rows in frame.groupby("task", sort=False):
        kept = rows[rows.groupby("method").front_told.transform("any")]
        lines = []
        for method, own in kept.groupby("method", sort=False):
            first = own.iloc[0]
            cells = (
                _number(row["amount"]) + (" ●" if row["front"] else " ○" * row["front_told"])
                for row in own.to_dict("records")
            )
            lines.append((str(method), first.told, f"{first.reward:.1f}", *cells))
        columns = ("method", "told", "reward", *LABELS.values())
        tables.append(Table(f"{name}: Pareto sets of reward and spend", columns, tuple(lines)))
    return tables


def frontier_page(results: Results, steps: Steps) -> str:
    """Targets over trials and Pareto sets as a Markdown page."""
    tables = [
        *targets_tables(results, steps),
        *targets_tables(results, steps, other_arm="still"),
        *pareto_tables(results),
    ]
    parts = [
        "# Reward and what it costs",
        "Targets: runs that came within a share of the optimum, of all runs; median trials with "
        "its 95 % interval over all runs (Kaplan-Meier; those that could have gone on are "
        "censored, the others never reach it). Pareto sets: ● no method has a mean reward as high "
        "for as little spend, ○ none that was told no more; methods with a run that has no "
        "solution, and the optimum's searches, are left out. Spend is the median over runs; early "
        "kinematics and time are spread evenly over a run's trials. docs/results.md says more.",
    ]
    for table in tables:
        parts += [f"## {table.title}", table.to_markdown()]
    return "\n\n".join(parts) + "\n"


def _selected(
    results: Results, steps: Steps | None
) -> Iterator[tuple[CellRuns, str, list[Progress]]]:
    """Every cell and spend with the runs whose steps are known."""
    steps = progress(results) if steps is None else steps
    for cell in results.cells:
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
    means = _resampling(len(values), seed) @ values
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(means, [tail, 1 - tail], axis=0)
    return values.mean(axis=0), low, high


@cache
def _resampling(n: int, seed: int) -> Array:
    """Weights of n runs in each bootstrap resample, shape ``(RESAMPLES, n)``."""
    rng = np.random.default_rng(seed)
    return rng.multinomial(n, np.full(n, 1 / n), size=RESAMPLES) / n


def _area(run: Progress, spend: str, optimum: float, start: float, end: float) -> float:
    gaps = np.minimum(1.0, (optimum - np.concatenate([[-np.inf], run.rewards])) / abs(optimum))
    edges = np.clip(np.concatenate([[start], run.spent[spend], [end]]), start, end)
    return float(np.average(gaps, weights=np.diff(np.log(edges))))


def _times(runs: Sequence[Progress], spend: str, target: float) -> tuple[Array, float]:
    """Spend of each run to reach a reward, infinite where it did not, and the horizon."""
    most = max((run.total["trials"] for run in runs if run.solved), default=0.0)
    places = [int(np.searchsorted(run.rewards, target)) for run in runs]
    times = [
        float(run.spent[spend][place]) if place < len(run.rewards) else math.inf
        for run, place in zip(runs, places, strict=True)
    ]
    ends = [
        run.total[spend]
        for run in runs
        if run.learns and run.solved and run.total["trials"] == most
    ]
    return np.array(times), min(ends, default=math.inf)


def _target_cell(row: Mapping[Any, Any]) -> str:
    text = f"{row['reached']}/{row['runs']}"
    median, horizon = row["median"], row["horizon"]
    if not row["reached"] or (math.isinf(median) and math.isinf(horizon)):
        return text
    text += f", {_number(median)}" if math.isfinite(median) else f", > {_number(horizon)}"
    if row["runs"] == 1 or math.isinf(row["low"]):
        return text
    return text + f" [{_number(row['low'])}, {_number(row['high'])}]"


def _number(value: float) -> str:
    """An amount with three figures: 950, 12.3 k, 0.21; ∞ where there is none."""
    if math.isnan(value):
        return NONE
    if math.isinf(value):
        return "∞"
    for size, unit in ((1e6, " M"), (1e3, " k")):
        if value >= size:
            return f"{value / size:.3g}{unit}"
    return f"{value:.3g}"
