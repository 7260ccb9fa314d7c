"""Make the stored tables and figures of the shipped suites again.

    python docs/scripts/store_tables.py

``docs/stored/SUITE`` has tables (CSV) and figures (SVG) of the results that ship.
"""

import lzma
import sys
from pathlib import Path

import pandas as pd

from coartic.analysis import FIGURES, TABLES, Study, by_task
from coartic.analysis.study import load
from coartic.runs.shipped import PACKED, SHIPPED_FOLDER, shipped_hashes
from coartic.runs.store import RUNS_FILE

ROOT = Path(__file__).parents[2]
STORED = ROOT / "docs" / "stored"
NOISE = "motor_noise=0.01"
WIDTH = 3.5
"""Width of the figures, in inches."""


def make_table(study, name):
    """Return a stored table of a study, without ids of runs.

    ``name`` is the id of a table of the report; or ``by-task``, the means on each task; or
    ``random-tasks``, the mean gap of each method over the instances of the families with up to
    eight goals, without noise and with it.
    """
    if name == "random-tasks":
        return pd.DataFrame(
            {
                column: over_random_tasks(study.worlds[world])
                for column, world in (("gap", ""), ("gap_in_noise", NOISE))
            }
        ).rename_axis("row")
    world = NOISE if name.endswith(NOISE) else ""
    study, name = study.worlds[world], name.removesuffix(f"-in-{NOISE}")
    if name == "by-task":
        return by_task(study.runs).set_index("task")
    return TABLES[name](study).drop(columns="run_ids")


def over_random_tasks(study: Study) -> pd.Series:
    """Return the mean gap of each ranked row over tasks; NaN if it lacks a task."""
    runs = study.runs[~study.runs.family.str.startswith("many-goals/")]
    by_row = runs.pivot_table("gap", "ranked_as", "task", dropna=False)
    return by_row.mean(axis=1).where(by_row.notna().all(axis=1)).dropna()


def draw(study, name):
    """Return a stored figure of a study."""
    return FIGURES[name](study.worlds[""], width=WIDTH).figure


def main():
    """Write all tables and figures that are stored already."""
    sys.path.insert(0, str(ROOT / "studies"))
    from stored import stored_picture

    for suite in shipped_hashes():
        unpack(suite, ROOT / "build" / "shipped" / suite)
        study = load(ROOT / "build" / "shipped" / suite)
        for path in sorted((STORED / suite).glob("*.csv")):
            table = make_table(study, path.stem)
            table.to_csv(path, float_format="%.6g", lineterminator="\n")
        for path in sorted((STORED / suite).glob("*.svg")):
            path.write_bytes(stored_picture(draw, study, path.stem))


def unpack(suite, folder):
    """Unpack the shipped results of a suite into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    packed = (SHIPPED_FOLDER / f"{suite}{PACKED}").read_bytes()
    (folder / RUNS_FILE).write_bytes(lzma.decompress(packed))


if __name__ == "__main__":
    main()
