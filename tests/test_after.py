"""Rankings after the first trials of each run, against rewards that are read trial by trial."""

import math
import shutil
import zlib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from coartic import CoarticError, MotionModel, load_task
from coartic.analysis import FIGURES, TABLES, contrast, load
from coartic.analysis.report import build
from coartic.analysis.report.build import write_report
from coartic.analysis.report.sections import left_out
from coartic.analysis.standings import standings
from coartic.analysis.study import improvements
from coartic.analysis.tables import SOLUTIONS_ONLY
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.runner import perform
from coartic.runs.plan import cell_of
from coartic.runs.record import reward_bytes
from coartic.runs.store import open_store
from tests.support.suites import KNOWN, InProcess, cell_on, edit, planned, run_and_write

TASKS, TRIALS, AFTER = ("ascending", "two-armed-1"), 60, 25
LEARNERS = {"ascending": "dual-process/EC1", "two-armed-1": "dual-process/EC4"}
SEARCHES = ("random-search", "hill-climbing", "cma-es/bandit")
CONSTANT = ("posture-qp/goals-ahead", "corrective-alone/given")
SUBTASK = "dual-process/EC4-subtask"
NOISE = "motor_noise=0.01"


def cells():
    for name in TASKS:
        for method in (LEARNERS[name], *SEARCHES, *CONSTANT):
            yield cell_on(load_task(name), KNOWN[method])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Runs in two worlds, also of a learner whose answer is not its best trial."""
    noisy = cell_of(
        load_task("ascending"), KNOWN["random-search"], {}, model=MotionModel(motor_noise=0.01)
    )
    place = tmp_path_factory.mktemp("after") / "out"
    subtask = cell_on(load_task("two-armed-1"), KNOWN[SUBTASK])
    run_and_write(place, [*cells(), subtask, noisy], runs=5, trials=TRIALS)
    return place


@pytest.fixture(scope="module")
def whole(folder):
    return load(folder).worlds[""]


@pytest.fixture(scope="module")
def early(folder):
    return load(folder, after=AFTER)


def rewards_of(folder):
    with open_store(folder) as store:
        return {run_id: rewards.tolist() for run_id, rewards in store.rewards()}


def test_gaps_are_those_of_the_best_of_the_first_trials(folder, whole, early):
    rewards, optima = rewards_of(folder), whole.optima
    assert early.optima == optima
    runs = early.runs.set_index("run_id")
    for run in whole.runs.itertuples():
        if run.label == SUBTASK:
            assert run.run_id not in runs.index
            continue
        now, best = runs.loc[run.run_id], optima[run.task].reward
        first = [ticks for ticks in rewards.get(run.run_id, [])[:AFTER] if not math.isnan(ticks)]
        reward = run.reward if run.label in CONSTANT else max(first)
        assert (now.reward, now.value) == (reward, reward)
        assert now.gap == (best - reward) / -best
        assert now.best_known == best
        if run.label in CONSTANT:
            assert (now.trials, now.hands, now.cpu_s) == (run.trials, run.hands, run.cpu_s)
        else:
            assert (now.trials, now.budget) == (AFTER, AFTER)
            assert rewards[run.run_id][int(now.best_trial)] == reward
            assert now.best_trial == first.index(reward)
            assert pd.isna(now.hands)
            assert pd.isna(now.forward_kinematics)
    means = early.runs.groupby(["ranked_as", "task"]).gap.mean().groupby("ranked_as").mean()
    table = TABLES["ranking"](early)
    assert table.gap.to_dict() == pytest.approx(means.to_dict())
    assert {*table.index} == {"learner", *SEARCHES, *CONSTANT}
    assert table.place.notna().all()
    for run_id, kept in early.rewards():
        assert kept.tolist() == rewards[run_id][:AFTER]
    assert max(trials[-1] for trials, _ in improvements(early).values()) <= AFTER
    assert {*early.cells} == {(run.task, run.label) for run in early.runs.itertuples()}


def test_a_run_with_fewer_trials_is_the_same(early, tmp_path):
    """These methods make the same first trials, however many they are asked for."""
    asked = run_and_write(tmp_path / "asked", list(cells()), runs=5, trials=AFTER)
    known = ["task", "label", "run", "reward", "best_trial", "trials", "budget", "value", "gap"]
    now, then = (
        study.runs[known].sort_values(["task", "label", "run"], ignore_index=True)
        for study in (early, asked)
    )
    pd.testing.assert_frame_equal(now, then)
    tables = [TABLES["ranking"](study) for study in (early, asked)]
    columns = ["place", "gap", "gap_low", "gap_high", "share", "share_low", "better", "worse"]
    columns += ["on ascending", "on two-armed-1", "runs", "note"]
    pd.testing.assert_frame_equal(tables[0][columns], tables[1][columns])
    assert tables[0].gap_early[[*CONSTANT]].notna().all()
    assert tables[0].gap_early[["learner", *SEARCHES]].isna().all()  # after 1,000 trials


def test_all_trials_are_the_plain_ranking(folder, whole):
    """Nothing was cut, so that the learner from subtasks is as good as it is."""
    study = load(folder, after=TRIALS)
    pd.testing.assert_frame_equal(study.runs, whole.runs)
    for name in [name for name in TABLES if name not in SOLUTIONS_ONLY]:
        pd.testing.assert_frame_equal(TABLES[name](study), TABLES[name](whole))
    assert (study.after, whole.after, load(folder).after) == (TRIALS, None, None)


def test_a_run_without_a_completed_trial_so_far_is_failed(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "out")
    study = load(tmp_path / "out").worlds[""]
    runs = study.runs
    run = runs[(runs.label == "hill-climbing") & (runs.task == "ascending")].iloc[0]
    planted = [None] * 10 + [run.reward - 9, None, run.reward - 20] + [None] * 46 + [run.reward]
    packed = zlib.compress(reward_bytes(planted))
    edit(tmp_path / "out", "UPDATE results SET rewards = ? WHERE run_id = ?", packed, run.run_id)
    for after, best in ((5, None), (10, None), (11, -9), (13, -9), (59, -9), (60, 0)):
        study = load(tmp_path / "out", after=after)
        now = study.runs.set_index("run_id").loc[run.run_id]
        if best is None:
            assert (now.status, now.reason) == (
                "infeasible", f"no completed trial in the first {after}",
            )  # fmt: skip
            assert math.isnan(now.gap)
            assert standings(study).why["hill-climbing"] == "1 of 10 runs failed"
            assert TABLES["failed"](study).failed.tolist() == [1]
        else:
            assert (now.status, now.reward) == ("ok", run.reward + best)
            assert standings(study).why["hill-climbing"] == ""


def test_solutions_are_those_of_whole_runs(early):
    words = "after 25 trials, but solutions are those of whole runs"
    for needs in (
        lambda: early.executed("ascending", "hill-climbing"), lambda: early.movements(),
        lambda: early.configurations("ascending", "EC1"), lambda: early.signature("whole"),
        lambda: early.executed("ascending", "corrective-alone/given"), lambda: early.solutions,
        lambda: early.amounts("ticks exact", "ascending", "hill-climbing"),
        lambda: TABLES["signatures"](early), lambda: FIGURES["saved"](early),
    ):  # fmt: skip
        with pytest.raises(CoarticError, match=words):
            needs()
    for name, of in TABLES.items():
        if name not in SOLUTIONS_ONLY:
            of(early)
    assert all(FIGURES[name](early) for name in ("ranking", "runtimes", "learning-curves", "tasks"))
    assert FIGURES["ranking"](early).title.endswith(", after 25 trials")
    assert FIGURES["tasks"](early).title == "Tasks"


@pytest.mark.parametrize("after", [0, -1, 2.5, "100", True])
def test_a_number_of_trials_is_an_integer(folder, after):
    with pytest.raises(CoarticError, match="it must be a number of trials from 1"):
        load(folder, after=after)


def test_runs_with_fewer_trials_are_refused(folder, tmp_path):
    words = "after is 61, but a run of .* has 60 trials: give at most 60"
    with pytest.raises(CoarticError, match=words):
        load(folder, after=61)
    shutil.copytree(folder, tmp_path / "out")
    run = load(folder).worlds[""].cells["ascending", "hill-climbing"].run_id.iloc[0]
    edit(tmp_path / "out", "UPDATE results SET trials = 30 WHERE run_id = ?", run)  # ended early
    words = "after is 31, but a run of hill-climbing has 30 trials: give at most 30"
    with pytest.raises(CoarticError, match=words):
        load(tmp_path / "out", after=31)
    assert load(tmp_path / "out", after=30).after == 30


def test_noise_and_answers_that_are_no_trials_are_left_out(early, folder, tmp_path):
    assert [*early.worlds] == [""]
    assert left_out(early) == [
        "The world motor_noise=0.01 is left out: with motor noise the best trial so far says "
        "nothing of the answer.",
        "learner EC4, subtask reward is left out: the answer is not the best trial.",
    ]
    assert left_out(load(folder)) == []
    model = MotionModel(motor_noise=0.01)
    noisy = cell_of(load_task("ascending"), KNOWN["random-search"], {}, model=model)
    perform(planned([noisy], runs=1, trials=5), tmp_path / "noise", executor=InProcess())
    with pytest.raises(CoarticError, match="all runs are in worlds with motor noise"):
        load(tmp_path / "noise", after=5)


SUITE = """title = "Ask"
description = "Questions."
runs = 2
trials = 20

