"""The search for what the paper does not print (docs/scripts): its command, scores, likelihoods."""

from __future__ import annotations

import itertools
import math
import runpy
import sys
from dataclasses import replace
from pathlib import Path

import calibrate
import numpy as np
import pandas as pd
import pytest
from reconstruction import layouts, readings, scoring
from reconstruction.search import search_for
from scipy import stats

from coartic import PAPER, CoarticError, corrective_trial, hand_sequences, load_task
from coartic.motion.sequences import CorrectiveTrials, corrective_trials

SCRIPTS = Path(__file__).parent.parent / "docs" / "scripts"
TASK = load_task("two-armed-1")


def runs(rewards: np.ndarray, *hands: tuple[str, int]) -> pd.DataFrame:
    """Runs with these rewards, so many of them with each hand sequence."""
    names = [name for name, count in hands for _ in range(count)] or ["LRLR"] * len(rewards)
    hands = pd.Series(names, dtype=object)
    return pd.DataFrame({"reward": np.array(rewards, float), "hands": hands})


def test_trials_are_those_that_are_made_one_by_one() -> None:
    rng = np.random.default_rng(1)
    goals = TASK.goal_array + rng.uniform(-0.4, 0.4, (3, 4, 2))
    goals[1, :2] = goals[0, :2]  # begins as the one before
    model = PAPER._replace(max_iterations=300)  # some fail
    sequences = hand_sequences(TASK)
    together = corrective_trials(TASK, sequences, goals, model=model)
    failed = 0
    for (n, places), (s, hands) in itertools.product(enumerate(goals), enumerate(sequences)):
        moved = TASK.model_copy(update={"goals": tuple(map(tuple, places.tolist()))})
        alone = corrective_trial(moved, hands, model=model)
        if not alone.completed:
            failed += 1
            assert math.isnan(together.rewards[n, s])
            assert np.isnan(together.reached[n, s, -1]).all()
            continue
        assert together.rewards[n, s] == alone.reward
        np.testing.assert_array_equal(together.reached[n, s], alone.configurations)
    assert 0 < failed < len(goals) * len(sequences)


def test_constraints() -> None:
    rewards = np.array([[-675.0, -700.0], [-675.0, -675.0], [-674.0, np.nan]])
    reached = np.zeros((3, 2, 4, 10))
    reached[:, 0, :, 0] = [[-1, 1, 0, 2], [-1, -2, 0, 2], [0.5, 1, 2, -1]]
    trials = CorrectiveTrials(rewards, reached)
    for constraint, expected in (
        (layouts.reward_is("RRRR", -675.0), [True, True, False]),
        (layouts.reward_is("RRRR", -674.0, within=1.0), [True, True, True]),
        (layouts.earns_more("RRRR", ["LLLL"]), [True, False, True]),
        (layouts.base_moves("RRRR", 0, 1, "left", 0.0), [True, True, False]),
        (layouts.base_moves("RRRR", 2, 3, "left", 0.0), [True, False, False]),
        (layouts.base_moves("RRRR", 0, 4, "right", 0.0), [True, True, False]),
    ):
        assert constraint.holds(trials).tolist() == expected, constraint.says


