"""Suites, the harness, and the tables it leaves behind."""

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from coartic import (
    CoarticError,
    Movement,
    corrective_trial,
    execute,
    files,
    hand_sequences,
    learn,
    load_task,
)
from coartic.analysis.comparisons.paper import paper_rows
from coartic.analysis.results.folder import load_results
from coartic.analysis.results.laws import read_manifest
from coartic.analysis.study import Study
from coartic.benchmarks.declaration import declared
from coartic.benchmarks.executors import Local
from coartic.benchmarks.registry import CLASSES, Entry, registry
from coartic.benchmarks.run import Selection, run_suite
from coartic.benchmarks.specification import Limits
from coartic.benchmarks.store import Store
from coartic.benchmarks.suites import (
    Cell,
    distinct,
    load_suite,
    select_cells,
)
from coartic.benchmarks.tables import write_tables
from coartic.benchmarks.worker import ForeignCodeError, perform
from coartic.inputs import MOST_PLANNED
from coartic.learner.rows import movements_from
from coartic.method import Information, Parameters, Session
from coartic.motion.initial import ranked_sequences
from coartic.runs.record import run_seeds
from coartic.runs.tables import FORMAT, RUNS
from tests.support.strategies import as_released, tiny_task
from tests.support.suites import (
    KNOWN,
    paper_cells,
    run_and_write,
    run_specs,
    same_tables,
    suite_of,
)

FIRST_COLUMNS = [
    *"run_id suite task method variant label run seed status reason hands reward".split(),
    *"replay_reward replay_hands initial_reward initial_hands best_trial trials".split(),
]
BROKEN = Path(__file__).parent / "plugins" / "broken.py"


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return run_and_write(tmp_path_factory.mktemp("results") / "deep" / "er")


def test_suite_paper():
    suite = load_suite("paper")
    assert (suite.runs, suite.trials) == (20, 10_000)
    assert [(cell.task.name, cell.method) for cell in paper_cells()] == [
        ("ascending", "dual-process/EC1"),
        ("descending", "dual-process/EC1"),
        ("two-armed-1", "dual-process/EC2"),
        ("two-armed-1", "dual-process/EC3"),
        ("two-armed-1", "dual-process/EC4"),
        ("two-armed-2", "dual-process/EC3"),
        ("two-armed-2", "dual-process/EC4"),
    ]


def test_every_method_runs_in_some_suite():
    suites = ("comparison", "ablations", "optimum")
    cells = [cell for suite in suites for cell in select_cells(load_suite(suite), KNOWN)]
    assert {cell.method for cell in cells} == set(KNOWN)


def test_suite_comparison_has_at_most_sixteen_methods_a_task():
    tasks = [cell.task.name for cell in select_cells(load_suite("comparison"), KNOWN)]
    assert max(map(tasks.count, tasks)) <= 16


def test_suite_ablations_frees_the_base():
    cells = select_cells(load_suite("ablations"), KNOWN)
    tasks = {cell.task.name: cell.task for cell in cells}
    free, rail = tasks["two-armed-1.free-base"], tasks["two-armed-1"]
    assert (free.locked_base, rail.locked_base) == ((), ("y",))
    assert free.provenance["locked_base"].status == "chosen"
    same = {"goals", "start", "hands", "radius", "initial_hands"}
    assert free.model_dump(include=same) == rail.model_dump(include=same)
    blocks = {
        "cells": [{"tasks": ["ascending"], "methods": ["dual-process/EC1"], "free_base": True}]
    }
    suite = load_suite("paper").model_validate(load_suite("paper").model_dump() | blocks)
    with pytest.raises(CoarticError, match="the base of task 'ascending' is free"):
        select_cells(suite, KNOWN)


def test_runs_table(results):
    runs = results.runs
    assert list(runs.columns) == RUNS.names
    assert list(runs.columns[: len(FIRST_COLUMNS)]) == FIRST_COLUMNS
    assert (runs.solution_corrections <= 4).all()
    assert (runs.told.str.contains("reward by trial")).all()
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


def test_tables_do_not_depend_on_executor_or_workers(results, tmp_path):
    """In this process and in two others: the same but for the timings."""
    same_tables(run_and_write(tmp_path, executor=Local(2)), results)