[[blocks]]
tasks = ["two-armed/v1/i000..i005"]
methods = ["random-search", "hill-climbing"]
"""
QUESTION = """
[[contrasts]]
name = "{0}"
says = "Sentence {0}."
quantity = "{1}"
weights = {{ "hill-climbing" = 1, "random-search" = -1 }}
expected = "below 0"
"""


def test_questions_are_answered_after_the_trials(tmp_path):
    path = tmp_path / "ask.toml"
    questions = [("ticks", "ticks"), ("arm", "arm"), ("exact", "ticks exact")]
    text = SUITE + "".join(QUESTION.format(*each) for each in questions)
    text += QUESTION.format("early", "ticks") + "after = 3\n"
    text += QUESTION.format("late", "ticks") + "after = 15\n"
    path.write_text(text, "utf-8")
    perform(plan_suite(path), tmp_path / "out", executor=InProcess())
    whole, study = load(tmp_path / "out"), load(tmp_path / "out", after=10)
    answers = study.contrasts.set_index("contrast")
    assert [*answers.index] == ["ticks", "early"]
    rewards = rewards_of(tmp_path / "out")
    for name, trials in (("ticks", 10), ("early", 3)):
        runs = whole.runs
        ticks = runs.assign(ticks=[-np.nanmax(rewards[run][:trials]) for run in runs.run_id])
        of = ticks.groupby(["method", "task"]).ticks.mean()
        assert answers["mean"][name] == (of["hill-climbing"] - of["random-search"]).mean()
    assert left_out(study) == [
        "Not answered after 10 trials: Sentence arm; Sentence exact; Sentence late."
    ]
    weights = {"hill-climbing": 1}
    with pytest.raises(CoarticError, match="after is 15, but the study is after 10 trials"):
        contrast(study, "ticks", weights, after=15)
    write_report(study, tmp_path / "report", for_paper=False)
    page = (tmp_path / "report" / "report.html").read_text()
    assert "Not answered after 10 trials: Sentence arm; Sentence exact; Sentence late." in page
    assert (tmp_path / "report" / "tables" / "contrasts.csv").exists()


def test_a_report_names_the_number_and_has_a_folder_of_its_own(folder, early, coartic, monkeypatch):
    monkeypatch.setattr(build, "picture", lambda *_: b"")  # drawn for the page already
    place = folder / "report-after-25"
    files, failures = write_report(early, place)
    assert failures == {}
    assert all((place / name).exists() for name in files)
    tables = {name for name in files if name.endswith(".csv")}
    names = "ranking", "runtimes", "tasks", "methods"
    assert tables == {f"tables/{name}.csv" for name in names}
    page = (place / "report.html").read_text()
    title = page.partition("<title>")[2].partition("</title>")[0]
    assert title == (
        "Coarticulation of a simulated robot: Ascending and Two-armed 1\N{NO-BREAK SPACE}†, "
        "after 25 trials"
    )
    assert "The world motor_noise=0.01 is left out" in page
    assert "section Coarticulation, the films and table saved are left out" in page
    assert "on each, after 25 trials" in page
    assert 'id="coarticulation"' not in page
    assert 'id="cost"' in page
    assert "after 25 trials" in (place / "tables" / "ranking.tex").read_text()
    code, text, _ = coartic("report", str(folder), "--after", "25")
    assert (code, f"{place / 'report.html'}: made" in text) == (0, True)
    code, _, error = coartic("report", str(folder), "--after", "24", "--out", str(place))
    assert (code, "holds the report after 25 trials; choose another folder" in error) == (2, True)
    code, _, error = coartic("report", str(folder), "--out", str(place))
    assert (code, "holds the report after 25 trials" in error) == (2, True)
    code, _, error = coartic("report", str(folder), "--after", "99")
    assert (code, "after is 99, but a run of" in error) == (2, True)


@pytest.mark.usefixtures("ranked")
def test_run_ranks_after_some_trials(coartic, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = "run paper --tasks ascending --methods EC1,random-search --runs 2 --trials 20 --out o"
    code, _, error = coartic(*words.split(), "--after", "21")
    assert (code, "has 20 trials: give at most 20" in error) == (2, True)
    assert not (tmp_path / "o").exists()  # told before the runs
    code, text, _ = coartic(*words.split(), "--after", "5")
    assert code == 0
    assert "After 5 trials:" in text
    assert "`coartic report o --after 5` writes o/report-after-5/report.html" in text.replace(
        "\n        ", " "
    )
    gap = TABLES["ranking"](load(tmp_path / "o", after=5)).gap["random-search"]
    assert f"{100 * gap:.1f}" in text
    part = words.replace("--runs 2", "--runs 0..1").split()
    code, _, error = coartic(*part, "--after", "5")
    assert (code, "--after has no effect" in error) == (2, True)


def test_a_method_that_is_left_out_cannot_be_compared_with(folder):
    assert load(folder, against=SUBTASK, after=AFTER).against == ""
    assert load(folder, against="hill-climbing", after=AFTER).against == "hill-climbing"


def test_a_study_after_trials_is_pickled_and_changed(early):
    again = replace(early)
    assert (again.after, again.optima) == (AFTER, early.optima)
