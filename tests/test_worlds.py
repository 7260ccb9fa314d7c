"""Cells in other worlds: asked for, stored, judged, included, read from older folders."""

import json
import sqlite3
from contextlib import closing

import numpy as np
import pytest

from coartic import (
    PAPER,
    CoarticError,
    MotionModel,
    Movement,
    corrective_trial,
    execute,
    execute_noisy,
    hand_sequences,
    load_task,
)
from coartic.analysis.verify import check_runs
from coartic.benchmarks import reproduce
from coartic.benchmarks.include import include_folders
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.runner import perform
from coartic.benchmarks.scoring import score
from coartic.benchmarks.worker import Outcome
from coartic.motion.initial_hands import best_hands
from coartic.runs.plan import Job, cell_of, judge_seed, run_seed
from coartic.runs.record import NOISE_RULE
from coartic.runs.store import RUNS_FILE, open_store
from tests.support.strategies import STUCK, tiny_task
from tests.support.suites import KNOWN, Failing, InProcess, cell_on, edit

NOISY = MotionModel(motor_noise=0.01)
HEAD = 'title = "x"\ndescription = "x"\nruns = 2\ntrials = 40\n'
BLOCK = '[[blocks]]\ntasks = ["ascending"]\nmethods = ["random-search", "dual-process/EC1"]\n'
WORLDS = """
model = { motor_noise = [0.0, 0.01], norm = "maximum" }
"""


@pytest.fixture
def suite(tmp_path):
    def written(*blocks, head=HEAD):
        path = tmp_path / "own.toml"
        path.write_text(head + "".join(blocks))
        return path

    return written


def worlds_in(plan):
    return [*dict.fromkeys(job.cell.world for job in plan)]


# ---- What is asked for ----


def test_a_table_of_a_block_is_a_grid_of_worlds(suite):
    plan = plan_suite(suite(BLOCK, BLOCK + WORLDS))
    assert worlds_in(plan) == ["", "norm=maximum", "motor_noise=0.01, norm=maximum"]
    assert len(plan) == 6
    models = {job.cell.world: job.cell.model for job in plan}
    assert models[""] == PAPER.for_radius(0.1)
    assert models["motor_noise=0.01, norm=maximum"].motor_noise == 0.01


def test_the_table_of_a_suite_is_that_of_blocks_without_one(suite):
    head = HEAD + "model = { base_weight = 4.0 }\n"
    plan = plan_suite(suite(BLOCK, BLOCK + WORLDS, head=head))
    assert worlds_in(plan)[0] == "base_weight=4.0"


def test_a_command_sets_the_world_of_blocks_without_one(suite):
    path = suite(BLOCK, BLOCK.replace("EC1", "EC4").replace("ascending", "two-armed-1") + WORLDS)
    with pytest.warns(UserWarning, match="block 2, is left out: it has a world of its own"):
        plan = plan_suite(path, model={"motor_noise": 0.01})
    assert worlds_in(plan) == ["motor_noise=0.01"]
    assert {job.cell.task.name for job in plan} == {"ascending"}


def test_a_request_has_one_world():
    with pytest.raises(
        CoarticError, match="model has a list of values; here each constant has one"
    ):
        plan_suite("quick", model={"motor_noise": [0.01, 0.02]})
    assert plan_suite("quick", model={"motor_noise": [0.01]})


def test_methods_beside_the_blocks_run_in_the_worlds_of_the_suite(suite):
    """In all worlds that the suite has of a task, and in no other."""
    noisy = BLOCK + "model = { motor_noise = [0.01, 0.02] }\n"
    other = BLOCK.replace("ascending", "descending")
    for blocks, worlds in (
        ([noisy], ["motor_noise=0.01", "motor_noise=0.02"]),
        ([noisy, BLOCK, other], ["motor_noise=0.01", "motor_noise=0.02", ""]),
    ):
        plan = plan_suite(suite(*blocks), methods=["random-search", "hill-climbing"])
        beside = [job.cell for job in plan if job.cell.method.name == "hill-climbing"]
        assert [cell.world for cell in beside if cell.task.name == "ascending"] == worlds
        assert {cell.world for cell in beside if cell.task.name == "descending"} <= {""}
    plan = plan_suite(suite(BLOCK), methods=["hill-climbing"], model={"motor_noise": 0.01})
    assert worlds_in(plan) == ["motor_noise=0.01"]


