"""Suites, the runner and the tables it leaves behind."""

import json

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from analysis.results import load_results
from baselines.corrective_alone import every_sequence
from benchmarks import records, runner
from benchmarks.records import RUNS, prepare_folder, write_results
from benchmarks.runner import Plan, corrective_sequences, execute_plan, run_seed
from benchmarks.suites import Cell, load_suite, select_cells
from coartic import CoarticError, execute, learn, load_task
from coartic.frames import movements_from

from .strategies import tiny_task

FIRST_COLUMNS = (
    "run_id suite task method run seed status reason hands reward replay_reward replay_hands "
    "initial_reward initial_hands"
).split()


def small_plan(runs=2, trials=150, seed=0, cells=None):
    return Plan("paper", tuple(cells or select_cells(load_suite("paper"))), runs, trials, seed)


def run_and_write(folder, plan, jobs=-1):
    prepare_folder(folder, overwrite=False)
    found = list(execute_plan(plan, jobs=jobs))
    manifest = {"specification": plan.specification(), "environment": {}}
    write_results(folder, found, corrective_sequences(plan.tasks), manifest)
    return load_results(folder)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return run_and_write(tmp_path_factory.mktemp("results") / "deep" / "er", small_plan())


def test_suite_paper():
    suite = load_suite("paper")
    assert (suite.runs, suite.trials) == (20, 10_000)
    assert [(cell.task.name, cell.method) for cell in select_cells(suite)] == [
        ("ascending", "dual-process/EC1"),
        ("descending", "dual-process/EC1"),
        ("two-armed-1", "dual-process/EC2"),
        ("two-armed-1", "dual-process/EC3"),
        ("two-armed-1", "dual-process/EC4"),
        ("two-armed-2", "dual-process/EC3"),
        ("two-armed-2", "dual-process/EC4"),
    ]


def test_runs_table(results):
    runs = results.runs
    assert list(runs.columns) == RUNS.names
    assert list(runs.columns[: len(FIRST_COLUMNS)]) == FIRST_COLUMNS
    assert len(runs) == 14
    assert runs.run_id.is_unique
    assert list(runs.run) == [0, 1] * 7
    assert (runs.status == "ok").all()
    assert (runs.trials == 150).all()
    assert (runs.corrective_iterations == runs.jacobians).all()
    assert (runs.reward >= runs.initial_reward).all()
    assert (runs.wall_s > 0).all()
    assert set(runs[runs.task == "ascending"].initial_reward) == {-319}


def test_solutions_re_execute_to_the_recorded_reward(results):
    """From the written files alone, every movement as it stands there."""
    tasks = results.tasks
    solutions = results.solutions()
    assert list(solutions.columns) == [
        *["run_id", "order", "goal", "hand", "kind", "ticks", "base_x", "base_y"],
        *[f"left_{k}" for k in range(1, 5)],
        *[f"right_{k}" for k in range(1, 5)],
    ]
    for run in results.runs.itertuples():
        rows = solutions[solutions.run_id == run.run_id]
        movements = movements_from(tasks[run.task], rows)
        execution = execute(tasks[run.task], movements)
        assert execution.reward == run.reward == -rows.ticks.sum()
        assert execution.hands == run.hands
        assert list(rows.order) == list(range(len(rows)))
        assert rows.goal.min() == 1


def test_learning_table(results):
    learning = results.learning()
    assert list(learning.columns) == ["run_id", "trial", "reward"]
    assert len(learning) == 14 * 150
    best = learning.groupby("run_id", observed=True).reward.max()
    first = learning[learning.trial == 0].set_index("run_id").reward
    for run in results.runs.itertuples():
        assert best[run.run_id] == run.reward
        assert first[run.run_id] == run.initial_reward
    columns = pq.read_schema(results.folder / "learning.parquet")
    assert [str(columns.field(n).type) for n in ("trial", "reward")] == ["int32", "int32"]


def test_sequences_table(results):
    sequences = results.sequences
    assert dict(sequences.groupby("task").size()) == {
        "ascending": 1,
        "descending": 1,
        "two-armed-1": 16,
        "two-armed-2": 16,
    }
    assert list(sequences[sequences.task == "two-armed-1"].hands[:2]) == ["LRLR", "RRLR"]


def test_tables_do_not_depend_on_the_number_of_workers(results, tmp_path):
    timings = ["wall_s", "cpu_s"]
    for jobs in (1, 3):
        again = run_and_write(tmp_path / str(jobs), small_plan(), jobs=jobs)
        pd.testing.assert_frame_equal(
            again.runs.drop(columns=timings), results.runs.drop(columns=timings)
        )
        pd.testing.assert_frame_equal(again.solutions(), results.solutions())
        pd.testing.assert_frame_equal(again.learning(), results.learning())


