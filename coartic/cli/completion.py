"""Complete names on the command line: suites, tasks, methods, and ids of runs.

When the user presses Tab, the shell starts coartic, which calls one of these functions with the
incomplete word. The function returns a list of words. Typer offers those of them that begin with
the incomplete word; if there are none, the shell offers files. To be fast, the functions import
neither pandas nor Numba.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import typer

import coartic

Words = Callable[[str], list[str]]
"""Function that returns a list of completions for an incomplete word."""
_PACKAGE = Path(coartic.__file__).parent


def suites(incomplete: str = "") -> list[str]:
    """Return the names of the shipped suites."""
    return sorted(path.stem for path in (_PACKAGE / "benchmarks" / "suites").glob("*.toml"))


def tasks(incomplete: str = "") -> list[str]:
    """Return the names of the shipped tasks, and of an instance of each shipped family.

    The instance is ``i000``, the first test instance.
    """
    files = sorted((_PACKAGE / "tasks" / "paper").glob("*.toml"))
    return [
        *(path.stem.partition("-")[2] for path in files),  # such as 1-ascending
        *(f"{family}/i000" for family in families()),
    ]


def families(incomplete: str = "") -> list[str]:
    """Return the names of the shipped families."""
    files = sorted((_PACKAGE / "tasks" / "families").glob("*.toml"))
    return [path.stem.replace(".", "/") for path in files]


def methods(incomplete: str = "") -> list[str]:
    """Return names of the built-in methods: exploration conditions, titles and ids.

    The condition ``custom`` and titles with a blank are left out.
    """
    from coartic.method import built_in_methods

    known = built_in_methods()
    conditions = [name.partition("dual-process/")[2] for name in known]
    titles = [method.title for method in known.values() if " " not in method.title]
    return [name for name in (*conditions, *titles, *known) if name not in ("", "custom")]


def names(incomplete: str = "") -> list[str]:
    """Return the names of the shipped suites, tasks and families, and of the built-in methods."""
    return [*suites(), *tasks(), *families(), *methods()]


def after_commas(words: Words) -> Words:
    """Return a function that completes the last word of a comma-separated list.

    ``words`` is the function that returns the completions of a single word.
    """

    def complete(incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        return [f"{before}{comma}{word}" for word in words(last)]

    return complete


def runs(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the ids of stored runs that begin with the incomplete word.

    The runs are all those in the results folder that is named on the command line. The result is
    empty if no folder is named yet. Raises CoarticError if the folder cannot be read.
    """
    from coartic.runs.shipped import open_results, results_folder

    # The folder is not parsed yet, because the option before the incomplete word lacks its value.
    for folder in ctx.args[:1]:
        with open_results(results_folder(folder)) as store:
            return store.ids(incomplete)
    return []
