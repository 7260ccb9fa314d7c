"""Study practice on a small folder: hands, numbers, and hill climbing that keeps targets."""

import math
import statistics

import numpy as np
import pandas as pd
import pytest

from coartic import PAPER, load_task
from coartic.method import Session, run_method
from coartic.method.optimisers import explored_joints
from tests.support.processes import ROOT, programs
from tests.support.suites import unpacked

PROTOCOLS, KEEPS_TARGETS, STUDY = programs("practice", "protocols", "keeps_targets", "study")
SMALL = ROOT / "tests" / "studies" / "practice"
WEIGHTS = {
    "method": {"a": -1, "b": -1, "c": 1, "d": 1},
    "spread": {"a": -1, "b": 1, "c": -1, "d": 1},
    "interaction": {"a": 2, "b": -2, "c": -2, "d": 2},
}
"""Twice the weights of the cells, as the page says."""
TASK, HANDS = load_task("one-armed/v1/d000"), "RRRR"
NOISY = PAPER._replace(motor_noise=0.01)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    return STUDY.read(unpacked(SMALL, tmp_path_factory.mktemp("practice")))


@pytest.fixture(scope="module")
def rows(stored):
    return STUDY.stored(stored).reset_index().to_dict("records")


def test_runs_have_the_hands_and_the_seed_of_the_learner_in_the_same_world(rows):
    """The small folder was made by protocols.py, which gives each run its hands."""
    learner = {
        (row["task"], row["motor_noise"], row["run"]): (row["hands"], row["seed"])
        for row in rows if row["method"].startswith("dual-process/")
    }  # fmt: skip
    assert len({hands for hands, _ in learner.values()}) > 2
    for row in rows:
        key = row["task"], row["motor_noise"], row["run"]
        assert (row["hands"], row["seed"]) == learner[key]
        if not row["method"].startswith("dual-process/"):
            assert f"sequence={row['hands']}" in row["setting"].split(", ")


def gap(row):
    return 100 * (row["value"] / row["best_known"] - 1)


def effect(rows, name, noise, task, replaced=""):
    """The effect on the gap on a task, from rows of runs by plain arithmetic."""
    cells = {}
    for row in rows:
        if (row["task"], row["motor_noise"]) == (task, noise):
            cells.setdefault(row["run"], {})[STUDY.cell_of(row["method"], row["setting"])] = gap(
                row
            )
    values = []
    for of_run in cells.values():
        chosen = {cell: f"{cell} second" if cell in replaced else cell for cell in "abcd"}
        if {*chosen.values()} <= {*of_run}:
            weights = WEIGHTS[name].items()
            values.append(sum(weight * of_run[chosen[cell]] for cell, weight in weights) / 2)
    return values


@pytest.fixture(scope="module")
def effects(stored):
    return STUDY.tabulate_effects(STUDY.measure_runs(STUDY.stored(stored))).reset_index()


@pytest.mark.parametrize("name", WEIGHTS)
def test_effects_are_those_of_plain_arithmetic_on_the_rows(name, effects, rows):
    for noise in PROTOCOLS.NOISES:
        for settings, replaced in STUDY.SETTINGS.items():
            by_task = [
                statistics.mean(effect(rows, name, noise, f"{family}/v1/i00{k}", replaced))
                for family in ("one-armed", "two-armed") for k in (0, 1)
            ]  # fmt: skip
            due = {
                "random": statistics.mean(by_task),
                "one-armed": statistics.mean(by_task[:2]),
                "two-armed": statistics.mean(by_task[2:]),
                "ascending": statistics.mean(effect(rows, name, noise, "ascending", replaced)),
            }
            here = effects[(effects.motor_noise == noise) & (effects.settings == settings)]
            here = here[here.effect == name]
            found = here.set_index("group").points
            assert {group: found[group] for group in due} == pytest.approx(due)


def made_up(log=(0.0, 0.0, 0.0, 0.0), gaps=(0.0, 0.0, 0.0, 0.0)):
    """Runs on twelve tasks in both worlds, whose cells a to d have these values."""
    rng = np.random.default_rng(5)
    rows = [
        {"motor_noise": noise, "group": "long", "task": f"long/v1/i{task:03}", "run": 0,
         "cell": cell, "gap": g + rng.normal(0, 0.01), "log_ticks": x + rng.normal(0, 0.01)}
        for noise in PROTOCOLS.NOISES for task in range(12)
        for cell, g, x in zip("abcd", gaps, log, strict=True)
    ]  # fmt: skip
    return pd.DataFrame(rows)


