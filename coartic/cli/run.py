"""Commands that run suites, list tasks, suites and methods, and check or start methods."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from coartic.cli import arguments as given
from coartic.cli import completion
from coartic.cli.read import say_ranking
from coartic.cli.terminal import Display, say, say_pairs, say_table
from coartic.errors import CoarticError
from coartic.internal.interruption import interruptible
from coartic.internal.text import one_line, pluralize, unknown
from coartic.internal.threads import MAX_JOBS

if TYPE_CHECKING:
    from coartic.benchmarks.conformance import CheckResult
    from coartic.benchmarks.suites import Suite
    from coartic.runs.method_info import MethodInfo
    from coartic.tasks.families import Family
    from coartic.tasks.task import Task


def run(
    suite: Annotated[
        str | None,
        typer.Argument(
            metavar="SUITE",
            help="Suite to run (`coartic list` names them), or a TOML file.",
            autocompletion=completion.suites,
        ),
    ] = None,
    folder: Annotated[
        str | None,
        given.option("FOLDER", "Folder for the results; by default results/SUITE.", "--out"),
    ] = None,
    runs: Annotated[
        Any,
        typer.Option(
            parser=given.parse_run_range,
            metavar="N",
            help="Runs of each method on each task, or a part of them, such as 50..99.",
        ),
    ] = None,
    trials: Annotated[
        int | None,
        given.option("N", "Trials of each run, for methods that have this parameter."),
    ] = None,
    jobs: Annotated[
        int | None,
        given.ranged_option(
            "--jobs", "Number of processes; by default one for each core.", 1, MAX_JOBS
        ),
    ] = None,
    tasks: Annotated[
        list[str] | None,
        given.option(
            "A,B",
            "Only these tasks, such as two-armed-1, or files (TOML).",
            words=completion.after_commas(completion.tasks),
        ),
    ] = None,
    methods: Annotated[
        list[str] | None,
        given.option(
            "X,Y",
            "Only these methods, such as EC4, CMA-ES or 'optimum/*'.",
            words=completion.after_commas(completion.methods),
        ),
    ] = None,
    method_file: given.MethodFiles = None,
    family_file: Annotated[
        list[Path] | None, given.option("FILE", "A family of your own (TOML).")
    ] = None,
    seed: Annotated[int, given.option("N", "Seed of the suite.")] = 0,
    time_limit: Annotated[
        float | None, given.option("SECONDS", "Most CPU time of a job: of a run, or of a few.")
    ] = None,
    trial_budget: Annotated[
        int | None, given.option("N", "Most trials of a run, for all methods.")
    ] = None,
    model: Annotated[
        list[str] | None,
        given.option(
            "CONSTANT=VALUE",
            "World of the runs, such as motor_noise=0.01, of blocks without a world of their own.",
        ),
    ] = None,
    scheduler: Annotated[
        str | None, given.option("ADDRESS", "Dask scheduler to use instead of this machine.")
    ] = None,
    include: Annotated[
        list[str] | None,
        given.option("FOLDER", "Include the runs of a folder, or the results named 'shipped'."),
    ] = None,
    after: given.After = None,
) -> None:
    """Run the missing part of a suite, and print the ranking.

    If the command is interrupted, repeat it. It continues where it stopped, and repeats runs that
    crashed. If --runs names a part of the runs, no ranking is printed.
    """
    from coartic.analysis.study import check_after, load
    from coartic.benchmarks.cluster import Dask
    from coartic.benchmarks.include import include_folders
    from coartic.benchmarks.planning import plan, request_for
    from coartic.benchmarks.pool import Local
    from coartic.benchmarks.registry import registry
    from coartic.benchmarks.runner import perform
    from coartic.benchmarks.suites import load_suite, suites
    from coartic.runs.shipped import own_folder
    from coartic.runs.store import open_store

    if suite is None:
        raise CoarticError(f"SUITE is missing: give {', '.join(suites())}, or a file (.toml)")
    if scheduler is not None and jobs is not None:
        raise CoarticError("--jobs has no effect with --scheduler, whose workers perform the runs")
    if after is not None and isinstance(runs, range):
        raise CoarticError("--after has no effect with a part of --runs, which prints no ranking")
    chosen, display = load_suite(suite), Display()
    out = own_folder(f"results/{chosen.name}" if folder is None else folder, "--out")

    def saved() -> str:
        runs_stored = "no run yet"
        with suppress(CoarticError), open_store(out) as store:
            runs_stored = pluralize(len(store.present()), "run")
        return one_line(f"Stored in {out}: {runs_stored}; repeat the command to resume.")

    with interruptible(saved), display:
        display.show(f"Planning the runs of {chosen.name}")
        registered = registry(method_file or ())
        names = given.resolve_methods(given.split_names(methods), registered, expand=False)
        if include and not names:  # only the user's own methods
            names = [name for name, info in registered.items() if info.where.endswith(".py")]
        request = request_for(
            tasks=given.split_names(tasks),
            methods=names,
            family_files=family_file or (),
            **{"runs": runs, "trials": trials, "seed": seed},
            **{"time_limit_s": time_limit, "trial_budget": trial_budget},
            model=given.constants_in(given.split_names(model)),
        )
        asked = plan(chosen, request, registered)
        if include:
            only = {job.cell.task.name for job in asked} if tasks else None
            display.show(f"Adding the runs of {' and '.join(include)}")
            asked = include_folders(asked, include, out, only, registered)
            display.line(f"Added the runs of {' and '.join(include)}.")
        if after is not None:
            check_after(asked, after)
        executor = Local(jobs or -1) if scheduler is None else Dask(scheduler, say=display.line)
        progress = perform(asked, out, executor=executor, watch=display.update)
    say(str(progress))
    if isinstance(runs, range):
        part = f"`--include {quote(str(out))}`, with all other parts, joins them"
        say_pairs([("Next", f"{out} has runs {runs[0]} to {runs[-1]}: {part}")])
    else:
        say_ranking(load(str(out), after=after), out)
    if progress.crashed:
        sys.exit(1)


def list_(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="Task, suite, method, family or results folder.",
            autocompletion=completion.names,
        ),
    ] = None,
    method_file: given.MethodFiles = None,
) -> None:
    """List tasks, suites and methods, or describe one of them.

    For a results folder, list its runs and their ids.
    """
    from coartic import builtin_tasks, load_task
    from coartic.benchmarks.registry import registry
    from coartic.benchmarks.suites import check_kind, kind_of, load_suite, suites
    from coartic.tasks.families import load_family, shipped_families
    from coartic.tasks.task import address_of

    registered, families = registry(method_file or []), shipped_families()
    if name is None:  # all names, to fit one screen
        titles = given.method_titles(registered)
        return say_pairs(
            [
                ("Tasks", ""),
                *((f"  {task}", load_task(task).label) for task in builtin_tasks()),
                ("Families", ", ".join(families)),
                ("Suites", ""),
                *((f"  {suite}", content.title) for suite, content in suites().items()),
                ("Methods", ""),
                *((f"  {method}", titles[method]) for method in registered),
                ("More", "coartic list NAME, such as two-armed-1, comparison or CMA-ES"),
            ]
        )
    if name.endswith(".toml"):
        check_kind(name, "suite", "task", "family")
    kind, methods = kind_of(name), list[str]()
    if kind == "suite":
        pairs = _describe_suite(name, load_suite(name))
    elif kind == "results folder":
        return _list_runs(given.results_folder(name))
    elif kind == "family":
        pairs = _describe_family(load_family(name), name)
    elif name in builtin_tasks() or address_of(name) or ".toml" in name:
        pairs = _describe_task(name, load_task(name))
    elif kind == "shipped family":
        family = families.get(name) or families[f"{name}/v1"]
        pairs = _describe_family(family, family.name)
    else:
        try:
            methods = given.resolve_methods([name], registered)
        except CoarticError as error:
            if Path(name).is_dir():
                return _list_runs(given.results_folder(name))  # explains what the folder lacks
            if not str(error).startswith("unknown"):
                raise
            known = [*suites(), *builtin_tasks(), *families, *registered]
            raise CoarticError(unknown("task, suite, method or family", name, known)) from error
        pairs = (pair for method in methods for pair in _describe_method(registered[method]))
    given.check_used(method_file, registered, methods)
    return say_pairs(pairs)


def _describe_suite(name: str, suite: Suite) -> Iterator[tuple[str, str]]:
    """Yield a description of a suite, as pairs of a heading and a text (:func:`.say_pairs`).

    ``name`` is the name of the suite or the path of its file.
    """
    from coartic import builtin_tasks
    from coartic.analysis.words import number

    yield "Suite", f"{name}: {suite.title}"
    yield "", suite.description
    runs = " or ".join(map(str, sorted({block.runs or suite.runs for block in suite.blocks})))
    trials = number(suite.trials) if suite.trials else "no"
    yield "Runs", f"{runs} of each method on each task, {trials} trials a run"
    entries = [entry for block in suite.blocks for entry in block.tasks]
    tasks = [task for entry in entries for task in (builtin_tasks() if entry == "*" else [entry])]
    yield "Tasks", ", ".join(dict.fromkeys(tasks))
    yield "Methods", ", ".join(dict.fromkeys(m for block in suite.blocks for m in block.methods))
    yield "Run it", f"coartic run {name}"


def _describe_task(name: str, task: Task) -> Iterator[tuple[str, str]]:
    """Yield a description of a task, as pairs of a heading and a text (:func:`.say_pairs`).

    ``name`` is the name of the task or the path of its file, as the user wrote it.
    """
    yield "Task", f"{name} ({task.label}): {task.description}"
    yield "Goals", ", ".join(f"({x:g}, {y:g})" for x, y in task.goals)
    yield "Hands", f"{' and '.join(task.hands)}; initially {task.initial_hands}"
    yield "Base", f"locked in {', '.join(task.locked_base)}" if task.locked_base else "free"
    if task.name == name and task.family is None:  # a task of the paper
        yield "Goals are", "reconstructed" if task.reconstructed else "published in the paper"


def _list_runs(folder: Path) -> None:
    """Print a table of the stored runs in the plan of a results folder."""
    from coartic.runs.shipped import open_results

    with open_results(folder) as store:
        runs = store.runs()
    columns = ["run_id", "task", "method", "setting", "run", "reward", "status"]
    if (runs.world != "").any():
        columns.insert(4, "world")
    if runs.mean_ticks.notna().any():
        columns.insert(-1, "mean_ticks")
    say_table(columns, runs[columns].astype("string").fillna("").to_numpy().tolist())
    say(f"{folder}: {pluralize(len(runs), 'run')}.")


def _describe_family(family: Family, name: str) -> Iterator[tuple[str, str]]:
    """Yield a description of a family, as pairs of a heading and a text (:func:`.say_pairs`).

    ``name`` is the name of the family or the path of its file.
    """
    yield "Family", f"{name}: {family.description}"
    yield "Instances", f"{name}/i000, ... (test); {name}/d000, ... (development)"
    yield "Draw some", f"coartic draw {quote(name)}/i000..i003 --out FOLDER"


def _describe_method(info: MethodInfo) -> Iterator[tuple[str, str]]:
    """Yield a description of a method, as pairs of a heading and a text (:func:`.say_pairs`)."""
    from coartic import builtin_tasks, load_task
    from coartic.analysis.methods import title_of
    from coartic.internal.text import describe_parameters
    from coartic.runs.method_info import WITHDRAWN

    applies = (
        task for task in builtin_tasks() if info.inapplicable_reason(load_task(task)) is None
    )
    yield "Method", f"{info.name}: {info.title}"
    yield "Called", title_of(info)
    yield "Information", ", ".join(info.information)
    withdrawn = WITHDRAWN.get(info.name, {})
    defaults = {name: value for name, value in info.defaults.items() if name not in withdrawn}
    yield "Parameters", describe_parameters(defaults) or "none"
    yield "Tasks", ", ".join(applies) or "none of the paper's tasks"
    yield "Runs", "depend on the seed" if info.stochastic else "do not depend on the seed"
    yield "Tuned on", info.tuned_on or "not stated"
    works = *info.facts.works, *info.facts.solvers, info.citation
    yield "Cites", ", ".join(filter(None, works)) or "nothing"


def check(
    subject: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="Methods, such as EC4 or 'optimum/*', or a task file (.toml).",
            autocompletion=completion.methods,
        ),
    ],
    method_file: given.MethodFiles = None,
    verbose: Annotated[
        bool,
        typer.Option("--verbose", help="Show what the method prints and logs, and tracebacks."),
    ] = False,
) -> None:
    """Check whether a method or a task file keeps the rules.

    Exits with code 1 if it does not.
    """
    from coartic import builtin_tasks
    from coartic.benchmarks.conformance import check_method, check_task_file
    from coartic.benchmarks.registry import registry
    from coartic.benchmarks.suites import check_kind
    from coartic.internal.toml_files import read_bytes
    from coartic.tasks.task import address_of

    if subject in builtin_tasks() or address_of(subject):
        raise CoarticError(
            f"{subject} is a task, not a method or a file. `coartic draw {subject} --out FOLDER` "
            "writes its file, which can be checked."
        )
    registered = registry(method_file or [])
    if subject.endswith(".toml"):
        read_bytes(subject)  # a file that is missing is not a check that fails
        check_kind(subject, "task")
        if verbose:
            raise CoarticError("--verbose has no effect on a task file")
        with Display() as display:
            display.show(f"Performing runs on {subject}")
            results = check_task_file(Path(subject), registered)
        broken = _show_results(subject, results)
    else:
        names = given.resolve_methods([subject], registered)
        given.check_used(method_file, registered, names)
        broken = 0
        for name in names:
            with Display() as display:
                display.show(f"Performing runs of {name}")
                results = check_method(registered[name], verbose=verbose)
            broken += _show_results(name, results)
    if broken:
        sys.exit(1)


def _show_results(name: str, results: Sequence[CheckResult]) -> int:
    """Print the results of checks, and return the number of checks that did not pass.

    ``name`` is the name of the method or file that was checked. A check that was not made counts as
    a check that did not pass.
    """
    words = {True: "pass", False: "FAIL", None: "skip"}
    for result in results:
        say(f"{words[result.passed]}  {result.name}: {result.finding}")
    passed = sum(result.passed is True for result in results)
    say(f"{name}: {passed} of {pluralize(len(results), 'check')} passed.")
    return len(results) - passed


def _new_study(name: str, out: Path | None, replace: bool) -> None:
    """Write a suite with two contrasts into a file."""
    import coartic
    from coartic.benchmarks.suites import suites
    from coartic.internal.files import check_ending, write_output
    from coartic.tasks.task import NAME_PATTERN

    path = Path(f"{name}.toml") if out is None else out
    check_ending(path, [".toml"])
    if name in suites() or not re.fullmatch(NAME_PATTERN, name):
        raise CoarticError(
            f"coartic new: a suite cannot have the name {name!r}: choose another one of letters, "
            "digits, dots, hyphens and underscores"
        )
    template = Path(coartic.__file__).parent / "benchmarks" / "template_study.toml"
    text = template.read_text(encoding="utf-8").replace("NAME", name)
    write_output(path, text.encode(), replace=replace)
    file = quote(str(path))
    say_pairs(
        [
            ("Written", f"{path}: change it into your own question"),
            ("Run", f"coartic run {file}"),
            ("Report", f"coartic report results/{name}"),
        ]
    )


def new(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Id of the method or study, such as my-search.")
    ],
    planner: Annotated[
        bool,
        typer.Option("--planner", help="A planner, not an optimiser that learns from trials."),
    ] = False,
    study: Annotated[
        bool, typer.Option("--study", help="A suite that asks two questions, not a method.")
    ] = False,
    out: given.Out = None,
    replace: given.Replace = False,
) -> None:
    """Write a small working method or study, to start your own."""
    if study:
        if planner:
            raise CoarticError("--planner has no effect with --study")
        _new_study(name, out, replace)
        return
    from coartic.benchmarks import template, template_planner
    from coartic.benchmarks.registry import check_id, registry
    from coartic.internal.files import check_ending, write_output

    path = Path(given.file_name(name)) if out is None else out
    check_ending(path, [".py"])
    check_id(name, "coartic new", registry())
    module = template_planner if planner else template
    text = Path(str(module.__file__)).read_text(encoding="utf-8").replace("NAME", name)
    write_output(path, text.encode(), replace=replace)
    file = quote(str(path))
    say_pairs(
        [
            ("Written", f"{path}: change it into your own method"),
            ("Check", f"coartic check {name} --method-file {file}"),
            (
                "Run",
                f"coartic run comparison --method-file {file} --include shipped --out results/mine",
            ),
        ]
    )
