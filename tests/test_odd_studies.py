"""Results that users can have: methods that fail, settings without their method, odd names."""

import math

import pandas as pd

from coartic.analysis import TABLES
from coartic.analysis.control import with_control
from coartic.analysis.optima import BestKnown
from coartic.analysis.tables import is_setting
from tests.support.made_up import runs_of, study_of

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


def test_a_task_without_a_solution_of_every_run_is_not_solved():
    study = planted(
        *(behind([ONE], method, 10, 11, 12) for method in ("mine", "hill-climbing")),
        *(behind([TWO, THREE], method, 10, 11, None) for method in ("mine", "hill-climbing")),
        behind([ONE, TWO, THREE], "random-search", 15, 14, 13),
    )
    assert [*TABLES["ranking"](study).index] == ["random-search"]
    others = TABLES["not-ranked"](study)
    assert others.tasks.to_dict() == {"hill-climbing": 1, "mine": 1}
    assert (others.why == "2 of 9 runs failed").all()


def test_hands_of_many_runs_are_shares_of_those_that_are_executed():
    hands = ["RRRR", "LRLR", "LRLR", "LRLR"] * 500
    study = study_of(runs_of(TWO, "hill-climbing", [-470] * 2000, hands=hands))
    values = pd.Series([1.0] * 500 + [math.nan] * 1500, study.runs.index)
    object.__setattr__(study, "signature", lambda *_: values)
    assert [*with_control(study, "first", TWO, "hill-climbing")] == ["LRLR", "RRRR"]
