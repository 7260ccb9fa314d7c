"""Parts of the reference that are made of the code's own tables, so that they cannot differ."""

from __future__ import annotations

import dataclasses
import importlib
import json
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.util import inspect
from sphinx.util.docutils import SphinxDirective

from coartic.families import Parts

_IN_PARTS = get_args(Parts)[1]  # what reads a figure into thousandths
_MANY = {"number": "numbers", "integer": "integers"}
LONGEST_DEFAULT = 60
"""Characters of one that is shown in a table."""


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


def add_meanings() -> None:
    """Let ``meanings.toml`` stand for docstrings. Raises KeyError for what is no class's field."""
    path = Path(__file__).with_name("meanings.toml")
    for owner, said in tomllib.loads(path.read_text(encoding="utf-8")).items():
        module, _, name = owner.rpartition(".")
        known = hints(getattr(importlib.import_module(module), name))
        docs = ModuleAnalyzer.for_module(module).find_attr_docs()
        for key, meaning in said.items():
            if key not in known:
                raise KeyError(f"{path.name}: {owner} has no field {key}")
            docs[name, key] = [meaning, ""]


def meanings_of(model: type) -> dict[str, str]:
    """What every field of a model means."""
    words: dict[str, str] = {}
    for owner in reversed(model.__mro__):
        if owner.__module__.startswith("coartic"):
            words |= attribute_words(owner.__module__, owner.__qualname__)
    return words


def hints(model: Any) -> dict[str, Any]:
    """Annotations of a model's fields, with all that they are annotated with."""
    fields = model.__pydantic_fields__.items()
    return {name: Annotated[f.annotation, *f.metadata, None] for name, f in fields}


def bare(kind: Any) -> Any:
    """A type without what it is annotated with."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return bare(parts[0])
    if origin in (tuple, dict):
        return origin[tuple(map(bare, parts))]
    if origin in (Union, UnionType):
        return Union[tuple(map(bare, parts))]  # noqa: UP007
    return kind


def values(kind: Any) -> str:
    """What a value may be, in words of TOML."""
    parts = get_args(kind)
    match get_origin(kind):
        case origin if origin is Annotated:
            return "number" if _IN_PARTS in parts else values(parts[0])
        case origin if origin is Literal:
            return " or ".join(f"`{toml(value)}`" for value in parts)
        case origin if origin in (Union, UnionType):
            kinds = dict.fromkeys(values(part) for part in parts if part is not NoneType)
            return " or ".join(kinds)
        case origin if origin is tuple and parts[-1] is ...:
            inner = values(parts[0])
            return "tables" if inner == "table" else f"list of {_MANY.get(inner, inner)}"
        case origin if origin is tuple:
            return f"[{', '.join(map(values, parts))}]"
        case origin if origin is dict:
            inner = values(parts[1])
            return "tables" if inner == "table" else f"table of {inner}"
    simple = {bool: "`true` or `false`", int: "integer", float: "number", str: "text"}
    return simple.get(kind, "table")


def in_parts(kind: Any) -> bool:
    """Whether figures are kept in thousandths of what a file says (coartic.families)."""
    parts = get_args(kind)
    return _IN_PARTS in parts or any(map(in_parts, parts))


def toml(value: Any, kind: Any = None) -> str:
    """A value as a file says it; thousandths as what they are thousandths of."""
    if hasattr(value, "__pydantic_fields__"):
        of = hints(type(value))
        fields = {name: getattr(value, name) for name in type(value).__pydantic_fields__}
        inner = (f"{name} = {toml(item, of[name])}" for name, item in fields.items())
        return "{ " + ", ".join(inner) + " }"
    match value:
        case dict():
            inner = (f"{name} = {toml(item)}" for name, item in value.items())
            return "{ " + ", ".join(inner) + " }" if value else "{}"
        case tuple() | list():
            return "[" + ", ".join(toml(item, kind) for item in value) + "]"
        case bool() | str():
            return json.dumps(value, ensure_ascii=False)
        case int() if in_parts(kind):
            return repr(value / 1000)
    return repr(value)


def default_of(value: Any, kind: Any) -> str:
    """For a table: as TOML; what is too long for it stands in a table of its own."""
    if value is None:
        return "none"
    text = toml(value, kind)
    return f"`{text}`" if len(text) <= LONGEST_DEFAULT else "as below"


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
    from coartic.dual_process import DualProcessParameters
    from coartic.readings import readings

    condition = attribute_words("coartic.exploration", "ExplorationCondition")
    read = {
        reading.field: f"{condition[reading.field]} ([Reading](#readings) `{reading.id}`.)"
        for reading in readings()
        if reading.part == "condition"
    }
    shared: dict[Any, list[str]] = {}
    for name, method in CLASSES.items():
        shared.setdefault(method.Parameters, []).append(name)
    for kind, names in shared.items():
        yield from (", ".join(map(code, names)), "")
        if not kind.model_fields:
            yield from ("None.", "")
            continue
        words = meanings_of(kind)
        if issubclass(kind, DualProcessParameters):
            words |= read
        yield from table(("parameter", "default", "values", "meaning"), rows_of(kind, words))


def rows_of(model: Any, words: dict[str, str], but: str = "") -> Iterator[Sequence[str]]:
    """Of a table of a model's fields. Raises KeyError for one without a meaning."""
    of = hints(model)
    defaults = {
        name: ... if f.is_required() else f.get_default(call_default_factory=True)
        for name, f in model.__pydantic_fields__.items()
    }
    for name, default in defaults.items():
        if name != but:
            if name not in words:
                raise KeyError(f"{model.__name__}.{name}: neither docstring nor meanings.toml")
            shown = "required" if default is ... else default_of(default, of[name])
            yield code(name), shown, values(of[name]), words[name]


