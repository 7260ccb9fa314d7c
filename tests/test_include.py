"""Included runs: the shipped ones, the parts of a suite, another person's folder."""

import lzma
import shutil
import sys
from dataclasses import replace

import pack_shipped
import pytest

from coartic import CoarticError, load_task
from coartic.analysis import TABLES
from coartic.analysis.study import load
from coartic.analysis.verify import check_runs
from coartic.benchmarks.include import include_folders
from coartic.benchmarks.runner import perform
from coartic.runs import shipped
from coartic.runs.plan import size_of
from coartic.runs.store import RUNS_FILE, open_store, writing
from tests.support.suites import (
    KNOWN,
    Failing,
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
    with pytest.raises(CoarticError, match="has 2 of 4 runs: it was interrupted, or has a part"):
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
        UserWarning, match=rf"right has 2 runs of {EC1} on descending; this command asks for 3"
    ):
        joined(parts[1:], tmp_path / "few", LEFT, runs=3)


def test_crashed_runs_of_a_source_are_performed_again(tmp_path):
    run_and_write(tmp_path / "crashed", LEFT, executor=Failing(0), **OPTIONS)
    assert joined([tmp_path / "crashed"], tmp_path / "whole", LEFT).present == 2
    assert set(load(tmp_path / "whole").runs.status) == {"ok"}


def test_a_folder_gives_what_it_has_and_is_asked_for_no_more(parts, left, tmp_path):
    """Whatever it was asked for itself: nobody else's plan says how much is performed here."""
    edit(left, "UPDATE cells SET runs = 1000000 WHERE position = 0")
    with pytest.warns(UserWarning, match=f"left is not finished: it lacks runs of {EC1} on asc"):
        progress = joined([left], tmp_path / "more", RIGHT[2:])
    assert (progress.present, progress.done, progress.total) == (2 + 1, 1, 4)
    edit(left, f"DELETE FROM results WHERE {OF_EC1}")  # the second one follows a gap
    with pytest.warns(UserWarning, match="lacks runs of"):
        progress = joined([left], tmp_path / "less", RIGHT[2:])
    assert (progress.present, progress.done, progress.total) == (1, 1, 2)
    assert check_runs(tmp_path / "more").wrong == check_runs(tmp_path / "less").wrong == []


def test_runs_of_a_cell_under_two_limits_are_included(parts, left, tmp_path):
    edit(left, f"UPDATE results SET time_limit_s = 50.0 WHERE {OF_EC1}")
    assert joined([left], tmp_path / "whole", LEFT).present == 3


def test_runs_of_a_method_that_is_not_here_are_refused(parts, tmp_path):
    with open_store(parts[0]) as store, pytest.raises(CoarticError, match="pass its method file"):
        perform(store.plan(), tmp_path / "out", executor=InProcess())


OF_EC1 = f"run = 0 AND cell IN (SELECT id FROM cells WHERE method = '{EC1}')"


def test_two_results_of_one_run(parts, tmp_path):
    downsampled, other = (
        shutil.copytree(parts[0], tmp_path / name) for name in ("downsampled", "other")
    )
    with writing(downsampled) as store:
        store.write([store.run(run_id).downsample() for run_id in store.ids()])
    assert joined([parts[0], downsampled], tmp_path / "same", LEFT).present == 3
    with open_store(parts[0]) as store:
        first, second = (run for run in map(store.run, store.ids()) if run.outcome.rewards)
    with writing(other) as store:
        store.write([replace(second, job=first.job)])
    words = f"run {first.number} of {EC1} on ascending differs between .*left and .*other "
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
        (plan, tmp_path / "nowhere", "nowhere. does not exist; .shipped. stands for"),
        (plan, out, "cannot include itself"),
    ):
        with pytest.raises(CoarticError, match=said):
            include_folders(asked, [folder], out)
    assert not out.exists()


def test_shipped_results(monkeypatch, tmp_path):
    for suite in shipped.shipped_hashes():
        with shipped.open_shipped(suite) as store:
            plan = store.plan()
            assert {job.suite for job in plan} == {suite}
            assert len(store.ids()) == size_of(plan)
            tasks = {job.cell.task.name: job.cell.task for job in plan}
            some = [name for name in tasks if "/" not in name or name.endswith("7")]
            assert all(load_task(name) == tasks[name] for name in some)  # as shipped today
            learned = (run for run in map(store.run, store.ids()) if run.outcome.rewards)
            assert next(learned).is_downsampled
    with pytest.raises(CoarticError, match="of suite 'quick' are shipped; those of comparison, "):
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


