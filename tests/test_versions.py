"""Versions of built-in methods, and the shipped runs of each."""

import hashlib
import json
from dataclasses import replace

import check_shipped
import pytest
from pydantic import create_model

from coartic import CoarticError, execute, load_task
from coartic.analysis.study import load
from coartic.benchmarks.include import include_folders
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.provenance import made_with
from coartic.benchmarks.registry import built_in
from coartic.benchmarks.reproduce import compare_runs
from coartic.benchmarks.runner import perform
from coartic.benchmarks.scoring import score
from coartic.benchmarks.worker import perform_job
from coartic.method import run_method
from coartic.runs.method_info import BUILT_IN, answer, method_info
from coartic.runs.plan import Cell, Job, cell_of
from coartic.runs.shipped import open_shipped
from coartic.runs.store import open_store_for_writing
from tests.support.processes import at_release
from tests.support.suites import InProcess, cell_on, planned, run_and_write

TASK = load_task("two-armed-2")
EC1 = built_in()["dual-process/EC1"]
SMALL = {"runs": 3, "trials": 30}


@pytest.fixture(scope="module")
def shipped_runs():
    return check_shipped.shipped_runs()


@pytest.fixture
def old(tmp_path):
    """A folder of runs by another version of a method."""
    before = cell_on(load_task("ascending"), replace(EC1, code="1.0"))
    return run_and_write(tmp_path / "old", [before], **SMALL).folder


def test_runs_of_another_version_are_kept_and_made_again(old, coartic, in_this_process):
    before = load(old).runs
    now = planned([cell_on(load_task("ascending"), EC1)], **SMALL)
    progress = perform(now, old, executor=InProcess())
    assert (progress.present, progress.done) == (0, 3)
    assert dict(progress.outdated) == {(EC1.name, "1.0", EC1.code): 3}
    after = load(old).runs
    assert after.reward.tolist() == before.reward.tolist()
    assert {run_id[:16] for run_id in after.run_id} == {run_id[:16] for run_id in before.run_id}
    text = coartic("verify", old, "--run", before.run_id[0])[1]
    assert f"made by version 1.0 of the method; its version here is {EC1.code}." in text
    assert "1 run performed again: none with another result" in text


def test_runs_of_another_version_are_included_as_they_are_or_not_at_all(old, tmp_path):
    def asked(runs):
        return planned([cell_on(load_task("ascending"), EC1)], **SMALL | {"runs": runs})

    joined = include_folders(asked(3), [old], tmp_path / "all")
    assert perform(joined, tmp_path / "all", executor=InProcess()).done == 0
    assert {*load(tmp_path / "all").runs.code} == {"1.0"}
    words = f"version 1.0 in .*old and version {EC1.code} in this command: leave it out"
    with pytest.raises(CoarticError, match=words):
        include_folders(asked(4), [old], tmp_path / "more")


def digests(method, **parameters):
    """What cells of a class of methods are known by."""
    info = method_info(method, BUILT_IN, method.__module__, "1.1")
    answers = answer(method, "complete", parameters)
    return Cell(TASK, info, info.identifying(answers)).digest


def test_a_new_field_at_its_default_changes_no_id():
    """Of a method, and of an exploration condition, which every learner has. Another value does."""
    search = built_in()["hill-climbing"].load()
    more = create_model("More", __base__=search.Parameters, patience=(int, 7))
    longer = type("Longer", (search,), {"Parameters": more})
    assert digests(longer) == digests(search) == digests(longer, patience=7)
    assert digests(longer, patience=8) != digests(search)
    custom = built_in()["dual-process/custom"].load()
    more = create_model("More", __base__=custom.Parameters, tremor=(float | None, None))
    shaking = type("Shaking", (custom,), {"Parameters": more})
    assert digests(shaking) == digests(custom) == built_in_digest("dual-process/custom")
    assert digests(shaking, tremor=0.1) != digests(custom)


def test_withdrawn_parameters_stay_in_ids():
    """Of all runs of two suites, as version 7.0.0 made them."""
    ids = [job.run_id(0) for suite in ("comparison", "families") for job in plan_suite(suite)]
    assert len(ids) == 5238
    text = json.dumps(sorted(ids)).encode()
    assert hashlib.sha256(text).hexdigest().startswith("465790709ccc413c88e889dff79aaec5")


