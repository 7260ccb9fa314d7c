"""Format numbers and names in the same way for the page, for tables and for the terminal."""

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
"""Translation table for ``str.translate``. It maps special characters of LaTeX and BibTeX, and
some symbols that coartic itself writes, to LaTeX commands."""


def id_of(function: Callable[..., Any]) -> str:
    """Return the id of a table or figure, made from the name of its function.

    The id is the name after its first underscore, with dashes instead of underscores:
    ``family-gaps`` for ``list_family_gaps``, and ``ranking`` for ``draw_ranking``.
    """
    return function.__name__.partition("_")[2].replace("_", "-")


def number(value: float, digits: _Digits | None = None) -> str:
    """Return a number as a string, with a true minus sign.

    Parameters
    ----------
    value : float
        The number. NaN becomes ``–``, and infinity ``∞``.
    digits : int, optional
        Number of decimals. By default, it depends on the number:

        - An integer has no decimals.
        - Any other number whose size is below 0.0001 has two significant figures and an exponent,
          as in ``1.2e−05``.
        - All other numbers have about three significant figures, or no decimals from 100 on.

    Returns
    -------
    str
        The number. If its absolute value is at least 10,000, narrow no-break spaces separate groups
        of three digits.

    Examples
    --------
    >>> number(-0.03821), number(319.0), number(0.5, 2)
    ('−0.0382', '319', '0.50')
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
    """Return a p-value as ``p < 0.001`` or ``p = 0.012``, with no-break spaces.

    The result is the empty string for NaN.
    """
    if math.isnan(p):
        return ""
    return ("p < 0.001" if p < 0.001 else f"p = {p:.2g}").replace(" ", NO_BREAK)


def in_brackets(low: float, high: float, digits: int | None = None) -> str:
    """Return an interval as a string such as ``[1.3, 2.9]``.

    ``digits`` is the number of decimals; by default :func:`number` chooses it. The result is the
    empty string if an end is NaN. It is also empty if both ends are equal, because an interval of
    length 0 would look like certainty.
    """
    if math.isnan(low) or math.isnan(high) or low == high:
        return ""
    return f"[{number(low, digits)}, {number(high, digits)}]"


def interval(row: Any, column: str, digits: _Digits = 1, scale: float = 1.0, unit: str = "") -> str:
    """Return a number in a row of a table, with its interval, as a string.

    Parameters
    ----------
    row : mapping
        A row of a table, such as a row of :func:`coartic.analysis.means`. If ``column`` is
        ``"gap"``, the row must contain the numbers ``gap``, ``gap_low`` and ``gap_high``.
    column : str
        Name of the column with the number.
    digits : int
        Number of decimals.
    scale : float
        Factor by which the three numbers are multiplied: 100 turns a fraction into per cent.
    unit : str
        Unit that is written after the number, such as ``" %"``.

    Returns
    -------
    str
        A string such as ``7.8 [7.3, 8.1]``. The interval is left out if one of its ends is NaN, or
        if both ends are equal.

    Raises
    ------
    CoarticError
        The row lacks one of the three numbers.

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
    """Return tasks in the same order, with titles that all differ.

    A task that needs another title is replaced by a copy with this title:

    - The change is added to the title of a changed task if this title, in lower case and with
      dashes for spaces, is the name of the original task. ``ascending.radius-0.2``, for example,
      gets the title ``Ascending, radius-0.2``.
    - If several tasks then have the same title, the name of the task is added, in parentheses, to
      each of these titles.
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
    """Return the title of a task, followed by † if a part of the task is reconstructed.

    :data:`RECONSTRUCTED` is the sentence that explains the dagger to readers.
    """
    return f"{task.label} †" if task.reconstructed else task.label


def tally(names: Iterable[str]) -> str:
    """Return names with the numbers of their occurrences, as in ``LRLR 17, RRLR 3``.

    The most frequent name comes first. Names that are equally frequent are in alphabetical order.
    The result is ``–`` if there are no names.
    """
    counts = Counter(sorted(names)).most_common()
    return ", ".join(f"{name} {count}" for name, count in counts) or NONE


def commonest(texts: Iterable[str], most: int | None = 3) -> list[str]:
    """Return the most frequent strings with their counts, as in ``12 × no hit``.

    The list is in descending order of frequency. It has at most ``most`` entries; if ``most`` is
    None, it has an entry for each distinct string.
    """
    return [f"{count} × {text}" for text, count in Counter(texts).most_common(most)]


def listed(words: Iterable[str]) -> str:
    """Return words as an enumeration, such as ``a, b and c``.

    Raises ValueError if there are no words.
    """
    *others, last = words
    return f"{', '.join(others)} and {last}" if others else last


def capital(text: str) -> str:
    """Return a string with a capital first letter."""
    return text[:1].upper() + text[1:]


def slugs(names: Iterable[str]) -> dict[str, str]:
    """Return a dict that maps each name to a unique slug for file names.

    A slug consists of the lower-case letters a to z, digits and dashes. It has at most 80
    characters, to which a number can be added: if two names would have the same slug, such as
    ``a-b``, the second one gets ``a-b-2``. The slug of a name without ASCII letters and digits
    begins with ``x``.
    """
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


def latex(text: object) -> str:
    """Return text as one printable line for LaTeX and BibTeX, with special characters escaped.

    Letters that pdfLaTeX cannot print are kept; XeLaTeX and LuaLaTeX can print them.
    """
    return one_line(str(text)).translate(_LATEX)
