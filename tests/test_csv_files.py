"""The CSV files of a results folder: typed, said what they rest on, and traced."""

import re
from dataclasses import replace

import pandas as pd
import pytest

from coartic import CoarticError
from coartic.analysis.report.tables.files import FILES, METHOD_ROWS, csv_text
from coartic.analysis.report.trace import find_trace, trace_in_file
from tests.support.made_up import MadeUp
from tests.support.reports import changed_columns


@pytest.fixture(scope="module")
def tables(traced):
    return {name: file.table(traced) for name, file in FILES.items()}


def test_every_column_is_stated_and_typed(traced, tables):
    """A table refuses rows of one name and values of another kind than its column's."""
    for name, file in FILES.items():
        written = pd.read_csv(pd.io.common.StringIO(file.text(traced)), keep_default_na=False)
        assert list(written.columns) == [column.name for column in tables[name].columns]
        assert len(written) == len(tables[name].rows) > 0, name
        for row in tables[name].rows:
            assert row.all_cells <= traced.cells.keys()
    with pytest.raises(ValueError, match=r"methods has other columns .*'more'"):
        csv_text(METHOD_ROWS.layout, traced.methods.assign(more=1))


def test_rows_name_what_they_were_computed_from(traced, tables):
    for name, rows in (("anytime.csv", traced.anytime), ("targets.csv", traced.targets)):
        own = [((row.task, row.method),) for row in rows.itertuples()]
        assert [row.cells for row in tables[name].rows] == own
    pairs = {row.key: row.cells for row in tables["comparisons.csv"].rows}
    assert pairs["two-armed-1 dual-process/EC4 dual-process/EC3"] == (
        ("two-armed-1", "dual-process/EC4"),
        ("two-armed-1", "dual-process/EC3"),
    )
    methods = {row.key for row in tables["methods.csv"].rows}
    assert "two-armed-1 dual-process/EC4 noise_sd=0.1" in methods
    together = {row.key: {*row.cells} for row in tables["across_tasks.csv"].rows}
    assert together["dual-process (EC1, EC4)"] == {
        (task, f"dual-process/{condition}")
        for task, condition in (
            ("ascending", "EC1"),
            ("descending", "EC1"),
            ("two-armed-1", "EC4"),
        )
    }
    claims = {row.key: row.cells for row in tables["claims.csv"].rows}
    for entry in traced.judged:
        runs = {run for cell in claims[entry.claim.id] for run in traced.run_ids[cell]}
        assert runs >= {*entry.run_ids}
    between = [row for row in tables["signatures.csv"].rows if "against descending" in row.key]
    assert between
    assert all({task for task, _ in row.cells} == {"ascending", "descending"} for row in between)


def test_what_rests_on_the_optimum_says_so(traced, tables):
    """With another optimum those columns change that say that they rest on it."""
    others = {
        (task, arm): replace(best, reward=best.reward + {"free": 9, "still": 6}[arm], bound=None)
        for (task, arm), best in traced.optima.items()
    }
    other = MadeUp(traced.results, optima=others)
    changed = {
        key
        for name in FILES
        for key in changed_columns([tables[name]], [FILES[name].table(other)])
    }
    saying = {
        (name, column.name)
        for name, table in tables.items()
        for column in table.columns
        if "optimum" in column.rests_on
    }
    assert changed - saying == set()
    missed = {re.sub(r"_\d+.*|_note", "", " ".join(key)) for key in saying - changed}
    missed -= {re.sub(r"_\d+.*|_note", "", " ".join(key)) for key in changed}
    # Evidence of other claims; nobody is above a higher optimum; too few runs for an interval.
    few = {f"targets.csv {end}" for end in ("low", "high")}
    assert missed == {"claims.csv evidence", "methods.csv beaten", *few}


def test_a_value_of_a_file_is_traced(traced):
    folder = traced.results.folder
    still = "two-armed-1 dual-process/EC3 still trials 0.05"
    found = find_trace(folder, "targets.csv", (still, "target"))
    assert "Optimum of two-armed-1, other arm still" in found.how
    assert found.cells == ()
    first = "ascending dual-process/EC1 first subtask against initial goal 1"
    value = find_trace(folder, "signatures.csv", (first, "value"))
    assert value.how.startswith(
        "value. first subtask against initial: less those of the initial solution"
    )
    found = find_trace(folder / "report", "targets.csv", (still, "reached"))
    assert found.folder == folder
    (source,) = found.sources
    assert source.run_ids == traced.run_ids["two-armed-1", "dual-process/EC3"]
    pair = "two-armed-1 dual-process/EC4 random-search/pure"
    raw, adjusted = (
        trace_in_file(folder, "comparisons.csv", (pair, column)) for column in ("p", "p_holm")
    )
    assert len(raw.cells) == 2
    assert {*raw.cells} < {*adjusted.cells}
    assert "It depends on all of its family: all pairs of the task" in adjusted.how


def test_what_a_file_does_not_have(traced, tmp_path):
    folder = traced.results.folder
    for where, words in (
        ((), r"name a row and a column of it.*\n.* and \d+ more\n.*task, method, spend"),
        (("ascending dual-process/EC1 trial 1", "mean"), "did you mean 'ascending dual-process"),
    ):
        with pytest.raises(CoarticError, match=words):
            trace_in_file(folder, "anytime.csv", where)
    with pytest.raises(CoarticError, match="no results folder in .*; make one with `coartic run"):
        find_trace(tmp_path, "anytime.csv")
