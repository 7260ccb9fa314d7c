"""Comparisons of the settings of a method, against gaps and tests by hand."""

import itertools
import json

import numpy as np
import pytest

from coartic.analysis.sections import TABLES, settings
from coartic.analysis.sections.settings import (
    BEST,
    IDENTICAL,
    LARGER,
    SOME_FAILED,
    UNSURE,
    UNTESTED,
)
from tests.support.made_up import made_up_optima, runs_of, study_of

EC1, OWN = "dual-process/EC1", "mine"
BASE = np.array([-304, -301, -303, -302, -305, -300, -303, -302])
OFF = np.array([3, -1, 2, 1, -2, 2, -1, 2])
"""Ticks by which paired runs differ, in either direction."""


def study(rewards):
    """Runs of settings by task: ``{(task, method, σ): rewards}``; σ 0.05 is the default."""
    rows = [
        run for (task, method, sd), of_setting in rewards.items()
        for run in runs_of(task, method, of_setting, setting=f"noise_sd={sd}" * (sd != 0.05),
                           parameters=json.dumps({"noise_sd": sd, "trials": 10}))
    ]  # fmt: skip
    return study_of(rows, optima=made_up_optima(*{each["task"] for each in rows}))


def of_one_task(*rewards, method=EC1):
    """Settings σ 0.05, 0.1, 0.2, ... on ascending."""
    sds = (0.05, 0.1, 0.2, 0.4)
    return {("ascending", method, sd): each for sd, each in zip(sds, rewards, strict=False)}


def exact_p(differences):
    sums = [abs(differences @ signs) for signs in itertools.product((1, -1), repeat=len(OFF))]
    return np.mean(np.array(sums) >= abs(differences.sum()) - 1e-12)


def test_each_setting_is_tested_against_the_smallest_gap_of_its_method():
    """With Holm's correction for the two others."""
    rows = TABLES["settings"](study(of_one_task(BASE - 4, BASE, BASE - OFF)))
    assert rows.index.tolist() == [f"{EC1} noise_sd=0.1", f"{EC1} noise_sd=0.2", EC1]
    assert rows.setting.tolist() == ["σ 0.1", "σ 0.2", "σ 0.05 (default)"]
    assert rows.gap.tolist() == pytest.approx([10.5 / 292, 11.25 / 292, 14.5 / 292])
    assert rows.comparison.tolist() == [BEST, UNSURE, LARGER]
    assert exact_p(OFF) > 0.05
    assert rows.p_holm.tolist()[1:] == pytest.approx([exact_p(OFF), 2 * 2 / 2**8])


def test_few_runs_tell_nothing():
    """Of five pairs 2 of 32 signs are as extreme at least."""
    rows = TABLES["settings"](study(of_one_task(BASE[:5], BASE[:5] - 9)))
    assert rows.comparison.tolist() == [BEST, UNTESTED]


def test_settings_with_the_same_rewards_are_called_identical():
    """One arm has no hand to explore: with the same seeds ε changes nothing."""
    rows = TABLES["settings"](study(of_one_task(BASE - 4, BASE, BASE)))
    assert rows.comparison.tolist() == [BEST, IDENTICAL, LARGER]
    assert rows.p_holm.isna().tolist() == [True, True, False]
    assert rows.p_holm.iloc[2] == pytest.approx(2 / 2**8)
    sentence = settings.best_settings(study(of_one_task(BASE, BASE)))
    assert "with σ 0.05 (default) and σ 0.1 each, identical in every run." in sentence


def test_an_own_method_beside_a_grid_takes_no_test_away():
    """The grid does not have the defaults; each setting has a row in every table."""
    grid = {key: rewards for key, rewards in of_one_task(BASE, BASE - 4, BASE - 9).items()
            if key[2] != 0.05}  # fmt: skip
    alone = study(grid)
    both = study(grid | of_one_task(BASE - 2, method=OWN))
    labels = [f"{EC1} noise_sd=0.1", f"{EC1} noise_sd=0.2"]
    columns = ["comparison", "p_holm", "gap"]
    assert TABLES["settings"](both)[columns].equals(TABLES["settings"](alone)[columns])
    assert TABLES["settings"](both).index.tolist() == labels
    assert TABLES["ranking"](both).index.tolist() == [OWN, *labels]


def test_settings_stand_behind_their_method_in_the_ranking():
    """Behind its defaults, though their gap is smaller; in sentences the defaults count."""
    seen = study(of_one_task(BASE - 4, BASE) | of_one_task(BASE - 2, method="hill-climbing"))
    ranked = TABLES["ranking"](seen)
    assert ranked.index.tolist() == ["hill-climbing", EC1, f"{EC1} noise_sd=0.1"]
    assert seen.methods.under.to_dict() == {
        EC1: "", f"{EC1} noise_sd=0.1": EC1, "hill-climbing": ""
    }  # fmt: skip


def test_a_setting_with_a_failed_run_has_no_gap():
    rewards = of_one_task(BASE, BASE - 4, BASE - 9)
    runs = study(rewards).stored
    runs.loc[runs.setting == "noise_sd=0.1", "status"] = ["timeout"] + ["ok"] * 7
    rows = TABLES["settings"](study_of(runs, optima=made_up_optima("ascending")))
    assert rows.comparison.tolist() == [BEST, LARGER, SOME_FAILED]
    assert rows.gap.isna().tolist() == [False, False, True]


def test_settings_on_other_tasks_are_not_compared():
    other = {("two-armed-1", EC1, 0.1): BASE - 200}
    assert TABLES["settings"](study({("ascending", EC1, 0.05): BASE} | other)).empty
    more = {("two-armed-1", EC1, 0.05): BASE - 210}
    rows = TABLES["settings"](study({("ascending", EC1, 0.05): BASE} | other | more))
    assert rows.tasks.tolist() == [1, 1]
    assert rows.index.tolist() == [f"{EC1} noise_sd=0.1", EC1]


def test_tasks_of_settings_have_the_order_of_the_study():
    """The tests draw signs by position: the order of a set would change p from run to run."""
    tasks = "two-armed-2", "ascending", "two-armed-1"
    seen = study({(task, EC1, sd): BASE - 200 for task in tasks for sd in (0.05, 0.1)})
    ((_, cells),) = settings.settings_of(seen)
    assert [[cell.task for cell in of_setting] for of_setting in cells.values()] == [
        [*seen.tasks]
    ] * 2
