"""The study of wrong objectives, on a small folder: against a slow loop, and in closed form."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from coartic import execute, load_task
from coartic.analysis.claims.data import Data, MissingError
from coartic.analysis.claims.judge import judge_claims
from coartic.analysis.claims.register import CLAIMS
from coartic.analysis.report import build
from coartic.analysis.report.contents import TABLES
from coartic.analysis.study import load, one_by_one
from coartic.analysis.topics import objectives
from coartic.analysis.topics.objectives import advantage, crossing, crossings, less_regret, rewards
from coartic.benchmarks.run import run_suite
from coartic.benchmarks.suites import load_suite
from coartic.tasks.task import Penalty, hands_of
from tests.support import reference
from tests.support.made_up import MadeUp, row, study_of
from tests.support.suites import InProcess, made_once

SMALL = """
title = "x"
description = "x"
runs = 3
trials = 60
"""
CELLS = """
[[cells]]
tasks = ["one-armed/v1/d000..d002"]
methods = ["believed-reward/plan", "believed-reward/EC1"]
parameters = { nodes = 40, graphs = 1, starts = 2 }
PENALTIES
[[cells]]
tasks = ["one-armed/v1/d000..d002"]
methods = ["dual-process/EC1"]
PENALTIES
"""
PENALTIES = "penalties = [{ distinct = 100 }, { distinct = 300 }]"


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    def make(folder):
        folder.mkdir()
        (folder / "own.toml").write_text(
            SMALL + CELLS.replace("PENALTIES", "") + CELLS.replace("PENALTIES", PENALTIES)
        )
        run_suite(folder / "own.toml", folder / "results", executor=InProcess())

    return load(made_once(tmp_path_factory, "objectives", make) / "results")


def test_a_plan_is_scored_under_penalties_that_it_does_not_know(study):
    frame = rewards(study).set_index(["task", "term", "weight", "who"]).reward
    for name in (f"one-armed/v1/d00{k}" for k in range(3)):
        (label,) = {label for _, label in study.cells if label.startswith("believed-reward/plan")}
        run = str(study.cells[name, label].good.run_id.iloc[0])
        plain = study.tasks[name]
        execution = execute(plain, study.movements(name, label)[run])
        hits, hands = list(execution.configurations), list(hands_of(execution.hands))
        assert frame[name, "region", 0.0, "ticks"] == -execution.ticks
        for weight in (100.0, 300.0):
            task = study.tasks[f"{name}.distinct-{weight:g}"]
            lost = sum(reference.penalty(task, hits, hands))
            assert frame[name, "distinct", weight, "ticks"] == -execution.ticks - lost
            told = frame[name, "distinct", weight, "told"]
            assert told >= frame[name, "distinct", weight, "ticks"] - 2
            cell = study.cells[task.name, "dual-process/EC1"]
            assert frame[name, "distinct", weight, "learner"] == cell.rewards.mean()


def test_regret_is_less_and_its_advantage_the_difference(study):
    frame = rewards(study)
    assert (frame.regret >= 0).all()
    assert (frame.groupby(["task", "term", "weight"]).regret.min() < 5).all()
    table = advantage(study, "learner", "ticks", "distinct")
    assert list(table.columns) == [0.0, 100.0, 300.0]
    assert len(table) == 3
    assert table[0.0].mean() < table[300.0].mean()  # the more wrong the planner is
    assert not len(advantage(study, "cma-es", "ticks", "distinct"))
    table = crossings(study)
    assert (table.crossing_low <= table.crossing).all()
    assert (table.crossing <= table.crossing_high).all()


def test_regret_is_to_the_best_single_run():
    """Of two learners, without plans: the best run is the learner's, the best mean is CMA-ES's."""
    plain = load_task("ascending")
    dear = plain.model_copy(
        update={"name": "ascending.distinct-100", "penalty": Penalty(distinct=100.0)}
    )
    runs = [
        row(method, reward, task=task.name, run=k, reason="planted" * (status != "ok"),
            status=status)
        for task, method, rewards in (
            (plain, "dual-process/EC1", [-300, -310, -320]),
            (plain, "cma-es/bandit", [-320, -320, None]),
            (dear, "dual-process/EC1", [-400, -420, -440]),
            (dear, "cma-es/bandit", [-410, -410, -410]),
            (dear, "random-search/climbing", [-390]),  # not compared, so that nothing is of it
        )
        for k, reward in enumerate(rewards)
        for status in ("infeasible" if reward is None else "ok",)
    ]  # fmt: skip
    frame = pd.DataFrame(runs).astype({"reward": "Int64"})
    study = study_of(frame, [plain, dear], suite="objectives")
    seen = rewards(MadeUp(study, movements=({}, {})))
    expected = [
        ("joints", 0.0, "learner", -310.0, 100 * 10 / 300),
        ("joints", 0.0, "cma-es", -320.0, 100 * 20 / 300),
        ("region", 0.0, "learner", -310.0, 100 * 10 / 300),
        ("region", 0.0, "cma-es", -320.0, 100 * 20 / 300),
        ("distinct", 0.0, "learner", -310.0, 100 * 10 / 300),
        ("distinct", 0.0, "cma-es", -320.0, 100 * 20 / 300),
        ("distinct", 100.0, "learner", -420.0, 5.0),
        ("distinct", 100.0, "cma-es", -410.0, 2.5),
    ]
    names = ["term", "weight", "who", "reward", "regret"]
    pd.testing.assert_frame_equal(seen[names], pd.DataFrame(expected, columns=names))
    assert set(seen.task) == {"ascending"}
    assert seen.family.isna().all()


def test_where_a_line_crosses_zero():
    weights = np.array([0.0, 30.0, 100.0])
    assert crossing(weights, np.array([-3.0, -1.0, 1.0])) == 65.0
    assert crossing(weights, np.array([-1.0, 3.0, 4.0])) == 7.5
    assert crossing(weights, np.array([1.0, 3.0, 4.0])) == 0.0
    assert crossing(weights, np.array([1.0, 3.0, -4.0])) == math.inf
    assert crossing(weights, np.array([1.0, -2.0, 2.0])) == 65.0  # for good


def test_a_claim_without_its_tasks_is_not_judged(study):
    with pytest.raises(MissingError, match="region"):
        less_regret(Data(study), "learner", "ticks", 300, ("distinct", "region"))


def test_suite_has_what_its_claims_compare():
    penalties = [p for block in load_suite("objectives").cells for p in block.penalties]
    compared = {(t, w) for *_, w, terms in objectives.CLAIMED.values() for t in terms if w}
    assert compared <= {(t, getattr(p, t)) for p in penalties for t in objectives.TERMS}


def test_tables_and_the_figure_have_what_was_planted(monkeypatch):
    """Regrets of ten tasks, planted in the place of solutions, beside one of development."""
    planted = {"told": 0.0, "ticks": 50.0, "smooth": 5.0, "learner": 20.0, "cma-es": 30.0,
               "from plan": 10.0}  # fmt: skip
    rows = [
        {
            "task": f"one-armed/v1/i{number:03d}", "family": "one-armed/v1",
            "split": "test" if number < 10 else "development",
            "term": term, "weight": weight, "who": who, "reward": -100.0,
            "regret": regret * (share if who in ("ticks", "from plan") else 1.0)
            * (0.8 + 0.4 * number / 9 if number < 10 else 5.0),
            "cell": SimpleNamespace(runs=pd.DataFrame({"run_id": [f"{number}"]})),
        }
        for term in objectives.TERMS
        for number in range(11)
        for weight, share in ((0.0, 0.0), (30.0, 0.05), (100.0, 0.5), (300.0, 1.0))
        for who, regret in planted.items()
    ]  # fmt: skip
    frame = pd.DataFrame(rows).astype({"family": "string", "split": "string"})
    monkeypatch.setattr(objectives, "rewards", lambda study: frame)
    rows = pd.DataFrame([row("dual-process/EC1", -100, task="ascending")])
    study = study_of(rows, [load_task("ascending")])
    table = TABLES["objectives"](study)
    assert table.regret["region 300 ticks"] == pytest.approx(50)
    assert table.regret_low["region 300 ticks"] < 50 < table.regret_high["region 300 ticks"]
    assert table.helps["region 100 from plan"] == pytest.approx(15)  # 20 % against 5 %
    assert set(table.tasks) == {10}
    crossings = TABLES["crossings"](study)
    # 2.5 % at 30 and 25 % at 100: 20 % lie between them, 30 % between 100 and 300.
    assert crossings.crossing["region learner"] == pytest.approx(30 + 70 * 17.5 / 22.5)
    assert crossings.crossing["joints cma-es"] == pytest.approx(140)
    assert len(crossings) == 6
    assert build.draw_figure(study, "objectives")
    assert objectives.finding_of_objectives(study) == (
        "On 10 random tasks with a penalty of weight 300 a planner that believes that ticks alone "
        "count loses 50.0 % of the best known reward with costly joints, 50.0 % with a costly "
        "disc, 50.0 % with postures alike, the learner 20.0 %, 20.0 %, 20.0 %. The learner "
        "overtakes that planner at a weight of 84 [84, 84] with costly joints, 84 [84, 84] with a "
        "costly disc, 84 [84, 84] with postures alike."
    )
    claims = [claim for claim in CLAIMS.values() if claim.suite == "objectives"]
    entries = {entry.claim.id: entry for entry in judge_claims(study, claims)}
    finding = entries["cma-es-overtakes-sooner"].finding
    assert [test.value for test in finding.tests] == pytest.approx([-6, -6])  # and the margin, 1
    assert re.fullmatch(
        r"CMA-ES regrets less than the planner of ticks: −5.0 \[.*\] points at weight 100 \(costly "
        r"joints\) on 10 random tasks, −5.0 .*\. Points are per cent of the best known reward\.",
        finding.evidence,
    )
    assert {name: entry.verdict for name, entry in entries.items()} == {
        "right-objective-plans-better": "supported",  # 0 % against 20 %
        "learner-overtakes-wrong-plans": "supported",  # 20 % against 50 %
        "cma-es-overtakes-sooner": "not supported",  # 30 % against 25 %
        "learner-finds-distinct-postures": "not supported",  # 20 % against 5 %
        "slightly-wrong-plan-helps": "supported",  # 0.5 % against 20 %
        "very-wrong-plan-hurts": "not supported",  # 20 % against 10 %
        "truth-beats-trial-and-error": "supported",  # 0 % against 20 %
    }


def test_variants_of_instances_are_not_listed_one_by_one(study):
    assert len(study.tasks) == 9
    assert not one_by_one(study)
