"""Compare the table of README.md with a results folder of suite ``comparison``, number by number:
``python docs/scripts/check_readme.py FOLDER``. A difference is printed, and is no error."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pandas as pd

from coartic.analysis.sections import TABLES
from coartic.analysis.study import load

README = Path(__file__).parents[2] / "README.md"


def rows_of(text: str) -> dict[str, tuple[list[str], list[str]]]:
    """Return the numbers of gap and share as printed, in per cent, by the name of the row."""
    row = r"^\| \**(.+?)\**(?: of the paper|:.*?)? \| .+? \| (.+?%.*?) \| (.+?) \|$"
    rows = re.findall(row, text, re.MULTILINE)
    return {name: (numbers_in(gap), numbers_in(share)) for name, gap, share in rows}


def numbers_in(text: str) -> list[str]:
    """Return the numbers of a text, as they are printed."""
    return re.findall(r"-?\d+(?:\.\d+)?", text.replace("\N{MINUS SIGN}", "-"))


def is_same(printed: list[str], row: pd.Series, column: str) -> bool:
    """Return whether a row rounds, in per cent, to the printed numbers: value, then interval."""
    values = [100 * row[name] for name in (column, f"{column}_low", f"{column}_high")]
    there = [value for value in values if pd.notna(value)]
    decimals = [len(text.partition(".")[2]) for text in printed]
    rounded = [f"{value:.{places}f}" for value, places in zip(there, decimals, strict=False)]
    return len(there) == len(printed) and rounded == printed


def differences(text: str, ranking: pd.DataFrame) -> tuple[int, list[str]]:
    """Return the number of rows of README's text, and a line for each that the ranking, by the
    titles of its methods, has otherwise."""
    lines, rows = [], rows_of(text)
    for name, (gap, share) in rows.items():
        titles = [title for title in ranking.index if title.partition(" (")[0] == name]
        if not titles:
            lines.append(f"{name}: not in this folder")
            continue
        row = ranking.loc[titles[0]]
        if not (is_same(gap, row, "gap") and is_same(share, row, "share")):
            lines.append(f"{name}: gap {100 * row.gap:.2f} %, share {100 * row.share:.1f} %")
    return len(rows), lines


def main(folder: str) -> None:
    """Print what differs between README and a folder."""
    study = load(folder)
    ranking = TABLES["ranking"](study)
    ranking.index = study.methods.title.reindex(ranking.index)
    count, lines = differences(README.read_text("utf-8"), ranking)
    print(f"As the table of README: {count - len(lines)} of {count} rows.")
    print(*(f"  {line}" for line in lines), sep="\n", end="\n" if lines else "")


if __name__ == "__main__":
    main(sys.argv[1])
