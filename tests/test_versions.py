"""Two results folders against each other, on runs of our own and on planted differences."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from coartic import CoarticError, load_task
from coartic.analysis.comparisons.versions import compare_versions, load_pair
from coartic.analysis.report.document import Estimate
from coartic.analysis.report.formats.markdown import markdown
from coartic.analysis.report.pages.versions import versions_document, versions_table
from coartic.analysis.results.folder import load_results
from coartic.analysis.results.laws import read_manifest
from coartic.analysis.statistics.equivalence import MARGIN
from coartic.analysis.study import Study
from coartic.benchmarks.registry import registry
from coartic.benchmarks.suites import Cell
from coartic.tables import FORMAT, Manifest
from tests.support.commands import call
from tests.support.packs import packs_of, records_of, write_pack
from tests.support.reports import shown
from tests.support.suites import Failing, InProcess, run_and_write

RUNS = 6
OUTCOME = ["status", "reward", "hands"]
KNOWN = registry()
CELLS = [
    Cell(load_task("ascending"), KNOWN["dual-process/EC1"]),
    Cell(load_task("two-armed-2"), KNOWN["dual-process/EC3"]),
    Cell(load_task("ascending"), KNOWN["corrective-alone/given"]),
]
LEARNED = "dual-process/EC1"


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    return made(tmp_path_factory.mktemp("first"))


def made(folder, cells=CELLS, **more):
    return Study(run_and_write(folder, cells, **{"runs": RUNS, "trials": 40, **more}))


def page(comparison):
    return markdown(versions_document(comparison), tables="")


def planted(first, edit=lambda runs: runs, edit_manifest=lambda content: None):
    """Results with other runs and another manifest, such as no folder could hold them."""
    results = first.results
    runs, content = edit(first.runs.copy()), results.manifest.model_dump(mode="json")
    edit_manifest(content)
    old = first.runs.loc[runs.index, OUTCOME].astype(str)
    other = (runs[OUTCOME].astype(str) != old).any(axis=1)
    runs.loc[other, "result"] += "-other"
    manifest = Manifest.model_validate_json(json.dumps(content))
    return Study(replace(results, runs=runs, manifest=manifest))


def of(runs, method=LEARNED):
    return runs.method == method


def shifted(by, method=LEARNED):
    """Edits the rewards of a method's runs by a list of numbers, in the order of the runs."""

    def edit(runs):
        runs.loc[of(runs, method), "reward"] += np.array(by)
        return runs

    return edit


def found(first, second, method=LEARNED):
    return compare_versions(first, second).cells.set_index("method").loc[method]


def test_the_same_runs_made_twice_are_identical(first, tmp_path):
    again = made(tmp_path / "again")
    comparison = compare_versions(*load_pair(first.results.folder, again.results.folder))
    cells = comparison.cells
    assert list(cells.method) == [LEARNED, "dual-process/EC3", "corrective-alone/given"]
    assert set(cells.verdict) == {"identical"}
    assert list(cells.identical) == list(cells.n_a) == [RUNS, RUNS, 1]
    assert (cells.difference == 0).all()
    assert cells.p.isna().all()
    assert cells.p_adjusted.isna().all()
    assert not comparison.differing
    assert comparison.summary == ["3 cells in both: 3 identical in every run."]
    row = shown(versions_table(comparison))[f"ascending {LEARNED}"]
    assert (row["identical"], row["shared"], row["difference"]) == (RUNS, RUNS, Estimate(0.0))
    assert page(comparison) == page(compare_versions(first, again))


def test_planted_differences_come_back_in_pairs(first):
    """The order of rows is none of the seeds' business."""
    by = [-20, -21, -22, -20, -23, -21]
    second = planted(first, lambda runs: shifted(by)(runs).iloc[::-1])
    row = found(first, second)
    assert row.paired
    assert row.identical == 0
    assert row.difference == pytest.approx(np.mean(by))
    assert -23 < row.low < np.mean(by) < row.high < -20
    assert row.margin == pytest.approx(MARGIN * -row.mean_a)
    assert row.verdict == "different"
    assert row.p < 0.01
    assert row.p_adjusted == row.p  # the one cell that is tested
    assert found(first, second, "dual-process/EC3").verdict == "identical"


