"""Our study of how far ahead a planner must look: planted results, and a small version."""

import json
import math
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis.claims.judge import judgements
from coartic.analysis.report import build
from coartic.analysis.report.contents import TABLES
from coartic.analysis.topics import horizon
from coartic.analysis.topics.horizon import HORIZONS, gaps_by_horizon
from tests.support.made_up import MadeUp, row, study_of
from tests.support.suites import run_and_write, suite_of

HORIZON = TABLES["horizon"]
BEST = 100_000  # ticks: rounding of a reward is then a thousandth of a per cent
FALLING = (30.0, 8.0, 2.0, 1.0, 0.5, 0.0)  # per cent by horizon
CLAIMS = {
    "first": "first-of-several-goals-ahead-gains-most",
    "further": "further-goals-gain-little-where-they-are",
    "learner": "learner-behind-one-goal-ahead",
}


@cache
def tasks_of(stream, family="long"):
    return [load_task(f"{family}/v1/{stream}{k:03d}") for k in range(8)]


def planted(*, stream="i", plain=FALLING, learner=20.0, short=()):
    """A study in which gaps are planted: of eight tasks, a little different on each.

    ``short``: tasks with fewer goals beside them; the first gaps are then those of every task, and
    0 where all goals are in view.
    """
    rows, tasks = [], [*tasks_of(stream), *short]
    losses = np.broadcast_to(learner, len(tasks))
    for number, (task, loss) in enumerate(zip(tasks, losses, strict=True)):
        factor = 1.0 if short else 0.8 + 0.4 * number / 7
        last = len(task.goals) - 1
        for h, gap in {**dict(enumerate(plain[: min(last, 5)])), last: plain[-1]}.items():
            # Version 1 also had plans with given hands and dear joints, which count for nothing.
            for of_version_1 in ({}, {"hands": "optimal"}, {"costs": "base"}):
                asked = {"horizon": h, **of_version_1}
                variant = ", ".join(f"{key}={value}" for key, value in asked.items())
                ticks = BEST * (1 + (100.0 if of_version_1 else factor * gap) / 100)
                words = {"variant": variant, "parameters": json.dumps(asked), "task": task.name}
                run = f"{task.name} {variant}"
                rows.append(row("receding-horizon", -round(ticks), run_id=run, **words))
        ticks = round(BEST * (1 + factor * loss / 100))
        rows.append(row("dual-process/EC4", -ticks, run_id=f"{task.name} EC4", task=task.name))
    return MadeUp(study_of(pd.DataFrame(rows), tasks, suite="horizon"), optima={})


def verdicts(study):
    entries = judgements(study)
    assert {entry.claim.suite for entry in entries} == {study.suite}
    return {entry.claim.id: entry.verdict for entry in entries}


def evidence(study):
    return {entry.claim.id: entry.finding.evidence for entry in judgements(study)}


def test_claims_hold_where_they_were_planted():
    study = planted()
    assert set(verdicts(study).values()) == {"supported"}
    seen = evidence(study)
    sentence = r"The first goal ahead gains [\d.]+ \[.*\] points more than all others together \("
    assert re.match(sentence, seen[CLAIMS["first"]])


@pytest.mark.parametrize(
    ("claim", "other", "verdict"),
    [
        ("first", {"plain": (30.0, 16.0, 8.0, 1.0, 0.5, 0.0)}, "not supported"),
        # The second gains half a per cent; the fourth three and a half.
        ("further", {"plain": (30.0, 8.0, 7.5, 1.0, 0.5, 0.0)}, "not supported"),
        ("further", {"plain": (30.0, 8.0, 5.0, 4.5, 1.0, 0.0)}, "not supported"),
        ("learner", {"learner": 8.5}, "not supported"),  # half a per cent is less than the margin
        ("learner", {"learner": [5.0, 25.0, 25.0, 5.0, 5.0, 25.0, 5.0, 25.0]}, "undecided"),
    ],
)
def test_a_claim_fails_alone_where_its_contrary_was_planted(claim, other, verdict):
    result = verdicts(planted(**other))
    assert result.pop(CLAIMS[claim]) == verdict
    assert set(result.values()) == {"supported"}


def test_development_instances_are_not_judged():
    assert set(verdicts(planted(stream="d")).values()) == {"undecided"}


