"""The command line, called as a user would, in this process."""

import sys
from functools import cache

import typer

from coartic import cli

APP = cli.app


@cache
def ready():
    """All commands, put together once."""
    return typer.main.get_command(APP)


def call(monkeypatch, capsys, *arguments):
    """Exit code, standard output, standard error."""
    monkeypatch.setattr(sys, "argv", ["coartic", *map(str, arguments)])
    monkeypatch.setattr(cli, "app", ready())
    try:
        cli.main()
        code = 0
    except SystemExit as stop:
        code = stop.code or 0
    captured = capsys.readouterr()
    return code, captured.out, captured.err
