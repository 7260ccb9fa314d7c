"""Folders of version 1.1, in which the paper could be read in several ways."""

import hashlib
import json
import shutil
import sqlite3
from contextlib import closing

import pytest

from coartic import CoarticError, load_task
from coartic.analysis.study import load
from coartic.analysis.verify import check_runs
from coartic.benchmarks import template
from coartic.benchmarks.beside import put_beside
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.registry import built_in
from coartic.benchmarks.reproduce import perform_again
from coartic.benchmarks.run import perform
from coartic.runs.plan import Cell, Specification
from coartic.runs.store import _EARLIER_VIEWS, RUNS_FILE, open_store
from tests.support.strategies import tiny_task
from tests.support.suites import InProcess, paper_cells, run_and_write

READ = (
    "'$.ties', 'left', '$.state', 'previous-hand', '$.equal_distance', 'random', "
    "'$.first_trial', 'learns', '$.unknown_target', 'corrects'"
)
MOVED = (
    "'$.corrective_arrival', json('false'), '$.first_step', json('false'), "
    "'$.whole_last_step', json('false')"
)
OF_1_1 = (
    f"settings SET model = json_set(model, {MOVED})",
    f"settings SET parameters = json_set(parameters, {READ}) WHERE method LIKE 'dual-process/%'",
    f"methods SET defaults = json_set(defaults, {READ}) WHERE name LIKE 'dual-process/%'",
)


def edited(folder, out, *statements, version=1):
    """A copy of a results folder as an earlier version wrote it, in which tables are updated so."""
    shutil.copytree(folder, out)
    with closing(sqlite3.connect(out / RUNS_FILE, isolation_level=None)) as db:
        db.execute("DROP VIEW runs")
        db.execute("UPDATE results SET trials = trials + initial_trials")
        db.execute("ALTER TABLE results DROP COLUMN initial_trials")
        for statement in statements:
            db.execute(f"UPDATE {statement}")
        db.executescript(f"{_EARLIER_VIEWS[version]}PRAGMA user_version = {version}")
    return out


def ask(folder, column, name, value):
    """Store another value in each setting, with the hash that it has."""
    with closing(sqlite3.connect(folder / RUNS_FILE, isolation_level=None)) as db:
        db.row_factory = sqlite3.Row
        for row in db.execute("SELECT * FROM settings").fetchall():
            read = {key: json.loads(row[key]) for key in ("parameters", "model")}
            read[column][name] = value
            setting = {"task": json.loads(row["definition"]), "method": row["method"], **read}
            setting |= {"trial_budget": row["trial_budget"]}
            setting["model"] = {"arrival_tick": 1} | read["model"]  # which 1.0 stored
            text = json.dumps(setting, sort_keys=True, separators=(",", ":"))
            asked = hashlib.sha256(text.encode()).hexdigest()
            values = json.dumps(read[column]), asked, row["id"]
            db.execute(f"UPDATE settings SET {column} = ?, asked = ? WHERE id = ?", values)
            for run in db.execute(
                "SELECT * FROM results WHERE setting = ?", [row["id"]]
            ).fetchall():
                text = f"{asked} {run['suite_seed']} {run['run']}"
                run_id = f"{hashlib.sha256(text.encode()).hexdigest()[:16]}-{row['code']}"
                db.execute("UPDATE results SET run_id = ? WHERE id = ?", [run_id, run["id"]])


@pytest.fixture(scope="module")
def now(tmp_path_factory):
    """A folder of this version."""
    folder = tmp_path_factory.mktemp("earlier") / "now"
    run_and_write(folder, paper_cells(tasks=["ascending"]), trials=20)
    return folder


