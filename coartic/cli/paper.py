"""The command about what the paper does not print: how it is read, and the goals of its tasks."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.arguments import at_least, check_numbers
from coartic.cli.terminal import say, say_pairs, show_frame
from coartic.errors import CoarticError
from coartic.files import check_folder, folder_named, publish

if TYPE_CHECKING:
    import pandas as pd

app = typer.Typer(
    no_args_is_help=True,
    help="Study what the paper leaves open.",
)
_TrialsOf = Annotated[
    int, typer.Option(parser=at_least(1), metavar="N", help="Trials of each run.")
]


@app.command("readings")
def readings(
    judge: Annotated[
        str | None,
        typer.Option("--judge", metavar="FOLDER", help="Judge them, and write the result there."),
    ] = None,
    runs: Annotated[
        int,
        typer.Option(parser=at_least(40), metavar="N", help="Runs of each reading and task."),
    ] = 1000,
    trials: _TrialsOf = 10_000,
    pairs: Annotated[
        bool, typer.Option("--pairs", help="Also every two of them together.")
    ] = False,
    jobs: given.Jobs = -1,
) -> None:
    """List how the paper can be read, or judge each reading.

    A reading is judged by the results that the paper prints of the one-armed tasks.
    """
    from coartic.tasks.readings import readings as known

    if judge is None:
        for reading in known():
            others = ", ".join(choice.written for choice in reading.alternatives)
            question = " ".join(reading.question.split())
            say_pairs([(reading.id, f"{question} {reading.default.written}; or {others}")])
        return
    from coartic.analysis.reconstruction.judge import combinations, judge_all, judged_table

    check_numbers(jobs, None)
    folder = _folder(judge, ["readings.csv"], "--judge")
    judged = judge_all(
        list(combinations(pairs)),
        runs=runs,
        trials=trials,
        jobs=_threads(jobs),
        progress=lambda each: say(
            f"{' '.join(map(str, each.chosen)) or 'default'}: p = {each.whole.p:.2g}"
        ),
    )
    table = judged_table(judged)
    publish(folder, {"readings.csv": _csv(table)})
    show_frame(table[["readings", "log likelihood", "p", "verdict"]])
    say(f"Written: {folder / 'readings.csv'}")


@app.command("goals")
def goals(
    task: Annotated[str, typer.Argument(metavar="TASK", help="Task whose goals are not printed.")],
    folder: given.OutFolder,
    members: Annotated[
        int, typer.Option(parser=at_least(2), metavar="N", help="Sets of goals to keep.")
    ] = 240,
    runs: Annotated[
        int, typer.Option(parser=at_least(2), metavar="N", help="Runs of each set and condition.")
    ] = 20,
    reading: given.Readings = None,
    jobs: given.Jobs = -1,
) -> None:
    """Search for goals that give the printed results.

    It keeps an ensemble of them.
    """
    from coartic.analysis.reconstruction.reconstruct import Effort, reconstruct, search_for

    check_numbers(jobs, None)
    names = [f"{task}-members.csv", f"{task}-tried.csv"]
    search = search_for(task, readings=tuple(reading or ()), jobs=_threads(jobs))
    out = _folder(folder, names)
    found = reconstruct(search, effort=Effort(members=members, runs=runs), report=say)
    tables = zip(names, (found.members, found.tried), strict=True)
    publish(out, {name: _csv(table) for name, table in tables})
    say(
        f"The nearest set lies {found.nearest.distance:.2f} standard errors from the printed "
        "results."
    )
    say(f"Written: {out / names[0]} and {out / names[1]}")


@app.command("results")
def results(
    tasks: Annotated[
        list[str], typer.Argument(metavar="TASK...", help="Tasks, or members of an ensemble.")
    ],
    runs: Annotated[
        int, typer.Option(parser=at_least(3), metavar="N", help="Runs of each condition.")
    ] = 100,
    trials: _TrialsOf = 10_000,
    out: Annotated[
        str | None, typer.Option(metavar="FOLDER", help="Folder for a table of it.")
    ] = None,
    reading: given.Readings = None,
    jobs: given.Jobs = -1,
) -> None:
    """Compare every printed result of a task with fresh runs."""
    from coartic.analysis.reconstruction.lines import lines

    check_numbers(jobs, None)
    folder = None if out is None else _folder(out, ["printed.csv"])
    chosen, threads = tuple(reading or ()), _threads(jobs)
    table = lines(tasks, readings=chosen, runs=runs, trials=trials, jobs=threads, progress=say)
    columns = ["figure", "task", "printed", "sd", "ours", "our_sd", "runs", "verdict"]
    show_frame(table[columns].map(_short))
    if folder is not None:
        publish(folder, {"printed.csv": _csv(table)})
        say(f"Written: {folder / 'printed.csv'}")


@app.command("claims")
def claims(
    folders: Annotated[
        list[Path],
        typer.Argument(
            parser=folder_named, metavar="FOLDER", help="Results folders, one of each reading."
        ),
    ],
    out: given.OutFolder,
    jobs: given.Jobs = -1,
) -> None:
    """Judge the claims under other readings and goals."""
    from coartic.analysis import load
    from coartic.analysis.figures.plot import FORMATS, picture
    from coartic.analysis.reconstruction.curve import specification_curve, verdicts
    from coartic.analysis.reconstruction.specifications import judged_specifications, shares

    check_numbers(jobs, None)
    tables = ("specifications.csv", "shares.csv")
    pictures = [f"{name}{kind}" for name in ("verdicts", "specification-curve") for kind in FORMATS]
    folder = _folder(out, [*tables, *pictures])
    studies = (load(each) for each in folders)
    table = judged_specifications(
        studies, jobs=_threads(jobs), progress=lambda spec: say(f"Judged: {spec.label}")
    )
    if table.empty:
        raise CoarticError(
            "no claim of the paper can be judged there. Run its conditions with 10 000 trials."
        )
    counted = shares(table)
    files = dict(zip(tables, map(_csv, (table, counted)), strict=True))
    figures = [verdicts(table)]
    if table.effect.notna().any():
        figures.append(specification_curve(table))
    files |= {
        f"{plot.id}{kind}": picture(plot.figure, kind) for plot in figures for kind in FORMATS
    }
    publish(folder, files)
    show_frame(counted)
    say(f"Written: {folder}")


def _folder(name: str, files: Sequence[str], what: str = "--out") -> Path:
    """A folder in which the command may write its files, looked at before the work is done."""
    folder = folder_named(name, what)
    check_folder(folder, files)
    return folder


def _csv(table: pd.DataFrame) -> bytes:
    return table.to_csv(index=False, lineterminator="\n").encode()


def _short(value: object) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{round(value, 3):g}"
    return str(value)


def _threads(jobs: int) -> int:
    return (os.cpu_count() or 1) if jobs == -1 else max(jobs, 1)
