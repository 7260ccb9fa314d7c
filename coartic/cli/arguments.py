"""Arguments and options that commands share, and how they are read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.inputs import MOST_SECONDS
from coartic.threads import MOST_JOBS, threads_for


def job_count(text: str | int) -> int:
    """A number of processes. Raises CoarticError for 0 and for what is none."""
    try:
        threads_for(int(text))
    except ValueError:
        raise CoarticError(
            f"--jobs {text}: it must be -1, one process for each core, or from 1 to {MOST_JOBS}."
        ) from None
    return int(text)


def output_named(name: str | Path) -> Path:
    """A file or folder to write. Raises CoarticError for an empty name."""
    return folder_named(name, "--out")


SuiteName = Annotated[
    str,
    typer.Argument(
        metavar="SUITE", help="Suite to run (`coartic list` names them), or a TOML file."
    ),
]
Something = Annotated[
    str | None, typer.Argument(metavar="NAME", help="Task, suite, method or family.")
]
Results = Annotated[
    Path, typer.Argument(parser=folder_named, metavar="FOLDER", help="Results folder.")
]
RunId = Annotated[str, typer.Argument(metavar="RUN", help="Id of a run, or its beginning.")]
In = Annotated[
    Path,
    typer.Option("--in", parser=folder_named, metavar="FOLDER", help="Where to look for the run."),
]
Out = Annotated[
    str | None,
    typer.Option(
        "--out", metavar="FOLDER", help="Folder for the results; results/SUITE if not given."
    ),
]
OutFolder = Annotated[str, typer.Option("--out", metavar="FOLDER", help="Folder for the results.")]
Readings = Annotated[
    list[str] | None,
    typer.Option(
        "--reading",
        metavar="NAME=VALUE",
        help="How the paper is read (`coartic paper readings`), such as ties=right.",
    ),
]
RunCount = Annotated[
    int | None,
    typer.Option(min=1, metavar="N", help="Runs of each cell."),
]
TrialCount = Annotated[int | None, typer.Option(min=1, metavar="N", help="Trials of each run.")]
Jobs = Annotated[
    int,
    typer.Option(parser=job_count, metavar="N", help="Processes; -1 is one for each core."),
]
Tasks = Annotated[str | None, typer.Option(metavar="A,B", help="Only these tasks.")]
Methods = Annotated[str | None, typer.Option(metavar="X,Y", help="Only these methods.")]
Subject = Annotated[
    str,
    typer.Argument(metavar="NAME", help="A method, EC4 or 'optimum/*', or a task file (.toml)."),
]
TaskFiles = Annotated[
    list[Path] | None,
    typer.Option("--task-file", readable=False, metavar="FILE", help="A task of your own (TOML)."),
]
MethodFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--method-file", readable=False, metavar="FILE", help="Methods of your own (Python)."
    ),
]
Seed = Annotated[int, typer.Option(min=0, metavar="N", help="Seed of the suite.")]
TimeLimit = Annotated[
    float | None,
    typer.Option(min=1e-3, max=MOST_SECONDS, metavar="SECONDS", help="Most CPU time of a run."),
]
TrialBudget = Annotated[
    int | None,
    typer.Option(min=1, metavar="N", help="Most trials that a run may make."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Dask scheduler to use instead of this machine."),
]
RetryFailed = Annotated[
    bool, typer.Option("--retry-failed", help="Repeat runs that crashed or took too long.")
]
Redo = Annotated[bool, typer.Option("--redo", help="Repeat every run.")]
Beside = Annotated[
    str | None,
    typer.Option(
        metavar="FOLDER",
        help="Put these results beside: a folder, or 'released' for the shipped ones.",
    ),
]
Replace = Annotated[bool, typer.Option("--replace", help="Write over a file that is there.")]


def split_names(text: str | None, option: str) -> list[str]:
    """A comma-separated list. Raises CoarticError for an empty name."""
    if text is None:
        return []
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise CoarticError(f"{option} {text!r} has an empty name. Write for example a,b.")
    return names
