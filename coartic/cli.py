"""The command line. It sits on top of the four packages; nothing imports it."""

from __future__ import annotations

import csv
import importlib.util
import io
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer
from rich import box
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TaskID, TextColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress
from rich.table import Table as RichTable

from coartic import CoarticError, __version__, builtin_tasks, load_task
from coartic.compiled import PACKAGE
from coartic.inputs import MOST_RUNS, MOST_SECONDS, MOST_SEED, MOST_TRIALS
from coartic.text import json_text, one_line

if TYPE_CHECKING:
    from benchmarks.harness import Progress
    from benchmarks.registry import Entry
    from benchmarks.specification import RunSpec
    from coartic import Task

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Comparative benchmark of coarticulation in motor skill acquisition.",
)
PLAIN_WIDTH = 200  # columns where the output is not a terminal


def main() -> None:
    """Run the command line; exit code 2 for what the user can put right."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal that lacks ± gets a ?
            stream.reconfigure(errors="replace")
    warnings.showwarning = lambda message, *_, **__: _complain("warning", str(message))
    os.environ["MPLBACKEND"] = "agg"  # no window is opened, whatever is set
    # Ctrl-C ends the process; where something is to be saved before, it is caught there. As an
    # exception, in the middle of an import, it can get lost.
    interrupted = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        _check_arguments()
        _check_packages()
        app(prog_name="coartic")
    except CoarticError as error:
        _complain("error", str(error))
        sys.exit(2)
    except BrokenPipeError:
        raise
    except OSError as error:
        _complain("error", str(error.strerror or error))
        sys.exit(1)
    finally:
        signal.signal(signal.SIGINT, interrupted)


@contextmanager
def _interruptible() -> Iterator[Callable[[], None]]:
    """Within it Ctrl-C is a KeyboardInterrupt; if that gets lost, the next call raises it again.

    An exception that a signal raises in a destructor or a callback is printed and dropped.
    """
    asked = False

    def interrupt(*_: object) -> None:
        nonlocal asked
        asked = True
        raise KeyboardInterrupt

    def again() -> None:
        if asked:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield again
    finally:
        signal.signal(signal.SIGINT, before)


def _check_arguments() -> None:
    """They are kept in records, as text."""
    for argument in sys.argv[1:]:
        if any("\ud800" <= c <= "\udfff" for c in argument):
            raise CoarticError(f"argument {argument!r} is not text in this system's encoding")


def _complain(kind: str, text: str) -> None:
    _say(*(f"{kind}: {line}" for line in text.splitlines()), stream=sys.stderr)


def _say(*lines: str, stream: TextIO | None = None) -> None:
    """Print lines; whatever names are in them, each is one, and prints.

    Text comes to a terminal here, in :func:`_print` and in :class:`_Display`.
    """
    print("\n".join(map(one_line, lines)), file=stream)


def _check_packages() -> None:
    """Other modules of these names, in the current folder say, would be taken for ours."""
    for name in ("analysis", "baselines", "benchmarks"):
        found = importlib.util.find_spec(name)
        origin = Path(found.origin) if found is not None and found.origin else None
        if origin is None or origin.parent.parent != PACKAGE.parent:
            raise CoarticError(
                f"module {name!r} is taken from {origin or 'nowhere'} instead of coartic's "
                f"installation in {PACKAGE.parent}; run the command from another folder"
            )


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


def _labels(text: str, option: str) -> list[str]:
    """A comma-separated list of labels, in double quotes where they have commas themselves."""
    labels = [label.strip() for label in next(csv.reader([text], skipinitialspace=True), [])]
    if not labels or not all(labels):
        raise CoarticError(f"{option} {text!r} has an empty name; write for example a,b")
    return list(dict.fromkeys(labels))


MethodFiles = Annotated[
    list[Path] | None,
    typer.Option("--method-file", readable=False, help="Methods of your own (Python)."),
]
Records = Annotated[Path, typer.Option("--in", help="Folder to look for the run in.")]
Replace = Annotated[bool, typer.Option("--replace", help="Write over a file that is there.")]


@app.command()
def run(
    suite: Annotated[str, typer.Argument(help="Suite to run (`coartic list`), or a TOML file.")],
    folder: Annotated[str, typer.Option("--out", help="Folder for the results.")],
    runs: Annotated[int | None, typer.Option(min=1, max=MOST_RUNS, help="Runs per cell.")] = None,
    trials: Annotated[
        int | None, typer.Option(min=1, max=MOST_TRIALS, help="Trials per run.")
    ] = None,
    jobs: Annotated[
        int, typer.Option(min=-1, max=1024, help="Processes; -1 for one per core.")
    ] = -1,
    tasks: Annotated[str | None, typer.Option(help="Only these tasks, a,b.")] = None,
    methods: Annotated[str | None, typer.Option(help="Only these methods, x,y.")] = None,
    task_file: Annotated[
        list[Path] | None,
        typer.Option(readable=False, help="A task of your own (TOML); may be repeated."),
    ] = None,
    method_file: MethodFiles = None,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of the whole suite.")] = 0,
    time_limit: Annotated[
        float | None, typer.Option(help="Seconds per run; the suite's limit by default.")
    ] = None,
    trial_budget: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_TRIALS, help="Most physical trials a run may make."),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Dask scheduler, tcp:// or tls://host:port, instead of this machine."),
    ] = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Perform timeouts and crashes again.")
    ] = False,
    redo: Annotated[
        bool, typer.Option("--redo", help="Perform every run again, also those already there.")
    ] = False,
) -> None:
    """Run what a suite's folder lacks, then make its tables and the comparison.

    Interrupted by whatever, the same command goes on where it stopped.
    """
    from analysis.comparisons.methods import methods_frame
    from analysis.comparisons.paper import compare
    from analysis.markup import words
    from analysis.results.folder import load_results
    from benchmarks.cluster import Dask
    from benchmarks.executors import Local
    from benchmarks.harness import perform_plan
    from benchmarks.registry import registry
    from benchmarks.specification import Limits
    from benchmarks.store import Store
    from benchmarks.suites import load_suite, manifest_of, run_specs, select_cells
    from benchmarks.tables import OWNER, check_results_folder, write_tables
    from coartic.files import publish

    if jobs == 0:
        raise CoarticError("--jobs 0: give a number of processes, or -1 for one per core")
    if time_limit is not None and not 0 < time_limit <= MOST_SECONDS:
        raise CoarticError(
            f"--time-limit {time_limit:g}: give a number of seconds above 0, "
            f"at most {MOST_SECONDS:_}"
        )
    if not folder.strip():
        raise CoarticError("--out is empty; name a folder for the results")
    out = Path(folder)
    chosen = load_suite(suite)
    cells = select_cells(
        chosen,
        registry(method_file or []),
        tasks=_names(tasks, "--tasks"),
        methods=_names(methods, "--methods"),
        task_files=task_file or [],
    )
    limits = Limits(time_limit or chosen.time_limit_s, trial_budget)
    runs = runs or chosen.runs
    planned = run_specs(cells, runs=runs, seed=seed, trials=trials or chosen.trials, limits=limits)
    manifest, clock = manifest_of(chosen, runs, seed, planned, limits), time.perf_counter()
    check_results_folder(out)
    store = Store(out)
    with store.locked(), _Display(chosen.name) as display:

        def watch(progress: Progress, spec: RunSpec | None) -> None:
            display.update(progress, spec)
            interrupted()

        try:
            with _interruptible() as interrupted:
                progress = perform_plan(
                    [spec for _, spec in planned],
                    store,
                    Local(jobs) if scheduler is None else Dask(scheduler, say=display.line),
                    retry_failed=retry_failed,
                    redo=redo,
                    watch=watch,
                )
        except KeyboardInterrupt:
            display.close()
            _say(
                f"interrupted; {display.done} runs done now are kept in {out}, "
                "and the same command goes on from there",
                stream=sys.stderr,
            )
            sys.exit(130)
        wall = time.perf_counter() - clock
        records = write_tables(store, manifest)
        results = load_results(out)
        comparison = compare(results)
        pages = {
            "comparison.md": comparison.to_markdown(),
            "methods.csv": methods_frame(results).to_csv(index=False),
        }
        publish(
            out,
            {name: text.encode() for name, text in pages.items()},
            owner=OWNER,
            alone=False,
        )

    console = _console()
    hidden = sum(
        _print(console, table.title, table.columns, table.rows, wrap=False)
        for table in comparison.tables
    )
    if hidden:
        console.print("(The terminal is too narrow for all columns; comparison.md has them.)\n")
    for note in comparison.notes:
        console.print(one_line(f"- {words(note)}"))
    _say(
        "",
        f"{progress.total} runs: {progress.present} were there, {progress.done} done in "
        f"{wall:.1f} s; {progress.failed} failed. "
        f"Results in {out}, this comparison in {out / 'comparison.md'}.",
    )
    if any(record.status == "crashed" for record in records.values()):
        sys.exit(1)


@app.command(name="list")
def list_(method_file: MethodFiles = None) -> None:
    """List tasks, methods and suites."""
    from benchmarks.registry import registry
    from benchmarks.suites import suites

    console = _console()
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
    methods = registry(method_file or [])
    _print(
        console,
        "Methods",
        ("method", "what it is", "told", "parameters", "tasks"),
        [
            (
                name,
                entry.declared.title + ("" if entry.foreign is None else f" ({entry.origin})"),
                ", ".join(sorted(entry.declared.told)),
                ", ".join(f"{key}={value}" for key, value in entry.declared.defaults.items())
                or "–",
                _applicable(entry, known),
            )
            for name, entry in methods.items()
        ],
    )
    _print(
        console,
        "Suites",
        ("suite", "runs", "trials", "what it is"),
        [
            (name, str(suite.runs), str(suite.trials or "–"), suite.description)
            for name, suite in suites().items()
        ],
    )


def _applicable(entry: Entry, tasks: list[Task]) -> str:
    """Tasks a method applies to with its default parameters, or why that is unknown."""
    try:
        return ", ".join(task.name for task in tasks if entry.why_not(task) is None)
    except CoarticError as error:
        return f"unknown: {error}"


@app.command()
def analyse(
    folder: Annotated[Path, typer.Argument(help="Results folder, such as results/all.")],
) -> None:
    """Signatures, claims, methods compared, and the reward-compute frontier of a folder."""
    from analysis.claims import claims_page
    from analysis.comparisons.frontier_page import frontier_page
    from analysis.comparisons.pairs_page import comparisons_page
    from analysis.report.formats.markdown import markdown
    from analysis.report.pages.signatures import signatures_document
    from analysis.study import load
    from coartic.files import publish

    study = load(folder)
    results = study.results
    pages = {
        "claims.md": claims_page(results, study.judged),
        "comparisons.md": comparisons_page(study, study.pairs, study.overall, study.scores),
        "frontier.md": frontier_page(results, study.targets, study.areas, study.pareto),
        "signatures.md": markdown(signatures_document(study), tables=""),
    }
    frames = {
        "claims.csv": study.claims,
        "comparisons.csv": study.pairs,
        "across_tasks.csv": study.overall,
        "profiles.csv": study.profiles,
        "signatures.csv": study.signatures.drop(columns="label"),
        "anytime.csv": study.anytime,
        "targets.csv": study.targets,
        "areas.csv": study.areas,
        "pareto.csv": study.pareto,
    }
    pages |= {name: frame.to_csv(index=False) for name, frame in frames.items()}
    files = {name: text.encode() for name, text in pages.items()}
    publish(folder, files, owner="analyse", alone=False)
    _print(
        _console(),
        "Claims",
        ("claim", "verdict", "statement"),
        [
            (entry.claim.id, entry.verdict + " †" * entry.claim.fitted, entry.claim.statement)
            for entry in study.judged
        ],
    )
    _say(f"In {folder}: {', '.join(pages)}.")


@app.command()
def show(
    run_id: Annotated[str, typer.Argument(help="Id of a run, or its beginning.")],
    folder: Records = Path("results"),
) -> None:
    """Show everything about one run, with the command that reproduces it."""
    from benchmarks.reproduce import command_for, find_record

    store, record = find_record(run_id, folder)
    shown = record.model_dump(mode="json")
    shown["rewards"] = f"{len(record.rewards)} trials, in learning.parquet and in the record"
    shown["record"] = str(store.path(record.run_id))
    _say(*json_text(shown, indent=2).split("\n"))
    _say("", f"Reproduce it with: {command_for(record, store.folder)}")


@app.command()
def reproduce(
    run_id: Annotated[str, typer.Argument(help="Id of a run, or its beginning.")],
    folder: Records = Path("results"),
    method_file: MethodFiles = None,
) -> None:
    """Perform one run again and say whether the result is identical."""
    from benchmarks.registry import registry
    from benchmarks.reproduce import differences, find_record, perform_once, spec_of
    from benchmarks.specification import Limits

    _, record = find_record(run_id, folder)
    limits = Limits(record.timing.time_limit_s, None)
    spec = spec_of(record, registry(method_file or []), limits)
    again = perform_once(spec)
    found = differences(record, again)
    label = f"{record.run_id} ({spec.method} on {spec.task.name}, run {spec.run})"
    if record.code != again.code:
        _say(f"The record was made by code {record.code}; here is {again.code}.")
    if not found:
        _say(f"{label}: identical.")
        return
    _say(f"{label}: different.")
    for difference in found:
        _say(f"- {difference}")
    sys.exit(1)


@app.command()
def check(
    subject: Annotated[str, typer.Argument(help="Id of a method, or a task file (.toml).")],
    method_file: MethodFiles = None,
) -> None:
    """Check a method or a task file against the laws of the benchmark."""
    from benchmarks.conformance import check_method, check_task_file
    from benchmarks.registry import registry, unknown

    known = registry(method_file or [])
    if subject.endswith(".toml"):
        laws = check_task_file(Path(subject), known)
    elif subject in known:
        laws = check_method(known[subject])
    else:
        raise unknown("method", subject, known)
    for law in laws:
        _say(f"{'pass' if law.passed else 'FAIL'}  {law.name}: {law.finding}")
    broken = sum(not law.passed for law in laws)
    _say("", f"{subject}: {len(laws) - broken} of {len(laws)} laws hold.")
    if broken:
        sys.exit(1)


@app.command()
def draw(
    out: Annotated[Path, typer.Option(help="Picture to write: .png, .svg or .pdf.")],
    tasks: Annotated[str | None, typer.Option(help="Tasks to draw, a,b; all by default.")] = None,
    task_file: Annotated[
        list[Path] | None,
        typer.Option(readable=False, help="A task of your own (TOML); may be repeated."),
    ] = None,
    replace: Replace = False,
) -> None:
    """Draw start configuration and goals of tasks."""
    from analysis.figures.plot import FORMATS, picture
    from analysis.figures.tasks import tasks_plot
    from coartic.files import check_outputs, write_outputs

    if out.suffix.lower() not in FORMATS:
        raise CoarticError(f"--out {out}: the name must end in {', '.join(FORMATS)}")
    check_outputs([out], replace=replace)
    names = _names(tasks, "--tasks")
    if not names and not task_file:
        names = list(builtin_tasks())
    chosen = [load_task(name) for name in dict.fromkeys(names)] + [
        load_task(path) for path in task_file or []
    ]
    write_outputs({out: picture(tasks_plot(chosen), out.suffix.lower())}, replace=replace)
    _say(f"{', '.join(task.name for task in chosen)} drawn in {out}.")


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(help="Results folder, such as results/all.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; DIR/report by default.")
    ] = None,
    methods: Annotated[
        str | None,
        typer.Option(
            help="Methods that the figures show, labels as in the tables: a,b, "
            "'\"a x=1, y=2\",b' with parameters."
        ),
    ] = None,
    formats: Annotated[
        str, typer.Option(help="Files of each figure: svg and any of pdf, png, csv.")
    ] = "pdf,svg,png,csv",
) -> None:
    """Write a report: page with player, tables, figures, numbers for LaTeX, traces.

    A folder that holds anything else than an earlier report, unchanged, is refused.
    """
    from analysis.report.build import build, write
    from analysis.report.write import check_report_folder
    from analysis.study import load

    started = time.monotonic()
    study = load(folder)
    out = folder / "report" if out is None else out
    check_report_folder(out, folder)
    made = build(
        study,
        None if methods is None else _labels(methods, "--methods"),
        [f".{name}" for name in _names(formats, "--formats")],
    )
    write(made, study, out)
    _say(
        f"{out / 'report.html'} is the report, made in {time.monotonic() - started:.0f} s. Beside "
        f"it: report.md, {len(made.document.tables())} tables (tables/, CSV and LaTeX), "
        f"{len(made.plots)} figures (figures/, as {formats}), numbers.tex."
    )


@app.command()
def trace(
    name: Annotated[str, typer.Argument(help="Macro of numbers.tex, or id of a table.")],
    row: Annotated[str | None, typer.Argument(help="Row of the table: its first cell.")] = None,
    column: Annotated[str | None, typer.Argument(help="Column of the table's CSV.")] = None,
    folder: Annotated[
        Path, typer.Option("--in", help="Report, its results folder, or a folder above.")
    ] = Path("results"),
) -> None:
    """Say which runs, code and command are behind a number of a report."""
    from analysis.report.trace import find_report, trace_text
    from analysis.report.trace import trace as find

    where = [part for part in (row, column) if part is not None]
    _say(*trace_text(find(find_report(folder), name, where)).split("\n"))


@app.command()
def compare(
    first: Annotated[Path, typer.Argument(metavar="DIR_A", help="Results folder A.")],
    second: Annotated[Path, typer.Argument(metavar="DIR_B", help="Results folder B.")],
    out: Annotated[
        Path | None, typer.Option(help="Page to write (.md), with a table beside it (.csv).")
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="Table to write (.csv).")] = None,
    replace: Replace = False,
) -> None:
    """Compare two results folders cell by cell: versions, machines, parameters."""
    from analysis.comparisons.versions import compare_versions, load_pair
    from coartic.files import check_outputs, write_outputs

    for path, option, ending in ((out, "--out", ".md"), (csv, "--csv", ".csv")):
        if path is not None and path.suffix.lower() != ending:
            raise CoarticError(f"{option} {path}: the name must end in {ending}")
    if out is not None and csv is None:
        csv = out.with_suffix(".csv")
    check_outputs(filter(None, (out, csv)), replace=replace)
    found = compare_versions(*load_pair(first, second))
    texts = {out: found.to_markdown(), csv: found.cells.to_csv(index=False)}
    written = {path: text.encode() for path, text in texts.items() if path is not None}
    write_outputs(written, replace=replace)
    console = _console()
    for table in (found.differing, found.table):
        _print(console, table.title, table.columns, table.rows, wrap=table is found.differing)
    _say(*found.summary)
    if written:
        _say(f"In {' and '.join(map(str, written))}.")


@app.command()
def animate(
    run_id: Annotated[str, typer.Argument(help="Id of a run, or its beginning.")],
    out: Annotated[Path, typer.Option(help="Film to write: .gif or .mp4 (needs ffmpeg).")],
    other: Annotated[
        str | None, typer.Argument(metavar="[OTHER_RUN_ID]", help="A run to show beside it.")
    ] = None,
    folder: Records = Path("results"),
    initial: Annotated[
        bool, typer.Option("--initial", help="Show the task's initial solution beside it.")
    ] = False,
    speed: Annotated[
        float | None,
        typer.Option(min=0.1, max=10_000, help="Ticks per second; by default some 10 s in all."),
    ] = None,
    width: Annotated[int, typer.Option(min=200, max=3840, help="Width in pixels.")] = 800,
    replace: Replace = False,
) -> None:
    """Show a run's solution tick by tick, alone or beside another one."""
    from analysis.figures.animation import Panel, check_output
    from analysis.figures.animation import animate as film
    from benchmarks.reproduce import find_record, trajectory_of
    from coartic import corrective_trial, initial_hands, trajectory

    check_output(out, replace=replace)
    if initial and other is not None:
        raise CoarticError("--initial shows one run beside its initial solution: give one run id")
    panels = []
    for name in (run_id, other):
        if name is not None:
            _, record = find_record(name, folder)
            found = trajectory_of(record)
            title = one_line(f"{found.task.name}: {record.method}, run {record.run}")
            panels.append(Panel(title, found))
    if initial:
        task = panels[0].trajectory.task
        movements = corrective_trial(task, initial_hands(task)).movements
        panels.insert(0, Panel(f"{task.name}: initial solution", trajectory(task, movements)))
    timed = film(panels, out, speed=speed, width=width, replace=replace)
    _say(
        f"{' beside '.join(panel.title for panel in panels)} in {out}: "
        f"{len(timed.rows)} frames, {timed.stride / timed.interval_s:.0f} ticks a second."
    )


