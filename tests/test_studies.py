"""Our own studies, how far ahead and stops: planted results, and small versions of both suites."""

import json
import math
import re
from dataclasses import replace
from functools import cache
from itertools import product
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from coartic import load_task
from coartic.analysis.claims.judge import judgements
from coartic.analysis.report import build
from coartic.analysis.report.contents import TABLES
from coartic.analysis.signatures.signs import SIGNS
from coartic.analysis.topics import horizon, stops
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


@cache
def tasks_of(stream, family="long"):
    return [load_task(f"{family}/v1/{stream}{k:03d}") for k in range(8)]


def planted(*, stream="i", plain=FALLING, given=FALLING, dear=FALLING, learner=20.0, short=()):
    """A study in which gaps are planted: of eight tasks, a little different on each.

    ``short``: tasks with fewer goals beside them; the first gaps are then those of every task, and
    0 where all goals are in view.
    """
    rows, trajectories, tasks = [], {}, [*tasks_of(stream), *short]
    curves = {("planned", "none"): plain, ("optimal", "none"): given}
    losses = np.broadcast_to(learner, len(tasks))
    curves |= {("planned", costs): dear for costs in ("base", "right-arm")}
    for number, (task, loss) in enumerate(zip(tasks, losses, strict=True)):
        factor = 1.0 if short else 0.8 + 0.4 * number / 7
        last = len(task.goals) - 1
        for (hands, costs), curve in curves.items():
            for h, gap in {**dict(enumerate(curve[: min(last, 5)])), last: curve[-1]}.items():
                variant = f"hands={hands}, costs={costs}, horizon={h}"
                ticks = BEST * (1 + factor * gap / 100)
                asked = {"horizon": h, "hands": hands, "costs": costs, "cost_factor": 3.0}
                words = {"variant": variant, "parameters": json.dumps(asked), "task": task.name}
                run = f"{task.name} {variant}"
                rows.append(row("receding-horizon", -round(ticks), run_id=run, **words))
                if costs != "none":
                    # One straight movement of the first link of the dear part: so long by its cost.
                    step = np.zeros((2, task.robot.dof))
                    step[1, int(np.argmax(joint_costs(task.robot, costs, 3.0)))] = ticks / 3
                    runs = SimpleNamespace(runs=(SimpleNamespace(configurations=step),))
                    trajectories[task.name, f"receding-horizon {variant}"] = runs
        ticks = round(BEST * (1 + factor * loss / 100))
        rows.append(row("dual-process/EC4", -ticks, run_id=f"{task.name} EC4", task=task.name))
    study = study_of(pd.DataFrame(rows), tasks, suite="horizon")
    return MadeUp(study, trajectories=made(trajectories))


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
        ("posture", {"given": (10.0, *FALLING[1:])}, "not supported"),
        ("dear", {"dear": (30.0, 2.5, 2.0, 1.0, 0.5, 0.0)}, "not supported"),
        # 5 % beyond the fourth
        ("dear", {"dear": (30.0, 20.0, 15.0, 10.0, 5.0, 0.0)}, "not supported"),
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
    study = planted(short=others, plain=curve, given=curve, dear=curve)
    frame = gaps_by_horizon(study).xs(("planned", "none"), level=("hands", "costs"))
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
    beyond = seen[CLAIMS["dear"]].split("; ")[1]
    assert "gain 5.00" in beyond
    assert beyond.endswith("(8 tasks)")


def test_the_table_of_horizons_has_what_was_planted():
    study = planted(given=(20.0, *FALLING[1:]))
    gaps = gaps_by_horizon(study)
    means = gaps[[*HORIZONS]].groupby(["hands", "costs"], sort=False).mean()
    expected = [FALLING, (20.0, *FALLING[1:]), FALLING, FALLING]
    assert means.to_numpy() == pytest.approx(np.array(expected), abs=0.01)
    table = HORIZON(study)
    assert 100 * table.gap["all all h=0"] == pytest.approx(30, abs=0.01)
    assert 100 * table.gain["all all h=1"] == pytest.approx(22, abs=0.01)
    assert 100 * table.gap["hands given h=0"] == pytest.approx(20, abs=0.01)
    low, high = table.gap_low["all all h=0"], table.gap_high["all all h=0"]
    assert 0.24 < low < 0.3 < high < 0.36  # 24 % to 36 % are the tasks' own
    assert set(table.seconds) == {0.5}  # as planted in every run
    by_goals = table[(table.group == "goals") & (table.h == "0")]
    assert by_goals.tasks.sum() == len(tasks_of("i"))
    runs = f"{tasks_of('i')[0].name} hands=planned, costs=none, horizon=2"
    assert runs in table.run_ids["all all h=2"]
    sentence = horizon.finding_of_horizon(study)
    assert re.match(r"On 8 random tasks .* no goal ahead ends 30.0 % \[2", sentence)
    assert "the second gains 6.0 % [" in sentence
    assert "the others together gain 0.5 % [0.5, 0.5] (8 tasks)." in sentence