def test_holm_over_all_cells_tested(first):
    def edit(runs):
        runs = shifted([-5, -1, 2, 3, -4, 1])(runs)
        return shifted([-9, -7, -8, -9, -7, -6], "dual-process/EC3")(runs)

    cells = compare_versions(first, planted(first, edit)).cells
    low, high = sorted(cells.p.dropna())
    assert sorted(cells.p_adjusted.dropna()) == [2 * low, max(2 * low, high)]


def test_a_difference_within_the_margin_is_equivalent(first):
    row = found(first, planted(first, shifted([-1, 1, 0, -1, 2, -2])))
    assert row.verdict == "equivalent"
    assert row.identical == 1
    # One run of six: the studentised bootstrap has no end there.
    row = found(first, planted(first, shifted([0, 0, 0, 1, 0, 0])))
    assert row.verdict == "equivalent"
    assert row.identical == 5
    row = found(first, planted(first, shifted([0, 0, 0, 60, 0, 0])))
    assert row.verdict == "undecided"


def test_other_hands_are_not_identical(first):
    def edit(runs):
        runs.loc[runs.index[of(runs, "dual-process/EC3")][2], "hands"] = "LLLL"
        return runs

    row = found(first, planted(first, edit), "dual-process/EC3")
    assert (row.identical, row.shared, row.difference) == (RUNS - 1, RUNS, 0)
    assert row.verdict == "equivalent"


def test_without_shared_seeds_runs_are_independent(first, tmp_path):
    second = made(tmp_path, runs=RUNS + 2, seed=1)
    comparison = compare_versions(first, second)
    row = comparison.cells.set_index("method").loc[LEARNED]
    assert not row.paired
    assert "no shared seeds" in row.remarks
    assert (row.n_a, row.n_b, row.shared) == (RUNS, RUNS + 2, 0)
    assert row.difference == pytest.approx(row.mean_b - row.mean_a)
    assert ("seed", "0", "1") in comparison.differing
    assert ("runs", "6", "8") in comparison.differing
    alone = comparison.cells.set_index("method").loc["corrective-alone/given"]
    assert (alone.verdict, alone.shared, alone.difference) == (
        "identical",
        0,
        0.0,
    )  # draws nothing


def test_one_run_that_differs_has_no_interval(first):
    second = planted(first, shifted([-3], "corrective-alone/given"))
    row = found(first, second, "corrective-alone/given")
    assert row.difference == -3
    assert row.verdict == "no interval"
    assert np.isnan(row.low)
    assert np.isnan(row.p)


@pytest.mark.usefixtures("one_by_one")
def test_failures_are_counted_and_nothing_compared(first, tmp_path):
    cells = CELLS[:1]
    failing = made(tmp_path / "b", cells, executor=Failing(1))
    row = found(first, failing)
    assert (row.solved_a, row.solved_b, row.n_b, row.identical) == (RUNS, RUNS - 1, RUNS, RUNS - 1)
    assert row.verdict == "not compared"
    assert row[["mean_a", "mean_b", "difference", "low", "p", "solve_s_b"]].isna().all()
    assert "B solved 5 of 6" in row.remarks
    assert "A solved" not in row.remarks
    # Two runs without a solution came out the same, whatever was said of the reason.
    again = made(tmp_path / "c", cells, executor=Failing(1))
    again.runs["reason"] = again.runs.reason + ", at night"
    both = found(failing, again)
    assert both.identical == RUNS
    assert both.verdict == "not compared"


def test_tasks_of_one_name_and_other_content(first):
    def move(content):
        content["specification"]["tasks"]["ascending"]["goals"][1] = [6.5, 2.0]

    def rename(content):
        content["specification"]["tasks"]["ascending"]["description"] = "another text"

    comparison = compare_versions(first, planted(first, edit_manifest=move))
    rows = comparison.cells.set_index("method")
    assert list(rows.verdict) == ["not compared", "identical", "not compared"]
    assert rows.remarks[LEARNED] == "the tasks of this name differ: goals"
    assert rows.identical[LEARNED] == 0
    (line,) = comparison.differing
    assert line[0] == "task ascending"
    assert "6.5" not in line[1]
    assert "6.5" in line[2]
    assert found(first, planted(first, edit_manifest=rename)).verdict == "identical"


