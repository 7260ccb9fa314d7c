"""Study tell-apart: its learner is the paper's, and other code finds the same shares."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from coartic import Movement, learn, load_task
from coartic.analysis import figures

FOLDER = Path(__file__).parents[3] / "studies" / "tell-apart"


@pytest.fixture
def protocols(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    import protocols

    return protocols


@pytest.fixture
def study(protocols, monkeypatch):
    monkeypatch.delitem(sys.modules, "study", raising=False)  # another folder's
    import study

    yield study
    del sys.modules["study"]


def test_tables_and_figure_of_some_of_the_tasks(study):
    raw = [pd.read_csv(FOLDER / f"{name}.csv") for name in ("changes", "starts", "steps")]
    few = raw[0].task.drop_duplicates()[:6]
    tables = study.measure(*(table[table.task.isin(few)] for table in raw))
    shares = tables["results"].share_1
    assert shares["change 0.5 planner, all goals"] == 1
    assert shares["change 0.5 learner"] == 0
    assert abs(shares["change 0.5 learner, told"]) < 0.9
    assert len(tables["claims"]) == 9
    needed = tables["power"].people_learners  # where the models differ by nothing, nobody tells
    assert not needed["step same"] < 100
    assert needed["change 0.5, 4 goals"] <= needed["change 0.5, 1 goals"] < 50
    assert figures.picture(study.draw(tables["results"]), ".svg").count(b"<path") > 20


def test_learner_that_is_logged_is_the_papers(protocols):
    postures, rewards = protocols.series(load_task("one-armed/v1/d000"), "learner", 7)
    run = learn("one-armed/v1/d000", "EC1", seed=7, trials=len(rewards))
    assert rewards.tolist() == run.rewards.tolist()
    best = postures[run.best_trial]
    assert np.array_equal(best, run.execute().configurations)


# ---- The same by other code: complex numbers, one step after the other ----


def hand_at(task, q, hand):
    shoulder = task.robot.left_shoulder if hand == "left" else task.robot.right_shoulder
    links = task.robot.left_links if hand == "left" else task.robot.right_links
    turns = np.exp(1j * np.cumsum(q[task.robot.joints(hand)]))
    joints = complex(*q[:2]) + complex(*shoulder) + np.cumsum(np.append(0, links * turns))
    return joints[-1], joints[:-1]


def off(task, q, hand, goal):
    return complex(*task.goals[goal]) - hand_at(task, q, hand)[0]


def corrected(task, q, hand, goal):
    q = q.copy()
    while abs(error := off(task, q, hand, goal)) > 0.01:
        tip, joints = hand_at(task, q, hand)
        turn = 1j * (tip - joints)
        q[task.robot.joints(hand)] += 0.05 * (turn.real * error.real + turn.imag * error.imag)
        moves = [0.0 if axis in task.locked_base else 1.0 for axis in "xy"]
        q[:2] += 0.05 * np.multiply(moves, [error.real, error.imag])
    return q


def moved(task, q, target, hand, goal, arrives):
    distance, end = np.linalg.norm(target - q), hand_at(task, target, hand)[0]
    for k in range(int(np.ceil(distance / 0.01)) + 1):
        here = target if 0.01 * k >= distance else q + 0.01 * k / distance * (target - q)
        hit = abs(off(task, here, hand, goal)) <= task.radius
        if hit or (arrives and abs(end - hand_at(task, here, hand)[0]) <= 0.01):
            break
    return here, hit


def postures(task, movements):
    q, reached = task.q0, []
    for goal in range(len(task.goals)):
        due = [movement for movement in movements if movement.goal == goal + 1]
        hand, hit = due[0].hand, abs(off(task, q, due[0].hand, goal)) <= task.radius
        for n, movement in enumerate(due):
            learned = movement.kind != "corrective"
            if not hit or (learned and n == 0):
                q, hit = moved(task, q, movement.target, hand, goal, learned)
        if not hit:
            q, hit = moved(task, q, corrected(task, q, hand, goal), hand, goal, False)
        reached.append(q)
    return np.array(reached)


@pytest.mark.parametrize("name", ["one-armed/v1/i002", "two-armed/v1/i001"])
def test_share_at_once_by_other_code(protocols, monkeypatch, name):
    monkeypatch.setattr(protocols, "AFTER", [1, 300])
    monkeypatch.setattr(protocols, "EVOLVED", 2)
    monkeypatch.setattr(protocols, "PLANNERS", {})
    task, practised = load_task(name), learn(name, protocols.condition(load_task(name)), seed=0)
    cases = [case for case in protocols.moves(task, 0) if case[1] == 0.5]
    hands = [{"L": "left", "R": "right"}[letter] for letter in practised.hands]
    rows = [row for row in protocols.change_goals(task, 0) if row["distance"] == 0.5]
    for n, (g, _, after) in enumerate(cases):
        run = learn(after, practised.condition, seed=1, trials=300, start=practised.solution)
        before, first, end = (
            postures(*each)[g]
            for each in ((task, practised.solution), (after, practised.solution),
                         (after, run.solution))
        )  # fmt: skip
        learner = [row for row in rows if row["model"] == "learner"][n]
        assert (first - before) @ (end - before) == 0.0 == learner["dot_1"]
        assert np.sum((end - before) ** 2) == pytest.approx(learner["square"], rel=1e-6)
        # Told: half of the change of where the corrective process would go, brought back.
        hand, following = hands[g : g + 2]
        way = corrected(after, before, following, g + 1) - corrected(task, before, following, g + 1)
        way = corrected(task, before + way / 2, hand, g) - corrected(task, before, hand, g)
        parts = [m for m in practised.solution if m.goal <= g], [m for m in practised.solution
                                                                 if m.goal > g + 1]  # fmt: skip
        told = [*parts[0], Movement(g + 1, hand, "learned", before + way), *parts[1]]
        run = learn(after, practised.condition, seed=1, trials=300, start=told)
        first, end = (postures(after, movements)[g] for movements in (told, run.solution))
        row = [row for row in rows if row["model"] == "learner, told"][n]
        assert (first - before) @ (end - before) == pytest.approx(row["dot_1"], abs=1e-6)