def test_a_cell_does_not_depend_on_its_company(results, tmp_path):
    cells = paper_cells(tasks=["two-armed-2"], methods=["dual-process/EC4"])
    alone = run_and_write(tmp_path, cells).runs
    chosen = results.runs[results.runs.run_id.isin(alone.run_id)].reset_index(drop=True)
    pd.testing.assert_series_equal(alone.reward, chosen.reward)
    assert len(chosen) == 2


def test_seeds_are_paired_by_task_and_run(results):
    seeds = results.runs.groupby(["task", "run"]).seed.nunique()
    assert (seeds == 1).all()
    assert results.runs.seed.nunique() == 8  # 4 tasks x 2 runs
    for root, task in ((0, "ascending"), (1, "ascending"), (2**40 + 5, "x"), (2**63 - 1, "é")):
        digest = hashlib.sha256(task.encode()).digest()
        words = [int.from_bytes(digest[4 * k : 4 * k + 4], "little") for k in range(4)]
        for run, seed in list(enumerate(run_seeds(root, task, 10**5)))[::9973]:
            sequence = np.random.SeedSequence(root, spawn_key=(*words, run))
            assert seed == int(sequence.generate_state(1, np.uint64)[0]) >> 1


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


def test_run_ids_name_what_the_run_depends_on():
    def first(**changes):
        cells = changes.pop("cells", paper_cells()[:1])
        return run_specs(cells, **{"runs": 1, "seed": 0, "trials": 10, **changes})[0][1]

    base = first()
    assert base.run_id == first().run_id
    assert base.run_id == first(limits=Limits(time_s=1.0)).run_id  # decides whether, not which
    others = [
        first(cells=paper_cells()[1:2]),
        first(seed=1),
        first(trials=11),
        first(limits=Limits(trials=5)),
        first(cells=[Cell(base.task, base.entry, (("noise_sd", 0.1),))]),
        first(cells=[Cell(base.task.model_copy(update={"radius": 0.2}), base.entry)]),
    ]
    assert len({spec.run_id for spec in [base, *others]}) == 7
    assert base.run_id == f"{base.specification.key()}-{base.entry.code}"


def test_failures_are_kept_as_data(tmp_path):
    stuck = tiny_task(
        name="stuck", locked_base=["x", "y"], hands=["right"],
        goals=[[2.5, 0.1]], initial_hands="R",
    )  # fmt: skip
    policy = stuck.model_copy(update={"name": "policy", "initial_hands": "best-of-all"})
    learner = KNOWN["dual-process/EC1"]
    found = run_and_write(tmp_path, [Cell(stuck, learner), Cell(policy, learner)], trials=5)
    assert list(found.runs.status) == ["infeasible"] * 4
    assert found.runs.reason.str.len().min() > 20
    assert found.runs.reward.isna().all()
    assert list(found.runs.failed_trials[:2]) == [5, 5]
    assert found.learning().reward.isna().all()
    assert len(found.learning()) == 10  # the runs that started
    assert found.solutions().empty
    assert found.sequences.reward.isna().all()


