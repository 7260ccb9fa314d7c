"""Choose the two-sided test of a mean over tasks by its error rate.

    PYTHONPATH=studies python docs/scripts/calibrate_means.py docs/stored/means

Studies test whether a mean over random tasks differs from a bound, by the studentised bootstrap
(``coartic.analysis.statistics.bootstrap_test``). The script measures how often this test rejects if
the mean *is* the bound, for values that are distributed like those of our claims. A *cell* is one
mean that a claim is about. The population of the cell consists of the values that ship with the
study, one for each task, shifted to the mean 0. From this population, 20,000 samples of the same
size are drawn with replacement.

There are two candidates for the two-sided test:

- ``|t|``: the p-value is the share of resamples whose |t| is at least as large;
- ``equal-tailed``: the p-value is twice the smaller of the two one-sided p-values.

**Rule**, committed before the first result: the equal-tailed test is chosen if, at the level 5 %,
its largest share of rejected samples over all cells is not above that of |t|. Otherwise |t| is
kept.

The table has further columns that describe the tests and do not count in the choice:

- both candidates at the level 1 %;
- ``greater`` (the direction of the claim) and ``less``: the one-sided tests at 5 %;
- ``with the rule``: for the two-sided candidates and the one-sided tests, the share of samples with
  p < 0.01, or with p < 0.05 and an absolute skewness of at most 2. This is the rule of verdicts,
  without the adjustment over claims.

All samples of the same size have the same 999 resamples.

Two more tables describe intervals over random tasks (``coartic.analysis.other_tasks``):

- ``coverage.csv``: for each method and family, the share of 500 samples of gaps in which the 95 %
  interval contains the mean of the population. The population consists of the shipped gaps of 40
  tasks;
- ``widths.csv``: the width of the interval divided by the width of the true interval, for normal
  values. There is a row for each number of runs on a task, and each ratio of the SD over runs to
  the SD over tasks.

The script takes some minutes.
"""

import itertools
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pandas as pd

from coartic.analysis import other_tasks
from common import judging

ROOT = Path(__file__).parents[2]
SEED, SAMPLES, RESAMPLES, AT_ONCE, INTERVALS = 0, 20_000, 999, 1_000, 500
LEVEL, STRICT, MOST_SKEWED = 0.05, 0.01, 2.0
METHODS = {
    "dual-process/EC1": "learner", "dual-process/EC4": "learner",
    "dual-process/EC1-informed": "informed learner",
    "dual-process/EC4-informed": "informed learner",
    "hill-climbing": "hill climbing", "random-search": "random search",
    "cma-es/bandit": "CMA-ES",
}  # fmt: skip
"""Maps ids of the methods that study noise compares to their names. Forms of the learner for one
and for two arms have the same name."""


DEFAULTS = {
    "dual-process": {"counted": "later", "discount": 0.0},
    "receding-horizon": {"nodes": 200, "horizon": 1},
}
"""Maps the first part of a method's id to the defaults of its parameters, which the settings of
shipped runs leave out."""


def program(study):
    """Import the program of a study, and return it with the study's shipped runs."""
    folder = ROOT / "studies" / study
    for name in {path.stem for path in (ROOT / "studies").glob("*/*.py")} & {*sys.modules}:
        del sys.modules[name]  # modules of studies have the same names
    sys.path.insert(0, str(folder))
    try:
        return __import__("study"), pd.read_csv(folder / "runs.csv.xz")
    finally:
        sys.path.remove(str(folder))


def with_settings(rows):
    """Return an object with the attributes ``runs`` and ``signature`` of a study, for shipped runs.

    ``rows`` are the runs that ship with a study.
    """
    settings = [
        dict(each.split("=") for each in text.split(", ")) if text else {}
        for text in rows.setting.fillna("")
    ]
    numbers = pd.DataFrame(settings, index=rows.index).drop(columns="hands", errors="ignore")
    for name in {"nodes", "horizon", "discount"} & {*numbers}:
        numbers[name] = numbers[name].astype(float)
    for method, defaults in DEFAULTS.items():
        is_method = rows.method.str.startswith(method)
        for name in {*defaults} & {*numbers}:
            numbers.loc[is_method, name] = numbers.loc[is_method, name].fillna(defaults[name])
    is_random = rows.task.str.contains("/")
    runs = rows.join(numbers).assign(
        setting=rows.setting.fillna(""),
        family=rows.task.str.rpartition("/")[0].where(is_random),
        goals=rows.hands.str.len(),
        gap=(rows.best_known - rows.reward) / -rows.best_known,
    )

    def signature(name, *, replay=False):
        return runs[f"{'replay_' * replay}{name.replace(' ', '_')}"]

    return SimpleNamespace(runs=runs, signature=signature)


