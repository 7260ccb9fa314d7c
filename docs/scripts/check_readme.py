"""Compare the numbers in the table of README.md with a results folder of suite ``comparison``.

    python docs/scripts/check_readme.py FOLDER

The script prints the differences. Differences are not an error.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pandas as pd

from coartic.analysis import TABLES, Study, interval, load

README = Path(__file__).parents[2] / "README.md"
COLUMNS = ("gap", "gap_in_noise", "share")
"""Columns of :func:`ranking_of` that the table of README shows, in its order."""
NOISE = "motor_noise=0.01"
"""World of the second column of the table: methods practise and are judged in this world."""


def rows_of(text: str) -> dict[str, tuple[str, ...]]:
    """Return a dict that maps each row of README's table to its numbers.

    The numbers are strings in per cent: the gap without noise, the gap with motor noise, and the
    share of the possible gain.
    """
    row = r"^\| \**(.+?)\**(?: of the paper|:.*?)? \| .+? \| (.+?%.*?) \| (.+?%.*?) \| (.+?) \|$"
    rows = re.findall(row, text, re.MULTILINE)
    return {name: tuple(cell.replace("*", "") for cell in cells) for name, *cells in rows}


def differences(text: str, ranking: pd.DataFrame) -> tuple[int, list[str]]:
    """Compare README's table with a ranking whose index has the titles of methods.

    ``text`` is the text of README. Returns the number of rows of README's table, and a line for
    each row that differs.
    """
    lines, rows = [], rows_of(text)
    for name, printed in rows.items():
        titles = [title for title in ranking.index if name in (title, title.partition(" (")[0])]
        titles.sort(key=len)  # without a setting before those with one
        if not titles:
            lines.append(f"{name}: not in this folder")
            continue
        row, decimals = ranking.loc[titles[0]], (cell.split()[0].partition(".") for cell in printed)
        computed = tuple(
            interval(row, column, len(digits), 100, " %")
            for column, (*_, digits) in zip(COLUMNS, decimals, strict=True)
        )
        if computed != printed:
            lines.append(
                f"{name}: gap {computed[0]}, with motor noise {computed[1]}, share {computed[2]}"
            )
    return len(rows), lines


def ranking_of(study: Study) -> pd.DataFrame:
    """Return the ranking in the paper's world, with gaps in the noisy world.

    The frame is indexed by the titles of methods. The columns ``gap_in_noise``,
    ``gap_in_noise_low`` and ``gap_in_noise_high`` are the gap in the world with noise.
    """
    paper, noise = (TABLES["ranking"](study.worlds[world]) for world in ("", NOISE))
    ends = "", "_low", "_high"
    of_noise = noise[[f"gap{end}" for end in ends]].reindex(paper.index)
    ranking = paper.assign(**{f"gap_in_noise{end}": of_noise[f"gap{end}"] for end in ends})
    return ranking.set_axis(study.methods.title.reindex(ranking.index))


def main(folder: str) -> None:
    """Print the differences between the table of README and a results folder."""
    ranking = ranking_of(load(folder))
    count, lines = differences(README.read_text("utf-8"), ranking)
    print(f"{count - len(lines)} of {count} rows are equal to the table of README.")
    print(*(f"  {line}" for line in lines), sep="\n", end="\n" if lines else "")


if __name__ == "__main__":
    main(sys.argv[1])
