"""The dial: gains, and verdicts, of planted runs."""

import numpy as np
import pandas as pd
import pytest

from coartic import corrective_trial, hand_sequences, load_task
from coartic.analysis import ranking, runtimes, shares
from common import judging
from tests.support.made_up import study_of_rewards
from tests.support.processes import programs

STUDY, PROTOCOLS, SHIFTS = programs("dial", "study", "protocols", "shifts")


def planted(gains, quarters=None):
    """Stored runs with gains after 100 and 10,000 trials by setting, in per cent, on 12 instances
    of each family; the paths from -600 to -500."""
    rows = []
    for setting in PROTOCOLS.SETTINGS:
        early, late = gains.get(setting, (20, 40))
        for family in STUDY.FAMILIES:
            for number in range(12):
                off = number % 4 - 1.5
                rewards = dict(zip(
                    (f"reward_{n}" for n in PROTOCOLS.AFTER),
                    (-600, -600 + early + off, -600 + early + off, -600 + late + off), strict=True,
                ))  # fmt: skip
                rows.append({
                    "task": f"{family}/v1/i{number:03d}", "family": family, "setting": setting,
                    "run": 0, "corrective_best": -600, "best_known": -500, **rewards,
                    "quarter": (quarters or {}).get(setting, 1000) + number, "half": np.inf,
                })  # fmt: skip
    return STUDY.measure_runs(pd.DataFrame(rows))


@pytest.fixture(autouse=True)
def _fewer_resamples(monkeypatch):
    monkeypatch.setattr(judging, "RESAMPLES_OF_CLAIMS", 1_999)


def verdicts(*arguments):
    return STUDY.judge_claims(planted(*arguments)).verdict


def test_gains_are_shares_of_the_way_to_the_best_known():
    runs = planted({"0 0.05": (30, 70)})
    paper = runs[(runs.setting == "0 0.05") & (runs.task == "long/v1/i000")].iloc[0]
    assert (paper.gain_30, paper.gain_100, paper.gain_10000) == (0, 28.5, 68.5)
    assert (paper.log_quarter, paper.log_half) == (3, 4)  # a run that does not come there: all
    nothing = STUDY.measure_runs(runs.assign(best_known=-600))
    assert nothing.gain_100.isna().all()


def test_verdicts_follow_the_gains():
    informed, planner, wrong = "0.3 0.05 next-goal", "1 0.01 next-goal", "1 0.05 start"
    gains = {informed: (60, 80), "correction": (25, 40), wrong: (20, 10), "drawn": (58, 80)}
    less = {informed: (60, 80), "correction": (55, 40), wrong: (20, 60), "drawn": (52, 80)}
    claims = [
        *("information-in-correction-brings-little", "information-makes-quick"),
        *("wrong-information-harms", "drawn-drift-is-as-good"),
    ]
    much = "information-in-exploration-brings-much"
    assert verdicts(gains, {planner: 20})[[*claims, much]].eq("supported").all()
    assert verdicts(less, {planner: 900})[claims].eq("not supported").all()
    assert verdicts({informed: (10, 80)})[much] == "not supported"


def test_a_task_is_run_under_every_setting(monkeypatch):
    """The learner's own runs; fields of hands are left out with one arm."""
    for name, value in (("TRIALS", 40), ("FEW", 40), ("AFTER", (5, 10, 20, 40)), ("RUNS", 2)):
        monkeypatch.setattr(PROTOCOLS, name, value)
    rows = pd.DataFrame(PROTOCOLS.run_task("ascending"), columns=[
        "task", "family", "setting", "run", "corrective_best", "best_known", *"abcd",
        "quarter", "half",
    ])  # fmt: skip
    assert rows.groupby("setting").size().eq(2).all()
    assert {*rows.setting} == {*PROTOCOLS.SETTINGS}
    assert (rows.a <= rows.b).all()
    assert (rows.c <= rows.d).all()
    assert (rows.d <= rows.best_known).all()
    half = rows[rows.half < np.inf]
    assert (half.d >= (half.corrective_best + half.best_known) / 2).all()


def test_the_corrective_process_with_its_best_hands_gains_nothing():
    """Shares, targets, ranking and the dial have one zero, whatever the initial hands."""
    task = load_task("two-armed-1")
    best = max(corrective_trial(task, hands).reward for hands in hand_sequences(task))
    assert best > corrective_trial(task, task.initial_hands).reward
    start, best_known = PROTOCOLS.span_of(task)
    assert start == best
    alone = "corrective-alone/best-hands"
    seen = study_of_rewards({(task.name, alone): [best], (task.name, "mine"): [best_known]})
    row = seen.runs[seen.runs.method == alone]
    assert shares(row).tolist() == [0]
    assert ranking(row).share.tolist() == [0]
    curve = runtimes(seen)
    assert curve[(curve.method == alone) & (curve.spend == "trials")].share.tolist() == [0]


def planted_shifts(settings):
    """Stored shifts of 12 tasks of two families: half of the shift after the trials that a setting
    takes, its share after ten, and all of it in the end."""
    rows = []
    for setting, (trials, ten) in settings.items():
        for task in (f"{family}/v1/i{n:03d}" for family in STUDY.FAMILIES[:2] for n in range(12)):
            shares = {n: 0.0 if n < trials else 0.5 for n in SHIFTS.SHIFT_AFTER}
            shares |= {10: ten + int(task[-2:]) / 1000, 10_000: 1.0}
            for square in (1.0, 3.0):  # two goals
                dots = {f"dot_{n}": square * share for n, share in shares.items()}
                rows.append(
                    {"task": task, "setting": setting, "goal": 0, "same": 0.1, "square": square}
                    | dots
                )
    return SHIFTS.measure_shifts(pd.DataFrame(rows))


def test_verdicts_follow_the_shifts():
    shifts = planted_shifts({"0 0.05": (1000, 0.0), "1 0.01 next-goal": (30, 0.2)})
    of_paper, of_planner = (shifts[shifts.setting == s].iloc[0] for s in shifts.setting.unique())
    assert (of_paper.log_half, of_paper.unchanged) == (3, 0.05)
    assert of_planner.log_half == pytest.approx(np.log10(30))
    assert SHIFTS.judge_shifts(shifts).verdict.eq("supported").all()
    slow = planted_shifts({"0 0.05": (300, 0.0), "1 0.01 next-goal": (300, 0.0)})
    judged = SHIFTS.judge_shifts(slow).verdict
    assert judged["drift-makes-the-shift-quick"] == "not supported"
    assert judged["drift-shifts-within-ten-trials"] == "not supported"
