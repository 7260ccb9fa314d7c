"""Commands that read stored runs."""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.terminal import Display, complain, say, say_pairs, say_table
from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.internal.interruption import interruptible
from coartic.internal.limits import MOST_RUNS
from coartic.internal.text import counted, one_line

if TYPE_CHECKING:
    from coartic.analysis.study import Study
    from coartic.runs.record import Run


def report(
    folder: given.ResultsFolder,
    out: Annotated[
        Path | None, given.file_or_folder("FOLDER", "Folder to write; FOLDER/report if not given.")
    ] = None,
    for_paper: Annotated[
        bool, typer.Option("--for-paper", help="Also figures as SVG and PDF, and tables as LaTeX.")
    ] = False,
    width: Annotated[
        float | None,
        given.within("--width", "Width of these figures, inches: 3.4 for one column.", 2.5, 20),
    ] = None,
    against: Annotated[
        str | None,
        given.option("METHOD", "Compare all methods with this one, in table differences."),
    ] = None,
) -> None:
    """Write the report of a results folder."""
    if width is not None and not for_paper:
        raise CoarticError("--width has no effect without --for-paper")
    out = folder / "report" if out is None else out
    from coartic.analysis import TABLES
    from coartic.analysis.report.build import write_report
    from coartic.analysis.study import load

    started = time.monotonic()
    with (
        Display() as display,
        interruptible(lambda: one_line(f"{out} may be incomplete; repeat the command.")),
    ):
        display.show(f"Reading {folder}")
        study = load(folder, against=against or "")
        if against and not len(TABLES["differences"](study)):
            raise CoarticError(
                f"--against {against} has no effect: no other method solved every run on the tasks "
                "on which this one did"
            )
        files, failures = write_report(
            study, out, for_paper=for_paper, width=width, watch=display.show
        )
    made, what = Counter(Path(name).suffix for name in files), "CSV"
    if for_paper:
        what = f"CSV, {made['.tex']} as LaTeX) and {counted(made['.svg'], 'figure')} (SVG and PDF"
    say(
        f"{out / 'report.html'}: made in {time.monotonic() - started:.0f} s, with "
        f"{counted(made['.csv'], 'table')} ({what})."
    )
    if not for_paper:
        again = f"coartic report {study.folder_in_commands} --for-paper"
        say_pairs([("More", f"{again} adds figures as SVG and PDF, and tables as LaTeX")])
    for part, reason in failures.items():
        complain("Error", f"{part} could not be made, by a fault of coartic: {reason}")
    if failures:
        sys.exit(1)


def say_ranking(study: Study, *more: tuple[str, str]) -> None:
    """Print the ranking of a study as a table, then pairs of a word and a text: why methods are not
    ranked, what was found on coarticulation and cost, how runs differ from the paper's, how many
    failed, and ``more``."""
    from coartic.analysis.report.sections import RUNS, SECTIONS, finding, limits
    from coartic.analysis.standings import ranked_tasks, reference, standings
    from coartic.analysis.words import interval, listed, number
    from coartic.learner.learning import TRIALS

    every = standings(study)
    names = [
        row.title if row.built_in or row.title.startswith(row.base) else f"{row.base}: {row.title}"
        for _, row in every.iterrows()
    ]
    every = every.assign(name=names)
    rows, others = every[every.why == ""], every[every.why != ""]
    to = reference(study, ranked_tasks(study))
    if study.question[0]:
        say(": ".join(study.question))
    heads = ["method", f"gap to the {to} (%)", "share of the gain (%)", "runs"]
    heads += ["note"] * any(rows.note)
    cells = [
        [row["name"], interval(row, "gap", scale=100), interval(row, "share", 0, 100),
         number(row["runs"]), row["note"]][: len(heads)]
        for row in rows.to_dict("records")
    ]  # fmt: skip
    say_table(heads, cells)
    pairs = [("Answer", line) for line in finding(study, SECTIONS[0]) if study.varied[0]][:1]
    pairs += [
        ("Not ranked", f"{why}: {'; '.join(of_reason['name'])}")
        for why, of_reason in others.groupby("why", sort=False)
    ]
    shown = [section for section in SECTIONS if section.id in ("coarticulation", "cost")]
    pairs += [(each.title, " ".join(lines)) for each in shown if (lines := finding(study, each))]
    what = limits(study)
    unlike = [f"{counted(what['few'], 'run')} of a task, not {RUNS}"] * bool(what["few"])
    unlike += [f"{number(n)} trials a run, not {number(TRIALS)}" for n in what["trials"]]
    if unlike:
        pairs.append(("Unlike the paper", "; ".join(unlike)))
    if what["own"]:
        text = (
            f"Of {listed(what['own'])} only the best of this folder is known: gaps there are to it"
        )
        again = "repeat the command with optimum/search among its --methods"
        pairs.append(("Reference", f"{text}. To search for the optimum, {again}"))
    if what["unknown"]:
        where = f"on {listed(what['unknown'])}, where fewer than two methods have a solution"
        pairs.append(("No gaps", where))
    pairs += [("‡", sentence) for sentence in what["late"]]
    if what["failed"]:
        failed = f"{what['failed']} of {counted(what['runs'], 'run')}: {'; '.join(what['reasons'])}"
        pairs.append(("Failed", failed))
    say_pairs([*pairs, *more])


