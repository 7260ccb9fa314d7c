"""The command about what the paper does not print."""

from __future__ import annotations

import typer

from coartic.cli.terminal import say_pairs

group = typer.Typer(
    no_args_is_help=True,
    help="Study what the paper leaves open.",
)


@group.callback()
def _group() -> None:
    pass


@group.command("readings")
def list_readings() -> None:
    """List how the paper can be read."""
    from coartic.tasks.readings import readings

    for reading in readings():
        others = ", ".join(choice.written for choice in reading.alternatives)
        question = " ".join(reading.question.split())
        say_pairs([(reading.id, f"{question} {reading.default.written}; or {others}")])
