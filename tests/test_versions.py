"""Versions of built-in methods, and the shipped runs of each."""

import hashlib
import json
from dataclasses import replace

import check_shipped
import pytest
from check_shipped import SHORT_RUNS
from pydantic import create_model

from coartic import CoarticError, load_task
from coartic.analysis.study import load
from coartic.benchmarks.include import include_folders
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.provenance import made_with
from coartic.benchmarks.registry import built_in
from coartic.benchmarks.reproduce import compare_runs, perform_runs_again
from coartic.benchmarks.runner import perform
from coartic.benchmarks.scoring import score
from coartic.benchmarks.worker import perform_job
from coartic.runs.method_info import BUILT_IN, answer, method_info
from coartic.runs.plan import Cell, Job, cell_of
from coartic.runs.record import PARTS
from coartic.runs.store import open_store_for_writing
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
    return Cell(TASK, info, answers).digest


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
    """The folder is one in which 7.0.0 made a run with another value."""
    info = built_in()["dual-process/EC1-informed"]
    cell = replace(cell_of(load_task("ascending"), info, {"trials": 20}), parameters={})
    cell = replace(cell, parameters=info.complete({"trials": 20}) | {"pull": 0.5})
    assert "pull=0.5" in cell.setting
    job = Job(cell, 0, range(1), 60.0, "own", 20)
    folder = tmp_path / "old"
    plain = Job(cell_of(load_task("ascending"), info, {"trials": 20}), 0, range(1), 60.0, "own", 20)
    outcomes = [perform_job(plain)[0]]
    with open_store_for_writing(folder) as store:
        store.replace_plan([job], made_with())
        store.write(score(job, outcomes))
    runs = load(folder).runs
    assert runs.setting.str.contains("pull=0.5").all()
    assert coartic("verify", folder)[0] == 0
    code, _, error = coartic("verify", folder, "--run", runs.run_id[0])
    assert (code, "coartic 7.0.0 (commit a0cf376b) makes such runs" in error) == (2, True)
    with pytest.raises(CoarticError, match="pull is 0.5, but this parameter was withdrawn"):
        info.complete({"pull": 0.5})


def built_in_digest(name):
    info = built_in()[name]
    return cell_of(TASK, info, {}).digest


@pytest.mark.parametrize("name", SHORT_RUNS)
def test_a_method_without_a_quick_shipped_run_has_a_short_one(name):
    assert check_shipped.short_run(name, SHORT_RUNS[name][0]) == SHORT_RUNS[name]


def test_a_release_names_what_is_new(shipped_runs, monkeypatch):
    """Methods and families that nothing would compare with later versions, with their entries."""
    before = [*check_shipped.missing_entries(shipped_runs)]
    entry = SHORT_RUNS["dual-process/EC4-uncorrected"]
    monkeypatch.delitem(SHORT_RUNS, "dual-process/EC4-uncorrected")
    monkeypatch.delitem(check_shipped.FAMILIES, "long/v1")
    more = [each for each in check_shipped.missing_entries(shipped_runs) if each not in before]
    method, family = more
    assert f'"dual-process/EC4-uncorrected": {entry} to SHORT_RUNS' in method
    assert f'"long/v1": "{check_shipped.family_hash("long/v1")}" to FAMILIES' in family


@pytest.mark.usefixtures("in_this_process")
def test_a_shipped_run_of_each_other_built_in_method_comes_back(shipped_runs, monkeypatch):
    """To the tick and the hand, with rewards of all trials and all counts: this, not the text of
    the code, is what makes the numbers safe. Targets may differ in bits on other processors."""
    found = []

    def watched(*given):
        for run, again in perform_runs_again(*given):
            words = compare_runs(run, again)
            found.extend(each for each in words if not each.startswith(("details", *PARTS)))
            yield run, again

    monkeypatch.setattr(check_shipped, "perform_runs_again", watched)
    runs = shipped_runs[shipped_runs.suite == "comparison"]
    shipped = {*runs.method} - {*SHORT_RUNS}
    rows = runs[runs.is_current & runs.method.isin(shipped)].groupby("method").head(1)
    assert len(rows) >= 0.75 * len(shipped)
    assert [*check_shipped.differences(rows), *found] == []
