"""Define the rules by which study noise judges. They were committed before the judged runs."""

import numpy as np
import pandas as pd

from coartic.analysis import other_tasks
from coartic.analysis.statistics import bootstrap_test, holm
from common.judging import level_of

RESAMPLES = 99_999
OPEN, DIFFERS = "open", "differs by family"


def test_mean(values, resamples):
    """Make a two-sided test that the mean over tasks is 0."""
    return bootstrap_test(values, 0.0, "two-sided", resamples=resamples)


def without_favourite(values):
    """Return the values without the largest one in the direction of their mean."""
    sign = np.sign(np.mean(values))
    return np.delete(values, np.argmax(sign * values))


def tests_of(values, resamples):
    """Test samples by name with all tasks and without the task that favours the mean most.

    Returns a row for each sample with its mean, both p-values, corrected over all samples (Holm),
    and whether the mean differs from 0: both are below the level of the sample (1 % if its values
    are very skewed, else 5 %).
    """
    samples = {name: np.asarray(each, dtype=float) for name, each in values.items()}
    p, p_without = (
        holm([test_mean(reduce(each), resamples).p for each in samples.values()])
        for reduce in (np.asarray, without_favourite)
    )
    table = pd.DataFrame(
        {"mean": [each.mean() for each in samples.values()], "p": p, "p_without": p_without},
        index=[*samples],
    )
    levels = [level_of(each) for each in samples.values()]
    table["differs"] = table[["p", "p_without"]].max(axis=1) < levels
    return table


def judge(differences, resamples=RESAMPLES):
    """Judge differences of gaps between methods and the learner, corrected over all of them.

    ``differences`` has, by name, a series with a value for each task, by family and task: the gap
    of a method less that of the learner. A row has the mean with its interval, both p-values and
    the verdict:

    - *ahead* or *behind*: the mean differs from 0 (:func:`tests_of`);
    - *differs by family*: so it does, but the whole interval of a family lies on the other side;
    - *open*: it does not.
    """
    table = tests_of(differences, resamples)
    rows = {}
    for (name, values), test in zip(differences.items(), table.itertuples(), strict=True):
        by_family = {
            family: [*of_family.to_numpy()[:, None]]
            for family, of_family in values.groupby("family", sort=False)
        }
        estimates = [other_tasks({family: each}) for family, each in by_family.items()]
        is_ahead = test.mean < 0
        word = "ahead" if is_ahead else "behind"
        if any(each.low > 0 if is_ahead else each.high < 0 for each in estimates):
            word = DIFFERS
        rows[name] = other_tasks(by_family).columns("difference")
        rows[name] |= {"p": test.p, "p_without": test.p_without}
        rows[name]["verdict"] = word if test.differs else OPEN
    return pd.DataFrame.from_dict(rows, orient="index")


def judge_levels(values, resamples=RESAMPLES):
    """Judge mean differences at several levels of noise, corrected over all levels (memory).

    ``values`` has one value for each task, by level. The verdict is *more* or *less* if the mean
    differs from 0 (:func:`tests_of`), and otherwise *open*.
    """
    table = tests_of(values, resamples)
    word = np.where(table["mean"] > 0, "more", "less")
    return table.drop(columns="differs").assign(verdict=np.where(table.differs, word, OPEN))
