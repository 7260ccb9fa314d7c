"""Names of tasks as the names of figures, tables and sections have them."""

from __future__ import annotations

import re
from collections.abc import Iterable

MOST = 80
"""Characters of a slug before its number; names of files must not be too long."""


def slugs(names: Iterable[str]) -> dict[str, str]:
    """Small letters, digits and dashes, all different: ``A_b`` is ``a-b``, ``a.b`` then ``a-b-2``.

    A minus sign after an underscore is spelled out: ``goal_-1`` is ``goal-minus1``. A name with
    none of them is ``x``.
    """
    found: dict[str, str] = {}
    for name in names:
        signed = re.sub(r"(?<=[_=])-(?=\d)", "minus", name.lower())
        base = re.sub(r"[^a-z0-9]+", "-", signed)[:MOST].strip("-") or "x"
        slug, number = base, 2
        while slug in found.values():
            slug, number = f"{base}-{number}", number + 1
        found[name] = slug
    return found
