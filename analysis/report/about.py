"""Findings of a folder, and the limits of conclusions from its runs."""

from __future__ import annotations

import traceback
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

from coartic.analysis.sections import SECTIONS, Section
from coartic.analysis.study import Study, cached, one_by_one
from coartic.analysis.words import NO_BREAK, listed, marked
from coartic.errors import CoarticError
from coartic.internal.text import error_line, one_line
from coartic.learner.learning import TRIALS

Made = TypeVar("Made")
RUNS = 20
"""Number of runs of every experiment of the paper."""


def shown(text: str) -> str:
    """Return text as a printable line without breaks before per cent signs and daggers."""
    return one_line(text).replace(" %", f"{NO_BREAK}%").replace(" †", f"{NO_BREAK}†")


def visible_sections(study: Study) -> list[Section]:
    """Return the sections, without sections about single tasks if a folder has many tasks."""
    return [section for section in SECTIONS if one_by_one(study) or not section.single]


@cached
def failures(study: Study) -> dict[str, str]:
    """Return the errors of :func:`attempt` so far, in words, by the name of the failed part."""
    return {}


def attempt(study: Study, name: str, make: Callable[[Study], Made]) -> Made | None:
    """Make a part of a report, and return None if this raises an exception.

    :func:`failures` then has the error, with file and line, by the ``name`` of the part. A
    CoarticError, which is an error of the folder, is raised.
    """
    try:
        return make(study)
    except CoarticError:
        raise
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}, line {place.lineno}"
        failures(study).setdefault(name, f"{error_line(error)} ({where})")
        return None


@cached
def finding(study: Study, section: Section) -> list[str]:
    """Return the lines of a section's sentence; none without a finding."""
    text = attempt(study, section.short, section.sentence) if section.sentence else ""
    return [shown(line.strip()) for line in text.strip().split("\n")] if text else []


def answers(study: Study) -> list[tuple[Section, list[str]]]:
    """Return the sections with a short answer, and the lines of their findings."""
    answering = [section for section in visible_sections(study) if section.answer]
    return [(each, lines) for each in answering if (lines := finding(study, each))]


@cached
def limits(study: Study) -> dict[str, Any]:
    """Return facts that limit the conclusions from these runs, for the page."""
    runs, made_with = study.runs, study.made_with
    failed = runs[runs.status != "ok"]
    algorithm, kind = study.methods.algorithm, study.methods.kind
    learners = [cell for cell in study.cells.values() if algorithm[cell.label] == "learner"]
    trials = {int(n) for cell in learners for n in cell.runs.trials.dropna()}
    papers = [len(cell.runs) for cell in learners if kind[cell.label] == "learner"]
    fewest = min(papers, default=RUNS)
    tasks = list(one_by_one(study).values())
    optima = [(task, study.optima.get(task.name)) for task in tasks]
    reasons = Counter(map(str, failed.reason.fillna(""))).most_common(3)
    others = len(failed) - sum(count for _, count in reasons)
    return {
        "runs": len(runs),
        "failed": len(failed),
        "reasons": [f"{count} × {reason}" for reason, count in reasons]
        + [f"{others} for other reasons"] * bool(others),
        "reconstructed": [task.label for task in tasks if task.reconstructed],
        "trials": sorted(trials) if trials != {TRIALS} else [],
        "few": fewest if fewest < RUNS else 0,
        "seed": study.plan[0].seed,
        "unproven": [
            marked(task) for task, best in optima if best and not (best.proven or best.only_here)
        ],
        "own": [marked(task) for task, best in optima if best and best.only_here],
        "unknown": [marked(task) for task, best in optima if best is None],
        "side_by_side": bool(runs.together.max() > 1),
        "dirty": bool(runs.commit.dropna().astype(str).str.endswith("+").any()),
        "processor": made_with["processor"],
        "cores": made_with["cores"],
    }


def notes_of(study: Study, columns: Iterable[str]) -> list[str]:
    """Return the notes on a table with these columns."""
    unproven, own, columns = limits(study)["unproven"], limits(study)["own"], set(columns)
    notes = []
    if unproven and columns & {"gap", "optimum"}:
        notes.append(
            f"The optimum of {listed(unproven)} is not proven: it is the best known reward."
        )
    if own and "gap" in columns:
        notes.append(
            f"No optimum of {listed(own)} is known: gaps there are to the best of this folder."
        )
    return notes
