"""Rows of a ranking: under which name a run is ranked, drawn and asked about."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from coartic.learner.conditions import EVERY_CONDITION, METHOD_PREFIX, VARIANTS
from coartic.runs.contrasts import Place
from coartic.runs.plan import Job, label_of

LEARNER = "learner"
"""Name of the row of the paper's learner."""
ONE_ARM, TWO_ARMS = "EC1", "EC4"
"""Conditions of the learner that share a row: for tasks with one arm, and with two."""


def _learner_rows() -> dict[str, tuple[str, str]]:
    """Map the name of each row that two conditions share to the ids of their methods."""
    names = {"": LEARNER, "-informed": f"informed {LEARNER}"}
    names |= {f"-{name}": f"{LEARNER}, {words}" for name, (words, _) in VARIANTS.items()}
    return {
        name: (f"{METHOD_PREFIX}{ONE_ARM}{ending}", f"{METHOD_PREFIX}{TWO_ARMS}{ending}")
        for ending, name in names.items()
        if f"{ONE_ARM}{ending}" in EVERY_CONDITION
    }


LEARNER_ROWS = _learner_rows()
"""Maps the name of each row of the learner to its methods for one arm and for two."""


class Ranked(NamedTuple):
    """What decides the row of a run."""

    method: str
    setting: str
    task: str
    called: str = ""
    """Name that the block of the suite gives (``as``); empty for none."""


def row_names(runs: Sequence[Ranked]) -> list[str]:
    """Return the name of the row of each run.

    The name is the one that the suite gives; or else the id of the method with its setting. The
    learner's conditions for one arm and for two arms are one row if their settings are equal and
    no task has both.
    """
    names = {each: each.called or label_of(each.method, each.setting) for each in {*runs}}
    tasks = defaultdict[tuple[str, str], set[str]](set)
    for each in names:
        if not each.called:
            tasks[each.method, each.setting].add(each.task)
    for row, (one, two) in LEARNER_ROWS.items():
        for setting in {setting for method, setting in tasks if method in (one, two)}:
            if not tasks[one, setting] & tasks[two, setting]:
                names |= {
                    each: label_of(row, setting)
                    for each in names
                    if not each.called and each.method in (one, two) and each.setting == setting
                }
    return [names[each] for each in runs]


def places_of(plan: Iterable[Job]) -> list[Place]:
    """Return where the jobs of a plan are ranked, with one entry for each job."""
    jobs = [*plan]
    names = row_names(
        [
            Ranked(job.cell.method.name, job.cell.setting, job.cell.task.name, job.called)
            for job in jobs
        ]
    )
    return [
        Place(
            name,
            job.cell.label,
            job.cell.task.name,
            job.cell.task.family or "",
            job.cell.world,
            len(job.numbers),
            job.cell.method.stochastic,
            job.cell.trials,
            bool(job.cell.parameters.get("until")),
            job.cell.model.motor_noise > 0.0,
        )
        for name, job in zip(names, jobs, strict=True)
    ]
