"""The command about families of random tasks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coartic.cli.terminal import say, show_table
from coartic.errors import CoarticError
from coartic.files import folder_named
from coartic.text import counted

if TYPE_CHECKING:
    from coartic.families import Family
    from coartic.task import Address

GROUP = "Random tasks"
_PICTURED = 12  # instances of a picture
_STREAMS = {"development": "d", "test": "i"}


def _names() -> list[str]:
    from coartic.families import families as known

    return list(known())


_Name = Annotated[
    str | None,
    typer.Argument(help="Family, as two-armed or two-armed/v1.", autocompletion=_names),
]
_Drawn = Annotated[
    int | None, typer.Option("--draw", min=1, max=1000, help="Instances to write, from 000.")
]
_Out = Annotated[Path | None, typer.Option(parser=folder_named, help="Folder for the task files.")]
_Split = Annotated[
    str, typer.Option(help="development, test, or a year: fresh instances of that year.")
]
_Count = Annotated[
    int, typer.Option(min=1, max=10_000, help="Instances that rejections are counted over.")
]


def families(
    name: _Name = None,
    draw: _Drawn = None,
    out: _Out = None,
    split: _Split = "test",
    count: _Count = 100,
) -> None:
    """List families of random tasks with their rejections, or write instances as task files."""
    from coartic.families import families as known
    from coartic.families import load_family

    if (draw is None) != (out is None) or (draw is not None and name is None):
        raise CoarticError("--draw N and --out FOLDER go together, with the name of a family")
    chosen = list(known().values()) if name is None else [load_family(name)]
    stream = _stream(split)
    if draw is not None and out is not None:
        _write(chosen[0], stream, draw, out)
        return
    show_table(
        "Families",
        ("family", "what it is", "goals", "links", "base", "also done with"),
        [
            (
                family.name,
                family.description,
                _span(family.goals),
                _span(family.links),
                ", ".join(family.base),
                ", ".join(family.restrictions) or "–",
            )
            for family in chosen
        ],
    )
    _show_rejections(chosen, stream, count)


def _show_rejections(chosen: list[Family], stream: str, count: int) -> None:
    from coartic.families import CORRECTIVE, RULES, RULES_IN_WORDS, rejections

    rules = (*RULES, CORRECTIVE)
    found = [rejections(map(str, _addresses(family, stream, count))) for family in chosen]
    show_table(
        f"Draws rejected on the way to {counted(count, 'instance')}, by the first rule broken",
        ("family", "draws", "rejected", *rules),
        [
            (family.name, str(each.draws), f"{each.rate:.1%}",
             *(str(each.by_rule[rule]) for rule in rules))
            for family, each in zip(chosen, found, strict=True)
        ],
    )  # fmt: skip
    say(*(f"{rule}: {RULES_IN_WORDS[rule]}" for rule in rules))


def _write(family: Family, stream: str, count: int, out: Path) -> None:
    from coartic.analysis.figures.plot import picture
    from coartic.analysis.figures.tasks import tasks_plot
    from coartic.families import drawn, task_hash, task_text
    from coartic.files import publish

    made = [drawn(address) for address in _addresses(family, stream, count)]
    files = {f"{each.task.name}.toml": task_text(each.task).encode() for each in made}
    shown = [each.task for each in made[:_PICTURED]]
    pictured = f"{family.name.replace('/', '.')}.svg"
    publish(out, files | {pictured: picture(tasks_plot(shown), ".svg")}, owner="families",
            alone=False)  # fmt: skip
    show_table(
        f"{family.title}, drawn",
        ("instance", "goals", "links", "base locked in", "hands", "rejected before", "hash"),
        [
            (
                each.task.name,
                str(len(each.task.goals)),
                str(each.task.robot.most_links),
                " ".join(each.task.locked_base) or "–",
                each.task.initial_hands,
                ", ".join(each.rejected) or "–",
                task_hash(each.task)[:16],
            )
            for each in made
        ],
    )
    say(f"In {out}: {counted(len(made), 'task file')}; {counted(len(shown), 'instance')} drawn in "
        f"{pictured}.")  # fmt: skip


def _addresses(family: Family, stream: str, count: int) -> list[Address]:
    from coartic.task import Address

    return [Address(family.name, stream, number) for number in range(count)]


def _stream(split: str) -> str:
    if split in _STREAMS:
        return _STREAMS[split]
    if len(split) == 4 and split.isascii() and split.isdecimal():
        return f"{split}-"
    raise CoarticError(f"--split {split}: give development, test, or a year such as 2027")


def _span(span: tuple[int, int]) -> str:
    return str(span[0]) if span[0] == span[1] else f"{span[0]} to {span[1]}"


COMMANDS = (families,)
