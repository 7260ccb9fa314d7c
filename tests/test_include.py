"""Included runs: the shipped ones, the parts of a suite, another person's folder."""

import lzma
import shutil
from dataclasses import replace

import pack_shipped
import pytest

from coartic import CoarticError, load_task
from coartic.analysis import TABLES
from coartic.analysis.study import load
from coartic.analysis.verify import check_runs
from coartic.benchmarks.include import include_folders
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.runner import perform
from coartic.runs import shipped
from coartic.runs.plan import size_of
from coartic.runs.store import RUNS_FILE, open_store, open_store_for_writing
from tests.support.suites import (
    KNOWN,
    InProcess,
    cell_on,
    edit,
    planned,
    run_and_write,
    same_results,
)

EC1, ALONE, PLAN = "dual-process/EC1", "corrective-alone/given", "posture-qp/current-goal"


def cells(*pairs):
    return [cell_on(load_task(task), KNOWN[method]) for task, method in pairs]


LEFT = cells(("ascending", EC1), ("ascending", PLAN))
RIGHT = cells(("ascending", PLAN), ("descending", EC1), ("descending", ALONE))
WHOLE = [*LEFT, *RIGHT[1:]]
OPTIONS = {"trials": 40}


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """What two machines ran of a suite; one cell both of them."""
    folder = tmp_path_factory.mktemp("parts")
    for name, its_cells in (("left", LEFT), ("right", RIGHT)):
        run_and_write(folder / name, its_cells, **OPTIONS)
    return folder / "left", folder / "right"


@pytest.fixture
def left(parts, tmp_path):
    """A copy of the left part, to be changed."""
    return shutil.copytree(parts[0], tmp_path / "left")


def joined(folders, out, cells=WHOLE, **options):
    """What is performed where a plan of cells includes folders."""
    whole = include_folders(planned(cells, **OPTIONS | options), folders, out)
    return perform(whole, out, executor=InProcess())


def test_an_array_of_jobs_shares_a_cell(coartic, tmp_path, in_this_process):
    command = ("run", "paper", "--tasks", "ascending", "--trials", 20, "--methods", f"EC1,{ALONE}")
    places = [tmp_path / each for each in ("first", "second", "whole", "once")]
    for place, runs in zip(places, ("0..1", "2..3"), strict=False):
        code, text, _ = coartic(*command, "--runs", runs, "--out", place)
        assert code == 0, text
    assert "with all other parts, joins them" in " ".join(text.split())
    with pytest.raises(
        CoarticError, match="has 2 of 4 runs: it was interrupted, or has only a part"
    ):
        load(places[1])
    report = check_runs(places[1])
    said = "The plan asks for 4 runs, of which the folder has 2."
    assert (report.wrong, report.unfinished) == ([], [said])
    includes = ("--include", places[0], "--include", places[1])
    code, _, error = coartic(*command, "--runs", "2..3", *includes, "--out", places[2])
    assert (code, "part of an array" in error) == (2, True)
    assert coartic(*command, *includes, "--runs", 4, "--out", places[2])[1].startswith(
        "5 runs (5 reused) in "
    )
    assert coartic(*command, "--runs", 4, "--out", places[3])[0] == 0
    same_results(load(places[2]), load(places[3]))


def test_what_no_folder_has_is_performed(parts, left, tmp_path):
    """Of what both parts have, one is copied."""
    edit(left, f"DELETE FROM results WHERE {OF_EC1}")
    whole = tmp_path / "new" / "whole"
    progress = joined([left, parts[1]], whole)
    assert (progress.present, progress.done) == (1 + 1 + 2 + 1, 1)
    assert check_runs(whole).wrong == []
    assert [path.name for path in whole.iterdir()] == [RUNS_FILE]
    same_results(load(whole), run_and_write(tmp_path / "once", WHOLE, **OPTIONS))
    assert joined(parts[:1], tmp_path / "more", LEFT, runs=3).done == 1
    assert joined([tmp_path / "more", parts[0]], tmp_path / "most", LEFT).present == 3 + 1
    with pytest.warns(
        UserWarning, match=rf"right has fewer than 3 runs, .* of {EC1} on descending$"
    ):
        joined(parts[1:], tmp_path / "few", LEFT, runs=3)


@pytest.mark.parametrize("lost", [1, 2048, 20_000])
def test_a_damaged_source_is_named_and_nothing_is_copied(parts, left, tmp_path, lost):
    """As by a disk that lost the end of the file, or has zeros there."""
    content = (left / RUNS_FILE).read_bytes()
    for end in (b"", *[bytes(lost)] * (lost > 1)):
        (left / RUNS_FILE).write_bytes(content[:-lost] + end)
        with pytest.raises(CoarticError, match=f"{left / RUNS_FILE}.*: it is damaged"):
            joined([parts[1], left], tmp_path / "whole")
        assert not (tmp_path / "whole").exists()


OF_EC1 = f"run = 0 AND cell IN (SELECT id FROM cells WHERE method = '{EC1}')"


