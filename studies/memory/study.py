"""Measure what memory adds to random search: how often something is kept, and what.

    python studies/memory/protocols.py results/memory
    python studies/memory/study.py results/memory

Random search is the learner without its memory. Here it has memory by the dose: after each of r
equal parts of its trials it goes on from its best trial, from the postures that this trial reached
or from the targets that it aimed at. Against the expected answer, that such a memory makes the
learner's coarticulation: signatures that do not rise with r, or a learner beyond their level.

On two arms all of this has the hands in which the learner ends, each weighted as the learner's runs
weight it. All tests and intervals resample tasks within families, which weigh the same.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from coartic.analysis import TwoContexts, all_of, figures, judge, load, mean_beyond, write_study

MEASURES = {
    "gain": "gain (ticks)",
    "first": "first movement slower (ticks)",
    "arm": "next goal nearer (ticks)",
    "other arm": "idle hand nearer (share)",
}
"""Gain and signatures, with the labels of their axes. The gain counts from the corrective process
alone with its best hands."""
BOUNDS = {"gain": 5.0, "first": 2.0, "arm": 2.0, "other arm": 0.1}
"""Differences that count as none, set on development instances before any test instance ran."""
KEEPS = ("postures", "targets")
STAGES = [1, 2, 4, 10, 30, 100, 1_000]
MOST = STAGES[-1]
RESAMPLES = 9_999
NAMES = {
    "dual-process/EC1": "learner",
    "dual-process/EC4": "learner",
    "dual-process/EC1-informed": "informed learner",
    "dual-process/EC4-informed": "informed learner",
    "random-search": "random search",
    "hill-climbing": "hill climbing",
    "cma-es/bandit": "CMA-ES",
    "posture-based/two-goals": "posture planning",
    "posture-qp/goals-ahead": "posture QP",
}
TRIALS = 10_000
LEAST_SHARE = 0.1


def measure_runs(study):
    """Return the solved runs with gain and signatures; ``group``: family, or task of the paper."""
    runs = study.runs[study.runs.status == "ok"]
    return runs.assign(
        group=runs.family.str.partition("/")[0].fillna(runs.task),
        name=runs.method.map(NAMES),
        gain=runs.reward.astype(float) - runs.corrective_best,
        **{name: study.signature(name) for name in MEASURES if name != "gain"},
    )


def measure_cells(runs):
    """Return means over runs, a row for each task, method, number of trials, and for random search
    number of stages and what is kept.

    Random search has a mean for each hand sequence of the learner, weighted by the learner's runs;
    rows of the learner with 10,000 trials have the runs with these hands alone (``compared``).
    """
    rows, measures = [], [*MEASURES]
    for (group, task), of_task in runs.groupby(["group", "task"], sort=False):
        learner = of_task[(of_task.name == "learner") & (of_task.trials == TRIALS)]
        shares = learner.hands.value_counts(normalize=True)
        shares = shares[shares >= LEAST_SHARE]
        key = {"group": group, "task": task}
        compared = learner[learner.hands.isin(shares.index)][measures].mean()
        rows.append(key | {"name": "compared", "trials": TRIALS} | compared.to_dict())
        search = of_task[of_task.name == "random search"]
        for (stages, keep), of_dose in search.groupby(["stages", "keep"], sort=False):
            by_hands = of_dose.groupby("hands")[measures].mean()
            if {*shares.index} <= {*by_hands.index}:
                of_hands = by_hands.loc[shares.index]
                weights = of_hands.notna().mul(shares, axis=0)  # of hands with the signature
                means = (of_hands * weights).sum() / weights.sum()
                for kept in KEEPS if stages == 1 else (keep,):
                    names = {"name": kept, "trials": TRIALS, "stages": int(stages)}
                    rows.append(key | names | means.to_dict())
        others = of_task[of_task.name != "random search"]
        for (name, trials), of_cell in others.groupby(["name", "trials"], sort=False, dropna=False):
            names = {"name": name, "trials": trials}
            rows.append(key | names | of_cell[measures].mean().to_dict())
    return pd.DataFrame(rows).fillna({"stages": 0, "trials": 0}).astype({"stages": int})


def drawn(groups):
    """Return places of tasks in :data:`RESAMPLES` resamples within families, shape ``(resamples,
    tasks)``. ``groups``: the family of each task, families one after the other."""
    rng, places, start = np.random.default_rng(0), [], 0
    for size in groups.groupby(groups, sort=False).size():
        places.append(start + rng.integers(size, size=(RESAMPLES, size)))
        start += size
    return np.concatenate(places, axis=1)


class Scale:
    """Means of a measure over the stages of random search, for what is kept, and of the learner.

    ``table`` has a row for each task that has all of them, a column for each number of stages and
    ``learner``; ``means`` are their means over tasks, ``resampled`` those of resamples."""

    def __init__(self, cells, measure, keep, groups=None):
        of = cells[cells.name.isin([keep, "compared"]) & cells.task.str.contains("/")]
        of = of if groups is None else of[of.group.isin(groups)]
        column = of.stages.where(of.name != "compared", "learner")
        table = of.assign(column=column).pivot_table(measure, ["group", "task"], "column")
        self.table = table.dropna().sort_index()
        self.stages = [stage for stage in STAGES if stage in table]
        families = self.table.index.get_level_values("group").to_series(index=self.table.index)
        # Families weigh the same, whatever the number of their tasks.
        weights = 1 / families.groupby(families).transform("size") / families.nunique()
        values = self.table[[*self.stages, "learner"]].to_numpy(float)
        places = drawn(families)
        self.means = dict(zip(self.table[[*self.stages, "learner"]], weights @ values, strict=True))
        resampled = np.einsum("bt,btc->bc", weights.to_numpy()[places], values[places])
        self.resampled = dict(zip(self.means, resampled.T, strict=True))
        self.families = families

    def __len__(self):
        return len(self.table)

    def difference(self, first, second, coverage=0.95):
        """Return the mean of a column less that of another, with its interval."""
        of = self.resampled[first] - self.resampled[second]
        tail = (1 - coverage) / 2
        ends = np.quantile(of, [tail, 1 - tail])
        return float(self.means[first] - self.means[second]), *map(float, ends)

    def level(self, bound):
        """Return the least number of stages from which on the 90 % interval of the difference to
        the largest number stays within ± bound; the largest if it does from nowhere."""
        least = self.stages[-1]
        for stages in self.stages[-2::-1]:
            _, low, high = self.difference(stages, self.stages[-1], 0.9)
            if not -bound < low <= high < bound:
                break
            least = stages
        return least

    def place(self):
        """Return the number of stages at which the mean is the learner's, interpolated over log r,
        infinite beyond the scale and 1 below it, with its 95 % interval."""
        scale = np.array([self.resampled[stages] for stages in self.stages]).T
        found = [
            first_crossing(self.stages, *each)
            for each in zip(scale, self.resampled["learner"], strict=True)
        ]
        mean = first_crossing(
            self.stages, [self.means[stages] for stages in self.stages], self.means["learner"]
        )
        return mean, *map(float, np.quantile(found, [0.025, 0.975], method="inverted_cdf"))

    def slopes(self):
        """Return the slope of each task by log10 of the stages, family as a factor."""
        x = np.log10(self.stages)
        x = x - x.mean()
        return self.by_task(self.table[self.stages] @ (x / (x @ x)))

    def more(self, first, second):
        """Return a column less another, a value for each task, family as a factor."""
        return self.by_task(self.table[first] - self.table[second])

    def by_task(self, values):
        """Return values whose spread is that within families, about the mean of families."""
        of_family = values.groupby(self.families)
        size, means = of_family.transform("size"), of_family.transform("mean")
        return of_family.mean().mean() + (values - means) * np.sqrt(size / (size - 1))


def first_crossing(stages, scale, value):
    """Return the number of stages at which a scale first reaches a value, between stages linear in
    their logarithm; infinite if it never does."""
    above = np.flatnonzero(np.asarray(scale) >= value)
    if not len(above):
        return np.inf
    place = above[0]
    if place == 0:
        return float(stages[0])
    part = (value - scale[place - 1]) / (scale[place] - scale[place - 1])
    return float(stages[place - 1] * (stages[place] / stages[place - 1]) ** part)


def where(scale, bound):
    """Return where the learner is: ``level``, ``above`` or ``below`` the largest number of stages
    by more than the bound, or ``open``."""
    _, low, high = scale.difference("learner", scale.stages[-1], 0.9)
    if -bound < low <= high < bound:
        return "level"
    return "above" if low > bound else "below" if high < -bound else "open"


def groups_of(cells, measure):
    """Return the families that have a measure, by group: all of them, and each alone."""
    there = cells[cells.task.str.contains("/") & cells[measure].notna()]
    there = there[there[measure].groupby(there.group).transform("any")]  # 0 with one arm
    families = [*dict.fromkeys(there.group)]
    return {"all": families} | {family: [family] for family in families}


def tabulate_scales(cells):
    """Tabulate for each family, content of memory and measure: the trend, the least number of
    stages at the level, and the learner's place."""
    rows = {}
    for measure, bound in BOUNDS.items():
        for group, families in groups_of(cells, measure).items():
            for keep in KEEPS:
                scale = Scale(cells, measure, keep, families)
                row = {"group": group, "keep": keep, "measure": measure, "tasks": len(scale)}
                for name, value in {
                    "rise": scale.difference(MOST, 1),
                    "place": scale.place(),
                    "beyond_one": scale.difference("learner", 1),
                    "beyond_level": scale.difference("learner", MOST),
                }.items():
                    row |= dict(zip([name, f"{name}_low", f"{name}_high"], value, strict=True))
                row |= {"level": scale.level(bound), "where": where(scale, bound)}
                rows[f"{group} {keep} {measure}"] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def tabulate(cells):
    """Tabulate both scales and the learner: means over tasks, and by how much they exceed random
    search in one part, by family and over all."""
    rows = {}
    for measure in MEASURES:
        for group, families in groups_of(cells, measure).items():
            for keep in KEEPS:
                scale = Scale(cells, measure, keep, families)
                for column in scale.means:
                    name = "learner" if column == "learner" else keep
                    row = rows.setdefault(f"{group} {name} {column}".removesuffix(" learner"), {})
                    row |= {"group": group, "name": name}
                    row |= {"stages": np.nan if name == "learner" else column}
                    row |= {"tasks": row.get("tasks", len(scale))}
                    value = scale.difference(column, 1)
                    names = [f"{measure}_more{end}" for end in ("", "_low", "_high")]
                    row |= {measure: scale.means[column]} | dict(zip(names, value, strict=True))
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def tabulate_methods(cells):
    """Tabulate means over tasks of each method by family, over all, and on the paper's tasks."""
    drawn_tasks = cells[cells.task.str.contains("/")]
    every = pd.concat([drawn_tasks.assign(group="all"), cells])
    keys = ["group", "name", "trials", "stages"]
    table = every.groupby(keys, sort=False)[[*MEASURES]].mean()
    table.insert(0, "tasks", every.groupby(keys, sort=False).size())
    table = table.reset_index()
    table.index = [
        f"{row.group} {row.name_} {row.trials:g} {row.stages}"
        for row in table.rename(columns={"name": "name_"}).itertuples()
    ]
    return table.rename_axis("row")


