"""Arguments and options that commands share, what completes them, and how they are read."""

from __future__ import annotations

import csv
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from typing import Annotated

import typer

from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.inputs import MOST_RUNS, MOST_SECONDS, MOST_SEED, MOST_TRIALS
from coartic.text import did_you_mean


def _suites() -> Iterable[str]:
    from coartic import benchmarks

    folder = Path(benchmarks.__file__).parent / "suites"
    return sorted(path.stem for path in folder.glob("*.toml"))


def _tasks() -> Iterable[str]:
    from coartic import builtin_tasks

    return builtin_tasks()


def _conditions() -> Iterable[str]:
    from coartic import CONDITIONS, VARIANTS

    return [*CONDITIONS, *VARIANTS]


def _methods() -> Iterable[str]:
    from coartic.benchmarks.registry import CLASSES

    return CLASSES


def _completing(*sources: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Completes the last of some names that stand between commas, from the first source that
    has one: those that take longer to import come later."""

    def complete(incomplete: str) -> list[str]:
        done, comma, begun = incomplete.rpartition(",")
        found = ([name for name in names() if name.startswith(begun)] for names in sources)
        return [f"{done}{comma}{name}" for name in next(filter(None, found), [])]

    return complete


SuiteName = Annotated[
    str,
    typer.Argument(
        help="Suite to run (`coartic list`), or a TOML file.", autocompletion=_completing(_suites)
    ),
]
ResultsFolder = Annotated[
    Path, typer.Argument(parser=folder_named, help="Results folder, such as results/all.")
]
Results = Annotated[
    Path,
    typer.Argument(
        parser=folder_named, metavar="DIR", help="Results folder, or an archive of one (.zip)."
    ),
]
RunId = Annotated[str, typer.Argument(help="Id of a run, or its beginning.")]
Records = Annotated[
    Path, typer.Option("--in", parser=folder_named, help="Folder to look for the run in.")
]
Out = Annotated[str, typer.Option("--out", help="Folder for the results.")]
Readings = Annotated[
    list[str] | None,
    typer.Option(
        help="How the paper is read, as ties=right (`coartic readings`); once for each reading.",
    ),
]
Runs = Annotated[int | None, typer.Option(min=1, max=MOST_RUNS, help="Runs per cell.")]
Trials = Annotated[int | None, typer.Option(min=1, max=MOST_TRIALS, help="Trials per run.")]
Jobs = Annotated[int, typer.Option(min=-1, max=1024, help="Processes; -1 for one per core.")]
Tasks = Annotated[
    str | None, typer.Option(help="Only these tasks, a,b.", autocompletion=_completing(_tasks))
]
TasksToDraw = Annotated[
    str | None,
    typer.Option(help="Tasks to draw, a,b; all by default.", autocompletion=_completing(_tasks)),
]
Methods = Annotated[
    str | None,
    typer.Option(
        help="Only these methods, x,y.", autocompletion=_completing(_conditions, _methods)
    ),
]
Subject = Annotated[
    str,
    typer.Argument(
        help="A method, EC4 or 'optimum/*', or a task file (.toml).",
        autocompletion=_completing(_conditions, _methods),
    ),
]
TaskFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--task-file", readable=False, help="A task of your own (TOML); may be repeated."
    ),
]
MethodFiles = Annotated[
    list[Path] | None,
    typer.Option("--method-file", readable=False, help="Methods of your own (Python)."),
]
Seed = Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of the whole suite.")]
TimeLimit = Annotated[
    float | None, typer.Option(help="Seconds per run; the suite's limit by default.")
]
TrialBudget = Annotated[
    int | None,
    typer.Option(min=1, max=MOST_TRIALS, help="Most physical trials a run may make."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(help="Dask scheduler, tcp:// or tls://host:port, instead of this machine."),
]
RetryFailed = Annotated[
    bool, typer.Option("--retry-failed", help="Perform timeouts and crashes again.")
]
Redo = Annotated[
    bool, typer.Option("--redo", help="Perform every run again, also those already there.")
]
Replace = Annotated[bool, typer.Option("--replace", help="Write over a file that is there.")]


def names_in(text: str | None, option: str) -> list[str]:
    """A comma-separated list. Raises CoarticError for an empty name."""
    if text is None:
        return []
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise CoarticError(f"{option} {text!r} has an empty name; write for example a,b")
    return names


def labels_in(text: str, option: str) -> list[str]:
    """A comma-separated list of labels, in double quotes where they have commas themselves.

    Raises CoarticError for an empty one.
    """
    labels = [label.strip() for label in next(csv.reader([text], skipinitialspace=True), [])]
    if not labels or not all(labels):
        raise CoarticError(f"{option} {text!r} has an empty name; write for example a,b")
    return list(dict.fromkeys(labels))


def endings_in(text: str, known: Collection[str]) -> list[str]:
    """The endings of a report's figures, ``.svg`` among them.

    Raises CoarticError for one that is not among the ``known`` ones.
    """
    formats = [ending.removeprefix(".") for ending in known]
    names = names_in(text, "--formats")
    for name in names:
        if name not in formats:
            hint = did_you_mean(name, formats) or ";"
            raise CoarticError(
                f"--formats: figures are not written as {name!r}{hint} choose of "
                f"{', '.join(formats)}"
            )
    if "svg" not in names:
        raise CoarticError(f"--formats {text}: svg must be among them: report.md shows it")
    return [f".{name}" for name in names]


def check_numbers(jobs: int, time_limit: float | None) -> None:
    """Raises CoarticError for what the options' bounds let pass."""
    if jobs == 0:
        raise CoarticError("--jobs 0: give a number of processes, or -1 for one per core")
    if time_limit is not None and not 0 < time_limit <= MOST_SECONDS:
        raise CoarticError(
            f"--time-limit {time_limit:g}: give a number of seconds above 0, "
            f"at most {MOST_SECONDS:_}"
        )