def test_a_goal_ahead_is_judged_on_tasks_that_have_it():
    """Eight tasks with five goals ahead or more, and some with one, three and four.

    The fourth goal gains 3 points where others follow it, and all 8 that are left where none does.
    Those beyond it gain 5.
    """
    others = [task for task in tasks_of("i", "one-armed") if len(task.goals) in (2, 4, 5)]
    ahead = [len(task.goals) - 1 for task in others]
    one, three, four = (ahead.count(h) for h in (1, 3, 4))
    assert (one, three, four) == (3, 1, 2)
    curve = (30.0, 24.0, 16.0, 8.0, 5.0, 0.0)
    study = planted(short=others, plain=curve)
    frame = gaps_by_horizon(study)
    few = frame[[*HORIZONS]].loc[next(t.name for t in others if len(t.goals) == 2)]
    assert few.notna().tolist() == [True, True, False, False, False, True]
    table = HORIZON(study)
    tasks = {h: table.tasks[f"all all h={h}"] for h in ("0", "1", "2", "3", "4", "5+", "all")}
    more = 8 + four
    everyone = more + three + one
    assert list(tasks.values()) == [everyone] * 2 + [more + three] * 2 + [more, 8, everyone]
    fourth = (8 * 3 + four * 8) / more
    assert 100 * table.gain["all all h=4"] == pytest.approx(fourth, abs=0.01)
    assert 100 * table.gain["all all h=5+"] == pytest.approx(5, abs=0.01)
    assert math.isnan(table.gain["all all h=all"])
    assert "goals 2 h=2" not in table.index
    seen = evidence(study)
    assert f"the fourth gains {fourth:.2f}" in seen[CLAIMS["further"]]
    first = (8 * (6 - 24) + (three + four) * (6 - 24)) / (more + three)
    assert f"gains −{-first:.2f}" in seen[CLAIMS["first"]]


def test_the_table_of_horizons_has_what_was_planted():
    study = planted()
    means = gaps_by_horizon(study)[[*HORIZONS]].mean()
    assert means.tolist() == pytest.approx(FALLING, abs=0.01)
    table = HORIZON(study)
    assert 100 * table.gap["all all h=0"] == pytest.approx(30, abs=0.01)
    assert 100 * table.gain["all all h=1"] == pytest.approx(22, abs=0.01)
    low, high = table.gap_low["all all h=0"], table.gap_high["all all h=0"]
    assert 0.24 < low < 0.3 < high < 0.36  # 24 % to 36 % are the tasks' own
    assert set(table.seconds) == {0.5}  # as planted in every run
    by_goals = table[(table.group == "goals") & (table.h == "0")]
    assert by_goals.tasks.sum() == len(tasks_of("i"))
    runs = table.run_ids["all all h=2"]
    assert f"{tasks_of('i')[0].name} horizon=2" in runs
    assert "hands" not in runs
    sentence = horizon.finding_of_horizon(study)
    assert re.match(r"On 8 random tasks .* no goal ahead ends 30.0 % \[2", sentence)
    assert "the second gains 6.0 % [" in sentence
    assert "the others together gain 0.5 % [0.5, 0.5] (8 tasks)." in sentence


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The suite with little search: three tasks with one arm."""
    folder = tmp_path_factory.mktemp("studies")
    quick = "nodes = 40, graphs = 1, chains = 2"
    tasks = 'tasks = ["one-armed/v1/d001..d003"]'
    planner = f"""{tasks}
methods = ["receding-horizon"]
parameters = {{ {quick} }}
grid = {{ horizon = [0, 1, 2] }}
"""
    beside = f'{tasks}\ngoals = [2, 3]\nmethods = ["dual-process/EC1"]\nruns = 3\n'
    study = run_and_write(folder / "horizon", suite_of(folder, planner, beside), runs=1)
    object.__setattr__(study, "plan", replace(study.plan, suite="horizon"))
    return study


def test_a_small_study_of_horizons(small):
    study = small
    assert (study.runs.status == "ok").all()
    planned = study.runs[study.runs.method == "receding-horizon"]
    horizons = planned.parameters.map(lambda text: json.loads(text)["horizon"])
    ticks = -planned.assign(h=horizons).pivot_table(index="task", columns="h", values="reward")
    best = -study.runs.groupby("task").reward.max()
    for h in (0, 1, 2):
        there = [task for task in ticks.index if len(study.tasks[task].goals) > h]
        mean = (ticks[h] / best - 1)[there].mean()
        assert HORIZON(study).gap[f"all all h={h}"] == pytest.approx(mean)
    signs = TABLES["horizon-signs"](study)
    none, every = signs.loc["whole h=0"], signs.loc["whole h=all"]
    assert 0 < none.to_come == pytest.approx(every["mean"] - none["mean"])
    assert none.tasks == sum(len(task.goals) > 1 for task in study.tasks.values())
    assert build.draw_figure(study, "horizon")