def test_two_results_of_one_run(parts, tmp_path):
    downsampled, other = (
        shutil.copytree(parts[0], tmp_path / name) for name in ("downsampled", "other")
    )
    with open_store_for_writing(downsampled) as store:
        store.write([store.run(run_id).downsample() for run_id in store.ids()])
    assert joined([parts[0], downsampled], tmp_path / "same", LEFT).present == 3
    with open_store(parts[0]) as store:
        first, second = (run for run in map(store.run, store.ids()) if run.rewards)
    with open_store_for_writing(other) as store:
        named = {name: first[name] for name in ("run_id", "run", "seed")}
        store.write([replace(second, job=first.job).with_values(**named)])
    words = f"run {first['run']} of {EC1} on ascending differs between .*left and .*other "
    with pytest.raises(CoarticError, match=words):
        joined([parts[0], other], tmp_path / "whole", LEFT)
    with pytest.raises(CoarticError, match="differs between .*same and .*other"):
        joined([other], tmp_path / "same", LEFT)


def test_what_does_not_go_together(parts, tmp_path):
    moved = load_task("descending").model_copy(update={"name": "ascending"})
    wrong = {
        "the seed is 0 in .*left and 5 in this command": {"seed": 5},
        "the trial budget is unlimited in .* and 30 in": {"trial_budget": 30},
        f"trials of {EC1} on ascending is 40 in .*left and 41 in this": {"trials": 41},
        "task 'ascending' is definition": {"cells": [cell_on(moved, KNOWN[EC1])]},
    }
    for said, change in wrong.items():
        with pytest.raises(CoarticError, match=said):
            joined(parts[:1], tmp_path / "whole", **{"cells": LEFT} | change)
    plan, out = planned(LEFT, **OPTIONS), tmp_path / "whole"
    quick = [replace(job, suite="quick") for job in plan]
    for asked, folder, said in (
        (quick, parts[0], "the suite is 'paper' in .*left and 'quick' in this command"),
        (plan, out, "cannot include itself"),
    ):
        with pytest.raises(CoarticError, match=said):
            include_folders(asked, [folder], out)
    assert not out.exists()


@pytest.mark.usefixtures("not_repeated")
def test_runs_of_a_changed_method_file_are_not_used(tmp_path):
    """Runs of a method whose file the command does not have are included as they are."""
    mine = replace(KNOWN["hill-climbing"], origin="mine.py", code="1" * 12)
    changed, old = replace(mine, code="2" * 12), tmp_path / "old"
    on_task = [cell_on(load_task("ascending"), method) for method in (mine, changed)]
    run_and_write(old, on_task[:1], **OPTIONS)
    with pytest.warns(UserWarning, match="old: 2 runs of hill-climbing not used"):
        assert joined([old], tmp_path / "again", on_task[1:]).done == 2
    assert {*load(tmp_path / "again").runs.code} == {changed.code}
    asked, known = planned(LEFT, **OPTIONS), {**KNOWN, mine.name: changed}
    with pytest.warns(UserWarning, match="old: 2 runs of hill-climbing not used"):
        plan = include_folders(asked, [old], tmp_path / "beside", methods=known)
    assert mine.name not in {job.cell.method.name for job in plan}
    plan = include_folders(asked, [old], tmp_path / "without")
    assert mine.code in {job.cell.method.code for job in plan}


def test_shipped_results(monkeypatch, tmp_path):
    with shipped.open_shipped("comparison") as store:
        plan = store.plan()
        now = {job.cell.digest for job in plan_suite("comparison")}
        assert {job.cell.digest for job in plan} == now
        assert len(store.ids()) == size_of(plan)
        learned = (run for run in map(store.run, store.ids()) if run.rewards)
        assert next(learned).is_downsampled
    with pytest.raises(
        CoarticError, match="suite 'quick' has no shipped results; the suites comparison, "
    ):
        shipped.open_shipped("quick")
    copy = shutil.copytree(shipped.SHIPPED_FOLDER, tmp_path / "copy")
    monkeypatch.setattr(shipped, "SHIPPED_FOLDER", copy)
    (copy / "families.sqlite.xz").write_bytes(lzma.compress(b"something else"))
    with pytest.raises(CoarticError, match="was changed after it was shipped"):
        shipped.open_shipped("families")
    (copy / "families.sqlite.xz").unlink()
    with pytest.raises(CoarticError, match="families.sqlite.xz cannot be read: install"):
        shipped.open_shipped("families")
    (copy / "SHA256SUMS").write_text("something else\n\n")
    with pytest.raises(CoarticError, match="cannot be read: install"):
        shipped.open_shipped("comparison")


def test_packed_results_say_the_same(parts, tmp_path):
    """As if a part of suite ``paper`` were shipped."""
    with open_store(parts[1]) as source:
        pack_shipped.pack(source, map(source.run, source.runs().run_id), tmp_path)
    content = (tmp_path / "paper.sqlite.xz").read_bytes()
    (tmp_path / RUNS_FILE).write_bytes(lzma.decompress(content))
    assert check_runs(tmp_path).wrong == []
    full, downsampled = load(parts[1]), load(tmp_path)
    for name in ("learning", "ranking", "methods", "runtimes"):
        assert TABLES[name](full).equals(TABLES[name](downsampled))
    assert full.runs.best_trial.equals(downsampled.runs.best_trial)
    with open_store(tmp_path) as store:
        assert store.run(full.runs.query("trials > 1").run_id.iloc[0]).is_downsampled
