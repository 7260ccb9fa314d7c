"""Numbers and names in words, alike wherever they are shown."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from coartic import Task
    from coartic.analysis.statistics.estimates import Inference

NONE = "–"
"""Shown where there is no value."""
NO_SPREAD = "no spread"
"""Shown for an interval that is a point, which would look like certainty."""
MINUS, NARROW_SPACE, TIMES = "−", "\N{NARROW NO-BREAK SPACE}", "×"
RECONSTRUCTED = "† Reconstructed: what the paper does not print of this task was inferred."
LONGEST_SLUG = 80
"""Characters of a slug before its number; names of files must not be too long."""
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def stated(module: str, name: str = "") -> dict[str, Any]:
    """What the TOML file beside a module says, of the module's name or another.

    ``module``: its ``__file__``.
    """
    path = Path(module)
    file = path.with_name(f"{name}.toml") if name else path.with_suffix(".toml")
    return tomllib.loads(file.read_text(encoding="utf-8"))


def short(value: float) -> str:
    """With three figures: 950, 12.3 k, 4.98 M, 0.21; ∞, and a dash for NaN."""
    if math.isnan(value):
        return NONE
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    for size, unit in ((1e6, " M"), (1e3, " k")):
        if abs(value) >= 0.9995 * size:
            return f"{value / size:.3g}{unit}"
    return f"{value:.3g}"


def interval(found: Inference, style: str = ".1f") -> str:
    """``2.1 [1.3, 2.9]``; without the brackets where there is no interval.

    An interval that is a point would look like certainty: it is given in words.
    """
    text = format(found.estimate, style)
    if math.isnan(found.low) or math.isnan(found.high):
        return text
    if found.low == found.high:
        return f"{text} (no spread in {' and '.join(map(str, found.n))} runs)"
    return f"{text} [{found.low:{style}}, {found.high:{style}}]"


def marked(name: str, task: Task) -> str:
    """A name with † where its task is reconstructed (:data:`RECONSTRUCTED`)."""
    return f"{name} †" if task.reconstructed else name


def tally(of: Mapping[Any, int]) -> str:
    """``LRLR 17, RRLR 3``, the commonest first; a dash for none."""
    ordered = sorted(of.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{name} {count}" for name, count in ordered) or NONE


def true_minus(text: str) -> str:
    """Text with a minus where a hyphen before a digit begins a word, in brackets or not."""
    return re.sub(r"(?<![^\s(\[])-(?=\d)", MINUS, text)


def typographic(number: str) -> str:
    """A number of :func:`number_text` with a true minus and its thousands apart."""
    comparison = number[:1] if number[:1] in ("<", ">") else ""
    number = number.removeprefix(comparison)
    sign = MINUS if number.startswith("-") else ""
    number = number.removeprefix("-")
    if number == "inf":
        return f"{sign}∞"
    mantissa, _, power = number.partition("e")
    whole, dot, decimals = mantissa.partition(".")
    if len(whole) > 4:
        whole = f"{int(whole):,}".replace(",", NARROW_SPACE)
    shown = f"{comparison}{sign}{whole}{dot}{decimals}"
    return f"{shown} {TIMES} 10{power.translate(_SUPERSCRIPTS)}" if power else shown


def slugs(names: Iterable[str]) -> dict[str, str]:
    """Small letters, digits and dashes, all different: ``A_b`` is ``a-b``, ``a.b`` then ``a-b-2``.

    A minus sign after an underscore is spelled out: ``goal_-1`` is ``goal-minus1``. A name with
    none of them is ``x``.
    """
    found: dict[str, str] = {}
    for name in names:
        signed = re.sub(r"(?<=[_=])-(?=\d)", "minus", name.lower())
        base = re.sub(r"[^a-z0-9]+", "-", signed)[:LONGEST_SLUG].strip("-") or "x"
        slug, number = base, 2
        while slug in found.values():
            slug, number = f"{base}-{number}", number + 1
        found[name] = slug
    return found
