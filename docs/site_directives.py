"""Parts of the reference that are made of the code's own tables, so that they cannot differ."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import SphinxDirective


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """A table of Markdown."""
    yield "| " + " | ".join(heads) + " |"
    yield "| " + " | ".join("---" for _ in heads) + " |"
    for row in rows:
        yield "| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) + " |"
    yield ""


def attribute_words(module: str, owner: str) -> dict[str, str]:
    """What the docstrings of a class's attributes say."""
    words = ModuleAnalyzer.for_module(module).find_attr_docs()
    return {name: " ".join(text).strip() for (of, name), text in words.items() if of == owner}


def code(text: Any) -> str:
    """As code, where there is any."""
    return f"`{text}`" if str(text) else ""


def commands() -> Iterator[str]:
    """Every command with its arguments and options, as typer has them."""
    import typer

    from coartic.cli import app

    context = typer.Context(typer.main.get_command(app), info_name="coartic")
    for name, command in context.command.commands.items():  # type: ignore[attr-defined]
        yield from (f"## coartic {name}", "", command.help or "", "")
        own = typer.Context(command, parent=context, info_name=name)
        usage = " ".join(command.collect_usage_pieces(own))
        yield from ("```text", f"coartic {name} {usage}", "```", "")
        records = (parameter.get_help_record(own) for parameter in command.params)
        rows = [(code(shown), said) for shown, said in filter(None, records)]
        if rows:
            yield from table(("argument or option", "what it is"), rows)


def information() -> Iterator[str]:
    """What a method can be told, with the letters of the tables."""
    from coartic.analysis.comparisons.methods import TOLD
    from coartic.method import METERED, Information

    words = attribute_words("coartic.method", "Information")
    yield from table(
        ("letter", "what", "meaning", "seen being used"),
        (
            (
                f"**{TOLD[item]}**",
                item.value,
                words[item.name],
                "yes" if item in METERED else "stated",
            )
            for item in Information
        ),
    )


def methods() -> Iterator[str]:
    """Every built-in method: what it is told, whether its seed matters, its source."""
    from coartic.analysis.comparisons.methods import TOLD
    from coartic.benchmarks.registry import CLASSES
    from coartic.method import Information

    def told(method: Any) -> str:
        return " ".join(TOLD[item] for item in Information if item in method.told)

    yield from table(
        ("method", "what it is", "told", "runs", "source"),
        (
            (code(name), method.title, told(method), "many" if method.stochastic else "one",
             method.citation)
            for name, method in CLASSES.items()
        ),
    )  # fmt: skip


def parameters() -> Iterator[str]:
    """Parameters of every built-in method with their defaults; methods that share them once."""
    from coartic.benchmarks.registry import CLASSES

    shared: dict[Any, list[str]] = {}
    for name, method in CLASSES.items():
        shared.setdefault(method.Parameters, []).append(name)
    for kind, names in shared.items():
        fields = kind.model_fields
        yield from (", ".join(map(code, names)), "")
        if not fields:
            yield from ("None.", "")
            continue
        words: dict[str, str] = {}
        for owner in reversed(kind.__mro__):
            if owner.__module__.startswith("coartic"):
                words |= attribute_words(owner.__module__, owner.__name__)
        yield from table(
            ("parameter", "default", "meaning"),
            ((code(name), code(field.default), words.get(name) or field.description or "")
             for name, field in fields.items()),
        )  # fmt: skip


def conditions() -> Iterator[str]:
    """Exploration conditions and variants, as the learner takes them."""
    from dataclasses import fields

    from coartic import CONDITIONS, VARIANTS

    every = {**CONDITIONS, **VARIANTS}
    names = [field.name for field in fields(next(iter(every.values())))]
    yield from table(
        ("condition", "what differs from the first"),
        (
            (code(name), ", ".join(
                f"`{field} = {getattr(condition, field)}`" for field in names
                if field != "id" and (
                    name == next(iter(every))
                    or getattr(condition, field) != getattr(next(iter(every.values())), field)
                )
            ))
            for name, condition in every.items()
        ),
    )  # fmt: skip


def suites() -> Iterator[str]:
    """The suites that are shipped."""
    from coartic.benchmarks.suites import SUITE_FOLDER, load_suite

    loaded = [load_suite(path.stem) for path in sorted(SUITE_FOLDER.glob("*.toml"))]
    yield from table(
        ("suite", "what it is", "runs a cell", "trials"),
        (
            (code(s.name), f"{s.title}. {s.description}", str(s.runs), str(s.trials or ""))
            for s in loaded
        ),
    )


def tasks() -> Iterator[str]:
    """The tasks that are shipped by name."""
    from coartic import builtin_tasks, load_task

    loaded = [load_task(name) for name in builtin_tasks()]
    yield from table(
        ("task", "what it is", "goals", "hands", "base locked in", "not printed"),
        (
            (code(t.name), t.description or t.title,
             " ".join(f"({x:g}, {y:g})" for x, y in t.goals),
             ", ".join(t.hands), ", ".join(t.locked_base) or "nothing",
             ", ".join(t.reconstructed) or "nothing")
            for t in loaded
        ),
    )  # fmt: skip


def readings() -> Iterator[str]:
    """What the paper leaves open: every reading with its alternatives."""
    import coartic

    path = Path(coartic.__file__).with_name("readings.toml")
    for name, reading in tomllib.loads(path.read_text(encoding="utf-8")).items():
        yield from _reading(name, reading)


def _reading(name: str, reading: Any) -> Iterator[str]:
    def said(choice: Any) -> str:
        return f"`{choice['value']}`, {choice['says']}"

    yield from (f"**`{name}`** (`{reading['parameter']}`). {reading['question']}", "")
    if "quote" in reading:
        yield from (f"“{reading['quote']}” ({reading['place']})", "")
    yield f"- default: {said(reading['default'])}"
    for choice in reading["alternatives"]:
        yield f"- {'as printed' if choice.get('printed') else 'or'}: {said(choice)}"
    yield from ("", reading["why"], "")


def fields(module: str, owner: str) -> Iterator[str]:
    """Keys of a file, as its model checks them."""
    import dataclasses
    import importlib

    model = getattr(importlib.import_module(module), owner)
    words = attribute_words(module, owner)
    if dataclasses.is_dataclass(model):
        rows = [(f.name, f.default) for f in dataclasses.fields(model)]
    else:
        rows = [
            (name, "required" if f.is_required() else f.get_default(call_default_factory=True))
            for name, f in model.model_fields.items()
        ]
    yield from table(
        ("key", "default", "meaning"),
        ((code(name), code(default), words.get(name, "")) for name, default in rows),
    )


class Made(SphinxDirective):
    """``{made} methods``: what a function of this file gives, as Markdown."""

    required_arguments = 1
    optional_arguments = 2

    def run(self) -> list[nodes.Node]:
        """The nodes in its place."""
        function, *arguments = self.arguments
        return self.parse_text_to_nodes(
            "\n".join(globals()[function](*arguments)), allow_section_headings=True
        )


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("made", Made)
    return {"parallel_read_safe": True}