def test_ids_are_those_of_the_paper_unless_the_world_is_another():
    """A constant that has its default is no part of an id, and each that has not is."""
    info, task = KNOWN["random-search"], load_task("ascending")
    cells = [
        cell_of(task, info, {}, model=model)
        for model in (PAPER, PAPER.for_radius(0.1), NOISY, MotionModel(norm="maximum"),
                      MotionModel(base_weight=2.0))
    ]  # fmt: skip
    assert cells[0].id == cells[1].id
    assert len({cell.id for cell in cells}) == 4
    for cell in cells:
        stored = json.loads(json.dumps(cell.content))["model"]
        assert {"motor_noise", "norm", "base_weight", "radius"} & {*stored} == {
            name.partition("=")[0] for name in cell.world.split(", ") if name
        }


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (
            "{ sd = 0.1 }",
            "model has no constant 'sd'; it has motor_noise, norm, base_weight, radius",
        ),
        ("{ motor_noise = -0.1 }", "model.motor_noise is -0.1"),
        ('{ norm = "taxi" }', "model.norm is 'taxi'; it must be 'euclidean' or 'maximum'"),
        ("{ base_weight = 0.0 }", "model.base_weight is 0.0"),
        ("{ base_weight = 1001 }", "model.base_weight is 1001; it must be .* to 1000"),
        ("{}", "model is {}; it must be a table of constants"),
        ('"noisy"', "model is 'noisy'; it must be a table"),
        ("{ motor_noise = [] }", "model.motor_noise is empty"),
    ],
)
def test_a_wrong_world_is_refused_with_file_and_key(suite, coartic, table, words):
    path = suite(f"{BLOCK}model = {table}\n")
    with pytest.raises(CoarticError, match=f"own.toml.*{words}"):
        plan_suite(path)
    status, _, error = coartic("run", str(path))
    assert status == 2
    assert "own.toml" in error


def test_a_wrong_world_of_a_command_is_refused(coartic):
    for text, words in (("motor_noise", "has no value"), ("sd=1", "no constant 'sd'"),
                        ("norm=taxi", "must be 'euclidean' or 'maximum'")):  # fmt: skip
        status, _, error = coartic("run", "quick", "--model", text)
        assert (status, words in " ".join(error.split())) == (2, True)


def test_a_world_that_a_method_cannot_use_is_refused_where_it_is_named(suite):
    planner = BLOCK.replace('"random-search", ', '"posture-based/one-goal", ')
    with pytest.raises(
        CoarticError, match="own.*block 1: model.norm is 'maximum'; method 'posture"
    ):
        plan_suite(suite(planner + 'model = { norm = "maximum" }\n'))
    open_block = planner.replace('"ascending"', '"*"') + 'model = { norm = "maximum" }\n'
    assert {job.cell.method.name for job in plan_suite(suite(open_block))} == {"dual-process/EC1"}


# ---- How a run in noise is judged ----


def judged(task, model, solution, suite_seed=3, number=5):
    """Mean ticks by 100 executions of the judge, as the documentation says."""
    seed = judge_seed(suite_seed, task.name, number)
    ticks = execute_noisy(task, [solution], model.motor_noise, 100, seed, model.without_noise())[0]
    alone = [corrective_trial(task, hands, model=model.without_noise()).reward
             for hands in hand_sequences(task)]  # fmt: skip
    cap = -2 * max(reward for reward in alone if reward is not None)
    return float(np.where(np.isnan(ticks), cap, ticks).mean()), int(np.isnan(ticks).sum())


def test_what_a_method_recommends_is_judged_without_the_ticks_that_it_tells():
    task, model = load_task("two-armed-2"), MotionModel(motor_noise=0.02, base_weight=2.0)
    cell = cell_of(task, KNOWN["random-search"], {}, model=model)
    lucky = corrective_trial(task, "RLRR").movements  # with ticks and targets of corrections
    job = Job(cell, 3, (5,), 60.0)
    rewards = [-400, None, *range(-380, -372)]
    (row,) = score(job, [Outcome("ok", parts={"solution": [*lucky]}, rewards=rewards)])
    asked = [Movement(g, m.hand, "corrective") for g, m in enumerate(lucky, 1)]
    assert row.part("solution") == asked
    assert (row["mean_ticks"], row["failed_executions"]) == judged(task, model, asked)
    assert row["noise_rule"] == NOISE_RULE
    assert row["hands"] == "RLRR"
    names = "reward", "best_trial", "initial_reward", "replay_reward"
    assert [row[name] for name in names] == [None] * 4
    assert json.loads(row["practice"]) == [400.0, None, *map(float, range(380, 372, -1))]