def conditions() -> Iterator[str]:
    """Exploration conditions and variants, as the learner takes them."""
    from coartic import CONDITIONS, VARIANTS

    every = {**CONDITIONS, **VARIANTS}
    first = next(iter(every.values()))
    names = [field.name for field in dataclasses.fields(first)]
    yield from table(
        ("condition", "what differs from the first"),
        (
            (code(name), ", ".join(
                f"`{field} = {toml(getattr(condition, field))}`" for field in names
                if field != "id" and (
                    condition is first or getattr(condition, field) != getattr(first, field)
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


def fields(module: str, owner: str, but: str = "") -> Iterator[str]:
    """Keys of a file, as its model checks them; ``but``: one that no file has."""
    model = getattr(importlib.import_module(module), owner)
    yield from table(
        ("key", "default", "values", "meaning"), rows_of(model, meanings_of(model), but)
    )


class Made(SphinxDirective):
    """``{made} methods``: what a function of this file gives, as Markdown."""

    required_arguments = 1
    optional_arguments = 3

    def run(self) -> list[nodes.Node]:
        """The nodes in its place."""
        function, *arguments = self.arguments
        return self.parse_text_to_nodes(
            "\n".join(globals()[function](*arguments)), allow_section_headings=True
        )


def plainly(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str, returns: str
) -> tuple[str, str] | None:
    """Types in signatures without what they are annotated with.

    A model, whose signature is that of the fields that are listed below it, has none.
    """
    if what == "class" and "__pydantic_fields__" in vars(thing):
        own = thing.__annotations__
        own |= {field: bare(kind) for field, kind in hints(thing).items() if field in own}
        return "", ""
    if "Annotated[" not in (signature or ""):
        return None
    kinds, found = get_type_hints(thing), inspect.signature(thing, bound_method=what == "method")
    of_it = [
        p.replace(annotation=kinds.get(p.name, p.annotation)) for p in found.parameters.values()
    ]
    shown = found.replace(parameters=of_it)
    return inspect.stringify_signature(shown, show_return_annotation=False), returns


def setup(app: Sphinx) -> dict[str, bool]:
    """Register what is made here."""
    add_meanings()
    app.add_directive("made", Made)
    app.connect("autodoc-process-signature", plainly)
    return {"parallel_read_safe": True}
