r"""Is a planner's horizon a number of goals, or a share of those left?

    coartic run studies/fourteen/suite.toml \
        --family-file studies/fourteen/fourteen-one.v1.toml \
        --family-file studies/fourteen/fourteen-two.v1.toml \
        --family-file studies/fourteen/seven-one.v1.toml \
        --family-file studies/fourteen/seven-two.v1.toml
    PYTHONPATH=studies python studies/fourteen/study.py results/fourteen
"""

import sys
from pathlib import Path

import pandas as pd
from scipy import stats

from coartic.analysis import figures, load, mean, means, other_tasks
from common.judging import judge_means, mean_beyond
from common.writing import tabulate_runs, write_study

HERE = Path(__file__).parent
PLANNER = "receding-horizon"
OTHERS = [
    "dual-process/EC1", "dual-process/EC4", "cma-es/bandit", "cma-es/goal-by-goal",
    "hill-climbing", "random-search", "corrective-alone/given",
]  # fmt: skip
ARMS = ["one arm", "two arms"]
MANY = ["fourteen-one/v1", "fourteen-two/v1"]
HALF = ["seven-one/v1", "seven-two/v1"]
"""Families with half as many goals, drawn alike."""
FIRST = 28
"""Number of tasks with two arms that were planned first."""
GAIN = 1.0
"""Per cent. The question is at which horizon a further goal gains less than this; it is also what
counts as equivalent to a published reward."""


def measure_plans(study):
    """Return plans, a row for each task, number of ``nodes`` and horizon, with what their goals
    ahead gain.

    With h goals ahead the planner sees more than with h - 1 at n - h movements of n alone. ``gain``
    is the difference of their ticks for each of those movements, as a share of a mean movement of
    the best known solution; where no run has the horizon ``before``, of each goal since the last
    that was run, alike. ``together``: the gains of all goals ahead up to this one.
    """
    plans = study.runs[(study.runs.method == PLANNER) & study.runs.gap.notna()]
    numbers = plans[["horizon", "goals", "reward", "best_known", "nodes"]].astype(int)
    order = pd.Categorical(plans.task, plans.task.unique())  # as in the suite
    plans = plans.assign(**numbers, ticks=-numbers.reward, order=order)
    plans = plans.sort_values(["order", "nodes", "horizon"])
    before = plans.groupby(["task", "nodes"])[["horizon", "ticks"]].shift()
    more = plans.horizon - before.horizon
    # The sum of n - h over the goals ahead since the horizon before.
    movements = more * (plans.goals - (before.horizon + 1 + plans.horizon) / 2)
    mean_movement = -plans.best_known / plans.goals
    gain = (before.ticks - plans.ticks) / movements / mean_movement
    together = (gain * more).groupby([plans.task, plans.nodes]).cumsum()
    before = before.add_prefix("before_")
    return plans.assign(gain=gain, together=together, **before)


def first_plans(plans):
    """Return the plans on the tasks, and with the nodes, of plans without a goal ahead; later ones
    repeat them, or are of more tasks."""
    first = plans[plans.horizon == 0]
    return plans[plans.task.isin(first.task) & plans.nodes.isin(first.nodes)]


def repeats_of(plans):
    """Return the ticks of plans with ``three`` and ``four`` goals ahead with two arms, a row for
    each task and number of ``nodes``, and the ``gain`` of the fourth goal."""
    plans = plans[(plans.family == MANY[1]) & (plans.horizon == 4) & (plans.before_horizon == 3)]
    plans = plans.sort_values(["task", "nodes"]).rename(columns={"ticks": "four"})
    rows = (plans.task + " nodes=" + plans.nodes.astype(str)).rename("row")
    plans = plans.assign(three=plans.before_ticks)
    return plans.set_index(rows)[["task", "nodes", "three", "four", "gain"]]


def tabulate(study, plans):
    """Gaps by goals ahead and what each goal gains, then the gaps of other methods, as shares."""
    plans = plans.sort_values(["family", "horizon"], kind="stable")
    planned = means(plans, ["family", "method", "horizon"], ["gap", "gain", "together"])
    planned = planned.rename(columns={"horizon": "h", "rows": "tasks"})
    planned.index = planned.family + " h=" + planned.h.astype(str)
    return pd.concat([planned, tabulate_others(study)]).rename_axis("row")


def tabulate_others(study):
    """Tabulate the gaps of :data:`OTHERS` on tasks with fourteen goals, by family and method:
    means, as shares, with intervals about other tasks and runs."""
    runs = study.runs[study.runs.family.isin(MANY) & study.runs.gap.notna()]
    rows = {}
    for method in OTHERS:
        for family, of_family in runs[runs.method == method].groupby("family"):
            gaps = [of_task.gap.to_numpy() for _, of_task in of_family.groupby("task")]
            row = {"family": family, "method": method, "tasks": len(gaps)}
            rows[f"{family} {method}"] = row | other_tasks({family: gaps}).columns("gap")
    return pd.DataFrame.from_dict(rows, orient="index")


def at(plans, families, h, column):
    """A column of the plans with h goals ahead, in per cent, by task."""
    rows = plans[plans.family.isin(families) & (plans.horizon == h)]
    return 100 * rows.set_index("task")[column]


def signed_rank(gains, side="greater"):
    """Return p of a one-tailed signed-rank test that gains, per cent by task, are more or less than
    :data:`GAIN`."""
    return stats.wilcoxon(gains - GAIN, alternative=side).pvalue


