"""Which methods and tasks a figure shows, and what it says where the runs do not allow it."""

from __future__ import annotations

from collections.abc import Sequence

from coartic import CoarticError
from coartic.analysis.cells import CellRuns
from coartic.analysis.methods import main_methods
from coartic.analysis.study import Study
from coartic.text import did_you_mean

NO_CONTEXTS = "no method has solved runs on two tasks that share their first goals"


def chosen(study: Study, tasks: Sequence[str], methods: Sequence[str] | None) -> list[str]:
    """Labels that have a solved run on one of the tasks, of ``methods`` or of the main ones.

    Raises CoarticError where there is none of them, or one that the folder does not have.
    """
    solved_labels = dict.fromkeys(
        label for (task, label), cell in study.cells.items() if task in tasks and len(cell.good)
    )
    if methods is None:
        labels = main_methods(solved_labels)
    else:
        known_methods(study, methods)
        labels = [label for label in methods if label in solved_labels]
    if not labels:
        of = f" of {', '.join(methods)}" if methods else ""
        raise missing(study, f"no solved run{of} on {', '.join(tasks) or 'any task'}")
    return labels


def known_methods(study: Study, methods: Sequence[str]) -> None:
    """Raise CoarticError for a label, method with variant, that the folder does not have."""
    known = list(dict.fromkeys(label for _, label in study.cells))
    for label in methods:
        if label not in known:
            hint = did_you_mean(label, known) or f"; it has {', '.join(known)}"
            raise missing(study, f"no method {label!r}{hint}")


def has(study: Study, task: str, label: str) -> bool:
    """Whether a method has a solved run on a task."""
    cell = study.cells.get((task, label))
    return cell is not None and len(cell.good) > 0


def solved(study: Study, task: str, label: str) -> CellRuns:
    """A cell with at least one solved run; CoarticError where there is none."""
    if not has(study, task, label):
        raise missing(study, f"no solved run of {label} on {task}")
    return study.cells[task, label]


def missing(study: Study, what: str) -> CoarticError:
    """The error of a figure that the folder's runs do not allow."""
    return CoarticError(f"{study.folder}: {what}")
