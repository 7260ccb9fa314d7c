"""Scores and profiles over tasks, by hand and against scipy."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from coartic.analysis.comparisons.overall import by_task, normalised_scores, profiles
from coartic.analysis.statistics import across_tasks
from tests.support.made_up import MadeUp, fake_results, made_up_optima


def test_normalised_scores_and_gaps():
    assert across_tasks.normalised([-319, -292, -305.5], -319, -292).tolist() == [0, 1, 0.5]
    assert across_tasks.gap_share([-300, -303], -300).tolist() == [0, 0.01]
    with pytest.raises(ValueError, match="not above"):
        across_tasks.normalised([-1.0], -300, -300)


def test_scores_of_a_results_folder(tmp_path):
    """The initial solution of two-armed-1 is among its sequences."""
    runs = {
        "run": [0, 1], "seed": [7, 8], "status": ["ok", "infeasible"], "reason": ["", "planted"],
        "reward": [-520, None], "hands": ["RRLR", None], "initial_reward": [-671, None],
    }  # fmt: skip
    results = fake_results(tmp_path, runs)
    sequences = pd.DataFrame({"hands": ["LRLR", "RRRR"], "reward": [-533, -671]})
    sequences = sequences.assign(task="two-armed-1", reason="")
    optima = made_up_optima("two-armed-1")
    study = MadeUp(replace(results, sequences=sequences), optima=optima)
    scores = normalised_scores(study)
    optimum = optima["two-armed-1", "free"].reward
    first = scores.iloc[0]
    assert (first.task, first.method, first.seed) == ("two-armed-1", "dual-process/EC2", 7)
    assert first.score == pytest.approx((671 - 520) / (671 + optimum))
    assert first.gap == pytest.approx((optimum + 520) / -optimum)
    assert scores[["reward", "score", "gap"]].iloc[1].isna().all()
    values = by_task(scores, "dual-process/EC2", "gap")["two-armed-1"]
    assert values == pytest.approx([first.gap, math.nan], nan_ok=True)
    missed = {("two-armed-1", "free"): replace(optima["two-armed-1", "free"], reward=-680)}
    assert normalised_scores(MadeUp(study.results, optima=missed)).empty  # below the initial one
    without_sequences = MadeUp(results, optima=optima)  # hence without an initial solution
    assert normalised_scores(without_sequences).empty


def test_interquartile_mean_over_equal_tasks_is_of_all_runs():
    rng = np.random.default_rng(30)
    scores = {task: rng.gamma(2, size=20) for task in "abcd"}
    found = across_tasks.interquartile_mean(scores, seed=1)
    together = np.concatenate(list(scores.values()))
    assert found.estimate == pytest.approx(stats.trim_mean(together, 0.25))
    assert found.low < found.estimate < found.high
    assert found.n == (20, 20, 20, 20)


def test_strata_are_resampled_within_themselves():
    """Tasks far apart add no width; with 20 constant runs each there is none at all."""
    rng = np.random.default_rng(31)
    runs = rng.normal(0, 1, (4, 20))
    together = across_tasks.interquartile_mean(dict(zip("abcd", runs, strict=True)), seed=1)
    apart = {task: 100 * i + runs[i] for i, task in enumerate("abcd")}
    found = across_tasks.interquartile_mean(apart, seed=1)
    middle = np.concatenate([apart["b"], apart["c"]])
    assert found.estimate == pytest.approx(middle.mean())
    assert found.high - found.low < 2 * (together.high - together.low)
    error = math.sqrt(runs[1].var() / 20 + runs[2].var() / 20) / 2
    assert found.high - found.low == pytest.approx(2 * 1.96 * error, rel=0.1)


def test_tasks_with_fewer_runs_count_as_much():
    scores = {"a": [1.0] * 4, "b": [5.0] * 40}
    found = across_tasks.interquartile_mean(scores, seed=1)
    assert found.estimate == pytest.approx(3.0)
    uneven = {"a": [1.0, 2, 3, 4], "b": [5.0] * 20 + [6.0] * 20}
    repeated = np.concatenate([np.repeat(uneven["a"], 10), uneven["b"]])
    found = across_tasks.interquartile_mean(uneven, seed=1)
    assert found.estimate == pytest.approx(stats.trim_mean(repeated, 0.25))
    assert found.low < found.estimate < found.high


def test_deterministic_methods_have_no_interval():
    found = across_tasks.interquartile_mean({"a": [0.9], "b": [0.8]}, seed=1)
    assert found.estimate == pytest.approx(0.85)
    assert math.isnan(found.low)
    with pytest.raises(ValueError, match="finite"):
        across_tasks.interquartile_mean({"a": [0.9, math.nan]}, seed=1)


def test_profile_by_hand():
    gaps = {"a": [0.0, 0.01, 0.05, math.nan], "b": [0.02, 0.02]}
    found = across_tasks.profile(gaps, [0.0, 0.01, 0.02, 1.0], "at most", seed=1)
    assert found.share.tolist() == [0.125, 0.25, 0.75, 0.875]
    scores = {"a": [0.0, 0.5, 1.0, math.nan]}
    found = across_tasks.profile(scores, [-1.0, 0.0, 0.5, 1.0], "above", seed=1)
    assert found.share.tolist() == [0.75, 0.5, 0.25, 0.0]
    for wrong in ({}, {"a": []}):
        with pytest.raises(ValueError, match="at least one"):
            across_tasks.profile(wrong, [0.0], "above", seed=1)


def test_profile_intervals_of_one_task_are_binomial():
    """A resample reaches a threshold as often as a binomial with the sample's share says."""
    values = np.arange(20.0)
    found = across_tasks.profile({"a": values}, [5, 9], "at most", seed=1, resamples=20_000)
    for i, share in enumerate((0.3, 0.5)):
        low, high = stats.binom.ppf([0.025, 0.975], 20, share) / 20
        assert (found.low[i], found.high[i]) == pytest.approx((low, high), abs=1e-9)


def test_profiles_never_turn_back():
    rng = np.random.default_rng(33)
    gaps = {task: rng.gamma(1, 0.02, 20) for task in "abcd"}
    found = across_tasks.profile(gaps, np.linspace(0, 0.1, 50), "at most", seed=1)
    for line in (found.share, found.low, found.high):
        assert (np.diff(line) >= -1e-12).all()
    assert (found.low <= found.share + 1e-12).all()
    assert (found.share <= found.high + 1e-12).all()


def test_profiles_of_scores_count_what_is_above():
    """Thresholds met exactly tell "above" from "at least", and either from "at most"."""
    scores = pd.DataFrame(
        [
            {"task": task, "method": "m", "score": score, "gap": gap}
            for task in "ab"
            for score, gap in ((0.0, 0.4), (0.5, 0.1), (0.5, 0.1), (1.0, 0.0))
        ]
    )
    shares = profiles(scores).set_index(["kind", "threshold"]).share
    for threshold, share in ((-0.02, 1.0), (0.0, 0.75), (0.5, 0.25), (1.0, 0.0)):
        assert shares.loc["score", threshold] == share
    for threshold, share in ((0.0, 0.25), (0.1, 0.75), (0.395, 0.75), (0.4, 1.0)):
        assert shares.loc["gap", threshold] == share