def test_a_run_with_a_withdrawn_parameter_is_read_and_not_made_again(tmp_path, coartic):
    """In a folder in which 7.0.0 also made a run with another value."""
    info = built_in()["dual-process/EC1-informed"]
    cell = replace(cell_of(load_task("ascending"), info, {"trials": 20}), parameters={})
    cell = replace(cell, parameters=info.complete({"trials": 20}) | {"pull": 0.5})
    assert "pull=0.5" in cell.setting
    job = Job(cell, 0, range(1), 60.0, "own", 20)
    folder = tmp_path / "old"
    plain = Job(cell_of(load_task("ascending"), info, {"trials": 20}), 0, range(1), 60.0, "own", 20)
    outcomes = [perform_job(plain)[0]]
    with open_store_for_writing(folder) as store:
        store.replace_plan([job, plain], made_with())
        for each in (job, plain):
            store.write(score(each, outcomes))
    runs = load(folder).runs
    assert runs.setting.str.contains("pull=0.5").tolist() == [True, False]
    code, out, _ = coartic("verify", folder, "--again", "5")
    assert (code, "1 run performed again: none with another result" in out) == (0, True)
    code, _, error = coartic("verify", folder, "--run", runs.run_id[0])
    assert (code, "which made it, can perform it again" in error) == (2, True)
    with pytest.raises(CoarticError, match="pull is 0.5, but this parameter was withdrawn"):
        info.complete({"pull": 0.5})


def built_in_digest(name):
    info = built_in()[name]
    return cell_of(TASK, info, {}).digest


SHORT_RUNS = {
    "dual-process/EC1-uncorrected": ("two-armed-2", -357, "RRRR", 384_054),
    "dual-process/EC4-uncorrected": ("two-armed-2", -357, "RRRR", 406_895),
    "dual-process/custom": ("two-armed-2", -357, "RRRR", 821_009),
    "trajectory-optimisation/path-length": ("descending", -304, "RRR", 306),
    "trajectory-optimisation/squared-displacement": ("ascending", -298, "RRR", 94),
    "trajectory-optimisation/acceleration": ("descending", -319, "RRR", 128),
    "trajectory-optimisation/jerk": ("ascending", -323, "RRR", 23),
    "trajectory-optimisation/hand-jerk": ("descending", -409, "RRR", 44),
    "receding-horizon": ("ascending", -299, "RRR", 74),
    "optimum/search": ("ascending", -292, "RRR", 46),
    "optimum/in-model": ("ascending", -292, "RRR", 46),
}
"""Maps methods to the results of short runs with seed 1: task, reward, hands, and either the ticks
of all movements or the number of iterations of the solver. These are methods without a shipped run,
with 2,000 trials, and planners whose cheapest shipped run takes seconds, with the parameters of a
quick check."""


def short_run(name: str, task: str) -> tuple[str, int, str, int]:
    """Perform the short run of a method, and return its entry in :data:`SHORT_RUNS`."""
    info = built_in()[name]
    trials = {"trials": 2000} if "trials" in info.defaults else {}
    parameters = info.configure(trials | info.load().quick)
    result, session = run_method(parameters, load_task(task), seed=1)
    execution, meter = execute(task, result.solution), session.meter
    effort = meter.movement_ticks or meter.solver_iterations
    return task, int(execution.reward), execution.hands, int(effort)


@pytest.mark.parametrize("name", SHORT_RUNS)
def test_a_method_without_a_quick_shipped_run_has_a_short_one(name):
    assert short_run(name, SHORT_RUNS[name][0]) == SHORT_RUNS[name]


@at_release
def test_nothing_is_without_a_run_that_later_versions_can_be_compared_with(shipped_runs):
    new = {}
    for name in {*built_in()} - {*shipped_runs.method, *SHORT_RUNS}:
        info, tasks = built_in()[name], map(load_task, ("two-armed-2", "ascending"))
        task = next(task for task in tasks if info.inapplicable_reason(task) is None)
        new[name] = short_run(name, task.name)
    assert not new, f"add to SHORT_RUNS: {new}"


@pytest.mark.usefixtures("in_this_process")
def test_a_shipped_run_of_each_other_built_in_method_comes_back(shipped_runs):
    """To the tick and the hand, with rewards of all trials and all counts: this, not the text of
    the code, is what makes the numbers safe. Targets may differ in bits on other processors."""
    runs = shipped_runs[shipped_runs.suite == "comparison"]
    shipped = {*runs.method} - {*SHORT_RUNS}
    rows = runs[runs.is_current & runs.method.isin(shipped)].groupby("method").head(1)
    assert len(rows) >= 0.75 * len(shipped)
    assert [*check_shipped.differences(rows)] == []


def test_a_run_that_no_longer_comes_back_is_named(shipped_runs):
    """A tick, a hand, a reward or a count is a difference; a bit of a target is none."""
    runs = shipped_runs[(shipped_runs.suite == "comparison") & shipped_runs.is_current]
    row = runs[(runs.method == "random-search") & (runs.world == "")].head(1)
    (change,) = row.run_id
    with open_shipped("comparison") as store:
        run = store.run(change)
    moved = json.loads(json.dumps(run.movements))
    goal, hand, kind, ticks, path = moved["solution"][0]
    for ticks_here, target, count in ((ticks + 1, path, 1), (ticks, "[]", 0)):
        first = [goal, hand, kind, ticks_here, target]
        other = replace(run, movements=moved | {"solution": [first, *moved["solution"][1:]]})
        assert len(compare_runs(run, other, postures=False)) == count
        assert len(compare_runs(run, other)) == 1
    assert compare_runs(run, run.with_values(trials=1), postures=False) == [
        "trials: 10000 against 1"
    ]
