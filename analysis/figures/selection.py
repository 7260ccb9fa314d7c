"""Which methods and tasks a figure shows."""

from __future__ import annotations

from collections.abc import Sequence

from coartic import CoarticError
from coartic.analysis.methods import KNOWN_METHODS
from coartic.analysis.results.folder import CellRuns
from coartic.analysis.study import Study
from coartic.text import did_you_mean

HEADLINES = tuple(name for name, row in KNOWN_METHODS.items() if row.headline)
"""Methods that stand for their families where none are named, in the order of figures."""

NO_CONTEXTS = "no method has solved runs on two tasks that share their first goals"


def chosen(study: Study, tasks: Sequence[str], methods: Sequence[str] | None) -> list[str]:
    """Labels of ``methods``, or of the default ones, that have a solved run on one of the tasks.

    By default those of :data:`HEADLINES`, then methods that are not the project's own; all where
    there is neither. Raises CoarticError where there is none of them, or one that the folder does
    not have.
    """
    known_methods(study, methods or ())
    families = {name.partition("/")[0] for name in KNOWN_METHODS}
    found = {
        label: cell.method.partition("/")[0] not in families
        for (task, label), cell in study.cells.items()
        if task in tasks and len(cell.good)
    }
    labels = [label for label in HEADLINES if label in found]
    labels = labels + [label for label, foreign in found.items() if foreign] or list(found)
    if methods is not None:
        labels = [label for label in methods if label in found]
    if not labels and methods is None:
        raise missing(study, f"no method has a solved run on {', '.join(tasks) or 'any task'}")
    if not labels:
        raise missing(study, f"no solved run of {', '.join(methods or ())} on {', '.join(tasks)}")
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
    return CoarticError(f"{study.results.folder}: {what}")