def test_a_verdict_needs_the_same_sign_on_the_logarithm_of_ticks():
    verdicts = {}
    for sign in (1, -1):
        runs = made_up(log=(sign, sign, 0, 0), gaps=(5, 5, 0, 0))
        verdicts[sign] = STUDY.judge_claims(runs).verdict
    for world in STUDY.WORLDS.values():
        assert verdicts[1][f"method-{world}"] == "supported"
        assert verdicts[-1][f"method-{world}"] == "undecided"


def test_planted_effects_have_their_signs():
    """A learned spread gains 1 point in hill climbing and 4 in the policy gradient, which is 2.5
    points worse."""
    runs = made_up(log=(4, 3, 8, 4), gaps=(4, 3, 8, 4))
    verdicts = STUDY.judge_claims(runs).verdict
    for world in STUDY.WORLDS.values():
        assert verdicts[f"method-{world}"] == "not supported"
        assert verdicts[f"spread-{world}"] == "supported"
        assert verdicts[f"interaction-{world}"] == "supported"


def test_a_failed_run_has_twice_the_ticks_of_the_corrective_process(stored):
    runs = STUDY.stored(stored)
    runs.loc[runs.index[0], "status"] = "infeasible"
    runs.loc[runs.index[0], "value"] = np.nan
    first = STUDY.measure_runs(runs).iloc[0]
    ticks = -2 * first.corrective_best
    assert first.log_ticks == pytest.approx(100 * math.log(ticks))
    assert first.gap == pytest.approx(100 * (ticks / -first.best_known - 1))


def climb(model, trials):
    """The best reward and the last centre of a slow (1+1) climber that keeps targets."""
    session = Session(TASK, 3, KEEPS_TARGETS.KeepsTargets.information, model=model)
    first = session.trials(HANDS, np.full((1, session.goals_count, session.dof), np.nan))
    explored = np.tile(explored_joints(session), (session.goals_count, 1))
    centre, best = np.where(explored, first.reached[0], np.nan), first.rewards[0]
    for _ in range(trials - 1):
        targets = centre.copy()
        targets[explored] += 0.05 * session.rng.standard_normal(explored.sum())
        made = session.trials(HANDS, targets[None])
        if made.rewards[0] > best:
            best, centre = made.rewards[0], targets
    return best, centre


@pytest.mark.parametrize("model", [PAPER, NOISY], ids=["without noise", "with noise"])
def test_hill_climbing_keeps_the_targets_of_its_best_trial(model):
    method = KEEPS_TARGETS.KeepsTargets
    parameters = method.Parameters(trials=300, sequence=HANDS)
    result, session = run_method(method(parameters), TASK, 3, model=model)
    best, centre = climb(model, 300)
    assert max(reward for reward in session.rewards if reward is not None) == best
    if model is NOISY:
        targets = np.array([movement.target for movement in result.solution])
        np.testing.assert_array_equal(targets, centre)


def test_the_share_of_hands_is_that_of_plain_arithmetic():
    """Tasks, runs and gaps are made up; a policy gradient with another setting does not count."""
    runs = pd.DataFrame(
        {"motor_noise": 0.0, "task": f"long/v1/i00{task}", "run": run, "cell": cell, "gap": gap}
        for cell, gaps in {"learner": (40, 60, 20, 40), "d": (20, 40, 10, 10)}.items()
        for (task, run), gap in zip(((0, 0), (0, 1), (1, 0), (1, 1)), gaps, strict=True)
    )
    executions = pd.DataFrame(
        {"question": "practised", "target": "T", "method": "policy-gradient", "setting": setting,
         "motor_noise": noise, "task": f"long/v1/i00{task}", "ticks": ticks, "best_known": -100.0}
        for task, noise, setting, ticks in (
            (0, 0.0, None, 110), (1, 0.0, None, 105), (0, 0.01, None, 150),
            (0, 0.0, "spread=fixed", 190),
        )
    )  # fmt: skip
    table = STUDY.tabulate_hands(runs, executions)
    assert [*table.index] == ["0.0, two arms", "0.0, long"]
    row = table.loc["0.0, long"]
    assert (row.learner, row.given, row.own) == pytest.approx((40, 20, 7.5))
    assert row.share == pytest.approx((20 - 7.5) / (40 - 7.5))
