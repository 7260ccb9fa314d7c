"""Scales of memory: random search by the number of its parts, and where the learner is on them.

Intervals resample tasks within families, which weigh the same.
"""

import numpy as np
import pandas as pd
from cells import KEEPS, MEASURES, groups_of

from coartic.estimates import Estimate

BOUNDS = {"gain": 5.0, "first": 2.0, "arm": 2.0, "other arm": 0.1}
"""Differences that count as none, set on development instances before any test instance ran."""
STAGES = [1, 2, 4, 10, 30, 100, 1_000]
MOST = STAGES[-1]
RESAMPLES = 9_999


def weights_of(groups):
    """Return the weight of each task, by which families weigh the same whatever the number of their
    tasks. ``groups``: the family of each task."""
    return 1 / groups.groupby(groups).transform("size") / groups.nunique()


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
        weights = weights_of(families)
        columns = [*self.stages, "learner"]
        values, places = self.table[columns].to_numpy(float), drawn(families)
        self.means = pd.Series(weights @ values, columns)
        resampled = np.einsum("bt,btc->bc", weights.to_numpy()[places], values[places])
        self.resampled = pd.DataFrame(resampled, columns=columns)
        self.families = families

    def difference(self, first, second, coverage=0.95):
        """Return the mean of a column less that of another, with its interval."""
        tail = (1 - coverage) / 2
        ends = np.quantile(self.resampled[first] - self.resampled[second], [tail, 1 - tail])
        return Estimate(self.means[first] - self.means[second], *ends)

    def level(self, bound):
        """Return the least number of stages from which on the 90 % interval of the difference to
        the largest number stays within ± bound; the largest if it does from nowhere."""
        least = self.stages[-1]
        for stages in self.stages[-2::-1]:
            of = self.difference(stages, self.stages[-1], 0.9)
            if not -bound < of.low <= of.high < bound:
                break
            least = stages
        return least

    def place(self):
        """Return the number of stages at which the mean is the learner's, interpolated over log r,
        infinite beyond the scale and 1 below it, with its 95 % interval."""
        mean, *found = (
            first_crossing(self.stages, values, learner)
            for *values, learner in np.vstack([self.means, self.resampled])
        )
        return Estimate(mean, *np.quantile(found, [0.025, 0.975], method="inverted_cdf"))

    def slopes(self):
        """Return the slope of each task by log10 of the stages, family as a factor."""
        x = np.log10(self.stages)
        x = x - x.mean()
        return self.by_task(self.table[self.stages] @ (x / (x @ x)))

    def more(self, first, second):
        """Return a column less another, a value for each task, family as a factor."""
        return self.by_task(self.table[first] - self.table[second])

    def median(self, first, second):
        """Return the median over tasks of a column less that of another."""
        return float((self.table[first] - self.table[second]).median())

    def by_task(self, values):
        """Return values of tasks whose mean and standard error are those of the mean of families
        (:func:`by_task`)."""
        return by_task(values, self.families)


def by_task(values, families):
    """Return values of tasks, shape ``(N,)``, whose mean is the mean over families of their means,
    and whose standard error is that of this mean.

    In a mean of F families a task of a family of n tasks has the weight 1 / (F n), and in a mean of
    N tasks 1 / N. So deviations within a family are multiplied by N / (F n). ``families``: the
    family of each task.
    """
    of_family = values.groupby(families)
    size, means = of_family.transform("size"), of_family.transform("mean")
    weights = len(values) * weights_of(families)
    return of_family.mean().mean() + weights * (values - means) * np.sqrt(size / (size - 1))


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
    of = scale.difference("learner", scale.stages[-1], 0.9)
    if -bound < of.low <= of.high < bound:
        return "level"
    return "above" if of.low > bound else "below" if of.high < -bound else "open"


def every_scale(cells):
    """Return the scales by measure, group of families and content of memory."""
    return {
        (measure, group, keep): Scale(cells, measure, keep, families)
        for measure in MEASURES
        for group, families in groups_of(cells, measure).items()
        for keep in KEEPS
    }


def tabulate_scales(scales):
    """Tabulate for each family, content of memory and measure: the trend, the least number of
    stages at the level, and the learner's place."""
    rows = {}
    for (measure, group, keep), scale in scales.items():
        row = {"group": group, "keep": keep, "measure": measure, "tasks": len(scale.table)}
        for name, value in {
            "rise": scale.difference(MOST, 1),
            "place": scale.place(),
            "beyond_one": scale.difference("learner", 1),
            "beyond_level": scale.difference("learner", MOST),
        }.items():
            row |= value.columns(name)
        for name, (first, second) in {"hundred": (100, MOST), "beyond": ("learner", MOST)}.items():
            row |= scale.difference(first, second, 0.9).columns(f"{name}_90")
        row["rise_median"] = scale.median(MOST, 1)
        row["beyond_one_median"] = scale.median("learner", 1)
        row["beyond_level_median"] = scale.median("learner", MOST)
        row |= {"level": scale.level(BOUNDS[measure]), "where": where(scale, BOUNDS[measure])}
        rows[f"{group} {keep} {measure}"] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def tabulate(scales):
    """Tabulate both scales and the learner: means over tasks, and by how much they exceed random
    search in one part, by family and over all."""
    rows = {}
    for (measure, group, keep), scale in scales.items():
        for column, mean in scale.means.items():
            name = "learner" if column == "learner" else keep
            row = rows.setdefault(f"{group} {name} {column}".removesuffix(" learner"), {})
            row |= {"group": group, "name": name}
            row |= {"stages": np.nan if name == "learner" else column}
            row |= {"tasks": row.get("tasks", len(scale.table)), measure: mean}
            row |= scale.difference(column, 1).columns(f"{measure}_more")
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
            of_task = more.index.get_level_values(0).to_series(index=more.index)
            places, weights = drawn(of_task), weights_of(of_task).to_numpy()
            weighted = weights * more.to_numpy()
            ends = np.quantile(weighted[places].sum(axis=1), [0.025, 0.975])
            key = {"group": group, "measure": measure, "tasks": len(more)}
            key |= Estimate(weighted.sum(), *ends).columns("more")
            rows[f"{group} {measure}"] = key | {"median": more.median()}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")