def test_runs_of_1_1_count_as_runs_of_now(now, tmp_path):
    then = edited(now, tmp_path / "then", *OF_1_1)
    assert load(then).plan.specifications == load(now).plan.specifications
    assert load(then).plan.cells[0].complete == load(now).plan.cells[0].complete
    assert check_runs(then).wrong == []
    run_id = load(now).runs.run_id[0]
    with open_store(then) as store:
        assert store.run(run_id).id == run_id
    select = {"tasks": ["ascending"], "methods": ["NAME"], "method_files": [template.__file__]}
    plan = plan_suite("paper", runs=2, trials=20, **select)
    put_beside(plan, [then], tmp_path / "out")
    with open_store(tmp_path / "out") as store:
        assert {*store.ids()} == {*load(now).runs.run_id}
    assert perform(load(now).plan, then, executor=InProcess()).done == 0
    with closing(sqlite3.connect(then / RUNS_FILE)) as db:  # as this version writes it
        assert db.execute("SELECT run_id, setting FROM runs LIMIT 1").fetchone() == (run_id, "")


def test_folders_of_2_0_count_the_search_for_hands_among_trials(tmp_path):
    task = tiny_task(initial_hands="best-of-all", goals=[[5.0, 1.0], [5.0, 2.0]])
    names = ["dual-process/EC4", "corrective-alone/given", "nullspace-qp/none"]
    cells = [Cell(task, built_in()[name]) for name in names]
    run_and_write(tmp_path / "now", cells, runs=1, trials=20)
    then = edited(tmp_path / "now", tmp_path / "then", version=2)
    assert check_runs(then).wrong == []
    runs = load(then).runs
    assert list(runs.trials) == [24, 5, 0]
    assert runs.initial_trials.isna().all()
    with open_store(then) as store, open_store(tmp_path / "now") as now:
        for run_id in runs.run_id:
            assert store.run(run_id).to_row() == now.run(run_id).to_row()
    more = run_and_write(then, cells, runs=2, trials=20).runs  # one more of the learner
    assert more.trials.tolist() == [24, 20, 5, 0]
    assert more.initial_trials.isna().tolist() == [True, False, True, True]
    assert check_runs(then).wrong == []


def test_a_run_with_a_parameter_that_is_gone_is_not_performed(now, tmp_path):
    then = edited(
        now,
        tmp_path / "then",
        *("environments SET content = json_set(content, '$.coartic', '1.1.0')", *OF_1_1),
    )
    ask(then, "parameters", "timing", "fixed")
    with open_store(then) as store:
        run = store.run(store.ids()[0])
    with pytest.raises(
        CoarticError, match=r"timing is an unknown key.* Version 1\.1\.0 of coartic"
    ):
        perform_again(run, built_in())


@pytest.mark.parametrize(
    ("method", "parameters", "begins"),
    [
        ("dual-process/EC1", {"trials": 60, "epsilon": 0.2, "noise_sd": 0.05}, "eb4e4adffc4d3218-"),
        ("nullspace-qp/none", {"period": 5}, "5bd50b47a216d22c-"),
    ],
)
def test_ids_begin_as_in_1_1(method, parameters, begins):
    """Those of suites quick, with 60 trials, and comparison; an id ends with the hash of code."""
    specification = Specification(load_task("ascending"), method, "", (), parameters, None)
    assert specification.run_id(0, 0) == begins
    row = specification.to_row()
    again = Specification.from_row(row | {"definition": json.dumps(row["definition"])}, "")
    assert again == specification  # told nothing


@pytest.mark.parametrize(
    ("column", "name", "value"),
    [("parameters", "ties", "right"), ("model", "gain", 0.1), ("model", "first_step", True)],
)
def test_another_reading_is_refused_in_a_sentence(now, tmp_path, column, name, value):
    then = edited(now, tmp_path / "then", *OF_1_1)
    ask(then, column, name, value)
    refused = pytest.raises(
        CoarticError, match="on ascending was another specification when it was run"
    )
    with open_store(then) as store:
        with refused:
            store.run(store.ids()[0])
        with refused:
            store.plan()
    if name != "gain":  # which the check takes as it is stored
        (words,) = check_runs(then).wrong
        assert name in words
        assert "version 1.1.0" in words
