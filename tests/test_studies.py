"""Our own studies, how far ahead and stops: planted results, and small versions of both suites."""

import json
import math
import re
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis.claims.judge import judged
from coartic.analysis.report import build, facts
from coartic.analysis.report.contents import TABLES
from coartic.analysis.report.text import sentence
from coartic.analysis.topics import horizon, random_tasks, stops
from coartic.analysis.topics.horizon import HORIZONS, gaps_by_horizon
from coartic.motion.costs import joint_costs
from tests.support.made_up import MadeUp, made, row, study_of
from tests.support.suites import run_and_write, suite_of

HORIZON, STOPS = TABLES["horizon"], TABLES["stops"]
BEST = 100_000  # ticks: rounding of a reward is then a thousandth of a per cent
FALLING = (30.0, 8.0, 2.0, 1.0, 0.5, 0.0)  # per cent by horizon
CLAIMS = {
    "first": "first-of-several-goals-ahead-gains-most",
    "further": "further-goals-gain-little-where-they-are",
    "posture": "most-of-the-loss-is-posture",
    "dear": "dear-joints-keep-the-horizon-where-goals-are",
    "learner": "learner-behind-one-goal-ahead",
}


FLAWED = {
    "first-goal-ahead-gains-most": CLAIMS["first"],
    "further-goals-gain-little": CLAIMS["further"],
    "dear-joints-keep-the-horizon": CLAIMS["dear"],
}
"""Claims that take goals that do not exist for goals that gain nothing, with what corrects them."""


@cache
def tasks_of(stream, family="long"):
    return [load_task(f"{family}/v1/{stream}{k:03d}") for k in range(8)]


def planted(
    *,
    stream="i",
    plain=FALLING,
    given=FALLING,
    dear=FALLING,
    learner=20.0,
    short=(),
    gaps=None,
):
    """A study in which gaps are planted: of eight tasks, a little different on each.

    ``short``: tasks with few goals beside them; those of a task are then ``gaps`` of the number of
    its goals ahead.
    """
    rows, trajectories, tasks = [], {}, [*tasks_of(stream), *short]
    for number, task in enumerate(tasks):
        factor, last = 0.8 + 0.4 * (number % 8) / 7, len(task.goals) - 1

        def add(method, variant, reward, name=task.name, **parameters):
            words = {"task": name, "variant": variant, "parameters": json.dumps(parameters)}
            rows.append(row(method, reward, run_id=f"{name} {method} {variant}", **words))

        curves = {("planned", "none"): plain, ("optimal", "none"): given}
        curves |= {("planned", costs): dear for costs in horizon.DEAR}
        for (hands, costs), curve in curves.items():
            horizons = (0, 1, 2, 3, 4, last)
            if short:
                factor, curve = 1.0, gaps(last)
                horizons = sorted({min(h, last) for h in horizons})
            for h, gap in zip(horizons, curve, strict=True):
                variant = f"hands={hands}, costs={costs}, horizon={h}"
                ticks = BEST * (1 + factor * gap / 100)
                add("receding-horizon", variant, -round(ticks), horizon=h, hands=hands,
                    costs=costs, cost_factor=3.0)  # fmt: skip
                # One straight movement of the first link of the dear part: so long by its cost.
                if costs != "none":
                    step = np.zeros((2, task.robot.dof))
                    dearest = int(np.argmax(joint_costs(task.robot, costs, 3.0)))
                    step[1, dearest] = ticks / 3
                    runs = (SimpleNamespace(configurations=step),)
                    trajectories[task.name, f"receding-horizon {variant}"] = SimpleNamespace(
                        runs=runs
                    )
        add("dual-process/EC4", "", -round(BEST * (1 + factor * learner / 100)))
    frame = pd.DataFrame(rows)
    return MadeUp(study_of(frame, tasks, suite="horizon"), trajectories=made(trajectories))


@pytest.fixture(autouse=True)
def fewer_resamples(monkeypatch):
    monkeypatch.setattr(random_tasks, "RESAMPLES_OF_STUDIES", 9_999)


def verdicts(study):
    entries = judged(study)
    assert {entry.claim.suite for entry in entries} == {study.suite}
    return {entry.claim.id: entry.verdict for entry in entries if not entry.claim.uncounted}