@pytest.fixture
def packed(parts, tmp_path, monkeypatch):
    """The right part of suite ``paper``, as if it were shipped."""
    (tmp_path / "packed").mkdir()
    pack_shipped.pack(parts[1], tmp_path / "packed")
    monkeypatch.setattr(shipped, "SHIPPED_FOLDER", tmp_path / "packed")
    return parts[1]


def test_packed_results_say_the_same(packed, tmp_path):
    content = (tmp_path / "packed" / "paper.sqlite.xz").read_bytes()
    (tmp_path / RUNS_FILE).write_bytes(lzma.decompress(content))
    assert check_runs(tmp_path).wrong == []
    full, downsampled = load(packed), load(tmp_path)
    for name in ("learning", "ranking", "methods", "runtimes"):
        assert TABLES[name](full).equals(TABLES[name](downsampled))
    assert full.runs.best_trial.equals(downsampled.runs.best_trial)
    with open_store(tmp_path) as store:
        assert store.run(full.runs.query("trials > 1").run_id.iloc[0]).is_downsampled


def test_results_are_packed_again_where_they_have_not_changed(
    packed, tmp_path, monkeypatch, capsys
):
    def pack(folder, *options):
        monkeypatch.setattr(sys, "argv", ["shipped", *options, str(folder)])
        return pack_shipped.main(), capsys.readouterr().out

    before = (tmp_path / "packed" / "SHA256SUMS").read_text()
    for name, change, said in (
        ("fewer", f"DELETE FROM results WHERE {OF_EC1}", "is missing"),
        ("other", "UPDATE results SET trials = trials + 1", "trials: "),
    ):
        edit(shutil.copytree(packed, tmp_path / name), change)
        code, text = pack(tmp_path / name)
        assert (code, said in text, "--changed" in text) == (1, True, True)
    assert (tmp_path / "packed" / "SHA256SUMS").read_text() == before
    same = shutil.copytree(packed, tmp_path / "same")
    edit(same, "UPDATE results SET cpu_s = 9")
    assert pack(same) == (0, f"{same}: no differences from the shipped results\n")
    assert pack(tmp_path / "other", "--changed")[0] == 0
    with shipped.open_shipped("paper") as store:
        assert (store.runs().trials == load(tmp_path / "other").runs.trials).all()
    other = replace(KNOWN[EC1], code="0123456789ab")
    run_and_write(tmp_path / "old", [cell_on(load_task("ascending"), other)], **OPTIONS)
    with pytest.raises(SystemExit):  # whatever has changed
        pack(tmp_path / "old", "--changed")
    assert "has version 0123456789ab of dual-process/EC1" in capsys.readouterr().err


@pytest.mark.usefixtures("in_this_process")
def test_command(packed, parts, tmp_path, coartic):
    """A method is written by a command, run beside the shipped results, and there when that is
    repeated; a colleague includes the folder with another one, without the method's file."""
    mine, out = tmp_path / "my_search.py", tmp_path / "out"
    small = ("--runs", 2, "--trials", 40, "--tasks", "ascending,descending")
    assert coartic("new", "my-search", "--out", mine)[0] == 0
    own = ("--method-file", mine, "--include", "shipped", "--out", out)
    code, text, _ = coartic("run", "paper", *own, *small)
    assert (code, text[:16]) == (0, "8 runs (4 reused")
    assert coartic("run", "paper", *own, *small)[1].startswith("8 runs (8 reused)")
    theirs = load(packed).runs
    assert set(load(out).runs.method) == {"my-search", *theirs.method}
    assert set(theirs.run_id) < set(load(out).runs.run_id)
    both = ("--include", out, "--include", parts[0], "--out", tmp_path / "both", *small)
    code, text, _ = coartic("run", "paper", "--methods", "EC1", *both)
    assert (code, text[:19]) == (0, "10 runs (10 reused)")
