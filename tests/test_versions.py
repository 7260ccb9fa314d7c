"""Versions of built-in methods: folders of version 4.0.0, whose runs have hashes, and later."""

import lzma
import sqlite3
from contextlib import closing

import check_shipped
import pytest

from coartic import CoarticError, execute, load_task
from coartic.analysis.study import load
from coartic.analysis.verify import check_runs
from coartic.benchmarks.include import include_folders
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.registry import built_in
from coartic.benchmarks.reproduce import compare_runs, find_run, perform_runs_again
from coartic.benchmarks.runner import perform
from coartic.method import run_method
from coartic.runs.method_info import run_identity, version_of
from coartic.runs.record import PARTS
from coartic.runs.store import RUNS_FILE, open_store, writing
from tests.support.processes import python
from tests.support.suites import ROOT, InProcess

TASK = load_task("two-armed-2")
SAME = ["dual-process/EC1", "random-search", "hill-climbing", "corrective-alone/given"]
CHANGED = ["cma-es/bandit", "posture-qp/current-goal"]
"""Methods whose versions are 1.2 since version 5.0.0."""


@pytest.fixture
def old(tmp_path):
    """A folder as version 4.0.0 left it."""
    folder = tmp_path / "old"
    folder.mkdir()
    packed = (ROOT / "tests" / "folders" / "of_4_0_0.sqlite.xz").read_bytes()
    (folder / RUNS_FILE).write_bytes(lzma.decompress(packed))
    return folder


def planned(methods=(*SAME, *CHANGED), runs=3):
    return plan_suite("comparison", tasks=["ascending"], methods=methods, runs=runs, trials=200)


def performed(folder, methods=(*SAME, *CHANGED), runs=3):
    return perform(planned(methods, runs), folder, executor=InProcess())


def runs_of(folder):
    """The stored runs of a folder, by id."""
    with open_store(folder) as store:
        return [store.run(run_id) for run_id in sorted(store.ids())]


def numbers(study, methods=SAME):
    """What runs of some methods came to, by method and number."""
    runs = study.runs[study.runs.method.isin(methods)].sort_values(["method", "run"])
    return runs[["method", "run", "seed", "reward", "hands", "result"]].to_numpy().tolist()


def test_a_folder_of_4_0_0_is_resumed(old):
    before = load(old)
    assert {version_of(code) for code in before.runs.code} == {"1.1"}
    progress = performed(old, runs=4)
    assert (progress.present, progress.done) == (3 * 3 + 1, 3 + 4 + 1)
    assert dict(progress.stale) == {
        ("cma-es/bandit", "1.1", "1.2"): 3,
        ("posture-qp/current-goal", "1.1", "1.2"): 1,
    }
    after = load(old)
    kept = after.runs[after.runs.run < 3]
    assert [row for row in numbers(after) if row[1] < 3] == numbers(before)
    assert set(kept.run_id[kept.method.isin(SAME)]) <= {*before.runs.run_id}
    assert check_runs(old).wrong == []
    assert performed(old, runs=4).done == 0


def test_earlier_runs_of_a_version_are_counted_whatever_stands_for_it(old):
    with closing(sqlite3.connect(old / RUNS_FILE)) as db:
        rows = [name for _, name, *_ in db.execute("PRAGMA table_info(cells)")]
        names = ", ".join(name for name in rows if name not in ("id", "code"))
        (there,) = db.execute("SELECT id FROM cells WHERE method = 'cma-es/bandit'").fetchone()
        copy = f"INSERT INTO cells ({names}, code) SELECT {names}, '1.1' FROM cells WHERE id = ?"
        other = db.execute(copy, (there,)).lastrowid
        db.execute("UPDATE results SET cell = ? WHERE cell = ? AND run = 0", (other, there))
        db.commit()
    with writing(old) as store:
        store.replace_plan(planned(), store.made_with())
        assert store.stale()["cma-es/bandit", "1.1", "1.2"] == 3


def test_a_folder_of_4_0_0_and_one_of_now_have_the_same_runs(old, tmp_path):
    performed(tmp_path / "new", SAME)
    assert numbers(load(tmp_path / "new")) == numbers(load(old))
    for first, second in ((old, tmp_path / "new"), (tmp_path / "new", old)):
        out = tmp_path / f"of {first.name}"
        joined = include_folders(planned(SAME), [first, second], out)
        assert perform(joined, out, executor=InProcess()).done == 0
        assert numbers(load(out)) == numbers(load(old))
        assert check_runs(out).wrong == []
        with open_store(out) as store:
            assert len({*map(run_identity, store.ids())}) == len(store.ids())


def test_runs_of_an_earlier_version_are_included_as_they_are_or_not_at_all(old, tmp_path):
    joined = include_folders(planned(), [old], tmp_path / "all")
    assert perform(joined, tmp_path / "all", executor=InProcess()).done == 0
    study = load(tmp_path / "all")
    assert {study.declared[name].version for name in CHANGED} == {"1.1"}
    words = r"method 'cma-es/bandit' is version 1.1 in .*old and version 1.2 in this command"
    with pytest.raises(CoarticError, match=f"{words}: leave it out of one of them"):
        include_folders(planned(CHANGED[:1], runs=4), [old], tmp_path / "more")


