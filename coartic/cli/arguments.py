"""Arguments and options of several commands, and the names that users may write in them."""

from __future__ import annotations

import keyword
import os
import re
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.internal.text import unknown

if TYPE_CHECKING:
    from coartic.benchmarks.registry import Registry


def file_or_folder(metavar: str, what: str, *names: str) -> Any:
    """Return a command-line option for the name of a file or folder, which need not exist, read as
    a Path. Its flags are ``names``, or follow from its parameter; ``metavar`` names its value in
    the help, ``what`` is its help. An empty or impossible name raises CoarticError."""
    return typer.Option(*names, parser=folder_named, metavar=metavar, help=what)


def option(metavar: str, what: str, *names: str) -> Any:
    """Return a command-line option for text, or for names of files that are read later, with help
    ``what`` and flags ``names`` (without any, a flag from its parameter); ``metavar`` names its
    value in the help."""
    return typer.Option(*names, readable=False, metavar=metavar, help=what)


ResultsFolder = Annotated[
    Path, typer.Argument(parser=folder_named, metavar="FOLDER", help="Results folder.")
]
Out = Annotated[Path | None, file_or_folder("FILE", "File to write.")]
Replace = Annotated[bool, typer.Option("--replace", help="Write over a file that is there.")]
MethodFiles = Annotated[
    list[Path] | None, option("FILE", "Methods of your own (Python).", "--method-file")
]


def within(option: str, what: str, least: float, most: float) -> Any:
    """Return a command-line option, with the flag ``option`` and the help ``what``, for a number
    from ``least`` to ``most``."""
    return typer.Option(option, min=least, max=most, metavar="N", help=what)


def runs_named(text: str) -> Any:
    """Return the number of runs, or their range, that ``20`` or ``50..99``, both ends included,
    stands for; any other text is returned unchanged, for the plan to refuse."""
    first, is_range, last = text.partition("..")
    with suppress(ValueError):
        return range(int(first), int(last) + 1) if is_range else int(first)
    return text


def names_in(text: str | None) -> list[str]:
    """Return the names, also empty names, between the commas of ``text``, without blanks around
    them; an empty list for None."""
    return [] if text is None else [name.strip() for name in text.split(",")]


def method_titles(registered: Registry) -> dict[str, str]:
    """Return the title of each registered method by id, such as ``CMA-ES``; empty where it is the
    id."""
    from coartic.analysis.methods import title_of

    titles = {name: title_of(name) for name in registered}
    return {name: title if title != name else "" for name, title in titles.items()}


def methods_meant(names: Sequence[str], registered: Registry, *, expand: bool = True) -> list[str]:
    """Return the ids of the methods that users name by ids, titles, conditions (``EC4``) and
    wildcards (``optimum/*``); without ``expand`` a wildcard for several methods is returned
    unchanged. Raises CoarticError for an unknown name."""
    from coartic.benchmarks.registry import methods_named
    from coartic.benchmarks.suites import check_kind
    from coartic.learner.conditions import EVERY_CONDITION

    titles, meant = method_titles(registered) if names else {}, list[str]()
    ids = {title: name for name, title in titles.items() if title}
    for name in names:
        try:
            found = methods_named(ids.get(name, name), registered)
        except CoarticError:
            check_kind(name)  # a thing of another kind has its own sentence
            if os.path.isfile(file := file_name(name)):
                words = f"method {name!r} is not known: add --method-file {file}"
                raise CoarticError(f"{words}, if it is defined there") from None
            known = [*titles, *EVERY_CONDITION, *ids]
            raise CoarticError(unknown("method", name, known)) from None
        meant += found if expand or len(found) == 1 else [name]
    return meant


def check_used(
    method_files: Sequence[Path] | None, registered: Registry, methods: Iterable[str]
) -> None:
    """Raise CoarticError if a file of ``method_files`` defines none of the ids ``methods``."""
    used = {registered[name].where for name in methods if name in registered}
    for path in method_files or ():
        if str(path.resolve()) not in used:
            raise CoarticError(
                f"--method-file {path} has no effect: none of its methods is asked for"
            )


def file_name(method: str) -> str:
    """Return the name of the file that ``coartic new``, without ``--out``, writes for the id of a
    method: a file that Python can import, and that hides no standard module, coartic or NumPy."""
    stem = re.sub(r"\W", "_", method)
    taken = {*keyword.kwlist, *sys.stdlib_module_names, "coartic", "numpy"}
    return f"{stem if stem.isidentifier() and stem not in taken else f'my_{stem}'}.py"
