"""What a notebook shows of tasks, studies, tables and figures, and the results that are shipped."""

import os
import pickle
from xml.dom import minidom

import numpy as np
import pytest

from coartic import load_task
from coartic.analysis import TABLES, load, ranking


def elements(page, name):
    """The elements of a page that is well formed, with their attributes and their text."""
    found = minidom.parseString(f"<div>{page}</div>").getElementsByTagName(name)
    return [
        (dict(each.attributes.items()), "".join(n.data for n in each.childNodes if n.nodeType == 3))
        for each in found
    ]


@pytest.mark.parametrize("name", ["ascending", "two-armed-2", "long/v1/i000"])
def test_a_task_is_a_picture_of_its_goals(name):
    task = load_task(name)
    page = task._repr_html_()
    numbers = [text for _, text in elements(page, "text")]
    assert numbers == [str(number) for number, _ in enumerate(task.goals, 1)]
    circles = [circle for circle, _ in elements(page, "circle")]
    places = np.array([[float(circle["cx"]), float(circle["cy"])] for circle in circles])
    assert {float(circle["r"]) for circle in circles} == {task.radius}
    due = np.diff(task.goal_array, axis=0) * [1, -1]  # y points down
    np.testing.assert_allclose(np.diff(places[: len(task.goals)], axis=0), due, atol=2e-3)


def test_shipped_results_are_read_as_a_study(tmp_path, monkeypatch):
    """Read-only, whatever folder is here; by their own names as others."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "shipped").mkdir()
    study = load("shipped").worlds[""]
    assert study.suite == "comparison"
    assert len(study.runs) > 3_000
    (alone,) = study.cells["ascending", "corrective-alone/best-hands"].reward
    assert alone == max(study.sequences("ascending").reward.dropna())
    ranked = ranking(study.runs[study.runs.run == 0])
    assert ranked.why["learner"] == ""
    assert ranked.why["dual-process/EC3"] == "2 of 4 tasks"
    assert len(next(study.rewards())[1]) > 0
    assert os.listdir("shipped") == []


def test_a_study_pickles_after_a_table_was_asked_for(traced):
    table = TABLES["tasks"](traced)
    again = pickle.loads(pickle.dumps(traced))
    assert TABLES["tasks"](again).equals(table)
    assert again.runs.equals(traced.runs)
