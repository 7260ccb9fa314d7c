"""Arguments and options that several commands have, and the names that may stand in them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.internal.limits import check_limits

if TYPE_CHECKING:
    from coartic.benchmarks.registry import Registry


def path(what: str, metavar: str, *names: str) -> Any:
    """An option that is a file or a folder."""
    return typer.Option(*names, parser=folder_named, metavar=metavar, help=what)


Results = Annotated[
    Path, typer.Argument(parser=folder_named, metavar="FOLDER", help="Results folder.")
]
In = Annotated[Path, path("Where to look for the run.", "FOLDER", "--in")]
Out = Annotated[Path | None, path("File to write.", "FILE")]
Replace = Annotated[bool, typer.Option("--replace", help="Write over a file that is there.")]
MethodFiles = Annotated[
    list[Path] | None,
    typer.Option(
        "--method-file", readable=False, metavar="FILE", help="Methods of your own (Python)."
    ),
]


def within(option: str, what: str, least: float, most: float, unit: str = "N") -> Any:
    """An option that is a number from ``least`` to ``most``, a whole one where ``least`` is an int.
    Raises CoarticError for anything else when it is read."""

    def read(text: str) -> Any:
        value: Any = text
        for kind in (float, int):
            with suppress(ValueError):
                value = kind(text)
        try:
            check_limits(option, value, least, most)
        except ValueError as error:
            raise CoarticError(str(error)) from None
        return value

    return typer.Option(option, parser=read, metavar=unit, help=what)


def listed(text: str | None) -> list[str]:
    """Return the names that an option has between commas."""
    return [] if text is None else [name.strip() for name in text.split(",")]


def id_named(name: str, names: Mapping[str, str]) -> str:
    """The id of what people call so, in small letters or large; ``name`` itself for none.

    ``names`` are people's names by id; an id goes before a name.
    """
    called = {words.casefold(): each for each, words in names.items() if words}
    ids = {each.casefold(): each for each in names}
    return name if name in names else (called | ids).get(name.casefold(), name)


def tasks_meant(names: Sequence[str]) -> list[str]:
    """Tasks by their ids, where people's names for them may stand; other names as they are."""
    from coartic import builtin_tasks, load_task

    known = {name: load_task(name).label for name in builtin_tasks()}
    return [id_named(name, known) for name in names]


def method_names(registered: Registry) -> Mapping[str, str]:
    """People's names of methods by id, empty where they have none."""
    from coartic.analysis.methods import title_of
    from coartic.learner.conditions import ABLATIONS, CONDITIONS

    names = {name: title_of(name) for name in registered}
    named = {name: words if words != name else "" for name, words in names.items()}
    return named | dict.fromkeys((*CONDITIONS, *ABLATIONS), "")


def methods_meant(names: Sequence[str], registered: Registry) -> list[str]:
    """Methods by their ids, where people's names for them and wildcards may stand.

    Raises CoarticError for an unknown name.
    """
    from coartic.benchmarks.registry import methods_named
    from coartic.benchmarks.suites import check_kind

    ids, meant = method_names(registered) if names else {}, list[str]()
    for name in names:
        try:
            meant += methods_named(id_named(name, ids), registered)
        except CoarticError:
            check_kind(name)  # or it is nothing else
            if Path(file := file_name(name)).is_file():
                words = f"method {name!r} is not known: add --method-file {file}"
                raise CoarticError(f"{words}, if it is defined there") from None
            raise
    return meant


def file_name(method: str) -> str:
    """The name of the file that ``coartic new`` writes for a method."""
    return re.sub(r"\W", "_", method) + ".py"
