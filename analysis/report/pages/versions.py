"""The page that ``coartic compare`` writes: two results folders."""

from __future__ import annotations

from collections.abc import Iterator

from analysis.comparisons.versions import VersionComparison
from analysis.markup import code, escaped
from analysis.report.document import Block, Bullets, Document, Prose, Section
from analysis.report.tables.versions import differing_table, versions_table


def versions_document(found: VersionComparison) -> Document:
    """What differs between the folders, the cells of both, and those of one alone."""
    first, second = found.folders
    differing, cells = differing_table(found), versions_table(found)
    same = Prose((f"The same: {escaped(', '.join(found.same)) or 'nothing'}.",))
    return Document(
        "Two sets of results",
        (
            Section("outcome", "Outcome", (Bullets(tuple(found.summary)),)),
            Section("differing", "What differs", (differing or Prose(("Nothing.",)), same)),
            Section("in-both", "Cells of both folders", tuple(_cells(cells, found))),
            *_only(found),
        ),
        f"A: {code(str(first))}. B: {code(str(second))}.",
    )


def _cells(cells: Block | None, found: VersionComparison) -> Iterator[Block]:
    yield cells or Prose(("None.",))
    stale = [
        f"{side}: {count} records were made by other code and have no part here."
        for side, count in zip("AB", found.stale, strict=True)
        if count
    ]
    if stale:
        yield Bullets(tuple(stale))


def _only(found: VersionComparison) -> Iterator[Section]:
    for side, tasks in zip("AB", found.only, strict=True):
        if tasks:
            items = tuple(escaped(f"{name}: {', '.join(on)}") for name, on in tasks.items())
            yield Section(f"only-{side.lower()}", f"Cells only in {side}", (Bullets(items),))
