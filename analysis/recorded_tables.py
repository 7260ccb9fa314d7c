"""Tables that people record, as CSV files or frames: their names and numbers, and sentences on
their rows. Knows nothing of tasks and hits."""

from __future__ import annotations

import csv
import io
import re
import sys
import unicodedata
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pandas.api.types import infer_dtype

from coartic import CoarticError
from coartic.internal.limits import brief_value
from coartic.internal.text import counted, foreign_file

NAMED = 5
"""Number of rows, or other things of a kind, that a sentence names."""
_INNER = ("coartic", "pydantic")  # packages whose lines no warning names
_MONTH = "(jan|feb|m[aä]r|apr|ma[iy]|jun|jul|aug|sep|o[ck]t|nov|de[cz])[a-z]*"
_DATE = re.compile(rf"\d+\W+{_MONTH}\W*\d*|{_MONTH}\W+\d+|\d+([-./])\d+\3\d{{2,4}}", re.IGNORECASE)
_HYPHENS = str.maketrans(dict.fromkeys("‐‑‒–—−﹣－", "-"))


def read_table(path: str | Path, kind: str) -> tuple[pd.DataFrame, list[str]]:
    """Return a CSV file as a frame of texts and numbers, and a name, such as ``line 2``, for each
    row. Raises CoarticError for a file of another program, and for a file that cannot be read, is
    not in UTF-8, is separated by other characters than commas, has rows that do not fit its
    headings, or repeats one or all headings; ``kind``, such as ``recorded hits are``, is for a
    message."""
    if words := foreign_file(str(path), f"{kind} a CSV file, see docs/howto/people.md"):
        raise CoarticError(words)
    try:
        content = Path(path).read_bytes()
        text = content.decode("utf-8-sig")
    except OSError as error:
        raise CoarticError(f"{path} cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        wide = content[:2] in (b"\xff\xfe", b"\xfe\xff") or b"\0" in content[:200]
        kind = "in UTF-16, as Excel and Notepad write 'Unicode'" if wide else "not in UTF-8"
        kind = f"damaged from byte {content.find(0)} on" if len(text) > 1 and not wide else kind
        raise CoarticError(f"{path} is {kind}: save it as CSV in UTF-8")
    frame, lines = _plain_table(text) or _odd_table(path, text)
    again = np.flatnonzero(frame.iloc[:, :1] == frame.columns[:1]).tolist()
    if again:
        others = also([lines[row] for row in again])
        raise CoarticError(f"{path}, {lines[again[0]]}: the headings are there again{others}")
    return frame, lines


def _plain_table(text: str) -> tuple[pd.DataFrame, list[str]] | None:
    """Return frame and names of rows as :func:`read_table` does, by a fast parser; None for a text
    without rows, or with quotes, ``#``, blank lines, rows that differ in length, odd line ends, or
    empty, equal or single headings."""
    head, _, body = text.replace("\r\n", "\n").removesuffix("\n").partition("\n")
    headings, rows = [*map(_written, head.split(","))], body.count("\n") + 1
    if (
        any(odd in text for odd in '"#')
        or "\r" in body
        or not all(headings)
        or not 1 < len({*headings}) == len(headings)
        or body.count(",") != rows * (len(headings) - 1)
        or body.partition("\n")[0].count(",") != len(headings) - 1  # else pandas shifts columns
    ):
        return None
    try:
        frame = pd.read_csv(
            io.StringIO(body), names=headings, dtype={"subject": str, "hand": str}, na_values=[""],
            keep_default_na=False, skipinitialspace=True, low_memory=False,
        )  # fmt: skip
    except ValueError:  # of rows with more values
        return None
    if len(frame) != rows or frame.isna().all(axis=1).any():
        return None
    return frame, [f"line {row}" for row in range(2, rows + 2)]


def _odd_table(path: str | Path, text: str) -> tuple[pd.DataFrame, list[str]]:
    """Return frame and names of rows as :func:`read_table` does, line by line. Raises CoarticError
    for another separator, a row with another number of values than the headings, an open quote, and
    a repeated heading. Warns of rows with as many values as headings that are left out because they
    begin with #."""
    reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True, strict=True)
    headings: list[str] = []
    rows, lines, wrong, hidden = [], [], [], []
    try:
        for fields in reader:
            while fields and (not headings or len(fields) > len(headings)):
                if fields[-1].strip():
                    break
                fields.pop()
            first = fields[0].strip() if fields else ""
            if first.startswith("#"):
                hidden += [f"line {reader.line_num}"] * (len(fields) == len(headings))
                continue
            if not any(map(str.strip, fields)):
                continue
            if not headings and first.startswith("sep=") and not any(fields[1:]):
                continue
            if not headings:
                headings = [*map(_written, fields)]
                for separator in [odd for odd in ";\t|" if len(fields) == 1 and odd in fields[0]]:
                    raise CoarticError(
                        f"{path}: the separator is {separator!r}; needed are values separated by "
                        f"commas, and numbers with a decimal point: found are {headings[0]}"
                    )
            elif len(fields) != len(headings):
                wrong.append((reader.line_num, len(fields)))
            else:
                rows.append(fields)
                lines.append(f"line {reader.line_num}")
    except csv.Error as error:
        quote = "; is a quotation mark open?" * ("unexpected end" in str(error))
        raise CoarticError(f"{path}, line {reader.line_num}: {error}{quote}") from None
    if wrong:
        raise CoarticError(
            f"{path}, line {wrong[0][0]}: it has {counted(wrong[0][1], 'value')}, "
            f"the headings are {len(headings)}: {', '.join(headings)}"
            f"{'; is there a decimal comma?' * (wrong[0][1] > len(headings))}"
            f"{also([f'line {line}' for line, _ in wrong])}"
        )
    if twice := [name for n, name in enumerate(headings) if name in headings[:n]]:
        raise CoarticError(f"{path} has two columns {twice[0]!r}")
    if hidden:
        warn(f"{path}, {hidden[0]}: it begins with # and is left out{also(hidden)}")
    return pd.DataFrame(rows, columns=headings, dtype=object), lines