def measure_contexts(study):
    """Tabulate the posture difference at the first goal of both one-armed tasks of the paper, with
    the mean gain on both, by method, trials and stages."""
    rows = {}
    runs = measure_runs(study)
    runs = runs[runs.task.isin(("ascending", "descending"))]
    for label, of in runs.groupby("label", sort=False):
        if of.task.nunique() == 2:
            both = (study.executed(task, label) for task in ("ascending", "descending"))
            contexts = TwoContexts(*both, 1, "right")
            first = of.iloc[0]
            rows[label] = {
                "name": first["name"],
                "trials": first.trials,
                "stages": first.get("stages", 0),
                "keep": first.get("keep", ""),
                "runs": len(of) // 2,
                "gain": of.groupby("task").gain.mean().mean(),
                "distance": contexts.posture_difference,
            }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("label")


def at_equal_gain(cells):
    """Return each cell's signatures next to the learner's where the learner gains as much,
    interpolated over its numbers of trials, with 0 at gain 0.

    A row for each cell of another method: signatures, those of the learner in columns that begin
    with ``learner``, and ``status``: ``compared``, ``gain below 0`` or ``beyond the learner``."""
    signatures = [name for name in MEASURES if name != "gain"]
    rows = []
    for _, of_task in cells.groupby("task", sort=False):
        learner = of_task[(of_task.name == "learner") & (of_task.gain > 0)].sort_values("gain")
        gains = np.append(0.0, learner.gain)
        for row in of_task[~of_task.name.isin(["learner", "compared"])].to_dict("records"):
            below, beyond = row["gain"] < 0, row["gain"] > gains[-1]
            row["status"] = (
                "gain below 0" if below else "beyond the learner" if beyond else "compared"
            )
            for name in signatures:
                at = np.interp(row["gain"], gains, np.append(0.0, learner[name]))
                row[f"learner {name}"] = at if row["status"] == "compared" else np.nan
            rows.append(row)
    return pd.DataFrame(rows)