def test_a_cell_does_not_depend_on_its_company(results, tmp_path):
    cells = select_cells(load_suite("paper"), tasks=["two-armed-2"], methods=["dual-process/EC4"])
    alone = run_and_write(tmp_path, small_plan(cells=cells)).runs
    chosen = results.runs[results.runs.run_id.isin(alone.run_id)].reset_index(drop=True)
    pd.testing.assert_series_equal(alone.reward, chosen.reward)
    assert len(chosen) == 2


def test_seeds_are_paired_by_task_and_run(results):
    seeds = results.runs.groupby(["task", "run"]).seed.nunique()
    assert (seeds == 1).all()
    assert results.runs.seed.nunique() == 8  # 4 tasks x 2 runs
    assert run_seed(0, "ascending", 0) != run_seed(1, "ascending", 0)
    assert 0 <= run_seed(0, "x", 10**6) < 2**63


def test_a_run_is_reproduced_from_its_row(results):
    row = results.runs.iloc[5]
    run = learn(
        results.tasks[row.task],
        row.method.split("/")[1],
        seed=int(row.seed),
        trials=int(row.trials),
    )
    assert run.reward == row.reward
    assert run.hands == row.hands


def test_run_ids_name_what_the_run_depends_on(monkeypatch):
    cell, other = select_cells(load_suite("paper"))[:2]
    base = runner.run_id(cell, 1, 10)
    assert base == runner.run_id(cell, 1, 10)
    assert len({base, runner.run_id(other, 1, 10), runner.run_id(cell, 2, 10)}) == 3
    assert runner.run_id(cell, 1, 11) != base
    monkeypatch.setattr(runner, "source_fingerprint", lambda: "other code")
    assert runner.run_id(cell, 1, 10) != base


def test_failures_are_kept_as_data(tmp_path):
    stuck = tiny_task(
        name="stuck", locked_base=["x", "y"], hands=["right"],
        goals=[[2.5, 0.1]], initial_hands="R",
    )  # fmt: skip
    policy = stuck.model_copy(update={"name": "policy", "initial_hands": "best-of-all"})
    cells = [Cell(stuck, "dual-process/EC1"), Cell(policy, "dual-process/EC1")]
    found = run_and_write(tmp_path, small_plan(trials=5, cells=cells))
    assert list(found.runs.status) == ["infeasible"] * 4
    assert found.runs.reason.str.len().min() > 20
    assert found.runs.reward.isna().all()
    assert list(found.runs.failed_trials[:2]) == [5, 5]
    assert found.learning().reward.isna().all()
    assert len(found.learning()) == 10  # the runs that started
    assert found.solutions().empty
    assert found.sequences.reward.isna().all()


def test_a_crash_is_a_record_and_stops_nothing(monkeypatch):
    real = runner.learn

    def sometimes(task, condition, **arguments):
        if task.name == "descending":
            raise ZeroDivisionError("planted")
        return real(task, condition, **arguments)

    monkeypatch.setattr(runner, "learn", sometimes)
    cells = select_cells(load_suite("paper"), tasks=["ascending", "descending"])
    found = [record.row for record in execute_plan(small_plan(cells=cells), jobs=2)]
    assert [row["status"] for row in found] == ["ok", "ok", "crashed", "crashed"]
    assert found[2]["reason"] == "ZeroDivisionError: planted"


def test_a_reward_that_does_not_re_execute_is_refused(monkeypatch):
    real = runner.learn

    def wrong(*arguments, **keywords):
        run = real(*arguments, **keywords)
        run.rewards[run.best_trial] += 1
        return run

    monkeypatch.setattr(runner, "learn", wrong)
    (record,) = execute_plan(small_plan(runs=1, cells=select_cells(load_suite("paper"))[:1]))
    assert record.row["status"] == "crashed"
    assert "re-executes to" in record.row["reason"]


def test_robots_of_different_size_share_a_table(tmp_path):
    small = tiny_task(
        name="small", robot={"left_links": [2.0], "right_links": [1.0] * 11},
        start={"left": [0.1], "right": [0.1] * 11}, goals=[[3.0, 1.0]], initial_hands="R",
    )  # fmt: skip
    cells = [Cell(small, "dual-process/EC4"), *select_cells(load_suite("paper"))[:1]]
    found = run_and_write(tmp_path, small_plan(trials=20, cells=cells))
    names = list(found.solutions().columns[6:])
    assert names[2:6] == ["left_1", "left_2", "left_3", "left_4"]
    assert names[6:] == [f"right_{k}" for k in range(1, 12)]
    for run in found.runs.itertuples():
        rows = found.solutions()[found.solutions().run_id == run.run_id]
        task = found.tasks[run.task]
        assert execute(task, movements_from(task, rows)).reward == run.reward


def test_folder_with_results_is_left_alone(results):
    before = (results.folder / "runs.parquet").read_bytes()
    with pytest.raises(CoarticError, match="already holds results.*--overwrite"):
        prepare_folder(results.folder, overwrite=False)
    prepare_folder(results.folder, overwrite=True)
    assert (results.folder / "runs.parquet").read_bytes() == before


