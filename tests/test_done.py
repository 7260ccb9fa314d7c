"""A suite that finds nothing to do: what it does not check again, and when it does."""

import hashlib
import json

import pytest

import coartic.benchmarks.suites
from coartic import CoarticError
from coartic.analysis.results.folder import load_results
from coartic.analysis.results.laws import read_manifest
from coartic.benchmarks.provenance import surroundings
from coartic.benchmarks.run import plan_cells
from coartic.benchmarks.specification import Limits
from coartic.benchmarks.suites import load_suite
from coartic.benchmarks.tables import PAGES
from coartic.packs import Packs
from coartic.record import Commit, Record
from tests.support.packs import packs_of, read_pack, records_of, write_pack
from tests.support.suites import InProcess, paper_cells

PAGE = "comparison.md"
HERE = surroundings().model_copy(update={"commit": Commit(id="0" * 40, dirty=False)})


@pytest.fixture(autouse=True)
def unchanged(monkeypatch):
    """A checkout without changes."""
    monkeypatch.setattr(coartic.benchmarks.suites, "surroundings", lambda: HERE)


@pytest.fixture
def checks(monkeypatch):
    """Ids of the runs that are checked."""
    found, check = [], Record.disagreement
    monkeypatch.setattr(
        Record, "disagreement", lambda self: (found.append(self.run_id), check(self))[1]
    )
    return found


def plan(**options):
    options = {"runs": 2, "trials": 20, "limits": Limits(60.0)} | options
    return plan_cells(load_suite("paper"), paper_cells(tasks=["ascending"]), **options)


def pages(folder):
    return {PAGE: b"1", "methods.csv": b"2"}


def perform(folder, planned=None, **options):
    return (planned or plan()).perform(folder, executor=InProcess(), pages=pages, **options)


def files(folder):
    return {
        p.name: (p.read_bytes(), p.stat().st_mtime_ns) for p in folder.rglob("*") if p.is_file()
    }


def test_nothing_is_checked_or_written_again(tmp_path, checks):
    assert perform(tmp_path).progress.done == 2
    before = files(tmp_path)
    checks.clear()
    said = []
    report = perform(tmp_path, watch=lambda progress, spec: said.append(progress.present))
    assert (report.progress.total, report.progress.present, report.progress.done) == (2, 2, 0)
    assert said == [2]
    assert [record.run for record in report.records.values()] == [0, 1]
    assert "x" not in report.records
    assert report.records.get("x") is None
    assert checks == []
    assert files(tmp_path) == before


def lines_turned(folder):
    (path,) = packs_of(folder)[:1]
    path.rename(path.with_stem("00000077"))


def with_stale(folder):
    run_id, record = next(iter(records_of(folder).items()))
    stale = f"{run_id[:17]}c0ffee"
    write_pack(
        folder / "records" / "00000088.pack",
        {stale: {**record, "run_id": stale, "code": "c0ffee"}},
    )


def harmed(name):
    def harm(folder):
        path = folder / name
        path.write_bytes(path.read_bytes()[:-9])

    return harm


CHANGES = {
    "a pack renamed": lines_turned,
    "a pack more": with_stale,
    "a pack gone": lambda folder: packs_of(folder)[0].unlink(),
    "a pack harmed": lambda folder: harmed(packs_of(folder)[0])(folder),
    "a table harmed": harmed("runs.parquet"),
    "a table gone": lambda folder: (folder / "learning.parquet").unlink(),
    "the manifest harmed": harmed("manifest.json"),
    "the manifest gone": lambda folder: (folder / "manifest.json").unlink(),
    "a page gone": lambda folder: (folder / PAGE).unlink(),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_whatever_was_changed_is_checked_and_made_anew(change, tmp_path, checks):
    perform(tmp_path)
    change(tmp_path)
    checks.clear()
    perform(tmp_path)
    assert len(set(checks)) == 2
    assert len(load_results(tmp_path).runs) == 2
    assert (tmp_path / PAGE).exists()


@pytest.mark.parametrize(
    "update",
    [
        {"commit": Commit(id="0" * 40, dirty=True)},
        {"commit": Commit(id="1" * 40, dirty=False)},
        {"model_code": "another"},
        {"packages": {}},
    ],
)
def test_another_version_checks_all(update, tmp_path, checks, monkeypatch):
    perform(tmp_path)
    checks.clear()
    other = HERE.model_copy(update=update)
    monkeypatch.setattr(coartic.benchmarks.suites, "surroundings", lambda: other)
    assert perform(tmp_path).progress.done == 0
    assert len(set(checks)) == 2


def test_another_plan_is_another_plan(tmp_path, checks):
    perform(tmp_path)
    for planned in (plan(limits=Limits(90.0)), plan(runs=1), plan(seed=1), plan(trials=21)):
        checks.clear()
        perform(tmp_path, planned)
        assert checks
    report = perform(tmp_path, planned, redo=True)
    assert report.progress.done == 2


@pytest.mark.usefixtures("one_by_one")
def test_a_forgery_with_its_hash_in_the_manifest_is_refused_and_then_undone(tmp_path):
    """The command finds nothing to do; who reads finds the forgery, and says what helps."""
    perform(tmp_path)
    path, *_ = packs_of(tmp_path)
    honest = records_of(tmp_path)
    ((run_id, forged),) = read_pack(path).items()
    forged["solution"]["reward"] += 10
    write_pack(path, {run_id: forged})
    manifest = read_manifest(tmp_path).model_copy(update={"records": Packs(tmp_path).digest})
    text = manifest.text()
    (tmp_path / "manifest.json").write_text(text, encoding="utf-8")
    listing = tmp_path / ".coartic-files.json"
    content = json.loads(listing.read_text(encoding="utf-8"))
    content["run"]["manifest.json"] = [hashlib.sha256(text.encode()).hexdigest()]
    listing.write_text(json.dumps(content), encoding="utf-8")
    assert perform(tmp_path).progress.done == 0
    with pytest.raises(CoarticError, match="where it finds nothing to do, delete manifest.json"):
        load_results(tmp_path)
    (tmp_path / "manifest.json").unlink()
    assert perform(tmp_path).progress.done == 1
    found = records_of(tmp_path)
    assert found[run_id]["solution"] == honest[run_id]["solution"]
    load_results(tmp_path)


def test_pages_of_earlier_tables_are_not_kept(tmp_path):
    """More runs without pages, as from Python, then the same with them."""
    cells = paper_cells(tasks=["ascending"], methods=["dual-process/EC1"])
    suite = load_suite("paper")

    def perform(runs, **options):
        plan = plan_cells(suite, cells, runs=runs, trials=3)
        return plan.perform(tmp_path, executor=InProcess(), **options)

    def pages(folder):
        count = len(Packs(folder))
        return {page: f"of {count} runs".encode() for page in PAGES}

    perform(1, pages=pages)
    perform(4)
    perform(4, pages=pages)
    assert {(tmp_path / page).read_text() for page in PAGES} == {"of 4 runs"}
