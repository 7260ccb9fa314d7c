"""Measure how far ahead a planner must look.

    coartic run studies/horizon/suite.toml
    PYTHONPATH=studies python studies/horizon/study.py results/horizon

Each plan is made three times, with numbers of postures (``nodes``) that differ by 1 %. Claims,
tables and figure use the mean over the repeats of a task. File repeats.csv has the verdicts of each
repeat. This rule was written before the repeats were run, with our expectation: no verdict changes,
and the gain of the fourth goal stays undecided.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from coartic.analysis import SIGNATURES, figures, load, means
from common.judging import judge_means
from common.writing import tabulate_runs, write_study

HERE = Path(__file__).parent
PLANNER = "receding-horizon"
STEPS = ["0", "1", "2", "3", "4", "5+", "all"]
"""Goals ahead. ``5+`` stands for five or more; ``all`` for all goals of the task, in all tasks."""


def measure_plans(study):
    """Return the plans on random tasks with their signatures.

    Column ``ahead`` is the number of goals ahead at the first movement, and ``h`` is the number of
    goals ahead that the planner sees there.
    """
    plans = study.runs[(study.runs.method == PLANNER) & study.runs.family.notna()]
    return plans.assign(
        ahead=plans.goals - 1,
        h=np.minimum(plans.horizon, plans.goals - 1),
        **{name: study.signature(name) for name in SIGNATURES},
    )


def average(plans):
    """Return means over the repeats of each plan, by task and step (:data:`STEPS`).

    Gaps are shares. ``gain`` is by how much the gap is smaller than with one goal ahead less. With
    more than five goals ahead, it is by how much it is smaller than with four. ``gain`` is NaN
    without a goal ahead, and in step ``all``. ``ahead`` is the number of goals ahead at the first
    movement.
    """
    keys = ["task", "family", "goals", "ahead", "h"]
    plans = plans.groupby(keys, sort=False)[["gap", *SIGNATURES]].mean().reset_index()
    gaps = plans.pivot_table("gap", "task", "h")
    before = [gaps.loc[task, min(h - 1, 4)] if h else np.nan
              for task, h in zip(plans.task, plans.h, strict=True)]  # fmt: skip
    plans = plans.assign(step=plans.h.map(lambda h: STEPS[min(int(h), 5)]), gain=before - plans.gap)
    every = plans[plans.h == plans.ahead].assign(step="all", gain=np.nan)
    return pd.concat([plans, every]).sort_values("step", kind="stable")


def tabulate(plans):
    """Tabulate gaps and gains by goals ahead, for all tasks and each number of goals."""
    count = plans.goals.map(lambda goals: str(goals) if goals <= 5 else "6 or more")
    by_goals = plans.assign(group="goals", value=count).sort_values("value", kind="stable")
    every = pd.concat([plans.assign(group="all", value="all"), by_goals])
    table = means(every, ["group", "value", "step"], ["gap", "gain"])
    table = table.rename(columns={"step": "h", "rows": "tasks"})
    return table.set_index((table.group + " " + table.value + " h=" + table.h).rename("row"))


def tabulate_movements(gains):
    """Tabulate the gain of the last goal in view per movement, for one to four goals ahead.

    The gain is in per cent of a movement, for each movement that has this goal ahead. Rows are for
    all tasks that have this goal, for each number of goals, and for tasks with five or more goals.
    """
    h = gains.h[(gains.h > 0) & (gains.h <= 4)].astype(int)
    gain = 100 * gains.gain * gains.goals / (gains.goals - h)
    gains = gains.loc[h.index].assign(h=h, gain=gain)
    count = gains.goals.map(lambda goals: str(goals) if goals <= 5 else "6 or more")
    many = gains[gains.goals >= 5].assign(goals="5 or more")
    parts = [gains.assign(goals="all"), gains.assign(goals=count), many]
    every = pd.concat(part.sort_values(["goals", "h"]) for part in parts)
    table = means(every, ["goals", "h"], ["gain"]).rename(columns={"rows": "tasks"})
    table["median"] = every.groupby(["goals", "h"], sort=False).gain.median().to_numpy()
    table.index = ("goals " + table.goals + " h=" + table.h.astype(str)).rename("row")
    return table


def tabulate_signatures(plans):
    """Tabulate signatures of coarticulation by goals ahead.

    Plans that already see all goals count only in the rows ``all``. ``to_come`` is what seeing all
    goals adds to the signature.
    """
    plans, rows = plans[plans.step != "5+"], []
    for name, signature in SIGNATURES.items():
        plans = plans.assign(signature=name, words=signature.words, here=plans[name])
        full = plans[plans.step == "all"].set_index("task").here
        plans["to_come"] = plans.task.map(full) - plans.here
        more = plans[(plans.ahead > plans.h) | ((plans.step == "all") & (plans.ahead > 0))]
        rows.append(more.dropna(subset=["here", "to_come"]))
    every = pd.concat(rows)
    every["to_come"] = every.to_come.where(every.step != "all")
    table = means(every, ["signature", "words", "step"], ["here", "to_come"])
    table.columns = table.columns.str.replace("here", "mean")
    table = table.rename(columns={"step": "h", "rows": "tasks"})
    return table.set_index((table.signature + " h=" + table.h).rename("row"))


def judge_claims(study, plans):
    """Judge the claims."""
    gaps = 100 * plans.pivot_table("gap", "task", "step").loc[plans.task.unique()]
    ahead = plans.groupby("task").ahead.first()[gaps.index]
    first = (gaps["0"] - gaps["1"]) - (gaps["1"] - gaps["all"])
    learner = study.runs[study.runs.method.str.startswith("dual-process")]
    behind = 100 * learner.groupby("task").gap.mean().reindex(gaps.index) - gaps["1"]
    values = {
        "first-of-several-goals-ahead-gains-most": [first[ahead > 1]],
        "further-goals-gain-little-where-they-are": [gaps["1"] - gaps["2"], gaps["3"] - gaps["4"]],
        "learner-behind-one-goal-ahead": [behind],
    }
    return judge_means(HERE / "claims.toml", values)


@figures.styled
def draw(table):
    """Draw the gap by goals ahead, with a line for each number of goals."""
    figure, (axes,) = figures.panels((1, 1), (figures.ONE, 2.6))
    rows = table[(table.group == "goals") & (table.h != "5+")]
    rows = rows[(rows.h != "all") | (rows.value == "6 or more")]
    rows = rows.assign(place=rows.h.map([*STEPS[:5], "all"].index))
    figures.means(axes, rows, x="place", y="gap", by="value", scale=100, shift=0.08, bars=0.9)
    axes.set_xticks(range(6), [*STEPS[:5], "all"])
    axes.set(xlabel="goals ahead", ylabel="gap (%)")
    axes.set_yscale("symlog", linthresh=1, linscale=0.6)
    axes.set_yticks([0, 0.5, 1, 2, 5, 10, 20, 50], ["0", "0.5", "1", "2", "5", "10", "20", "50"])
    axes.set_ylim(bottom=-0.1)
    axes.legend(title="goals of the task", loc="upper right", labelspacing=0.2)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    every = measure_plans(study)
    plans = average(every)
    repeats = {
        nodes: judge_claims(study, average(of_nodes)) for nodes, of_nodes in every.groupby("nodes")
    }
    steps = plans[plans.step != "all"]
    return {
        "results": tabulate(plans),
        "signatures": tabulate_signatures(plans),
        "gains": (gains := steps.set_index("task")[["family", "goals", "h", "gap", "gain"]]),
        "movements": tabulate_movements(gains.reset_index()),
        "runs": tabulate_runs(study),
        "claims": judge_claims(study, plans),
        "repeats": pd.concat(repeats, names=["nodes"]).reset_index("nodes"),
    }


if __name__ == "__main__":
    write_study(HERE, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)