def also(names: Sequence[str]) -> str:
    """Return `` (also B, C, D, E, 2 more)`` for names A to G: the second to the fifth name and the
    number of others; empty for a single name or none."""
    named = [*names[1:NAMED], *[f"{len(names) - NAMED} more"] * (len(names) > NAMED)]
    return f" (also {', '.join(named)})" if named else ""


def warn(text: str, refuse: bool = False) -> None:
    """Warn with this text, at the line outside of this package that called it; with ``refuse``
    raise CoarticError with this text in place of a warning."""
    if refuse:
        raise CoarticError(text)
    frame, level = sys._getframe(), 1
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] in _INNER:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, stacklevel=level)


def _written(text: str) -> str:
    """Return text in Unicode's composed form (NFC), with a single space for blanks of any kind
    between words, none at the ends, a hyphen for dashes and minus signs, and without format
    characters (Cf)."""
    shown = "".join(c for c in text.translate(_HYPHENS) if unicodedata.category(c) != "Cf")
    return " ".join(unicodedata.normalize("NFC", shown).split())


def row_names(frame: pd.DataFrame) -> list[str]:
    """Return a name for each row of a frame, such as ``row 2``, by its index."""
    return [f"row {brief_value(row)}" for row in frame.index.tolist()]


def as_names(values: pd.Series) -> pd.Series:
    """Return names as texts, with single spaces and plain hyphens (:func:`_written`); whole numbers
    are without ``.0``, and a missing name is an empty text."""
    texts = {}
    for value in values.dropna().unique():
        is_whole = isinstance(value, float | np.floating) and value.is_integer()
        texts[value] = _written(f"{value:.0f}" if is_whole else str(value))
    return values.map(texts).astype(object).where(values.notna(), "")


def as_numbers(values: pd.Series) -> NDArray[np.float64]:
    """Return values as numbers, shape ``(n,)``, also texts with typographic minus signs; NaN for a
    value that pandas reads as no real number. Infinity is a number, True and False are not."""
    values = values.astype(object) if isinstance(values.dtype, pd.CategoricalDtype) else values
    if infer_dtype(values, skipna=True) in ("boolean", "complex", "mixed", "mixed-integer"):
        values = values.astype(object).where(
            ~values.map(lambda value: isinstance(value, bool | np.bool_ | complex))
        )
    elif values.dtype.kind not in "iufO":  # durations of pandas would be nanoseconds
        values = values.astype(str)
    numbers = pd.to_numeric(values, errors="coerce")
    array = np.array(numbers.to_numpy(np.float64, na_value=np.nan))
    for row in np.flatnonzero(np.isnan(array)):
        if isinstance(text := values.iloc[row], str) and text:
            array[row] = pd.to_numeric(_written(text), errors="coerce")
    return array


def why_no_number(value: object) -> str:
    """Return in words why a value is no number: it looks like a date, or a character spoils it; for
    other values return that a number is needed."""
    text = _written(str(value))
    if _DATE.fullmatch(text):
        return "it looks like a date that a spreadsheet made of a number: import numbers as text"
    begin = re.match(r"[+-]?\d*\.?\d*(e[+-]?\d+)?", text, re.IGNORECASE | re.ASCII)
    spoils = text[begin.end() :][:1] if begin else ""
    if not (spoils and re.search(r"\d", text)):
        return "needed is a number; leave out the row of a hit that is missing"
    point = {",": ": write a decimal point, and nothing between thousands",
             ":": ": write seconds, not the time of day"}.get(spoils, "")  # fmt: skip
    kind = unicodedata.name(spoils, "without a name").lower()
    return f"{spoils!r} ({kind}) makes it no number{point}"