def claims_of(study):
    """Judge the claims of a study by its shipped runs, and return the table."""
    program_, rows = program(study)
    if study == "dial":
        moved = pd.read_csv(ROOT / "studies/dial/moved.csv")
        return pd.concat(
            [
                program_.judge_claims(program_.measure_runs(rows)),
                program_.judge_shifts(program_.measure_shifts(moved)),
            ]
        )
    if study == "memory":
        cells = pd.read_csv(ROOT / "studies/memory/cells.csv", index_col=0)
        return program_.judge_claims(cells, program_.every_scale(cells))
    shipped = with_settings(rows)
    if study == "dose":
        return program_.judge_claims(program_.measure_runs(shipped))
    plans = program_.measure_plans(shipped)
    if study == "horizon":
        return program_.judge_claims(shipped, program_.average(plans))
    repeats = program_.repeats_of(plans)
    return program_.judge_claims(shipped, program_.first_plans(plans), repeats)


def samples_of_claims(study):
    """Return the words and the values over tasks of each mean in a study's claims.

    The bound is subtracted from the values. If the mean is claimed to lie below the bound, their
    sign is changed, so that each claim is that the mean is above 0.
    """
    samples, judge = [], judging.mean_beyond

    def record(sentence, values, bound=0.0, side="greater"):
        sample = judging.SIGNS[side] * (np.asarray(values, dtype=float) - bound)
        samples.append(
            (f"{sentence.replace('{}', '...')} ({side} {bound:g})", sample[~np.isnan(sample)])
        )
        return judge(sentence, values, bound, side)

    with (
        patch.object(judging, "mean_beyond", record),
        patch.object(judging, "RESAMPLES_OF_CLAIMS", 99),
    ):
        claims_of(study)
    return samples


def samples_of_hands():
    """Return a dict that maps each family to differences of gains on its tasks.

    A difference is the gain of the learner's table minus the gain of hill climbing with centres.
    """
    runs = pd.read_csv(ROOT / "studies/memory/hands.csv.xz")
    gains = runs.pivot_table("reward", ["family", "task"], "cell")
    more = gains.table - gains.centres
    return {f"{family}: table less centres": values.to_numpy()
            for family, values in more.groupby("family", sort=False)}  # fmt: skip


def gaps_of_noise(noise):
    """Return the gaps (per cent) that ship with study noise at a motor noise.

    The frame is indexed by family and task, and has a column for each method.
    """
    rows = pd.read_csv(ROOT / "studies/noise/runs.csv.xz", low_memory=False)
    rows = rows[(rows.question == "practised") & (rows.target == "T") & rows.setting.isna()]
    rows = rows[rows.method.isin(METHODS)]
    rows = rows.assign(gap=100 * (rows.ticks + rows.best_known) / -rows.best_known)
    rows["name"], rows["family"] = rows.method.map(METHODS), rows.task.str.partition("/")[0]
    rows = rows[rows.motor_noise == noise]
    return rows.pivot_table("gap", ["family", "task"], "name", sort=False)


def samples_of_noise():
    """Return gaps of methods minus the learner's gaps, without noise and with motor noise 0.01.

    The dict maps words, which name family, method and noise, to an array with a value for each
    task.
    """
    samples = {}
    for noise in (0.0, 0.01):
        gaps = gaps_of_noise(noise)
        for name in gaps.columns.drop("learner"):
            less = (gaps[name] - gaps.learner).dropna()
            groups = {"all families": less} | dict([*less.groupby("family", sort=False)])
            samples |= {f"{group}: {name} less learner, noise {noise:g}": values.to_numpy()
                        for group, values in groups.items()}  # fmt: skip
    return samples


def every_sample():
    """Yield the study, the words, and the values over tasks of each cell."""
    for study in ("dial", "dose", "fourteen", "horizon", "memory"):
        for words, values in samples_of_claims(study):
            yield study, words, values
    for words, values in samples_of_hands().items():
        yield "memory, hands", words, values
    for words, values in samples_of_noise().items():
        yield "noise", words, values


def skewness(values):
    """Return the skewness of each row; 0 for a row of equal values."""
    around = values - values.mean(axis=-1, keepdims=True)
    spread = (around**2).mean(axis=-1)
    third = (around**3).mean(axis=-1)
    return np.divide(third, spread**1.5, out=np.zeros_like(third), where=spread > 0)


