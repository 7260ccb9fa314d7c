"""The works that are cited, from ``references.bib``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Annotated

from pydantic import AfterValidator

from coartic import CoarticError
from coartic.text import did_you_mean

_ENTRY = re.compile(r"@([a-z]+)\{([a-z0-9-]+),\n((?:  [a-z]+ = \{.+\},\n)+)\}")
_FIELD = re.compile(r"  ([a-z]+) = \{(.+)\},\n")
_REQUIRED = {
    "article": {"author", "title", "journal", "year"},
    "book": {"author", "title", "publisher", "year"},
    "inproceedings": {"author", "title", "booktitle", "year"},
    "misc": {"author", "title", "year"},
    "techreport": {"author", "title", "institution", "year"},
}


@dataclass(frozen=True)
class Reference:
    """One entry of a bibliography."""

    key: str
    kind: str
    """``article``, ``book``, ``inproceedings``, ``misc`` or ``techreport``."""
    fields: Mapping[str, str]

    def to_bibtex(self) -> str:
        """The entry, one field a line."""
        lines = [f"  {name} = {{{value}}}," for name, value in self.fields.items()]
        return "\n".join([f"@{self.kind}{{{self.key},", *lines, "}"])


def parse(text: str, source: str) -> dict[str, Reference]:
    """Entries by key, of a bibliography in the layout of ``references.bib``.

    Comment lines come first. Raises CoarticError where anything else is in the text, an entry
    lacks a field that its kind requires, braces do not match, or a key or field comes twice.
    """
    body = re.sub(r"\A(?:%.*\n)*\n*", "", text).rstrip("\n")
    found: dict[str, Reference] = {}
    for block in body.split("\n\n"):
        first = block.split("\n", 1)[0]
        entry = _ENTRY.fullmatch(block)
        if entry is None:
            raise CoarticError(f"{source}: {first!r}: not one `  name = {{value}},` a line")
        kind, key, lines = entry.groups()
        pairs = _FIELD.findall(lines)
        fields = dict(pairs)
        if key in found or len(fields) < len(pairs):
            raise CoarticError(f"{source}: {key}: the key, or a field of it, is there twice")
        missing = _REQUIRED.get(kind, {f"a known kind, not @{kind}"}) - fields.keys()
        if missing:
            raise CoarticError(f"{source}: {key} lacks {', '.join(sorted(missing))}")
        for name, value in pairs:
            if not _balanced(value):
                raise CoarticError(f"{source}: {key}: braces of {name} do not match")
        found[key] = Reference(key, kind, fields)
    return found


@cache
def references() -> Mapping[str, Reference]:
    """Every entry of ``references.bib`` by key."""
    file = resources.files("coartic.analysis") / "references.bib"
    return parse(file.read_text(encoding="utf-8"), "references.bib")


def _balanced(value: str) -> bool:
    depth = 0
    for sign in re.sub(r"\\.", "", value):
        depth += {"{": 1, "}": -1}.get(sign, 0)
        if depth < 0:
            return False
    return depth == 0


def _known(key: str) -> str:
    if key not in references():
        near = did_you_mean(key, references())
        raise ValueError(f"references.bib has no entry {key!r}{near}")
    return key


Key = Annotated[str, AfterValidator(_known)]
"""Of an entry of ``references.bib``; another is refused."""
