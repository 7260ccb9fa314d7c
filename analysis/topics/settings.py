"""Settings of a method beside each other: which is best on each task."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from coartic.analysis.settings import compares_settings, name_in, varied
from coartic.analysis.statistics.hypotheses import bootstrap_test, holm
from coartic.analysis.study import Study
from coartic.analysis.table import Rows, runs_of, table
from coartic.analysis.words import capital, interval, listed, marked, number
from coartic.estimates import LEVEL, mean
from coartic.internal.text import counted

MOST_TASKS = 4
"""Tasks on which a sentence names the best setting."""


@table("task, method, runs, solved, reward[], gap_ticks, p_holm, least_p")
def list_settings(study: Study) -> Rows:
    """Mean reward of each setting, the best of each task first.

    ``gap_ticks``: ticks behind the best of its task; ``p_holm``: of the two-tailed bootstrap test
    of that difference, corrected for the settings of the task; ``least_p``: the smallest that this
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
                **mean(cell.rewards).columns("reward"),
                "gap_ticks": cells[0].rewards.mean() - cell.rewards.mean(),
                "p_holm": corrected,
                "least_p": least_p,
            }
            yield f"{task} {cell.label}", row | runs_of(cell)


def best_settings(study: Study) -> str:
    """Say which setting is best on each task, and whether it is surely better than the next."""
    rows, texts, won, sure = list_settings(study), [], Counter[str](), Counter[str]()
    for task, title in ((name, marked(task)) for name, task in study.tasks.items()):
        of_task = rows[rows.task == title]
        if of_task.empty:
            continue
        rewards = {label: study.cells[task, label].rewards for label in of_task.method}
        first, best = of_task.iloc[0].to_dict(), rewards[of_task.method.iloc[0]]
        alike = [label for label, others in rewards.items() if np.array_equal(others, best)]
        names = listed(name_in(study, label) for label in alike)
        text = f"{title}: {names}, {interval(first, 'reward')} ticks"
        text += " each, the same in every run" * (len(alike) > 1)
        won[names if len(alike) == 1 else ""] += 1
        for second in of_task[~of_task.method.isin(alike)].head(1).to_dict("records"):
            surely = "significant" if second["p_holm"] < LEVEL else "no significant difference"
            if not of_task.p_holm.count() * second["least_p"] < LEVEL:
                surely = "the runs are too few, or too alike, to tell"
            elif len(alike) == 1:
                sure[names] += surely == "significant"
            next_best = name_in(study, second["method"])
            text += f"; next {next_best}, {number(second['reward'], 1)} ({surely})"
        texts.append(f"{text}.")
    if not texts:
        return ""
    more, of_tasks = len(texts) - MOST_TASKS, counted(len(texts), "task")
    card = f"No setting is better than all others on any of {of_tasks}"
    for best_name, count in [each for each in won.most_common() if each[0]][:1]:
        certainty = (
            f"significantly on {sure[best_name]}"
            if best_name in sure
            else "too few runs to be sure"
        )
        card = f"{capital(best_name)} is best on {count} of {of_tasks}, {certainty}"
    several = f" And {more} more in the table." if more > 0 else ""
    return f"{card}.\n{' '.join(texts[:MOST_TASKS])}{several}"