def test_a_failed_execution_counts_as_twice_the_corrective_process():
    """Noise so large that some executions need more than fifty corrections."""
    task, model = tiny_task(goals=[[5.0, 1.0]]), MotionModel(motor_noise=4.0)
    cell = cell_of(task, KNOWN["random-search"], {}, model=model)
    solution = [Movement(1, "right", "corrective")]
    (row,) = score(Job(cell, 3, (5,), 60.0), [Outcome("ok", parts={"solution": solution})])
    assert (row["mean_ticks"], row["failed_executions"]) == judged(task, model, solution)
    assert 0 < row["failed_executions"] < 100


def test_the_judge_is_the_same_for_all_methods_and_no_seed_of_practice():
    seeds = {judge_seed(0, "ascending", n) for n in range(50)}
    assert len(seeds) == 50
    assert not seeds & {run_seed(0, "ascending", n) for n in range(50)}
    assert judge_seed(1, "ascending", 0) != judge_seed(0, "ascending", 0)
    assert judge_seed(0, "descending", 0) != judge_seed(0, "ascending", 0)


def test_the_best_hands_are_those_of_all_sequences():
    for model in (PAPER, NOISY, MotionModel(base_weight=4.0)):
        task, exact = load_task("two-armed-1"), model.without_noise()
        trials = {h: corrective_trial(task, h, model=exact) for h in hand_sequences(task)}
        ticks = {hands: trial.ticks for hands, trial in trials.items() if trial.completed}
        assert best_hands(task, model)[1] == min(ticks.values())
    assert best_hands(STUCK) is None


# ---- Folders ----

CELLS = ("random-search", "hill-climbing", "dual-process/EC1", "corrective-alone/given")


def noisy_plan(runs=2, model=NOISY):
    task = load_task("ascending")
    cells = [cell_of(task, KNOWN[name], {}, 40, model=model) for name in CELLS]
    numbers = [range(runs if cell.method.stochastic else 1) for cell in cells]
    return [Job(c, 0, n, 300.0, "own", 40) for c, n in zip(cells, numbers, strict=True)]


def results_in(folder):
    with open_store(folder) as store:
        return store.results(), store.runs()


def test_a_noisy_run_is_the_same_after_a_crash_and_when_it_is_made_again(tmp_path):
    perform(noisy_plan(), tmp_path / "whole", executor=InProcess())
    perform(noisy_plan(), tmp_path / "crashed", executor=Failing(0, 2))
    perform(noisy_plan(), tmp_path / "crashed", executor=InProcess())
    (whole, runs), (resumed, again) = map(results_in, (tmp_path / "whole", tmp_path / "crashed"))
    assert whole == resumed
    assert runs.mean_ticks.tolist() == again.mean_ticks.tolist()
    assert runs.mean_ticks.notna().all()
    assert runs.world.unique().tolist() == ["motor_noise=0.01"]
    with open_store(tmp_path / "whole") as store:
        stored = [store.run(run_id) for run_id in store.ids()]
    for row, repeated in reproduce.perform_runs_again(stored, KNOWN):
        assert reproduce.compare_runs(row, repeated) == []
        assert row["mean_ticks"] == repeated["mean_ticks"]


def test_verify_executes_noisy_runs_again(tmp_path, coartic):
    """Of one run of each cell, and of all on request."""
    perform([*noisy_plan(), *noisy_plan(model=PAPER)], tmp_path / "a", executor=InProcess())
    code, out, _ = coartic("verify", tmp_path / "a")
    assert (code, "4 solutions executed with motor noise." in out) == (0, True)
    assert reproduce.execute_with_noise_again(tmp_path / "a", every=True) == (7, [])
    edit(tmp_path / "a", "UPDATE results SET mean_ticks = mean_ticks - 1 WHERE run = 1")
    _, wrong = reproduce.execute_with_noise_again(tmp_path / "a", every=True)
    assert len(wrong) == 3
    assert all("mean_ticks is" in sentence for sentence in wrong)
    code, out, _ = coartic("verify", tmp_path / "a", "--noise")
    assert (code, out.count("mean_ticks is")) == (1, 3)
    perform(noisy_plan(), tmp_path / "a", executor=InProcess())  # nothing is missing