def t_of(means, variances):
    """Return t: 0 where the mean is 0, infinite where only the variance is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.abs(means) < 1e-9, 0.0, means / np.sqrt(variances))


def p_by_test(samples, counts):
    """Return a dict that maps each test to the p-values of all samples, shape ``(samples,)``.

    ``samples`` has a sample in each row, shape ``(samples, n)``. ``counts``, shape
    ``(n, resamples)``, says how often each resample draws each value.
    """
    n = samples.shape[1]
    shifted = samples - samples.mean(axis=1, keepdims=True)
    observed = t_of(samples.mean(axis=1), samples.var(axis=1, ddof=1) / n)[:, None]
    means = shifted @ counts / n
    variances = np.maximum(shifted**2 @ counts / n - means**2, 0.0) / (n - 1)
    variances[variances < 1e-12 * (shifted**2).mean(axis=1, keepdims=True)] = 0.0
    null = t_of(means, variances)
    extreme = {
        "|t|": np.abs(null) >= np.abs(observed) - 1e-9,
        "greater": null >= observed - 1e-9,
        "less": null <= observed + 1e-9,
    }
    p = {name: (1 + each.sum(axis=1)) / (1 + RESAMPLES) for name, each in extreme.items()}
    equal = np.minimum(1.0, 2 * np.minimum(p["greater"], p["less"]))
    return {"|t|": p["|t|"], "equal-tailed": equal, "greater": p["greater"], "less": p["less"]}


def cell(values, rng):
    """Return the share of rejected samples of a cell, by test and level.

    ``values`` is the population of the cell.
    """
    centred, n = values - values.mean(), len(values)
    draws = np.random.default_rng([SEED, n]).integers(n, size=(RESAMPLES, n))
    counts = np.stack([np.bincount(draw, minlength=n) for draw in draws], axis=1).astype(float)
    found = []
    for _ in range(SAMPLES // AT_ONCE):
        samples = centred[rng.integers(n, size=(AT_ONCE, n))]
        p = pd.DataFrame(p_by_test(samples, counts))
        found.append(p.assign(skewed=np.abs(skewness(samples)) > MOST_SKEWED))
    p = pd.concat(found)
    row = {"n": n, "skewness": float(skewness(values))}
    for test in ("|t|", "equal-tailed", "greater", "less"):
        row[f"{test} at 5 %"] = (p[test] < LEVEL).mean()
        if test in ("|t|", "equal-tailed"):
            row[f"{test} at 1 %"] = (p[test] < STRICT).mean()
        row[f"{test} with the rule"] = (p[test] < np.where(p.skewed, STRICT, LEVEL)).mean()
    return row


def coverage():
    """Return how often the interval over tasks contains the mean gap.

    The frame has a row for each method and family.
    """
    rows, rng = [], np.random.default_rng(SEED)
    for name, of_method in gaps_of_noise(0.0).items():
        for family, gaps in of_method.groupby("family", sort=False):
            population, held = gaps.to_numpy(), 0
            for _ in range(INTERVALS):
                sample = rng.choice(population, len(population))
                found = other_tasks({family: [*sample[:, None]]})
                held += found.low <= population.mean() <= found.high
            row = {"method": name, "family": family, "tasks": len(population)}
            row |= {"skewness": float(skewness(population)), "coverage": held / INTERVALS}
            rows.append(row)
    return pd.DataFrame(rows)


def widths(tasks=40):
    """Return the mean width of the interval, divided by the true width.

    The interval is the 95 % interval over tasks. The frame has a row for each number of runs on a
    task, and each ratio of SDs. Each sample has ``tasks`` tasks.
    """
    rows, rng = [], np.random.default_rng(SEED)
    for runs, ratio in itertools.product((3, 5, 20), (0.5, 1.0, 2.0, 4.0)):
        found = []
        for _ in range(INTERVALS // 5):
            values = rng.normal(size=(tasks, 1)) + ratio * rng.normal(size=(tasks, runs))
            interval = other_tasks({"family": [*values]})
            found.append(interval.high - interval.low)
        true = 2 * 1.96 * np.sqrt((1 + ratio**2 / runs) / tasks)
        rows.append({"runs": runs, "sd_runs_over_tasks": ratio, "width": np.mean(found) / true})
    return pd.DataFrame(rows)


def main(folder):
    """Write the three tables, and print the worst cell of each test."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, made in (("coverage", coverage()), ("widths", widths())):
        made.to_csv(folder / f"{name}.csv", index=False, float_format="%.4g")
        print(made.to_string())
    rows, rng = [], np.random.default_rng(SEED)
    for study, words, values in every_sample():
        if np.ptp(values):
            rows.append({"study": study, "mean": words} | cell(values, rng))
    table = pd.DataFrame(rows)
    table.to_csv(folder / "cells.csv", index=False, float_format="%.5g")
    tests = table.columns[4:]
    print(len(table), "cells")
    print(table[tests].describe().loc[["mean", "50%", "max"]].T.round(4).to_string())
    for test in ("|t| at 5 %", "equal-tailed at 5 %"):
        print(table.loc[table[test].idxmax(), ["study", "mean", "n", "skewness", test]].to_string())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