def test_a_run_is_found_in_both_forms(old, tmp_path):
    performed(tmp_path / "new", SAME)
    runs = load(tmp_path / "new").runs
    (run_id,) = runs.run_id[(runs.method == "dual-process/EC1") & (runs.run == 1)]
    assert run_id.endswith("-1.1")
    for folder in (old, tmp_path / "new"):
        assert find_run(run_id[:16], folder).number == 1


def test_a_run_of_another_version_is_performed_again_and_named(old, coartic, in_this_process):
    with open_store(old) as store:
        (run_id, *_) = (r for r in store.ids() if store.run(r).cell.method.name == CHANGED[0])
    text = coartic("verify", old, "--run", run_id)[1]
    assert "Another version of the method made the run (1.1; here is 1.2)." in text
    assert "1 run performed again: " in text


SLOW = {"receding-horizon"}
"""Methods whose cheapest shipped run takes several seconds."""
RUNS = {
    "dual-process/EC1-uncorrected": (-357, "RRRR", 384_054),
    "dual-process/EC4-uncorrected": (-357, "RRRR", 406_895),
    "dual-process/custom": (-357, "RRRR", 821_009),
}
"""Of methods without a shipped run what 2,000 trials with seed 1 on two-armed 2 come to: reward,
hands, and control ticks of all trials."""


@pytest.mark.parametrize("name", RUNS)
def test_a_method_without_a_shipped_run_has_a_short_one(name):
    result, session = run_method(built_in()[name].configure({"trials": 2000}), TASK, seed=1)
    due = execute(TASK, result.solution)
    assert (due.reward, due.hands, session.meter.movement_ticks) == RUNS[name]


@pytest.fixture(scope="module")
def runs():
    return check_shipped.shipped_runs()


@pytest.mark.usefixtures("in_this_process")
def test_a_shipped_run_of_each_built_in_method_comes_back(runs, monkeypatch):
    """To the tick and the hand, with rewards of all trials and all counts: this, not the text of
    the code, is what makes the numbers safe. Targets may differ in bits on other processors."""
    found = []

    def watched(*given):
        for run, again in perform_runs_again(*given):
            words = compare_runs(run, again)
            found.extend(each for each in words if not each.startswith(("details", *PARTS)))
            yield run, again

    monkeypatch.setattr(check_shipped, "perform_runs_again", watched)
    assert {*runs.method} | {*RUNS} == {*built_in()}
    rows = runs[runs.is_current & ~runs.method.isin(SLOW)].groupby("method", sort=False).head(1)
    assert len(rows) >= 0.75 * runs.method.nunique()
    assert [*check_shipped.differences(rows), *found] == []


def test_a_shipped_run_that_does_not_come_back_is_named(runs, monkeypatch):
    def another(runs, registered):
        for run in runs:
            score = run.solution._replace(reward=run.solution.reward - 1)
            yield run, type(run)(run.job, run.outcome, run.scores | {"solution": score}, run.date)

    monkeypatch.setattr(check_shipped, "perform_runs_again", another)
    (sentence,) = check_shipped.differences(runs[runs.method == "dual-process/EC1"].head(1))
    assert "dual-process/EC1 on" in sentence
    assert "raise the version of the method" in sentence


def test_what_is_checked_before_a_release(runs):
    """A run of each cell of the comparison, and of each method on each family."""
    rows, every = check_shipped.chosen(runs), check_shipped.chosen(runs, every=True)
    assert len(every) == len(runs.groupby(check_shipped.CELL))
    assert (every.suite == "comparison").sum() == (rows.suite == "comparison").sum()
    of_families = runs[runs.suite == "families"].groupby(["method", "setting", "family"])
    assert len(rows) - (rows.suite == "comparison").sum() == len(of_families)


@pytest.mark.process
def test_workers_round_alike_whatever_the_environment_says(tmp_path):
    """The environment of these tests is that of workers (tests/conftest.py): this process rounds as
    they should, and a command in another environment is a process of its own."""
    methods = ",".join(CHANGED)
    plan = plan_suite("comparison", tasks=["descending"], methods=CHANGED, runs=1, trials=100)
    perform(plan, tmp_path / "here", executor=InProcess())
    python(
        "-m", "coartic", "run", "comparison", "--tasks", "descending", "--methods", methods,
        "--runs", "1", "--trials", "100", "--jobs", "1", "--out", str(tmp_path / "there"),
        OPENBLAS_CORETYPE="Haswell", NPY_DISABLE_CPU_FEATURES="",
    )  # fmt: skip
    here, there = (runs_of(tmp_path / name) for name in ("here", "there"))
    assert len(here) == 2
    assert [run.id for run in here] == [run.id for run in there]
    assert [run.result for run in here] == [run.result for run in there]
    assert len({run.outcome.environment["arithmetic"] for run in (*here, *there)}) == 1