@pytest.mark.usefixtures("one_by_one")
def test_other_code_is_said_and_never_mixed(first, tmp_path):
    """Runs of another version: their records and ids say so, or the folder is refused."""
    learned = replace(CELLS[0], entry=replace(CELLS[0].entry, code="c0ffeec0ffee"))
    cells = [learned, *CELLS[1:]]
    other = made(tmp_path / "other", cells, executor=OtherVersion())
    comparison = compare_versions(first, other)
    row = comparison.cells.set_index("method").loc[LEARNED]
    assert (row.verdict, row.remarks) == ("identical", "other code")
    assert [line[0] for line in comparison.differing] == [f"code of {LEARNED}"]
    folder = other.results.folder
    for number, pack in enumerate(packs_of(folder)):
        pack.rename(pack.with_stem(f"{90 + number:08}"))
    for pack in packs_of(folder)[RUNS:]:  # what both versions have alike
        pack.unlink()
    copied(first, folder)  # its tables and manifest, with both versions' records
    load_results(folder)
    replanned(folder, code="c0ffeec0ffed")
    with pytest.raises(CoarticError, match="no record of run [0-9a-f]{16}-c0ffeec0ffed in"):
        load_pair(first.results.folder, folder)


class OtherVersion(InProcess):
    """An executor that performs runs with the code that is here, whatever is asked for."""

    def perform(self, jobs):
        own = {cell.method: cell.entry.code for cell in CELLS}
        for job in jobs:
            yield from super().perform([{**job, "code": own[job["specification"]["method"]]}])


def copied(study, folder):
    """A results folder, or what is missing of it, somewhere else."""
    shutil.copytree(study.results.folder, folder, dirs_exist_ok=True)
    return folder


def replanned(folder, code):
    """Write a manifest whose first method has other code, with a seal that fits."""
    manifest = read_manifest(folder)
    plan = manifest.specification
    name = plan.cells[0].method
    methods = plan.methods | {name: plan.methods[name].model_copy(update={"code": code})}
    plan = plan.model_copy(update={"methods": methods})
    manifest = manifest.model_copy(update={"specification": plan})
    (folder / "manifest.json").write_text(manifest.text(), encoding="utf-8")


def test_one_gate_for_every_command(first, tmp_path, monkeypatch, capsys):
    """A table edited by hand is refused by whatever reads the folder."""
    edited = copied(first, tmp_path / "edited")
    table = pq.read_table(edited / "runs.parquet")
    for column, value in (("reward", -1), ("hands", "LLL"), ("code", None), ("wall_s", 0.0)):
        place = table.schema.get_field_index(column)
        field = table.schema.field(place)
        values = [value, *table[column].to_pylist()[1:]]
        pq.write_table(table.set_column(place, field, [values]), edited / "runs.parquet")
        words = f"runs.parquet is damaged (column '{column}' is not as its records have it"
        with pytest.raises(CoarticError, match=re.escape(words)):
            load_results(edited)
    for command in (("compare", first.results.folder), ("analyse",), ("report",), ("cite",)):
        code, _, error = call(monkeypatch, capsys, *command, edited)
        assert code == 2
        assert words in error
    pq.write_table(table.replace_schema_metadata({"pandas": "{}"}), edited / "runs.parquet")
    with pytest.raises(CoarticError, match="not those of this table: their metadata"):
        load_results(edited)


def test_what_differs_in_the_environment(first):
    def edit(model, numpy):
        return lambda content: content["environment"].update(
            model_code=model, packages={"numpy": numpy}, date=model
        )

    one = planted(first, edit_manifest=edit("aaaa", "2.4.6"))
    two = planted(first, edit_manifest=edit("bbbb", "2.4.7"))
    assert compare_versions(one, two).differing == [
        ("code of the model", "aaaa", "bbbb"),
        ("library numpy", "2.4.6", "2.4.7"),
    ]


def test_stale_records_are_counted(first, tmp_path):
    second = copied(first, tmp_path / "b")
    run_id, record = next(iter(records_of(second).items()))
    stale = f"{run_id[:17]}c0ffeec0ffee"
    other = {**record, "run_id": stale, "code": "c0ffeec0ffee"}
    write_pack(second / "records" / "00000099.pack", {stale: other})
    comparison = compare_versions(*load_pair(first.results.folder, second))
    assert comparison.stale == (0, 1)
    assert "B: 1 records were made by other code and have no part here" in page(comparison)
    assert "A: 1 records" not in page(comparison)


