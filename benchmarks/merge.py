"""Results folders of one suite, joined into one: strangers' results beside ours, or the parts of a
suite that several machines ran.

What is joined has the same tasks, readings, seed and trial budget, and a method has the same code
wherever it has runs. All else may differ: versions of coartic and of libraries, machines, and the
code of what only one folder has. The scorer is that of the code that joins: every stored solution
is executed again, and must come to what is stored of it.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from coartic.benchmarks.provenance import command, now
from coartic.benchmarks.reproduce import compare_runs
from coartic.benchmarks.scoring import score
from coartic.benchmarks.worker import Job, Outcome
from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.runs.plan import Cell, Plan, hash_of
from coartic.runs.run import PREFIXES, Run
from coartic.runs.store import RUNS_FILE, Store, explain_errors, open_store, writing
from coartic.text import brief_list, counted

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
        raise CoarticError(f"{out} is there already: choose another --out")
    with ExitStack() as stack:
        stores = [stack.enter_context(open_store(path)) for path in paths]
        plan = join({str(store.folder): store.plan() for store in stores})
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            made = stack.enter_context(tempfile.TemporaryDirectory(prefix=".", dir=out.parent))
        except OSError as error:
            raise CoarticError(f"cannot write {out}: {error.strerror}") from None
        with writing(Path(made) / "runs") as target:
            target.ask(plan, stores[0].made_with(), command(), now())
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
        theirs = source.plan()
        if (lacking := theirs.size - sum(1 for _ in source.present())) > 0:
            raise CoarticError(f"{folder} lacks {counted(lacking, 'run')}: finish it first")
        whole = join({str(folder): theirs, "this command": plan})
        whole = replace(whole, time_limit_s=plan.time_limit_s)
        with writing(out) as target:
            target.ask(whole, source.made_with(), command(), now())
            copy_runs(source, target)
    return whole


def join(plans: Mapping[str, Plan]) -> Plan:
    """All cells of plans, by where they are from; the first are first.

    Raises CoarticError for what does not go together.
    """

    def check(what: str, first: object, name: str, second: object) -> None:
        if first != second:
            raise CoarticError(f"{what}: {first} in {origin}, {second} in {name}")

    (origin, whole), *others = plans.items()
    for name, plan in others:
        for field in ("suite", "seed", "readings", "trial_budget"):
            check(field.replace("_", " "), getattr(whole, field), name, getattr(plan, field))
    return whole
