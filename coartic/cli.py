"""The command line. It sits on top of the four packages; nothing imports it."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated

import typer
from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table as RichTable

from coartic import CoarticError, __version__, builtin_tasks, load_task

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Comparative benchmark of coarticulation in motor skill acquisition.",
)
PLAIN_WIDTH = 170  # columns where the output is not a terminal


def main() -> None:
    """Run the command line; exit code 2 for what the user can put right."""
    try:
        app(prog_name="coartic")
    except CoarticError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"coartic {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    pass


def _names(text: str | None, option: str) -> list[str]:
    """A comma-separated list."""
    if text is None:
        return []
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise CoarticError(f"{option} {text!r} has an empty name; write for example a,b")
    return names


@app.command()
def run(
    suite: Annotated[str, typer.Argument(help="Suite to run; `coartic list` shows them.")],
    out: Annotated[Path, typer.Option(help="Folder for the results.")],
    runs: Annotated[int | None, typer.Option(min=1, help="Runs per cell.")] = None,
    trials: Annotated[int | None, typer.Option(min=1, help="Trials per run.")] = None,
    jobs: Annotated[int, typer.Option(min=-1, help="Threads; -1 for one per core.")] = -1,
    tasks: Annotated[str | None, typer.Option(help="Only these tasks, a,b.")] = None,
    methods: Annotated[str | None, typer.Option(help="Only these methods, x,y.")] = None,
    task_file: Annotated[
        list[Path] | None, typer.Option(help="A task of your own (TOML); may be repeated.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the whole suite.")] = 0,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace results already in the folder.")
    ] = False,
) -> None:
    """Run a suite, keep its records, and compare them with the published numbers."""
    from analysis.comparison import compare
    from analysis.results import load_results
    from benchmarks.provenance import environment
    from benchmarks.records import prepare_folder, write_results
    from benchmarks.runner import Plan, corrective_sequences, execute_plan
    from benchmarks.suites import load_suite, select_cells

    if jobs == 0:
        raise CoarticError("--jobs 0: give a number of threads, or -1 for one per core")
    chosen = load_suite(suite)
    cells = select_cells(
        chosen,
        tasks=_names(tasks, "--tasks"),
        methods=_names(methods, "--methods"),
        task_files=task_file or [],
    )
    plan = Plan(suite, tuple(cells), runs or chosen.runs, trials or chosen.trials, seed)
    prepare_folder(out, overwrite=overwrite)
    started = environment()
    clock = time.perf_counter()
    sequences = corrective_sequences(plan.tasks)
    records = []
    total = len(plan.cells) * plan.runs
    progress = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=Console(stderr=True),
    )
    try:
        with progress:
            bar = progress.add_task(suite, total=total)
            for record in execute_plan(plan, jobs=jobs):
                records.append(record)
                row = record.row
                progress.update(bar, advance=1, description=f"{row['task']} {row['method']}")
            progress.update(bar, description=suite)
    except KeyboardInterrupt:
        print(
            f"interrupted after {len(records)} of {total} runs; nothing written", file=sys.stderr
        )
        sys.exit(130)
    manifest = {
        "specification": plan.specification(),
        "environment": started,
        "jobs": jobs,
        "wall_s": time.perf_counter() - clock,
    }
    write_results(out, records, sequences, manifest)
    comparison = compare(load_results(out))
    (out / "comparison.md").write_text(comparison.to_markdown(), encoding="utf-8")

    console = Console()
    if not console.is_terminal:
        console = Console(width=PLAIN_WIDTH)
    for table in comparison.tables:
        _print(console, table.title, table.columns, table.rows)
    for note in comparison.notes:
        console.print(f"- {note}", markup=False, highlight=False)
    failed = sum(record.row["status"] != "ok" for record in records)
    print(
        f"\n{total} runs in {manifest['wall_s']:.1f} s, {failed} failed. "
        f"Results in {out}, this comparison in {out / 'comparison.md'}."
    )
    if any(record.row["status"] == "crashed" for record in records):
        sys.exit(1)


@app.command(name="list")
def list_() -> None:
    """List tasks, methods and suites."""
    from benchmarks.methods import METHODS
    from benchmarks.suites import suites

    console = Console() if sys.stdout.isatty() else Console(width=PLAIN_WIDTH)
    known = [load_task(name) for name in builtin_tasks()]
    _print(
        console,
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
    explored = {"none": "none", "closest": "closest hand, ε", "random": "any hand (DASel), ε"}
    _print(
        console,
        "Methods",
        ("method", "hands", "AModChosen", "AModOther", "hand exploration", "tasks"),
        [
            (
                name,
                " ".join(condition.hands),
                "yes" if condition.modify_chosen else "no",
                "yes" if condition.modify_other else "no",
                explored[condition.hand_exploration],
                ", ".join(task.name for task in known if condition.why_not(task) is None),
            )
            for name, condition in METHODS.items()
        ],
    )
    _print(
        console,
        "Suites",
        ("suite", "cells", "runs", "trials", "what it is"),
        [
            (
                name,
                str(sum(len(entry.methods) for entry in suite.cells)),
                str(suite.runs),
                str(suite.trials),
                suite.description,
            )
            for name, suite in suites().items()
        ],
    )


@app.command()
def draw(
    out: Annotated[Path, typer.Option(help="Picture to write: .png, .svg or .pdf.")],
    tasks: Annotated[str | None, typer.Option(help="Tasks to draw, a,b; all by default.")] = None,
    task_file: Annotated[
        list[Path] | None, typer.Option(help="A task of your own (TOML); may be repeated.")
    ] = None,
) -> None:
    """Draw start configuration and goals of tasks."""
    from analysis.drawing import FORMATS, draw_tasks

    if out.suffix not in FORMATS:
        raise CoarticError(f"--out {out}: the name must end in {', '.join(FORMATS)}")
    names = _names(tasks, "--tasks")
    if not names and not task_file:
        names = list(builtin_tasks())
    chosen = [load_task(name) for name in names] + [load_task(path) for path in task_file or []]
    try:
        draw_tasks(chosen, out)
    except OSError as error:
        raise CoarticError(f"cannot write {out}: {error.strerror or error}") from None
    print(f"{', '.join(task.name for task in chosen)} drawn in {out}.")


def _print(
    console: Console,
    title: str,
    columns: tuple[str, ...],
    rows: list[tuple[str, ...]] | tuple[tuple[str, ...], ...],
) -> None:
    table = RichTable(title=title, title_justify="left", box=box.SIMPLE_HEAD, highlight=False)
    for column in columns:
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(*row)
    console.print(table, markup=False)
