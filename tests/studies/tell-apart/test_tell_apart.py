"""Study tell-apart: its learner is the paper's, and other code finds the same shares."""

import numpy as np
import pandas as pd
import pytest

from coartic import Movement, learn, load_task
from coartic.analysis import figures
from coartic.tasks.task import hands_of
from tests.support.processes import ROOT, programs
from tests.support.reference import correct, execute

study, protocols = programs("tell-apart", "study", "protocols")


def test_tables_and_figure_of_some_of_the_tasks(monkeypatch, tmp_path):
    monkeypatch.setattr(study, "EXPERIMENTS", 25)
    raw = {
        name: pd.read_csv(ROOT / "studies" / "tell-apart" / f"{name}.csv")
        for name in ("changes", "starts", "steps")
    }
    few = raw["changes"].task.drop_duplicates()[:6]
    for name, table in raw.items():
        table[table.task.isin(few)].to_csv(tmp_path / f"{name}.csv", index=False)
    tables = study.measure(tmp_path)
    shares = tables["results"].share_1
    assert shares["change 0.5 planner, all goals"] == 1
    assert shares["change 0.5 learner"] == 0
    assert abs(shares["change 0.5 learner, informed"]) < 0.9
    assert len(tables["claims"]) == 9
    needed = tables["power"].people_learners  # where the models differ by nothing, nobody tells
    assert not needed["step same"] < 100
    assert needed["change 0.5, 4 goals"] <= needed["change 0.5, 1 goals"] < 50
    assert figures.picture(study.draw(tables["results"]), ".svg").count(b"<path") > 20


def test_learner_that_is_logged_is_the_papers():
    postures, rewards = protocols.series(load_task("one-armed/v1/d000"), "learner", 7)
    run = learn("one-armed/v1/d000", "EC1", seed=7, trials=len(rewards))
    assert rewards.tolist() == run.rewards.tolist()
    best = postures[run.best_trial]
    assert np.array_equal(best, run.execute().configurations)


def corrected(task, q, hand, goal):
    return correct(task.robot, q, hand, task.goals[goal], locked_base=task.locked_base).q


@pytest.mark.parametrize("name", ["one-armed/v1/i002", "two-armed/v1/i001"])
def test_share_at_once_by_other_code(monkeypatch, name):
    """By the step-by-step reference, one movement after the other."""
    monkeypatch.setattr(protocols, "AFTER", [1, 100])
    monkeypatch.setattr(protocols, "PLANNERS", {})
    task, practised = load_task(name), learn(name, protocols.condition(load_task(name)), seed=0)
    cases = [case for case in protocols.moves(task, 0) if case[1] == 0.5]
    hands = hands_of(practised.hands)
    rows = [row for row in protocols.change_goals(task, 0) if row["distance"] == 0.5]
    for n, (g, _, after) in enumerate(cases):
        run = learn(after, practised.condition, seed=1, trials=100, start=practised.solution)
        before, first, end = (
            execute(*each).hits[g]
            for each in ((task, practised.solution), (after, practised.solution),
                         (after, run.solution))
        )  # fmt: skip
        learner = [row for row in rows if row["model"] == "learner"][n]
        assert (first - before) @ (end - before) == 0.0 == learner["dot_1"]
        assert np.sum((end - before) ** 2) == pytest.approx(learner["square"], rel=1e-6)
        # Informed: half of the change of where the corrective process would go, brought back.
        hand, following = hands[g : g + 2]
        way = corrected(after, before, following, g + 1) - corrected(task, before, following, g + 1)
        way = corrected(task, before + way / 2, hand, g) - corrected(task, before, hand, g)
        parts = [m for m in practised.solution if m.goal <= g], [m for m in practised.solution
                                                                 if m.goal > g + 1]  # fmt: skip
        informed = [*parts[0], Movement(g + 1, hand, "learned", before + way), *parts[1]]
        run = learn(after, practised.condition, seed=1, trials=100, start=informed)
        first, end = (execute(after, movements).hits[g] for movements in (informed, run.solution))
        row = [row for row in rows if row["model"] == "learner, informed"][n]
        assert (first - before) @ (end - before) == pytest.approx(row["dot_1"], abs=1e-6)
