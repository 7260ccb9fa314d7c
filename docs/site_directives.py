"""The directive ``{made} NAME``: a table of the site that is made from the code's own data."""

from __future__ import annotations

import importlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.util import inspect
from sphinx.util.docutils import SphinxDirective

from coartic.play.page import figure, play_page, preset_of, text_of, up_or_down
from coartic.tasks.families import Thousandths
from coartic.tasks.task import shipped_tasks

_IN_PARTS = get_args(Thousandths)[1]  # what reads a figure of a file into thousandths
_SIMPLE = {bool: "`true` or `false`", int: "integer", float: "number", str: "text"}
_LONGEST = 60  # characters of a default that is shown in a table


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """A table of Markdown."""
    yield "| " + " | ".join(heads) + " |"
    yield "| " + " | ".join("---" for _ in heads) + " |"
    for row in rows:
        yield "| " + " | ".join(" ".join(cell.split()).replace("|", "\\|") for cell in row) + " |"
    yield ""


def meanings_of(owner: type) -> dict[str, str]:
    """The docstrings of a class's attributes, inherited ones included."""
    return {
        name: " ".join(text).strip()
        for parent in reversed(owner.__mro__)
        if parent.__module__.startswith("coartic")
        for (of, name), text in ModuleAnalyzer.for_module(parent.__module__)
        .find_attr_docs()
        .items()
        if of == parent.__qualname__
    }


def hints(model: Any) -> dict[str, Any]:
    """The annotations of a model's fields, with their metadata."""
    fields = model.__pydantic_fields__.items()
    return {name: Annotated[f.annotation, *f.metadata, None] for name, f in fields}


def bare(kind: Any) -> Any:
    """A type without metadata."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return bare(parts[0])
    if origin in (tuple, dict):
        return origin[tuple(map(bare, parts))]
    if origin in (Union, UnionType):
        return Union[tuple(map(bare, parts))]  # noqa: UP007
    return kind


def values(kind: Any) -> str:
    """The values that a type allows, in words of TOML."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return "number" if _IN_PARTS in parts else values(parts[0])
    if origin is Literal:
        return " or ".join(f"`{toml(value)}`" for value in parts)
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(values(part) for part in parts if part is not NoneType))
    if origin is tuple and parts[-1] is not ...:
        return f"[{', '.join(map(values, parts))}]"
    if origin in (tuple, dict):
        inner = values(parts[0 if origin is tuple else 1])
        if inner == "table":
            return "tables"
        plural = f"{inner}s" if inner in ("number", "integer") else inner
        return f"list of {plural}" if origin is tuple else f"table of {inner}"
    return _SIMPLE.get(kind, "table")


def in_parts(kind: Any) -> bool:
    """Whether a family keeps these figures in thousandths."""
    return _IN_PARTS in get_args(kind) or any(map(in_parts, get_args(kind)))


def toml(value: Any, kind: Any = None) -> str:
    """A value as a file states it."""
    if hasattr(value, "__pydantic_fields__"):
        value = {name: toml(getattr(value, name), of) for name, of in hints(type(value)).items()}
        return "{ " + ", ".join(f"{name} = {item}" for name, item in value.items()) + " }"
    if isinstance(value, dict):
        inner = ", ".join(f"{name} = {toml(item)}" for name, item in value.items())
        return f"{{ {inner} }}" if value else "{}"
    if isinstance(value, tuple | list):
        return "[" + ", ".join(toml(item, kind) for item in value) + "]"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    return repr(value / 1000 if isinstance(value, int) and in_parts(kind) else value)


def rows_of(model: Any, meanings: Mapping[str, str], but: str = "") -> Iterator[Sequence[str]]:
    """Rows of a table of a model's fields. Raises KeyError for a field without a meaning."""
    of = hints(model)
    for name, field in model.__pydantic_fields__.items():
        if name == but:
            continue
        if name not in meanings:
            raise KeyError(f"{model.__name__}.{name}: has no docstring")
        shown = "required"
        if not field.is_required():
            default = field.get_default(call_default_factory=True)
            text = "none" if default is None else f"`{toml(default, of[name])}`"
            shown = text if len(text) <= _LONGEST + 2 else "as below"
        yield f"`{name}`", shown, values(of[name]), meanings[name]


