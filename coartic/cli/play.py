"""The command that opens the figure to play with."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.terminal import say


def play(
    task: Annotated[
        str | None,
        typer.Argument(metavar="TASK", help="Task to begin with, or a task file (.toml)."),
    ] = None,
    out: given.Out = None,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open it in the browser.")] = True,
    replace: given.Replace = False,
) -> None:
    """Move goals and watch the learner learn, in the browser."""
    import webbrowser

    from coartic import load_task
    from coartic.files import write_output
    from coartic.play.page import play_page

    chosen = [] if task is None else given.tasks_meant([task])
    page = play_page(*map(load_task, chosen)).encode()
    if out is None:
        with tempfile.NamedTemporaryFile(suffix=".html", prefix="coartic-", delete=False) as file:
            file.write(page)
        out = Path(file.name)
    else:
        write_output(out, page, replace=replace)
    opened = show and webbrowser.open(out.absolute().as_uri())
    say(f"{out}: {len(page) // 1000} kB" + ("." if opened else "; open it in a browser."))
