"""Measure how fast postures shift after an announced change, with settings along the dial."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from announced import moves, with_shares
from settings import DIAL, FAMILIES, PAPER, PLANNER, SETTINGS, TRIALS, base_of

from coartic import learn, load_task
from coartic.analysis import means
from common.judging import judge_means

SHIFTED = (PAPER, *DIAL[2:], PLANNER)
"""Settings of learners that practise a task, are told that a goal has moved, and practise again."""
SHIFT_TASKS = [f"{family}/v1/i{number:03d}" for number in range(30) for family in FAMILIES[:2]]
SHIFT_AFTER = (1, 2, 3, 10, 30, 100, 300, 1_000, 10_000)
"""Numbers of trials after the change at which the solution is measured. The last is the whole
practice."""
SHIFT_COLUMNS = ["task", "setting", "goal", "same", "square", *(f"dot_{n}" for n in SHIFT_AFTER)]


def run_shifts(name):
    """Measure how postures at a goal shift after the next goal has moved.

    Learners practise a task. Then the goal after ``goal`` moves by half a link, and the learners
    practise on: they keep their movements and forget the rewards. Returns rows of
    :data:`SHIFT_COLUMNS`:

    - ``dot_N``: scalar product of the shift of the posture at ``goal`` after N trials and the shift
      after all trials;
    - ``square``: scalar product of the shift after all trials with itself;
    - ``same``: scalar product of the shift in as much practice without a change and the shift after
      all trials.
    """
    task, seed, rows = load_task(name), SHIFT_TASKS.index(name), []
    cases = [(g, other) for g, distance, other in moves(task, seed) if distance == 0.5]
    for setting in SHIFTED:
        condition = replace(base_of(task), **SETTINGS[setting])
        practised = learn(task, condition, seed=10 * seed, trials=TRIALS)
        more = {"condition": condition, "seed": 10 * seed + 1, "start": practised.solution}
        before = practised.execute().configurations
        went_on = learn(task, trials=TRIALS, **more).execute().configurations
        for g, other in cases:
            runs = [learn(other, trials=n, **more) for n in SHIFT_AFTER]
            after = [run.execute().configurations[g] for run in runs]
            shifts = np.array(after) - before[g]
            same = (went_on[g] - before[g]) @ shifts[-1]
            rows.append([name, setting, g, same, shifts[-1] @ shifts[-1], *(shifts @ shifts[-1])])
    return rows


def measure_shifts(raw):
    """Measure shares of the shift after the change, with a row for each task and setting.

    ``share_N`` and ``log_half`` (:func:`announced.with_shares`) are computed from sums over goals.
    ``unchanged`` is the share of the shift that the same amount of practice brings without a
    change.
    """
    sums = raw.groupby(["setting", "task"], sort=False).sum(numeric_only=True).reset_index()
    sums["family"] = sums.task.str.partition("/")[0]
    return with_shares(sums, SHIFT_AFTER).assign(unchanged=sums.same / sums.square)


def tabulate_shifts(shifts):
    """Tabulate shares of the shift, and median trials to half of it, by family and setting."""
    numbers = [*(f"share_{n}" for n in SHIFT_AFTER), "unchanged"]
    table = means(shifts, ["family", "setting"], numbers).rename(columns={"rows": "tasks"})
    trials = (10**shifts.log_half).groupby([shifts.family, shifts.setting], sort=False)
    medians = trials.median().rename("half_0.5")
    table = table.merge(medians, left_on=["family", "setting"], right_index=True)
    table.index = (table.family + " " + table.setting).rename("row")
    return table


def by_task(rows, setting, column):
    """Return the means of a column under a setting by family and task."""
    return rows[rows.setting == setting].groupby(["family", "task"])[column].mean()


def in_each(values, families=FAMILIES):
    """Return values by family, for a claim that has to hold in each family."""
    return {family: values[family] for family in families}


def judge_shifts(shifts):
    """Judge the claims on an announced change.

    The claims were registered before any test instance was run.
    """
    quicker = by_task(shifts, PAPER, "log_half") - by_task(shifts, PLANNER, "log_half")
    quicker, after_ten, unchanged = (in_each(values, FAMILIES[:2]) for values in (
        quicker, by_task(shifts, PLANNER, "share_10"), by_task(shifts, PLANNER, "unchanged")
    ))  # fmt: skip
    values = {
        "drift-makes-the-shift-quick": [quicker],
        "drift-shifts-within-ten-trials": [after_ten, after_ten],
        "shift-is-of-the-change": [unchanged],
    }
    return judge_means(Path(__file__).with_name("claims.toml"), values)
