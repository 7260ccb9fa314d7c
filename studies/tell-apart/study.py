"""Measure which experiment would distinguish trial and error from planning.

python studies/tell-apart/protocols.py results/tell-apart
PYTHONPATH=studies python studies/tell-apart/study.py results/tell-apart
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from announced import DISTANCES, with_shares
from protocols import AFTER, NOISE
from scipy import stats

from coartic.analysis import figures, means
from common.judging import judge_means
from common.writing import write_study

HERE = Path(__file__).parent
EXPERIMENTS = 2000


def share_by_task(changes):
    """A row for each task, distance and model: sums over people and goals, and shares of the shift
    as of :func:`announced.with_shares`."""
    shares = changes.groupby(["distance", "model", "task"], sort=False)
    shares = with_shares(shares.sum(numeric_only=True, min_count=1).reset_index(), AFTER)
    return shares.assign(
        half=shares.log_half, shift=np.sqrt(shares.square / shares.cases),
        drift=shares["same"] / shares.square, from_anew=np.log10(shares.anew / shares.among) / 2,
        gap=100 * (shares.ticks_10000 / shares.ticks_anew - 1),
    )  # fmt: skip


def tabulate(shares, starts, steps):
    """Means over tasks with intervals, a row for each measure of a model.

    Shares vary between tasks, so that ``share_1`` has its median, too, and the trials to half their
    quartiles. ``unlike``: tasks on which two learners of the changed task differ by more than the
    learner shifts.
    """
    columns = [*(f"share_{n}" for n in AFTER), "shift", "half", "drift", "from_anew", "gap"]
    by = shares.assign(unlike=shares.among > shares.square).groupby(
        ["distance", "model"], sort=False
    )
    more = pd.DataFrame({
        "share_1_median": by.share_1.median(),
        **{f"half_{100 * part:.0f}": by.half.quantile(part) for part in (0.25, 0.5, 0.75)},
        "unlike": by.unlike.sum(),
    })  # fmt: skip
    tables = [means(shares, ["distance", "model"], columns)
              .merge(more, left_on=["distance", "model"], right_index=True)]  # fmt: skip
    tables.append(means(starts, ["model", "trials"], ["ratio"]))
    tables.append(means(steps.groupby(["model", "task"], sort=False).mean(numeric_only=True)
                        .reset_index(), ["model"], ["same", "kept", "records"]))  # fmt: skip
    names = "change {0.distance:g} {0.model}", "start {0.model} {0.trials}", "step {0.model}"
    for table, name in zip(tables, names, strict=True):
        table.index = [name.format(row) for row in table.itertuples()]
    return pd.concat(tables).rename(columns={"rows": "tasks"}).rename_axis("row")


def judge_claims(shares, starts, steps):
    """Judge the predictions, committed before any test instance was run, on random tasks: those of
    the paper were seen before."""
    shares, starts, steps = (raw[raw.task.str.contains("/")] for raw in (shares, starts, steps))
    shares = shares[shares.distance == 0.5].pivot(index="task", columns="model")  # noqa: PD010
    ratio = starts.pivot_table("ratio", "task", ["model", "trials"])
    same, kept = (steps.pivot_table(name, "task", "model") for name in ("same", "kept"))
    at_once = shares["share_1"]["learner, informed"]
    values = {
        "learner-takes-hundreds-of-trials": [shares["half"]["learner"]],
        "shift-is-of-the-change": [shares["drift"]["learner"]],
        "informed-learner-between": [at_once, at_once],
        "planner-shift-is-seen": [shares["shift"]["planner, all goals"]],
        "learner-ends-where-learning-anew-ends": [shares["from_anew"]["learner"]],
        "learner-ends-as-well": [shares["gap"]["learner"]],
        "starts-keep-learners-apart": [ratio["learner", 1], ratio["learner", 10_000]],
        "signs-tell-no-planner": [same.learner - same.planner, same.walk - same.learner],
        "best-trials-are-kept": [kept.learner, kept.planner],
    }
    return judge_means(HERE / "claims.toml", values)


def people_needed(learner, planner, noise, items, planned, rng):
    """Return the fewest people with whom 90 % of experiments classify them correctly; NaN beyond
    200. A person's score is the mean over ``items``; a share ``planned`` of the items has the
    planner's score, the rest the learner's, each with ``noise`` (SD). All learners, or all
    planners, are distinguished if a one-tailed test rejects half-way between; a mixture if tests
    reject both.
    """
    middle = (learner + planner) / 2
    nulls = {0: [middle], 1: [middle]}.get(planned, [learner, planner])
    for people in [*range(3, 30), *range(30, 201, 10)]:
        plans = rng.binomial(items, planned, (EXPERIMENTS, people)) / items
        scores = learner + (planner - learner) * plans
        scores += noise / np.sqrt(items) * rng.standard_normal(scores.shape)
        right = np.ones(EXPERIMENTS, bool)
        for null in nulls:
            side = "greater" if learner + planned * (planner - learner) > null else "less"
            right &= stats.ttest_1samp(scores, null, axis=1, alternative=side).pvalue < 0.05
        if right.mean() >= 0.9:
            return people
    return np.nan


def find_power(shares, starts, steps):
    """People needed for each contrast, by what they are.

    Noise: in the first contrast ``NOISE`` in each joint of one trial, as a share of the planner's
    shift on a task at its lower quartile, with means of 20 trials before and after; in the second
    the spread of runs, as a share of the distance of the groups, whose middle is 0; in the third
    the spread of persons.
    """
    rng = np.random.default_rng(0)
    ratio = starts[(starts.model == "learner") & (starts.trials == 1)]
    apart = np.sqrt(np.median(ratio.between / ratio.within) - 1)  # of groups, in RMS within pairs
    person = steps.groupby("model")[["same", "kept"]].agg(["mean", "std"])

    def of_change(distance, model, words=""):
        planned = shares[(shares.distance == distance) & (shares.model == model)]
        noise = NOISE * np.sqrt(1.05) / planned["shift"].quantile(0.25)
        return {f"change {distance:g}, {k} goals{words}": (0, 1, noise, k) for k in (1, 4)}

    cases = {}
    for distance in DISTANCES:
        cases |= of_change(distance, "planner, all goals")
    cases["start"] = 1, 0, np.sqrt(2) / apart, 1
    records = round(steps.records[steps.model == "learner"].mean())
    for name, items in (("same", 400), ("kept", records)):
        (a, spread), (b, other) = person.loc["learner", name], person.loc["planner", name]
        cases[f"step {name}"] = a, b, max(spread, other) * np.sqrt(items), items
    cases |= of_change(0.5, "planner, next goal", ", one goal ahead")
    rows = {
        name: {"learner": case[0], "planner": case[1], "noise": case[2] / np.sqrt(case[3]),
               **{f"people_{kind}": people_needed(*case, planned, rng) for kind, planned in
                  (("learners", 0), ("planners", 1), ("quarter", 0.25), ("half", 0.5))}}
        for name, case in cases.items()
    }  # fmt: skip
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("contrast")


@figures.styled
def draw(table):
    """Share of the shift by trials after the change."""
    figure, (axes,) = figures.panels((1, 1), (figures.TWO, 3.2))
    blue, _, _, red, _, sky = figures.PALETTE
    for model, words, color, up in (
        ("planner, all goals", "planner: all of it at once", blue, 0.05),
        ("learner, informed", "learner whose corrective process\nuses the next goal", sky, 0.25),
        ("learner", "learner by trial and error: none of it at once", red, -0.09),
    ):
        row = table.loc[f"change 0.5 {model}"]
        y, low, high = ([row[f"share_{n}{end}"] for n in AFTER] for end in ("", "_low", "_high"))
        axes.fill_between(AFTER, low, high, color=color, alpha=0.15, linewidth=0)
        axes.plot(AFTER, y, color=color, marker="o", markersize=4, markevery=slice(1, None))
        axes.plot(1, y[0], color=color, marker="o", markersize=11, clip_on=False)
        axes.text(1.25, y[0] + up, words, color=color, weight="bold")
    axes.set_xscale("log")
    axes.set_xticks([1, 10, 100, 1000, 10_000], ["first", "10", "100", "1000", "10 000"])
    axes.set(xlabel="trial after a goal was moved", ylabel="share of the final shift of posture")
    axes.set_yticks([0, 0.5, 1], ["0", "½", "1"])
    axes.set_ylim(-0.17, 1.17)
    return figure


def measure(folder):
    """Return the tables by name; each becomes a CSV file."""
    rows = {name: pd.read_csv(Path(folder) / f"{name}.csv")
            for name in ("changes", "starts", "steps")}  # fmt: skip
    shares, starts = share_by_task(rows["changes"]), rows["starts"]
    ratio = np.log10(starts.between / starts.within) / 2  # logarithm of a ratio of distances
    seen = shares, starts.assign(ratio=ratio), rows["steps"]
    tables = {"results": tabulate(*seen), "claims": judge_claims(*seen), "power": find_power(*seen)}
    return tables | {name: table.set_index("task") for name, table in rows.items()}


if __name__ == "__main__":
    write_study(HERE, measure(sys.argv[1]) if sys.argv[1:] else {}, draw)