def test_parameters_cells_and_spends(first, tmp_path):
    cells = [CELLS[0], Cell(load_task("ascending"), KNOWN[LEARNED], (("noise_sd", 0.1),))]
    second = made(tmp_path, cells, trials=80)
    comparison = compare_versions(first, second)
    (row,) = comparison.cells.to_dict("records")
    assert row["remarks"] == "trials 40 → 80"
    assert (row["trials_a"], row["trials_b"]) == (40, 80)
    assert row["paired"]
    assert comparison.only == (
        {"dual-process/EC3": ["two-armed-2"], "corrective-alone/given": ["ascending"]},
        {f"{LEARNED} noise_sd=0.1": ["ascending"]},
    )
    assert comparison.summary[1:] == ["2 cells only in A.", "1 cells only in B."]
    row = shown(versions_table(comparison))[f"ascending {LEARNED}"]
    assert (row["trials"], row["paired"]) == (2, "yes")  # twice the trials
    assert "## Cells only in A\n\n- dual-process/EC3: two-armed-2\n" in page(comparison)
    assert ("methods of one folder only", "dual-process/EC3, corrective-alone/given", "") in (
        comparison.differing
    )
    other = planted(second, edit_manifest=_without_first)
    nothing = compare_versions(first, other)
    assert nothing.summary[0] == "0 cells in both: nothing to compare."
    assert nothing.cells.empty


def _without_first(content):
    del content["specification"]["cells"][0]


def test_folders_that_cannot_be_compared(first, tmp_path):
    first = first.results.folder
    link = tmp_path / "link"
    link.symlink_to(first)
    for same in (first, link, first / ".." / first.name):
        with pytest.raises(CoarticError, match="are one folder"):
            load_pair(first, same)
    empty = tmp_path / "empty"
    empty.mkdir()
    for missing, words in (
        (tmp_path / "nowhere", "nowhere does not exist; name a folder"),
        (empty, "is not a results folder: .*manifest.json is missing"),
        (first / "runs.parquet", "is a file, not a results folder"),
    ):
        with pytest.raises(CoarticError, match=words):
            load_pair(first, missing)
    old = shutil.copytree(first, tmp_path / "old")
    (old / "manifest.json").write_text(json.dumps({"format": 2}), encoding="utf-8")
    words = f"have format 2, this version reads {FORMAT}; start the same"
    with pytest.raises(CoarticError, match=words):
        load_pair(first, old)
    damaged = shutil.copytree(first, tmp_path / "damaged")
    (damaged / "runs.parquet").write_bytes((first / "runs.parquet").read_bytes()[:200])
    with pytest.raises(CoarticError, match="runs.parquet is damaged"):
        load_pair(damaged, first)


def test_command(first, tmp_path, monkeypatch, capsys):
    second = made(tmp_path / "b", trials=80)
    due = compare_versions(first, second)
    first, second = first.results.folder, second.results.folder
    out = tmp_path / "page.md"
    code, text, _ = call(monkeypatch, capsys, "compare", first, second, "--out", out)
    assert code == 0
    assert due.summary[0] in text
    assert out.read_text(encoding="utf-8") == page(due)
    table = pd.read_csv(tmp_path / "page.csv")
    assert list(table.verdict) == list(due.cells.verdict)
    assert table.verdict[2] == "identical" != table.verdict[0]
    before = {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    (tmp_path / "page.csv").write_text("of somebody else's")
    out.unlink()
    code, _, error = call(monkeypatch, capsys, "compare", first, second, "--out", out)
    assert (code, out.exists()) == (2, False)
    assert f"{tmp_path / 'page.csv'} is there already; add --replace" in error
    assert (tmp_path / "page.csv").read_text() == "of somebody else's"
    call(monkeypatch, capsys, "compare", first, second, "--out", out, "--replace")
    assert before == {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    code, text, _ = call(monkeypatch, capsys, "compare", first, second)
    assert code == 0
    assert "In " not in text
    code, *_ = call(monkeypatch, capsys, "compare", first, second, "--csv", tmp_path / "own.csv")
    assert code == 0
    assert (tmp_path / "own.csv").read_bytes() == (tmp_path / "page.csv").read_bytes()
    for arguments, words in (
        ((first, first), "are one folder"),
        ((first, tmp_path / "nowhere"), "does not exist"),
        ((first, second, "--out", "page.html"), "the name must end in .md"),
        ((first, second, "--csv", "table.txt"), "the name must end in .csv"),
        ((first, second, "--out", "/dev/null/x.md"), "cannot write /dev/null/x.md"),
        ((first, second, "--out", second / "records" / "x.md"), "is among the records"),
    ):
        code, _, error = call(monkeypatch, capsys, "compare", *arguments)
        assert code == 2
        assert words in error
