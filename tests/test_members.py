"""Ensembles of reconstructions, and the paper's claims over them."""

import csv
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from reconstruction.scoring import printed_tests
from reconstruction.search import search_for

from coartic import CoarticError, TaskError, load_task
from coartic.analysis.claims.specifications import (
    PAPERS,
    judge_specifications,
    shares,
    specifications,
)
from coartic.benchmarks.suites import load_suite, select_cells
from coartic.tasks.catalogue import MEMBERS_FOLDER, is_admitted, members, task_of, with_members
from tests.support.made_up import row, study_of
from tests.support.suites import KNOWN


@pytest.mark.parametrize("task", with_members())
def test_an_ensemble_has_200_members_that_meet_every_constraint(task):
    ensemble = members(task)
    drawn = {name: t for name, t in ensemble.items() if name.startswith(f"{task}-m")}
    assert len({t.goals for t in drawn.values()}) == len(drawn) >= 200
    assert ensemble[f"{task}-m001"].goals == load_task(task).goals
    for name, t in ensemble.items():
        assert load_task(name) is t
        assert task_of(name) == task
        assert "goals" in t.reconstructed
    goals = np.array([t.goal_array for t in ensemble.values()])
    assert search_for(task).meets_all(goals).tolist() == [is_admitted(name) for name in ensemble]


@pytest.mark.parametrize("task", with_members())
def test_distances_of_members_are_those_of_their_figures(task):
    text = (MEMBERS_FOLDER / f"{task}.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    assert len(rows) == len(members(task))
    labels = [test.label for test in printed_tests(task) if test.counted]
    for each in rows:
        distances = [each[f"{label}, distance"] for label in labels]
        squares = [25.0 if value == "" else min(abs(float(value)), 5.0) ** 2 for value in distances]
        assert float(each["distance"]) == pytest.approx(np.sqrt(np.mean(squares)), abs=0.01)


def test_a_member_runs_in_any_suite():
    cells = select_cells(load_suite("comparison"), KNOWN, tasks=["two-armed-1-m017"])
    assert {cell.task.goals for cell in cells} == {load_task("two-armed-1-m017").goals}
    # Of many names an error shows some.
    with pytest.raises(CoarticError, match=r"m012 and \d+ others\.$"):
        select_cells(load_suite("reconstructions"), KNOWN, tasks=["ascending"])
    with pytest.raises(TaskError, match="unknown task 'two-armed-1-m999'"):
        load_task("two-armed-1-m999")
    assert task_of("ascending") is None


def study_with(tasks, means, **plan):
    """Runs of EC3 and EC4 on tasks, the latter better by so many ticks."""
    rng = np.random.default_rng(0)
    rows = []
    for task, better in zip(tasks, means, strict=True):
        for method, mean in (("dual-process/EC3", -500.0), ("dual-process/EC4", -500.0 + better)):
            rewards = np.round(rng.normal(mean, 3.0, 20)).astype(int)
            rows += [
                row(method, int(r), task=task, run=k, trials=10_000, run_id=f"{task}{method}{k}",
                    replay_reward=int(r), initial_reward=-675)
                for k, r in enumerate(rewards)
            ]  # fmt: skip
    study = study_of(pd.DataFrame(rows), list(map(load_task, tasks)), **plan)
    defaults = {"ties": "left", "trials": 10_000}
    cells = tuple(
        replace(cell, method=replace(cell.method, defaults=defaults)) for cell in study.plan.cells
    )
    return replace(study, plan=replace(study.plan, cells=cells))


def test_claims_are_judged_for_each_member():
    """For each that is admitted, once: v0.1 is not, F3 has the goals of the default task."""
    names = ["two-armed-1", "two-armed-2", "two-armed-1-m002", "two-armed-1-m003"]
    more = ["two-armed-1-v0.1", "two-armed-1-m001", "two-armed-1-F3"]
    study = study_with([*names, *more], (20.0, 20.0, 20.0, -20.0, 20.0, 20.0, 20.0))
    claims = [claim for claim in PAPERS if claim.id == "ec4-beats-ec3"]
    table = judge_specifications([study], claims=claims)
    judged = table[table.claim == "ec4-beats-ec3"].set_index("member")
    assert set(judged.index) == {"", *names[2:], "two-armed-1-m001"}
    assert judged.effect["two-armed-1-m002"] > 0 > judged.effect["two-armed-1-m003"]
    assert judged.verdict[["", *names[2:]]].tolist() == ["supported", "supported", "not supported"]
    twice = judge_specifications([study, study], claims=claims)
    pd.testing.assert_frame_equal(twice, table)
    counts = shares(table).set_index(["claim", "kind"]).loc["ec4-beats-ec3"]
    assert counts.loc["two-armed-1", ["supported", "specifications"]].tolist() == [2, 3]
    assert counts.loc["readings", ["supported", "specifications"]].tolist() == [1, 1]


def test_parameters_of_a_reading_are_no_variant():
    study = study_with(["two-armed-1"], (20.0,), readings=("ties=right",))
    cells = tuple(replace(cell, parameters={"ties": "right"}) for cell in study.plan.cells)
    runs = study.runs.assign(variant="ties=right")
    changed = replace(study, plan=replace(study.plan, cells=cells), runs=runs)
    ((specification, view),) = specifications(changed)
    assert specification == ("ties=right", "", "")
    assert {label for _, label in view.cells} == {"dual-process/EC3", "dual-process/EC4"}
    assert all(len(cell.runs) == 20 for cell in view.cells.values())
