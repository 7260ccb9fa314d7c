"""Scales of memory: random search by the number of its parts, and where the learner is on them.

Intervals resample tasks within families, which weigh the same.
"""

import numpy as np
import pandas as pd
from cells import KEEPS, MEASURES, groups_of

BOUNDS = {"gain": 5.0, "first": 2.0, "arm": 2.0, "other arm": 0.1}
"""Differences that count as none, set on development instances before any test instance ran."""
STAGES = [1, 2, 4, 10, 30, 100, 1_000]
MOST = STAGES[-1]
RESAMPLES = 9_999


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
