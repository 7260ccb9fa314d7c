"""Tables of the keys of files and of the parameters of methods, made from the code's own data."""

from __future__ import annotations

import ast
import inspect
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from textwrap import dedent
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from coartic.benchmarks.registry import built_in
from coartic.benchmarks.suites import Block, Move, Suite
from coartic.robot import Robot
from coartic.tasks.families import Alignment, Family, Posture, Postures, Region, Thousandths
from coartic.tasks.task import Provenance, Start, Task

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
    """The texts below a class's fields, inherited ones included, as Markdown."""
    meanings = {}
    for parent in reversed(owner.__mro__):
        if parent.__module__.startswith("coartic"):
            (tree,) = ast.parse(dedent(inspect.getsource(parent))).body
            for field, text in pairwise(getattr(tree, "body", [])):
                match field, text:
                    case ast.AnnAssign(target=ast.Name(name)), ast.Expr(ast.Constant(str(words))):
                        plain = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", words)
                        meanings[name] = " ".join(plain.replace("``", "`").split())
    return meanings


def hints(model: Any) -> dict[str, Any]:
    """The annotations of a model's fields, with their metadata."""
    fields = model.__pydantic_fields__.items()
    return {name: Annotated[f.annotation, *f.metadata, None] for name, f in fields}


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
        shown = "as said" if "By default" in meanings[name] else "required"
        if not field.is_required():
            default = field.get_default(call_default_factory=True)
            text = "none" if default is None else f"`{toml(default, of[name])}`"
            shown = text if len(text) <= _LONGEST + 2 else "as below"
        yield f"`{name}`", shown, values(of[name]), meanings[name]


def fields(model: Any, but: str = "") -> str:
    """The keys of a file, as its model checks them; ``but`` is a field that no file has."""
    heads = ("key", "default", "values", "meaning")
    return "\n".join(table(heads, rows_of(model, meanings_of(model), but))).strip()


def parameters() -> str:
    """The parameters of every built-in method; methods that share them stand together."""
    shared: dict[Any, list[str]] = {}
    for name, card in built_in().items():
        shared.setdefault(card.load().Parameters, []).append(f"`{name}`")
    lines = list[str]()
    for kind, names in shared.items():
        lines += [", ".join(names), ""]
        rows = list(rows_of(kind, meanings_of(kind)))
        heads = ("parameter", "default", "values", "meaning")
        lines += table(heads, rows) if rows else ("None.", "")
    return "\n".join(lines).strip()


MODELS = {
    model.__name__: model
    for model in (
        Task, Start, Robot, Provenance, Family, Region, Alignment, Postures, Posture, Suite, Block,
        Move,
    )
}  # fmt: skip
"""What a page can name."""