def tabulate_equal(cells):
    """Tabulate what is left of each method's signatures at the learner's gain: the difference, and
    the ratio of sums over tasks, with tasks resampled within families; and what is left out."""
    equal, rows = at_equal_gain(cells[cells.task.str.contains("/")]), {}
    keys = ["name", "stages"]
    for group, of_group in (("all", equal), *equal.groupby("group", sort=False)):
        for (name, stages), of in of_group.groupby(keys, sort=False):
            row = {"group": group, "name": name, "stages": stages, "cells": len(of)}
            row |= of.status.value_counts().to_dict()
            for measure in MEASURES:
                if measure == "gain":
                    continue
                pairs = of[["group", measure, f"learner {measure}"]].dropna().sort_values("group")
                if len(pairs) < 3 or not pairs[measure].any():
                    continue
                mine, learner = pairs[[measure, f"learner {measure}"]].to_numpy().T
                places = drawn(pairs.group)
                differences = (mine - learner)[places].mean(axis=1)
                ratios = mine[places].sum(axis=1) / learner[places].sum(axis=1)
                for word, value, each in (
                    ("difference", (mine - learner).mean(), differences),
                    ("ratio", mine.sum() / learner.sum(), ratios),
                ):
                    low, high = np.quantile(each, [0.025, 0.975])
                    column = f"{measure}_{word}"
                    row |= {column: value, f"{column}_low": low, f"{column}_high": high}
                row[f"{measure}_tasks"] = len(pairs)
            rows[f"{group} {name} {stages}"] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def tabulate_keeping(cells):
    """Tabulate how much more random search in 1,000 parts gains and shows if it keeps targets in
    place of postures, by family."""
    rows = {}
    for measure in MEASURES:
        for group, families in groups_of(cells, measure).items():
            of = cells[cells.group.isin(families) & (cells.stages == MOST)]
            table = of.pivot_table(measure, ["group", "task"], "name").dropna()
            more = (table.targets - table.postures).sort_index()
            low, high = np.quantile(
                more.to_numpy()[drawn(more.index.get_level_values(0).to_series())].mean(axis=1),
                [0.025, 0.975],
            )
            rows[f"{group} {measure}"] = {
                "group": group, "measure": measure, "tasks": len(more),
                "more": more.mean(), "more_low": low, "more_high": high,
            }  # fmt: skip
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def judge_claims(cells):
    """The predictions, as they were registered before any test instance was run."""
    scales = {(measure, keep): Scale(cells, measure, keep, groups_of(cells, measure)["all"])
              for measure in MEASURES for keep in KEEPS}  # fmt: skip
    signatures = [measure for measure in MEASURES if measure != "gain"]
    words = {measure: label.partition(" (")[0] for measure, label in MEASURES.items()}

    def rises(keep):
        return all_of(*(
            mean_beyond(f"{words[measure]} by {{}} for each factor of ten", scale.slopes())
            for (measure, kept), scale in scales.items() if kept == keep
        ))  # fmt: skip

    def within(values, measure):
        bound = BOUNDS[measure]
        above = mean_beyond(f"{words[measure]} {{}}", values, -bound)
        both = all_of(above, mean_beyond("{}", values, bound, "less"))
        return replace(both, evidence=above.evidence)

    def same(first, second, measures, which=scales):
        return all_of(*(
            within(which[measure, "postures"].more(first, second), measure)
            for measure in measures
        ))  # fmt: skip

    families = [name for name in groups_of(cells, "gain")["all"] if name != "long"]
    but_long = {("gain", "postures"): Scale(cells, "gain", "postures", families)}
    test = "one-tailed bootstrap tests over random tasks, family as a factor"
    bounds = (
        f"{test}: within ± {BOUNDS['gain']:g} ticks (gain), ± {BOUNDS['arm']:g} ticks and "
        f"± {BOUNDS['other arm']:g}"
    )
    targets = {measure: scales[measure, "targets"] for measure in MEASURES}
    both = {measure: targets[measure].by_task(
        (targets[measure].table[MOST] - scales[measure, "postures"].table[MOST]).dropna()
    ) for measure in MEASURES}  # fmt: skip
    return judge({
        "rises-with-postures": (
            "With postures kept, gain and each signature rise with the number of parts.",
            f"{test}: slope by log r above 0",
            rises("postures"),
        ),
        "rises-with-targets": (
            "With targets kept, gain and each signature rise with the number of parts.",
            f"{test}: slope by log r above 0",
            rises("targets"),
        ),
        "level-from-a-hundred": (
            "With postures kept, a hundred parts gain and show what a thousand do.",
            bounds,
            same(100, MOST, MEASURES),
        ),
        "learner-at-the-level": (
            "By each signature the learner is at the level of a thousand parts with postures kept.",
            bounds,
            same("learner", MOST, signatures),
        ),
        "learner-gains-the-level": (
            "In all families but long the learner gains what a thousand parts with postures kept "
            "do.",
            bounds,
            same("learner", MOST, ["gain"], but_long),
        ),
        "targets-gain-more": (
            f"With targets kept a thousand parts gain over {BOUNDS['gain']:g} ticks more than with "
            "postures.",
            f"{test}: above {BOUNDS['gain']:g} ticks",
            mean_beyond("gain {} ticks", both["gain"], BOUNDS["gain"]),
        ),
        "targets-slow-more": (
            f"With targets kept a thousand parts slow the first movement over {BOUNDS['first']:g} "
            "ticks more than with postures.",
            f"{test}: above {BOUNDS['first']:g} ticks",
            mean_beyond("first movement slower by {} ticks", both["first"], BOUNDS["first"]),
        ),
        "targets-pass-the-learner": (
            "With targets kept thirty parts gain more than the learner.",
            f"{test}: above 0",
            mean_beyond("gain {} ticks", targets["gain"].more(30, "learner")),
        ),
        "one-place": (
            "With targets kept the learner lies between ten and a hundred parts, by gain and by "
            "each signature.",
            f"{test}: above ten, below a hundred",
            all_of(*(
                finding for measure in MEASURES for finding in (
                    mean_beyond(f"{words[measure]} {{}} above ten",
                                targets[measure].more("learner", 10)),
                    mean_beyond("{} below a hundred", targets[measure].more(100, "learner")),
                )
            )),
        ),
    })  # fmt: skip


