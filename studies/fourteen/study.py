r"""Is a planner's horizon a number of goals, or a share of those left?

    coartic run studies/fourteen/suite.toml \
        --family-file studies/fourteen/fourteen-one.v1.toml \
        --family-file studies/fourteen/fourteen-two.v1.toml \
        --family-file studies/fourteen/seven-one.v1.toml \
        --family-file studies/fourteen/seven-two.v1.toml
    python studies/fourteen/study.py results/fourteen

With two arms the fourth goal ahead is judged on 88 tasks, some planned repeatedly with numbers of
postures (``nodes``) that differ by 2 % at most, so that every repeat samples other postures. A case
is a task, and its value is the mean over its repeats. A claim on its gain is supported if three
tests agree, otherwise undecided: the bootstrap test of the mean; the same without the case that
speaks most for the claim; a signed-rank test, p < 0.05. The rule was written before these runs.

Writes results.csv, gains.csv, fourth.csv, claims.csv, figure.svg and the page, README.md; without a
folder the page alone, from the tables that are there.
"""

import sys
from pathlib import Path

import pandas as pd

from coartic.analysis import (
    figures,
    fill_page,
    judge,
    load,
    mean_beyond,
    means,
    other_tasks,
)  # fmt: skip

HERE = Path(__file__).parent
PLANNER = "receding-horizon"
OTHERS = [
    "dual-process/EC1", "dual-process/EC4", "cma-es/bandit", "placebo/guesses",
    "corrective-alone/given",
]  # fmt: skip
ARMS = ["one arm", "two arms"]
MANY = ["fourteen-one/v1", "fourteen-two/v1"]
HALF = ["seven-one/v1", "seven-two/v1"]
"""Families with half as many goals, drawn alike."""
GAIN = 1.0
"""Per cent. The question is at which horizon a further goal gains less than this; it is also what
counts as equivalent to a printed reward."""


def measure_plans(study):
    """Plans, a row for each task and horizon, with what their goals ahead gain.

    With h goals ahead the planner sees more than with h - 1 at n - h movements of n alone; from
    then on both see all that is left. So the difference of their ticks, of the whole task, is due
    to those movements, and what the postures after them are worth is counted. ``gain`` is that
    difference for each of those movements, as a share of a mean movement of the best known
    solution; where no run has the horizon before, of each goal since the last that was run, alike.
    ``together``: the gains of all goals ahead up to this one.
    """
    plans = study.runs[(study.runs.method == PLANNER) & study.runs.gap.notna()]
    numbers = plans[["horizon", "goals", "reward", "best_known"]].astype(int)
    order = pd.Categorical(plans.task, plans.task.unique())  # as in the suite
    plans = plans.assign(**numbers, ticks=-numbers.reward, order=order)
    plans = plans.sort_values(["order", "horizon"])
    before = plans.groupby("task")[["horizon", "ticks"]].shift()
    more = plans.horizon - before.horizon
    # The sum of n - h over the goals ahead since the horizon before.
    movements = more * (plans.goals - (before.horizon + 1 + plans.horizon) / 2)
    mean_movement = -plans.best_known / plans.goals
    gain = (before.ticks - plans.ticks) / movements / mean_movement
    return plans.assign(gain=gain, together=(gain * more).groupby(plans.task).cumsum())


def tabulate(study, plans):
    """Gaps by goals ahead and what each goal gains, then the gaps of other methods, as shares."""
    plans = plans.sort_values(["family", "horizon"], kind="stable")
    columns = ["gap", "gain", "together", "cpu_s"]
    planned = means(plans, ["family", "method", "horizon"], columns)
    planned = planned.drop(columns=["cpu_s_low", "cpu_s_high"])
    planned = planned.rename(columns={"horizon": "h", "rows": "tasks", "cpu_s": "seconds"})
    planned.index = planned.family + " h=" + planned.h.astype(str)
    return pd.concat([planned, tabulate_others(study)]).rename_axis("row")


def tabulate_others(study):
    """Gaps of the other methods on tasks with fourteen goals, about other tasks and runs."""
    runs = study.runs[study.runs.family.isin(MANY) & study.runs.gap.notna()]
    rows = {}
    for method in OTHERS:
        for family, of_family in runs[runs.method == method].groupby("family"):
            gaps = [(of_task.gap.to_numpy(),) for _, of_task in of_family.groupby("task")]
            gap = other_tasks({family: gaps})
            row = {"family": family, "method": method, "tasks": len(gaps)}
            row |= {"gap": gap.value, "gap_low": gap.low, "gap_high": gap.high}
            rows[f"{family} {method}"] = row
    return pd.DataFrame.from_dict(rows, orient="index")


def tabulate_gains(study, plans):
    """What each goal ahead gains on each task, as a share of a mean movement."""
    rows = (plans.task + " h=" + plans.horizon.astype(str)).rename("row")
    return plans.set_index(rows)[["family", "task", "horizon", "ticks", "gain"]]


def at(plans, families, h, column):
    """A column of the plans with h goals ahead, in per cent, by task."""
    rows = plans[plans.family.isin(families) & (plans.horizon == h)]
    return 100 * rows.set_index("task")[column]


