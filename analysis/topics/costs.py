"""Cost of coming near the optimum: running times to reward targets.

Targets are rewards evenly spaced between those of the initial solution and of the optimum.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis import methods
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, looks_in, spoken
from coartic.analysis.settings import name_in, shown_methods
from coartic.analysis.statistics import running_times
from coartic.analysis.statistics.running_times import RunningTimes
from coartic.analysis.study import CellRuns, Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics import scores
from coartic.analysis.topics.failed import failed_runs
from coartic.analysis.words import interval, number
from coartic.robot import Array

SPENDS = ("trials", "forward_kinematics", "solve_s")
"""Kinds of cost: columns of ``runs``; ``solve_s`` is wall time in s."""
TARGETS = np.arange(1, 21) / 20
"""Targets, as shares of the way from the initial solution to the optimum."""
COSTS = (
    ("trials_to_quarter", "trials", 0.25),
    ("trials_to_half", "trials", 0.5),
    ("kinematics_to_half", "forward_kinematics", 0.5),
    ("seconds_to_half", "solve_s", 0.5),
)
"""Columns of :func:`runtimes`: kind of cost, and share of the targets."""
PANELS = {"trials": "trials", "forward_kinematics": "forward-kinematics evaluations"}
"""Spends that the figure of costs has a panel of, and their axes."""
ECDF_STEPS = 150
"""Steps of an ECDF that are drawn."""


@cached
def improvements(study: Study) -> dict[str, tuple[Array, Array]]:
    """Of runs that made trials: numbers of the trials that were better than all before, from 1,
    and their rewards, by run id."""
    by_run = {}
    for run_id, rewards in study.rewards():
        best = np.maximum.accumulate(np.where(np.isnan(rewards), -np.inf, rewards))
        steps = np.flatnonzero(best > np.concatenate([[-np.inf], best[:-1]]))
        by_run[run_id] = (steps + 1).astype(np.float64), best[steps]
    return by_run


def times_of(study: Study, cell: CellRuns, spend: str, shares: Array = TARGETS) -> Array:
    """Cost at which each run of a cell reached each target, shape ``(runs, targets)``.

    Infinite where it did not. A planner reaches all of its targets at the end. Kinematics
    evaluations and time are known as totals of the run and spread evenly over its trials, which is
    not exact: over the first 10, 100 and 1000 of 10 000 trials, evaluations were 0.6 to 1.5 times
    their even share, 3.4 times for the first 10 trials of CMA-ES on two-armed 1 (the learner, hill
    climbing and CMA-ES, six cells, one seed each); a learner without its corrective process spends
    most of them on its first trial. A run whose spend is not known, such as the time of a cold one,
    has no part; times are those of :func:`.scores.solve_times`, without building.
    """
    initial, optimum = scores.initial_and_optimum(study)[cell.task]
    targets = np.ceil(initial + shares * (optimum - initial) - 1e-9)
    runs = cell.runs
    if spend == "solve_s":
        runs = runs.assign(solve_s=scores.solve_times(cell.good).reindex(runs.index))
    rows, trials_made = [], scores.floats(runs.trials)
    total, reward = scores.floats(runs[spend]), scores.floats(runs.reward)
    for place, (run_id, status) in enumerate(zip(runs.run_id, runs.status, strict=True)):
        if status != "ok":
            rows.append(np.full(len(targets), math.inf))
        elif np.isfinite(total[place]):
            spent, rewards = total[[place]], reward[[place]]
            if str(run_id) in improvements(study):
                trials, rewards = improvements(study)[str(run_id)]
                spent = (
                    trials if spend == "trials" else total[place] * (trials / trials_made[place])
                )
            rows.append(np.append(spent, math.inf)[np.searchsorted(rewards, targets)])
    return np.array(rows).reshape(-1, len(targets))


@cached
def costs(study: Study) -> dict[tuple[str, str], RunningTimes]:
    """Running times over :func:`.scores.common_tasks` by method and spend."""
    by_method: dict[tuple[str, str], RunningTimes] = {}
    for method, cells in cells_compared(study).items():
        for spend in SPENDS:
            times = [times_of(study, cell, spend) for cell in cells]
            if all(map(len, times)):
                by_method[method, spend] = times
    return by_method


def cells_compared(study: Study) -> dict[str, list[CellRuns]]:
    """Cells of each method that ran on all of :func:`.scores.common_tasks`, in lists' order."""
    tasks, compared = scores.common_tasks(study), scores.compared(study)
    return {
        method: [cell for task, cell in compared[method].items() if task in tasks]
        for method in methods.in_order(compared)
        if compared[method].keys() >= {*tasks}
        and not (len(tasks) == 1 and method.startswith(methods.TOGETHER))
    }


@table(
    "method, reached, trials_to_quarter[], trials_to_half[], kinematics_to_half[], "
    "seconds_to_half[], half on *",
)
def runtimes(study: Study) -> Rows:
    """Cost of a quarter and of half of the targets; ``half on``: median trials to the
    target halfway, by task, infinite where most runs never reach it."""
    for method, cells in cells_compared(study).items():
        if (method, "trials") not in costs(study):
            continue
        times = costs(study)[method, "trials"]
        row: Row = {"method": method, "reached": running_times.share_reached(times)}
        for name, spend, share in COSTS:
            if (method, spend) in costs(study):
                row |= running_times.budget_for(costs(study)[method, spend], share).columns(name)
        if scores.groups(study)[method] == scores.BY_TRIAL:
            of_method = scores.compared(study)[method]
            for task in (task for task in scores.initial_and_optimum(study) if task in of_method):
                half = times_of(study, of_method[task], "trials", np.array([0.5]))
                row[f"half on {task}"] = float(np.quantile(half, 0.5, method="inverted_cdf"))
        yield method, row | runs_of(*cells)


