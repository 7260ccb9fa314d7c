"""The command that begins something of one's own."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from coartic.cli import arguments as given
from coartic.cli.terminal import say_pairs
from coartic.errors import CoarticError


def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Its id, such as my-search.")],
    out: given.Out = None,
    replace: given.Replace = False,
) -> None:
    """Write a method of your own: ten lines that work, to be changed."""
    from coartic.benchmarks import template
    from coartic.benchmarks.reader import check_declaration
    from coartic.benchmarks.registry import add_cards, registry
    from coartic.files import write_output
    from coartic.runs.card import card_of

    path = Path(re.sub(r"\W", "_", name) + ".py") if out is None else out
    if path.suffix != ".py":
        raise CoarticError(f"--out {path}: the name must end in .py.")
    mine = type("Mine", (template.Mine,), {"name": name})
    check_declaration(mine, "coartic new")
    add_cards(registry(), [card_of(mine, "coartic new", "", "")])
    text = Path(template.__file__).read_text(encoding="utf-8").replace("NAME", name)
    write_output(path, text.encode(), replace=replace)
    say_pairs(
        [
            ("Written", f"{path}: change it as you like"),
            ("Check", f"coartic check {name} --method-file {path}"),
            (
                "Run",
                f"coartic run comparison --method-file {path} --beside shipped --out results/mine",
            ),
        ]
    )