def tabulate_fourth(repeats):
    """Tabulate the gain of the fourth goal ahead with two arms, with p of the test that it exceeds
    1 %, over all tasks, without the greatest gains, over the first tasks, over the tasks added
    later, and by repeat."""
    repeats = repeats.assign(gain=100 * repeats.gain)
    gains = repeats.groupby("task").gain.mean()
    first = gains.index.str[-3:].astype(int) < FIRST
    parts = {
        "all": gains,
        "without the greatest": gains.drop(gains.idxmax()),
        "without the five greatest": gains.drop(gains.nlargest(5).index),
        "first tasks": gains[first],
        "more tasks": gains[~first],
    }
    for (nodes, more), rows in repeats.groupby(["nodes", repeats.task.isin(gains.index[~first])]):
        parts[f"{'more' if more else 'first'} tasks, nodes={nodes}"] = rows.set_index("task").gain
    rows = {}
    for name, part in parts.items():
        if part.empty:
            continue
        rows[name] = {
            "tasks": len(part), "losing": (part < 0).sum(), "median": part.median(),
            **mean(part).columns("gain"),
            "p": mean_beyond("{}", part, GAIN).tests[0].p, "signed_rank_p": signed_rank(part),
        }  # fmt: skip
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def judge_claims(study, plans, repeats):
    """Judge the claims registered before the runs; those on the fourth goal ahead with two arms
    need a signed-rank test as well."""
    one, two = at(plans, MANY[:1], 4, "gain"), 100 * repeats.groupby("task").gain.mean()
    pairs = [at(plans, families, h, "together").rename(lambda name: name.partition("-")[2])
             for families, h in ((MANY, 2), (HALF, 1), (HALF, 2))]  # fmt: skip
    nearer = pairs[0] - (pairs[1] + pairs[2]) / 2
    learner = study.runs[study.runs.method.str.startswith("dual-process")]
    cma_es = study.runs[study.runs.method == "cma-es/bandit"]
    learner, cma_es = (100 * runs.groupby("task").gap.mean() for runs in (learner, cma_es))
    values = {
        "fourth-of-fourteen-gains-little-on-one-arm": [one],
        "fourth-of-fourteen-gains-more-on-one-arm": [one],
        "fourth-of-fourteen-gains-little-on-two-arms": [two],
        "fourth-of-fourteen-gains-more-on-two-arms": [two],
        "horizon-is-a-number-of-goals": [nearer],
        "horizon-is-a-share-of-goals": [nearer],
        "learner-behind-no-goal-ahead": [learner - at(plans, MANY, 0, "gap")],
        "cma-es-behind-one-goal-ahead": [cma_es - at(plans, MANY[:1], 1, "gap")],
    }
    claims = judge_means(HERE / "claims.toml", values)
    for name, side in (("little", "less"), ("more", "greater")):
        row = f"fourth-of-fourteen-gains-{name}-on-two-arms"
        if claims.verdict[row] == "supported" and signed_rank(two, side) >= 0.05:
            claims.loc[row, "verdict"] = "undecided"
    return claims


@figures.styled
def draw(table):
    """Gaps (learner dotted, CMA-ES dash-dotted), gains, and gains together, seven goals open."""
    figure, panels = figures.panels((1, 3), (figures.TWO, 2.8))
    for color, arms, many, half in zip(figures.PALETTE, ARMS, MANY, HALF, strict=False):
        rows, seven = table[table.family == many], table[table.family == half]
        line = {"x": "h", "scale": 100, "bars": 0.9, "color": color}
        for axes, column in zip(panels, ("gap", "gain", "together"), strict=True):
            figures.means(axes, rows, y=column, label=arms, **line)
        line |= {"label": f"{arms}, seven", "markerfacecolor": "white"}
        figures.means(panels[2], seven, y="together", **line)
        for method, dash in (("dual-process", "dotted"), ("cma-es/bandit", "dashdot")):
            for gap in rows.gap[rows.method.str.startswith(method)]:
                panels[0].axhline(100 * gap, color=color, linestyle=dash, linewidth=1)
    panels[1].axhline(GAIN, color="black", linewidth=0.7, linestyle="dashed")
    labels = "gap (%)", "gain of a goal ahead (%)", "gain together (%)"
    for axes, label in zip(panels, labels, strict=True):
        axes.set(xlabel="goals ahead", ylabel=label, xticks=range(0, 9, 2))
    panels[1].set_yscale("symlog", linthresh=1)
    panels[1].set_yticks([-1, 0, 1, 3, 10, 30], ["−1", "0", "1", "3", "10", "30"])
    figures.legend(figure, panels[2].get_legend_handles_labels()[0], 4)
    figures.letters(panels)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    every = measure_plans(study)
    plans, repeats = first_plans(every), repeats_of(every)
    rows = (plans.task + " h=" + plans.horizon.astype(str)).rename("row")
    return {
        "results": tabulate(study, plans),
        "gains": plans.set_index(rows)[["family", "task", "horizon", "ticks", "gain"]],
        "repeats": repeats,
        "fourth": tabulate_fourth(repeats),
        "runs": tabulate_runs(study),
        "claims": judge_claims(study, plans, repeats),
    }


if __name__ == "__main__":
    write_study(HERE, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)
