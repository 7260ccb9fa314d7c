"""Sequences of fourteen goals: is a planner's horizon a number of goals, or a share of them?"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from coartic.analysis.claims.data import Data, judges
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing
from coartic.analysis.methods import most_exploring
from coartic.analysis.optima import gap_share
from coartic.analysis.section import Section
from coartic.analysis.statistics.estimates import FEWEST
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics import horizon, random_tasks
from coartic.analysis.topics.families.sample import sample
from coartic.analysis.words import plural

MANY, HALF = 14, 7
FAMILIES = ("fourteen-one/v1", "fourteen-two/v1", "seven-one/v1", "seven-two/v1")
"""Families with :data:`MANY` goals, and with half as many."""
CMA_ES = "cma-es/bandit"
PLAIN = "planned", "none"
"""``hands`` and ``costs`` of the planner that chooses its hands, and takes all joints alike."""


@cached
def gains_by_horizon(study: Study) -> pd.DataFrame:
    """What each goal ahead gains a planner, a row for each task and horizon.

    With h goals ahead it sees more than with h − 1 at n − h movements of n alone; from then on
    both see all that is left. So the difference of their ticks, of the whole task, is due to those
    movements, and what the postures after them are worth is counted. ``gain`` is that difference
    for each of those movements, in per cent of a mean movement of the best known solution; where
    no run has the horizon before, of each goal since the last that was run, alike. ``together``:
    the gains of all goals ahead up to this one. ``gap``: per cent of the best known.
    """
    references = instances.references if (instances := sample(study)) else {}
    rows = []
    for (name, *kind), plans in horizon.plans_by_horizon(study).items():
        task = study.tasks[name]
        if task.family not in FAMILIES or tuple(kind) != PLAIN or 0 not in plans:
            continue
        goals, shortest = len(task.goals), -float(references[name].reward)
        together, before, longer = 0.0, 0, plans[0][0]
        for h, (ticks, cell) in sorted(plans.items()):
            more = range(before + 1, h + 1)
            movements = sum(goals - further for further in more)
            gain = math.nan
            if movements:
                gain = 100 * (longer - ticks) / movements / (shortest / goals)
                together += gain * len(more)
            rows.append(
                {
                    "task": name,
                    "goals": goals,
                    "arms": horizon.KINDS["arms"](task),
                    "h": h,
                    "gap": 100 * (ticks / shortest - 1),
                    "gain": gain,
                    "together": together,
                    "cell": cell,
                }
            )
            before, longer = h, ticks
    columns = ["task", "goals", "arms", "h", "gap", "gain", "together", "cell"]
    return pd.DataFrame(rows, columns=columns)


@table("goals, arms, method, h, tasks, gap[], gain[], together[], seconds")
def fourteen(study: Study) -> Rows:
    """Gaps by goals ahead and what each goal gains, then the gaps of other methods, as shares."""
    every, instances = gains_by_horizon(study), sample(study)
    for (goals, arms), of_tasks in every.groupby(["goals", "arms"]):
        group: Row = {"goals": goals, "arms": arms}
        for h, rows in of_tasks.groupby("h"):
            row = {**group, "method": random_tasks.RECEDING_HORIZON, "h": h, "tasks": len(rows)}
            for name in ("gap", "gain", "together") if h else ("gap",):
                row |= random_tasks.mean_of(name, rows[name] / 100)
            row["seconds"] = float(np.mean([cell.good.cpu_s.mean() for cell in rows.cell]))
            yield f"{goals} {arms} h={h}", row | runs_of(*rows.cell)
        assert instances is not None  # of its tasks are the rows
        names = list(dict.fromkeys(of_tasks.task))
        for label in instances.labels:
            gaps = {name: instances.gap(name, label) for name in names}
            there = pd.Series({n: gap.mean() for n, gap in gaps.items() if gap is not None})
            if label.startswith(random_tasks.RECEDING_HORIZON) or not len(there):
                continue
            cells = [study.cells[name, label] for name in there.index]
            row = {**group, "method": label, "tasks": len(there)}
            row |= random_tasks.mean_of("gap", there)
            row["seconds"] = float(np.mean([cell.good.cpu_s.mean() for cell in cells]))
            yield f"{goals} {arms} {label}", row | runs_of(*cells)


@figure(
    "fourteen",
    "Sequences of fourteen goals",
    "Means over random tasks with fourteen goals, for one arm and for two, with their "
    f"{style.CONFIDENCE} intervals (bootstrap over tasks). (a) Gap to the best known solution by "
    "goals ahead; dotted: learner, dash-dotted: CMA-ES. (b) What each goal ahead gains at a "
    "movement that has it, in per cent of a mean movement. (c) Gains together, with fourteen goals "
    "and with seven (open): they lie on each other if a horizon is a number of goals; if it is a "
    "share, those with seven are as high with half as many goals ahead.",
)
def draw_fourteen(study: Study) -> Parts:
    """Gaps, gains and gains together by goals ahead."""
    data = fourteen(study)
    if not (data.goals == MANY).any():
        raise missing(study, f"no runs of the planner on tasks of families with {MANY} goals")
    drawing, panels = style.figure_of((1, 3), (style.TWO, 2.5))
    for color, arms in zip(style.PALETTE, ("one", "two"), strict=False):
        rows = data[(data.arms == arms) & (data.goals == MANY)]
        planned = rows[rows.h.notna()]
        name = f"{arms} arm{'s' * (arms == 'two')}"
        for axes, column in zip(panels, ("gap", "gain", "together"), strict=True):
            curve(axes, planned, column, color, name)
        for start, dash in (("dual-process", "dotted"), (CMA_ES, "dashdot")):
            beside = rows[rows.method.str.startswith(start)]
            for gap in beside.gap:
                panels[0].axhline(100 * gap, color=color, linestyle=dash, linewidth=1)
        seven = data[(data.arms == arms) & (data.goals == HALF) & data.h.notna()]
        curve(panels[2], seven, "together", color, f"{name}, seven", markerfacecolor=style.PAPER)
    panels[1].axhline(MARGINS["gain"], color=style.INK, linewidth=0.7, linestyle="dashed")
    labels = "gap (%)", "gain of a goal ahead (%)", "gain together (%)"
    for axes, label in zip(panels, labels, strict=True):
        axes.set_xlabel("goals ahead")
        axes.set_ylabel(label)
    panels[0].legend(loc="upper right")
    panels[2].legend(loc="lower right")
    style.letters(panels)
    gains = data[(data.goals == MANY) & data.gain.notna()]
    each = (
        f"{a}, {h:.0f}: {g:.1%}" for a, h, g in zip(gains.arms, gains.h, gains.gain, strict=True)
    )
    return drawing, data, f"Gain of a goal ahead by arms and goals ahead. {'; '.join(each)}.", ()


def curve(axes: Axes, rows: pd.DataFrame, column: str, color: str, name: str, **look: Any) -> None:
    """Means by goals ahead with their intervals."""
    rows = rows[rows[column].notna()]
    low, high = 100 * rows[f"{column}_low"], 100 * rows[f"{column}_high"]
    axes.vlines(rows.h, low, high, color=color, linewidth=0.9)
    line: Any = {"color": color, "marker": "o", "markersize": 3, "linewidth": 1.2, **look}
    axes.plot(rows.h, 100 * rows[column], **line, label=name)


def finding_of_fourteen(study: Study) -> str:
    """What each of the first goals ahead gains, of fourteen."""
    data = fourteen(study)
    data = data[(data.goals == MANY) & data.gain.notna() & (data.tasks >= FEWEST)]
    sentences = []
    for arms, rows in data.groupby("arms"):
        first = rows[rows.h.isin(range(1, 5))].to_dict("records")
        gains = (random_tasks.interval_in_words(row, "gain", " %", scale=100) for row in first)
        tasks = plural(rows.tasks.max(), "random task")
        sentences.append(f"on {tasks} with {MANY} goals, {arms}-armed, {', '.join(gains)}")
    if not sentences:
        return ""
    return (
        "In per cent of a mean movement that has it in view, the first to the fourth goal ahead "
        f"gain {'; '.join(sentences)}."
    )


def values_at(data: Data, goals: int, h: int, column: str) -> pd.Series:
    """A column of the gains on test tasks with so many goals, by arms and instance."""
    every = gains_by_horizon(data.study)
    rows = every[(every.goals == goals) & (every.h == h)]
    rows = rows[rows.task.map(lambda name: data.task(name).split != "development").astype(bool)]
    data.run_ids.extend(run for cell in rows.cell for run in cell.good.run_id)
    index = [rows.arms, rows.task.str.rsplit("/").str[-1]]
    return pd.Series(rows[column].to_numpy(), pd.MultiIndex.from_arrays(index))


def fourth_goal_gains(data: Data, *, arms: str, side: int) -> Finding:
    """The gain of the fourth goal ahead of fourteen, against the margin."""
    gains = values_at(data, MANY, 4, "gain")
    gains = gains[gains.index.get_level_values(0) == arms]
    sentence = "The fourth goal ahead gains {} %"
    return random_tasks.means_over_tasks({sentence: (gains, MARGINS["gain"], side)})


for _arms, _words in (("one", "one arm"), ("two", "two arms")):
    for _side, _end, _than in ((-1, "little", "less"), (1, "more", "more")):
        judges(
            f"fourth-of-fourteen-gains-{_end}-on-{_words.replace(' ', '-')}",
            test="one-tailed bootstrap test over random tasks with fourteen goals: from three "
            f"goals ahead to four the planner gains {_than} than {{gain:g}} % of a mean movement, "
            "for each movement that has a fourth goal ahead",
        )(partial(fourth_goal_gains, arms=_arms, side=_side))


def two_of_fourteen(data: Data, *, side: int) -> Finding:
    """What two goals ahead of fourteen gain, less the middle of one and two of seven."""
    many = values_at(data, MANY, 2, "together")
    one, two = (values_at(data, HALF, h, "together") for h in (1, 2))
    sentence = f"Two goals ahead of {MANY} gain {{}} points more than the middle of {HALF}"
    return random_tasks.means_over_tasks({sentence: (many - (one + two) / 2, 0.0, side)})


for _side, _name, _than in ((1, "number", "more"), (-1, "share", "less")):
    judges(
        f"horizon-is-a-{_name}-of-goals",
        test="one-tailed bootstrap test over pairs of random tasks, of the same arms and number, "
        "one with fourteen goals and one with seven: two goals ahead of fourteen gain "
        f"{_than} than the middle between what one and what two goals ahead gain of seven "
        "(together, in per cent of a mean movement, for each movement that has them ahead)",
    )(partial(two_of_fourteen, side=_side))


def behind_planner(data: Data, h: int, arms: tuple[str, ...], label: str = "") -> pd.Series:
    """Gap of a method, else of the learner, less that of the planner, on tasks with fourteen."""
    instances = sample(data.study)
    every = gains_by_horizon(data.study)
    rows: Any = every[(every.goals == MANY) & (every.h == h) & every.arms.isin(arms)]
    behind = {}
    for row in rows.itertuples():
        name, task = row.task, data.task(row.task)
        cell = data.study.cells.get((name, label or most_exploring(task)))
        if instances and task.split != "development" and cell is not None and len(cell.good):
            gap = gap_share(cell.rewards, instances.references[name].reward)
            behind[name] = 100 * float(gap.mean()) - row.gap
            data.run_ids.extend([*cell.good.run_id, *row.cell.good.run_id])
    return pd.Series(behind, dtype=np.float64)


@judges(
    "learner-behind-no-goal-ahead",
    test="one-tailed bootstrap test over random tasks with fourteen goals: the learner's gap is "
    "higher by more than {gain:g} %",
)
def learner_behind_no_goal_ahead(data: Data) -> Finding:
    """Gap of the learner less that of the planner without look-ahead."""
    behind = behind_planner(data, 0, ("one", "two"))
    sentence = "The learner loses {} points more than the planner without look-ahead"
    return random_tasks.means_over_tasks({sentence: (behind, MARGINS["gain"], 1)})


@judges(
    "cma-es-behind-one-goal-ahead",
    test="one-tailed bootstrap test over random tasks with fourteen goals for one arm: the gap of "
    "CMA-ES is higher by more than {gain:g} %",
)
def cma_es_behind_one_goal_ahead(data: Data) -> Finding:
    """Gap of CMA-ES less that of the planner with one goal ahead, with no hands to choose."""
    behind = behind_planner(data, 1, ("one",), CMA_ES)
    sentence = "CMA-ES loses {} points more than the planner with one goal ahead"
    return random_tasks.means_over_tasks({sentence: (behind, MARGINS["gain"], 1)})


FOURTEEN = Section(
    "fourteen",
    short="Fourteen",
    title="Is a horizon a number of goals, or a share?",
    caption="Gaps by goals ahead, and what each goal ahead gains; gaps of other methods",
    finding=finding_of_fourteen,
    figure="fourteen",
    table="fourteen",
    note=(
        "The gain of a goal ahead is per movement that has so many goals ahead, in per cent of a "
        "mean movement of the best known solution. Where a horizon was left out it is that of each "
        "goal since the last."
    ),
)
