"""Compute scales of memory: random search by its number of stages, and the learner's place on them.

Intervals resample tasks within families. All families have the same weight.
"""

import numpy as np
import pandas as pd
from cells import KEEPS, MEASURES, groups_of

from coartic.estimates import Estimate

BOUNDS = {"gain": 5.0, "first": 2.0, "arm": 2.0, "other arm": 0.1}
"""Differences below which means count as equal. They were set on development instances, before any
test instance was run."""
STAGES = [1, 2, 4, 10, 30, 100, 1_000]
MAX_STAGES = STAGES[-1]
RESAMPLES = 9_999


def weights_of(groups):
    """Return the weight of each task in a mean in which all families have the same weight.

    ``groups`` has the family of each task.
    """
    return 1 / groups.groupby(groups).transform("size") / groups.nunique()


def drawn(groups):
    """Return resamples of tasks within families, as indices of shape ``(RESAMPLES, tasks)``.

    ``groups`` has the family of each task. Tasks of a family must be one after the other.
    """
    rng, places, start = np.random.default_rng(0), [], 0
    for size in groups.groupby(groups, sort=False).size():
        places.append(start + rng.integers(size, size=(RESAMPLES, size)))
        start += size
    return np.concatenate(places, axis=1)


class Scale:
    """Means of a measure of random search by its number of stages, and of the learner.

    Random search keeps postures or targets (``keep``). ``table`` has a column for each number of
    stages and a column ``learner``, and a row for each task that has all of these values. ``means``
    are the means over tasks, and ``resampled`` the means over resampled tasks.
    """

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
        """Return the smallest number of stages from which on the measure stays level.

        It stays level if the 90 % interval of the difference from the largest number of stages is
        within ± bound. If this is the case for no other number, the largest number is returned.
        """
        least = self.stages[-1]
        for stages in self.stages[-2::-1]:
            of = self.difference(stages, self.stages[-1], 0.9)
            if not -bound < of.low <= of.high < bound:
                break
            least = stages
        return least

    def place(self):
        """Return the number r of stages at which the mean is the learner's, with a 95 % interval.

        r is interpolated over log r. It is infinite if the learner's mean is above the scale, and 1
        if it is below the scale.
        """
        mean, *found = (
            first_crossing(self.stages, values, learner)
            for *values, learner in np.vstack([self.means, self.resampled])
        )
        return Estimate(mean, *np.quantile(found, [0.025, 0.975], method="inverted_cdf"))

    def slopes(self):
        """Return the slope of each task on log10 of the number of stages (:meth:`by_task`)."""
        x = np.log10(self.stages)
        x = x - x.mean()
        return self.by_task(self.table[self.stages] @ (x / (x @ x)))

    def more(self, first, second):
        """Return the difference of two columns for each task (:meth:`by_task`)."""
        return self.by_task(self.table[first] - self.table[second])

    def median(self, first, second):
        """Return the median over tasks of a column less that of another."""
        return float((self.table[first] - self.table[second]).median())

    def by_task(self, values):
        """Return values whose mean and standard error are those of the mean over families.

        See :func:`by_task`.
        """
        return by_task(values, self.families)


def by_task(values, families):
    """Return values of tasks whose mean and standard error are those of the mean over families.

    The result has shape ``(N,)`` for N tasks. In a mean over F families, a task has the weight
    1 / (F n) if its family has n tasks. In a mean over tasks, it has the weight 1 / N. Therefore
    deviations within a family are multiplied by N / (F n), and by √(n / (n − 1)). ``families`` has
    the family of each task.
    """
    of_family = values.groupby(families)
    size, means = of_family.transform("size"), of_family.transform("mean")
    weights = len(values) * weights_of(families)
    return of_family.mean().mean() + weights * (values - means) * np.sqrt(size / (size - 1))


def first_crossing(stages, scale, value):
    """Return the number of stages at which a scale first reaches a value.

    It is interpolated linearly over the logarithm of the number of stages. It is infinite if the
    scale never reaches the value.
    """
    above = np.flatnonzero(np.asarray(scale) >= value)
    if not len(above):
        return np.inf
    place = above[0]
    if place == 0:
        return float(stages[0])
    part = (value - scale[place - 1]) / (scale[place] - scale[place - 1])
    return float(stages[place - 1] * (stages[place] / stages[place - 1]) ** part)


def where(scale, bound):
    """Compare the learner with the largest number of stages, by the 90 % interval.

    The result is ``level`` if their difference is within ± bound, ``above`` or ``below`` if it
    exceeds the bound, and otherwise ``open``.
    """
    of = scale.difference("learner", scale.stages[-1], 0.9)
    if -bound < of.low <= of.high < bound:
        return "level"
    return "above" if of.low > bound else "below" if of.high < -bound else "open"


def every_scale(cells):
    """Return the scales by measure, group of families, and content of memory."""
    return {
        (measure, group, keep): Scale(cells, measure, keep, families)
        for measure in MEASURES
        for group, families in groups_of(cells, measure).items()
        for keep in KEEPS
    }


def tabulate_scales(scales):
    """Tabulate facts about each scale.

    They are its trend, the smallest number of stages from which on it is level, and the learner's
    place.
    """
    rows = {}
    for (measure, group, keep), scale in scales.items():
        row = {"group": group, "keep": keep, "measure": measure, "tasks": len(scale.table)}
        for name, value in {
            "rise": scale.difference(MAX_STAGES, 1),
            "place": scale.place(),
            "beyond_one": scale.difference("learner", 1),
            "beyond_level": scale.difference("learner", MAX_STAGES),
        }.items():
            row |= value.columns(name)
        for name, (first, second) in {
            "hundred": (100, MAX_STAGES),
            "beyond": ("learner", MAX_STAGES),
        }.items():
            row |= scale.difference(first, second, 0.9).columns(f"{name}_90")
        row["rise_median"] = scale.median(MAX_STAGES, 1)
        row["beyond_one_median"] = scale.median("learner", 1)
        row["beyond_level_median"] = scale.median("learner", MAX_STAGES)
        row |= {"level": scale.level(BOUNDS[measure]), "where": where(scale, BOUNDS[measure])}
        rows[f"{group} {keep} {measure}"] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("row")


def tabulate(scales):
    """Tabulate the means of both scales and of the learner, by family and over all families.

    ``*_more`` is by how much a mean exceeds that of random search in one stage.
    """
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
    """Tabulate how much measures rise if random search keeps targets instead of postures.

    Random search has 1,000 stages. Rows are by family.
    """
    rows = {}
    for measure in MEASURES:
        for group, families in groups_of(cells, measure).items():
            of = cells[cells.group.isin(families) & (cells.stages == MAX_STAGES)]
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