@pytest.mark.parametrize(
    ("passing", "stopped", "expected"),
    [
        (50.0, 30.0, ["supported", "supported"]),
        (50.0, 0.5, ["not supported", "supported"]),
        (30.0, 50.0, ["supported", "not supported"]),
    ],
)
def test_claims_on_stops(passing, stopped, expected, monkeypatch):
    """Ticks in the place of solutions; wild ones where plans or tasks are not those of a claim."""
    tasks = [*tasks_of("i"), *tasks_of("d"), load_task("ascending")]
    judged_plan, other_plan = stops.STOPPING, "trajectory-optimisation/acceleration"
    rows = []
    for (number, task), method, timing, stop, every in product(
        enumerate(tasks), (judged_plan, other_plan), ("free", "fixed"), (0.0, 1.0), (1, 2)
    ):
        ticks = (stopped if stop else passing) * (0.8 + number / 17.5)
        if number >= 8 or method == other_plan or every == 2:
            ticks = 1e4 * stop
        cell = SimpleNamespace(good=pd.DataFrame({"run_id": [f"{task.name} {stop}"]}))
        at = dict(zip(stops.KEYS, ("random, one arm", method, timing, stop, every), strict=True))
        rows.append({**at, "task": task.name, "cell": cell, "nearer": ticks})
    monkeypatch.setattr(stops, "stop_values", lambda study: pd.DataFrame(rows))
    study = study_of(
        pd.DataFrame([row(judged_plan, -500, task=task.name) for task in tasks]),
        tasks,
        suite="stops",
    )
    assert list(verdicts(study).values()) == expected
    assert {run for entry in judgements(study) for run in entry.run_ids} == {
        f"{task.name} {stop}" for task in tasks_of("i") for stop in (0.0, 1.0)
    }


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

    def study_on(suite, *blocks):
        study = run_and_write(folder / suite, suite_of(folder, *blocks), runs=1)
        object.__setattr__(study, "plan", replace(study.plan, suite=suite))
        return study

    return study_on("horizon", planner, beside), study_on("stops", smooth)


def test_a_small_study_of_horizons(small):
    study, _ = small
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


def test_a_small_study_of_stops(small):
    _, study = small
    table = STOPS(study)
    for group in ("random, one arm", "ascending, descending"):
        for timing in ("free", "fixed"):
            of = table[(table.group == group) & (table.timing == timing)].set_index("stop")
            assert of.turn[0] < of.turn[1] / 3  # passing is smooth, a stop leaves a corner
            assert of.less[1] == pytest.approx(of.nearer[0] - of.nearer[1])
            assert math.isnan(of.less[0])
    assert table.apart.dropna().gt(0.1).all()  # postures depend on the next goal at any stop
    full = table.loc["random, one arm trajectory-optimisation/jerk free stop=1"]
    cells = [cell for cell in study.cells.values() if cell.runs.run_id.iloc[0] in full.run_ids]
    assert len(cells) == full.tasks == 3
    for sign, column in (("arm", "nearer"), ("first", "first")):
        ticks = [SIGNS[sign].of(study.trajectories(cell.task, cell.label)) for cell in cells]
        assert full[column] == pytest.approx(np.mean(ticks))
    assert build.draw_figure(study, "stops")
    passing = table.loc["random, one arm trajectory-optimisation/jerk free stop=0"]
    assert stops.finding_of_stops(study).startswith(
        "At free times postures of minimum-jerk plans leave the next goal nearer by "
        f"{passing.nearer:.1f} ticks [{passing.nearer_low:.1f}, "
    )
