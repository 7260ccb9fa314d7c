"""Section on methods from files, on the tasks on which they ran."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd

from coartic.analysis import standings
from coartic.analysis.method_frame import BY_TRIAL, GROUPS
from coartic.analysis.methods import most_exploring
from coartic.analysis.sections import ranking
from coartic.analysis.study import Study
from coartic.analysis.table import Rows, row_of_cell, table
from coartic.analysis.words import MOST_NAMED, listed, marked, number, p_value, percent
from coartic.internal.text import counted

NO_TEST = " (the runs are too few, or too alike, for a test)"


def own_methods(study: Study) -> list[str]:
    """Return the methods from files that solved every run on a task, the smallest gap first."""
    rows = ranking.shown_gaps(study)
    return [*rows.method[~rows.built_in.astype(bool)]]


def nearest_others(study: Study, method: str) -> dict[str, float]:
    """Return the gaps of the nearest built-in method and of the learner, by their names, on the
    tasks that a method solved.

    Built-in methods with the same use of the reward come first.
    """
    rows = standings.gaps_on(study, standings.solved_tasks(study, method))
    group = study.methods.information[method]
    rows = pd.concat([standings.leaders(rows, of) for of in (group, *GROUPS)])
    rows = rows[rows.built_in.astype(bool)].drop_duplicates("method")
    is_learner = standings.is_learner(rows)
    nearest = rows[~is_learner & (rows.kind != "no learning")]
    others = pd.concat([nearest.head(1), rows[is_learner].head(1)]).to_dict("records")
    return {standings.called(row): row["gap"] for row in others}


@table(
    "task; method; runs; solved: -; reward± .1; gap: gap (%) .1; nearest; "
    "nearest_gap: gap of the nearest (%) .1; learner: learner's reward .1; p_holm: p (corrected) .p"
)
def list_own(study: Study) -> Rows:
    """List methods from files on each task, with the nearest built-in method and the learner."""
    compared, tested = standings.compared(study), ranking.list_against_learner(study)
    rows = study.methods
    for task in study.tasks:
        cells = {method: of[task] for method, of in compared.items() if task in of}
        gaps = {
            cell.gap: method
            for method, cell in cells.items()
            if rows.built_in[method] and not rows.under[method] and len(cell.good)
        }
        for method, cell in cells.items():
            if rows.built_in[method]:
                continue
            row = row_of_cell(study, cell) | {
                "nearest": gaps[min(gaps)] if gaps else None,
                "nearest_gap": min(gaps, default=math.nan),
            }
            if (name := f"{task} {method}") in tested.index:
                row |= {column: tested[column][name] for column in ("learner", "p_holm")}
            yield name, row


def own_in_words(study: Study) -> str:
    """Say the gaps of methods from files, the smallest first, with the gaps of other methods."""
    names = own_methods(study)
    lines = [card(study, method) for method in names[:1]]
    lines += [details(study, method) for method in names[:MOST_NAMED]]
    lines += [f"And {len(names) - MOST_NAMED} more in the table."] * (len(names) > MOST_NAMED)
    foreign = [key for key in study.cells if not study.methods.built_in[key[1]]]
    for task, label in foreign:
        if sum(other == task for other, _ in study.cells) == 1:
            only = f"{label} is the only method on {marked(study.tasks[task])}: name others, too."
            lines.append(only)
    cells = [study.cells[key] for key in foreign]
    lines.append(standings.failed_runs(study, cells, ", and these tasks do not count").strip())
    return "\n".join(filter(None, lines))


def card(study: Study, method: str) -> str:
    """Say the gap of a method from a file in a line, with its tasks and the nearest other one."""
    row: Any = ranking.list_ranking(study).loc[method]
    title = study.methods.title[method]
    text, nearest = f"gap of {percent(row['gap'])}", ""
    for other, gap in [*nearest_others(study, method).items()][:1]:
        nearest = f"{other} {percent(gap)}"
    if covered := standings.coverage(study, method):
        same = "task" if len(standings.solved_tasks(study, method)) == 1 else "tasks"
        on_the_same = f"; {nearest} on the same {same}" * bool(nearest)
        return f"{title} ran on {covered}: {text} there{on_the_same}."
    if not math.isnan(row["better"]):
        tasks = counted(len(against_learner(study, method)), "task")
        text += f", better than the learner on {row['better']:.0f} of {tasks}"
    elif nearest:
        text += f" ({nearest})"
    return f"{title}: {text}."


def details(study: Study, method: str) -> str:
    """Say the gap of a method from a file with its interval, gaps of other methods on the same
    tasks, its number of trials if the learner made another number, and tests."""
    row: Any = ranking.list_ranking(study).loc[method]
    tests = against_learner(study, method)
    tasks = standings.solved_tasks(study, method)
    is_partial = bool(standings.coverage(study, method))
    gap = f"Gap of {study.methods.title[method]} to the {standings.reference(study, tasks)}"
    if is_partial and len(tasks) <= MOST_NAMED:
        gap += f" on {listed(marked(study.tasks[task]) for task in tasks)}"
    gap += f": {ranking.gap_in_words(row)}"
    for other, gap_of_other in nearest_others(study, method).items():
        gap += f"; of {other}{' there' * is_partial}: {percent(gap_of_other)}"
    sentences, untested = [gap, trials_made(study, method)], math.isnan(row["better"])
    if len(tests) == 1:
        reward, learner, p = tests[["reward", "learner", "p_holm"]].iloc[0]
        text = f"Its mean reward is {number(reward, 1)}, the learner's {number(learner, 1)}"
        sentences.append(text + (NO_TEST if untested else f" ({p_value(p)})"))
    elif len(tests) and untested:
        higher = int((tests.reward > tests.learner).sum())
        text = f"Its mean reward is higher than the learner's on {higher} of {len(tests)} tasks"
        sentences.append(text + NO_TEST)
    elif len(tests):
        text = (
            f"It is significantly better than the learner on {counted(int(row['better']), 'task')}"
        )
        sentences.append(f"{text} and worse on {row['worse']:.0f}")
    sentences.append("Its information is as its author declares")
    return ". ".join(filter(None, sentences)) + "."


def against_learner(study: Study, method: str) -> pd.DataFrame:
    """Return the rows of a method in table ``against-learner``."""
    rows = ranking.list_against_learner(study)
    return rows[rows.method == method]


def trials_made(study: Study, method: str) -> str:
    """Say how many trials a method that learns from trials, and the learner, made at most.

    Empty if the numbers are equal, or one of them made no trials.
    """
    cells = standings.compared(study)[method]
    keys = [(task, most_exploring(study.tasks[task])) for task in cells]
    learners = [study.cells[key] for key in keys if key in study.cells]
    made, learned = (
        max((trials for each in of for trials in each.runs.trials.dropna()), default=0)
        for of in (cells.values(), learners)
    )
    if study.methods.information[method] != BY_TRIAL or learned in (0, made):
        return ""
    return f"It made {number(made)} trials (the learner: {number(learned)})"
