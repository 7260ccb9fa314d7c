"""Compare the table of README.md with a results folder of suite ``comparison``.

    python docs/scripts/check_readme.py FOLDER

The script prints the rows that differ. Differences are not an error.
"""

import sys
from pathlib import Path

from fill_tables import rows_of
from store_tables import make_table

from coartic.analysis import load


def differences(study):
    """Return the number of rows of README's table, and a line for each row that differs."""

    def read(file):
        return make_table(study, Path(file).stem)

    shipped, here = rows_of("readme")[1], rows_of("readme", read)[1]
    return len(shipped), [
        f"{ours[0].partition(':')[0]}: gap {ours[2]}, with motor noise {ours[3]}, share {ours[4]}"
        for theirs, ours in zip(shipped, here, strict=True)
        if theirs != ours
    ]


def main(folder):
    """Print the differences between the table of README and a results folder."""
    count, lines = differences(load(folder))
    print(f"{count - len(lines)} of {count} rows are equal to the table of README.")
    print(*(f"  {line}" for line in lines), sep="\n", end="\n" if lines else "")


if __name__ == "__main__":
    main(sys.argv[1])
