"""Write the code of a module that decides what it computes as text.

The text is the same under every version of Python that can read the code; ``ast.dump`` writes one
tree differently in 3.11, 3.12 and 3.13. This module imports the standard library alone.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from itertools import groupby
from typing import Any


def text_of(node: Any) -> str:
    """Return a syntax tree, a list of trees or a constant as text."""
    if isinstance(node, list):
        return f"[{' '.join(map(text_of, node))}]"
    if not isinstance(node, ast.AST):
        return ascii(node)  # the version decides which characters print
    text = type(node).__name__
    for name, value in _fields_of(node).items():
        text += f" {name}={text_of(value)}"
    return f"({text})"


def statements_in(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements, handlers and match cases below a node, each before those within it."""
    for value in _fields_of(node).values():
        for child in value if isinstance(value, list) else ():
            if isinstance(child, ast.stmt | ast.excepthandler | ast.match_case):
                yield child
                yield from statements_in(child)


def _fields_of(node: ast.AST) -> dict[str, Any]:
    """Return the fields of a node that can change a result: no docstring, no ``__version__``, no
    code for type checkers, and no empty field, such as the type parameters since Python 3.12."""
    fields = {name: value for name, value in ast.iter_fields(node) if value not in (None, [])}
    match node:
        case ast.Expr(value=ast.Constant()):
            return {}
        case ast.Assign(targets=[ast.Name(id="__version__"), *_]):
            del fields["value"]
        case ast.If(test=ast.Name(id="TYPE_CHECKING") | ast.Attribute(attr="TYPE_CHECKING")):
            del fields["body"]
        case ast.Constant():
            fields.pop("kind", None)  # u"text" is "text"
        case ast.JoinedStr(values=values):
            fields["values"] = _joined(values)
    return fields


def _joined(parts: list[Any]) -> list[ast.expr]:
    """Return the parts of an f-string with neighbouring texts as one text: Python divides them
    differently since version 3.12."""
    together: list[ast.expr] = []
    for is_text, some in groupby(parts, lambda part: isinstance(part, ast.Constant)):
        if not is_text:
            together += some
        elif text := "".join(str(part.value) for part in some):
            together.append(ast.Constant(text))
    return together