@app.command()
def cite(
    folder: Annotated[
        Path | None, typer.Argument(help="Results folder; all built-in methods without.")
    ] = None,
    style: Annotated[str, typer.Option("--format", help="Only bibtex.")] = "bibtex",
    analysis: Annotated[
        bool, typer.Option("--analysis", help="Also works behind statistics and signatures.")
    ] = False,
) -> None:
    """Print what to cite: the software, the paper, and the methods of a results folder."""
    from analysis.citations import MethodSource, bibliography
    from analysis.results.folder import load_results
    from benchmarks.registry import CLASSES
    from coartic.tables import BUILT_IN

    if style != "bibtex":
        raise CoarticError(f"--format {style}: the one format is bibtex")
    environment = None
    if folder is None:
        methods = [
            MethodSource(item.name, item.title, item.citation, True) for item in CLASSES.values()
        ]
    else:
        manifest = load_results(folder).manifest
        environment = manifest.environment.model_dump(mode="json")
        methods = [
            MethodSource(name, item.title, item.citation, item.origin == BUILT_IN)
            for name, item in manifest.specification.methods.items()
        ]
    text = bibliography(methods, analysis=analysis, environment=environment)
    _say(*text.rstrip("\n").split("\n"))


_AS_IT_IS: Any = {"markup": False, "emoji": False, "highlight": False}
"""Names in square brackets or between colons are no markup of rich."""


