"""The paper's claims about two-armed task 1 (exploration conditions 2 to 4)."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import numpy as np

from analysis.claims.data import ONE, Data, MissingError, rewards_of
from analysis.claims.judges.hands import better_hands
from analysis.claims.judges.shares import (
    AS_OFTEN,
    MOST,
    NEARLY_ALL,
    as_often,
    nearly_all,
    not_nearly_all,
)
from analysis.claims.register import Claim, Finding
from analysis.comparisons.methods import LEARNER
from analysis.published import published_exhaustive, published_initial
from analysis.statistics.estimates import FEWEST, SEED, mean
from analysis.statistics.hypotheses import bootstrap_test
from analysis.words import interval, tally
from coartic.robot import Array

# Before learning


def _right_hand_better(data: Data) -> Finding:
    known = data.sequences(ONE)
    right, left = known.get("RRRR", math.nan), known.get("LLLL", math.nan)
    if math.isnan(right + left):
        raise MissingError("the corrective process alone has no reward with RRRR or LLLL")
    printed = published_initial(ONE)
    assert printed is not None
    return Finding(right > left, f"RRRR {right:.0f} (published {printed[1]}), LLLL {left:.0f}")


def _base_steps(start: Array, configurations: Array) -> Array:
    return np.diff(np.append(start[0], configurations[:, 0]))


def _initial_base_reverses(data: Data) -> Finding:
    steps = _base_steps(data.task(ONE).q0, data.initial(ONE).configurations)
    return Finding(
        bool(steps[0] < 0 and steps[2] < 0 < steps.sum()),
        f"base along x from goal to goal {', '.join(f'{step:+.2f}' for step in steps)}, in all "
        f"{steps.sum():+.2f}",
    )


# Exploration condition 2


def _ec2_sequences(data: Data) -> Finding:
    return as_often(data, ONE, "EC2", "RRLR")


def _ec2_rrlr_better(data: Data) -> Finding:
    return better_hands(data, ONE, "EC2", "RRLR", "RRRR")


def _no_reversal(data: Data) -> Finding:
    cell = data.cell(ONE, f"{LEARNER}EC2")
    runs = [run for run in cell.runs if run.execution.hands == "RRLR"]
    if not runs:
        raise MissingError(f"no run of EC2 on {ONE} learned RRLR, as in the figure")
    q0 = data.task(ONE).q0
    right = sum(bool((_base_steps(q0, r.execution.configurations) > 0).all()) for r in runs)
    initial = _base_steps(q0, data.initial(ONE).configurations)
    return Finding(
        bool(right == len(runs) and (initial < 0).any()),
        f"from goal to goal the base goes right only in {right} of {len(runs)} runs with RRLR; in "
        f"the initial solution by {', '.join(f'{step:+.2f}' for step in initial)}",
    )


def _ec2_improves(data: Data) -> Finding:
    replays = data.replays(ONE, "EC2", "RRRR")
    if len(replays) < FEWEST:
        raise MissingError(f"fewer than {FEWEST} runs of EC2 on {ONE} keep RRRR")
    initial = float(data.learned(ONE, "EC2", "RRRR").initial_reward.iloc[0])
    test = bootstrap_test(replays, initial, seed=SEED)
    return Finding(
        test.estimate > 0,
        f"noiseless replay of the {len(replays)} runs with RRRR: {initial:.0f} to "
        f"{interval(mean(replays, seed=SEED))}",
        (test,),
    )


def _ec2_unreliable(data: Data) -> Finding:
    found = Counter(data.learned(ONE, "EC2").hands)
    seen = not_nearly_all(found.total() - found["RRRR"], found.total())
    return replace(seen, evidence=f"RRRR is left in {seen.evidence}; {tally(found)}")


# Exploration conditions 3 and 4


def _lrlr_in_all(data: Data, condition: str) -> Finding:
    found = Counter(data.learned(ONE, condition).hands)
    seen = nearly_all(found["LRLR"], found.total())
    others = f"; {tally(found)}" if len(found) > 1 else ""
    return replace(seen, evidence=f"LRLR in {seen.evidence}{others}")


def _ec3_alternates(data: Data) -> Finding:
    return _lrlr_in_all(data, "EC3")


def _ec4_keeps_lrlr(data: Data) -> Finding:
    return _lrlr_in_all(data, "EC4")


def _ec3_better_than_ec2(data: Data) -> Finding:
    runs = data.learned(ONE, "EC2")
    groups = {str(h): rewards_of(g) for h, g in runs.groupby("hands") if len(g) >= FEWEST}
    if not groups:
        raise MissingError(f"no hand sequence that {FEWEST} runs of EC2 on {ONE} learned")
    hands = max(groups, key=lambda name: float(groups[name].mean()))
    rewards = data.rewards(ONE, "EC3")
    test = bootstrap_test(rewards, groups[hands], seed=SEED)
    return Finding(
        test.estimate > 0,
        f"EC3 {interval(mean(rewards, seed=SEED))}; best under EC2 {hands} "
        f"{interval(mean(groups[hands], seed=SEED))} in {len(groups[hands])} of {len(runs)} runs",
        (test,),
    )


def _ec3_as_exhaustive(data: Data) -> Finding:
    best, reward = data.best_sequences(ONE)
    found = Counter(data.learned(ONE, "EC3").hands)
    seen = nearly_all(sum(found[hands] for hands in best), found.total())
    text = f"exhaustive search finds {' and '.join(best)} ({reward:.0f}); EC3 the same in"
    return replace(seen, evidence=f"{text} {seen.evidence}")


def _ec3_beats_exhaustive(data: Data) -> Finding:
    rewards = data.rewards(ONE, "EC3")
    _, best = data.best_sequences(ONE)
    published = published_exhaustive(ONE)
    assert published is not None
    test = bootstrap_test(rewards, best, seed=SEED)
    return Finding(
        test.estimate > 0,
        f"{interval(mean(rewards, seed=SEED))} against {best:.0f} (published {published[1]})",
        (test,),
    )


_EC2 = "Results, Exploration Condition 2"
_EC3 = "Results, Exploration Condition 3"
_EC4 = "Results, Exploration Condition 4"

TWO_ARMED_1: tuple[Claim, ...] = (
    Claim(
        "right-hand-better",
        "In two-armed task 1 the right hand alone does better than the left hand alone, which is "
        "why the initial solution uses it.",
        "Two-armed tasks",
        "exact: reward of the corrective process alone",
        _right_hand_better,
        _EC2,
        "The configurations using just the right hand were more rewarding",
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "initial-base-reverses",
        "In the initial solution of two-armed task 1 the base moves left to hit goals 1 and 3 "
        "while its net movement is to the right.",
        "Two-armed tasks",
        "exact: base positions at the goals",
        _initial_base_reverses,
        _EC2,
        "the base of the robot moved to the left",
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "ec2-sequences",
        "In two-armed task 1, about half the runs under condition 2 find RRLR (11 of 20), the "
        "others keep RRRR.",
        "Two-armed tasks",
        f"{AS_OFTEN}; of RRLR",
        _ec2_sequences,
        _EC2,
        "The best hand recruitment sequence found after learning used the left",
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "ec2-rrlr-better",
        "In two-armed task 1, runs under condition 2 that find RRLR get more than those that keep "
        "RRRR.",
        "Two-armed tasks",
        "one-tailed bootstrap test of two samples",
        _ec2_rrlr_better,
        _EC2,
        "the learned solution continued to use just the right hand",
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "no-reversal",
        "In two-armed task 1 the base goes right only once RRLR is learned; before, it reverses.",
        "Two-armed tasks",
        "exact: base positions at the goals, runs under condition 2 that learned RRLR, initial "
        "solution",
        _no_reversal,
        _EC2,
        "in contrast to the initial solution, the base always moves",
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "ec2-improves",
        "In two-armed task 1, runs under condition 2 that keep the hands of the initial solution "
        "(RRRR) still improve on it.",
        "Two-armed tasks",
        "one-tailed bootstrap test of noiseless replays against the initial reward",
        _ec2_improves,
        _EC2,
        "Although it did improve performance",
        fitted=True,
    ),
    Claim(
        "ec2-unreliable",
        "In two-armed task 1, condition 2 does not reliably find better hands than RRRR within "
        "10 000 trials (nine of 20 runs do not).",
        "Two-armed tasks",
        f"exact binomial test that fewer than {NEARLY_ALL:.0%} of all runs leave RRRR",
        _ec2_unreliable,
        _EC2,
        "did not produce enough exploration to reliably find a better",
        fitted=True,
    ),
    Claim(
        "ec3-alternates",
        "In two-armed task 1, condition 3 alternates hands (LRLR) in every run.",
        "Two-armed tasks",
        MOST,
        _ec3_alternates,
        _EC3,
        "adopted the hand recruitment sequence of alternating hands",
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "ec3-better-than-ec2",
        "In two-armed task 1, the hands found under condition 3 are better than those found under "
        "condition 2.",
        "Two-armed tasks",
        "one-tailed bootstrap test against the runs of condition 2 with its best hand sequence "
        f"(by mean reward, at least {FEWEST} runs)",
        _ec3_better_than_ec2,
        _EC3,
        "a hand recruitment sequence that is better than that found under",
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "ec3-as-exhaustive",
        "In two-armed task 1, condition 3 finds the hands that are best among all sequences with "
        "the corrective process alone.",
        "Two-armed tasks",
        MOST,
        _ec3_as_exhaustive,
        _EC3,
        "produced the same hand recruitment sequence as would DASel alone",
        fitted=True,
    ),
    Claim(
        "ec3-beats-exhaustive",
        "In two-armed task 1, condition 3 is better than trying every hand sequence with the "
        "corrective process alone.",
        "Two-armed tasks",
        "one-tailed bootstrap test against the best corrective-only reward",
        _ec3_beats_exhaustive,
        _EC3,
        "the overall performance with exploration at AModChosen and DASel was better",
        fitted=True,
    ),
    Claim(
        "ec4-keeps-lrlr",
        "In two-armed task 1, condition 4 keeps the hands of condition 3 (LRLR).",
        "Two-armed tasks",
        MOST,
        _ec4_keeps_lrlr,
        _EC4,
        "remained the same as that found under exploration condition 3",
        "Figure 8",
        fitted=True,
    ),
)
