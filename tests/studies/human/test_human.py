"""One rule for all models: agreement lies beyond the bound and exceeds random search."""

import re

import numpy as np
import pandas as pd
import pytest

from coartic.benchmarks.planning import plan_suite
from coartic.estimates import Estimate
from tests.support.processes import programs

(HUMAN,) = programs("human", "study")


def estimate(low, high):
    return Estimate((low + high) / 2, low, high)


@pytest.mark.parametrize(
    ("test", "seen", "over", "tasks", "verdict"),
    [
        ({"above": 1}, (2, 3), (0.5, 1), 10, "agrees"),
        ({"above": 1}, (2, 3), (-0.5, 1), 10, "undecided"),
        ({"above": 1}, (2, 3), (np.nan, np.nan), 10, "agrees"),  # nothing to compare with
        ({"above": 1}, (2, 3), (0.5, 1), 9, "undecided"),
        ({"above": 1}, (0, 0.5), (-2, -1), 10, "disagrees"),
        ({"below": 1}, (0, 0.5), (-2, -1), 10, "agrees"),
        ({"below": 3, "disagree": 4}, (3.2, 3.8), (-2, -1), 10, "undecided"),
        ({"above": 1}, (np.nan, np.nan), (np.nan, np.nan), 0, "no cases"),
    ],
)
def test_agreement_exceeds_random_search(test, seen, over, tasks, verdict):
    decided, because = HUMAN.decide(test, estimate(*seen), estimate(*over), tasks, "")
    assert decided == verdict
    assert (because == HUMAN.NOT_BEYOND) == (over[0] * over[1] < 0)


def test_the_control_of_two_arms_has_the_hands_of_each_run(monkeypatch):
    """Three runs of a model, of which two end in LRRR: of these two its control is twice the mean
    of random search with LRRR."""
    rows = [("a", "LRRR", 5), ("a", "LRRR", 6), ("a", "RLRR", 9)]
    rows = [("learner", 2, *row) for row in rows]
    rows += [
        ("random search by hands", 2, "a", "LRRR", 1),
        ("random search by hands", 2, "a", "LRRR", 3),
        ("random search by hands", 2, "a", "RLRR", 8),
        ("random search by hands", 2, "a", "RRRR", 100),
        ("random search, every hand sequence", 2, "a", "RLRR", 7),
    ]
    runs = pd.DataFrame(rows, columns=["model", "arms", "task", "hands", "first"])

    def measure(runs, model):
        return runs[runs.model == model].groupby("task")["first"].mean()

    measures = dict.fromkeys(HUMAN.OF_TWO_ARMS, (measure, np.mean))
    monkeypatch.setattr(HUMAN, "MEASURES", measures)
    first, repeats = "first movement against isolated reach", "near-tie repeats"
    assert HUMAN.of_control(runs, "learner", first)["a"] == (1 + 3 + 1 + 3 + 8) / 5
    assert HUMAN.of_control(runs, "learner", repeats)["a"] == 7


def test_the_suite_runs_each_model_and_each_control(tmp_path):
    """Cells leave out parameters at their defaults, such as a moving idle arm. Of each block's
    tasks the first few."""
    text = (HUMAN.HERE / "suite.toml").read_text("utf-8")
    text = re.sub(r'(tasks = \[\n.*)(\n    ".*)+', r"\1", text)
    (tmp_path / "human.toml").write_text(re.sub(r"000\.\.2026-\d+", "000..2026-005", text))
    found = {
        name
        for cell in (job.cell for job in plan_suite(tmp_path / "human.toml"))
        for name in HUMAN.models_of(
            cell.task, cell.method.name, cell.method.defaults | cell.parameters
        )
    }
    assert found == {*HUMAN.MODELS, *HUMAN.FURTHER}


def test_findings_that_separate_models():
    """A verdict of a test is needed, and another verdict beside it."""
    table = pd.DataFrame(
        [
            ("", "agrees", "undecided"),
            ("", "disagrees", "disagrees"),
            ("", "undecided", "disagrees *"),
            ("", "silent", "undecided"),
            ("", "agrees", "disagrees *"),
        ],
        columns=["finding", "of a", "of b"],
        index=["first", "alike", "built in", "open", "second"],
    )
    assert [*HUMAN.separating(table).index] == ["first", "second"]
