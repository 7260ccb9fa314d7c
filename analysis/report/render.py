"""Tables as text: CSV, HTML, LaTeX, and plain strings for the terminal.

``columns.toml`` beside the tables says how columns are called and formatted. A column that ends in
``_low``, ``_high`` or ``_sd`` is shown behind the one that it belongs to.
"""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Iterable
from typing import Any

import pandas as pd
from pydantic import BaseModel, ConfigDict, TypeAdapter

from coartic.analysis import tables
from coartic.analysis.methods import name_of
from coartic.analysis.words import NONE, in_brackets, number, read_beside
from coartic.text import one_line

_COMPANIONS = ("_low", "_high", "_sd")
_TONES = {
    "supported": "good",
    "equivalent": "good",
    "not supported": "bad",
    "different": "bad",
    "undecided": "open",
    "used to choose the goals": "plain",
}
"""Class of a verdict on the page, by its words."""
PACKAGES = "% needs \\usepackage{booktabs,siunitx} and \\usepackage[T1]{fontenc}"
"""First line of every LaTeX table."""
_LATEX = str.maketrans(
    {
        **{sign: f"\\{sign}" for sign in "&%$#_{}"},
        **{"~": "\\textasciitilde{}", "^": "\\textasciicircum{}", "\\": "\\textbackslash{}"},
        **{"†": "$\\dagger$", "−": "$-$", "–": "--", "∞": "$\\infty$", "±": "$\\pm$"},
        **{"Δ": "$\\Delta$", "σ": "$\\sigma$", "ε": "$\\epsilon$", "↳": "", "\u202f": "\\,"},
        **{"“": "``", "”": "''", "<": "$<$", ">": "$>$", "×": "$\\times$"},
    }
)