def test_unwritable_folder(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(CoarticError, match="cannot write to"):
        prepare_folder(tmp_path / "file" / "below", overwrite=False)


def test_a_failed_write_leaves_the_old_results(tmp_path, monkeypatch):
    plan = small_plan(runs=1, trials=2)
    run_and_write(tmp_path, plan)
    before = {name: (tmp_path / name).read_bytes() for name in records.FILES}

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(records.pq, "write_table", full)
    with pytest.raises(CoarticError, match="No space left on device"):
        write_results(tmp_path, [], [], {})
    assert {path.name for path in tmp_path.iterdir()} == set(records.FILES)
    assert before == {name: (tmp_path / name).read_bytes() for name in records.FILES}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"tasks": ["ascendin"]}, "did you mean 'ascending'?"),
        ({"methods": ["dual-process/EC9"]}, "unknown method 'dual-process/EC9'; did you mean"),
        (
            {"tasks": ["ascending"], "methods": ["dual-process/EC4"]},
            "no method to run on what was asked for: suite 'paper' has ascending x",
        ),
    ],
)
def test_selection_errors(arguments, words):
    with pytest.raises(CoarticError) as caught:
        select_cells(load_suite("paper"), **arguments)
    assert words in str(caught.value)


def test_unknown_suite():
    with pytest.raises(CoarticError, match="unknown suite 'papr'; did you mean 'paper'"):
        load_suite("papr")


def task_file(tmp_path, **changes):
    content = {
        "name": '"own"',
        "goals": "[[5.0, 1.0], [5.0, 2.0]]",
        "initial_hands": '"RR"',
        "start": "{ left = [0.0, 0.0, 0.0, 0.0], right = [0.0, 0.0, 0.0, 0.0] }",
        **changes,
    }
    path = tmp_path / f"{content['name'].strip(chr(34))}-{len(list(tmp_path.iterdir()))}.toml"
    path.write_text("\n".join(f"{key} = {value}" for key, value in content.items()))
    return path


def test_own_task_runs_under_every_applicable_condition(tmp_path):
    paper = load_suite("paper")
    path = task_file(tmp_path)
    cells = select_cells(paper, task_files=[path])
    assert len(cells) == 7 + 4
    only = select_cells(paper, task_files=[path], tasks=["own"])
    assert [cell.method[-3:] for cell in only] == ["EC1", "EC2", "EC3", "EC4"]
    one_armed = task_file(tmp_path, name='"arm"', hands='["right"]')
    assert [c.method for c in select_cells(paper, task_files=[one_armed], tasks=["arm"])] == [
        "dual-process/EC1"
    ]


def test_own_task_errors(tmp_path):
    paper = load_suite("paper")
    with pytest.raises(CoarticError, match="name 'ascending' is already taken by a shipped task"):
        select_cells(paper, task_files=[task_file(tmp_path, name='"ascending"')])
    twice = [task_file(tmp_path), task_file(tmp_path)]
    with pytest.raises(CoarticError, match="name 'own' is already taken by .*own-"):
        select_cells(paper, task_files=twice)
    left = task_file(tmp_path, name='"left"', hands='["left"]', initial_hands='"LL"')
    with pytest.raises(CoarticError, match="no method to run on task 'left': EC1 uses the right"):
        select_cells(paper, task_files=[left])


def test_every_sequence_is_sorted_and_bounded():
    trials = every_sequence(load_task("two-armed-1"))
    rewards = [trial.execution.reward for trial in trials]
    assert rewards == sorted(rewards, reverse=True)
    assert all(trial.hands == trial.execution.hands for trial in trials)
    many = tiny_task(goals=[[5.0, 1.0]] * 13, initial_hands="R" * 13)
    with pytest.raises(CoarticError, match="8192 hand sequences; at most 4096"):
        every_sequence(many)
    assert corrective_sequences([many]) == []


def test_damaged_results_are_named(results, tmp_path):
    with pytest.raises(CoarticError, match="is not a results folder: .*manifest.json is missing"):
        load_results(tmp_path)
    for name in records.FILES:
        (tmp_path / name).write_bytes((results.folder / name).read_bytes()[:100])
    with pytest.raises(CoarticError, match="results cannot be read"):
        load_results(tmp_path)


def test_manifest(results):
    manifest = json.loads((results.folder / "manifest.json").read_text(encoding="utf-8"))
    specification = manifest["specification"]
    assert specification["seed"] == 0
    assert specification["tasks"]["ascending"]["provenance"]["goals"]["status"] == "printed"
    assert specification["methods"]["dual-process/EC4"]["modify_other"] is True
    assert specification["model"]["arrival_tolerance"] == 0.01
    assert np.isfinite(manifest["format"])
