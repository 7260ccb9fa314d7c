"""Tables as CSV, HTML and LaTeX.

The page shows intervals and standard deviations, columns ``x_low``, ``x_high`` and ``x_sd``, in
column ``x``.
"""

from __future__ import annotations

import html
import math
import re
from collections.abc import Sequence
from fnmatch import fnmatch
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from coartic.analysis.table import Table, is_setting
from coartic.analysis.words import (
    NARROW_SPACE,
    NONE,
    RECONSTRUCTED,
    in_brackets,
    latex,
    number,
    slugs,
)
from coartic.internal.text import one_line

IN_LATEX = {
    "contexts": "place, method, runs, distance, p_holm, control, p_random_search",
    "ranking": "method, gap, share, on *, note",
    "not-ranked": "method, why, on *, note",
    "differences": "against, method, difference, p_holm, tasks",
    "runtimes": "method, reached, trials_to_half, forward_kinematics_to_half",
    "learning": "task, method, runs, after_*",
    "signatures": "task, method, hands, runs, first, first_control, first_p, arm, arm_p",
    "family-gaps": "method, gap, in *",
    "tasks": "task, arms, base, initial, optimum, bound",
    "methods": "task, method, runs, reward, gap, hands, trials",
}
"""Tables in LaTeX, by id, and their columns."""
FORMULA = ("=", "+", "-", "@")
"""Beginnings of text that spreadsheets take for formulas."""


def table_csv(frame: pd.DataFrame) -> str:
    """Return a table as CSV, with an apostrophe before text that a spreadsheet would take for a
    formula."""
    return frame.map(_guarded).rename(index=_guarded).to_csv(lineterminator="\n")


def _guarded(value: Any) -> Any:
    """Return a value unchanged, or, for text that a spreadsheet would take for a formula, the text
    behind an apostrophe."""
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value


class ShownColumn(NamedTuple):
    """A column of a table as people see it."""

    header: str
    texts: list[str]
    """Values as text, with their SDs and intervals, row by row."""
    is_number: bool
    """True if the column has numbers, True and False alone, or no value at all."""


def shown_columns(table: Table, frame: pd.DataFrame) -> dict[str, ShownColumn]:
    """Return the columns that the page can show, by name: columns with a heading and a value in
    some row, without ends of intervals and SDs of other columns.

    A task in a heading goes by its title, with † where it is reconstructed.
    """
    shown, titles = {}, frame.attrs.get("titles", {})
    to = frame.attrs.get("reference", "optimum")
    for name in frame.columns:
        values = frame[name]
        if _is_end(table, frame, name) or not (values.notna() & (values != "")).any():
            continue
        column = table.column(name)
        if not column.header:
            continue
        what = name.removeprefix(column.name)
        header = column.header.replace("{}", titles.get(what, what))
        if header == "gap (%)" and to != "optimum":
            header = f"gap to the {to} (%)"
        if header == "best known" and to == "best of this folder":
            header = to
        low, high, sd = (
            end if _is_end(table, frame, end) else ""
            for end in (f"{name}_low", f"{name}_high", f"{name}_sd")
        )
        header += " ± SD" * bool(sd)
        has_interval = low and frame[low].notna().any() and "[" not in header
        header += f" [95{NARROW_SPACE}%]" * bool(has_interval)
        if not pd.api.types.is_numeric_dtype(values.infer_objects()) and values.notna().any():
            words = {each: titles.get(each) or one_line(str(each)) for each in values.unique()}
            texts = [NONE if pd.isna(each) else words[each] or NONE for each in values]
            shown[name] = ShownColumn(header, texts, is_number=False)
            continue
        numbers = frame.reindex(columns=[name, low, high, sd]).apply(pd.to_numeric)
        rows = numbers.to_numpy(float, na_value=math.nan) * (100.0 if "(%)" in header else 1.0)
        texts = [_number_text(column.digits, *row) for row in rows.tolist()]
        shown[name] = ShownColumn(header, texts, is_number=True)
    return shown


def _is_end(table: Table, frame: pd.DataFrame, name: str) -> bool:
    """Return True if ``name`` is a column of the frame with the end of an interval, or the SD, of
    another column of the frame, such as ``gap_low``, ``gap_high`` or ``reward_sd``."""
    start = re.sub("_(low|high|sd)$", "", name)
    both = start != name and {start, name} <= {*frame.columns}
    return both and table.column(start).ending in ("[]", "±", "[*]")


def _number_text(digits: str, value: float, low: float, high: float, sd: float) -> str:
    """Return a number with its SD and interval, where they are not NaN, as text; ``digits`` as in
    :class:`.Column`. An interval of no length is left out (:func:`.in_brackets`)."""
    decimals, is_p = int(digits) if digits.isdigit() else None, digits == "p"
    spread = "" if math.isnan(sd) else f" ± {number(sd, decimals)}"
    text = number(value, 3 if is_p else decimals)
    text = "< 0.001" if is_p and value < 0.001 else text
    return f"{text}{spread} {in_brackets(low, high, decimals)}".strip()


