"""Results folders of one suite, joined into one: strangers' results beside ours, or the parts of a
suite that several machines ran.

What is joined has the same tasks, readings, seed and trial budget, and a method has the same code
wherever it has runs. All else may differ: versions of coartic and of libraries, machines, and the
code of what only one folder has. The scorer is that of the code that joins: every stored solution
is executed again, and must come to what is stored of it.
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from coartic.benchmarks.provenance import command, current_environment, now
from coartic.benchmarks.reproduce import compare_runs
from coartic.benchmarks.scoring import score
from coartic.benchmarks.worker import Job, Outcome
from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.runs.card import MethodCard
from coartic.runs.plan import Cell, Plan, hash_of
from coartic.runs.run import PREFIXES, Run
from coartic.runs.store import Store, open_store, writing
from coartic.text import counted

_SCORED = (
    *(f"{prefix}{name}" for prefix in PREFIXES.values() for name in ("reward", "hands")),
    *("solution_corrections", "result"),
)
"""Columns of ``results`` that follow from the solutions of a run."""
_MOST_CONFLICTS = 5  # that are named


class Merged(NamedTuple):
    """What came of joining folders."""

    folder: Path
    runs: int
    """Of all folders, each once."""
    repeats: int
    """Runs that an earlier folder had already, with the same result."""


def merge(folders: Sequence[str | Path], out: str | Path) -> Merged:
    """Join results folders of one suite into a new one.

    Raises CoarticError where they do not go together, where a stored solution does not do what is
    stored of it, and where two folders have different results of one run; then nothing is written.
    """
    paths, out = [folder_named(folder) for folder in folders], folder_named(out, "--out")
    if len({path.resolve() for path in paths}) < max(len(paths), 2):
        raise CoarticError("name two results folders or more, each once")
    if os.path.lexists(out):
        raise CoarticError(f"the folder {out} is there already: choose another --out")
    with ExitStack() as stack:
        stores = [stack.enter_context(open_store(path)) for path in paths]
        plan = join({str(store.folder): store.plan() for store in stores})
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            made = stack.enter_context(tempfile.TemporaryDirectory(prefix=".", dir=out.parent))
        except OSError as error:
            raise CoarticError(f"cannot write {out}: {error.strerror}") from None
        with writing(Path(made) / "runs") as target:
            target.ask(plan, current_environment(), command(), now())
            repeats = sum(copy_runs(store, target) for store in stores)
            count = target.count()
        os.rename(Path(made) / "runs", out)
    return Merged(out, count, repeats)


def put_beside(plan: Plan, folder: Path, out: Path) -> Plan:
    """The plan with all that another folder holds, whose runs are copied into ``out``.

    Performed there, it is complete with the runs that the folder does not have. Raises
    CoarticError as :func:`merge` does, and where the folder lacks runs.
    """
    with open_store(folder) as source:
        theirs = complete_plan(source)
        whole = join({"the results that it is put beside": theirs, "this command": plan})
        with writing(out) as target:
            target.ask(whole, current_environment(), command(), now())
            copy_runs(source, target)
    return whole


def gather(first: Path, others: Sequence[Path], out: Path) -> dict[Path, str]:
    """Join with the first folder, whose tasks count, what goes with it; of each other folder, why
    it was left out, or nothing."""
    said = dict.fromkeys(others, "")
    with open_store(first) as ours, writing(out) as target:
        plans = {"the results that it is put beside": ours.plan()}
        target.ask(join(plans), current_environment(), command(), now())
        copy_runs(ours, target)
        for folder in others:
            try:
                with open_store(folder) as store:
                    more = {**plans, str(folder): complete_plan(store)}
                    if added := join(more).tasks.keys() - ours.plan().tasks:
                        raise CoarticError(f"the suite does not have task {min(added)!r}")
                    copy_runs(store, target)
                    plans = more
            except CoarticError as error:
                said[folder] = str(error)
        target.ask(join(plans), current_environment(), command(), now())
    return said


def complete_plan(store: Store) -> Plan:
    """What a folder was asked for. Raises CoarticError where it lacks runs of that."""
    plan = store.plan()
    if (lacking := plan.size - len(store.present())) > 0:
        raise CoarticError(f"{store.folder} lacks {counted(lacking, 'run')}: finish it first")
    return plan


def join(plans: Mapping[str, Plan]) -> Plan:
    """All cells of plans, by where they are from; the first are first.

    Raises CoarticError for what does not go together.
    """
    said: dict[str, tuple[str, object]] = {}

    def agree(where: str, what: str, value: object, hint: str = "") -> None:
        """What is said of a thing is the same wherever it is said."""
        origin, there = said.setdefault(what, (where, value))
        if there != value:
            raise CoarticError(f"{what} is {there} in {origin} and {value} in {where}{hint}")

    cells: dict[str, Cell] = {}
    for where, plan in plans.items():
        agree(where, "the suite", repr(plan.suite))
        agree(where, "the seed", plan.seed)
        agree(where, "the trial budget", plan.trial_budget)
        agree(where, "the list of readings", list(plan.readings))
        for cell, setting in zip(plan.cells, plan.settings, strict=True):
            name, method = cell.task.name, cell.method
            agree(where, f"task {name!r}", f"definition {hash_of(setting.definition)[:8]}")
            hint = ": leave it out of one of them, or give it another name"
            agree(where, f"method {method.name!r}", f"code {method.code}", hint)
            chosen = ", ".join(f"{key}={value}" for key, value in cell.complete.items())
            agree(where, f"{name} x {cell.label}", chosen)
            ours = cells.setdefault(setting.asked, cell)
            cells[setting.asked] = replace(ours, runs=max(ours.runs, cell.runs))
    # The card of a method that can be performed here says where its code is.
    cards = sorted((cell.method for plan in plans.values() for cell in plan.cells), key=is_here)
    methods = {card.name: card for card in cards}
    limits = [plan.time_limit_s for plan in plans.values()]
    return replace(
        next(iter(plans.values())),
        runs=max(plan.runs for plan in plans.values()),
        trials=max(plan.trials for plan in plans.values()),
        time_limit_s=None if None in limits else max(filter(None, limits)),
        cells=tuple(replace(cell, method=methods[cell.method.name]) for cell in cells.values()),
    )


def is_here(card: MethodCard) -> bool:
    """Whether the code of a method is here, not only its results."""
    return bool(card.where)


def copy_runs(source: Store, target: Store) -> int:
    """Copy the runs that a folder was asked for, each scored again; how many were there already.

    Raises CoarticError where one does not do what is stored of it, or is there with another result.
    """
    there, methods = set(target.ids("")), source.plan().methods
    repeats, conflicts = 0, []
    for _, cell in source.frame("runs").groupby(["task", "label"], sort=False):
        runs = [source.run(run_id) for run_id in cell.run_id]
        check_scores(source.folder, methods[cell.method.iloc[0]], runs, list(cell.result))
        for run in runs:
            if run.key.id in there:
                repeats += 1
                conflicts += differences(target.run(run.key.id), run)
        target.write(run for run in runs if run.key.id not in there)
    if conflicts:
        named = "; ".join(conflicts[:_MOST_CONFLICTS])
        raise CoarticError(
            f"{source.folder} has another result of {counted(len(conflicts), 'run')}: {named}"
        )
    return repeats


def check_scores(folder: Path, method: MethodCard, runs: Sequence[Run], stored: list[str]) -> None:
    """Score runs of one cell again, side by side.

    Raises CoarticError where one does not come to what is stored of it, or to the hash ``stored``
    of its result.
    """
    setting = runs[0].setting
    stated = [
        Outcome(
            run.status,  # type: ignore[arg-type]  # the table takes no other
            run.reason,
            {part: list(score.movements) for part, score in run.scores.items()},
            bound=run.bound,
            details=run.details,
            meter=run.meter,
            rewards=run.rewards,
        )
        for run in runs
    ]
    again = score(Job(setting, method, tuple(run.key for run in runs)), stated)
    for run, scored, result in zip(runs, again, stored, strict=True):
        before, after = run.to_row(), scored.to_row()
        wrong = [
            f"{name} is {after[name]}, not {before[name]}"
            for name in _SCORED
            if before[name] != after[name]
        ]
        if run.result != result:
            wrong.append("a joint or a trial was changed")
        if run.key != setting.key(run.key.suite_seed, run.key.number):
            wrong.append("it is not the run that its id says")
        if not math.isclose(run.other_arm_travel or 0, scored.other_arm_travel or 0, abs_tol=1e-9):
            wrong.append("the travel of the other arm is not as stored")
        if wrong:
            raise CoarticError(
                f"{folder}: run {run.key.id} does not do what is stored of it: {wrong[0]}"
            )


def differences(first: Run, second: Run) -> list[str]:
    """Two results of one run in words; nothing where they are the same."""
    if first.result == second.result or first.thin().result == second.thin().result:
        return []
    which = f"{first.setting.method} on {first.setting.task.name}, run {first.key.number}"
    return [f"{which} ({first.key.id}): {compare_runs(first, second)[0]}"]
