"""Settings of a method beside each other: which is best on each task."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pandas as pd

from coartic.analysis.section import Section
from coartic.analysis.settings import compares_settings, name_in, varied
from coartic.analysis.statistics.estimates import LEVEL, interval, mean
from coartic.analysis.statistics.hypotheses import bootstrap_test, holm
from coartic.analysis.study import Study
from coartic.analysis.table import Rows, runs_of, table
from coartic.analysis.words import interval_in_words, marked, number, plural

MOST_TASKS = 4
"""Tasks on which a sentence names the best setting."""


@table("task, method, runs, solved, reward[], behind, p_holm, least_p")
def settings(study: Study) -> Rows:
    """Mean reward of each setting, the best of each task first.

    ``behind``: ticks behind the best of its task; ``p_holm``: of the two-tailed bootstrap test of
    that difference, corrected for the settings of the task; ``least_p``: the smallest that this
    test can give, uncorrected. Empty where folders compare methods.
    """
    for task in study.tasks if compares_settings(study) else ():
        cells = [cell for (on, _), cell in study.cells.items() if on == task and len(cell.good)]
        cells = [cell for cell in cells if varied(study)[cell.method]]
        cells.sort(key=lambda cell: -cell.rewards.mean())
        tests = [bootstrap_test(cells[0].rewards, cell.rewards, "two-sided") for cell in cells[1:]]
        p = [math.nan, *holm([test.p for test in tests])]
        least = [math.nan, *(test.least_p for test in tests)]
        for cell, corrected, least_p in zip(cells, p, least, strict=True):
            row = {
                "task": marked(study.tasks[task]),
                "method": cell.label,
                "runs": len(cell.runs),
                "solved": len(cell.good),
                **interval("reward", mean(cell.rewards)),
                "behind": cells[0].rewards.mean() - cell.rewards.mean(),
                "p_holm": corrected,
                "least_p": least_p,
            }
            yield f"{task} {cell.label}", row | runs_of(cell)


def answer_settings(study: Study) -> str:
    """The best setting of each task, and whether it is surely better than the next."""
    rows = settings(study)
    tasks = list(dict.fromkeys(rows.task))
    best = rows[~rows.task.duplicated()]
    if len(tasks) > MOST_TASKS:
        counts = best.method.map(partial(setting_in, study)).value_counts()
        most = "; ".join(f"{name} on {count}" for name, count in counts.items())
        return f"Best on {plural(len(tasks), 'task')}: {most}."
    return " ".join(on_task(study, rows[rows.task == task]) for task in tasks)


def setting_in(study: Study, label: str) -> str:
    """A setting in words: the values alone where one method has settings."""
    name = name_in(study, label)
    alone = len({label.partition(" ")[0] for label in settings(study).method}) == 1
    return name.partition(" (")[2].removesuffix(")") if alone else name


def on_task(study: Study, rows: pd.DataFrame) -> str:
    """A sentence on the settings of a task."""
    first, *others = rows.to_dict("records")
    reward = interval_in_words(first, "reward")
    text = f"{first['task']}: {setting_in(study, first['method'])}: {reward} ticks"
    if not others:
        return f"{text}."
    p = np.array([row["p_holm"] for row in others])
    after = f"next {setting_in(study, others[0]['method'])}: {number(others[0]['reward'], 1)}"
    if (p < LEVEL).all():
        return f"{text}, significantly better than all others; {after}."
    if not np.isfinite(p).sum() * others[0]["least_p"] < LEVEL:
        return f"{text}; {after}; the runs are too few, or too alike, to tell."
    surely = "significantly worse" if p[0] < LEVEL else "no significant difference"
    return f"{text}; {after}, {surely}."


SETTINGS = Section(
    "settings",
    short="Settings",
    title="Which setting is best?",
    caption="Mean reward of each setting (ticks), the best of each task first",
    finding=answer_settings,
    table="settings",
    note=(
        "Behind: ticks behind the best setting of the task. p is corrected for the settings of "
        "the task (Holm)."
    ),
)
