"""The table of a suite's questions, and its answers in a line each."""

from __future__ import annotations

from typing import Any

import pandas as pd

from coartic.analysis.contrasts import (
    ALL,
    EXACT,
    NOT_TESTED,
    OPEN,
    OPPOSITE,
    SHOWN,
    UNITS_OF_QUANTITIES,
)
from coartic.analysis.signatures import SIGNATURES
from coartic.analysis.study import Study
from coartic.analysis.tables.language import Rows, table
from coartic.analysis.words import in_brackets, listed, number, p_value
from coartic.internal.text import pluralize
from coartic.runs.plan import world_title

VERDICTS = (SHOWN, OPPOSITE, OPEN, NOT_TESTED)


@table(
    "Contrasts: answers of the suite's questions by family and world",
    """
    contrast
    says           | sentence                 |   | tex
    quantity       | quantity                 |   | tex
    expected       | expected                 |   | tex
    asked          | asked
    world          | world                    |   | tex
    family         | family                   |   | tex
    tasks
    n              | tasks                    |   | tex
    yes            | on the expected side     |   | tex
    equal          | equal                    |   | tex
    median[]       | median                   |   | tex
    mean[]         | mean                     |   | tex
    p              | p                        | p
    p_holm         | p (corrected)            | p | tex
    verdict        | verdict                  |   | tex
    dropped        | tasks dropped
    not_applicable | not applicable
    note           | note
    """,
    of_folder=True,
)
def list_contrasts(study: Study) -> Rows:
    """Yield a row for each cell of each contrast of the folder (:attr:`.Study.contrasts`)."""
    for number_of, row in enumerate(study.contrasts.to_dict("records"), 1):
        yield str(number_of), {str(name): value for name, value in row.items()}


def answer_lines(frame: pd.DataFrame) -> list[str]:
    """Return the answer to each contrast in a line, from rows of :attr:`.Study.contrasts`."""
    lines = []
    for _, rows in frame.groupby("contrast", sort=False):
        cells = rows[rows.family != ALL]
        first = cells.iloc[0]
        counts = {verdict: int((cells.verdict == verdict).sum()) for verdict in VERDICTS}
        told = [f"{verdict} in {counts[verdict]}" for verdict in VERDICTS if counts[verdict]]
        if len(cells) == 1 and first.verdict:
            p = f", {p_value(first.p_holm)}" if first.p_holm >= 0 else ""
            told = [f"{first.verdict} ({first.yes} of {first.n} tasks{p})"]
        elif told:
            told[-1] += f" of {pluralize(len(cells), 'cell')}"
        elif first.expected:
            told = ["not tested, because its tasks are fixed"]
        else:
            told = [f"described in {pluralize(len(cells), 'cell')}"]
        lines.append(f"{first.says.rstrip('.')}: {listed(told)}.")
    return lines


def needs_executions(quantity: str) -> bool:
    """Return whether a quantity needs executions of solutions, which take time."""
    return quantity in (*SIGNATURES, *EXACT)


def matrix_of(study: Study) -> dict[str, Any]:
    """Return the matrix of the contrasts of a folder for the page's template.

    ``worlds`` are its columns. ``contrasts`` are its groups of rows, with the sentence of each, and
    its ``rows``: the name of a family with a field for each world. A field has its ``text``, the
    ``verdict`` as a class, and the ``note``. ``across`` are the rows of contrasts across worlds.
    """
    frame = study.contrasts
    worlds, groups = [*study.worlds], []
    titles = {name: task.label for name, task in study.tasks.items()}
    for _, rows in frame.groupby("contrast", sort=False):
        is_across = not {*rows.world} <= {*worlds}
        columns = [*dict.fromkeys(rows.world)] if is_across else worlds
        fields = {(row.world, row.family): _field(row) for row in rows.itertuples()}
        families = [*dict.fromkeys(rows.family)]
        first = rows.iloc[0]
        groups.append(
            {
                "says": first.says,
                "about": f"{UNITS_OF_QUANTITIES[first.quantity]}"
                + (f", expected {first.expected}" if first.expected else ""),
                "asked": first.asked,
                "worlds": columns if is_across else None,
                "rows": [
                    (
                        titles.get(family, family.split("/")[0]),
                        [fields.get((world, family), _NONE) for world in columns],
                    )
                    for family in families
                ],
            }
        )
    return {"worlds": [*map(world_title, worlds)], "contrasts": groups}


_NONE = {"text": "–", "verdict": "", "note": "not asked here"}


def _field(row: Any) -> dict[str, str]:
    """Return a field of the matrix."""
    if pd.isna(row.yes):
        ends = in_brackets(row.mean_low, row.mean_high)
        text = f"{number(row.mean)} {ends}".strip() if row.mean == row.mean else "no value"
    elif not row.n:
        text = "no task"
    elif not row.expected:
        text = f"{number(row.median)} {in_brackets(row.median_low, row.median_high)}".strip()
    else:
        text = f"{row.yes} of {row.n}{f', {row.equal} equal' if row.equal else ''}"
    return {"text": text, "verdict": row.verdict.replace(" ", "-"), "note": row.note}