def test_gaps_are_those_that_were_planted():
    gaps = gaps_by_horizon(planted(given=(20.0, *FALLING[1:])))
    assert tuple(gaps.columns) == HORIZONS
    means = gaps.groupby(["hands", "costs"]).mean()
    for (hands, _), curve in means.iterrows():
        expected = (20.0 if hands == "optimal" else 30.0, *FALLING[1:])
        assert curve.to_numpy() == pytest.approx(expected, abs=0.01)
    assert len(means) == 4


def test_claims_hold_where_they_were_planted():
    study = planted()
    assert set(verdicts(study).values()) == {"supported"}
    sentence = r"The first goal ahead gains [\d.]+ \[.*\] points more than all others together \("
    assert re.match(sentence, found(study)[CLAIMS["first"]].evidence)


@pytest.mark.parametrize(
    ("claim", "other"),
    [
        ("first", {"plain": (30.0, 16.0, 8.0, 1.0, 0.5, 0.0)}),
        ("further", {"plain": (30.0, 8.0, 7.5, 1.0, 0.5, 0.0)}),  # the second gains half a per cent
        ("further", {"plain": (30.0, 8.0, 5.0, 4.5, 1.0, 0.0)}),  # the fourth three and a half
        ("posture", {"given": (10.0, *FALLING[1:])}),
        ("dear", {"dear": (30.0, 2.5, 2.0, 1.0, 0.5, 0.0)}),
        ("dear", {"dear": (30.0, 20.0, 15.0, 10.0, 5.0, 0.0)}),  # 5 % beyond the fourth
        ("learner", {"learner": 8.5}),  # half a per cent is less than the margin
    ],
)
def test_a_claim_fails_alone_where_its_contrary_was_planted(claim, other):
    result = verdicts(planted(**other))
    assert result.pop(CLAIMS[claim]) == "not supported"
    assert set(result.values()) == {"supported"}


def found(study):
    """What is seen of each claim."""
    return {entry.claim.id: entry.finding for entry in judged(study)}


def test_where_tasks_have_all_goals_flawed_claims_are_the_corrected_ones():
    seen = found(planted())
    for flawed, corrected in FLAWED.items():
        assert seen[flawed].evidence == seen[corrected].evidence


def test_a_goal_ahead_is_judged_on_tasks_that_have_it():
    """Eight tasks with five goals ahead or more, and some with one, three and four.

    The fourth goal gains 3 points where others follow it, and all 8 that are left where none does.
    Those beyond it gain 5.
    """
    others = [task for task in tasks_of("i", "one-armed") if len(task.goals) in (2, 4, 5)]
    ahead = [len(task.goals) - 1 for task in others]
    one, three, four = (ahead.count(h) for h in (1, 3, 4))
    assert (one, three, four) == (3, 1, 2)

    def gaps(last):
        """30, 24, 16, 8, 5, 0 per cent, down to 0 where all goals are in view."""
        return [*(30.0, 24.0, 16.0, 8.0, 5.0)[:last], 0.0]

    study = planted(short=others, gaps=gaps)
    frame = gaps_by_horizon(study).xs(("planned", "none"), level=("hands", "costs"))
    few = frame.loc[next(task.name for task in others if len(task.goals) == 2)]
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
    seen = found(study)
    assert f"the fourth gains {fourth:.2f}" in seen[CLAIMS["further"]].evidence
    diluted = (8 * 3 + four * 8) / everyone
    assert f"the fourth gains {diluted:.2f}" in seen["further-goals-gain-little"].evidence
    first = (8 * (6 - 24) + (three + four) * (6 - 24)) / (more + three)
    assert f"gains −{-first:.2f}" in seen[CLAIMS["first"]].evidence
    beyond = seen[CLAIMS["dear"]].evidence.split("; ")[1]
    assert "gain 5.00" in beyond
    assert beyond.endswith("(8 tasks)")


