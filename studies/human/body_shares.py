"""Measure finding body-shares: which parts of the body vary at the first goal with the second goal.

    python studies/human/body_shares.py

When people reach to a first target, their hip, shoulder and elbow vary with the position of the
second target. Tasks ascending and descending of the shipped suite ``comparison`` share their first
goal, and no other goal. This script compares mean postures at the first goal: the base stands for
the hip, the first joint of the arm for the shoulder, and the second joint for the elbow. The unit
of inference is the run. The script writes body.csv, which study.py joins with the other effects.
"""

from pathlib import Path

import numpy as np
from study import MODELS, RESAMPLES, SEARCH, columns_of, decide, tabulate_effects

from coartic.analysis import load
from coartic.estimates import Estimate

TASKS, NAME = ("ascending", "descending"), "body-shares"


def postures(study, model):
    """Return a model's configurations at goal 1 on both tasks, shape ``(runs, dof)`` each.

    The list is empty if the model did not run on both tasks.
    """
    method = MODELS[model]["method"] or "dual-process/EC1"
    if any((task, method) not in study.cells for task in TASKS):
        return []
    return [study.configurations(task, method)[:, 0] for task in TASKS]


def differences(groups, joints):
    """Return the distance between the mean postures of two groups, in some joints."""
    first, second = (group[:, joints].mean(axis=0) for group in groups)
    return float(np.linalg.norm(first - second))


def with_interval(sides, joints, level):
    """Return the difference of a model, or its excess over that of a second model, with interval.

    The ends of the interval are percentiles of a bootstrap of runs. If each group has a single run,
    both ends are equal to the value.
    """

    def statistic(drawn):
        first, *second = (differences(groups, joints) for groups in drawn)
        return first - sum(second)

    rng = np.random.default_rng(0)
    drawn = [
        statistic([[group[rng.integers(len(group), size=len(group))] for group in groups]
                   for groups in sides])
        for _ in range(RESAMPLES)
    ]  # fmt: skip
    ends = np.quantile(drawn, [level / 2, 1 - level / 2])
    return Estimate(statistic(sides), *map(float, ends))


def measure_body(study):
    """Return the effects of this finding, as :func:`study.tabulate_effects` does."""
    robot = study.tasks[TASKS[0]].robot
    arm = np.arange(robot.dof)[robot.joints("right")]
    groups = {"base": [0, 1], "shoulder": arm[:1], "elbow": arm[1:2]}
    search = postures(study, SEARCH)

    def judge(model, test, level, silent):
        ours = [] if silent else postures(study, model)
        joints = groups[test["measure"].split()[0]]
        seen, over = Estimate(np.nan), Estimate(np.nan)
        if ours:
            seen = with_interval([ours], joints, level)
        if ours and model != SEARCH:
            over = with_interval([ours, search], joints, level)
        count = min(map(len, ours)) if ours else 0
        return columns_of(
            test, seen, over, count, *decide(test, seen, over, count and np.inf, silent)
        )

    return tabulate_effects([NAME], judge)


if __name__ == "__main__":
    measure_body(load("shipped").worlds[""]).to_csv(
        Path(__file__).with_name("body.csv"), float_format="%.6g"
    )
