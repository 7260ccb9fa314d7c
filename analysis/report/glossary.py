"""Words of a report in plain language (``glossary.toml``)."""

from __future__ import annotations

import tomllib
from pathlib import Path


def glossary() -> tuple[str, ...]:
    """One word an item, in inline markup."""
    text = Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
    return tuple(f"**{word}**: {meaning}" for word, meaning in tomllib.loads(text).items())
