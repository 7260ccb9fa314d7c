"""Folders that are joined, released results, and results beside others."""

import hashlib
import lzma
import shutil
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from coartic import CoarticError, load_task
from coartic.analysis.report.contents import TABLES
from coartic.analysis.study import load
from coartic.analysis.verify import check_runs
from coartic.benchmarks import released, template
from coartic.benchmarks.merge import merge, put_beside
from coartic.benchmarks.planning import Selection, plan_suite
from coartic.benchmarks.run import perform
from coartic.benchmarks.suites import Cell
from coartic.runs.store import RUNS_FILE, open_store, writing
from tests.support.suites import KNOWN, InProcess, planned, run_and_write, same_results

EC1, ALONE, PLAN = "dual-process/EC1", "corrective-alone/given", "trajectory-optimisation/jerk"
OWN = Path(template.__file__)


def cells(*pairs):
    return [Cell(load_task(task), KNOWN[method], runs=2) for task, method in pairs]


LEFT = cells(("ascending", EC1), ("ascending", PLAN))
RIGHT = cells(("ascending", PLAN), ("descending", EC1), ("descending", ALONE))
OPTIONS = {"trials": 40}


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """What two machines ran of a suite; one cell both of them."""
    folder = tmp_path_factory.mktemp("parts")
    for name, its_cells in (("left", LEFT), ("right", RIGHT)):
        run_and_write(folder / name, its_cells, **OPTIONS)
    return folder / "left", folder / "right"


def test_parts_make_a_whole(parts, tmp_path):
    out = tmp_path / "new" / "whole"
    merged = merge(parts, out)
    assert (merged.runs, merged.repeats) == (2 + 1 + 2 + 1, 1)
    once = [*LEFT, *RIGHT[1:]]
    same_results(load(out), run_and_write(tmp_path / "once", once, **OPTIONS))
    assert check_runs(out).wrong == []
    assert [path.name for path in out.parent.iterdir()] == ["whole"]
    report = perform(planned(once, **OPTIONS), out, executor=InProcess())
    assert report.progress.done == 0


def edit(folder, statement):
    with closing(sqlite3.connect(folder / RUNS_FILE)) as db:
        assert db.execute(statement).rowcount
        db.commit()


OF_EC1 = "(SELECT results.id FROM results JOIN settings ON settings.id = setting"
OF_EC1 += f" WHERE method = '{EC1}' AND run = 0)"
CHEATS = {
    "reward is -": "UPDATE results SET reward = reward + 1",
    "hands is RRR, not RRL": "UPDATE results SET hands = 'RRL'",
    "initial_reward is -": f"UPDATE results SET initial_reward = -9 WHERE id = {OF_EC1}",
    "result is ": f"UPDATE movements SET ticks = ticks + 1 WHERE result_id = {OF_EC1}",
    "travel": "UPDATE results SET other_arm_travel = other_arm_travel + 1",
    "its id": f"UPDATE results SET run = 7 WHERE id = {OF_EC1}",
}


@pytest.mark.parametrize("said", CHEATS)
def test_what_was_changed_is_not_joined(parts, tmp_path, said):
    left = shutil.copytree(parts[0], tmp_path / "left")
    edit(left, CHEATS[said])
    if said == "its id":
        edit(left, "UPDATE cells SET runs = 9")
    with pytest.raises(CoarticError, match=f"left: run .* does not do what is stored.*{said}"):
        merge([parts[1], left], tmp_path / "whole")
    assert [path.name for path in tmp_path.iterdir()] == ["left"]


def test_a_changed_joint_is_found_by_the_hash(parts, tmp_path):
    """Though the arm that is not used moves without any effect on ticks."""
    left = shutil.copytree(parts[0], tmp_path / "left")
    edit(left, f"UPDATE movements SET left_1 = left_1 + 1e-12 WHERE result_id = {OF_EC1}")
    with pytest.raises(CoarticError, match="a joint or a trial was changed"):
        merge([left, parts[1]], tmp_path / "whole")


def test_two_results_of_one_run(parts, tmp_path):
    """They are named, and nothing is written; a thinned one is the same result."""
    thin, other = (shutil.copytree(parts[0], tmp_path / name) for name in ("thin", "other"))
    with writing(thin) as store:
        store.write([store.run(run_id).thin() for run_id in store.ids("")])
    assert merge([parts[0], thin], tmp_path / "same").repeats == 3
    with open_store(parts[0]) as store:
        first, second = (run for run in map(store.run, store.ids("")) if run.rewards)
    with writing(other) as store:
        store.write([replace(second, key=first.key)])
    with pytest.raises(CoarticError, match=rf"other has another .* of 1 run: {EC1} on ascending"):
        merge([parts[0], other], tmp_path / "whole")
    assert not (tmp_path / "whole").exists()