def test_grid_and_fixed_parameters(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(
        """
        title = "Noise"
        description = "Noise against trials"
        runs = 1
        [[cells]]
        tasks = ["ascending"]
        methods = ["dual-process/EC1"]
        parameters = { trials = 40 }
        grid = { noise_sd = [0.02, 0.1], epsilon = [0.0, 0.5] }
        """
    )
    cells = select_cells(load_suite(str(path)), KNOWN)
    assert [cell.variant for cell in cells] == [
        "trials=40, noise_sd=0.02, epsilon=0.0",
        "trials=40, noise_sd=0.02, epsilon=0.5",
        "trials=40, noise_sd=0.1, epsilon=0.0",
        "trials=40, noise_sd=0.1, epsilon=0.5",
    ]
    runs = run_and_write(tmp_path / "out", cells, runs=1, trials=999).runs
    assert (runs.trials == 40).all()  # the suite's own parameter stands
    assert runs.reward[0] == runs.reward[1]  # EC1 explores no hands, so ε is idle
    assert runs.reward[0] != runs.reward[2]
    asked = {"epsilon": 0.5, "noise_sd": 0.1, "trials": 40}
    assert json.loads(runs.parameters[3]).items() >= asked.items()


@pytest.mark.parametrize(
    ("block", "words"),
    [
        ('methods = ["dual-proces/EC1"]', "did you mean 'dual-process/EC1'"),
        ('methods = ["dual-process/EC3"]', "task 'ascending' has no left hand"),
        (
            'methods = ["dual-process/EC1"]\nparameters = {noise = 1.0}',
            "noise is an unknown key; did you mean 'noise_sd'?",
        ),
        (
            'methods = ["dual-process/EC1"]\ngrid = {noise_sd = [-1.0]}',
            "noise_sd is -1.0; it must be at least 0",
        ),
        ('methods = ["dual-process/EC1"]\ngrid = {noise_sd = []}', "own.toml: cells[0].grid"),
        ("methods = []", "own.toml: cells[0].methods"),
        (
            'methods = ["dual-process/EC1"]\nrun = 3',
            "own.toml: cells[0].run is an unknown key; did you mean 'runs'?",
        ),
    ],
)
def test_suite_files_that_cannot_be_used(block, words, tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(
        f'title = "x"\ndescription = "x"\nruns = 1\n[[cells]]\ntasks = ["ascending"]\n{block}\n'
    )
    with pytest.raises(CoarticError) as caught:
        select_cells(load_suite(str(path)), KNOWN)
    assert words in str(caught.value)


def test_cells_are_told_apart_by_their_parameters(tmp_path):
    """Different parameters are different cells, compared with the paper only as it had them."""
    ec1 = 'tasks = ["ascending"]\nmethods = ["dual-process/EC1"]\n'
    cells = suite_of(
        tmp_path,
        ec1,
        ec1 + "parameters = { noise_sd = 0.5 }",
        ec1 + "parameters = { noise_sd = 0.05 }",  # the default: the first cell again
        ec1 + "parameters = { trials = 20 }",
        'tasks = ["*"]\nmethods = ["dual-process/EC1"]',
    )
    labels = [(cell.task.name, cell.variant) for cell in cells]
    assert labels[:3] == [
        ("ascending", ""),
        ("ascending", "noise_sd=0.5"),
        ("ascending", "trials=20"),
    ]
    assert len(labels) == len(set(labels)) == 6
    found = run_and_write(tmp_path / "out", cells, runs=3, trials=30)
    assert found.runs.run_id.is_unique
    assert set(found.runs.groupby(["task", "variant"]).size()) == {3}
    compared = {(row.cell.task, row.cell.label) for row in paper_rows(Study(found))}
    assert ("ascending", "dual-process/EC1") in compared
    assert all(variant == "" or f"EC1 {variant}" not in str(compared) for _, variant in labels)


def test_verdicts_only_for_runs_as_long_as_the_papers(tmp_path):
    cells = paper_cells(tasks=["ascending"])
    long = run_and_write(tmp_path / "long", cells, runs=2, trials=10_000)
    short = run_and_write(
        tmp_path / "short", cells, runs=2, trials=10_000, limits=Limits(300.0, trials=40)
    )
    verdicts = [[row.verdict for row in paper_rows(Study(found))] for found in (long, short)]
    assert None not in verdicts[0]
    assert verdicts[1] == [None]


def test_learner_columns_are_the_learners(tmp_path):
    """A method's details never pass for columns that mean something else."""
    known = registry([BROKEN])
    found = run_and_write(tmp_path, [Cell(load_task("ascending"), known["test/pretender"])], runs=1)
    assert found.runs[["replay_reward", "best_trial"]].isna().all(axis=None)


def test_a_policys_search_counts_and_is_bounded(tmp_path):
    task = tiny_task(initial_hands="best-of-all", goals=[[5.0, 1.0], [5.0, 2.0], [4.0, 3.0]])
    names = ("dual-process/EC4", "corrective-alone/given")
    cells = [Cell(task, KNOWN[name]) for name in names]
    runs = run_and_write(tmp_path / "free", cells, runs=1, trials=20).runs
    assert list(runs.trials) == [8 + 20, 8 + 1]
    bounded = run_and_write(
        tmp_path / "bounded", cells[:1], runs=1, trials=20, limits=Limits(300.0, trials=11)
    ).runs
    assert list(bounded.trials) == [11]
    none_left = run_and_write(
        tmp_path / "none", cells[:1], runs=1, trials=20, limits=Limits(300.0, trials=8)
    ).runs
    assert list(none_left.status) == ["infeasible"]
    assert "the trial budget ends with the search" in none_left.reason[0]


def test_a_session_counts_per_configuration():
    session = Session(load_task("ascending"), 0, set(Information), trial_budget=2)
    session.forward_kinematics(np.zeros((4, 5, 10)), "right")
    session.jacobian(np.zeros((3, 10)), "right")
    found = session.correct(session.q0, "right", 1)
    execution = session.trial([Movement(k, "right", "corrective") for k in (1, 2, 3)])
    meter = session.meter
    assert meter.forward_kinematics == 20 + found.iterations + 1 + execution.evaluations
    assert meter.jacobians == 3 + found.iterations + execution.iterations
    assert (meter.trials, meter.movement_ticks, meter.corrections) == (1, 319, 3)
    assert session.trials_left == 1
    with pytest.raises(ValueError, match="goals are numbered 1 to 3"):
        session.correct(session.q0, "right", 4)


def test_a_worker_with_other_code_refuses():
    (_, spec), *_ = run_specs(paper_cells(), runs=1, seed=0, trials=1)
    with pytest.raises(ForeignCodeError, match="has code .* here and c0ffee"):
        perform({**spec.job(), "code": "c0ffee"})
    job = spec.job()
    job["specification"] = {**job["specification"], "method": "not-here"}
    with pytest.raises(ForeignCodeError, match="'not-here': it is not installed on this worker"):
        perform(job)
    with pytest.raises(ForeignCodeError, match="it is not installed on this worker"):
        perform({**spec.job(), "module": "coartic.baselines.not_here"})
    older = {key: value for key, value in spec.job().items() if key != "module"}
    with pytest.raises(ForeignCodeError, match="another version asks for it"):
        perform(older)
    far = {"kind": "file", "where": "far.py", "source": "import no_such_module_here"}
    broken = {**spec.job(), "foreign": far}
    with pytest.raises(ForeignCodeError, match="cannot be run: ModuleNotFoundError"):
        perform(broken)


def test_deterministic_methods_run_once():
    cells = paper_cells(methods=["corrective-alone/every"], tasks=["two-armed-1"])
    assert [cell.method for cell in cells] == ["corrective-alone/every"]
    assert len(run_specs(cells, runs=20, seed=0)) == 1


def test_corrective_alone_as_a_method(tmp_path):
    cells = paper_cells(methods=["corrective-alone/given", "corrective-alone/every"])
    found = run_and_write(tmp_path, cells).runs
    by_cell = found.set_index(["task", "method"]).reward
    assert by_cell["two-armed-1", "corrective-alone/given"] == -675
    assert by_cell["two-armed-1", "corrective-alone/every"] == -532
    assert by_cell["ascending", "corrective-alone/every"] == -319
    spent = found.set_index(["task", "method"])
    assert spent.trials["two-armed-1", "corrective-alone/every"] == 16
    assert spent.trials["two-armed-1", "corrective-alone/given"] == 1
    assert spent.movement_ticks["two-armed-1", "corrective-alone/given"] == 675


def test_robots_of_different_size_share_a_table(tmp_path):
    small = tiny_task(
        name="small", robot={"left_links": [2.0], "right_links": [1.0] * 11},
        start={"left": [0.1], "right": [0.1] * 11}, goals=[[3.0, 1.0]], initial_hands="R",
    )  # fmt: skip
    cells = [Cell(small, KNOWN["corrective-alone/given"]), *paper_cells()[:1]]
    found = run_and_write(tmp_path, cells, trials=20)
    names = list(found.solutions().columns[6:])
    assert names[2:6] == ["left_1", "left_2", "left_3", "left_4"]
    assert names[6:] == [f"right_{k}" for k in range(1, 12)]
    for run in found.runs.itertuples():
        rows = found.solutions()[found.solutions().run_id == run.run_id]
        task = found.tasks[run.task]
        assert execute(task, movements_from(task, rows)).reward == run.reward


def test_a_failed_write_leaves_the_old_tables(tmp_path, monkeypatch):
    found = run_and_write(tmp_path, runs=1, trials=2)
    manifest = read_manifest(found.folder)
    before = {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files, "write_atomically", full)
    other = manifest.limits.model_copy(update={"time_s": 1.0})
    manifest = manifest.model_copy(update={"limits": other})
    with pytest.raises(CoarticError, match="No space left on device"):
        write_tables(Store(tmp_path), manifest)
    assert before == {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}


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
        paper_cells(**arguments)
    assert words in str(caught.value)


def test_unknsuite_of():
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
    cells = select_cells(paper, KNOWN, task_files=[path])
    assert len(cells) == 7 + 4
    with_baseline = select_cells(
        paper, KNOWN, task_files=[path], tasks=["own"], methods=["corrective-alone/every"]
    )
    assert [cell.method for cell in with_baseline] == ["corrective-alone/every"]
    only = select_cells(paper, KNOWN, task_files=[path], tasks=["own"])
    assert [cell.method[-3:] for cell in only] == ["EC1", "EC2", "EC3", "EC4"]
    one_armed = task_file(tmp_path, name='"arm"', hands='["right"]')
    assert [
        c.method for c in select_cells(paper, KNOWN, task_files=[one_armed], tasks=["arm"])
    ] == ["dual-process/EC1"]


def test_variants_of_the_learner_are_methods_of_their_own(tmp_path):
    """Known by their short names, and told what they use."""
    cells = paper_cells(methods=["EC1-biased"], tasks=["ascending"])
    assert [cell.label for cell in cells] == ["dual-process/EC1-biased"]
    grid = suite_of(
        tmp_path,
        'tasks = ["two-armed-2"]\nmethods = ["dual-process/EC4-nullspace"]\n'
        "grid = { nullspace_gain = [0.05, 0.2] }",
    )
    assert [cell.variant for cell in grid] == ["", "nullspace_gain=0.2"]
    for name, entry in KNOWN.items():
        if name.startswith("dual-process/"):
            method = entry.declared
            condition = CLASSES[name].condition
            for key, value in entry.complete({"trials": 1}).items():
                assert key == "trials" or getattr(condition, key) == value
            assert ("secondary objectives" in method.told) == bool(method.secondary)
            assert bool(method.secondary) == name.endswith("-nullspace")
            assert ("Jacobian" in method.told) == name.endswith("-biased")
    for foreign in ("nullspace_gain", "bias"):  # told would no longer be right
        with pytest.raises(CoarticError, match=f"{foreign} is an unknown key"):
            KNOWN["dual-process/EC4"].complete({foreign: 0.1})


def test_own_task_errors(tmp_path):
    paper = load_suite("paper")
    with pytest.raises(CoarticError, match="name 'ascending' is already taken by a shipped task"):
        select_cells(paper, KNOWN, task_files=[task_file(tmp_path, name='"ascending"')])
    twice = [task_file(tmp_path), task_file(tmp_path)]
    with pytest.raises(CoarticError, match="name 'own' is already taken by .*own-"):
        select_cells(paper, KNOWN, task_files=twice)
    left = task_file(tmp_path, name='"left"', hands='["left"]', initial_hands='"LL"')
    with pytest.raises(CoarticError, match="no method to run on task 'left': EC1 uses the right"):
        select_cells(paper, KNOWN, task_files=[left])


def test_every_sequence_is_sorted_and_bounded():
    task = load_task("two-armed-1")
    trials = ranked_sequences(task, hand_sequences(task))
    rewards = [execution.reward for _, execution in trials]
    assert rewards == sorted(rewards, reverse=True)
    assert all(hands == execution.hands for hands, execution in trials)
    two = as_released("two-armed-2")  # RLRR and RRRR tie: fewer changes of hand go first
    assert [corrective_trial(two, hands).reward for hands in ("RLRR", "RRRR")] == [-357] * 2
    assert [hands for hands, _ in ranked_sequences(two, hand_sequences(two))[:2]] == [
        "RRRR",
        "RLRR",
    ]
    many = tiny_task(goals=[[5.0, 1.0]] * 13, initial_hands="R" * 13)
    with pytest.raises(CoarticError, match="8192 hand sequences; at most 4096"):
        hand_sequences(many)


def test_damaged_results_are_named(results, tmp_path):
    with pytest.raises(CoarticError, match="is not a results folder: .*manifest.json is missing"):
        load_results(tmp_path)
    (tmp_path / "manifest.json").write_text("{")
    with pytest.raises(CoarticError, match="it cannot be read as JSON"):
        load_results(tmp_path)


@pytest.mark.parametrize("name", ["runs", "sequences", "solutions", "paths", "learning"])
def test_damaged_tables_are_named_with_what_to_do(results, tmp_path, name):
    folder = shutil.copytree(results.folder, tmp_path / "copy")
    table = folder / f"{name}.parquet"
    load_results(folder)
    for content, why in (
        (None, "is missing"),
        (b"", "is damaged"),
        (table.read_bytes()[:100], "is damaged"),
        (table.read_bytes()[:-100] + bytes(100), "is damaged"),
    ):
        table.unlink() if content is None else table.write_bytes(content)
        with pytest.raises(CoarticError, match=rf"{name}\.parquet {why}.*`coartic run` again"):
            load_results(folder)
    pd.DataFrame({"x": [1]}).to_parquet(table)
    with pytest.raises(CoarticError, match=rf"{name}\.parquet is damaged \(its columns are not"):
        load_results(folder)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ([], "it holds no object"),
        ({"format": 2}, "have format 2"),
        ({"format": FORMAT}, "specification is missing"),
        (lambda found: found["specification"]["methods"].pop("dual-process/EC4"), "its seal"),
    ],
)
def test_manifests_that_are_none(results, tmp_path, content, words):
    folder = shutil.copytree(results.folder, tmp_path / "copy")
    if callable(content):
        edit, content = content, json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
        edit(content)
    (folder / "manifest.json").write_text(json.dumps(content))
    with pytest.raises(CoarticError, match=words):
        load_results(folder)


