"""Commands that put results beside results, and hand them on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.terminal import say, say_pairs
from coartic.files import folder_named
from coartic.text import counted


def merge(
    folders: Annotated[
        list[Path],
        typer.Argument(parser=folder_named, metavar="FOLDER...", help="Results folders."),
    ],
    out: given.OutFolder,
) -> None:
    """Join results folders of one suite into a new one."""
    from coartic.benchmarks.merge import merge as join_folders

    merged = join_folders(folders, out)
    repeats = f" ({merged.repeats} of them in more than one folder)" if merged.repeats else ""
    say(f"{merged.folder}: {counted(merged.runs, 'run')}{repeats}, each scored again.")
    say_pairs([("Next", f"coartic report {merged.folder}")])
