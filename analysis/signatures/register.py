"""Every signature of coarticulation: how it is measured, what it says, where it is shown.

To add one: a function that computes it, in the file of its concept, a measure of it
(:mod:`~.within` one method's runs on one task, :mod:`~.between` tasks), and a row of
``register.toml``. Rows are in the order of ``signatures.csv``.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

from pydantic import TypeAdapter

from analysis.signatures.rows import Signature

PER_DIMENSION = ", per root of dimension"
"""Of a unit."""


def _read() -> dict[str, tuple[Signature, ...]]:
    text = (Path(__file__).parent / "register.toml").read_text(encoding="utf-8")
    return TypeAdapter(dict[str, tuple[Signature, ...]]).validate_python(tomllib.loads(text))


_KINDS = _read()
WITHIN = _KINDS["within"]
"""Of one method's runs on one task."""
CONTEXTS = _KINDS["contexts"]
"""Of one goal in two contexts."""
FAMILIES = _KINDS["families"]
"""Of tasks that differ in one goal."""
REGISTER = {signature.name: signature for signature in (*WITHIN, *CONTEXTS, *FAMILIES)}
"""All signatures by name."""
