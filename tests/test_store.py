"""What is kept of runs: read back to the last bit, whatever interrupts or damages it."""

import json
import random
import shutil
import signal
import sqlite3
import sys
import time
import warnings
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from coartic import CoarticError, Movement
from coartic.analysis.study import load
from coartic.analysis.verify import check_runs
from coartic.benchmarks.provenance import made_with
from coartic.benchmarks.runner import perform
from coartic.benchmarks.scoring import score
from coartic.benchmarks.worker import fail, perform_job
from coartic.runs import store as store_module
from coartic.runs.record import movement_data
from coartic.runs.store import FORMAT, RUNS_FILE, open_store, open_store_for_writing
from tests.support.processes import started
from tests.support.strategies import failing_task, tiny_task
from tests.support.suites import (
    KNOWN,
    Failing,
    InProcess,
    cell_on,
    edit,
    edit_movement,
    paper_cells,
    planned,
    run_and_write,
    same_results,
)

NEAR = tiny_task(
    name="near", hands=["right"], goals=[[3.0, 1.0]], initial_hands="R",
    robot={"left_links": [2.0], "right_links": [2.0] * 2}, start={"left": [0.1], "right": [0.1] * 2}
)  # fmt: skip
"""Of a robot of another size than that of the other tasks."""
CELLS = [
    cell_on(failing_task(), KNOWN["dual-process/EC4"], epsilon=0.5),
    cell_on(NEAR, KNOWN["posture-qp/current-goal"]),
]
ONE = paper_cells(tasks=["ascending"])
FEW = {"runs": 9, "trials": 20}
PLAN = planned(ONE, **FEW)


