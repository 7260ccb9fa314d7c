"""Arguments and options that commands share, and the names that users may write in them."""

from __future__ import annotations

import keyword
import os
import re
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import typer

from coartic.cli.completion import Words
from coartic.errors import CoarticError
from coartic.internal.files import folder_named
from coartic.internal.text import BACKWARDS, unknown

if TYPE_CHECKING:
    from coartic.benchmarks.registry import Registry


def file_or_folder(metavar: str, what: str, *names: str) -> Any:
    """Make a command-line option for a file or folder, which need not exist.

    Its value is a Path. An empty name raises CoarticError. Parameters are those of :func:`option`.
    """
    return typer.Option(*names, parser=folder_named, metavar=metavar, help=what)


def option(metavar: str, what: str, *names: str, words: Words | None = None) -> Any:
    """Make a command-line option for a string, a number, or files that are read later.

    Parameters
    ----------
    metavar : str
        Name of the value in the help.
    what : str
        Help.
    *names : str
        Flags; by default a flag with the name of the parameter.
    words : callable, optional
        Function that completes the value (:mod:`coartic.cli.completion`).
    """
    return typer.Option(*names, readable=False, metavar=metavar, help=what, autocompletion=words)


ResultsFolder = Annotated[
    Path, typer.Argument(parser=folder_named, metavar="FOLDER", help="Results folder.")
]
Out = Annotated[Path | None, file_or_folder("FILE", "File to write.")]
Replace = Annotated[bool, typer.Option("--replace", help="Replace an existing file.")]
MethodFiles = Annotated[
    list[Path] | None, option("FILE", "Methods of your own (Python).", "--method-file")
]


def ranged_option(option: str, what: str, least: float, most: float) -> Any:
    """Make a command-line option, with the flag ``option``, for a number in a range."""
    return typer.Option(option, min=least, max=most, metavar="N", help=what)


def parse_run_range(text: str) -> Any:
    """Parse a number of runs, such as ``20``, or a range with both ends, such as ``50..99``.

    Any other string is returned unchanged; the plan refuses it. Raises CoarticError for a range
    that goes backwards.
    """
    first, is_range, last = text.partition("..")
    with suppress(ValueError):
        if is_range and int(last) < int(first):
            raise CoarticError(f"--runs {BACKWARDS.format(text)}")
        return range(int(first), int(last) + 1) if is_range else int(first)
    return text


def split_names(texts: Sequence[str] | None) -> list[str]:
    """Split the values of an option at commas, and strip blanks.

    None (the option was not given) gives an empty list.
    """
    return [name.strip() for text in texts or () for name in text.split(",")]


def constants_in(texts: Sequence[str]) -> dict[str, Any] | None:
    """Parse texts such as ``motor_noise=0.01``: a dict that maps constants to values.

    Return None if there are no texts. Raises CoarticError for a text without ``=``; the plan checks
    names and values.
    """
    constants = dict[str, Any]()
    for text in texts:
        name, is_pair, value = (part.strip() for part in text.partition("="))
        if not is_pair:
            raise CoarticError(
                f"--model {text!r} has no value: write a constant with its value, such as "
                "motor_noise=0.01"
            )
        constants[name] = value
        with suppress(ValueError):
            constants[name] = float(value)
    return constants or None


def method_titles(registered: Registry) -> dict[str, str]:
    """Return a dict that maps ids of methods to titles; a missing title is ``""``."""
    from coartic.analysis.methods import title_of

    titles = {name: title_of(name) for name in registered}
    return {name: title if title != name else "" for name, title in titles.items()}


def resolve_methods(
    names: Sequence[str], registered: Registry, *, expand: bool = True
) -> list[str]:
    """Return the ids of the methods that a user names.

    Parameters
    ----------
    names : sequence of str
        Ids, titles, conditions of the learner (``EC4``) and wildcards (``optimum/*``).
    registered : mapping
        Known methods by id.
    expand : bool
        False to return a wildcard for more than one method unchanged.

    Returns
    -------
    list of str

    Raises
    ------
    CoarticError
        A name is unknown.
    """
    from coartic.benchmarks.registry import methods_named
    from coartic.benchmarks.suites import check_kind
    from coartic.learner.conditions import EVERY_CONDITION

    titles, methods = method_titles(registered) if names else {}, list[str]()
    ids = {title: name for name, title in titles.items() if title}
    for name in names:
        try:
            matches = methods_named(ids.get(name, name), registered)
        except CoarticError:
            check_kind(name)  # has a better message for a thing of another kind
            if os.path.isfile(file := file_name(name)):
                raise CoarticError(
                    f"method {name!r} is unknown: if {file} defines it, add "
                    f"`--method-file {quote(file)}`"
                ) from None
            known = [*titles, *EVERY_CONDITION, *ids]
            raise CoarticError(unknown("method", name, known)) from None
        methods += matches if expand or len(matches) == 1 else [name]
    return methods


def check_used(
    method_files: Sequence[Path] | None, registered: Registry, methods: Iterable[str]
) -> None:
    """Raise CoarticError if a method file defines none of the methods that are used."""
    used = {registered[name].where for name in methods if name in registered}
    for path in method_files or ():
        if str(path.resolve()) not in used:
            raise CoarticError(
                f"--method-file {path} has no effect: the command uses none of its methods"
            )


def file_name(method: str) -> str:
    """Return the default file name of ``coartic new`` for the id of a method.

    Python can import the file, and its name is not that of a standard module, coartic or NumPy.
    """
    stem = re.sub(r"\W", "_", method)
    reserved = {*keyword.kwlist, *sys.stdlib_module_names, "coartic", "numpy"}
    return f"{stem if stem.isidentifier() and stem not in reserved else f'my_{stem}'}.py"