def test_what_does_not_go_together(parts, tmp_path):
    left, _ = parts
    moved = load_task("descending").model_copy(update={"name": "ascending"})
    new = KNOWN[EC1].__class__(**vars(KNOWN[EC1]) | {"code": "0123456789ab"})
    wrong = {
        "the seed is 0 in .*left and 5 in .*0": {"seed": 5},
        "the trial budget is None in .* and 30 in": {"trial_budget": 30},
        f"ascending x {EC1} is .*trials=40.* in .* and .*trials=41.* in": {"trials": 41},
        "task 'ascending' is definition": {"cells": [Cell(moved, KNOWN[EC1])]},
        f"method '{EC1}' is code .* and code 0123456789ab in .*: leave it out": {
            "cells": [Cell(load_task("descending"), new)]
        },
    }
    for number, (said, change) in enumerate(wrong.items()):
        right = tmp_path / str(number)
        plan = planned(**{"cells": LEFT, **OPTIONS} | change)
        with writing(right) as store:
            store.ask(plan, {}, [], "")
        with pytest.raises(CoarticError, match=said):
            merge([left, right], tmp_path / "whole")
    for folders, said in (
        ([left], "two results folders or more"),
        ([left, left], "each once"),
        ([left, tmp_path / "nowhere"], "nowhere does not exist"),
    ):
        with pytest.raises(CoarticError, match=said):
            merge(folders, tmp_path / "whole")
    with pytest.raises(CoarticError, match="is there already"):
        merge(parts, left)


def test_a_stranger_beside_others(parts, tmp_path):
    """Only the stranger's runs are made, also when all are to be made anew."""
    select = Selection(methods=["NAME"], method_files=[OWN])
    plan = plan_suite("paper", select=select, runs=2, trials=20)
    assert {cell.method.name for cell in plan.cells} == {"NAME"}
    out = tmp_path / "out"
    for redo in (False, True):
        whole = put_beside(plan, parts[1], out)
        report = perform(whole, out, executor=InProcess(), redo=redo)
        assert (report.progress.present, report.progress.done) == (4, plan.size)
    study = load(out)
    theirs = study.runs[study.runs.method != "NAME"]
    assert set(theirs.result) == set(load(parts[1]).runs.result)
    assert {"NAME", EC1} <= set(TABLES["methods"](study).method)
    with writing(parts[0].parent / "empty") as store:
        store.ask(planned(LEFT, **OPTIONS), {}, [], "")
    with pytest.raises(CoarticError, match="empty lacks 3 runs"):
        put_beside(plan, parts[0].parent / "empty", tmp_path / "other")


def test_released_results(monkeypatch, tmp_path):
    """They are those of their hash, and are read as any folder."""
    for suite in released.released_hashes():
        with released.results_folder("released", suite) as folder, open_store(folder) as store:
            plan = store.plan()
            assert plan.suite == suite
            assert store.count() == plan.size
            some = [name for name in plan.tasks if "/" not in name or name.endswith("7")]
            assert all(load_task(name) == plan.tasks[name] for name in some)  # as shipped today
            assert store.run(store.ids("")[0]).is_thin
    with pytest.raises(CoarticError, match="of suite 'quick' are released, but of comparison, "):
        released.results_folder("released", "quick").__enter__()
    copy = shutil.copytree(Path(released.__file__).with_name("released"), tmp_path / "copy")
    monkeypatch.setattr(released, "_FOLDER", copy)
    (copy / "families.sqlite.xz").write_bytes(lzma.compress(b"something else"))
    with pytest.raises(CoarticError, match="not as it was released"):
        released.results_folder("released", "families").__enter__()


def test_packed_results_say_the_same(parts, tmp_path):
    released.pack(parts[0], tmp_path)
    content = (tmp_path / "paper.sqlite.xz").read_bytes()
    assert (tmp_path / "SHA256SUMS").read_text().split()[0] == hashlib.sha256(content).hexdigest()
    (tmp_path / "thin").mkdir()
    (tmp_path / "thin" / RUNS_FILE).write_bytes(lzma.decompress(content))
    assert check_runs(tmp_path / "thin").wrong == []
    full, thin = load(parts[0]), load(tmp_path / "thin")
    for name in ("learning", "ranking", "methods", "runtimes"):
        before, after = TABLES[name](full), TABLES[name](thin)
        assert before.equals(after)
    assert full.runs.best_trial.equals(thin.runs.best_trial)
