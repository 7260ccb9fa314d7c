"""Define the rules by which study noise judges. They were committed before the judged runs."""

import numpy as np
import pandas as pd

from coartic.analysis import other_tasks
from common.judging import two_sided_tests

RESAMPLES = 99_999
OPEN, DIFFERS = "open", "differs by family"


def judge(differences, resamples=RESAMPLES):
    """Judge differences of gaps between methods and the learner, corrected over all of them.

    ``differences`` has, by name, a series with a value for each task, by family and task: the gap
    of a method less that of the learner. A row has the mean with its interval, both p-values and
    the verdict:

    - *ahead* or *behind*: the mean differs from 0 (:func:`.two_sided_tests`);
    - *differs by family*: so it does, but the whole interval of a family lies on the other side;
    - *open*: it does not.
    """
    table = two_sided_tests(differences, resamples)
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
    differs from 0 (:func:`.two_sided_tests`), and otherwise *open*.
    """
    table = two_sided_tests(values, resamples)
    word = np.where(table["mean"] > 0, "more", "less")
    return table.drop(columns="differs").assign(verdict=np.where(table.differs, word, OPEN))
