"""Section on costs: running times to reward targets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis import standings
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, looks_in, name_in_figure, spoken
from coartic.analysis.method_frame import BY_TRIAL, headline_methods
from coartic.analysis.statistics import running_times
from coartic.analysis.study import Study, cached, load, solved
from coartic.analysis.table import Row, Rows, run_ids, table
from coartic.errors import CoarticError
from coartic.internal.limits import brief_value, real_array
from coartic.robot import Array

SPENDS = ("trials", "forward_kinematics", "solve_s")
"""Costs, as columns of :attr:`.Study.runs`; ``solve_s`` is wall time, s."""
TARGETS = tuple(n / 20 for n in range(1, 21))
"""Targets, as shares of the distance from the corrective process alone, with its best hands, to the
optimum."""
COSTS = (
    ("trials_to_quarter", "trials", 0.25),
    ("trials_to_half", "trials", 0.5),
    ("forward_kinematics_to_half", "forward_kinematics", 0.5),
    ("seconds_to_half", "solve_s", 0.5),
)
"""Columns of :func:`list_runtimes`, each with its cost and the share of the targets to reach."""
PANELS = {"trials": "trials", "forward_kinematics": "forward-kinematics evaluations"}
"""Costs with a panel in the figure, and the labels of their axes."""


@cached
def improvements(study: Study) -> dict[str, tuple[Array, Array]]:
    """Return for each run with rewards of trials, by run id, the numbers, from 1, of the trials
    with a higher reward than all trials before, and these rewards, negative ticks; shape ``(n,)``
    each."""
    by_run = {}
    for run_id, rewards in study.rewards():
        best = np.fmax.accumulate(np.append(-np.inf, rewards))  # without NaN
        trials = 1 + np.flatnonzero(best[1:] > best[:-1])
        by_run[run_id] = trials.astype(np.float64), best[trials]
    return by_run


def best_after(steps: tuple[Array, Array], trials: Any) -> Array:
    """Return a run's best reward, negative ticks, after each number of trials in ``trials``, in the
    shape of ``trials``; NaN before the first reward. ``steps``: the trials of the run with a new
    best reward, from 1, and these rewards (:func:`improvements`)."""
    numbers, rewards = steps
    return np.asarray(np.append(math.nan, rewards)[np.searchsorted(numbers, trials, "right")])


@cached
def spans(study: Study) -> dict[str, tuple[float, int]]:
    """Return the two rewards between which targets lie, negative ticks, by name of the task:
    :attr:`.Study.corrective_best`, of the corrective process alone, and the best known reward.

    Tasks without one of the two, or with equal ones, are left out.
    """
    zero = study.corrective_best
    rewards = {name: (zero[name], best.reward) for name, best in study.optima.items()}
    return {name: pair for name, pair in rewards.items() if pair[0] < pair[1]}  # NaN: none


def times_of(
    study: Study, task: str, label: str, spend: str, shares: tuple[float, ...] = TARGETS
) -> Array:
    """Return the cost ``spend`` (``trials``, ``forward_kinematics`` or ``solve_s``) at which each
    run of a method on a task of :func:`spans` reached each target, shape ``(runs, targets)``.

    ``shares`` are the targets, as shares of the distance from the corrective process alone to the
    optimum. Infinite for a target that no trial of the run reached, and for a failed run; a solved
    run without a known cost has no row. A run without rewards of trials reaches the targets of its
    solution at its end. Forward-kinematics evaluations and
    time (:func:`solve_times`) are totals of a run, spread evenly over its trials, though early
    trials took 0.6 to 3.4 times as many evaluations.
    """
    initial, optimum = spans(study)[task]
    targets = np.ceil(initial + np.array(shares) * (optimum - initial) - 1e-9)
    runs, learned, rows = study.cells[task, label], improvements(study), []
    totals = runs[spend]
    if spend == "solve_s":
        totals = solve_times(solved(runs)).reindex(runs.index)
    for run_id, status, made, total, reward in zip(
        runs.run_id, runs.status, runs.trials, totals, runs.reward, strict=True
    ):
        if status != "ok":
            rows.append(np.full(len(targets), math.inf))
        elif not pd.isna(total):
            spent, rewards = np.array([float(total)]), np.array([float(reward)])
            if str(run_id) in learned:
                trials, rewards = learned[str(run_id)]
                spent = trials if spend == "trials" else total * (trials / made)
            rows.append(np.append(spent, math.inf)[np.searchsorted(rewards, targets)])
    return np.array(rows).reshape(-1, len(targets))


def solve_times(runs: pd.DataFrame) -> pd.Series:
    """Return the wall time of solving, s, of the runs that were made in warm processes, or of all
    runs if no process was warm, by the index of ``runs``; of a run without a time of solving above
    0 its whole wall time."""
    times = runs.solve_s.where(runs.solve_s > 0, runs.wall_s)
    warm = runs.warm.to_numpy(bool, na_value=False)
    return times[warm] if warm.any() else times


def _runs_with_targets(study: Study) -> dict[str, pd.DataFrame]:
    """Return, by label, the runs of each method that ran on all tasks with targets (:func:`spans`)
    among the ranked tasks."""
    tasks = [task for task in standings.ranked_tasks(study) if task in spans(study)]
    of_methods = {}
    for method, every in standings.runs_by_method(study).items():
        runs = every[every.task.isin(tasks)]
        if len(runs) and runs.task.nunique() == len(tasks):
            of_methods[method] = runs
    return of_methods


def _times_on_tasks(
    study: Study, runs: pd.DataFrame, spend: str, shares: tuple[float, ...] = TARGETS
) -> list[Array]:
    """Return a list of the costs at which targets were reached, shape ``(runs, targets)`` each
    (:func:`times_of`), for each cell of ``runs``, runs of a method, in their order."""
    return [times_of(study, *cell, spend, shares) for cell in standings.cells_of(runs)]


def runtimes(
    results: str | Path | Study, *, targets: Sequence[float] | Array = TARGETS
) -> pd.DataFrame:
    """Return the share of reward targets that methods reach within a budget: the ECDF of running
    times.

    Methods are those that ran on all ranked tasks that have targets; a failed run reaches none.
    Tasks have the same weight.

    Parameters
    ----------
    results : str, Path or Study
        A results folder, or its study.
    targets : sequence of float, shape (n,), optional
        Shares of the distance from the corrective process alone, with its best hands, to the
        optimum, above 0 and up to 1; by default 0.05, 0.1, ..., 1. Targets are rounded up to whole
        ticks.

    Returns
    -------
    pandas.DataFrame
        A row for each budget at which the share rises: ``method``, ``spend`` (``trials``;
        ``forward_kinematics``, evaluations, and ``solve_s``, seconds, both spread evenly over the
        trials of a run), ``budget``, and ``share``, the share of the pairs of run and target
        reached within the budget. A method that reaches no target has a single row for each cost,
        with share 0 and an infinite budget; a method without a known cost on a task has no row for
        this cost.

    Raises
    ------
    CoarticError
        The folder is no results folder, targets are out of bounds, or no task has a best known
        reward above the reward of the corrective process alone.
    """
    study = results if isinstance(results, Study) else load(results)
    shares = np.empty(0)
    with suppress(ValueError):  # no numbers, or masked
        shares = real_array("targets", targets)
    if shares.ndim != 1 or not shares.size or not ((shares > 0) & (shares <= 1)).all():
        raise CoarticError(
            f"targets are {brief_value(targets)}: needed are numbers above 0 and up to 1"
        )
    if not spans(study):
        raise CoarticError("no task has a best known reward above the corrective process alone")
    rows = []
    for name, runs in _runs_with_targets(study).items():
        for spend in SPENDS:
            times = _times_on_tasks(study, runs, spend, tuple(shares.tolist()))
            if all(map(len, times)):
                steps = zip(*running_times.share_by_budget(times), strict=True)
                rows += [(name, spend, *step) for step in steps]
    return pd.DataFrame(rows, columns=["method", "spend", "budget", "share"])


@table(
    "Cost of reaching shares of the targets",
    "method; reached: targets reached (%) .0; "
    "trials_to_quarter[]: trials to a quarter of the targets; "
    "trials_to_half[]: trials to half of the targets; "
    "forward_kinematics_to_half[]: forward-kinematics evaluations to half of the targets; "
    "seconds_to_half[]: seconds to half of the targets; half on *: -",
)
def list_runtimes(study: Study) -> Rows:
    """Yield a row for each method of :func:`runtimes` with known numbers of trials: the share of
    targets reached, and the costs of reaching a quarter and half of the targets (:data:`COSTS`).

    ``half on *``, for methods that use the reward of each trial: median number of trials to the
    target halfway to the optimum on a task, infinite if most runs do not reach this target.
    """
    for method, runs in _runs_with_targets(study).items():
        times = {spend: _times_on_tasks(study, runs, spend) for spend in SPENDS}
        if not all(map(len, times["trials"])):
            continue
        reached = running_times.share_reached(times["trials"])
        row: Row = {"method": method, "reached": reached}
        for name, spend, share in COSTS:
            if all(map(len, times[spend])):
                row |= running_times.budget_for(times[spend], share).columns(name)
        if study.methods.information[method] == BY_TRIAL:
            for task, label in standings.cells_of(runs):
                half = times_of(study, task, label, "trials", (0.5,))
                row[f"half on {task}"] = float(np.quantile(half, 0.5, method="inverted_cdf"))
        yield method, row | run_ids(runs)


@figure(
    "What it costs to come near",
    f"Share of {len(TARGETS)} reward targets reached within a budget. Targets are evenly spaced "
    "from the corrective process alone, with its best hands, to the {reference}; a run counts for "
    "each target that it reached. Forward-kinematics evaluations are spread evenly over a run's "
    f"trials. Bands: {style.COVERAGE} bootstrap intervals over runs. n = {{n}} runs of a method.",
)
def draw_runtimes(study: Study) -> Parts | None:
    """Draw the share of targets that methods reach within a number of trials, and of
    forward-kinematics evaluations, a panel each, or only one if the other has no curve; None
    without a curve.

    Among :func:`.headline_methods`, without the corrective process alone, curves are for methods
    that use the reward of each trial, for methods from files, and for the method that reaches most
    targets without using the reward of each trial.
    """
    if not len(tabled := list_runtimes(study)):
        return None
    rows = study.methods.loc[[*tabled.index]]
    rows = rows.loc[headline_methods(rows)]
    rows = rows[rows.algorithm != "corrective process alone"]
    plans = rows.index[rows.information != BY_TRIAL]
    best = tabled.reached[plans].idxmax() if len(plans) else None
    curves = rows.index[(rows.information == BY_TRIAL) | ~rows.built_in | (rows.index == best)]
    data = runtimes(study)
    shown = data.method.isin(curves) & (data.budget > 0) & (data.budget < math.inf)
    data = data[shown & data.spend.isin(PANELS)]
    if data.empty:
        return None
    steps = []
    for (label, spend), curve in data.groupby(["method", "spend"], sort=False):
        # No more than are seen.
        curve = curve.iloc[np.unique(np.linspace(0, len(curve) - 1, 100).round()).astype(int)]
        runs = _runs_with_targets(study)[str(label)]
        times = _times_on_tasks(study, runs, str(spend))
        low, high = running_times.interval_by_budget(times, curve.budget.to_numpy())
        steps.append(curve.assign(share_low=low, share_high=high, runs=len(runs)))
    data = pd.concat(steps, ignore_index=True)
    looks = looks_in(study, data.method.unique())
    spends = [spend for spend in PANELS if (data.spend == spend).any()]
    drawing, panels = style.panels(
        (1, len(spends)), (style.TWO, 1.9 if style.is_narrow() else 2.6), sharey=True
    )
    for axes, spend in zip(panels, spends, strict=True):
        style.log_axis(axes)
        of_spend = data[data.spend == spend]
        edge, most = of_spend.budget.min() / 1.5, of_spend.budget.max()
        most = max(most, 10 ** round(math.log10(most)))  # with the number at the end
        axes.axhline(50, color=style.GREY, linewidth=0.5)
        for label, rows in of_spend.groupby("method", sort=False):
            x = np.append(rows.budget, most)
            y, low, high = (
                100 * np.append(rows[name], rows[name].iloc[-1])
                for name in ("share", "share_low", "share_high")
            )
            look = looks[str(label)]
            axes.fill_between(
                x, low, high, step="post", color=look["color"], alpha=0.22, linewidth=0
            )
            (drawn,) = axes.step(x, y, where="post", **look)
            name = study.methods.title[str(label)]
            style.tip(drawn, f"{name}: {y[-1]:.0f} % of the targets in the end")
        axes.set_xlim(edge, most)
        axes.set_ylim(-2, 102)
        axes.set_title(f"By {PANELS[spend]}")
        axes.set_xlabel(PANELS[spend])
    panels[0].set_ylabel("targets reached (%)")
    at, grey = panels[0].get_yaxis_transform(), style.GREY
    panels[0].text(0.01, 51, "half of the targets", color=grey, va="bottom", transform=at)
    style.letters(panels)
    ends = data.groupby("method", sort=False).tail(1)
    ends = ends.assign(share=100 * ends.share).sort_values("share")
    height = -math.inf
    for end in ends.to_dict("records"):
        height = max(end["share"], height + (9 if style.is_narrow() else 6.5))
        at, look = panels[-1].get_yaxis_transform(), looks[end["method"]]
        mark: Any = {"color": look["color"], "markersize": 4, "markeredgewidth": 0}
        panels[-1].plot(1.03, height, look["marker"], transform=at, clip_on=False, **mark)
        panels[-1].annotate(
            name_in_figure(study, end["method"]), (1.03, height), (5, 0), va="center",
            xycoords=at, textcoords="offset points", annotation_clip=False,
            weight="normal" if study.methods.built_in[end["method"]] else "bold",
        )  # fmt: skip
    shares = spoken(study, ends, "{title} {share:.0f} %")
    alt = f"Share of reward targets reached against what was spent. At the end: {shares}."
    return drawing, data, alt, " Means over all tasks." * (len(spans(study)) > 1)