def test_a_first_run_that_was_interrupted(results, tmp_path):
    folder = shutil.copytree(results.folder, tmp_path / "copy")
    (folder / "manifest.json").unlink()
    with pytest.raises(
        CoarticError,
        match="no manifest.json yet.*start the same `coartic run` again",
    ):
        load_results(folder)


def test_manifest(results):
    manifest = json.loads((results.folder / "manifest.json").read_text(encoding="utf-8"))
    specification = manifest["specification"]
    assert specification["seed"] == 0
    assert specification["tasks"]["ascending"]["provenance"]["goals"]["status"] == "printed"
    assert "goals" in specification["methods"]["dual-process/EC2"]["told"]
    planned = results.manifest.specification.cells
    ids = [run_id for cell in planned for run_id in results.manifest.run_ids(cell)]
    assert ids == list(results.runs.run_id)
    assert len(set(ids)) == 14
    assert np.isfinite(manifest["format"])


def test_cells_that_only_print_alike_are_refused(monkeypatch):
    """-0.0 equals the default 0.0, and a text can hold a comma."""

    class Odd(CLASSES["dual-process/EC1"]):
        name = "odd"

        class Parameters(Parameters):
            shift: float = 0.0
            mode: str = "a"
            kind: str = "b"

    monkeypatch.setitem(CLASSES, "odd", Odd)
    odd, task = Entry(declared(Odd), "here", "0"), load_task("ascending")
    for first, second in (
        ({}, {"shift": -0.0}),
        ({"mode": "c, kind=d"}, {"mode": "c", "kind": "d"}),
    ):
        cells = [Cell(task, odd, tuple(parameters.items())) for parameters in (first, second)]
        assert distinct([cells[0], cells[0]]) == [cells[0]]
        with pytest.raises(CoarticError, match="two different cells are called"):
            distinct(cells)


