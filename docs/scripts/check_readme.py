"""Compare the table of README.md with a results folder of suite ``comparison``, number by number:
``python docs/scripts/check_readme.py FOLDER``. A difference is printed, and is no error."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pandas as pd

from coartic.analysis import TABLES, interval, load

README = Path(__file__).parents[2] / "README.md"
COLUMNS = ("gap", "noisy_gap", "share")
"""Columns of the ranking that the table of README has, in order."""


def rows_of(text: str) -> dict[str, tuple[str, ...]]:
    """Return gap, gap with motor noise and share as printed, in per cent, by the name of the
    row."""
    row = r"^\| \**(.+?)\**(?: of the paper|:.*?)? \| .+? \| (.+?%.*?) \| (.+?%.*?) \| (.+?) \|$"
    rows = re.findall(row, text, re.MULTILINE)
    return {name: tuple(cell.replace("*", "") for cell in cells) for name, *cells in rows}


def differences(text: str, ranking: pd.DataFrame) -> tuple[int, list[str]]:
    """Return the number of rows of README's text, and a line for each that the ranking, by the
    titles of its methods, has otherwise."""
    lines, rows = [], rows_of(text)
    for name, printed in rows.items():
        titles = [title for title in ranking.index if title.partition(" (")[0] == name]
        if not titles:
            lines.append(f"{name}: not in this folder")
            continue
        row, decimals = ranking.loc[titles[0]], (cell.split()[0].partition(".") for cell in printed)
        there = tuple(
            interval(row, column, len(digits), 100, " %")
            for column, (*_, digits) in zip(COLUMNS, decimals, strict=True)
        )
        if there != printed:
            lines.append(f"{name}: gap {there[0]}, with motor noise {there[1]}, share {there[2]}")
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
