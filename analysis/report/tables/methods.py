"""Every method side by side, on one task and over all."""

from __future__ import annotations

import math
from dataclasses import replace

from coartic.analysis.comparisons.methods import TOLD, MethodRow
from coartic.analysis.markup import escaped
from coartic.analysis.report.document import DataTable, Row
from coartic.analysis.report.tables.common import marked, mean_of, table_ids
from coartic.analysis.report.tables.layout import LAYOUTS
from coartic.analysis.results.optima import ARMS
from coartic.analysis.study import Study
from coartic.analysis.words import true_minus
from coartic.method import Information
from coartic.record import SEARCH
from coartic.text import counted

_METHODS, _OVERALL = LAYOUTS["methods"], LAYOUTS["across-tasks"]
_WHOLE = ("trials", "movement_ticks", "forward_kinematics", "jacobians", "solver_iterations")
"""Medians that are shown whole."""
_GROUPS = ("Methods, the best mean reward first", "Searches for the optimum: references")


def reading_of_methods(study: Study) -> tuple[str, ...]:
    """What the columns of :func:`methods_table` mean, and what does not fit."""
    impossible, corrected = [], []
    for (task, label), row in study.method_rows.items():
        name = escaped(f"{task} x {label}")
        if row.beaten:
            are = "is" if row.beaten == 1 else "are"
            impossible.append(
                f"**{counted(row.beaten, 'run')} of {name} {are} better than the optimum: it is "
                "not one. Report this.**"
            )
        if row.corrections and TOLD[Information.REWARD_BY_TRIAL] not in row.told:
            corrected.append(
                f"{name}: its solutions needed "
                f"{counted(row.corrections, 'corrective movement')} in all."
            )
    return (*impossible, *_METHODS.reading_with(), *corrected)


def methods_table(study: Study, task: str) -> DataTable | None:
    """Every method on one task: the optimum's searches, then the best mean reward first."""
    return _METHODS.table(
        (_method_row(study, row) for row in study.method_rows.values() if row.task == task),
        table_ids(study)[task],
        task=escaped(marked(study, task)),
        optimum=_optimum(study, task),
    )


def _method_row(study: Study, row: MethodRow) -> Row:
    key = row.task, row.label
    reward = mean_of(study.cells[key].good.reward)
    whole = {name: _whole(getattr(row, name)) for name in _WHOLE}
    made = _METHODS.row(row.label, row, (key,), method=row.label, reward=reward, **whole)
    return replace(made, group=_GROUPS[row.method.startswith(SEARCH)])


def _optimum(study: Study, task: str) -> str:
    """What is known of a task's best rewards, in inline markup."""
    known = []
    for arm in ARMS:
        best = study.optima.get((task, arm))
        if best is not None:
            bound = "no bound proven" if best.bound is None else f"proven bound {best.bound}"
            how = "proven" if best.proven else bound
            known.append(f"{arm} {best.reward} {best.hands} ({how})")
    if not known:
        return f"its optimum is not among the runs (methods {escaped(SEARCH)}\\*)"
    return f"optimum, by the other arm: {true_minus(', '.join(known))}"


def overall_table(study: Study) -> DataTable | None:
    """Every method over all tasks that have an optimum."""
    rows, scores = [], study.scores
    for _, found in study.overall.iterrows():
        own = scores[scores.method == found.method]
        cells = zip(own.task.map(str), own.label.map(str), strict=True)
        ran = {"runs": int(found.runs), "failed": int(found.failed)}
        rows.append(_OVERALL.row(found.method, found, dict.fromkeys(cells), **ran))
    known, tasks = scores.task.nunique(), len(study.tasks)
    of = "All tasks" if known == tasks else f"The {known} of {tasks} tasks with a known optimum"
    return _OVERALL.table(rows, of=of)


def _whole(value: float) -> int | None:
    return None if math.isnan(value) or not value else round(value)
