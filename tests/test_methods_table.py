"""Methods side by side: gaps, counts, and what must never happen."""

import json

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis.comparisons.methods import TOLD
from coartic.analysis.report.tables.methods import methods_table, reading_of_methods
from coartic.analysis.results.folder import Results
from coartic.analysis.study import Study
from coartic.method import Information
from tests.support.made_up import MadeUp, made_up_optima, manifest_for, row
from tests.support.strategies import changed


def study_of(rows, tmp_path, task=None):
    task = task or load_task("two-armed-1")
    runs = pd.DataFrame(rows).astype({"reward": "Int64", "proven_bound": "Int64"})
    return Study(Results(tmp_path, manifest_for([task], runs), runs, pd.DataFrame()))


def study_near_optimum(rows, tmp_path):
    """Two-armed 1 with a made-up optimum: -465, with the other arm still -490."""
    results = study_of(rows, tmp_path).results
    return MadeUp(results, optima=made_up_optima("two-armed-1"))


def shown(study):
    """The one row of the table of the one task, by its columns' names."""
    table = methods_table(study, *study.tasks)
    (row,) = table.rows
    return dict(zip([column.name for column in table.columns], row.values, strict=True))


def test_gaps_are_to_the_optimum_of_the_restriction(tmp_path):
    rows = [
        row("moving", -475, travel=0.3),
        row("still", -500, run=0),
        row("still", -510, run=1),
        row("still", None, run=2, status="infeasible"),
    ]
    found = study_near_optimum(rows, tmp_path).methods.set_index("method")
    assert found.loc["moving", "gap"] == 10
    assert np.isnan(found.loc["moving", "gap_still"])
    assert found.loc["still", "gap"] == 40
    assert found.loc["still", "gap_still"] == 15
    assert found.loc["still", "gap_share"] == pytest.approx(40 / 465)
    assert list(found[["runs", "solved"]].loc["still"]) == [3, 2]
    assert list(found.other_arm) == ["moves", "still"]  # best reward first
    assert found.beaten.sum() == 0
    assert found.loc["still", "reward_sd"] == pytest.approx(np.std([-500, -510], ddof=1))


def test_what_is_shown(tmp_path):
    study = study_near_optimum([row("m", -475, travel=0.3, jacobians=0)], tmp_path)
    assert methods_table(study, "two-armed-1").caption == (
        "All methods on two-armed-1 †; optimum, by the other arm: "
        "free −465 LRLR (proven), still −490 LRLR (proven)."
    )
    found = shown(study)
    assert found["told"] == "AT"
    assert (found["reward"].value, found["reward"].low, found["solved"]) == (-475, None, 1)
    assert (found["gap"], found["gap_share"]) == (10, pytest.approx(10 / 465))
    assert (found["forward_kinematics"], found["movement_ticks"]) == (1_234_567, 5000)
    assert found["jacobians"] is None  # of what was not used nothing was spent
    assert (found["hands"], found["other_arm"]) == ("LRLR", "moves")


def test_a_reward_above_the_optimum_is_shouted(tmp_path):
    study = study_near_optimum([row("miracle", -464, travel=1.0)], tmp_path)
    assert study.methods.beaten.sum() == 1
    shouted = reading_of_methods(study)[0]
    assert "better than the optimum: it is not one" in shouted
    study = study_near_optimum([row("good", -465, travel=1.0)], tmp_path)
    assert study.methods.beaten.sum() == 0
    assert shouted not in reading_of_methods(study)


def test_a_method_that_only_crashed_has_a_row(tmp_path):
    nothing = dict.fromkeys(("trials", "build_s", "solve_s", "jacobians", "hands"))
    rows = [row("m", None, status="crashed", **nothing)]
    found = shown(study_of(rows, tmp_path))
    assert (found["reward"], found["solved"], found["runs"]) == (None, 0, 1)
    assert found["gap"] is None


def test_times_are_of_warm_runs(tmp_path):
    rows = [row("m", -500, run=0, solve_s=9.0), row("m", -500, run=1, solve_s=0.2)]
    assert study_of(rows, tmp_path).methods.solve_s.item() == 0.2
    unmarked = [row("m", -500, run=1, solve_s=0.0, wall_s=0.7)]
    assert study_of(unmarked, tmp_path).methods.solve_s.item() == 0.7


def test_a_task_of_the_users_own_has_the_optimum_of_its_own_runs(tmp_path):
    task = changed("two-armed-1", goals=[[2.1, 3.6], [4.4, 3.5]], initial_hands="RR", name="own")
    rows = [row("m", -400, task="own")]
    assert study_of(rows, tmp_path, task).methods.gap.isna().all()
    parameters = json.dumps({"other_arm": "still", "base": "task"})
    rows += [
        row("optimum/multistart", -390, task="own", parameters=parameters),
        row("optimum/branch-and-bound", -391, task="own", parameters=parameters,
            proven_bound=-380),
        row("optimum/multistart", -350, task="own", run=1,
            parameters=json.dumps({"other_arm": "free", "base": "y"})),
    ]  # fmt: skip
    study = study_of(rows, tmp_path, task)
    found = study.optima["own", "still"]
    assert (found.reward, found.bound, found.proven) == (-390, -380, False)
    assert ("own", "free") not in study.optima


def test_a_task_that_only_shares_a_name_has_no_gap(tmp_path):
    task = changed("two-armed-1", radius=0.2)
    assert study_of([row("m", -475)], tmp_path, task).optima == {}


def test_an_optimum_of_no_ticks_has_no_share(tmp_path):
    """A task whose goals are hit as it starts."""
    task = changed("two-armed-1", goals=[[0, 4.07]], initial_hands="R", name="there")
    parameters = json.dumps({"other_arm": "free", "base": "task"})
    rows = [row("optimum/multistart", 0, task="there", parameters=parameters)]
    study = study_of(rows, tmp_path, task)
    found = study.methods
    assert (found.gap.item(), np.isnan(found.gap_share.item())) == (0, True)
    assert (shown(study)["gap"], study.method_rows["there", "optimum/multistart"].gap) == (0, 0)


def test_a_base_locked_by_a_parameter_has_no_gap(tmp_path):
    parameters = json.dumps({"other_arm": "free", "base": "y"})
    study = study_of([row("optimum/multistart", -500, parameters=parameters)], tmp_path)
    assert study.methods.gap.isna().all()


def test_a_still_arm_above_its_optimum_is_shouted_too(tmp_path):
    study = study_near_optimum([row("still", -480)], tmp_path)  # above -490, below -465
    assert study.methods.beaten.sum() == 1


def test_every_kind_of_information_has_a_letter():
    assert set(TOLD) == set(Information)
    assert len(set(TOLD.values())) == len(TOLD)
