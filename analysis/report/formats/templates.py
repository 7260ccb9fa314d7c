"""How templates are read, whatever they make."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, get_args

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from coartic.analysis.report.document import Block
from coartic.text import one_line

LATEX = {
    **{"block_start_string": "<%", "block_end_string": "%>"},
    **{"comment_start_string": "<#", "comment_end_string": "#>"},
    **{"variable_start_string": "<<", "variable_end_string": ">>"},
}
"""Settings for templates of LaTeX, whose own are braces and per cent signs."""


@cache
def template(name: str, *filters: Callable[..., Any], **settings: Any) -> Template:
    """A template of this folder: tags on lines of their own leave none. Read once.

    Functions are ``filters`` by their names, kinds of blocks tests by theirs in small letters;
    ``settings`` are further ones of jinja2.Environment.
    """
    environment = Environment(
        loader=PackageLoader("coartic.analysis.report", "formats"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        **settings,
    )
    environment.filters |= {function.__name__: function for function in filters}
    environment.tests |= {
        kind.__name__.lower(): kind.__instancecheck__ for kind in get_args(Block)
    }
    return environment.get_template(name)


def on_one_line(value: object) -> object:
    """What is filled in as text on one line, but what is markup already."""
    return value if hasattr(value, "__html__") else one_line(str(value))