def test_plans_are_bounded_before_they_are_made():
    (cell,) = paper_cells(tasks=["ascending"])
    with pytest.raises(CoarticError, match="2_000_001 runs are planned"):
        run_specs([cell], runs=MOST_PLANNED + 1, seed=0)


def test_a_suite_can_move_one_goal(tmp_path):
    cells = suite_of(
        tmp_path,
        'tasks = ["ascending"]\nmethods = ["dual-process/EC1"]\n'
        "move = { goal = 2, by = [[0, -0.5], [0.25, 0]] }",
    )
    base = load_task("ascending")
    assert [cell.task.name for cell in cells] == [
        "ascending.goal2_0_-0.5",
        "ascending.goal2_0.25_0",
    ]
    for cell, moved in zip(cells, ((6.0, 1.5), (6.25, 2.0)), strict=True):
        assert cell.task.goals == (base.goals[0], moved, base.goals[2])
        assert np.array_equal(cell.task.q0, base.q0)
    close = "[[0, 0.1], [0, 0.1000000001], [0, 0.12345678]]"
    moved = suite_of(
        tmp_path,
        'tasks = ["ascending"]\nmethods = ["dual-process/EC1"]\n'
        f"move = {{ goal = 2, by = {close} }}",
    )
    assert [cell.task.name.rpartition("_")[2] for cell in moved] == [
        *("0.1", "0.1000000001", "0.12345678"),
    ]
    with pytest.raises(CoarticError, match="has no goal 4 to move"):
        suite_of(
            tmp_path,
            'tasks = ["ascending"]\nmethods = ["dual-process/EC1"]\nmove = {goal=4, by=[[0,1]]}',
        )
    with pytest.raises(CoarticError, match="out of reach|too far"):
        suite_of(
            tmp_path,
            'tasks = ["two-armed-1"]\nmethods = ["dual-process/EC4"]\n'
            "move = { goal = 2, by = [[0, 9]] }",
        )


