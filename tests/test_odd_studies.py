"""Results that users can have: methods that fail, settings without their method, odd names."""

import math
from pathlib import Path

import pandas as pd

from coartic import load_task
from coartic.analysis import TABLES
from coartic.analysis.control import signature_by_hands, with_control
from coartic.analysis.optima import BestKnown
from coartic.analysis.report.sections import SECTIONS, finding
from coartic.analysis.tables import is_setting
from coartic.cli.read import say_ranking
from tests.support.made_up import change_runs, runs_of, study_of

ONE, TWO, THREE = "ascending", "two-armed-1", "two-armed-2"
BEST = {ONE: -292, TWO: -465, THREE: -306, "descending": -292}


def behind(tasks, method, *ticks, **more):
    """Runs on each task whose rewards are so many ticks behind the best known one; None: without a
    solution."""
    return [
        run for task in tasks for run in runs_of(
            task, method, [None if each is None else BEST[task] - each for each in ticks], **more
        )
    ]  # fmt: skip


def planted(*cells, **more):
    """The study of these runs, whose tasks have proven optima."""
    rows = [row for cell in cells for row in cell]
    best = {task: BestKnown(BEST[task], BEST[task]) for task in {row["task"] for row in rows}}
    return study_of(rows, optima=best, **more)


def test_a_setting_of_an_own_method_is_left_out_with_all_its_rows():
    study = planted(
        behind([TWO, THREE], "mine", 10, 11, 12),
        behind([TWO, THREE], "mine", 20, 21, 22, setting="sigma=0.1"),
        behind([TWO, THREE], "hill-climbing", 15, 14, 13),
        behind([TWO, THREE], "dual-process/EC4", 30, 31, 32),
    )
    table = TABLES["differences"](study)
    assert (is_setting(study, table) == (table.against == "mine sigma=0.1")).all()
    assert 0 < is_setting(study, table).sum() == len(table) / 2


def test_hands_of_many_runs_are_shares_of_those_that_are_executed():
    hands = ["RRRR", "LRLR", "LRLR", "LRLR"] * 500
    values = pd.Series([1.0] * 500 + [math.nan] * 1500)
    rows = runs_of(TWO, "hill-climbing", [-470] * 2000, hands=hands)
    study = study_of(rows, signature=lambda *_: values)
    assert [*with_control(study, "first", TWO, "hill-climbing")] == ["LRLR", "RRRR"]


def test_failed_runs_have_no_signature():
    """Their hands are missing."""
    runs = pd.DataFrame(runs_of(ONE, "mine", [-300, None, -301], hands=["RRR", None, "LRL"]))
    values = pd.Series([1.0, math.nan, 2.0])
    study = study_of(runs.astype({"hands": "string"}), signature=lambda *_: values)
    by_hands = signature_by_hands(study, "first", ONE, "mine")
    assert {hands: of.tolist() for hands, of in by_hands.items()} == {"RRR": [1.0], "LRL": [2.0]}


def said(study, capsys):
    """What commands print below the ranking, as one line."""
    change_runs(study, "commit", "")
    say_ranking(study, Path("out"))
    return " ".join(capsys.readouterr().out.split())


def test_nothing_is_ranked_if_everything_failed(capsys):
    rows = behind([ONE], "mine", None, None) + behind([ONE], "hill-climbing", None, None)
    study = planted([row | {"trials": pd.NA} for row in rows])
    text = said(study, capsys)
    assert "No method is ranked." in text
    assert "--runs" not in text
    assert finding(study, SECTIONS[0]) == ["No method is ranked."]
    assert not len(TABLES["runtimes"](study))


def test_the_advice_on_runs_keeps_all_runs(capsys):
    few = behind([ONE], "hill-climbing", 1, 2)
    assert "--runs 5" in said(planted(few, behind([ONE], "random-search", 1, 2, 3)), capsys)
    assert "--runs 9" in said(planted(few, behind([ONE], "random-search", *range(9))), capsys)


def test_the_advice_on_the_search_keeps_all_methods(capsys):
    rows = behind([ONE], "hill-climbing", 1, 2) + behind([ONE], "mine", 3, 4)
    own = load_task(ONE).model_copy(update={"radius": 0.11})
    text = said(study_of(rows, [own]), capsys)
    assert "add `optimum/search` to the command's `--methods`" in text
    assert "`--methods '*,optimum/search'` if it has none" in text


def test_an_instance_beside_a_task_has_its_own_gap():
    instance = "one-armed/v1/i003"
    rows = behind([ONE], "hill-climbing", 10) + runs_of(instance, "hill-climbing", [-400])
    best = {ONE: BestKnown(-292, -292), instance: BestKnown(-320, -320)}
    table = TABLES["ranking"](study_of(rows, optima=best))
    assert table[f"on {instance}"].tolist() == [80 / 320]