@figure(
    "What it costs to come near",
    f"Share of {len(TARGETS)} reward targets reached within a budget (mean over all "
    "tasks where there are several). Targets are evenly spaced from the initial solution to the "
    "optimum; a run counts for each target that it has reached. a: trials; planners make none and "
    "are lines. b: forward-kinematics evaluations, spread evenly over a run's trials.",
)
def draw_runtimes(study: Study) -> Parts | None:
    """Share of targets reached, against trials and kinematics."""
    data = ecdf_curves(study)
    spends = [spend for spend in PANELS if (data.budget[data.spend == spend] > 0).any()]
    if not spends:
        return None
    looks = looks_in(study, data.method.unique())
    size = style.TWO, 2.4 + 0.16 * -(-len(looks) // 3)
    drawing, panels = style.panels((1, len(spends)), size)
    for axes, spend in zip(panels, spends, strict=True):
        draw_shares(axes, study, data[data.spend == spend], looks)
        axes.set_title(f"By {PANELS[spend]}")
        axes.set_xlabel(PANELS[spend])
        axes.set_ylabel("targets reached (%)")
    style.letters(panels)
    ends = data[data.spend == spends[-1]].groupby("method", sort=False).tail(1)
    ends = ends.assign(share=100 * ends.share)
    entries = [style.legend_line(name_in(study, label), **look) for label, look in looks.items()]
    style.legend(drawing, entries, 3)
    shares = spoken(ends, "{method} {share:.0f} %")
    alt = f"Share of reward targets reached against what was spent. At the end: {shares}."
    return drawing, data, alt, study.tasks.values()


def ecdf_curves(study: Study) -> pd.DataFrame:
    """Share of targets reached within a budget, of the main methods.

    A row at every step that is drawn: ``method``, ``spend`` (of :data:`PANELS`), ``budget``,
    ``share``.
    """
    parts = [pd.DataFrame(columns=["method", "spend", "budget", "share"])]
    for label in methods.in_order(shown_methods(study, runtimes(study).index)):
        for spend in PANELS:
            if (label, spend) in costs(study):
                budget, share = running_times.share_by_budget(costs(study)[label, spend])
                count = min(len(budget), ECDF_STEPS)
                at = np.unique(np.linspace(0, len(budget) - 1, count).round()).astype(int)
                rows = {"budget": budget[at], "share": share[at]}
                parts.append(pd.DataFrame({"method": label, "spend": spend, **rows}))
    return pd.concat(parts[1:] or parts, ignore_index=True)


def draw_shares(
    axes: Axes, study: Study, data: pd.DataFrame, looks: Mapping[str, style.Look]
) -> None:
    """A step curve for each method."""
    style.log_axis(axes)
    positive = data.budget[data.budget > 0]
    least, most = positive.min(), positive.max()
    edge = least / 1.5
    axes.axhline(50, color=style.GREY, linewidth=0.5)
    for label, rows in data.groupby("method", sort=False):
        x = np.concatenate([rows.budget.clip(lower=edge), [most]])
        y = np.concatenate([100 * rows.share, [100 * rows.share.iloc[-1]]])
        line: Any = {**looks[str(label)], "linewidth": 1.3}
        (drawn,) = axes.step(x, y, where="post", **line)
        name = name_in(study, str(label))
        style.tip(drawn, f"{name}: {y[-1]:.0f} % of the targets in the end")
    axes.set_xlim(edge, most)
    axes.set_ylim(-2, 102)


def what_it_costs(study: Study) -> str:
    """Trials that the learner and its rival need for half of the targets."""
    table = runtimes(study)
    learners = [label for label in methods.main_methods(table.index) if methods.is_learner(label)]
    if not learners:
        return ""
    others = [
        label
        for label in table.index
        if not methods.is_learner(label) and scores.groups(study)[label] == scores.BY_TRIAL
    ]
    # The other method that learns from the reward of trials and reaches most targets.
    rival = [table.reached[others].idxmax()] if others else []
    rows = table.loc[[learners[0], *rival]].to_dict("records")
    names = ["the learner", *(methods.name_of(row["method"]) for row in rows[1:])]
    halves = [row["trials_to_half"] for row in rows]
    ends = [f"{number(100 * row['reached'], 0)} %" for row in rows]
    reached = " and ".join(f"{name} reaches {end}" for name, end in zip(names, ends, strict=True))
    text = f"Of the reward targets between initial solution and optimum, {reached}."
    if len(rows) == 2 and np.isfinite(halves).all():
        ours, theirs = (interval(row, "trials_to_half", digits=0) for row in rows)
        text = (
            f"To get halfway from the initial solution to the optimum, the learner needs {ours} "
            f"trials; {names[1]} needs {theirs}. In the end they reach {ends[0]} and {ends[1]} of "
            "the reward targets."
        )
    cells = [
        (task, cell.label)
        for method, of_method in scores.compared(study).items()
        if scores.groups(study)[method] == scores.BY_TRIAL
        for task, cell in of_method.items()
    ]
    return text + failed_runs(study, cells, " and count as reaching nothing")
