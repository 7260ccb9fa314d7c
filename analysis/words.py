"""Write numbers and names in the same way on the page, in tables and on the terminal."""

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
    from coartic.analysis.study import Study

_Digits = Annotated[int, Field(ge=0, le=30)]
NONE = "–"
"""String for a missing value."""
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
"""Special characters of LaTeX and BibTeX, and symbols that coartic itself writes."""


def id_of(function: Callable[..., Any]) -> str:
    """Return the id of a table or figure from the name of its function.

    It is ``family-gaps`` for ``list_family_gaps``, and ``ranking`` for ``draw_ranking``.
    """
    return function.__name__.partition("_")[2].replace("_", "-")


def number(value: float, digits: _Digits | None = None) -> str:
    """Return a number as a string, with a true minus sign; – for NaN.

    Numbers from 10 000 on have narrow spaces between thousands.

    Parameters
    ----------
    value : float
    digits : int, optional
        Number of decimals. By default, integers have none, and other numbers have three significant
        figures; very small ones have two, as in ``1.2e−05``.
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
    """Return a p-value as ``p < 0.001`` or ``p = 0.012``, with no-break spaces; empty for NaN."""
    if math.isnan(p):
        return ""
    return ("p < 0.001" if p < 0.001 else f"p = {p:.2g}").replace(" ", NO_BREAK)


def in_brackets(low: float, high: float, digits: int | None = None) -> str:
    """Return an interval as ``[1.3, 2.9]``, with ``digits`` decimals or as :func:`number` chooses.

    The result is empty if an end is NaN, or if both ends are equal, because this would look like
    certainty.
    """
    if math.isnan(low) or math.isnan(high) or low == high:
        return ""
    return f"[{number(low, digits)}, {number(high, digits)}]"


def interval(row: Any, column: str, digits: _Digits = 1, scale: float = 1.0, unit: str = "") -> str:
    """Return a number of a table with its interval as a string.

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
        A string such as ``7.8 [7.3, 8.1]``. It has only the number if an end is NaN, or if both
        ends are equal.

    Raises
    ------
    CoarticError
        The row does not have these numbers.

    Examples
    --------
    >>> interval({"gap": 0.078, "gap_low": 0.073, "gap_high": 0.081}, "gap", scale=100, unit=" %")
    '7.8 % [7.3, 8.1]'
    """
    names = column, f"{column}_low", f"{column}_high"
    try:
        value, low, high = (scale * float(row[name]) for name in names)
    except (KeyError, IndexError, TypeError, ValueError, OverflowError):
        raise CoarticError(
            f"the row lacks one of the numbers {', '.join(names)}; it must have all three"
        ) from None
    return f"{number(value, digits)}{unit} {in_brackets(low, high, digits)}".strip()


def titled_apart(tasks: Iterable[Task]) -> list[Task]:
    """Return the tasks in order, with titles that differ.

    A task that needs another title is replaced by a copy with this title:

    - If a changed task, such as ``ascending.radius-0.2``, has the title of the original task, the
      change is added: ``Ascending, radius-0.2``.
    - If tasks then still have the same title, their names are added.
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
    """Return how often each name occurs, as in ``LRLR 17, RRLR 3``; – for none.

    The most frequent name comes first; names that are equally frequent are in alphabetical order.
    """
    counts = Counter(sorted(names)).most_common()
    return ", ".join(f"{name} {count}" for name, count in counts) or NONE


def commonest(texts: Iterable[str], most: int | None = 3) -> list[str]:
    """Return the most frequent strings with their numbers, as in ``12 × no hit``.

    The list has at most ``most`` strings; None stands for all.
    """
    return [f"{count} × {text}" for text, count in Counter(texts).most_common(most)]


def listed(words: Iterable[str]) -> str:
    """Return words as a list, ``a, b and c``. Raises ValueError if there are none."""
    *others, last = words
    return f"{', '.join(others)} and {last}" if others else last


def capital(text: str) -> str:
    """Return a string with a capital first letter."""
    return text[:1].upper() + text[1:]


def slugs(names: Iterable[str]) -> dict[str, str]:
    """Return a different slug (small letters, digits, dashes) for each name: ``a-b``, ``a-b-2``."""
    slug_of: dict[str, str] = {}
    for name in names:
        # Slugs are used in names of files, which must be short.
        base = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:80] or "x"
        slug, count = base, 1
        while slug in slug_of.values():
            count += 1
            slug = f"{base}-{count}"
        slug_of.setdefault(name, slug)
    return slug_of


def ending_of(study: Study) -> str:
    """Return the end of ids of tables and figures in a world, such as ``-motor-noise-0-01``.

    It is empty for the paper's world.
    """
    return f"-{slugs([study.world])[study.world]}" if study.world else ""


def latex(text: object) -> str:
    """Return text as one printable line for LaTeX and BibTeX, with special characters escaped.

    Letters that pdfLaTeX does not know are not changed; XeLaTeX and LuaLaTeX print them.
    """
    return one_line(str(text)).translate(_LATEX)
