"""Fill the tables of pages from files that ship.

    python docs/scripts/fill_tables.py

A page has a table between the lines ``<!-- table NAME -->`` and ``<!-- end -->``.
``docs/tables.toml`` says for each NAME which rows and columns of which CSV file it shows.
"""

import re
import tomllib
from functools import cache
from pathlib import Path

import pandas as pd

from coartic.analysis.tables import column_of, number_text

ROOT = Path(__file__).parents[2]
TABLES = tomllib.loads((ROOT / "docs" / "tables.toml").read_text("utf-8"))
MARKED = re.compile(r"^( *)<!-- table (\S+) -->\n.*?^ *<!-- end -->$", re.DOTALL | re.MULTILINE)
ENDS = {"[]": ("", "_low", "_high"), "±": ("", "_sd")}


@cache
def read(file):
    """Return a CSV file of the repository, indexed by its first column."""
    return pd.read_csv(ROOT / file, index_col=0)


def pages():
    """Return all pages."""
    return [ROOT / "README.md", *ROOT.glob("docs/**/*.md"), *ROOT.glob("studies/**/*.md")]


def rows_of(name, read=read):
    """Return the headings of a table, and the cells of each row."""
    table, columns = TABLES[name], []
    for line in table["columns"].splitlines():
        column, _, file = line.rpartition("| ") if line.endswith(".csv") else (line, "", "")
        columns += [(column_of(column), file or table["file"])] if line.strip() else []
    rows = []
    for key, words in table["rows"].items() if "rows" in table else _all_rows(read(table["file"])):
        rows.append([words] if isinstance(words, str) else [*words])
        for column, file in columns:
            row, scale = read(file).loc[key], 100.0 if "(%)" in column.heading else 1.0
            ends = ENDS.get(column.ending, ("",))
            rows[-1].append(number_text(column, *(scale * row[column.name + end] for end in ends)))
    return [*table["words"], *(column.heading for column, _ in columns)], rows


def _all_rows(frame):
    """Return the rows of a file with their names."""
    return [(key, key) for key in frame.index]


def markdown(name):
    """Return the lines of a table."""
    headings, rows = rows_of(name)
    words = len(TABLES[name]["words"])
    ruler = ["---"] * words + ["---:"] * (len(headings) - words)
    return [f"| {' | '.join(cells)} |" for cells in (headings, ruler, *rows)]


def filled(text):
    """Return a page with its tables filled."""

    def fill(found):
        lines = [f"<!-- table {found[2]} -->", *markdown(found[2]), "<!-- end -->"]
        return "\n".join(found[1] + line for line in lines)

    return MARKED.sub(fill, text)


if __name__ == "__main__":
    for page in pages():
        page.write_text(filled(page.read_text("utf-8")), "utf-8")
