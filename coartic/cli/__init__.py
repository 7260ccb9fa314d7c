"""The command line ``coartic``.

Each command is a function in :mod:`~coartic.cli.run` or :mod:`~coartic.cli.read`. A command imports
most of the packages that it needs only when it is called, so that help and completion are fast.
"""

from __future__ import annotations

import contextlib
import io
import logging
import os
import sys
import warnings
from typing import Annotated

import typer

import coartic
from coartic.cli import read, run
from coartic.cli.terminal import complain
from coartic.errors import CoarticError
from coartic.internal.text import MAX_LINE_LENGTH, plain

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Comparative benchmark of coarticulation in motor skill acquisition.",
)


def _version(wanted: bool) -> None:
    if wanted:
        print(f"coartic {coartic.__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    pass


COMMANDS = (
    (read.play, "two-armed-1 --out play.html"),
    (run.list_, "comparison"),
    (run.run, "comparison --methods EC1,CMA-ES --runs 5 --out results"),
    (read.report, "results/quick --for-paper"),
    (read.verify, "results/quick --run 1a2b3c"),
    (run.new, "my-search"),
    (run.check, "my-search --method-file my_search.py"),
    (read.draw, "results/quick --run 1a2b3c --initial --out race.gif"),
    (read.cite, "results/comparison --analysis"),
)
"""Functions of the commands in the order of the help, each with the arguments of its example."""
for command, example in COMMANDS:
    name = command.__name__.removesuffix("_")
    # Without \b the help would wrap the command.
    app.command(name=name, epilog=f"\b\nExample: coartic {name} {example}")(command)


def main() -> None:
    """Run the command line, and exit.

    The exit code is

    - 0 after success;
    - 1 if the command found something wrong, after an error of the system, or after a bug;
    - 2 after a CoarticError or wrong usage.

    After a signal, :func:`.end_if_interrupted` exits with another code.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # closed; otherwise a file would get its number
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
            os.set_inheritable(getattr(sys, name).fileno(), True)
    if "_COARTIC_COMPLETE" in os.environ:  # for a shell, which shows errors within the command line
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # also for help and messages of libraries
            stream.reconfigure(errors="replaced")
    warnings.showwarning = lambda message, *_, **__: complain("Warning", str(message))
    logging.getLogger("coartic").setLevel(logging.INFO)
    logging.getLogger("coartic").addHandler(logging.StreamHandler())
    os.environ["MPLBACKEND"] = "agg"  # figures are written, never shown
    if os.path.lexists("matplotlibrc"):  # this file can name programs to run: do not read it
        with contextlib.chdir(os.path.dirname(__file__)):
            import matplotlib  # noqa: F401
    if sys.argv[1:2] == ["help"]:
        sys.argv[1:] = [*sys.argv[2:], "--help"]
    try:
        app(prog_name="coartic")
    except CoarticError as error:
        complain("Error", str(error))
        sys.exit(2)
    except BrokenPipeError:  # the reader, such as head, has ended: typer exits without a message
        raise
    except OSError as error:
        file = f": {plain(str(error.filename), MAX_LINE_LENGTH)}" if error.filename else ""
        complain("Error", f"{error.strerror or error}{file}")
        sys.exit(1)