def perform_here(folder):
    return perform(PLAN, folder, executor=InProcess())


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Runs as they were written, by their ids, and a study of them."""
    folder, plan = tmp_path_factory.mktemp("written"), planned(CELLS, trials=40)
    runs = [run for job in plan for run in score(job, perform_job(job))]
    with open_store_for_writing(folder) as store:
        store.replace_plan(plan, made_with())
        store.write(runs)
    return {run["run_id"]: run for run in runs}, load(folder)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return run_and_write(tmp_path_factory.mktemp("undisturbed"), ONE, **FEW)


def test_all_rows_of_a_large_folder_are_read(undisturbed, tmp_path):
    """More than are read at once, and the last of them right."""
    folder, count = shutil.copytree(undisturbed.folder, tmp_path / "large"), 12_345
    with closing(sqlite3.connect(folder / RUNS_FILE)) as database:
        columns = [row[1] for row in database.execute("PRAGMA table_info(results)")]
        values = {"run_id": "'run-' || n", "run": "n", "reward": "-n", "seed": "n"}
        selected = ", ".join(values.get(name, f'results."{name}"') for name in columns)
        names = ", ".join(f'"{name}"' for name in columns)
        database.execute(
            f"""WITH RECURSIVE more(n) AS
            (SELECT 100 UNION ALL SELECT n + 1 FROM more LIMIT {count})
            INSERT INTO results ({names}) SELECT {selected} FROM more, results
            WHERE results.rowid = 1"""
        )
        database.execute("DELETE FROM results WHERE run < 100")
        database.execute("UPDATE cells SET runs = 100000")
        database.commit()
    with open_store(folder) as store:
        runs, solutions = store.runs(), store.solutions()
    assert runs.run.tolist() == [*range(100, 100 + count)]
    assert (runs.reward == -runs.run).all()
    assert [*dict.fromkeys(solutions.run_id)] == [f"run-{n}" for n in range(100, 100 + count)]


@pytest.fixture
def copied(undisturbed, tmp_path):
    """The file of a copy of these runs, to be changed."""
    return shutil.copy(undisturbed.folder / RUNS_FILE, tmp_path / RUNS_FILE)


def plain(run):
    """All of a run, without the name of the suite."""
    return replace(run, job=replace(run.job, suite=""))


def test_what_is_written_is_read_back(written):
    handed, study = written
    learner, _, planner = study.runs.run_id
    assert {None} < {*handed[learner].rewards}
    assert handed[planner].part("solution")[0].waypoints is not None
    with open_store(study.folder) as store:
        for run_id, run in handed.items():
            assert plain(store.run(run_id)) == plain(run)
        assert store.plan() == [
            replace(job, time_limit_s=300.0) for job in planned(CELLS, trials=40)
        ]
    for run_id, rewards in study.rewards():
        kept = [np.nan if reward is None else reward for reward in handed[run_id].rewards]
        np.testing.assert_array_equal(rewards, kept)
    with closing(sqlite3.connect(study.folder / RUNS_FILE)) as plain_sql:
        for run_id, run in handed.items():

            def values(query, run_id=run_id):
                return [value for (value,) in plain_sql.execute(f"SELECT {query}", (run_id,))]

            assert values("reward FROM runs WHERE run_id = ?") == [run["reward"]]
            solution = run.part("solution")
            paths = values('path FROM solutions WHERE run_id = ? ORDER BY "order"')
            points = [m.target if m.waypoints is None else m.waypoints for m in solution]
            assert [*map(json.loads, paths)] == [each.tolist() for each in points]


def test_a_batch_is_there_whole_or_not_at_all(written, tmp_path):
    edges = np.array([5e-324, 1e308, np.nextafter(1, 2), 1 / 3, *np.zeros(6)])
    path = movement_data(Movement(1, "left", "path", edges, 3, np.array([edges / 7, edges])))
    first = next(iter(written[0].values()))
    environment = {"commit": {"id": "c0de", "dirty": True}}
    run = replace(first, movements={"solution": [path], "replay": [path]}, environment=environment)
    run = run.with_values(reward=-3, hands="L", replay_reward=-3, replay_hands="L")

    def some():
        yield run
        raise KeyboardInterrupt

    with open_store_for_writing(tmp_path) as store:
        store.replace_plan(planned(CELLS, trials=40), made_with())
        with pytest.raises(KeyboardInterrupt):
            store.write(some())
        assert len(store.ids()) == 0
        for _ in range(2):  # the second one replaces the first
            store.write([run])
            assert len(store.ids()) == 1
    with open_store(tmp_path) as store:
        assert plain(store.run(run["run_id"])) == plain(run)
        assert store.runs().commit.tolist() == ["c0de+"]


MANY = {"runs": 10, "trials": 30}
SEARCH = cell_on(NEAR, KNOWN["optimum/search"], graphs=1, chains=1, nodes=60)
SEARCHED = [SEARCH, *paper_cells()]


def perform_until_killed(progress, folder, most):
    """Perform so many runs, say how many are kept, and wait for the end."""

    def watch(at, _):
        progress.send(at.done)
        while at.done >= most:
            signal.pause()

    perform(planned(SEARCHED, **MANY), folder, executor=InProcess(), watch=watch)


@pytest.mark.process
@pytest.mark.skipif(
    sys.platform != "linux",
    reason="forks a process that has imported everything, which is safe on Linux alone",
)
def test_a_process_that_is_killed_at_any_moment_loses_nothing(tmp_path):
    """And what it has written is not begun again, a search above all, which is the first run."""
    whole, begun = run_and_write(tmp_path / "whole", SEARCHED, **MANY), []

    class Counts(InProcess):
        def perform(self, jobs):
            begun.extend(job.cell.method.name for job in jobs for _ in job.numbers)
            return super().perform(jobs)

    chance, there, folder = random.Random(3), [0], tmp_path / "killed"
    for _ in range(3):
        enough = chance.randrange(1, 16)
        process, done = started(perform_until_killed, folder, enough + 15)
        while done.recv() < enough:
            pass
        time.sleep(chance.uniform(0, 0.05))
        process.kill()
        process.join()
        with closing(sqlite3.connect(folder / RUNS_FILE)) as plain_sql:
            assert plain_sql.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            there += plain_sql.execute("SELECT count(*) FROM results").fetchone()
    assert there == sorted(there)
    assert 0 < there[-1] < 71
    resumed = run_and_write(folder, SEARCHED, executor=Counts(), **MANY)
    assert len(begun) == 71 - there[-1]
    assert "optimum/search" not in begun
    same_results(resumed, whole)


def test_one_writes_and_nobody_else_meanwhile(undisturbed):
    with open_store_for_writing(undisturbed.folder):
        with pytest.raises(CoarticError, match=r"another `coartic run` uses.*wait"):
            perform_here(undisturbed.folder)
        same_results(load(undisturbed.folder), undisturbed)  # readers do no harm


@pytest.mark.filterwarnings("always:another program uses .* waiting")
@pytest.mark.parametrize("begin", ["BEGIN", "BEGIN EXCLUSIVE"])
def test_a_run_waits_for_a_reader_and_the_reader_reads(written, tmp_path, begin, monkeypatch):
    """Where its program keeps the file, in the middle of a transaction, until the run says that it
    waits."""
    counts = []
    monkeypatch.setattr(store_module, "WAIT_S", 0.05)
    with open_store_for_writing(tmp_path) as store:
        store.replace_plan(planned(CELLS, trials=40), made_with())
        reader = sqlite3.connect(tmp_path / RUNS_FILE, isolation_level=None)

        def count(*_):
            counts.extend(reader.execute("SELECT count(*) FROM results").fetchone())
            if counts[1:]:
                reader.rollback()

        monkeypatch.setattr(warnings, "showwarning", count)
        reader.execute(begin)
        count()
        store.write(written[0].values())
        count()
        reader.close()
    assert counts == [0, 0, 3]
    assert [path.name for path in tmp_path.iterdir()] == [RUNS_FILE]


def replace_by_a_copy(folder):
    shutil.copytree(folder, folder.with_name("copy"))
    shutil.rmtree(folder)
    folder.with_name("copy").rename(folder)


@pytest.mark.parametrize("lose", [shutil.rmtree, replace_by_a_copy])
def test_a_folder_that_is_lost_during_a_run_ends_it_with_a_sentence(tmp_path, lose):
    def watch(progress, _):
        if progress.done == 8:
            lose(tmp_path / "out")

    with pytest.raises(CoarticError, match="out/.* was removed, renamed or replaced while"):
        perform(PLAN, tmp_path / "out", executor=InProcess(2), watch=watch)


class TooSlow(InProcess):
    def perform(self, jobs):
        for job in jobs:
            yield job, fail(job, "timeout", "time limit exceeded", 1.0)


def test_what_is_performed_again(undisturbed, tmp_path):
    def counts(time_limit_s, executor):
        plan = planned(ONE, time_limit_s=time_limit_s, **FEW)
        progress = perform(plan, tmp_path, executor=executor)
        return progress.present, progress.done, progress.failed, progress.crashed

    assert counts(1.0, TooSlow()) == (0, 9, 9, 0)
    assert counts(1.0, InProcess()) == (9, 0, 9, 0)  # they would be too slow again
    assert counts(0.5, InProcess()) == (9, 0, 9, 0)
    assert counts(2.0, Failing(0)) == (0, 9, 1, 1)
    assert load(tmp_path).runs.status.tolist() == ["crashed"] + ["ok"] * 8
    assert counts(3.0, InProcess()) == (8, 1, 0, 0)
    assert load(tmp_path).runs.result.tolist() == undisturbed.runs.result.tolist()


def sql(statement):
    return lambda path: edit(path.parent, statement)


def foreign(path):
    path.unlink()
    sql("CREATE TABLE notes (text)")(path)


def of_5_0_0(path):
    """Marked as by version 5.0.0, whose number is read from where it was then."""
    edit(path.parent, "UPDATE environments SET content = json_set(content, '$.coartic', '5.0.0')")
    edit(path.parent, "PRAGMA user_version = 6")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (sql(f"PRAGMA user_version = {FORMAT + 1}"), "later version.*update coartic"),
        (of_5_0_0, "was written by coartic 5.0.0, .*`coartic run` command with another --out"),
        (foreign, "was not written by coartic"),
        (lambda path: path.write_bytes(b"x" * 9999), "is damaged.*Move it out of"),
        (lambda path: path.write_bytes(path.read_bytes()[:-1]), "is damaged.*Move it out of"),
        (lambda path: path.write_bytes(path.read_bytes()[:-4096]), "is damaged.*Move it out of"),
    ],
)
def test_what_is_no_results_folder_is_left_alone(copied, tmp_path, spoil, words):
    def content():
        return {path: path.is_file() and path.read_bytes() for path in tmp_path.iterdir()}

    spoil(copied)
    before = content()
    for use in (load, perform_here):
        with pytest.raises(CoarticError, match=words) as caught:
            use(tmp_path)
        assert str(tmp_path) in str(caught.value)
        assert len(str(caught.value).splitlines()) == 1
        assert content() == before


def test_a_file_without_its_views_is_damaged(copied, tmp_path):
    """As a dump that was restored in part."""
    edit(tmp_path, "DROP VIEW asked")
    for use in (load, perform_here):
        with pytest.raises(CoarticError, match="it is damaged. Move it out of"):
            use(tmp_path)


@pytest.mark.parametrize(
    "statement",
    ["VACUUM", "CREATE VIEW mine AS SELECT 1"],
)
def test_what_other_programs_add_does_no_harm(copied, undisturbed, tmp_path, statement):
    with closing(sqlite3.connect(copied, isolation_level=None)) as db:
        db.execute(statement)
    same_results(load(tmp_path), undisturbed)
    assert check_runs(tmp_path).wrong == []
    assert perform_here(tmp_path).done == 0


def read_all(folder):
    study = load(folder)
    for cell in study.cells:
        study.executed(*cell)
    return list(study.rewards())


def rewritten(*place):
    """A change of one entry of the stored movements of the first run."""

    def change(folder):
        *entry, value = place

        def put(movement):
            numbers = movement if len(entry) == 1 else movement[entry[0]]
            numbers[entry[-1]] = value

        edit_movement(folder, 1, put)

    return change


DEEP = "[" * 100_000 + "]" * 100_000


@pytest.mark.parametrize(
    "change",
    [
        "cells SET content = json_set(content, '$.task.radius', 0.2)",
        "suite SET content = 'x'",
        "results SET movements = '{'",
        "results SET rewards = substr(rewards, 1, 9)",
        "cells SET method = 'x'",
        "cells SET task = 'descending'",
        f"cells SET content = '{DEEP}'",
        f"results SET movements = '{DEEP}'",
        rewritten(4, 6, 0.1),
        rewritten(2, "path"),
    ],
)
def test_content_of_another_kind_is_one_sentence(copied, tmp_path, change):
    """Whatever cannot be read, the check of the folder finds as well, or says that it cannot."""
    if isinstance(change, str):
        edit(tmp_path, f"UPDATE {change}")
    else:
        change(tmp_path)
    with pytest.raises(CoarticError) as caught:
        read_all(tmp_path)
    assert str(tmp_path) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    if change != "suite SET content = 'x'":  # what a command said of itself is not checked
        assert check_runs(tmp_path).wrong


@pytest.mark.parametrize("table", ["results", "cells", "suite", "environments"])
def test_rows_that_a_person_deleted_are_made_again(copied, undisturbed, tmp_path, table):
    edit(tmp_path, f"DELETE FROM {table} WHERE rowid IN (SELECT max(rowid) FROM {table})")
    perform_here(tmp_path)
    same_results(load(tmp_path), undisturbed)
    assert check_runs(tmp_path) == check_runs(undisturbed.folder)
