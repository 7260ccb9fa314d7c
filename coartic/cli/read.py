"""Commands that read stored runs."""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.terminal import complain, say, say_pairs, say_part, say_table
from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.internal.interruption import interruptible
from coartic.internal.limits import MOST_RUNS
from coartic.internal.text import counted, one_line

if TYPE_CHECKING:
    from coartic.analysis.study import Study


def report(
    folder: given.ResultsFolder,
    out: Annotated[
        Path | None, given.file_or_folder("FOLDER", "Folder to write; FOLDER/report if not given.")
    ] = None,
    for_paper: Annotated[
        bool, typer.Option("--for-paper", help="Also figures as SVG and PDF, and tables as LaTeX.")
    ] = False,
) -> None:
    """Write the report of a results folder."""
    out = folder / "report" if out is None else out
    from coartic.analysis.report.build import write_report
    from coartic.analysis.study import load

    started = time.monotonic()
    study = load(folder)
    with interruptible(lambda: one_line(f"{out} may be incomplete; repeat the command.")):
        files, failures = write_report(study, out, for_paper=for_paper, watch=say_part)
    say_part("")
    made, what = Counter(Path(name).suffix for name in files), "CSV"
    if for_paper:
        what = f"CSV, {made['.tex']} as LaTeX) and {counted(made['.svg'], 'figure')} (SVG and PDF"
    say(
        f"{out / 'report.html'}: made in {time.monotonic() - started:.0f} s, with "
        f"{counted(made['.csv'], 'table')} ({what})."
    )
    if not for_paper:
        say_pairs(
            [("More", "coartic report --for-paper adds figures as SVG and PDF and tables as LaTeX")]
        )
    for part, reason in failures.items():
        complain("Error", f"{part} could not be made, by a fault of coartic: {reason}")
    if failures:
        sys.exit(1)


def say_ranking(study: Study, *more: tuple[str, str]) -> None:
    """Print a table, then pairs of a word and a text.

    The table has at most ten methods of the ranking, without settings and ablations: those
    with the smallest gaps and, wherever they rank, the learner and random search. The pairs
    are the findings on coarticulation and on cost, numbers of runs and trials that are not
    those of the paper, the failed runs, and ``more``.
    """
    from coartic.analysis.report.about import RUNS, finding, leading, limits
    from coartic.analysis.sections import SECTIONS, TABLES
    from coartic.analysis.words import interval, number
    from coartic.learner.learning import TRIALS

    rows = TABLES["ranking"](study).dropna(subset="gap").sort_values("gap", kind="stable")
    rows = rows[~rows.method.isin(study.methods.index[study.methods.under != ""])]
    named = [row["method"] for row in leading(rows)]
    rows = rows[rows.method.isin([*rows.method[: 12 - len(named)], *named])]
    say_table(
        ("method", "gap (%)", "share of the gain (%)", "runs"),
        [
            (study.methods.title[row["method"]], interval(row, "gap", scale=100),
             interval(row, "share", 0, 100), number(row["runs"]))
            for row in rows.to_dict("records")
        ],
    )  # fmt: skip
    shown = [section for section in SECTIONS if section.id in ("coarticulation", "cost")]
    pairs = [(each.title, " ".join(lines)) for each in shown if (lines := finding(study, each))]
    what = limits(study)
    unlike = [f"{what['few']} runs, not {RUNS}"] * bool(what["few"])
    unlike += [f"{number(n)} trials a run, not {number(TRIALS)}" for n in what["trials"]]
    if unlike:
        pairs.append(("Unlike the paper", "; ".join(unlike)))
    if what["earlier"]:
        pairs.append(("Of 4.0.0", f"runs of {', '.join(what['earlier'])}"))
    pairs += [("‡", sentence) for sentence in what["late"]]
    if what["failed"]:
        failed = f"{what['failed']} of {counted(what['runs'], 'run')}: {'; '.join(what['reasons'])}"
        pairs.append(("Failed", failed))
    say_pairs([*pairs, *more])


def verify(
    folder: given.ResultsFolder,
    again: Annotated[int, given.within("--again", "Also perform N runs again.", 0, MOST_RUNS)] = 0,
    method_file: given.MethodFiles = None,
) -> None:
    """Execute every stored solution again and compare."""
    from coartic.analysis.verify import check_runs
    from coartic.runs.store import explain_errors, open_store

    if method_file and not again:
        raise CoarticError("--method-file has no effect without --again, which performs runs again")
    with open_store(folder), explain_errors(folder):  # these explain an error
        report = check_runs(folder)
    say(
        f"{counted(report.runs, 'run')} checked, {counted(report.movements, 'movement')} executed.",
        *(report.wrong or ["Nothing differs."]),
        *report.unfinished,
        "Not checked:",
        *(f"- {words}" for words in report.unchecked if not (again and "--again" in words)),
    )
    count = unlike = 0
    if again:
        from coartic.benchmarks.registry import registry
        from coartic.benchmarks.reproduce import perform_some_again

        registered = registry(method_file or [])
        with open_store(folder) as store:
            methods = [job.cell.method.name for job in store.plan()]
        given.check_used(method_file, registered, methods)
        for run_id, changes in perform_some_again(folder, again, registered):
            count += 1
            unlike += bool(changes)
            for difference in changes:
                say(f"Run {run_id}, performed again: {difference}")
        say(f"{counted(count, 'run')} performed again: {unlike or 'none'} with another result.")
    if report.wrong or report.unfinished or unlike:
        sys.exit(1)


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
    """Print BibTeX for coartic, the paper and the methods of a folder."""
    from coartic.analysis.citations import bibliography
    from coartic.benchmarks.registry import built_in
    from coartic.runs.store import open_store

    if folder is None:
        text = bibliography(built_in(), analysis=analysis)
    else:
        with open_store(folder) as store:
            plan, made_with = store.plan(), store.made_with()
        declared = {job.cell.method.name: job.cell.method for job in plan}
        text = bibliography(declared, analysis=analysis, environment=made_with)
    say(*text.rstrip("\n").split("\n"))