def fourth_gains(arms, than, gains):
    """A claim on the fourth goal ahead: its statement, its test, and what was seen."""
    side = "greater" if than == "more" else "less"
    return (
        f"Of fourteen goals for {arms} the fourth goal ahead gains {than} than 1 %.",
        "one-tailed bootstrap test over random tasks with fourteen goals: from three goals ahead "
        f"to four the planner gains {than} than 1 % of a mean movement, for each movement that has "
        "a fourth goal ahead",
        mean_beyond("The fourth goal ahead gains {} %", gains, GAIN, side),
    )


def tabulate_fourth(study, plans):
    """p of one claim without correction: on all tasks, and without the one that gains most."""
    gains, rows = at(plans, MANY[1:], 4, "gain"), {}
    for name, part in (("all", gains), ("without the greatest", gains.drop(gains.idxmax()))):
        alone = judge({"more": fourth_gains("two arms", "more", part)})
        rows[name] = {"tasks": len(part), "p": alone.p_holm["more"]}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def judge_claims(study, plans):
    """The claims, as they were registered before the runs."""
    one, two = (at(plans, [family], 4, "gain") for family in MANY)
    pairs = [at(plans, families, h, "together").rename(lambda name: name.partition("-")[2])
             for families, h in ((MANY, 2), (HALF, 1), (HALF, 2))]  # fmt: skip
    nearer = pairs[0] - (pairs[1] + pairs[2]) / 2
    sentence = "Two goals ahead of fourteen gain {} points more than the middle of seven"
    pairs_test = (
        "one-tailed bootstrap test over pairs of random tasks, of the same arms and number, one "
        "with fourteen goals and one with seven: two goals ahead of fourteen gain {} than the "
        "middle between what one and what two goals ahead gain of seven (together, in per cent of "
        "a mean movement, for each movement that has them ahead)"
    )
    learner = study.runs[study.runs.method.str.startswith("dual-process")]
    cma_es = study.runs[study.runs.method == "cma-es/bandit"]
    learner, cma_es = (100 * runs.groupby("task").gap.mean() for runs in (learner, cma_es))
    return judge({
        "fourth-of-fourteen-gains-little-on-one-arm": fourth_gains("one arm", "less", one),
        "fourth-of-fourteen-gains-more-on-one-arm": fourth_gains("one arm", "more", one),
        "fourth-of-fourteen-gains-little-on-two-arms": fourth_gains("two arms", "less", two),
        "fourth-of-fourteen-gains-more-on-two-arms": fourth_gains("two arms", "more", two),
        "horizon-is-a-number-of-goals": (
            "A horizon is a number of goals: two goals ahead gain of fourteen more nearly what two "
            "gain of seven than what one gains of seven.",
            pairs_test.format("more"),
            mean_beyond(sentence, nearer),
        ),
        "horizon-is-a-share-of-goals": (
            "A horizon is a share of the goals that are left: two goals ahead gain of fourteen "
            "more nearly what one gains of seven than what two gain of seven.",
            pairs_test.format("less"),
            mean_beyond(sentence, nearer, 0.0, "less"),
        ),
        "learner-behind-no-goal-ahead": (
            "The learner loses more than the planner that looks no goal ahead.",
            "one-tailed bootstrap test over random tasks with fourteen goals: the learner's gap is "
            "higher by more than 1 %",
            mean_beyond("The learner loses {} points more than the planner",
                        learner - at(plans, MANY, 0, "gap"), GAIN),
        ),
        "cma-es-behind-one-goal-ahead": (
            "CMA-ES, with one arm, loses more than the planner with one goal ahead.",
            "one-tailed bootstrap test over random tasks with fourteen goals for one arm: the gap "
            "of CMA-ES is higher by more than 1 %",
            mean_beyond("CMA-ES loses {} points more than the planner",
                        cma_es - at(plans, MANY[:1], 1, "gap"), GAIN),
        ),
    })  # fmt: skip


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
        for method, dash in (("dual-process", "dotted"), ("cma-es", "dashdot")):
            for gap in rows.gap[rows.method.str.startswith(method)]:
                panels[0].axhline(100 * gap, color=color, linestyle=dash, linewidth=1)
    panels[1].axhline(GAIN, color="black", linewidth=0.7, linestyle="dashed")
    labels = "gap (%)", "gain of a goal ahead (%)", "gain together (%)"
    for axes, label in zip(panels, labels, strict=True):
        axes.set_xlabel("goals ahead")
        axes.set_xticks(range(0, 9, 2))
        axes.set_ylabel(label)
    panels[1].set_yscale("symlog", linthresh=1)
    panels[1].set_yticks([-1, 0, 1, 3, 10, 30], ["−1", "0", "1", "3", "10", "30"])
    figures.legend(figure, panels[2].get_legend_handles_labels()[0], 4)
    figures.letters(panels)
    return figure


def measure(study):
    """The tables, each of which becomes a CSV file of its name."""
    plans = measure_plans(study)
    makers = {"results": tabulate, "gains": tabulate_gains, "fourth": tabulate_fourth,
              "claims": judge_claims}  # fmt: skip
    return {name: make(study, plans) for name, make in makers.items()}


def main():
    """Measure a folder, if one is given, and write the page."""
    if len(sys.argv) > 1:
        tables = measure(load(sys.argv[1]))
        for name, table in tables.items():
            table.to_csv(HERE / f"{name}.csv", float_format="%.6g")
        (HERE / "figure.svg").write_bytes(figures.picture(draw(tables["results"]), ".svg"))
    tables = {path.stem: pd.read_csv(path, index_col=0) for path in HERE.glob("*.csv")}
    page = fill_page(HERE / "README.md.jinja", **tables)
    (HERE / "README.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
