"""Study fit: the reader, the simulator, and fits of people whom other code simulates."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from coartic import CONDITIONS, CoarticError, learn, load_task
from coartic.analysis import SIGNATURES, solutions_of
from coartic.analysis.solutions import Solutions
from tests.support import reference
from tests.support.processes import program

FOLDER = Path(__file__).parents[3] / "studies" / "fit"
TASK = load_task("two-armed-1")


@pytest.fixture(scope="module")
def simulate():
    return program(FOLDER / "protocols.py").simulate


@pytest.fixture(scope="module")
def fit():
    return program(FOLDER / "fit.py")


@pytest.fixture(scope="module")
def read():
    return program(FOLDER / "hits.py").read_hits


@pytest.fixture(scope="module")
def people(simulate):
    """Two people, of whom the second is uninformed."""
    return simulate(TASK, "informed", 0.04, 0.3, [0.4, 0.0], seeds=[1, 2], trials=60)


def by_reference(task, condition, trials, seed):
    """Hits of the plain learner of the tests, in the format of the study."""
    run = reference.learn(task, condition, seed=seed, trials=trials)
    rows = [
        [seed, trial, goal, hand, ticks, *q]
        for trial, (visited, spent) in enumerate(zip(run.visits, run.ticks_by_goal, strict=True), 1)
        for goal, ((_, hand, q), ticks) in enumerate(zip(visited, spent, strict=True), 1)
    ]
    names = ["subject", "trial", "goal", "hand", "ticks", *task.robot.joint_names]
    return pd.DataFrame(rows, columns=names)


@pytest.mark.parametrize(("name", "condition"), [("ascending", "EC1"), ("two-armed-1", "EC2")])
def test_the_simulated_learner_is_the_packages(simulate, name, condition):
    people = simulate(load_task(name), "best", 0.05, 0.2, seeds=[7, 8], trials=30,
                      condition=CONDITIONS[condition])  # fmt: skip
    for number, seed in enumerate((7, 8)):
        of_person = people[people.subject == number]
        run = learn(name, condition, seed=seed, trials=30)
        assert (of_person.groupby("trial").ticks.sum() == -run.rewards).all()


def test_parameters_of_the_plain_learner_are_found(fit):
    """Its movements, tables and null spaces share no code with the package's kernels."""
    truth = {"sigma": 0.03, "epsilon": 0.25, "kappa": 0.5}
    fields = {"noise_sd": 0.03, "epsilon": 0.25, "drift": 0.5}
    people = by_reference(TASK, replace(CONDITIONS["EC4"], **fields), 60, seed=5)
    ((_, found),) = fit.fit(people, TASK).iterrows()
    assert (found.model, found.others) == ("informed", "")
    for name, value in truth.items():
        assert found[f"{name}_low"] < value < found[f"{name}_high"]
    assert found.kappa_high - found.kappa_low < 0.1
    assert "κ = 0." in fit.sentence(found)


@pytest.mark.parametrize("model", ["best", "drawn", "walk", "memoryless", "planner"])
def test_model_of_simulated_people_is_preferred(fit, simulate, model):
    people = simulate(TASK, model, 0.04, 0.3, seeds=[3], trials=60)
    ((_, found),) = fit.fit(people, TASK).iterrows()
    assert found.model == model
    assert ("do not apply" in fit.sentence(found)) == (model not in fit.LEARNERS)


def test_motor_noise_is_a_parameter(fit, people):
    noisy, joints = people[people.subject == 0].copy(), [*TASK.robot.joint_names]
    noisy[joints] += 0.03 * np.random.default_rng(0).standard_normal((len(noisy), len(joints)))
    trials = fit.trials_of(noisy, TASK)
    given, ignored = (fit.fit_subject(TASK, CONDITIONS["EC4"], trials, noise=noise, intervals=False)
                      for noise in (0.03, 0.0))  # fmt: skip
    assert ignored["sigma"] > 0.046
    assert given["sigma"] == pytest.approx(0.04, rel=0.1)
    assert given["kappa"] == pytest.approx(0.4, abs=0.05)


def test_where_two_models_explain_the_trials_no_parameters_are_given(fit, simulate):
    """A learner that has found nothing better is one without memory."""
    people = simulate(load_task("ascending"), "best", 0.05, 0.2, seeds=[2], trials=12)
    ((_, found),) = fit.fit(people, load_task("ascending")).iterrows()
    assert {"best", "memoryless"} <= {found.model, *found.others.split()}
    assert "cannot distinguish" in fit.sentence(found)
    assert "κ" not in fit.sentence(found)


def test_signatures_of_recorded_trials_are_of_what_was_recorded(simulate):
    task = load_task("two-armed-2")
    people = simulate(task, "best", 0.05, 0.2, seeds=[4], trials=20)
    run = learn(task, "EC4", seed=4, trials=20)
    recorded = solutions_of(task, people)
    best = Solutions(task, "learner", (run.execute(),))
    for signature in SIGNATURES.values():
        assert signature.each(recorded)[run.best_trial] == pytest.approx(
            signature.each(best)[0], nan_ok=True
        )
    assert len(solutions_of(task, people.drop(index=[0, 5])).runs) == 18


def test_lost_trials_and_hits_are_counted(fit, people):
    first = people[people.subject == 0]
    kept = first[~first.trial.isin([10, 20]) & ~((first.trial == 30) & (first.goal > 2))]
    ((_, found),) = fit.fit(kept, TASK).iterrows()
    assert (found.trials, found.lost, found.missing) == (60, 2, 2)
    with pytest.raises(CoarticError, match="two trials"):
        fit.fit(first[first.trial == 1], TASK)


WRONG = {
    "no column left_2": lambda t: t.drop(columns="left_2"),
    "line 4: hand is 'both'": lambda t: t.assign(hand=t.hand.where(t.index != 2, "both")),
    "line 3: goal is 9": lambda t: t.assign(goal=t.goal.where(t.index != 1, 9)),
    "line 2: trial is 0.5;": lambda t: t.assign(trial=t.trial.where(t.index != 0, 0.5)),
    "line 2: ticks is nan": lambda t: t.assign(ticks=t.ticks.where(t.index != 0)),
    "angles are in rad": lambda t: t.assign(left_1=np.degrees(t.left_1)),
    "a line above": lambda t: pd.concat([t, t]),
    "subject is nan": lambda t: t.assign(subject=t.subject.where(t.index != 0)),
}


@pytest.mark.parametrize("sentence", WRONG)
def test_reader_says_what_is_wrong_and_where(read, people, tmp_path, sentence):
    WRONG[sentence](people).to_csv(tmp_path / "people.csv", index=False)
    with pytest.raises(CoarticError, match=sentence):
        read(tmp_path / "people.csv", TASK)


def test_reader_takes_durations_and_warns_of_small_degrees(read, people, tmp_path):
    path = tmp_path / "people.csv"
    timed = people.rename(columns={"ticks": "duration"})
    timed.assign(duration=timed.duration / 100).to_csv(path, index=False)
    assert read(path, TASK, ticks_per_unit=100).ticks.tolist() == people.ticks.tolist()
    angles = [name for name in people if name[-1].isdigit()]
    people.assign(**np.degrees(people[angles] / 10)).to_csv(path, index=False)
    with pytest.warns(UserWarning, match="Are the angles in rad"):
        read(path, TASK)