def fields(module: str, owner: str, but: str = "") -> Iterator[str]:
    """The keys of a file, as its model checks them; ``but`` is a field that no file has."""
    model = getattr(importlib.import_module(module), owner)
    yield from table(
        ("key", "default", "values", "meaning"), rows_of(model, meanings_of(model), but)
    )


def parameters() -> Iterator[str]:
    """The parameters of every built-in method; methods that share them stand together."""
    from coartic.benchmarks.registry import built_in

    shared: dict[Any, list[str]] = {}
    for name, card in built_in().items():
        shared.setdefault(card.load().Parameters, []).append(f"`{name}`")
    for kind, names in shared.items():
        yield from (", ".join(names), "")
        rows = list(rows_of(kind, meanings_of(kind)))
        heads = ("parameter", "default", "values", "meaning")
        yield from table(heads, rows) if rows else ("None.", "")


def claims() -> Iterator[str]:
    """The paper's claims; each has its id for an anchor."""
    from coartic.analysis.claims.families import CLAIMS_ON_FAMILIES
    from coartic.analysis.claims.judgements import CLAIMS

    def goals(claim: Any) -> str:
        if claim in CLAIMS_ON_FAMILIES:
            return "random tasks"
        return "reconstructed †" if claim.fitted else "printed"

    rows = (
        (
            f"[{c.text}]{{#{c.id}}} <br>`{c.id}`",
            goals(c),
            f"{c.place}: “{c.quote}”",
            f"{c.test[0].upper()}{c.test[1:]}.",
        )
        for c in CLAIMS.values()
    )
    yield from table(("claim", "goals", "the paper says", "how it is judged"), rows)


def margins() -> Iterator[str]:
    """The margins of the claims, with the reason for each and its history."""
    from coartic.analysis.claims import margins

    reasons = ModuleAnalyzer.for_module(margins.__name__).find_attr_docs()
    rows = (
        (f"`{name.lower()}`", f"{getattr(margins, name):g}", " ".join(reason))
        for (_, name), reason in reasons.items()
    )
    yield from table(("margin", "value", "reason, and history if it was changed"), rows)


def play() -> Iterator[str]:
    """The figure to play with, its text and its styles; ``play.html`` is its page."""
    yield "```{raw} html"
    yield f"<style>{text_of('play.css')}</style>"
    yield figure([up_or_down(), *map(preset_of, shipped_tasks().values())], page="play.html")
    yield '<p><a href="play.html">On a page of its own</a>; with a task of yours:'
    yield " <code>coartic play TASK</code></p>"
    yield "```"


def add_page(app: Sphinx, failure: Exception | None) -> None:
    """Put the page of the figure beside the index, with a link to it."""
    if failure is None:
        home = '<main>\n<p class="soft"><a href="index.html">coartic: findings, how-to</a></p>'
        page = play_page().replace("<main>", home, 1)
        (Path(app.outdir) / "play.html").write_text(page, encoding="utf-8")


class Made(SphinxDirective):
    """Put the Markdown that a function of this file yields in the directive's place."""

    required_arguments = 1
    optional_arguments = 3

    def run(self) -> list[nodes.Node]:
        """Return its nodes."""
        function, *arguments = self.arguments
        return self.parse_text_to_nodes("\n".join(globals()[function](*arguments)))


def plainly(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str, returns: str
) -> tuple[str, str] | None:
    """Show types without metadata, and a model without its signature, which repeats its fields."""
    if what == "class" and "__pydantic_fields__" in vars(thing):
        annotations = thing.__annotations__
        annotations |= {
            field: bare(kind) for field, kind in hints(thing).items() if field in annotations
        }
        return "", ""
    if "Annotated[" not in (signature or ""):
        return None
    kinds, shown = get_type_hints(thing), inspect.signature(thing, bound_method=what == "method")
    of = [p.replace(annotation=kinds.get(p.name, p.annotation)) for p in shown.parameters.values()]
    shown = shown.replace(parameters=of)
    return inspect.stringify_signature(shown, show_return_annotation=False), returns


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("made", Made)
    app.connect("autodoc-process-signature", plainly)
    app.connect("build-finished", add_page)
    return {"parallel_read_safe": True}
