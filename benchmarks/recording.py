"""Runs that an outsider's program made on a problem, stored as those of a method are.

The program is not kept and cannot be repeated here; its solution is executed and scored.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from coartic.benchmarks.merge import join
from coartic.benchmarks.provenance import command, current_environment, now
from coartic.benchmarks.reader import METHOD_NAME
from coartic.benchmarks.registry import RESERVED, built_in
from coartic.benchmarks.scoring import score
from coartic.benchmarks.worker import Job, Outcome
from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.inputs import brief_value
from coartic.method import Session
from coartic.model import PAPER
from coartic.motion.solution import Movement
from coartic.runs.card import MethodCard
from coartic.runs.plan import Cell, Plan, hash_of, trials_in
from coartic.runs.store import writing
from coartic.tasks.task import LONGEST_NAME, NAME_PATTERN, Task

_CODE = 12  # digits of the hash that stands for the code of a method


def record_run(
    folder: str | Path,
    name: str,
    suite: str,
    *,
    task: Task,
    session: Session,
    seconds: float,
    solution: tuple[Movement, ...],
    parameters: Mapping[str, Any],
) -> int:
    """Store a run; see :meth:`coartic.Objective.record`. Returns its number."""
    card, out = card_named(name, session), folder_named(folder)
    if not re.fullmatch(NAME_PATTERN, str(suite)) or len(suite) > LONGEST_NAME:
        raise CoarticError(f"suite is {brief_value(suite)}; it must be a name such as 'problems'")
    if session.model != PAPER:
        raise CoarticError("runs are recorded under the constants of the paper, model=PAPER")
    complete = dict(sorted(parameters.items()))  # as they are stored
    new = Plan(suite, 0, 1, trials_in(complete), (), None, None, (Cell(task, card, {}, complete),))
    with writing(out) as store:
        plan = new
        if store.count():
            there = store.plan()
            others = [cell for cell in there.cells if (cell.task.name, cell.label) == label_in(new)]
            if any(cell.complete != complete for cell in others):
                raise CoarticError(
                    f"{out} has runs of {name!r} on {task.name!r} with other parameters: choose "
                    "another name or another folder"
                )
            more = replace(new.cells[0], runs=1 + sum(cell.runs for cell in others))
            plan = join({str(out): there, "this run": replace(new, runs=more.runs, cells=(more,))})
        position = next(p for p, s in enumerate(plan.settings) if s.asked == new.settings[0].asked)
        number = plan.cells[position].runs - 1
        outcome = Outcome(
            "ok",
            parts={"solution": list(solution)},
            used=tuple(sorted(item.value for item in session.used)),
            meter=replace(session.meter, solve_s=seconds),
            rewards=session.rewards,
        )
        setting, key = plan.settings[position], plan.key(position, number)
        runs = score(Job(setting, card, (key,)), [outcome])
        store.ask(plan, current_environment(), command(), now())
        store.write(runs)
    return number


def label_in(plan: Plan) -> tuple[str, str]:
    """Task and label of the only cell of a plan."""
    (cell,) = plan.cells
    return cell.task.name, cell.label


def card_named(name: str, session: Session) -> MethodCard:
    """The card of a method of which nothing but its name is known."""
    if not isinstance(name, str) or not METHOD_NAME.fullmatch(name):
        raise CoarticError(f"name is {brief_value(name)}; it must be one such as 'sep-cma'")
    if name.startswith(RESERVED) or name in built_in():
        raise CoarticError(f"{name!r} is the name of a method of this project: choose another")
    return MethodCard(
        name=name,
        title=name,
        citation="recorded with coartic.Objective.record",
        told=tuple(sorted(item.value for item in session.told)),
        secondary=(),
        stochastic=True,
        defaults={"hands": "all", "half_width": 1.0, "trials": None},
        origin="recorded",
        code=hash_of(["recorded", name])[:_CODE],
    )
