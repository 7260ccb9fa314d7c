"""Commands about what the paper does not print: its readings and the goals of its tasks."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.arguments import check_numbers
from coartic.cli.terminal import say, show_table
from coartic.errors import CoarticError
from coartic.files import check_folder, folder_named, publish
from coartic.inputs import MOST_RUNS, MOST_TRIALS

if TYPE_CHECKING:
    import pandas as pd

_KINDS = (".svg", ".pdf", ".png")
GROUP = "What is not printed"


_Judge = Annotated[
    str | None, typer.Option("--judge", metavar="FOLDER", help="Judge them, into a folder.")
]
_Runs = Annotated[
    int | None,
    typer.Option(min=40, max=MOST_RUNS, help="Runs a reading and task, 1000 if not said."),
]
_Trials = Annotated[
    int | None, typer.Option(min=1, max=MOST_TRIALS, help="Trials per run, 10 000 if not said.")
]
_Pairs = Annotated[bool, typer.Option(help="Every two readings together as well.")]


def readings(
    judge: _Judge = None,
    runs: _Runs = None,
    trials: _Trials = None,
    pairs: _Pairs = False,
    jobs: given.Jobs = -1,
) -> None:
    """List what the paper leaves open, or judge it by what is printed of one-armed tasks."""
    if judge is None:
        given_too = {"--pairs": pairs, "--runs": runs, "--trials": trials}
        if without := [name for name, value in given_too.items() if value]:
            raise CoarticError(
                f"{', '.join(without)}: only with --judge FOLDER, which judges the readings into "
                "that folder"
            )
        _list_readings()
        return
    from coartic.analysis.reconstruction.judge import combinations, judge_all, judged_table

    check_numbers(jobs, None)
    folder = _folder(judge, "readings", ["readings.csv"], "--judge")
    judged = judge_all(
        list(combinations(pairs)),
        runs=runs or 1000,
        trials=trials or 10_000,
        jobs=_threads(jobs),
        progress=lambda each: say(f"{' '.join(map(str, each.chosen)) or 'default'}: "
                                  f"p = {each.whole.p:.2g}"),
    )  # fmt: skip
    table = judged_table(judged)
    publish(folder, {"readings.csv": _csv(table)}, owner="readings", alone=False)
    shown = table[["readings", "log likelihood", "p", "verdict"]]
    show_table(
        "Readings",
        tuple(shown.columns),
        [tuple(map(str, row)) for row in shown.itertuples(index=False)],
    )
    say("", f"Results in {folder / 'readings.csv'}.")


def _list_readings() -> None:
    from coartic.readings import readings as known

    show_table(
        "Readings",
        ("reading", "what is open", "default", "alternatives"),
        [
            (
                reading.id,
                " ".join(reading.question.split()),
                reading.default.written,
                ", ".join(choice.written for choice in reading.alternatives),
            )
            for reading in known()
        ],
    )


def reconstruct(
    task: Annotated[str, typer.Argument(help="Task whose goals are not printed.")],
    folder: given.Out,
    members: Annotated[int, typer.Option(min=2, max=2000, help="Members of the ensemble.")] = 240,
    runs: Annotated[int, typer.Option(min=2, max=1000, help="Runs a member and condition.")] = 20,
    reading: given.Readings = None,
    jobs: given.Jobs = -1,
) -> None:
    """Search for goals that give what is printed, and make an ensemble of them."""
    from coartic.analysis.reconstruction.reconstruct import Effort, search_for
    from coartic.analysis.reconstruction.reconstruct import reconstruct as perform

    check_numbers(jobs, None)
    names = [f"{task}-members.csv", f"{task}-tried.csv"]
    search = search_for(task, readings=tuple(reading or ()), jobs=_threads(jobs))
    out = _folder(folder, "reconstruct", names)
    found = perform(search, effort=Effort(members=members, runs=runs), report=say)
    tables = zip(names, (found.members, found.tried), strict=True)
    files = {name: _csv(table) for name, table in tables}
    publish(out, files, owner="reconstruct", alone=False)
    say("", f"The nearest is {found.nearest.distance:.2f} standard errors from what is printed.")
    say(f"Results in {out / names[0]} and {out / names[1]}.")


def printed(
    tasks: Annotated[list[str], typer.Argument(help="Tasks, or members of an ensemble.")],
    runs: Annotated[int, typer.Option(min=3, max=MOST_RUNS, help="Runs a condition.")] = 100,
    trials: Annotated[int, typer.Option(min=1, max=MOST_TRIALS, help="Trials per run.")] = 10_000,
    out: Annotated[str | None, typer.Option(help="Folder for a table of it.")] = None,
    reading: given.Readings = None,
    jobs: given.Jobs = -1,
) -> None:
    """Show what the paper prints of tasks, line by line, beside fresh runs."""
    from coartic.analysis.reconstruction.lines import lines

    check_numbers(jobs, None)
    folder = None if out is None else _folder(out, "printed", ["printed.csv"])
    table = lines(
        tasks, readings=tuple(reading or ()), runs=runs, trials=trials, jobs=_threads(jobs),
        progress=say,
    )  # fmt: skip
    shown = table[["figure", "task", "printed", "sd", "ours", "our_sd", "runs", "verdict"]]
    rows = [tuple(map(_short, row)) for row in shown.itertuples(index=False)]
    show_table("What is printed", tuple(shown.columns), rows)
    if folder is not None:
        publish(folder, {"printed.csv": _csv(table)}, owner="printed", alone=False)
        say("", f"Results in {folder / 'printed.csv'}.")


def robustness(
    folders: Annotated[
        list[Path], typer.Argument(parser=folder_named, help="Results folders, one a reading.")
    ],
    out: given.Out,
    jobs: given.Jobs = -1,
) -> None:
    """Judge the paper's claims under each reading and with the goals of each member."""
    from coartic.analysis import load
    from coartic.analysis.figures.plot import rendered
    from coartic.analysis.reconstruction.curve import specification_curve, verdicts
    from coartic.analysis.reconstruction.specifications import judged_specifications, shares

    check_numbers(jobs, None)
    tables = ("specifications.csv", "shares.csv")
    pictures = [f"{name}{kind}" for name in ("verdicts", "specification-curve") for kind in _KINDS]
    folder = _folder(out, "robustness", [*tables, *pictures])
    studies = (load(each) for each in folders)
    table = judged_specifications(
        studies, jobs=_threads(jobs), progress=lambda spec: say(f"judged: {spec.label}")
    )
    if table.empty:
        raise CoarticError(
            "no claim of the paper can be judged there: run its conditions with its 10 000 trials"
        )
    found = shares(table)
    files = dict(zip(tables, map(_csv, (table, found)), strict=True))
    figures = [verdicts(table)]
    if table.effect.notna().any():
        figures.append(specification_curve(table))
    for figure in figures:
        files |= rendered(figure, _KINDS)
    publish(folder, files, owner="robustness", alone=False)
    rows = [tuple(map(str, row)) for row in found.itertuples(index=False)]
    show_table("Claims", tuple(found.columns), rows)
    say("", f"Results in {folder}.")


def _folder(name: str, owner: str, files: Sequence[str], what: str = "--out") -> Path:
    """A folder in which a command may write its files, looked at before the work is done."""
    folder = folder_named(name, what)
    check_folder(folder, owner=owner, alone=False, names=files)
    return folder


def _csv(table: pd.DataFrame) -> bytes:
    return table.to_csv(index=False, lineterminator="\n").encode()


def _short(value: object) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{round(value, 3):g}"
    return str(value)


def _threads(jobs: int) -> int:
    return (os.cpu_count() or 1) if jobs == -1 else max(jobs, 1)


COMMANDS = (readings, printed, reconstruct, robustness)
