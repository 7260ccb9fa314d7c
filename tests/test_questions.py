"""Questions of a suite in a results folder: stored before the runs, told, and kept."""

import json
import sqlite3
from contextlib import closing
from dataclasses import replace

import pandas as pd
import pytest
from scipy import stats

from coartic import CoarticError
from coartic.analysis import contrast, load
from coartic.analysis.report.build import write_report
from coartic.analysis.study import with_contrasts
from coartic.benchmarks.include import include_folders
from coartic.benchmarks.planning import plan_suite
from coartic.benchmarks.runner import perform
from coartic.runs.plan import Job
from coartic.runs.store import RUNS_FILE, open_store
from tests.support.suites import InProcess

HEAD = """title = "Ask"
description = "Two questions."
runs = 2
trials = 20

[[blocks]]
tasks = ["two-armed/v1/i000..i005"]
methods = ["random-search", "hill-climbing"]

[[blocks]]
tasks = ["two-armed/v1/i000..i005"]
methods = ["hill-climbing"]
parameters = { sigma = 0.2 }
as = "wide steps"
"""
AHEAD = """
[[contrasts]]
name = "ahead"
says = "Hill climbing takes fewer ticks than random search."
quantity = "ticks"
weights = { "hill-climbing" = 1, "random-search" = -1 }
expected = "below 0"
"""
WIDE = """
[[contrasts]]
name = "wide"
says = "Wide steps leave the next goal nearer."
quantity = "arm"
weights = { "wide steps" = 1, "hill-climbing" = -1 }
"""


@pytest.fixture
def ask(tmp_path):
    """Plans a suite with some questions."""

    def planned(*questions, head=HEAD, **options):
        path = tmp_path / "ask.toml"
        path.write_text(head + "".join(questions), "utf-8")
        return plan_suite(path, **options)

    return planned


def made(plan, folder):
    perform(plan, folder, executor=InProcess())
    return load(folder)


def test_a_question_is_stored_before_its_runs_and_read_without_its_suite(ask, tmp_path):
    study = made(ask(AHEAD, WIDE), tmp_path / "out")
    (tmp_path / "ask.toml").unlink()
    table = load(tmp_path / "out").contrasts
    assert table.contrast.tolist() == ["ahead", "wide"]
    assert {*table.asked} == {"before its runs"}
    means = study.runs.groupby(["ranked_as", "task"]).value.mean()  # negative ticks
    differences = means["random-search"] - means["hill-climbing"]
    ahead = table.iloc[0]
    yes, equal = (differences < 0).sum(), (differences == 0).sum()
    assert (ahead.n, ahead.yes, ahead.equal) == (6, yes, equal)
    assert ahead.p == stats.binomtest(yes, 6 - equal).pvalue if yes < 6 else 2 * 0.5**6
    assert ahead["mean"] == pytest.approx(differences.mean())
    wide = study.signature("arm").groupby([study.runs.ranked_as, study.runs.task]).mean()
    expected = wide["wide steps"] - wide["hill-climbing"]
    assert table.iloc[1]["mean"] == pytest.approx(expected.mean())


def test_a_question_that_comes_later_or_is_changed_is_told(ask, tmp_path):
    made(ask(), tmp_path / "out")
    study = made(ask(AHEAD), tmp_path / "out")
    assert study.contrasts.asked.tolist() == ["after all its runs"]
    same = AHEAD.replace("Hill climbing takes", "It takes")  # only another sentence
    study = made(ask(same, runs=3), tmp_path / "out")
    assert study.contrasts.asked.tolist() == ["after 24 of its runs"]
    assert study.contrasts.says.tolist() == ["It takes fewer ticks than random search."]
    study = made(ask(AHEAD.replace("below 0", "below 5"), runs=3), tmp_path / "out")
    assert study.contrasts.expected.tolist() == ["below 5", "below 0"]
    assert study.contrasts.asked.tolist() == [
        "after all its runs", "after 24 of its runs, and changed or left out since",
    ]  # fmt: skip


def test_included_runs_that_are_older_than_the_question_count(ask, tmp_path):
    plan = ask()
    made(plan, tmp_path / "old")
    later(tmp_path / "old")
    joined = include_folders(ask(AHEAD), [tmp_path / "old"], tmp_path / "new")
    study = made(joined, tmp_path / "new")
    assert study.contrasts.asked.tolist() == ["after all its runs"]


def test_a_question_of_an_included_folder_keeps_its_date(ask, tmp_path):
    made(ask(AHEAD), tmp_path / "part")
    later(tmp_path / "part")
    joined = include_folders(ask(AHEAD), [tmp_path / "part"], tmp_path / "whole")
    study = made(joined, tmp_path / "whole")
    assert study.contrasts.asked.tolist() == ["before its runs"]
    assert study.asked[0].date < "2001"


def later(folder):
    """Date what a folder has back by many years."""
    with closing(sqlite3.connect(folder / RUNS_FILE)) as file:
        file.execute("UPDATE results SET date = '2000-01-02T00:00:00+00:00'")
        file.execute("UPDATE contrasts SET date = '2000-01-01T00:00:00+00:00'")
        file.commit()