def test_a_name_is_no_list_of_names():
    for given in ({"tasks": "ascending"}, {"methods": "EC1"}, {"task_files": Path("a.toml")}):
        (name,) = given
        with pytest.raises(CoarticError, match=f"{name} is a list: write {name}=\\['"):
            Selection(**given)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"runs": "3"}, "runs is '3'; it must be an int from 1 to "),
        ({"trials": 2.5}, "trials is 2.5; it must be an int from 1 to "),
        ({"executor": 2}, "executor is 2; it must be one of coartic.benchmarks.executors"),
        ({"select": {}}, "select is {}; it must be a Selection"),
        ({"suite": 3}, "suite is 3; it must be a name, a path or a Suite"),
        ({"runs": True}, "runs is True; it must be an int from 1 to "),
        ({"folder": None}, "folder is None; it must be a path"),
        ({"folder": ""}, "the name of a folder is empty; the current folder is ."),
    ],
)
def test_an_argument_of_a_wrong_type_has_a_sentence(wrong, words, tmp_path):
    with pytest.raises(CoarticError) as found:
        run_suite(**{"suite": "quick", "folder": tmp_path / "out", "runs": 1} | wrong)
    assert str(found.value).startswith(words)
    assert not (tmp_path / "out").exists()


def test_a_selection_of_a_wrong_type_has_a_sentence():
    with pytest.raises(CoarticError, match="tasks is 3; it must be a list"):
        Selection(tasks=3)
    with pytest.raises(CoarticError, match="an item of tasks is 3; it must be a name or a path"):
        Selection(tasks=[3])


def test_a_run_of_more_trials_than_a_row_group_would_hold(tmp_path, monkeypatch):
    """Parquet would divide the rows of a run: readers want them in one group."""
    monkeypatch.setattr(pq.ParquetWriter, "write_table", _in_small_groups)
    cells = paper_cells(tasks=["ascending"], methods=["dual-process/EC1"])
    study = run_and_write(tmp_path, cells, runs=2, trials=50)
    assert len(study.runs) == 2
    assert pq.ParquetFile(tmp_path / "learning.parquet").num_row_groups == 1


def _in_small_groups(writer, table, row_group_size=20, write=pq.ParquetWriter.write_table):
    write(writer, table, row_group_size)
