"""The CSV files of a results folder: typed, said what they rest on, and traced."""

import re
import shutil
from dataclasses import replace

import pandas as pd
import pytest

from coartic import CoarticError
from coartic.analysis.report.tables.files import FILES, METHOD_ROWS, csv_text
from coartic.analysis.report.trace import find_trace, trace_in_file, trace_text
from coartic.analysis.report.trace_file import FILE
from coartic.analysis.signatures import subtasks, trajectories
from coartic.analysis.study import Study
from tests.support.made_up import MadeUp
from tests.support.reports import changed_columns, shown


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


def test_what_rests_on_the_corrective_process_alone_says_so(traced, tables, monkeypatch):
    """With other rewards of it, and no movement by it, those values change that say so."""
    table = traced.results.sequences
    other = Study(
        replace(traced.results, sequences=table.assign(reward=table.reward - 7 * table.index))
    )
    monkeypatch.setattr(trajectories, "corrective", lambda *_: None)
    monkeypatch.setattr(subtasks, "isolated_reach", lambda *_: None)
    changed, lost, saying, valued = set(), set(), set(), set()
    for name, file in FILES.items():
        before, after = shown(tables[name]), shown(file.table(other))
        for row in tables[name].rows:
            for column in tables[name].columns:
                value = before[row.key][column.name]
                place = name, column.name, row.key
                rests_on = row.rests_on.get(column.name, column.rests_on)
                if "simulation" in rests_on:
                    saying.add(place)
                if value is not None:
                    valued.add(place)
                if rests_on in ((), ("text",)):  # words of ours, as why something is not judged
                    continue
                if row.key not in after:
                    lost.add(place)
                elif repr(after[row.key][column.name]) != repr(value):
                    changed.add(place)
    assert changed - saying == set()
    columns = {place[:2] for place in changed}
    assert {("across_tasks.csv", "score"), ("profiles.csv", "share")} <= columns
    signatures = {place for place in saying & valued if place[:2] == ("signatures.csv", "value")}
    alike = re.compile(" (hand as in isolation|hands as the best corrective ones) ")  # 0 is 0
    assert all(alike.search(key) for *_, key in signatures - changed - lost)
    assert len(signatures) > 100


def test_a_claim_without_runs_says_what_is_behind_it(tables):
    values = shown(tables["claims.csv"])
    for row in tables["claims.csv"].rows:
        if values[row.key]["runs"] is None:
            (kinds,) = {row.rests_on[name] for name in ("verdict", "evidence")}
            assert (kinds == ("text",)) == (values[row.key]["sources"] is None)
            assert {"runs", "optimum"}.isdisjoint(kinds)


def test_a_value_of_a_file_is_traced(traced, tmp_path):
    folder = shutil.copytree(traced.results.folder, tmp_path / "traced")
    for name in ("targets.csv", "comparisons.csv"):
        (folder / name).write_text(FILES[name].text(traced), encoding="utf-8")
    (folder / "report").mkdir(exist_ok=True)
    (folder / "report" / FILE).touch()
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
    assert {label for _, label in adjusted.cells} >= {"random-search/pure", "dual-process/EC4"}
    table = FILES["comparisons.csv"].table(traced)
    kinds = {key: row["kind"] for key, row in shown(table).items()}
    families = ({row.family for row in table.rows if (kinds[row.key] == "conditions") is apart}
                for apart in (True, False))  # fmt: skip
    assert set.isdisjoint(*families)
    assert raw.note == ""
    assert "\nrests on: runs, optimum\n" in trace_text(found)
    score = trace_in_file(folder, "across_tasks.csv", ("dual-process (EC1, EC4)", "score"))
    assert "\nrests on: runs, optimum, simulation\n" in trace_text(score)
    assert trace_in_file(folder, "areas.csv", (still.removesuffix(" 0.05"), "area")).note
    (folder / "comparisons.csv").write_text("forged", encoding="utf-8")
    forged = trace_in_file(folder, "comparisons.csv", (pair, "p"))
    assert "is not what the records give" in forged.note
    (folder / "comparisons.csv").unlink()
    assert "is not there" in trace_in_file(folder, "comparisons.csv", (pair, "p")).note


def test_what_a_file_does_not_have(traced, tmp_path):
    folder = traced.results.folder
    rows = r"rows by task, method, spend, budget: 'ascending dual-process/EC1 trials 1.0', .* more"
    for where, words in (
        ((), rf"name a row and a column of it.*\n +{rows}\n +columns: task, method, spend"),
        (("ascending dual-process/EC1 trials 1", "mean"), "did you mean 'ascending dual-process"),
    ):
        with pytest.raises(CoarticError, match=words):
            trace_in_file(folder, "anytime.csv", where)
    (tmp_path / "within").mkdir()
    (tmp_path / "manifest.json").touch()
    for name, below, words in (
        ("anytime.csv", "within", "no results folder in .*within; make one with `coartic run"),
        ("anytime.csv", "nowhere", "no results folder in .*nowhere"),
        ("anytme.csv", "", "no file anytme.csv of .*; did you mean 'anytime.csv'?"),
        ("x.csv", "", "there are methods.csv, claims.csv"),
    ):
        with pytest.raises(CoarticError, match=words):
            find_trace(tmp_path / below, name)