def verify(
    folder: given.ResultsFolder,
    again: Annotated[int, given.within("--again", "Also perform N runs again.", 0, MOST_RUNS)] = 0,
    run: Annotated[
        str | None,
        given.option("ID", "Only perform this run again; the beginning of its id.", "--run"),
    ] = None,
    method_file: given.MethodFiles = None,
) -> None:
    """Execute every stored solution again and, with --again, perform runs again; with --run, only
    perform one run again. Exit with code 1 if something differs or, without --run, is missing."""
    from coartic.analysis.verify import check_runs
    from coartic.runs.store import explain_errors, open_store

    alone = run is not None
    if again and alone:
        raise CoarticError("--again has no effect with --run, which performs one run again")
    if method_file and not (again or alone):
        raise CoarticError("--method-file has no effect without --again or --run")
    is_right = True
    if not alone:
        with Display() as display, open_store(folder), explain_errors(folder):
            display.show(f"Executing the solutions of {folder}")
            report = check_runs(folder)
        is_right = not (report.wrong or report.unfinished)
        say(
            f"{counted(report.runs, 'run')} checked, "
            f"{counted(report.movements, 'movement')} executed.",
            *(report.wrong or ["Nothing differs."]),
            *report.unfinished,
        )
    unlike = _perform_again(folder, again, run, method_file) if again or alone else 0
    if unlike or not is_right:
        sys.exit(1)


def _perform_again(
    folder: Path, count: int, run_id: str | None, method_file: list[Path] | None
) -> int:
    """Perform the run of a folder whose id begins with ``run_id`` again, or, for None, at most
    ``count`` of its runs; print the differences from the stored runs and return the number of runs
    with another result."""
    from coartic.benchmarks.registry import registry
    from coartic.benchmarks.reproduce import compare_runs, find_run, perform_runs_again, some_runs
    from coartic.runs.store import open_store

    registered = registry(method_file or [])
    if run_id is None:
        runs = some_runs(folder, count, registered)
        with open_store(folder) as store:
            methods = [job.cell.method.name for job in store.plan()]
    else:
        runs = [find_run(run_id, folder)]
        methods = [runs[0].cell.method.name]
        if methods[0] not in registered:
            raise CoarticError(f"unknown method {methods[0]!r}: pass --method-file FILE")
    given.check_used(method_file, registered, methods)
    if run_id is not None:
        _describe_run(runs[0], registered[methods[0]].code)
    unlike = 0
    with Display() as display:
        display.show(f"Performing {counted(len(runs), 'run')} again")
        for number, (stored, again) in enumerate(perform_runs_again(runs, registered), 1):
            changes = compare_runs(stored, again)
            unlike += bool(changes)
            for difference in changes:
                say(f"Run {stored.id}, performed again: {difference}")
            display.show(f"Performed {number} of {counted(len(runs), 'run')} again")
    say(f"{counted(len(runs), 'run')} performed again: {unlike or 'none'} with another result.")
    return unlike


def _describe_run(run: Run, code: str) -> None:
    """Print id, seed, parameters and result of a run, and a sentence if ``code``, the version or
    code of its method in this installation, differs from the run's."""
    from coartic.analysis.methods import title_of
    from coartic.analysis.words import number
    from coartic.runs.plan import in_words

    cell, result = run.cell, f"{run.outcome.status}: {run.outcome.reason}"
    if run.solution.reward is not None:
        result = f"reward {number(run.solution.reward)}, hands {run.solution.hands}"
    say_pairs(
        [
            ("Run", f"{run.id}: {cell.task.label}, {title_of(cell.method)}, run {run.number}"),
            ("Seed", str(run.seed)),
            ("Parameters", in_words(cell.parameters)),
            ("Result", result),
        ]
    )
    if code != cell.method.code:
        say(f"Another version of the method made the run ({cell.method.code}; here is {code}).")


def cite(
    folder: Annotated[
        Path | None,
        typer.Argument(
            parser=folder_named,
            metavar="FOLDER",
            help="Results folder; without, all methods.",
        ),
    ] = None,
    analysis: Annotated[
        bool, typer.Option("--analysis", help="Also works behind statistics and signatures.")
    ] = False,
) -> None:
    """Print BibTeX for coartic, the paper and the methods of a folder, or all built-in methods."""
    from coartic.analysis.citations import bibliography
    from coartic.benchmarks.registry import built_in
    from coartic.runs.store import open_store

    if folder is None:
        text = bibliography(built_in(), analysis=analysis)
    else:
        with open_store(folder) as store:
            plan, made_with, imports = store.plan(), store.made_with(), store.imports()
        declared = {job.cell.method.name: job.cell.method for job in plan}
        text = bibliography(declared, analysis=analysis, environment=made_with, imports=imports)
    say(*text.rstrip("\n").split("\n"))
