"""The command about what the paper does not print: how it is read, and the goals of its tasks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.arguments import at_least
from coartic.cli.terminal import say, say_pairs, show_frame
from coartic.errors import CoarticError
from coartic.files import check_folder, folder_named, publish

if TYPE_CHECKING:
    import pandas as pd

app = typer.Typer(
    no_args_is_help=True,
    help="Study what the paper leaves open.",
)
TrialsOfRun = Annotated[
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
    trials: TrialsOfRun = 10_000,
    pairs: Annotated[
        bool, typer.Option("--pairs", help="Also every two of them together.")
    ] = False,
    jobs: given.Jobs = -1,
) -> None:
    """List how the paper can be read, or judge each reading.

    A reading is judged by the results that the paper prints of the one-armed tasks.
    """
    from coartic.tasks.readings import readings as all_readings

    if judge is None:
        for reading in all_readings():
            others = ", ".join(choice.written for choice in reading.alternatives)
            question = " ".join(reading.question.split())
            say_pairs([(reading.id, f"{question} {reading.default.written}; or {others}")])
        return
    from coartic.analysis.reconstruction.readings import combinations, judge_readings

    folder = checked_folder(judge, ["readings.csv"], "--judge")
    table = judge_readings(
        combinations(pairs),
        runs=runs,
        trials=trials,
        jobs=jobs,
        progress=lambda combined, p: say(f"{combined}: p = {p:g}"),
    )
    publish(folder, {"readings.csv": csv_of(table)})
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
    import pandas as pd

    from coartic.analysis.reconstruction.ensemble import reconstruct
    from coartic.analysis.reconstruction.search import search_for

    names = [f"{task}-members.csv", f"{task}-tried.csv"]
    search = search_for(task, readings=tuple(reading or ()), jobs=jobs)
    out = checked_folder(folder, names)
    ensemble = reconstruct(search, members=members, runs=runs, report=say)
    tried = pd.DataFrame(search.tried.items(), columns=["stage", "sets of goals"])
    publish(out, dict(zip(names, map(csv_of, (ensemble, tried)), strict=True)))
    distance = ensemble.distance[0]
    say(f"The nearest set lies {distance:.2f} standard errors from the printed results.")
    say(f"Written: {out / names[0]} and {out / names[1]}")


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
    from coartic.analysis.reconstruction.robustness import judged_specifications, shares

    names = ("specifications.csv", "shares.csv")
    folder = checked_folder(out, names)
    table = judged_specifications(
        map(load, folders),
        jobs=jobs,
        progress=lambda specification: say(f"Judged: {specification}"),
    )
    if table.empty:
        raise CoarticError(
            "no claim of the paper can be judged there. Run its conditions with 10 000 trials."
        )
    counts = shares(table)
    publish(folder, dict(zip(names, map(csv_of, (table, counts)), strict=True)))
    show_frame(counts)
    say(f"Written: {folder}")


def checked_folder(name: str, files: Sequence[str], what: str = "--out") -> Path:
    """A folder in which the command may write its files, looked at before the work is done."""
    folder = folder_named(name, what)
    check_folder(folder, files)
    return folder


def csv_of(table: pd.DataFrame) -> bytes:
    """A table as a file."""
    return table.to_csv(index=False, lineterminator="\n").encode()
