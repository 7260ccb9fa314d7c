"""Arguments and options that commands share, and how they are read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.text import id_named, unknown
from coartic.threads import MOST_JOBS, threads_for

if TYPE_CHECKING:
    from coartic.benchmarks.registry import Registry


def job_count(text: str | int) -> int:
    """A number of processes. Raises CoarticError for anything else."""
    try:
        threads_for(int(text))
    except ValueError:
        raise CoarticError(
            f"--jobs {text}: it must be -1, one process for each core, or from 1 to {MOST_JOBS}."
        ) from None
    return int(text)


def whole(option: str, least: int, most: int | None = None) -> Callable[[str | int], int]:
    """Return a function that reads an option as a whole number. It raises CoarticError for anything
    else, and for numbers out of the limits."""

    def read(text: str | int) -> int:
        try:
            number = int(text)
        except ValueError:
            raise CoarticError(f"{option} {text}: {text} is no whole number") from None
        if number < least or (most is not None and number > most):
            limits = f"at least {least}" if most is None else f"from {least} to {most}"
            raise CoarticError(f"{option} {text}: it must be {limits}")
        return number

    return read


def output_named(name: str | Path) -> Path:
    """A file or folder to write. Raises CoarticError for an empty name."""
    return folder_named(name, "--out")


SuiteName = Annotated[
    str | None,
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
RunCount = Annotated[
    int | None,
    typer.Option(parser=whole("--runs", 1), metavar="N", help="Runs of each cell."),
]
TrialCount = Annotated[
    int | None,
    typer.Option(parser=whole("--trials", 1), metavar="N", help="Trials of each run."),
]
Jobs = Annotated[
    int,
    typer.Option(parser=job_count, metavar="N", help="Processes; -1 is one for each core."),
]
Tasks = Annotated[
    str | None,
    typer.Option(metavar="A,B", help="Only these tasks, such as two-armed-1, or files (TOML)."),
]
Methods = Annotated[
    str | None,
    typer.Option(metavar="X,Y", help="Only these methods, such as EC4, CMA-ES or 'optimum/*'."),
]
Subject = Annotated[
    str,
    typer.Argument(metavar="NAME", help="A method, EC4 or 'optimum/*', or a task file (.toml)."),
]
MethodFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--method-file", readable=False, metavar="FILE", help="Methods of your own (Python)."
    ),
]
FamilyFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--family-file", readable=False, metavar="FILE", help="A family of your own (TOML)."
    ),
]
Seed = Annotated[
    int, typer.Option(parser=whole("--seed", 0), metavar="N", help="Seed of the suite.")
]
TimeLimit = Annotated[
    float | None,
    typer.Option(metavar="SECONDS", help="Most CPU time of a run."),
]
TrialBudget = Annotated[
    int | None,
    typer.Option(
        parser=whole("--trial-budget", 1), metavar="N", help="Most trials that a run may make."
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Dask scheduler to use instead of this machine."),
]
RetryFailed = Annotated[
    bool, typer.Option("--retry-failed", help="Repeat runs that crashed or took too long.")
]
Beside = Annotated[
    list[str] | None,
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


def tasks_meant(names: Sequence[str]) -> list[str]:
    """Tasks by their ids, where people's names for them may stand; other names as they are."""
    from coartic import builtin_tasks, load_task

    known = {name: load_task(name).label for name in builtin_tasks()}
    return [id_named(name, known) for name in names]


def method_names(registered: Registry) -> Mapping[str, str]:
    """People's names of methods by id; the learner's conditions go by their own names as well."""
    from coartic.analysis.methods import name_of
    from coartic.learner.conditions import CONDITIONS, VARIANTS

    names = {name: name_of(name) for name in registered}
    return {name: words if words != name else "" for name, words in names.items()} | dict.fromkeys(
        [*CONDITIONS, *VARIANTS], ""
    )


def methods_meant(names: Sequence[str], registered: Registry) -> list[str]:
    """Methods by their ids, where people's names for them and wildcards may stand.

    Raises CoarticError with a line for each unknown name.
    """
    from coartic.benchmarks.suites import methods_named

    known, ids, wrong = method_names(registered) if names else {}, [], []
    for name in names:
        try:
            ids += methods_named(id_named(name, known), registered)
        except CoarticError:
            wrong.append(unknown("method", name, known, known))
    if wrong:
        raise CoarticError("\n".join(wrong))
    return ids
