"""Arguments and options that several commands share, and functions that parse values."""

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
from coartic.internal.limits import MAX_TRIALS
from coartic.internal.text import BACKWARDS, unknown

if TYPE_CHECKING:
    from coartic.benchmarks.registry import Registry


def file_or_folder(metavar: str, what: str, *names: str) -> Any:
    """Make a command-line option whose value is the path of a file or folder.

    The file or folder need not exist. An empty name raises CoarticError when the command line is
    parsed. The parameters are the first three of :func:`option`.
    """
    return typer.Option(*names, parser=folder_named, metavar=metavar, help=what)


def option(metavar: str, what: str, *names: str, words: Words | None = None) -> Any:
    """Make a command-line option for a string, a number or the names of files.

    Parameters
    ----------
    metavar : str
        Name of the value in the help, such as ``N``.
    what : str
        Description of the option in the help.
    *names : str
        Flags, such as ``"--out"``. By default the flag is made from the name of the parameter of
        the command.
    words : callable, optional
        Function that returns completions of an incomplete value (:mod:`coartic.cli.completion`).

    Returns
    -------
    object
        The option, for the type hint of a parameter of the command.
    """
    return typer.Option(*names, readable=False, metavar=metavar, help=what, autocompletion=words)


def results_folder(name: str) -> Path:
    """Parse the name of a results folder (:func:`coartic.runs.shipped.results_folder`)."""
    from coartic.runs import shipped  # is slow

    return shipped.results_folder(name)


ResultsFolder = Annotated[
    Path,
    typer.Argument(
        parser=results_folder, metavar="FOLDER", help="Results folder, or the word 'shipped'."
    ),
]
Out = Annotated[Path | None, file_or_folder("FILE", "File to write.")]
Replace = Annotated[bool, typer.Option("--replace", help="Replace an existing file.")]
MethodFiles = Annotated[
    list[Path] | None, option("FILE", "Methods of your own (Python).", "--method-file")
]


def ranged_option(option: str, what: str, least: float, most: float) -> Any:
    """Make a command-line option for a number in a range.

    Parameters
    ----------
    option : str
        Flag, such as ``"--jobs"``.
    what : str
        Description of the option in the help.
    least, most : float
        Smallest and largest allowed value.
    """
    return typer.Option(option, min=least, max=most, metavar="N", help=what)


After = Annotated[
    int | None,
    ranged_option("--after", "Rank after the first N trials of each run.", 1, MAX_TRIALS),
]


def parse_run_range(text: str) -> Any:
    """Parse a number of runs, ``20``, or a range of runs, ``50..99``.

    The result is an integer or a range that includes both numbers. Any other string is returned
    unchanged, and refused later when the suite is planned. Raises CoarticError for a range whose
    second number is lower than the first.

    Examples
    --------
    >>> parse_run_range("20"), parse_run_range("50..99")
    (20, range(50, 100))
    """
    first, is_range, last = text.partition("..")
    with suppress(ValueError):
        if is_range and int(last) < int(first):
            raise CoarticError(f"--runs {BACKWARDS.format(text)}")
        return range(int(first), int(last) + 1) if is_range else int(first)
    return text


def split_names(texts: Sequence[str] | None) -> list[str]:
    """Split the values of an option at commas, and strip blanks.

    ``texts`` contains a string for each use of the option on the command line. It is None if the
    option is not used; then the result is an empty list.

    Examples
    --------
    >>> split_names(["EC1, EC4", "CMA-ES"])
    ['EC1', 'EC4', 'CMA-ES']
    """
    return [name.strip() for text in texts or () for name in text.split(",")]


def constants_in(texts: Sequence[str]) -> dict[str, Any] | None:
    """Parse strings such as ``motor_noise=0.01``, and return a dict that maps names to values.

    A value is a float or, if it is not a number, a string. The result is None if ``texts`` is
    empty. Raises CoarticError for a string without ``=``. Names and values are checked later, when
    the suite is planned.

    Examples
    --------
    >>> constants_in(["motor_noise=0.01", "norm=maximum"])
    {'motor_noise': 0.01, 'norm': 'maximum'}
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
    """Return a dict that maps the ids of built-in methods to their titles in tables.

    The dict also contains the ids of methods from files. Their titles are empty strings, and so are
    titles that are equal to the id.
    """
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
        Ids, titles, exploration conditions of the learner (``EC4``) and wildcards (``optimum/*``).
    registered : mapping of str to MethodInfo
        Dict that maps ids to all known methods.
    expand : bool
        True to replace each wildcard by the ids that match it. If False, a wildcard that matches
        more than one id is returned unchanged.

    Returns
    -------
    list of str
        Ids, and wildcards that are not replaced, in the order of ``names``. The ids that match a
        wildcard are in the order of ``registered``.

    Raises
    ------
    CoarticError
        A name is unknown, or is the name of something that is not a method.
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
    """Raise CoarticError for a method file whose methods the command does not use.

    Parameters
    ----------
    method_files : sequence of Path or None
        Files of option ``--method-file``; None if the option is not used.
    registered : mapping of str to MethodInfo
        Dict that maps ids to all known methods.
    methods : iterable of str
        Ids of the methods that the command uses.
    """
    used = {registered[name].where for name in methods if name in registered}
    for path in method_files or ():
        if str(path.resolve()) not in used:
            raise CoarticError(
                f"--method-file {path} has no effect: the command uses none of its methods"
            )


def file_name(method: str) -> str:
    """Return the default file name of ``coartic new`` for the id of a method.

    The name without ``.py`` is a valid name of a Python module, and is not ``coartic``, ``numpy``
    or the name of a module of the standard library.

    Examples
    --------
    >>> file_name("my-search"), file_name("random")
    ('my_search.py', 'my_random.py')
    """
    stem = re.sub(r"\W", "_", method)
    reserved = {*keyword.kwlist, *sys.stdlib_module_names, "coartic", "numpy"}
    return f"{stem if stem.isidentifier() and stem not in reserved else f'my_{stem}'}.py"
