"""Include runs of other folders: the shipped ones, another machine's, another person's.

They go together where suite, seed, trial budget, the tasks of a name and the code of a method are
the same. Versions of coartic and of libraries and machines may differ. Every solution of another
folder is executed and scored again; that of the shipped ones is checked by the hash of their file.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from coartic.benchmarks.provenance import command, current_environment, now
from coartic.benchmarks.reproduce import compare_runs
from coartic.benchmarks.scoring import score
from coartic.benchmarks.shipped import SHIPPED, open_shipped
from coartic.benchmarks.worker import Job, Outcome
from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.internal.text import counted
from coartic.runs.method_info import MethodInfo
from coartic.runs.plan import Cell, Plan, hash_of
from coartic.runs.run import PREFIXES, Run
from coartic.runs.store import Store, open_store, writing

_SCORED = (
    *(f"{prefix}{name}" for prefix in PREFIXES.values() for name in ("reward", "hands")),
    "solution_corrections",
)
"""Columns of ``results`` that follow from the solutions of a run."""


def include_folders(plan: Plan, folders: Sequence[str | Path], out: Path) -> Plan:
    """Return the plan with the runs that other folders hold, which are copied into ``out``.

    ``shipped`` names the shipped results. Performed in ``out``, the plan makes those of its own
    runs that no folder has, and no others: of what it does not ask for, a folder gives what it has.
    A warning names a folder that is not finished, and one that has fewer runs than are asked for.

    Raises CoarticError where the folders do not go together, where a stored solution does not do
    what is stored of it, and where two folders have different results of a run. Then nothing is
    copied but shipped results.
    """
    with ExitStack() as stack:
        sources: dict[str, Store] = {}
        for name in map(str, folders):
            if name == SHIPPED:
                sources[name] = stack.enter_context(open_shipped(plan.suite))
                continue
            if folder_named(name).resolve() == out.resolve():
                raise CoarticError(f"{name} cannot include itself: choose another --out")
            if not folder_named(name).exists():
                message = f"no folder {name!r}; {SHIPPED!r} stands for the shipped results"
                raise CoarticError(message)
            sources[name] = stack.enter_context(open_store(folder_named(name)))
        whole = join(plan, sources)
        target = stack.enter_context(writing(out))
        begun = SHIPPED in sources and target.begin_as(sources[SHIPPED])
        with target.transaction():
            target.replace_plan(whole, current_environment(), command(), now())
            origin = dict.fromkeys(target.ids(), str(out))
            for name, source in sources.items():
                if not (begun and name == SHIPPED):  # whose runs are all here
                    copy_runs(name, source, target, origin)
    return whole


def join(plan: Plan, sources: Mapping[str, Store]) -> Plan:
    """Return the plan with the cells of the sources, each with the runs that the plan asks for and
    those that follow in the sources without a gap. Raises CoarticError where sources contradict
    each other, or the plan where it asks for runs that no source has."""
    plans = {name: source.plan() for name, source in sources.items()}
    held = {
        (plans[name].specifications[position].asked, number)
        for name, source in sources.items()
        for position, number, *_ in source.present()
    }
    own = dict(cells_of(plan))
    # What a source has is not performed here, where the code of its method may be another.
    missing = [
        cell
        for asked, cell in own.items()
        if not held.issuperset((asked, n) for n in range(cell.runs))
    ]
    parts = plans | {"this command": replace(plan, cells=tuple(missing))}
    check_together(parts)
    methods = {name: method for part in parts.values() for name, method in part.methods.items()}
    cells: dict[str, Cell] = {}
    for asked, cell in (pair for part in (plan, *plans.values()) for pair in cells_of(part)):
        runs = own[asked].runs if asked in own else 0
        while (asked, runs) in held:
            runs += 1
        if runs:
            cells.setdefault(asked, replace(cell, method=methods[cell.method.name], runs=runs))
    for name, part in plans.items():
        lacking, few = list[Cell](), list[Cell]()
        for asked, cell in cells_of(part):
            there = cells[asked].runs if asked in cells else 0
            if there < cell.runs:
                lacking.append(cell)
            elif asked not in own and cell.method.stochastic and there < plan.runs:
                few.append(cell)
        if lacking:
            words = f"{name} is not finished: it lacks runs of {named(lacking)}"
            warnings.warn(
                f"{words}, and gives those before the first that is missing", stacklevel=3
            )
        if few:
            words = f"{counted(few[0].runs, 'run')} of {named(few)}; {plan.runs} are asked for here"
            warnings.warn(f"{name} has {words}", stacklevel=3)
    return replace(
        plan,
        runs=max(plan.runs, *(cell.runs for cell in cells.values())),
        trials=max(part.trials for part in parts.values()),
        cells=tuple(cells.values()),
    )


def cells_of(plan: Plan) -> Iterator[tuple[str, Cell]]:
    """The cells of a plan, each after the hash of its specification without the code."""
    return zip(
        (specification.asked for specification in plan.specifications), plan.cells, strict=True
    )


def named(cells: Sequence[Cell]) -> str:
    """Name the first of some cells, and count the others."""
    others = f" and of {counted(len(cells) - 1, 'other')}" if len(cells) > 1 else ""
    return f"{cells[0].label} on {cells[0].task.name}{others}"


def check_together(plans: Mapping[str, Plan]) -> None:
    """Raises CoarticError where plans, by where they are from, say different things of one."""
    first_said: dict[str, tuple[str, object]] = {}

    def agree(where: str, what: str, value: object, hint: str = "") -> None:
        origin, there = first_said.setdefault(what, (where, value))
        if there != value:
            raise CoarticError(f"{what} is {there} in {origin} and {value} in {where}{hint}")

    for where, plan in plans.items():
        agree(where, "the suite", repr(plan.suite))
        agree(where, "the seed", plan.seed)
        agree(where, "the trial budget", plan.trial_budget)
        for cell, specification in zip(plan.cells, plan.specifications, strict=True):
            name, method = cell.task.name, cell.method
            agree(where, f"task {name!r}", f"definition {hash_of(specification.definition)[:8]}")
            hint = ": leave it out of one of them, or give it another name"
            agree(where, f"method {method.name!r}", f"code {method.code}", hint)
            cell_named = f"{cell.label} on {name}"
            agree(where, f"the list of parameters of {cell_named}", sorted(cell.complete))
            for key, value in cell.complete.items():
                agree(where, f"{key} of {cell_named}", value)


def copy_runs(name: str, source: Store, target: Store, origin: dict[str, str]) -> None:
    """Copy the runs that a source was asked for and the target lacks, each scored again; ``origin``
    says where those are from that the target has. Raises CoarticError where a run does not do what
    is stored of it, or the target has another result of it."""
    methods, there = source.plan().methods, target.runs().set_index("run_id").result.to_dict()
    for _, cell in source.runs().groupby(["task", "method", "setting"], sort=False):
        results = dict(zip(cell.run_id, cell.result, strict=True))
        for run_id in results.keys() & there.keys():
            if results[run_id] == there[run_id]:
                continue
            run = source.run(run_id)
            if changes := compare_runs(target.run(run_id), run):  # beyond trials not kept
                which = f"run {run.number} of {cell.method.iloc[0]} on {cell.task.iloc[0]}"
                where = f"{origin[run_id]} and {name} ({run_id})"
                raise CoarticError(f"{which} differs in {where}: {changes[0]}")
        runs = [source.run(run_id) for run_id in results if run_id not in there]
        if runs and name != SHIPPED:  # whose file is checked by its hash
            check_scores(name, methods[cell.method.iloc[0]], runs, results)
        target.write(runs)
        origin |= {run.id: name for run in runs}


def check_scores(
    name: str, method: MethodInfo, runs: Sequence[Run], results: Mapping[str, str]
) -> None:
    """Score runs of one cell again, side by side.

    Raises CoarticError where one does not come to what is stored of it, or to the hash of its
    result, which ``results`` has by id.
    """
    specification = runs[0].specification
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
    again = score(
        Job(specification, method, runs[0].suite_seed, tuple(run.number for run in runs)), stated
    )
    for run, scored in zip(runs, again, strict=True):
        before, after = run.to_row(), scored.to_row()
        wrong = [
            f"{column} is {after[column]}, not {before[column]}"
            for column in _SCORED
            if before[column] != after[column]
        ]
        if {run.result, scored.result} != {results[run.id]}:
            wrong.append("a joint, a tick or a trial was changed")
        if not math.isclose(run.other_arm_travel or 0, scored.other_arm_travel or 0, abs_tol=1e-9):
            wrong.append("the travel of the other arm is not as stored")
        if wrong:
            raise CoarticError(f"{name}: run {run.id} does not do what is stored of it: {wrong[0]}")
