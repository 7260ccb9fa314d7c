r"""Measure whether a planner's horizon is a number of goals, or a share of the goals left.

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
"""Families with half as many goals, drawn in the same way."""
FIRST = 28
"""Number of tasks with two arms that were planned first."""
GAIN = 1.0
"""Gain of a goal, in per cent. The question is at which horizon a further goal gains less than
this. Differences from published rewards up to this size also count as equivalent."""


def measure_plans(study):
    """Return the plans with the gains of their goals ahead.

    There is a row for each task, number of ``nodes`` and horizon h. With h goals ahead instead of
    h - 1, the planner sees one goal more at n - h of the n movements. The new columns are

    - ``gain``: ticks that the last goal ahead saves for each of these movements, as a share of the
      mean movement of the best known solution;
    - ``before_horizon`` and ``before_ticks``: the next smaller horizon that was run, and its ticks.
      If it is below h - 1, ``gain`` is the mean gain of the goals ahead since then;
    - ``together``: sum of the gains of all goals ahead up to h.
    """
    plans = study.runs[(study.runs.method == PLANNER) & study.runs.gap.notna()]
    numbers = plans[["horizon", "goals", "reward", "best_known", "nodes"]].astype(int)
    order = pd.Categorical(plans.task, plans.task.unique())  # as in the suite
    plans = plans.assign(**numbers, ticks=-numbers.reward, order=order)
    plans = plans.sort_values(["order", "nodes", "horizon"])
    before = plans.groupby(["task", "nodes"])[["horizon", "ticks"]].shift()
    more = plans.horizon - before.horizon
    # The sum of n - h over the goals ahead after the previous horizon.
    movements = more * (plans.goals - (before.horizon + 1 + plans.horizon) / 2)
    mean_movement = -plans.best_known / plans.goals
    gain = (before.ticks - plans.ticks) / movements / mean_movement
    together = (gain * more).groupby([plans.task, plans.nodes]).cumsum()
    before = before.add_prefix("before_")
    return plans.assign(gain=gain, together=together, **before)


def first_plans(plans):
    """Return the plans that were made first, without repeats and tasks that were added later.

    The plans without a goal ahead were all made first. The other first plans have the same tasks
    and the same numbers of nodes.
    """
    first = plans[plans.horizon == 0]
    return plans[plans.task.isin(first.task) & plans.nodes.isin(first.nodes)]


def repeats_of(plans):
    """Return the ticks with three and with four goals ahead.

    There is a row for each task with fourteen goals and two arms, and each number of ``nodes``. The
    ticks are in columns ``three`` and ``four``, and the gain of the fourth goal is in ``gain``.
    """
    plans = plans[(plans.family == MANY[1]) & (plans.horizon == 4) & (plans.before_horizon == 3)]
    plans = plans.sort_values(["task", "nodes"]).rename(columns={"ticks": "four"})
    rows = (plans.task + " nodes=" + plans.nodes.astype(str)).rename("row")
    plans = plans.assign(three=plans.before_ticks)
    return plans.set_index(rows)[["task", "nodes", "three", "four", "gain"]]


def tabulate(study, plans):
    """Tabulate gaps and gains by goals ahead, and the gaps of other methods.

    All are shares, not per cent.
    """
    plans = plans.sort_values(["family", "horizon"], kind="stable")
    planned = means(plans, ["family", "method", "horizon"], ["gap", "gain", "together"])
    planned = planned.rename(columns={"horizon": "h", "rows": "tasks"})
    planned.index = planned.family + " h=" + planned.h.astype(str)
    return pd.concat([planned, tabulate_others(study)]).rename_axis("row")


def tabulate_others(study):
    """Tabulate the mean gaps of :data:`OTHERS` on tasks with fourteen goals, by family and method.

    Gaps are shares. Intervals are for other tasks and runs.
    """
    runs = study.runs[study.runs.family.isin(MANY) & study.runs.gap.notna()]
    rows = {}
    for method in OTHERS:
        for family, of_family in runs[runs.method == method].groupby("family"):
            gaps = [of_task.gap.to_numpy() for _, of_task in of_family.groupby("task")]
            row = {"family": family, "method": method, "tasks": len(gaps)}
            rows[f"{family} {method}"] = row | other_tasks({family: gaps}).columns("gap")
    return pd.DataFrame.from_dict(rows, orient="index")


def at(plans, families, h, column):
    """Return a column of the plans with h goals ahead, in per cent, indexed by task."""
    rows = plans[plans.family.isin(families) & (plans.horizon == h)]
    return 100 * rows.set_index("task")[column]


def signed_rank(gains, side="greater"):
    """Return p of a one-tailed signed-rank test of gains against :data:`GAIN`.

    ``gains`` contains a gain in per cent for each task. ``side`` is the alternative hypothesis: the
    gains are ``"greater"`` or ``"less"``.
    """
    return stats.wilcoxon(gains - GAIN, alternative=side).pvalue


def tabulate_fourth(repeats):
    """Tabulate the gain of the fourth goal ahead with two arms.

    Rows are for all tasks, for all tasks without those with the greatest gains (one or five), for
    the first tasks, for the tasks that were added later, and for each repeat. ``p`` is the p-value
    of the test that the mean gain exceeds 1 %; ``signed_rank_p`` is that of :func:`signed_rank`.
    """
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
    """Judge the claims, which were registered before the runs.

    Claims on the fourth goal ahead with two arms are only supported if a signed-rank test supports
    them, too.
    """
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
    """Draw the sum of the gains of all goals ahead, for up to four goals ahead.

    From three goals ahead, a dashed line rises by :data:`GAIN` for the fourth.
    """
    figure, (axes,) = figures.panels((1, 1), (figures.TWO, 3.2))
    lines = zip([*MANY, *HALF], 2 * ARMS, ["fourteen", "fourteen", "seven", "seven"], strict=True)
    for number, (family, arms, goals) in enumerate(lines):
        rows = table[(table.family == family) & (table.h <= 4)].fillna({"together": 0})
        rows = rows.fillna({"together_low": 0, "together_high": 0})
        many, color = family in MANY, figures.PALETTE[number % 2]
        look = {"color": color, "marker": "os"[number % 2], "linestyle": "-" if many else "--"}
        figures.means(axes, rows, x="h", y="together", scale=100, **look,
                      markerfacecolor=color if many else "white")  # fmt: skip
        last = rows.iloc[-1]
        above = (family == HALF[0]) - (family == HALF[1])
        axes.text(
            last.h + 0.08, 100 * last.together + 5 * above, f"{goals} goals, {arms}", va="center"
        )
        if many:
            third = 100 * rows.together.iloc[-2]
            axes.plot([3, 4], [third, third + GAIN], color="black", linewidth=1, linestyle=":")
    axes.set_xticks(range(5))
    axes.set_xlim(-0.1, 4.9)
    axes.set_xlabel("goals ahead")
    axes.set_ylabel("gain of all goals ahead (% of a movement)")
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
