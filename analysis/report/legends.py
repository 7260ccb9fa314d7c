"""Notes below tables that say what their letters and marks mean."""

from __future__ import annotations

from dataclasses import replace

from analysis.comparisons.methods import TOLD
from analysis.report.document import DataTable

_LETTERS = {"told", "told_more", "told_less"}  # columns with letters of information
_MARKS = {
    "†": "† Reconstructed: what the paper does not print of this task was inferred.",
    "δ": "Cliff's δ: how often a run of the first is higher than one of the second, less how "
    "often it is lower; −1 to 1.",
}


def with_legends(table: DataTable) -> DataTable:
    """The table with a note for every mark that it shows and its notes leave unexplained."""
    notes = list(table.notes)
    if _LETTERS & {column.name for column in table.columns}:
        letters = ", ".join(f"*{letter}* {item.value}" for item, letter in TOLD.items())
        notes.append(f"Told: {letters}.")
    texts = [table.caption, *(column.header for column in table.columns)]
    texts += [value for row in table.rows for value in row.values if isinstance(value, str)]
    notes += [
        note
        for mark, note in _MARKS.items()
        if any(mark in text for text in texts) and not any(mark in text for text in notes)
    ]
    return replace(table, notes=tuple(notes))
