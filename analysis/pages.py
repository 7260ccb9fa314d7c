"""Pages of Markdown whose numbers come from tables: a template is filled in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from coartic.analysis.words import interval, listed, number, p_value


def fill_page(template: Path, **values: Any) -> str:
    """Fill in a page.

    Parameters
    ----------
    template : pathlib.Path
        A template of Jinja. It has what is handed over, ``interval(row, column, digits, scale)``,
        which writes ``7.8 [7.3, 8.1]``, ``expect(holds, what)``, the filters ``number``,
        ``p_value`` and ``listed``, and the templates beside it.
    **values
        What the template calls by these names: tables, numbers, functions.

    Returns
    -------
    str
        The page.

    Raises
    ------
    ValueError
        A sentence that the template expects of the results does not hold.
    jinja2.UndefinedError
        The template names something that is not there.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(template.parent),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.globals |= {"interval": interval, "expect": expect, **values}
    environment.filters |= {"number": number, "p_value": p_value, "listed": listed}
    return environment.get_template(template.name).render()


def expect(holds: bool, what: str) -> str:
    """Nothing, where a sentence holds. Raises ValueError where the results no longer bear it."""
    if not holds:
        raise ValueError(f"this no longer holds: {what}")
    return ""
