"""Tables as HTML and LaTeX.

:data:`~coartic.analysis.table.COLUMNS` says how columns are called and formatted. A column that
ends in ``_low``, ``_high`` or ``_sd`` is shown behind the one that it belongs to.
"""

from __future__ import annotations

import html
import math
import textwrap
from collections.abc import Sequence
from fnmatch import fnmatch
from typing import Any

import numpy as np
import pandas as pd

from coartic.analysis.methods import is_built_in, look_alike, name_of
from coartic.analysis.table import COLUMNS, Column
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

TONES = {
    "supported": "good",
    "equivalent": "good",
    "not supported": "bad",
    "different": "bad",
    "undecided": "open",
    "depends on the goals": "open",
}
"""Class of a verdict on the page, by its words."""
IN_LATEX = {
    "own": "task, method, runs, reward, gap, nearest, nearest_gap",
    "settings": "task, method, runs, reward, gap_ticks, p_holm",
    "contexts": "place, method, runs, distance, standardised_difference, p_holm, p_random_search",
    "published": "task, condition, published, ours, runs, difference, verdict",
    "claims": "statement, verdict, p_holm",
    "ranking": "method, gap, on *",
    "runtimes": "method, reached, trials_to_quarter, trials_to_half, forward_kinematics_to_half",
    "hands": "task, condition, hands, published, ours, runs, difference",
    "learning": "task, method, runs, after_*, trials_to_half_gain",
    "signatures": "task, method, runs, first, total, as_in_isolation, preshaping",
    "family-gaps": "method, gap, in *",
    "tasks": "task, arms, base, initial, optimum, bound",
    "methods": "task, method, runs, reward, gap, hands, trials",
}
"""Tables for a paper, and their columns, which fit the width of a text; others are CSV alone."""
FORMULA = ("=", "+", "-", "@")
"""Beginnings of text that spreadsheets compute."""
MOST_ROWS = 50
"""Rows of a table on one page; a longer one is CSV alone."""


def table_csv(frame: pd.DataFrame) -> str:
    """Return a table as CSV, with an apostrophe before text that a spreadsheet would take for a
    formula; :func:`.trace.rows_of` reads it."""
    return frame.map(guarded).rename(index=guarded).to_csv(lineterminator="\n")


def guarded(value: Any) -> Any:
    """Return a value; text that a spreadsheet would take for a formula behind an apostrophe."""
    return f"'{value}" if isinstance(value, str) and value.startswith(FORMULA) else value


def column_of(name: str) -> Column:
    """Header and format of a column; columns of tasks and families go by their names."""
    kind, _, what = name.partition(" ")
    if name.startswith("half on "):
        return Column(page=False)
    if kind in ("on", "in") and what:
        return Column(f"{what.partition('/')[0]} (%)", 1, percent=True)
    return COLUMNS.get(name, Column())


def columns_of(frame: pd.DataFrame) -> dict[str, str]:
    """Columns of a table that the page and LaTeX show, with their headers.

    A task goes by its name, with † where it is reconstructed.
    """
    headers, tasks = {}, frame.attrs.get("tasks", {})
    names = list(frame.columns)
    if "verdict" in names:  # it is what one looks for, also where a screen has room for two columns
        names.insert(1, names.pop(names.index("verdict")))
    for name in names:
        if not name.endswith(("_low", "_high", "_sd")) and column_of(name).page:
            header = column_of(name).header or name.replace("_", " ")
            if name == "gap" and not frame.attrs.get("known", True):
                header = "gap to the best of this folder (%)"
            if name.startswith("on ") and name[3:] in tasks:
                header = f"{tasks[name[3:]]} (%)"
            if f"{name}_sd" not in frame:
                header = header.removesuffix(" ± SD")
            has_interval = f"{name}_low" in frame and frame[f"{name}_low"].notna().any()
            interval = f" [95{NARROW_SPACE}%]" if has_interval and "[" not in header else ""
            headers[name] = f"{header}{interval}"
    return headers


def is_number(values: pd.Series) -> bool:
    """Whether a column holds numbers, or no value at all."""
    return bool(pd.api.types.is_numeric_dtype(values.infer_objects())) or not values.notna().any()


def texts_of(frame: pd.DataFrame, name: str) -> list[str]:
    """The values of a column as text, with SDs and intervals that belong to them."""
    column = column_of(name)
    if not is_number(frame[name]):
        known = frame.attrs.get("methods", {}) if column.method else {}
        shown = name_of if column.method else one_line
        return [NONE if pd.isna(value) else known.get(value) or shown(str(value)) or NONE
                for value in frame[name]]  # fmt: skip
    columns = [f"{name}{ending}" for ending in ("", "_low", "_high", "_sd")]
    none = pd.Series(math.nan, frame.index)
    parts = [pd.to_numeric(frame.get(each, none)).to_numpy(float, na_value=math.nan)
             for each in columns]  # fmt: skip
    scaled = (100.0 if column.percent else 1.0) * np.column_stack(parts)
    texts = []
    for value, low, high, sd in scaled.tolist():
        spread = "" if math.isnan(sd) else f" ± {number(sd, column.digits)}"
        interval = in_brackets(low, high, column.digits)
        text = number(value, 3 if column.p else column.digits)
        text = "< 0.001" if column.p and value < 0.001 else text
        texts.append(f"{text}{spread} {interval}".strip())
    return texts