class Column(BaseModel):
    """How a column is called and shown, as ``columns.toml`` says it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    header: str
    digits: int | None = None
    percent: bool = False
    p: bool = False
    method: bool = False
    page: bool = True


_COLUMNS = TypeAdapter(dict[str, Column]).validate_python(read_beside(tables.__file__, "columns"))


def column_of(name: str) -> Column:
    """How a column is shown; columns of tasks and families go by these."""
    kind, _, what = name.partition(" ")
    if kind in ("on", "in"):
        return Column(header=f"{what.partition('/')[0]} (%)", percent=True, digits=1)
    return _COLUMNS.get(name, Column(header=name.replace("_", " ")))


def shown(frame: pd.DataFrame, *, page: bool = True) -> pd.DataFrame:
    """A table as text under its headers; only what a page shows, or all but the run ids."""
    kept = [name for name in frame.columns if not name.endswith(_COMPANIONS)]
    if page:
        kept = [name for name in kept if column_of(name).page]
    else:
        kept = [name for name in kept if name != "run_ids"]
    texts = {_header(frame, name): _texts(frame, name) for name in kept}
    return pd.DataFrame(texts, index=frame.index)


def _header(frame: pd.DataFrame, name: str) -> str:
    header = column_of(name).header
    has_interval = f"{name}_low" in frame and frame[f"{name}_low"].notna().any()
    return f"{header} [95 %]" if has_interval and "[" not in header else header


def _texts(frame: pd.DataFrame, name: str) -> list[str]:
    """The values of a column, with what belongs to them."""
    column, nothing = column_of(name), pd.Series(math.nan, frame.index)
    scale = 100.0 if column.percent else 1.0

    def numeric(ending: str) -> list[float]:
        values = pd.to_numeric(frame.get(f"{name}{ending}", nothing))
        return (scale * values.astype("Float64")).to_numpy(float, na_value=math.nan).tolist()

    if not is_number(frame[name]):
        return [_word(value, column) for value in frame[name]]
    texts = []
    for value, low, high, sd in zip(*map(numeric, ("", "_low", "_high", "_sd")), strict=True):
        text = _number(value, column)
        text += "" if math.isnan(sd) else f" ± {number(sd, column.digits)}"
        texts.append(f"{text} {in_brackets(low, high, column.digits)}".strip())
    return texts


def is_number(values: pd.Series) -> bool:
    """Whether a column holds numbers; one without any value counts as such."""
    return bool(pd.api.types.is_numeric_dtype(values.infer_objects())) or not values.notna().any()


def _number(value: float, column: Column) -> str:
    if column.p and value < 0.001:
        return "< 0.001"
    return number(value, 3 if column.p else column.digits)


def _word(value: Any, column: Column) -> str:
    if value is None or value is pd.NA or (isinstance(value, float) and math.isnan(value)):
        return NONE
    if isinstance(value, float | int) and not isinstance(value, bool):
        return _number(float(value), column)
    return name_of(str(value)) if column.method else one_line(str(value)) or NONE


def html_table(frame: pd.DataFrame, name: str, caption: str) -> str:
    """A table for the page. Its first column holds while the others scroll; rows are named."""
    kept = [c for c in frame.columns if not c.endswith(_COMPANIONS) and column_of(c).page]
    text = shown(frame)
    cells = {
        header: _html_cells(frame, column, text[header])
        for header, column in zip(text.columns, kept, strict=True)
    }
    made = pd.DataFrame(cells, index=frame.index)
    first = made.columns[0]
    made[first] = [
        f'<span title="row {html.escape(str(row))}">{value}</span>'
        for row, value in zip(made.index, made[first], strict=True)
    ]
    made.columns = pd.Index(
        html.escape(header) if is_number(frame[column]) else _text(html.escape(header))
        for header, column in zip(made.columns, kept, strict=True)
    )
    table = made.to_html(
        index=False, escape=False, border=0, table_id=f"table-{name}", justify="unset"
    )
    head = f"<caption><span>{html.escape(caption)}</span></caption>\n  <thead>"
    return table.replace("<thead>", head, 1).replace("<th>", '<th scope="col">')


def _text(content: str) -> str:
    return f'<span class="text">{content}</span>'


def _html_cells(frame: pd.DataFrame, column: str, texts: Iterable[str]) -> list[str]:
    """The cells of a column as HTML: verdicts in colour, methods with their ids."""
    raw = frame[column]
    if column_of(column).method:
        return [_method_cell(str(label)) for label in raw]
    escaped = map(html.escape, texts)
    if is_number(raw):
        return list(escaped)
    if column == "verdict":
        return [f'<span class="text {_TONES.get(text, "")}">{text}</span>' for text in escaped]
    return list(map(_text, escaped))


def _method_cell(label: str) -> str:
    name = name_of(label)
    small = "" if name == label else f"<small>{html.escape(one_line(label))}</small>"
    return _text(f"{html.escape(name)}{small}")


def tone_of(verdict: str) -> str:
    """Class of a verdict on the page."""
    return _TONES.get(verdict, "plain")


def latex_table(frame: pd.DataFrame, name: str, caption: str) -> str:
    """A table for a paper, with booktabs; plain numbers stand in siunitx's S columns."""
    kept = [c for c in frame.columns if not c.endswith(_COMPANIONS) and column_of(c).page]
    text = shown(frame)
    plain = [is_number(frame[c]) and not _has_companions(frame, c) for c in kept]
    made = text.copy()
    for header, column, is_plain in zip(text.columns, kept, plain, strict=True):
        made[header] = (
            pd.to_numeric(frame[column]).astype("Float64").astype(float) if is_plain
            else [latex(value) for value in text[header]]
        )  # fmt: skip
    formats: dict[Any, Any] = {
        header: _siunitx(column_of(column))
        for header, column, is_plain in zip(text.columns, kept, plain, strict=True)
        if is_plain
    }
    columns = "".join("S" if is_plain else "l" for is_plain in plain)
    styler = made.style.format(formats, na_rep="{--}").hide(axis="index")
    styler = styler.format_index(latex, axis="columns")
    body = styler.to_latex(
        hrules=True,
        siunitx=True,
        column_format=columns,
        caption=latex(caption),
        label=f"tab:coartic-{name}",
        position="tp",
        position_float="centering",
    )
    return f"{PACKAGES}\n{body}"


def _has_companions(frame: pd.DataFrame, column: str) -> bool:
    return any(f"{column}{ending}" in frame for ending in _COMPANIONS)


def _siunitx(column: Column) -> Callable[[float], str]:
    """How siunitx reads a value: no thousands apart, a plain hyphen as the minus."""

    def shown_as(value: float) -> str:
        if math.isinf(value):
            return "{$\\infty$}"
        scaled = 100 * value if column.percent else value
        return (
            number(scaled, 3 if column.p else column.digits).replace("−", "-").replace("\u202f", "")
        )

    return shown_as


def latex(text: object) -> str:
    """Text with everything escaped that LaTeX would read as its own."""
    return one_line(str(text)).translate(_LATEX)


def csv_table(frame: pd.DataFrame) -> str:
    """The raw values, with the run ids behind each row."""
    return str(frame.to_csv(lineterminator="\n"))