def test_a_quick_search_gives_what_is_printed(tmp_path, monkeypatch):
    """Sets of goals with the printed rewards of the corrective process, and how far each is."""
    command = ["reconstruct.py", "goals", "two-armed-1", "--quick", "--out", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", [*command, "--jobs", "2"])
    runpy.run_path(str(SCRIPTS / "reconstruct.py"), run_name="__main__")
    members = pd.read_csv(tmp_path / "out" / "two-armed-1-members.csv")
    earlier = list(layouts.layouts()["two-armed-1"].earlier)
    ours = len(members) - len(earlier)
    assert ours in (4, 5)  # four that are spread, and the nearest where it is none of them
    names = [f"m{k:03d}" for k in range(1, ours + 1)]
    assert members.member.tolist() == [*names, *earlier]
    goals = [members[[f"x{g}", f"y{g}"]].to_numpy() for g in range(1, 5)]
    for places in np.stack(goals, axis=1)[:ours]:
        task = TASK.model_copy(update={"goals": tuple(map(tuple, places.tolist()))})
        assert corrective_trial(task, "RRRR").reward == -675
        assert corrective_trial(task, "LRLR").reward == -532
    labels = [test.label for test in scoring.printed_tests("two-armed-1")]
    off = members[[f"{label}, distance" for label in labels]].abs().clip(upper=5.0).fillna(5.0)
    np.testing.assert_allclose(members.distance, np.sqrt((off**2).mean(axis=1)), atol=0.01)
    tried = pd.read_csv(tmp_path / "out" / "two-armed-1-tried.csv", index_col="stage")
    assert tried.loc["round sets of goals"].item() <= 3**6


def test_a_grid_holds_what_the_layout_allows() -> None:
    layout = layouts.Layout(
        (("x", "y"), ("x", "z")), dict.fromkeys("xyz", (0.0, 1.0, 0.5)), (("z", "y", 0.5),)
    )
    points = np.concatenate(list(layout.blocks(5)))
    wide = np.concatenate(list(replace(layout, apart=0.6).blocks(5)))
    assert (wide[:, 1] - wide[:, 2] == 1.0).all()
    assert len(wide) == 3
    expected = [p for p in itertools.product((0, 0.5, 1), repeat=3) if p[2] + 0.5 <= p[1]]
    np.testing.assert_array_equal(points, expected)
    np.testing.assert_array_equal(layout.places(points)[:, 1], points[:, [0, 2]])
    np.testing.assert_array_equal(layout.points(layout.places(points)), points)


@pytest.mark.parametrize("kind", ["mean", "sd", "share"])
def test_distances_are_in_standard_errors(kind: str) -> None:
    """Of figures of 20 runs of the same kind; with 2 SDs more they are far off."""
    rng = np.random.default_rng(3)
    hands = np.where(np.arange(400) < 240, "LRLR", "RRRR").astype(object)
    ours = runs(rng.normal(-500.0, 3.0, 400)).assign(hands=hands)
    distances = []
    for _ in range(300):
        sample = rng.normal(-500.0, 3.0, 20)
        sd = sample.std(ddof=1)
        value = {"mean": sample.mean(), "sd": sd, "share": rng.binomial(20, 0.6) / 20}[kind]
        name = "LRLR" if kind == "share" else None
        figure = scoring.Figure("EC3", kind, value, 20, name, sd, digits=1)
        distances.append(figure.compare({"EC3": ours})[1])
    assert np.std(distances) == pytest.approx(1.0, abs=0.15)
    assert abs(np.mean(distances)) < 0.3
    other = ours.assign(reward=-500.0 + 3.0 * (ours.reward + 500.0) + 6.0, hands="RRRR")
    assert abs(figure.compare({"EC3": other})[1]) > 3.0


def test_an_order_is_as_clear_as_its_printed_test() -> None:
    """With a printed p, the test of as many runs as are printed has to be so clear on average."""
    rewards = np.random.default_rng(0).normal(-500.0, 3.0, 400)
    cells = {"EC3": runs(rewards), "EC4": runs(rewards + 5.0), "near": runs(rewards + 1.0)}
    error = math.sqrt(2 * rewards.var(ddof=1) / 20)
    for above, p, expected in (
        ("EC4", None, 0.0),
        ("EC4", 0.01, 0.0),  # z = 5 / error = 5.3
        ("near", None, 0.0),
        ("near", 0.01, 1.0 / error - stats.norm.isf(0.01)),
    ):
        difference, off = scoring.Order(above, "EC3", p_below=p).compare(cells)
        assert difference == pytest.approx(5.0 if above == "EC4" else 1.0)
        assert off == pytest.approx(expected / math.sqrt(1 + 20 / 400), abs=1e-3)
    assert scoring.Order("EC3", "EC4").compare(cells)[1] < -5.0


def test_a_sequence_that_is_lost_is_as_bad_as_one_far_off() -> None:
    cells = {"EC3": runs(np.linspace(-503.0, -497.0, 400), ("LRLR", 300), ("RRRR", 100))}
    share = scoring.Figure("EC3", "share", 0.75, 20, "LRLR")
    absent = scoring.Figure("EC3", "mean", -502.0, 20, "LLLL", 3.0)
    far = scoring.Figure("EC3", "mean", -900.0, 20, "LRLR", 3.0)

    def distance(*tests: scoring.Figure) -> float:
        return scoring.distance(scoring.compare(tests, cells))

    assert share.compare(cells) == (0.75, 0.0)
    assert distance(far) == distance(absent) == scoring.FARTHEST
    assert distance(absent, share) == pytest.approx(scoring.FARTHEST / math.sqrt(2))
    # What follows from other figures is shown and not counted.
    assert distance(replace(far, counted=False), share) == 0.0


def test_chance_of_printed_counts_is_multinomial() -> None:
    cell = runs(np.zeros(40), ("RRRR", 10), ("RLRR", 30))
    printed = [scoring.Figure("EC3", "share", 0.5, 4, hands) for hands in ("RRRR", "RLRR")]
    (counts,) = readings.likelihoods(printed, cell)
    model = stats.multinomial(4, np.array([10.5, 30.5, 0.5]) / 41.5)
    assert counts.log_chance == pytest.approx(float(model.logpmf([2, 2, 0])))
    every = [c for c in itertools.product(range(5), repeat=3) if sum(c) == 4]
    chances = np.array([model.pmf(c) for c in every])
    exact = chances[chances <= model.pmf([2, 2, 0]) + 1e-12].sum()
    assert counts.p == pytest.approx(exact, abs=0.01)


def test_what_comes_from_a_reading_is_not_refuted_by_it() -> None:
    """Figures of 20 of a reading's own runs: p is uniform. Of others it is small."""
    rng = np.random.default_rng(0)
    of_reading = runs(rng.normal(-300.0, 3.0, 1000))

    def p(rewards: np.ndarray) -> float:
        mean, sd = round(float(rewards.mean())), round(float(rewards.std(ddof=1)), 1)
        figures = [
            scoring.Figure("EC1", "mean", mean, 20, sd=sd),
            scoring.Figure("EC1", "sd", sd, 20, digits=1),
        ]
        return readings.together(readings.likelihoods(figures, of_reading)).p

    same = [p(rng.normal(-300.0, 3.0, 20)) for _ in range(24)]
    assert stats.kstest(same, "uniform").pvalue > 0.01
    assert max(p(rng.normal(-305.0, 3.0, 20)) for _ in range(3)) < 0.01


def test_a_chance_is_that_of_the_rounded_figures() -> None:
    """As counted among many samples, and certain where all runs are equal."""
    rng = np.random.default_rng(1)
    rewards = np.round(rng.normal(-300.0, 3.0, 1000))
    figures = [
        scoring.Figure("EC1", "mean", -301.0, 20),
        scoring.Figure("EC1", "sd", 2.9, 20, digits=1),
    ]
    (part,) = readings.likelihoods(figures, runs(rewards))
    drawn = rng.choice(rewards, (60_000, 20))
    alike = (np.round(drawn.mean(axis=1)) == -301) & (np.round(drawn.std(axis=1, ddof=1), 1) == 2.9)
    assert math.exp(part.log_chance) == pytest.approx(alike.mean(), rel=0.2)
    (part,) = readings.likelihoods(figures[:1], runs(np.full(100, -301.0)))
    assert math.exp(part.log_chance) == pytest.approx(1.0, abs=0.1)
    failing = pd.concat([runs(rewards), runs(np.full(1000, math.nan))])
    assert readings.together(readings.likelihoods(figures, failing)).p < 1e-3


def test_a_gain_is_as_likely_as_its_rounding_allows() -> None:
    """A mean that rounds to -303 and a gain of 16 over -319: certain; of 17 over it: hardly."""
    mean = scoring.Figure("EC1", "mean", -303.0, 20)
    assert readings.likelihood_of_gain(16.0, -319.0, mean) == []
    (border,) = readings.likelihood_of_gain(17.0, -319.0, mean)
    assert border.p == 1 / 20  # exactly -302.5
    (never,) = readings.likelihood_of_gain(18.0, -319.0, mean)
    assert never.p < 1e-6


def test_what_is_printed_is_what_is_searched_for() -> None:
    constraints = {constraint.says for constraint in search_for("two-armed-1").constraints}
    assert {"RRRR gives -675", "LRLR gives -532", "RRRR earns more than LLLL"} < constraints
    tests = scoring.printed_tests("two-armed-2")
    assert len({test.label for test in tests}) == len(tests) == 10
    # All 20 runs have what their parts have.
    assert [test.label for test in tests if not test.counted] == ["EC3 mean", "EC3 sd"]
    assert all(test.counted for test in scoring.printed_tests("two-armed-1"))
    assert [test.p_below for test in tests if isinstance(test, scoring.Order)] == [0.01, 0.01]
    with pytest.raises(CoarticError, match="prints the goals of task 'ascending'"):
        search_for("ascending")


def test_procedures_are_calibrated_on_samples_with_a_known_truth() -> None:
    """One sample of each kind; of an interval around 5 instead of -300 nothing holds."""
    rng, draw = np.random.default_rng(0), calibrate.POPULATIONS["ticks"]
    seen = calibrate.of_rewards(rng, draw, 20, -300.0)
    assert seen["interval of a mean (Student)"]
    assert not calibrate.of_rewards(rng, draw, 20, 5.0)["interval of a mean (Student)"]
    seen |= calibrate.of_counts(rng, 20) | calibrate.of_postures(rng, 20)
    seen |= calibrate.of_instances(rng, 20)
    assert len(seen) == 13
