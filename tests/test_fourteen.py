"""Fourteen goals: what a goal ahead gains, and the claims on it, where it was planted."""

import json
from functools import cache

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis.claims.judge import judgements
from coartic.analysis.report.contents import TABLES
from coartic.analysis.topics import fourteen
from coartic.baselines.cma_es import CMAES
from coartic.baselines.random_search import Guesses
from tests.support.made_up import MadeUp, row, study_of
from tests.support.strategies import solve

MOVEMENT = 10_000  # ticks of a mean movement of the best solution
NUMBER = (0.0, 20.0, 8.0, 4.0, 0.2)
"""Per cent of a mean movement that each goal ahead gains a movement that has it."""


@cache
def tasks_of(family, stream="i"):
    return [load_task(f"{family}/v1/{stream}{k:03d}") for k in range(8)]


def planted(*, many=NUMBER, many_two=None, seven=NUMBER[:3], learner=60.0, cma=40.0, stream="i"):
    """A study in which every movement with h goals left ahead is so much shorter with h in view."""
    rows = []
    gains = {"fourteen-one": many, "fourteen-two": many_two or many}
    gains |= {"seven-one": seven, "seven-two": seven}
    for family, of_family in gains.items():
        for number, task in enumerate(tasks_of(family, stream)):
            goals = len(task.goals)
            factor = (0.8 + 0.4 * number / 7) * MOVEMENT / 100
            ticks = goals * MOVEMENT + sum(
                factor * gain for left in range(goals) for gain in of_family[1 : left + 1]
            )
            for h, gain in enumerate(of_family):
                ticks -= factor * gain * sum(left >= h for left in range(goals))
                words = {"variant": f"horizon={h}", "run_id": f"{task.name} {h}"}
                words |= {"parameters": json.dumps({"horizon": h}), "task": task.name}
                rows.append(row("receding-horizon", -round(ticks), **words))
            for method, loss in (("dual-process/EC1", learner), ("cma-es/bandit", cma)):
                name = "dual-process/EC4" if method[0] == "d" and len(task.hands) > 1 else method
                worse = goals * MOVEMENT * (1 + loss * (0.9 + number / 35) / 100)
                run_id = f"{task.name} {method}"
                rows.append(row(name, -round(worse), task=task.name, run_id=run_id))
    tasks = [task for family in gains for task in tasks_of(family, stream)]
    return MadeUp(study_of(pd.DataFrame(rows), tasks, suite="fourteen"), optima={})


def verdicts(study):
    """A sign for each claim: fourth goal with one arm (little, more) and two, number, share,
    learner, CMA-ES."""
    signs = {"supported": "+", "not supported": "-", "undecided": "?"}
    return "".join(signs[entry.verdict] for entry in judgements(study))


def test_gains_are_those_of_movements_with_a_full_window():
    table = TABLES["fourteen"](planted())
    for family in ("fourteen-one/v1", "fourteen-two/v1"):
        gains = [100 * table.gain[f"{family} h={h}"] for h in range(1, 5)]
        assert gains == pytest.approx(NUMBER[1:], abs=0.01)
        assert 100 * table.together[f"{family} h=4"] == pytest.approx(32.2, abs=0.02)
        assert 100 * table.gap[f"{family} h=4"] == pytest.approx(0, abs=0.01)
        # 13 of 14 movements have one goal ahead, 12 have two, 11 three, 10 four.
        loss = (13 * 20 + 12 * 8 + 11 * 4 + 10 * 0.2) / 14
        assert 100 * table.gap[f"{family} h=0"] == pytest.approx(loss, abs=0.02)
    assert [100 * table.together[f"seven-one/v1 h={h}"] for h in (1, 2)] == pytest.approx(
        [20, 28], abs=0.02
    )
    learner = (
        100 * table.gap[["fourteen-one/v1 dual-process/EC1", "fourteen-two/v1 dual-process/EC4"]]
    )
    assert learner.tolist() == pytest.approx([60.0, 60.0], abs=0.1)


def test_gains_are_told_by_task():
    table = TABLES["gains"](planted())
    rows = table[(table.family == "fourteen-two/v1") & (table.horizon == 2)]
    factors = [0.8 + 0.4 * number / 7 for number in range(8)]
    assert 100 * rows.gain.to_numpy() == pytest.approx(8 * np.array(factors), abs=0.02)
    before = table[(table.family == "fourteen-two/v1") & (table.horizon == 1)]
    shorter = before.ticks.to_numpy() - rows.ticks.to_numpy()
    assert shorter == pytest.approx(12 * 0.01 * MOVEMENT * 8 * np.array(factors), abs=2)


def test_a_horizon_that_was_left_out_is_shared_by_the_goals_since():
    study = planted()
    kept = study.runs[~study.runs.variant.isin(["horizon=2", "horizon=3"])]
    part = study_of(kept, list(study.tasks.values()), suite="fourteen")
    gains = fourteen.gains_by_horizon(MadeUp(part, optima={}))
    last = gains[gains.family.isin(fourteen.MANY) & (gains.h == 4)]
    each = (12 * 8 + 11 * 4 + 10 * 0.2) / (12 + 11 + 10)
    assert last.gain.mean() == pytest.approx(each, abs=0.01)
    assert last.together.mean() == pytest.approx(20 + 3 * each, abs=0.02)


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({}, "+-+-+-++"),
        ({"many_two": (0.0, 20.0, 8.0, 4.0, 2.0)}, "+--++-++"),
        # Two of fourteen gain what one of seven gains.
        ({"many": (0.0, 12.0, 8.0, 4.0, 4.0)}, "-+-+-+++"),
        ({"learner": 1.0}, "+-+-+--+"),
        ({"cma": 5.0}, "+-+-+-+-"),
        ({"stream": "d"}, "????????"),  # development tasks are not judged
    ],
)
def test_claims_say_what_was_planted(changed, expected):
    assert verdicts(planted(**changed)) == expected


@pytest.mark.parametrize("method", [CMAES, Guesses])
def test_too_many_hand_sequences_leave_the_hands_of_the_task(method):
    task = load_task("fourteen-two/v1/d000")  # 2 ** 14 sequences
    assert method().why_not(task) is None
    _, done, _ = solve(method, task, trials=40)
    assert done.completed
    assert done.hands == task.initial_hands == "L" * 14