def _console() -> Console:
    console = Console(**_AS_IT_IS)
    return console if console.is_terminal else Console(width=PLAIN_WIDTH, **_AS_IT_IS)


class _Display:
    """Cells done, failures and time left: live on a terminal, plain lines elsewhere."""

    EVERY_S = 10.0  # between plain lines

    def __init__(self, suite: str) -> None:
        self.done = 0
        self._suite = suite
        self._console = Console(stderr=True, **_AS_IT_IS)
        self._bar = RichProgress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[failed]} failed"),
            TimeRemainingColumn(),
            console=self._console,
            transient=False,
        )
        self._task: TaskID | None = None
        self._started = self._last = time.monotonic()  # set anew when work begins

    def __enter__(self) -> _Display:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the terminal as it was."""
        self._bar.stop()

    def update(self, progress: Progress, spec: RunSpec | None) -> None:
        """Show how far the plan is."""
        self.done = progress.done
        if spec is None:
            for damage in progress.damaged:
                self.line(f"{damage.reason}; this run is performed again")
            if progress.stale:
                self.line(
                    f"{len(progress.stale)} records were made by other code and are not used"
                )
            if progress.present:
                self.line(f"{progress.present} of {progress.total} runs are already there")
        if self._console.is_terminal:
            self._live(progress, spec)
        else:
            self._plain(progress)

    def _live(self, progress: Progress, spec: RunSpec | None) -> None:
        if self._task is None:
            if progress.present == progress.total:
                return
            self._bar.start()
            self._task = self._bar.add_task(
                one_line(self._suite), total=progress.total - progress.present, failed=0
            )
        words = "starting workers (the first time compiles)"
        if spec is not None:
            words = f"{spec.task.name} {spec.method}"
        self._bar.update(
            self._task,
            completed=progress.done,
            failed=progress.failed,
            description=one_line(words),
        )

    def _plain(self, progress: Progress) -> None:
        now = time.monotonic()
        if progress.done <= 1:  # the workers' start says nothing of the pace
            self._started = self._last = now
        finished = progress.present + progress.done == progress.total
        if not progress.done or (now - self._last < self.EVERY_S and not finished):
            return
        self._last = now
        if finished:
            self.line(f"{progress.total} of {progress.total} runs, {progress.failed} failed")
            return
        left = progress.total - progress.present - progress.done
        seconds = (now - self._started) / (progress.done - 1) * left
        self.line(
            f"{progress.present + progress.done} of {progress.total} runs, "
            f"{progress.failed} failed, about {seconds:.0f} s left"
        )

    def line(self, text: str) -> None:
        """Show a line above the progress."""
        self._console.print(one_line(text), soft_wrap=True)


def _print(
    console: Console,
    title: str,
    columns: tuple[str, ...],
    rows: list[tuple[str, ...]] | tuple[tuple[str, ...], ...],
    *,
    wrap: bool = True,
) -> int:
    """Print a table; the number of columns left out.

    Its first column is never broken. Without ``wrap`` none is: what does not fit in the
    terminal's width is left out from the right.
    """
    shown = len(columns)
    columns, rows = tuple(map(one_line, columns)), [tuple(map(one_line, row)) for row in rows]
    if not wrap:
        widths = [max(map(len, column)) + 4 for column in zip(columns, *rows, strict=True)]
        while shown > 2 and sum(widths[:shown]) > console.width:
            shown -= 1
    table = RichTable(
        title=one_line(title), title_justify="left", box=box.SIMPLE_HEAD, highlight=False
    )
    for index, column in enumerate(columns[:shown]):
        fixed = index == 0 or not wrap
        table.add_column(column, overflow="fold", no_wrap=fixed)
    for row in rows:
        table.add_row(*row[:shown])
    console.print(table)
    return len(columns) - shown
