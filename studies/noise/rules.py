"""The rules by which study noise judges. They are committed before the runs that they judge.

Question 1 compares methods in pairs. A pair has a value for each task before (without noise) and
after (with noise): the gap of the first method less the gap of the second. Three tests say whether
the mean before, the mean after, and the mean change differ from 0. The verdict follows from which
of them are significant.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd

from coartic.analysis.statistics import bootstrap_test, holm
from coartic.estimates import LEVEL

RESAMPLES = 99_999
OPEN = "open"


class Pair(NamedTuple):
    """Differences of two methods, one value for each task."""

    before: np.ndarray
    """Gap of the first method less gap of the second, without noise, shape ``(tasks,)``."""
    after: np.ndarray
    """The same with noise, shape ``(tasks,)``."""

    @property
    def samples(self):
        """The values of the three tests: before, after, and after less before."""
        return self.before, self.after, self.after - self.before


def test_mean(values, resamples):
    """Test, two-sided, whether the mean over tasks is 0."""
    return bootstrap_test(values, 0.0, "two-sided", resamples=resamples)


def without_favourite(values):
    """Return the values without the largest one in the direction of their mean."""
    sign = np.sign(np.mean(values))
    return np.delete(values, np.argmax(sign * values))


def verdict(before, after, significant):
    """Return the verdict on a pair from its two mean differences and which of the three tests are
    significant.

    - *kept*: both ends are significant and have the same sign; *kept, smaller* or *kept, larger* if
      the change is significant, too;
    - *reversed*: both ends are significant and have different signs;
    - *smaller*: only the end without noise and the change are significant, and the change is
      against the lead;
    - *new*: only the end with noise and the change are significant;
    - *open*: anything else.
    """
    at_start, at_end, change = significant
    if at_start and at_end:
        if before * after < 0:
            return "reversed"
        size = "smaller" if abs(after) < abs(before) else "larger"
        return f"kept, {size}" if change else "kept"
    if at_start and change and (after - before) * before < 0:
        return "smaller"
    if at_end and change:
        return "new"
    return OPEN


def common(*verdicts):
    """Return what verdicts on a pair have in common: the verdict if they are equal, *kept* if all
    of them are kinds of it, else *open*."""
    if len({*verdicts}) == 1:
        return verdicts[0]
    kinds = {each.partition(",")[0] for each in verdicts}
    return "kept" if kinds == {"kept"} else OPEN


def judge(pairs, resamples=RESAMPLES):
    """Judge pairs of methods, with all their tests corrected over each other (Holm).

    Returns a row for each of ``pairs``, by name: mean differences, the ratio of the leads, three
    corrected p-values, and three verdicts: ``all_tasks``; ``without``, in which each test lacks the
    task that favours its mean most; and ``verdict``, what both have in common.
    """
    rows = {name: {} for name in pairs}
    for column, reduce in (("all_tasks", np.asarray), ("without", without_favourite)):
        tests = {
            name: [test_mean(reduce(values), resamples) for values in pair.samples]
            for name, pair in pairs.items()
        }
        p = [each.p for of_pair in tests.values() for each in of_pair]
        adjusted = np.reshape(holm(p, len(p)), (-1, 3))
        for (name, of_pair), p_values in zip(tests.items(), adjusted, strict=True):
            before, after, change = (each.value for each in of_pair)
            rows[name][column] = verdict(before, after, p_values <= LEVEL)
            if column == "all_tasks":
                rows[name] |= {"before": before, "after": after, "change": change}
                rows[name] |= dict(zip(("p_before", "p_after", "p_change"), p_values, strict=True))
                rows[name]["ratio"] = after / before if p_values[0] <= LEVEL else np.nan
    for row in rows.values():
        row["verdict"] = common(row["all_tasks"], row["without"])
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("pair")


def fragile(share, cost):
    """Return what is fragile, *aim* or *posture*, from two estimates with intervals (question 2):
    the share of the cost of noise that aiming at the centre saves, and this cost in ticks a task.

    The aim is fragile if the whole interval of the share lies above one half, the posture if it
    lies below, else it is *undecided*. It is *not judged* where the interval of the cost reaches
    one tick.
    """
    if not cost.low > 1.0:
        return "not judged"
    if share.low > 0.5:
        return "aim"
    return "posture" if share.high < 0.5 else "undecided"


def judge_levels(values, resamples=RESAMPLES):
    """Test mean differences at several levels of noise, corrected over each other (question 3).

    ``values`` has one value for each task, by level. A row has the mean, corrected p-values with
    all tasks and without the task that favours the mean most, and the verdict: *more* or *less* if
    both are significant, else *open*.
    """
    means = [float(np.mean(each)) for each in values.values()]
    adjusted = [
        holm([test_mean(reduce(each), resamples).p for each in values.values()], len(values))
        for reduce in (np.asarray, without_favourite)
    ]
    rows = {}
    for level, mean, p, p_without in zip(values, means, *adjusted, strict=True):
        found = max(p, p_without) <= LEVEL
        word = ("more" if mean > 0 else "less") if found else OPEN
        rows[level] = {"mean": mean, "p": p, "p_without": p_without, "verdict": word}
    return pd.DataFrame.from_dict(rows, orient="index")