def html_table(frame: pd.DataFrame, name: str, caption: str) -> str:
    """A table for the page. Its first column holds while the others scroll; rows have links, those
    of methods from files beside others a class.

    The caption says what is the same in all rows.
    """
    ids_of = {row: f"row-{name}-{slug}" for row, slug in slugs(map(str, frame.index)).items()}
    cells: list[list[str]] = []
    heads: list[str] = []
    for column, header in columns_of(frame).items():
        texts = [html.escape(text).replace(" †", "&nbsp;†") for text in texts_of(frame, column)]
        head = f'<span data-column="{html.escape(column)}">{html.escape(header)}</span>'
        if cells and len(texts) > 2 and len(set(texts)) == 1 and not is_number(frame[column]):
            caption += f" ({header}: {html.unescape(texts[0])})"
            continue
        if column_of(column).method and name == "methods":  # ids stand in one table
            ids = [html.escape(one_line(str(label))) for label in frame[column]]
            pairs = zip(texts, ids, strict=True)
            texts = [text + f"<small>{id_}</small>" * (text != id_) for text, id_ in pairs]
        if not is_number(frame[column]):
            head = f'<span class="text">{head}</span>'
            tones = [TONES.get(text, "") if column == "verdict" else "" for text in texts]
            pairs = zip(tones, texts, strict=True)
            texts = [
                f'<span class="{f"text {tone}".strip()}">{text}</span>' for tone, text in pairs
            ]
        if not cells:
            labels = [html.escape(row) for row in ids_of]
            texts = [
                f'<span title="row {label}">{text}</span><a class="link" href="#{id_}" '
                'tabindex="-1" aria-label="Link to this row"></a>'
                for label, id_, text in zip(labels, ids_of.values(), texts, strict=True)
            ]
        cells.append(texts)
        heads.append(f'<th scope="col">{head}</th>')
    foreign = [not is_built_in(look_alike(str(label))) for label in frame.get("method", ())]
    marks = [' class="own"' * (is_own and not all(foreign)) for is_own in foreign]
    lines = "\n".join(
        f'<tr id="{id_}"{mark}>{"".join(f"<td>{text}</td>" for text in row)}</tr>'
        for id_, mark, row in zip(
            ids_of.values(), marks or [""] * len(frame), zip(*cells, strict=True), strict=True
        )
    )
    return (
        f'<table id="table-{name}">\n<caption><span>{html.escape(caption)}</span></caption>\n'
        f"<thead><tr>{''.join(heads)}</tr></thead>\n<tbody>\n{lines}\n</tbody>\n</table>"
    )


def latex_table(frame: pd.DataFrame, name: str, caption: str, notes: Sequence[str] = ()) -> str:
    """Return the columns of :data:`IN_LATEX` in LaTeX, with booktabs.

    A text that is the same in all rows stands in the caption. ``notes`` stand below the table, with
    what a dagger means where there is one.
    """
    columns = columns_of(frame)
    chosen = [c for want in IN_LATEX[name].split(", ") for c in columns if fnmatch(c, want)]
    cells, heads, sides = [], [], ""
    for column in chosen:
        texts, numbers = texts_of(frame, column), is_number(frame[column])
        if len({*texts}) == 1 < len(texts) and not numbers:
            caption += f" ({columns[column]}: {texts[0]})"
            continue
        side, longest = "r" if numbers else "l", max(map(len, texts))
        head = textwrap.wrap(columns[column], max(longest, 9), break_long_words=False)
        heads.append(f"\\shortstack[{side}]{{" + "\\\\{}".join(map(latex, head)) + "}")
        sides += "p{0.8\\linewidth}" if longest > 60 else side
        cells.append(list(map(latex, texts)))
    # Two columns may have one header.
    shown = pd.DataFrame(dict(enumerate(cells))).set_axis(heads, axis="columns")
    body = shown.style.hide(axis="index").to_latex(
        hrules=True,
        column_format=f"@{{}}{sides}@{{}}",
        caption=latex(caption),
        label=f"tab:coartic-{name}",
        position="tp",
        position_float="centering",
    )
    if "$\\dagger$" in body or any("†" in note for note in notes):
        notes = [*notes, RECONSTRUCTED]
    begin, end, below = "\\begin{tabular}", "\\end{tabular}", " ".join(map(latex, notes))
    if below:
        below = f"\n\n\\smallskip\\parbox{{\\linewidth}}{{\\footnotesize {below}}}"
    fit = "\\resizebox{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}{!}{"
    body = body.replace(begin, f"\\footnotesize\n{fit}{begin}", 1)
    body = body.replace(end, f"{end}}}{below}", 1)
    needs = "% needs \\usepackage{booktabs,graphicx} and \\usepackage[T1]{fontenc}"
    return f"{needs}\n{body}"
