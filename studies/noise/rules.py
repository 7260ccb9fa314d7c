"""Define the rules by which study noise judges. They were committed before the judged runs.

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
        """Values of the three tests: before, after, and after less before."""
        return self.before, self.after, self.after - self.before


def test_mean(values, resamples):
    """Make a two-sided test that the mean over tasks is 0."""
    return bootstrap_test(values, 0.0, "two-sided", resamples=resamples)


def without_favourite(values):
    """Return the values without the largest one in the direction of their mean."""
    sign = np.sign(np.mean(values))
    return np.delete(values, np.argmax(sign * values))


def verdict(before, after, significant):
    """Return the verdict on a pair of methods.

    ``before`` and ``after`` are the mean differences without and with noise. ``significant`` says
    for before, after and change whether their tests are significant. The verdict is

    - *kept* if before and after are significant and have the same sign (*kept, smaller* or *kept,
      larger* if the change is significant, too);
    - *reversed* if before and after are significant and have different signs;
    - *smaller* if only before and the change are significant, and the lead gets smaller;
    - *new* if only after and the change are significant;
    - *open* otherwise.
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
    """Return what verdicts on a pair have in common.

    It is the verdict itself if all are equal, *kept* if all are kinds of *kept*, and otherwise
    *open*.
    """
    if len({*verdicts}) == 1:
        return verdicts[0]
    kinds = {each.partition(",")[0] for each in verdicts}
    return "kept" if kinds == {"kept"} else OPEN


def judge(pairs, resamples=RESAMPLES):
    """Judge pairs of methods, with tests corrected over all pairs (Holm).

    Returns a row for each of ``pairs``, by name, with mean differences, the ratio of the leads,
    three corrected p-values, and three verdicts:

    - ``all_tasks``: the verdict over all tasks;
    - ``without``: the verdict if each test lacks the task that favours its mean most;
    - ``verdict``: what both have in common.
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
    """Return whether *aim* or *posture* is fragile (question 2).

    ``cost`` is the cost of noise in ticks per task. ``share`` is the share of this cost that is
    saved by aiming at the centres of goals. Both are estimates with intervals. The result is

    - *not judged* if the interval of the cost is not wholly above one tick;
    - *aim* if the whole interval of the share is above one half;
    - *posture* if the whole interval of the share is below one half;
    - *undecided* otherwise.
    """
    if not cost.low > 1.0:
        return "not judged"
    if share.low > 0.5:
        return "aim"
    return "posture" if share.high < 0.5 else "undecided"


def judge_levels(values, resamples=RESAMPLES):
    """Test mean differences at several levels of noise, corrected over all levels (question 3).

    ``values`` has one value for each task, by level. A row has the mean, corrected p-values with
    all tasks and without the task that favours the mean most, and the verdict. The verdict is
    *more* or *less* if both p-values are significant, and otherwise *open*.
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