def test_mean_ticks_by_an_older_rule_are_missing_until_they_are_made_again(tmp_path):
    perform(noisy_plan(), tmp_path / "a", executor=InProcess())
    runs = results_in(tmp_path / "a")[1]
    edit(tmp_path / "a", "UPDATE results SET mean_ticks = 1, noise_rule = 1 WHERE run = 1")
    assert results_in(tmp_path / "a")[1].mean_ticks.isna().sum() == 3
    perform(noisy_plan(), tmp_path / "a", executor=InProcess())
    made = results_in(tmp_path / "a")[1]
    assert made.mean_ticks.tolist() == runs.mean_ticks.tolist()
    assert made.date.tolist() == runs.date.tolist()  # no method ran


def as_version_6(folder):
    """Take from a folder what a file of version 6.0.0 does not have."""
    with closing(sqlite3.connect(folder / RUNS_FILE)) as db:
        views = dict(db.execute("SELECT name, sql FROM sqlite_master WHERE type = 'view'"))
        for name in views:
            db.execute(f"DROP VIEW {name}")
        added = ("mean_ticks", "failed_executions", "practice", "noise_rule")
        for column in added:
            db.execute(f"ALTER TABLE results DROP COLUMN {column}")
        db.execute("ALTER TABLE cells DROP COLUMN world")
        db.execute(views["asked"].replace("world, ", ""))
        columns = [name for name in (c[1] for c in db.execute("PRAGMA table_info(asked)"))
                   if name not in ("position", "cell", "suite_seed", "environment", "details",
                                   "movements", "rewards")]  # fmt: skip
        names = ", ".join(f'"{name}"' for name in columns)
        db.execute(f"CREATE VIEW runs AS SELECT {names} FROM asked ORDER BY position, run")
        db.execute(views["solutions"])
        db.execute("PRAGMA user_version = 7")
        db.commit()


@pytest.fixture
def old(tmp_path):
    """A folder as version 6.0.0 wrote it, and its runs now."""
    folder = tmp_path / "old"
    perform(noisy_plan(model=PAPER), folder, executor=InProcess())
    runs = results_in(folder)[1]
    as_version_6(folder)
    return folder, runs


def test_an_older_folder_is_read_and_gone_on_with(old, tmp_path):
    folder, runs = old
    assert results_in(folder)[1].equals(runs)
    assert check_runs(folder).wrong == []
    with open_store(folder) as store:
        assert store.run(store.ids()[0])["noise_rule"] is None
    assert reproduce.execute_with_noise_again(folder, every=True) == (0, [])
    plan = noisy_plan(model=PAPER)
    joined = include_folders(plan, [folder], tmp_path / "new")
    perform(joined, tmp_path / "new", executor=InProcess())
    assert perform(plan, folder, executor=InProcess()).done == 0
    for each in (tmp_path / "new", folder):
        assert results_in(each)[1].equals(runs)


def test_worlds_of_a_folder_do_not_mix(tmp_path):
    """Equal methods on one task, with other ids and other results."""
    plan = [
        *noisy_plan(model=PAPER),
        *noisy_plan(),
        *noisy_plan(model=NOISY._replace(norm="maximum")),
    ]
    perform(plan, tmp_path / "a", executor=InProcess())
    runs = results_in(tmp_path / "a")[1]
    assert runs.groupby("world").size().tolist() == [7, 7, 7]
    assert runs.run_id.is_unique
    assert (runs.reward.isna() == (runs.world != "")).all()
    assert (runs.mean_ticks.isna() == (runs.world == "")).all()
    joined = include_folders(noisy_plan(), [tmp_path / "a"], tmp_path / "b")
    assert len(joined) == 12
    assert execute("ascending", corrective_trial("ascending", "RRR").movements).reward == -319


def test_a_cell_reads_its_world_from_the_file(tmp_path):
    perform(noisy_plan(model=MotionModel(norm="maximum")), tmp_path / "a", executor=InProcess())
    with open_store(tmp_path / "a") as store:
        assert [job.cell for job in store.plan()] == [
            job.cell for job in noisy_plan(model=MotionModel(norm="maximum"))
        ]
    assert cell_on(load_task("ascending"), KNOWN["random-search"]).model == PAPER.for_radius(0.1)
