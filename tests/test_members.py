"""Ensembles of reconstructions, and the paper's claims over them."""

import csv
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from coartic.analysis.reconstruction.constraints import try_sequences
from coartic.analysis.reconstruction.curve import specification_curve
from coartic.analysis.reconstruction.reconstruct import search_for
from coartic.analysis.reconstruction.specifications import (
    PAPERS,
    judged_specifications,
    shares,
    specifications,
)

from coartic import PAPER, CoarticError, TaskError, load_task
from coartic.analysis.reconstruction import targets
from coartic.benchmarks.suites import load_suite, select_cells
from coartic.runs.plan import DeclaredMethod
from coartic.tasks.members import members, members_file, task_of, with_members
from tests.support.made_up import row, study_of
from tests.support.suites import KNOWN


@pytest.fixture(params=with_members())
def ensemble(request):
    return request.param, members(request.param)


def test_an_ensemble_has_200_members_and_the_task_is_the_first(ensemble):
    task, found = ensemble
    own = {name: t for name, t in found.items() if name.startswith(f"{task}-m")}
    assert len(own) >= 200
    assert len({t.goals for t in own.values()}) == len(own)
    assert found[f"{task}-m001"].goals == load_task(task).goals
    for name, t in found.items():
        assert load_task(name) is t
        assert task_of(name) == task
        assert "goals" in t.reconstructed


def test_members_meet_every_constraint(ensemble):
    task, found = ensemble
    search = search_for(task)
    goals = [t.goal_array for name, t in found.items() if name.startswith(f"{task}-m")]
    for constraint in search.constraints:
        tried = try_sequences(
            search.task, sorted(constraint.sequences), np.array(goals), model=PAPER, jobs=1
        )
        assert constraint.holds(tried).all(), str(constraint)


def test_a_member_that_is_not_there_is_said():
    with pytest.raises(TaskError, match="unknown task 'two-armed-1-m999'"):
        load_task("two-armed-1-m999")
    assert task_of("ascending") is None
    assert members("ascending") == {}


def test_a_member_runs_in_any_suite():
    cells = select_cells(load_suite("comparison"), KNOWN, tasks=["two-armed-1-m017"])
    assert {cell.task.goals for cell in cells} == {load_task("two-armed-1-m017").goals}
    families = {cell.method.partition("/")[0] for cell in cells}
    assert {"dual-process", "cma-es", "trajectory-optimisation"} <= families
    # Of many names an error shows some.
    with pytest.raises(CoarticError, match=r"m040 and \d+ others\.$"):
        select_cells(load_suite("reconstructions"), KNOWN, tasks=["ascending"])


def test_figures_of_members_are_complete(ensemble):
    task, _ = ensemble
    with members_file(task).open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for test in targets.tests_of(task):
        assert all(test.label in each for each in rows)
    distances = [float(each["distance"]) for each in rows]
    assert len(distances) == len(members(task))
    for each, distance in zip(rows, distances, strict=True):
        counted = [t for t in targets.tests_of(task) if not getattr(t, "implied", False)]
        own = [each[f"{test.label}, distance"] for test in counted]
        squares = [25.0 if value == "" else min(abs(float(value)), 5.0) ** 2 for value in own]
        assert distance == pytest.approx(np.sqrt(np.mean(squares)), abs=0.01)


def _study(tasks, means, **plan):
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
    frame = pd.DataFrame(rows)
    method = DeclaredMethod(
        title="t", citation="", told=(), secondary=(), stochastic=True,
        defaults={"ties": "left", "trials": 10_000}, origin="", code="",
    )  # fmt: skip
    names = ("dual-process/EC3", "dual-process/EC4")
    return study_of(
        frame, list(map(load_task, tasks)), methods=dict.fromkeys(names, method), **plan
    )


def test_claims_are_judged_for_each_member():
    """For each that is admitted, once: v0.1 is not, F3 has the goals of the default task."""
    names = ["two-armed-1", "two-armed-2", "two-armed-1-m002", "two-armed-1-m003"]
    more = ["two-armed-1-v0.1", "two-armed-1-m001", "two-armed-1-F3"]
    means = (20.0, 20.0, 20.0, -20.0, 20.0, 20.0, 20.0)
    study = _study([*names, *more], means)
    claims = [claim for claim in PAPERS if claim.id == "ec4-beats-ec3"]
    found = judged_specifications([study], claims=claims)
    own = found[found.claim == "ec4-beats-ec3"].set_index("member")
    assert set(own.index) == {"", *names[2:], "two-armed-1-m001"}
    assert own.effect["two-armed-1-m002"] > 0 > own.effect["two-armed-1-m003"]
    assert own.verdict[["", *names[2:]]].tolist() == ["supported", "supported", "not supported"]
    twice = judged_specifications([study, study], claims=claims, jobs=2)
    pd.testing.assert_frame_equal(twice, found)
    counted = shares(found).set_index(["claim", "kind"])
    assert counted.specifications["ec4-beats-ec3", "two-armed-1"] == 3
    assert counted.supported["ec4-beats-ec3", "two-armed-1"] == 2
    assert counted.supported["ec4-beats-ec3", "readings"] == 1
    curve = specification_curve(found)
    assert "ec4-beats-ec3: " in curve.alt
    assert len(curve.data) == found.effect.notna().sum()


def test_parameters_of_a_reading_are_no_variant():
    study = _study(["two-armed-1"], (20.0,), readings=("ties=right",))
    cells = [
        replace(cell, variant="ties=right", parameters={"ties": "right"})
        for cell in study.plan.cells
    ]
    changed = replace(
        study,
        plan=replace(study.plan, cells=tuple(cells)),
        runs=study.runs.assign(variant="ties=right"),
    )
    ((spec, seen),) = specifications(changed)
    assert spec.label == "ties=right"
    assert {label for _, label in seen.cells} == {"dual-process/EC3", "dual-process/EC4"}
    assert all(len(cell.runs) == 20 for cell in seen.cells.values())