def html_table(table: Table, frame: pd.DataFrame, caption: str) -> str:
    """Return a table in HTML.

    Each row has a link to itself and its classes (:func:`classes_of`). A column of texts that are
    the same in all rows, except the first column, moves to the caption if there are three rows or
    more. Cells without a value are empty.
    """
    slug = slugs(map(str, frame.index))
    cells: list[list[str]] = []
    heads: list[str] = []
    for column, (header, shown, is_number) in shown_columns(table, frame).items():
        texts = [
            html.escape(text).replace(" †", "&nbsp;†") if text != NONE else "" for text in shown
        ]
        head = f'<span data-column="{html.escape(column)}">{html.escape(header)}</span>'
        if cells and len(texts) > 2 and len(set(texts)) == 1 and not is_number:
            caption += f" ({header}: {html.unescape(texts[0])})"
            continue
        if column == "method" and table.id == "methods":  # ids stand in one table
            ids = [html.escape(one_line(str(label))) for label in frame[column]]
            pairs = zip(texts, ids, strict=True)
            texts = [text + f"<small>{id_}</small>" * (text != id_) for text, id_ in pairs]
        if not is_number:
            head = f'<span class="text">{head}</span>'
            texts = [f'<span class="text">{text}</span>' for text in texts]
        if not cells:
            texts = [
                f'<span title="row {html.escape(row)}">{text}</span><a class="link" '
                f'href="#row-{table.id}-{id_}" tabindex="-1" aria-label="Link to this row"></a>'
                for (row, id_), text in zip(slug.items(), texts, strict=True)
            ]
        cells.append(texts)
        heads.append(f'<th scope="col">{head}</th>')
    lines = "\n".join(
        f'<tr id="row-{table.id}-{id_}" class="{names}">'
        f"{''.join(f'<td>{text}</td>' for text in row)}</tr>"
        for id_, names, row in zip(
            slug.values(), classes_of(table, frame), zip(*cells, strict=True), strict=True
        )
    )
    return (
        f'<table id="table-{table.id}">\n<caption><span>{html.escape(caption)}</span></caption>\n'
        f"<thead><tr>{''.join(heads)}</tr></thead>\n<tbody>\n{lines}\n</tbody>\n</table>"
    )


def classes_of(table: Table, frame: pd.DataFrame) -> list[str]:
    """Return the HTML classes of each row, separated by a space: ``own`` for a method from a file,
    if the table has other methods, and ``setting``, in the ranking, for a setting or an ablation
    of a built-in method that has a row, too."""
    is_own = [label in frame.attrs.get("own", ()) for label in frame.get("method", frame.index)]
    is_folded = is_setting(frame) & (table.id == "ranking") & ~np.array(is_own, dtype=bool)
    return [
        " ".join(["own"] * (own and not all(is_own)) + ["setting"] * folded)
        for own, folded in zip(is_own, is_folded, strict=True)
    ]


def latex_table(table: Table, frame: pd.DataFrame, caption: str, notes: Sequence[str] = ()) -> str:
    """Return a table of :data:`IN_LATEX`, whose rows are ``frame``, in LaTeX, with booktabs and
    longtable, in the columns named there; without settings and ablations (:func:`.is_setting`),
    except in tables ``contexts`` and ``methods``. Raises KeyError for another table.

    ``notes`` are sentences below the table, with the meaning of a dagger in table or notes;
    ``caption`` and ``notes`` are plain text, which is escaped.
    """
    frame = frame if table.id in ("contexts", "methods") else frame[~is_setting(frame)]
    wanted = IN_LATEX[table.id].split(", ")
    columns = shown_columns(table, frame)
    chosen = [columns[name] for want in wanted for name in columns if fnmatch(name, want)]
    # Two columns may have one header.
    cells = pd.DataFrame({place: map(latex, each.texts) for place, each in enumerate(chosen)})
    cells = cells.set_axis([latex(each.header) for each in chosen], axis="columns")
    body = cells.style.hide(axis="index").to_latex(
        environment="longtable",
        hrules=True,
        column_format="".join("r" if each.is_number else "l" for each in chosen),
        caption=latex(caption),
        label=f"tab:coartic-{table.id}",
    )
    if "$\\dagger$" in body or any("†" in note for note in notes):
        notes = [*notes, RECONSTRUCTED]
    needs = "% needs \\usepackage{booktabs,longtable} and \\usepackage[T1]{fontenc}"
    text = "\n".join([needs, body, *map(latex, notes), ""])
    xelatex = "% needs XeLaTeX or LuaLaTeX, and a font that has the characters of \\symbol\n"
    return xelatex * ("\\symbol" in text) + text
