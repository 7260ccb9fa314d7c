"""Numbers and names in words, the same on the page, in tables and on the terminal."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from coartic.errors import CoarticError
from coartic.internal.text import one_line

if TYPE_CHECKING:
    from coartic import Task

_Digits = Annotated[int, Field(ge=0, le=30)]
NONE = "–"
"""Text of a missing value."""
MINUS, NARROW_SPACE, NO_BREAK = "−", "\N{NARROW NO-BREAK SPACE}", "\N{NO-BREAK SPACE}"
RECONSTRUCTED = "† The paper does not publish the goals of this task; ours are a reconstruction."
_LATEX = str.maketrans(
    {
        **{sign: f"\\{sign}" for sign in "&%$#_"},
        **{"~": "\\textasciitilde{}", "^": "\\textasciicircum{}", "\\": "\\textbackslash{}"},
        **{"{": "\\textbraceleft{}", "}": "\\textbraceright{}"},  # BibTeX counts braces
        **{"†": "$\\dagger$", "‡": "$\\ddagger$", "−": "$-$", "∞": "$\\infty$", "±": "$\\pm$"},
        **{NARROW_SPACE: "\\,", "σ": "$\\sigma$", "ε": "$\\epsilon$"},
    }
)
"""Signs with a meaning in LaTeX or BibTeX, and signs that coartic itself writes."""


def id_of(function: Callable[..., Any]) -> str:
    """Return the id of a table or figure from its function: ``family-gaps`` for
    ``list_family_gaps``, ``ranking`` for ``draw_ranking``."""
    return function.__name__.partition("_")[2].replace("_", "-")


def number(value: float, digits: _Digits | None = None) -> str:
    """Write a number, with a true minus and spaces between thousands from 10 000 on; – for NaN.

    ``digits``: decimals; by default none for integers, and as many as three significant figures
    need for others; below 0.0001 two figures, as in ``1.2e−05``.
    """
    if math.isnan(value):
        return NONE
    if math.isinf(value):
        return "∞" if value > 0 else f"{MINUS}∞"
    if digits is None:
        digits = 0 if value == round(value) else max(0, 2 - math.floor(math.log10(abs(value))))
        if digits > 6:
            return f"{value:.1e}".replace("-", MINUS)
    text = f"{abs(value):,.{digits}f}"
    if abs(value) < 10_000:
        text = text.replace(",", "")
    sign = MINUS if value < 0 and float(text.replace(",", "")) else ""
    return sign + text.replace(",", NARROW_SPACE)


def p_value(p: float) -> str:
    """Write a p-value, ``p < 0.001`` or ``p = 0.012``, with no-break spaces; empty for NaN."""
    if math.isnan(p):
        return ""
    return ("p < 0.001" if p < 0.001 else f"p = {p:.2g}").replace(" ", NO_BREAK)


def in_brackets(low: float, high: float, digits: int | None = None) -> str:
    """Write an interval, ``[1.3, 2.9]``, with ``digits`` decimals, by default as :func:`number`.

    Empty for NaN, and for an interval of no length, which would look like certainty.
    """
    if math.isnan(low) or math.isnan(high) or low == high:
        return ""
    return f"[{number(low, digits)}, {number(high, digits)}]"


def interval(row: Any, column: str, digits: _Digits = 1, scale: float = 1.0, unit: str = "") -> str:
    """Write a number of a table with its interval. Raises CoarticError if the row lacks a number.

    Parameters
    ----------
    row : mapping
        Row with ``column``, ``column_low`` and ``column_high``, such as a row of ``means``.
    column : str
        Name of the number.
    digits : int
        Decimals.
    scale : float
        Factor, such as 100 for a share in per cent.
    unit : str
        Unit after the number, such as ``" %"``.

    Returns
    -------
    str
        Such as ``7.8 [7.3, 8.1]``; the number alone if an end is NaN or the ends are equal.

    Examples
    --------
    >>> interval({"gap": 0.078, "gap_low": 0.073, "gap_high": 0.081}, "gap", scale=100, unit=" %")
    '7.8 % [7.3, 8.1]'
    """
    names = column, f"{column}_low", f"{column}_high"
    try:
        value, low, high = (scale * float(row[name]) for name in names)
    except (KeyError, IndexError, TypeError, ValueError, OverflowError):
        raise CoarticError(f"the row has no numbers {', '.join(names)}") from None
    return f"{number(value, digits)}{unit} {in_brackets(low, high, digits)}".strip()


def titled_apart(tasks: Iterable[Task]) -> list[Task]:
    """Return the tasks in their order, so that titles differ: a task that needs another title is
    replaced by a copy with this title.

    A changed task, ``ascending.radius-0.2``, that has the title of its task gets the change, too:
    ``Ascending, radius-0.2``. Then tasks with the same title get their names, too.
    """
    tasks, titles = [*tasks], []
    for task in tasks:
        base, _, change = task.name.partition(".")
        is_changed = change and task.label.lower().replace(" ", "-") == base
        titles.append(f"{task.label}, {change}" if is_changed else task.label)
    shared = Counter(titles)
    apart = [
        f"{title} ({task.name})" if shared[title] > 1 else title
        for task, title in zip(tasks, titles, strict=True)
    ]
    return [
        task if task.label == title else task.model_copy(update={"title": title})
        for task, title in zip(tasks, apart, strict=True)
    ]


def marked(task: Task) -> str:
    """Return the title of a task, with † if it is reconstructed (:data:`RECONSTRUCTED`)."""
    return f"{task.label} †" if task.reconstructed else task.label


def tally(names: Iterable[str]) -> str:
    """Write how often each name occurs, ``LRLR 17, RRLR 3``, the commonest first, then by name; –
    for none."""
    counts = Counter(sorted(names)).most_common()
    return ", ".join(f"{name} {count}" for name, count in counts) or NONE


def commonest(texts: Iterable[str], most: int | None = 3) -> list[str]:
    """Return the commonest texts, ``most`` at most (None: all), each with its number, ``12 × no
    hit``."""
    return [f"{count} × {text}" for text, count in Counter(texts).most_common(most)]


def listed(words: Iterable[str]) -> str:
    """Write a list, ``a, b and c``. Raises ValueError without words."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def capital(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


def slugs(names: Iterable[str]) -> dict[str, str]:
    """Return slugs (small letters, digits, dashes) by name, no two equal: ``a-b``, ``a-b-2``."""
    taken: dict[str, str] = {}
    for name in names:
        # Names of files are short.
        base = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:80] or "x"
        slug, count = base, 1
        while slug in taken.values():
            count += 1
            slug = f"{base}-{count}"
        taken.setdefault(name, slug)
    return taken


def latex(text: object) -> str:
    """Return text as one printable line for LaTeX and BibTeX, in which special characters are
    escaped. Letters that pdfLaTeX does not know stay; XeLaTeX and LuaLaTeX print them."""
    return one_line(str(text)).translate(_LATEX)