@figures.styled
def draw(results):
    """Gain and signatures beyond one selection against the number of parts: thick over all
    families, thin by family; grey: the learner, with its interval."""
    figure, every = figures.panels((2, 2), (figures.ONE, 3.6))
    looks = dict(zip(KEEPS, (figures.PALETTE[0], figures.PALETTE[1]), strict=True))
    for axes, (measure, label) in zip(every, MEASURES.items(), strict=True):
        column = f"{measure}_more"
        for keep, color in looks.items():
            rows = results[(results.name == keep) & results[column].notna()]
            for group, of_group in rows.groupby("group", sort=False):
                if group == "all":
                    figures.means(axes, of_group, x="stages", y=column, color=color, label=keep)
                else:
                    axes.plot(of_group.stages, of_group[column], color=color, linewidth=0.4)
        learner = results.loc["all learner"]
        axes.axhspan(learner[f"{column}_low"], learner[f"{column}_high"], color="0.85", zorder=0)
        axes.axhline(learner[column], color="0.5", linewidth=0.8, label="learner")
        axes.set_title(label)
        axes.set_xlabel("parts r")
        axes.set_xscale("log")
    figures.legend(figure, every[0].get_legend_handles_labels()[0], 3)
    return figure


def measure(study):
    """Return the tables by name; each becomes a CSV file."""
    cells = measure_cells(measure_runs(study))
    return {
        "results": tabulate(cells),
        "scales": tabulate_scales(cells),
        "keeping": tabulate_keeping(cells),
        "equal": tabulate_equal(cells),
        "methods": tabulate_methods(cells),
        "contexts": measure_contexts(study),
        "claims": judge_claims(cells),
    }


if __name__ == "__main__":
    write_study(Path(__file__).parent, measure(load(sys.argv[1])) if sys.argv[1:] else {}, draw)
