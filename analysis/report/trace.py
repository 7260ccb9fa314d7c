"""Runs behind the rows of a report's tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from coartic import CoarticError
from coartic.analysis.report.render import columns_of, guarded, is_number, texts_of
from coartic.analysis.study import Study
from coartic.analysis.table import SHORT_ID, Table
from coartic.analysis.words import NONE, marked, number
from coartic.internal.text import plain
from coartic.runs.plan import hash_of, label_of


def tables_of(folder: Path) -> dict[str, Path]:
    """Return the CSV files of the tables of the report in a folder or below it, by id.

    Raises CoarticError if the folder has no report, or several.
    """
    here = folder.resolve()
    files = [path for path in folder.glob("**/tables/*.csv") if path.is_file()]
    files = [path for path in files if path.resolve().is_relative_to(here)]  # and no link elsewhere
    reports = sorted({path.parent for path in files})
    if not reports:
        raise CoarticError(f"there is no report in {folder}. `coartic report FOLDER` writes one.")
    if len(reports) > 1:
        shown = ", ".join(str(path.parent) for path in reports[:4])
        raise CoarticError(f"there are several reports in {folder}: name one with --in ({shown}).")
    return {path.stem: path for path in sorted(files) if path.parent == reports[0]}


def read_table(table: Path) -> pd.DataFrame:
    """Read a table of a report. Raises CoarticError for another file."""
    try:
        frame = pd.read_csv(table, index_col="row", keep_default_na=False, na_values=[""])
        if "run_ids" not in frame or not frame.index.is_unique:
            raise ValueError("its rows do not name runs")
        frame = frame.map(unguarded).rename(index=unguarded)
    except ValueError as error:
        raise CoarticError(f"{table} is no table of a report: {plain(str(error))}") from None
    return frame


def unguarded(value: Any) -> Any:
    """Return a value without the apostrophe that :func:`.render.guarded` puts before it."""
    return value[1:] if isinstance(value, str) and value == guarded(value[1:]) else value


def stamp(runs: pd.DataFrame) -> str:
    """Return the hash of the results of runs, by which a report identifies its runs."""
    return hash_of(sorted(zip(runs.run_id, runs.result, strict=True)))


def beginnings(table: Table, frame: pd.DataFrame) -> list[tuple[str, str]]:
    """Return the ids of a table's rows, with the first two columns of text that the page shows."""
    words = [name for name in columns_of(table, frame) if not is_number(frame[name])]
    texts = [texts_of(table, frame, name) for name in words[:2]]
    return [(row, ", ".join(first)) for row, *first in zip(frame.index, *texts, strict=True)]


def values_of(table: Table, frame: pd.DataFrame, row: str) -> list[tuple[str, str]]:
    """Return headings and values of a row as on the page, without missing values."""
    one = frame.loc[[row]]
    columns = columns_of(table, one).items()
    shown = ((header, texts_of(table, one, name)[0]) for name, header in columns)
    return [(header, text) for header, text in shown if text not in ("", NONE)]


def runs_behind(study: Study, ids: Sequence[str]) -> pd.DataFrame:
    """Return the runs with these ids, the lowest reward of a task first: run, task, seed, hands,
    reward, and the method if the runs have several."""
    chosen = study.runs[study.runs.run_id.isin(ids)]
    chosen = chosen.sort_values(["task", "reward"], kind="stable")
    labels = [*map(label_of, chosen.method, chosen.setting)]
    rewards = chosen.reward.astype("Float64").to_numpy(float, na_value=math.nan)
    shown = {
        "run": chosen.run_id.str[:SHORT_ID],
        "task": [marked(study.tasks[task]) for task in chosen.task],
        "method": [*study.methods.title[labels]],
        "seed": chosen.seed,
        "hands": chosen.hands.fillna(NONE),
        "reward (ticks)": [number(reward, 0) for reward in rewards.tolist()],
    }
    frame = pd.DataFrame(shown)
    return frame if len(set(frame.method)) > 1 else frame.drop(columns="method")