def test_without_a_difference_nothing_is_decided():
    """Gaps that are high on one task and low on another by chance."""
    tasks = tasks_of("i")
    noisy = np.random.default_rng(1).permutation(np.repeat([5.0, 25.0], len(tasks) // 2))
    study = planted()
    ours = study.runs.method == "dual-process/EC4"
    study.runs.loc[ours, "reward"] = (-BEST * (1 + noisy / 100)).round().astype(int)
    assert verdicts(study)[CLAIMS["learner"]] == "undecided"


def test_development_instances_are_not_judged():
    assert set(verdicts(planted(stream="d")).values()) == {"undecided"}


def test_the_table_of_horizons_has_means_and_gains():
    study = planted(given=(20.0, *FALLING[1:]))
    table = HORIZON(study)
    assert 100 * table.gap["all all h=0"] == pytest.approx(30, abs=0.01)
    assert 100 * table.gain["all all h=1"] == pytest.approx(22, abs=0.01)
    assert 100 * table.gap["hands given h=0"] == pytest.approx(20, abs=0.01)
    low, high = table.gap_low["all all h=0"], table.gap_high["all all h=0"]
    assert 0.24 < low < 0.3 < high < 0.36  # 24 % to 36 % are the tasks' own
    by_goals = table[(table.group == "goals") & (table.h == "0")]
    assert by_goals.tasks.sum() == len(tasks_of("i"))


@pytest.mark.parametrize(
    ("passing", "stopping", "expected"),
    [
        (50.0, 30.0, ["supported", "supported"]),
        (50.0, 0.5, ["not supported", "supported"]),
        (30.0, 50.0, ["supported", "not supported"]),
    ],
)
def test_claims_on_stops(passing, stopping, expected, monkeypatch):
    """Ticks that are planted in the place of solutions."""
    rows, values, tasks = [], {}, tasks_of("i")
    for number, task in enumerate(tasks):
        for timing in ("free", "fixed"):
            for stop, ticks in ((0, passing), (1, stopping)):
                variant = f"timing={timing}, stop={stop}"
                parameters = json.dumps({"timing": timing, "stop": stop, "stop_every": 1})
                words = {"variant": variant, "parameters": parameters, "task": task.name}
                rows.append(row(stops.STOPPING, -500, run_id=f"{task.name} {variant}", **words))
                values[task.name, f"{stops.STOPPING} {variant}"] = ticks * (0.8 + number / 17.5)
    monkeypatch.setattr(
        stops, "SIGNS", {"arm": SimpleNamespace(of=lambda value: np.array([value]))}
    )
    study = study_of(pd.DataFrame(rows), tasks, suite="stops")
    assert list(verdicts(MadeUp(study, trajectories=made(values))).values()) == expected


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Both suites with little search: three tasks with one arm, and one of the paper's."""
    folder = tmp_path_factory.mktemp("studies")
    quick = "nodes = 40, graphs = 1, chains = 2"
    tasks = 'tasks = ["one-armed/v1/d001..d003"]'
    planner = f"""{tasks}
methods = ["receding-horizon"]
parameters = {{ {quick} }}
grid = {{ horizon = [0, 1, 2] }}
"""
    beside = f'{tasks}\ngoals = [2, 3]\nmethods = ["dual-process/EC1"]\nruns = 3\n'
    smooth = f"""{tasks.replace("]", ', "ascending", "descending"]')}
methods = ["trajectory-optimisation/jerk"]
parameters = {{ {quick}, noisy_starts = 0 }}
grid = {{ timing = ["free", "fixed"], stop = [0, 1] }}
"""
    studies_of = {}
    for suite, blocks in (("horizon", (planner, beside)), ("stops", (smooth,))):
        study = run_and_write(folder / suite, suite_of(folder, *blocks), runs=1)
        object.__setattr__(study, "plan", replace(study.plan, suite=suite))
        studies_of[suite] = study
    return studies_of


def test_a_small_study_of_horizons(small):
    study = small["horizon"]
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
    assert signs["mean"]["whole h=all"] > signs["mean"]["whole h=0"]
    assert build.drawn(study, "horizon")
    assert "looks no goal ahead ends" in sentence("horizon", facts.horizon(study))


def test_a_small_study_of_stops(small):
    study = small["stops"]
    table = STOPS(study)
    for group in ("random, one arm", "ascending, descending"):
        for timing in ("free", "fixed"):
            of = table[(table.group == group) & (table.timing == timing)].set_index("stop")
            assert of.turn[0] < of.turn[1] / 3  # passing is smooth, a stop leaves a corner
    assert table.apart.dropna().gt(0.1).all()  # postures depend on the next goal at any stop
    assert build.drawn(study, "stops")
    assert sentence("stops", facts.stops(study)).startswith("At free times")