def test_a_part_of_a_suite_and_added_cells_change_no_correction(ask, tmp_path):
    blocks = '\n[[blocks]]\ntasks = ["one-armed/v1/i000..i005"]\nmethods = ["*-search", "hill-*"]\n'
    head = HEAD + blocks
    whole = made(ask(AHEAD, head=head), tmp_path / "whole")
    p = whole.contrasts.set_index("family").p_holm
    two = [f"two-armed/v1/i00{number}" for number in range(6)]
    part = made(ask(AHEAD, head=head, tasks=two), tmp_path / "part").contrasts
    assert part.family.tolist() == ["two-armed/v1"]
    assert part.p_holm.iloc[0] == min(1, 2 * part.p.iloc[0])
    assert p["two-armed/v1"] <= part.p_holm.iloc[0]
    added = [*two, "two-armed/v1/i006"]
    more = made(ask(AHEAD, head=head, tasks=added), tmp_path / "more").contrasts
    assert more.n.tolist() == [6]


def test_a_method_that_the_command_leaves_out_is_told(ask, tmp_path):
    study = made(ask(AHEAD, methods=["random-search"]), tmp_path / "out")
    (row,) = study.contrasts.to_dict("records")
    assert (row["verdict"], row["n"]) == ("not tested", 0)
    assert row["note"] == "no task of the folder has all of its methods"


def test_a_name_is_one_setting_on_a_task_and_no_id(ask):
    grid = HEAD.replace("parameters = { sigma = 0.2 }", "grid = { sigma = [0.2, 0.3] }")
    with pytest.raises(CoarticError, match=r"'wide steps' names two settings on two-armed/v1/i000"):
        ask(head=grid)
    with pytest.raises(CoarticError, match="as = 'random-search' is the name of another row"):
        ask(head=HEAD.replace('as = "wide steps"', 'as = "random-search"'))


def test_names_are_in_no_id(ask):
    plans = ask(), ask(head=HEAD.replace('as = "wide steps"\n', ""))
    ids = [[job.cell.id for job in plan] for plan in plans]
    assert ids[0] == ids[1]


def test_errors_come_before_anything_runs(ask):
    with pytest.raises(CoarticError, match="suite 'ask', contrast 'ahead': method 'hill-climb'"):
        ask(AHEAD.replace('"hill-climbing" = 1', '"hill-climb" = 1'))
    with pytest.raises(CoarticError, match=r"contrasts\[0\].quantites is an unknown key"):
        ask(AHEAD.replace("quantity", "quantites"))
    with pytest.raises(CoarticError, match=r"blocks\[0\].trials .* belongs in another table"):
        ask(head=HEAD.replace("[[blocks]]", "[[blocks]]\ntrials = 3", 1))
    with pytest.raises(CoarticError, match="after is 100, but runs of .* have 20 trials"):
        ask(AHEAD + "after = 100\n")


def test_a_file_asks_about_finished_runs(ask, tmp_path):
    study = made(ask(), tmp_path / "out")
    (tmp_path / "ask2.toml").write_text(AHEAD, "utf-8")
    table = with_contrasts(study, tmp_path / "ask2.toml").contrasts
    assert table.asked.tolist() == ["after all its runs"]
    weights = {"hill-climbing": 1, "random-search": -1}
    again = contrast(study, "ticks", weights, expected="below 0")
    numbers = ["n", "yes", "equal", "median", "mean", "p", "p_holm"]
    pd.testing.assert_frame_equal(table[numbers], again[numbers])
    (tmp_path / "ask3.toml").write_text(HEAD + AHEAD, "utf-8")
    with pytest.raises(CoarticError, match=r"ask3.toml: .* is an unknown key"):
        with_contrasts(study, tmp_path / "ask3.toml")


def test_the_page_begins_with_the_questions(ask, tmp_path):
    study = made(ask(AHEAD, WIDE), tmp_path / "out")
    files, failures = write_report(study, tmp_path / "page", for_paper=True)
    assert failures == {}
    assert {"tables/contrasts.csv", "tables/contrasts.tex", "figures/contrasts.svg"} <= {*files}
    page = (tmp_path / "page" / "report.html").read_text("utf-8")
    assert page.index("Wide steps leave") < page.index('id="ranking"')
    rows = pd.read_csv(tmp_path / "page" / "tables" / "contrasts.csv")
    assert rows["mean"].tolist() == pytest.approx(study.contrasts["mean"].tolist())
    assert rows.run_ids.str.split().str.len().tolist() == [24, 24]
    again = write_report(replace(study, asked=()), tmp_path / "page")[0]
    assert "tables/contrasts.csv" not in again
    assert not (tmp_path / "page" / "tables" / "contrasts.csv").exists()


def test_jobs_carry_names_through_a_folder(ask, tmp_path):
    perform(ask(AHEAD), tmp_path / "out", executor=InProcess())
    with open_store(tmp_path / "out") as store:
        called = {job.called for job in store.plan()}
        (record,) = store.contrasts()
    assert called == {"", "wide steps"}
    assert json.loads(record.contrast.content)["name"] == "ahead"
    assert record.cells == 1
    assert Job.called == ""
