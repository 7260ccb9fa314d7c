"""Commands that run suites and single runs, and show what there is to run."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from coartic.cli import arguments as given
from coartic.cli.arguments import check_numbers, names_in
from coartic.cli.terminal import Display, performing, say, show_data, show_lines, show_table
from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.text import counted, json_text

if TYPE_CHECKING:
    from coartic import Task
    from coartic.analysis.report.document import Document
    from coartic.benchmarks.conformance import Law
    from coartic.benchmarks.executors import Executor
    from coartic.benchmarks.registry import Entry, Registry
    from coartic.benchmarks.run import RunReport

GROUP = "Run"


def run(
    suite: given.SuiteName,
    folder: given.Out,
    runs: given.Runs = None,
    trials: given.Trials = None,
    jobs: given.Jobs = -1,
    tasks: given.Tasks = None,
    methods: given.Methods = None,
    task_file: given.TaskFiles = None,
    method_file: given.MethodFiles = None,
    seed: given.Seed = 0,
    time_limit: given.TimeLimit = None,
    trial_budget: given.TrialBudget = None,
    reading: given.Readings = None,
    scheduler: given.Scheduler = None,
    retry_failed: given.RetryFailed = False,
    redo: given.Redo = False,
) -> None:
    """Run what a suite's folder lacks, then make its tables and the comparison.

    Interrupted by whatever, the same command goes on where it stopped.
    """
    from coartic.benchmarks.run import Selection, plan_suite
    from coartic.benchmarks.specification import Limits
    from coartic.benchmarks.suites import load_suite

    check_numbers(jobs, time_limit)
    chosen, out = load_suite(suite), folder_named(folder, "--out")
    wanted = names_in(tasks, "--tasks"), names_in(methods, "--methods")
    select = Selection(*wanted, task_file or (), method_file or ())
    limits = Limits(time_limit or chosen.time_limit_s, trial_budget)
    planned = partial(plan_suite, runs=runs, trials=trials, seed=seed, readings=reading or ())
    plan = planned(chosen, select=select, limits=limits)
    perform = partial(plan.perform, out, retry_failed=retry_failed, redo=redo)
    with performing(chosen.name, out) as display:
        comparison, executor = _Comparison(display), _executor(jobs, scheduler, display)
        report = perform(executor=executor, watch=display.update, pages=comparison.pages)
    comparison.show(report)
    if report.crashed:
        sys.exit(1)


def _executor(jobs: int, scheduler: str | None, display: Display) -> Executor:
    from coartic.benchmarks.cluster import Dask
    from coartic.benchmarks.executors import Local

    return Local(jobs) if scheduler is None else Dask(scheduler, say=display.line)


class _Comparison:
    """The comparison of a folder that was just made: its pages, then on the terminal."""

    def __init__(self, display: Display) -> None:
        self._display = display
        self._made: Document | None = None

    def pages(self, folder: Path) -> dict[str, bytes]:
        """What is written beside the tables."""
        self._display.end_runs()
        from coartic.analysis import Study
        from coartic.analysis.report.comparison import comparison_document
        from coartic.analysis.report.formats.markdown import markdown
        from coartic.analysis.report.tables.files import METHOD_ROWS
        from coartic.analysis.results.folder import made_here

        study = Study(made_here(folder))
        self._made = comparison_document(study)
        return {
            "comparison.md": markdown(self._made, tables="").encode(),
            METHOD_ROWS.name: METHOD_ROWS.text(study).encode(),
        }

    def show(self, report: RunReport) -> None:
        """Print what fits the terminal, where something was made anew; and what it came to."""
        page = report.folder / "comparison.md"
        if self._made is not None:
            from coartic.analysis.report.comparison import notes_of

            show_data(self._made.tables(), f"see {page}")
            show_lines(f"- {note}" for note in notes_of(self._made))
        say("", f"{report}, this comparison in {page}.")


def list_(method_file: given.MethodFiles = None) -> None:
    """List tasks, methods and suites."""
    from coartic import builtin_tasks, load_task
    from coartic.benchmarks.registry import registry
    from coartic.benchmarks.suites import suites

    known = [load_task(name) for name in builtin_tasks()]
    show_table(
        "Tasks",
        ("task", "goals", "hands", "what it is", "reconstructed"),
        [
            (
                task.name,
                str(len(task.goals)),
                " ".join(task.hands),
                task.description,
                ", ".join(task.reconstructed) or "–",
            )
            for task in known
        ],
    )
    show_table(
        "Methods",
        ("method", "what it is", "told", "parameters", "tasks"),
        [_method_row(entry, known) for entry in registry(method_file or []).values()],
    )
    show_table(
        "Suites",
        ("suite", "runs", "trials", "what it is"),
        [
            (name, str(suite.runs), str(suite.trials or "–"), suite.description)
            for name, suite in suites().items()
        ],
    )


def _method_row(entry: Entry, known: list[Task]) -> tuple[str, ...]:
    from coartic.readings import readings

    declared = entry.declared
    read = {each.field for each in readings()}  # `coartic readings` has these
    try:
        tasks = ", ".join(task.name for task in known if entry.why_not(task) is None)
    except CoarticError as error:
        tasks = f"unknown: {error}"
    return (
        declared.name,
        declared.title + ("" if entry.foreign is None else f" ({entry.origin})"),
        ", ".join(sorted(declared.told)),
        ", ".join(f"{k}={v}" for k, v in declared.defaults.items() if k not in read) or "–",
        tasks,
    )


def show(run_id: given.RunId, folder: given.Records = Path("results")) -> None:
    """Show everything about one run, with the command that reproduces it."""
    from coartic.benchmarks.reproduce import command_for, find_record

    store, record = find_record(run_id, folder)
    shown = record.model_dump(mode="json")
    trials = counted(len(record.rewards), "trial")
    shown["rewards"] = f"{trials}, in learning.parquet and in the record"
    shown["record"] = str(store.path(record.run_id))
    say(*json_text(shown, indent=2).split("\n"))
    say("", f"Reproduce it with: {command_for(record, store.folder)}")


def reproduce(
    run_id: given.RunId,
    folder: given.Records = Path("results"),
    method_file: given.MethodFiles = None,
) -> None:
    """Perform one run again and say whether the result is identical."""
    from coartic.benchmarks.registry import registry
    from coartic.benchmarks.reproduce import differences, find_record, perform_once, spec_of
    from coartic.benchmarks.specification import Limits

    _, record = find_record(run_id, folder)
    limits = Limits(record.timing.time_limit_s, None)
    spec = spec_of(record, registry(method_file or []), limits)
    again = perform_once(spec)
    found = differences(record, again)
    label = f"{record.run_id} ({spec.method} on {spec.task.name}, run {spec.run})"
    if record.code != again.code:
        say(f"The record was made by code {record.code}; here is {again.code}.")
    if not found:
        say(f"{label}: identical.")
        return
    say(f"{label}: different.", *(f"- {difference}" for difference in found))
    sys.exit(1)


def check(
    subject: given.Subject,
    method_file: given.MethodFiles = None,
) -> None:
    """Check a method or a task file against the laws of the benchmark."""
    from coartic.benchmarks.registry import registry

    broken = 0
    for number, (name, checked) in enumerate(_checks(subject, registry(method_file or []))):
        laws = checked()
        if number:
            say("")
        for law in laws:
            say(f"{'pass' if law.passed else 'FAIL'}  {law.name}: {law.finding}")
        hold = sum(law.passed for law in laws)
        say("", f"{name}: {hold} of {counted(len(laws), 'law')} hold.")
        broken += len(laws) - hold
    if broken:
        sys.exit(1)


def _checks(subject: str, known: Registry) -> list[tuple[str, Callable[[], list[Law]]]]:
    """What is checked: a task, or all methods that a name stands for."""
    from coartic.benchmarks.conformance import check_method, check_task_file
    from coartic.benchmarks.suites import methods_named

    if subject.endswith(".toml"):
        if not Path(subject).is_file():
            raise CoarticError(f"{subject}: there is no such file")
        return [(subject, partial(check_task_file, Path(subject), known))]
    try:
        names = methods_named(subject, known)
    except CoarticError as error:
        raise CoarticError(f"{error} A task is checked by its file.") from None
    return [(name, partial(check_method, known[name])) for name in names]


COMMANDS = (run, list_, show, reproduce, check)
