"""Sequences of fourteen goals: is a planner's horizon a number of goals, or a share of them?"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.claims.data import Data, judges
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.figures import style
from coartic.analysis.figures.plot import Parts, figure, missing, spoken
from coartic.analysis.methods import EC1, EC4
from coartic.analysis.section import Section
from coartic.analysis.study import Study, cached
from coartic.analysis.table import Row, Rows, runs_of, table
from coartic.analysis.topics import horizon, random_tasks
from coartic.analysis.topics.families.sample import sample
from coartic.analysis.topics.families.tables import family_runs, instance_gaps
from coartic.analysis.words import interval_in_words, plural

MANY = "fourteen-one/v1", "fourteen-two/v1"
"""Families with fourteen goals."""
HALF = "seven-one/v1", "seven-two/v1"
"""Families with half as many goals, drawn alike."""
ARMS = "one arm", "two arms"


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
    references = sample(study).references
    rows = []
    for name, plans in horizon.plans_by_horizon(study).items():
        task = study.tasks[name]
        if task.family not in MANY + HALF or 0 not in plans:
            continue
        goals, shortest = len(task.goals), -float(references[name].reward)
        together, before, longer = 0.0, 0, plans[0][0]
        for h, (ticks, cell) in sorted(plans.items()):
            more = range(before + 1, h + 1)
            movements = sum(goals - further for further in more)
            gain = 100 * (longer - ticks) / movements / (shortest / goals) if h else math.nan
            together += gain * len(more) if h else 0.0
            gap = 100 * (ticks / shortest - 1)
            rows.append((name, task.family, h, ticks, gap, gain, together, cell))
            before, longer = h, ticks
    columns = ["task", "family", "h", "ticks", "gap", "gain", "together", "cell"]
    return pd.DataFrame(rows, columns=columns)


@table("family, method, h, tasks, gap[], gain[], together[], seconds")
def fourteen(study: Study) -> Rows:
    """Gaps by goals ahead and what each goal gains, then the gaps of other methods, as shares."""
    for family, of_family in gains_by_horizon(study).groupby("family"):
        for h, rows in of_family.groupby("h"):
            row: Row = {"family": family, "method": random_tasks.RECEDING_HORIZON, "h": h}
            for name in ("gap", "gain", "together") if h else ("gap",):
                row |= random_tasks.mean_of(name, rows[name] / 100)
            row["seconds"] = float(np.mean([cell.good.cpu_s.mean() for cell in rows.cell]))
            yield f"{family} h={h}", {**row, "tasks": len(rows), **runs_of(*rows.cell)}
    gaps = instance_gaps(study)
    others = gaps[gaps.family.isin(MANY) & (gaps.method != random_tasks.RECEDING_HORIZON)]
    for other in others.drop_duplicates(["family", "method"]).to_dict("records"):
        family, method = other["family"], other["method"]
        row = {"family": family, "method": method, "tasks": other["instances"]}
        row |= {f"gap{end}": other[f"mean{end}"] for end in ("", "_low", "_high")}
        yield f"{family} {method}", row | family_runs(study, family, (method,))


@table("family, task, horizon, ticks, gain")
def gains(study: Study) -> Rows:
    """What each goal ahead gains on each task, as a share of a mean movement."""
    for each in gains_by_horizon(study).to_dict("records"):
        row: Row = {name: each[name] for name in ("family", "task", "ticks")}
        row |= {"horizon": each["h"], "gain": each["gain"] / 100}
        yield f"{each['task']} h={each['h']}", row | runs_of(each["cell"])


@figure(
    "fourteen",
    "Sequences of fourteen goals",
    "Means over random tasks with fourteen goals, for one arm and for two, with their "
    f"{style.COVERAGE} intervals (bootstrap over tasks). (a) Gap to the best known solution by "
    "goals ahead; dotted: learner, dash-dotted: CMA-ES. (b) What each goal ahead gains at a "
    "movement that has it, in per cent of a mean movement; linear below 1 %. (c) Gains together, "
    "with fourteen goals and with seven (open): on each other if a horizon is a number of goals; "
    "if it is a share, as high with seven as with twice as many goals ahead of fourteen.",
)
def draw_fourteen(study: Study) -> Parts:
    """Gaps, gains and gains together by goals ahead."""
    data = fourteen(study)
    if not data.family.isin(MANY).any():
        raise missing(study, "no runs of the planner on tasks of families with fourteen goals")
    drawing, panels = style.panels((1, 3), (style.TWO, 2.8))
    for color, name, *families in zip(style.PALETTE, ARMS, MANY, HALF, strict=False):
        rows, seven = (data[data.family == family] for family in families)
        line: Any = {"color": color, "linewidth": 1.2, "bars": 0.9, "scale": 100}
        for axes, column in zip(panels, ("gap", "gain", "together"), strict=True):
            style.means_at(axes, rows.h, rows, column, **line, label=name)
        empty = line | {"label": f"{name}, seven", "markerfacecolor": style.BACKGROUND}
        style.means_at(panels[2], seven.h, seven, "together", **empty)
        for method, dash in (("dual-process", "dotted"), ("cma-es", "dashdot")):
            for gap in rows.gap[rows.method.str.startswith(method)]:
                panels[0].axhline(100 * gap, color=color, linestyle=dash, linewidth=1)
    panels[1].axhline(MARGINS["gain"], color=style.INK, linewidth=0.7, linestyle="dashed")
    labels = "gap (%)", "gain of a goal ahead (%)", "gain together (%)"
    for axes, label in zip(panels, labels, strict=True):
        axes.set_xlabel("goals ahead")
        axes.set_xticks(range(0, 9, 2))
        axes.set_ylabel(label)
    panels[1].set_yscale("symlog", linthresh=1)
    panels[1].set_yticks([-1, 0, 1, 3, 10, 30], ["−1", "0", "1", "3", "10", "30"])
    handles, _ = panels[2].get_legend_handles_labels()
    style.legend(drawing, handles, 4)
    style.letters(panels)
    gains = spoken(data[data.gain.notna()], "{family}, {h:.0f}: {gain:.1%}")
    return drawing, data, f"Gain of a goal ahead by family and goals ahead. {gains}.", ()


def finding_of_fourteen(study: Study) -> str:
    """What each of the first goals ahead gains, of fourteen."""
    data, seen = fourteen(study), []
    for arms, family in zip(ARMS, MANY, strict=True):
        rows = data[(data.family == family) & data.h.between(1, 4)].to_dict("records")
        gains = [interval_in_words(row, "gain", scale=100) for row in rows]
        if gains:
            seen.append(f"{', '.join(gains)} with {arms} ({plural(rows[0]['tasks'], 'task')})")
    start = "Of fourteen goals the first ones ahead gain, in per cent of a mean movement that has "
    return f"{start}them ahead: {'; '.join(seen)}." if seen else ""


def values_at(data: Data, families: tuple[str, ...], h: int, column: str) -> pd.Series:
    """A column of the gains on the test tasks of families, with h goals ahead, by task."""
    every = gains_by_horizon(data.study)
    rows = every[every.family.isin(families) & (every.h == h)]
    return random_tasks.judged(data, rows).set_index("task")[column]


def fourth_goal_gains(data: Data, *, family: str, side: int) -> Finding:
    """The gain of the fourth goal ahead of fourteen, against the margin."""
    gains, sentence = values_at(data, (family,), 4, "gain"), "The fourth goal ahead gains {} %"
    return random_tasks.means_over_tasks({sentence: (gains, MARGINS["gain"], side)})


for _arms, _family in zip(ARMS, MANY, strict=True):
    for _side, _end, _than in ((-1, "little", "less"), (1, "more", "more")):
        judges(
            f"fourth-of-fourteen-gains-{_end}-on-{_arms.replace(' ', '-')}",
            test="one-tailed bootstrap test over random tasks with fourteen goals: from three "
            f"goals ahead to four the planner gains {_than} than {{gain:g}} % of a mean movement, "
            "for each movement that has a fourth goal ahead",
            family=_family,
            side=_side,
        )(fourth_goal_gains)


def two_of_fourteen(data: Data, *, side: int) -> Finding:
    """What two goals ahead of fourteen gain, less the middle of one and two of seven."""
    many, one, two = (
        values_at(data, families, h, "together").rename(lambda name: name.partition("-")[2])
        for families, h in ((MANY, 2), (HALF, 1), (HALF, 2))
    )
    sentence = "Two goals ahead of fourteen gain {} points more than the middle of seven"
    return random_tasks.means_over_tasks({sentence: (many - (one + two) / 2, 0.0, side)})


for _side, _name, _than in ((1, "number", "more"), (-1, "share", "less")):
    judges(
        f"horizon-is-a-{_name}-of-goals",
        test="one-tailed bootstrap test over pairs of random tasks, of the same arms and number, "
        "one with fourteen goals and one with seven: two goals ahead of fourteen gain "
        f"{_than} than the middle between what one and what two goals ahead gain of seven "
        "(together, in per cent of a mean movement, for each movement that has them ahead)",
        side=_side,
    )(two_of_fourteen)


def loses_more_than_planner(
    data: Data, *, who: str, labels: tuple[str, ...], h: int, arms: int
) -> Finding:
    """Gap of a method less that of the planner with h goals ahead, for so many arms at most."""
    planned, gaps = values_at(data, MANY[:arms], h, "gap"), instance_gaps(data.study)
    behind = 100 * gaps[gaps.method.isin(labels)].set_index("task").gap - planned
    runs = data.study.runs
    data.run_ids.extend(runs[runs.method.isin(labels) & runs.task.isin(planned.index)].run_id)
    sentence = f"{who} loses {{}} points more than the planner"
    return random_tasks.means_over_tasks({sentence: (behind, MARGINS["gain"], 1)})


judges(
    "learner-behind-no-goal-ahead",
    test="one-tailed bootstrap test over random tasks with fourteen goals: the learner's gap is "
    "higher by more than {gain:g} %",
    who="The learner",
    labels=(EC1, EC4),
    h=0,
    arms=2,
)(loses_more_than_planner)
judges(
    "cma-es-behind-one-goal-ahead",
    test="one-tailed bootstrap test over random tasks with fourteen goals for one arm: the gap of "
    "CMA-ES is higher by more than {gain:g} %",
    who="CMA-ES",
    labels=("cma-es/bandit",),
    h=1,
    arms=1,
)(loses_more_than_planner)


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
