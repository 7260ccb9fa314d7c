"""The paper's claims about two-armed tasks 1 and 2."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import numpy as np

from analysis.claims.data import ONE, TWO, Data, MissingError, rewards_of
from analysis.claims.judges.hands import (
    AS_OFTEN,
    MOST,
    NEARLY_ALL,
    as_often,
    better_hands,
    nearly_all,
)
from analysis.claims.register import Finding
from analysis.claims.statements import decides
from analysis.methods import LEARNER
from analysis.published import published_exhaustive, published_initial
from analysis.statistics.estimates import FEWEST, SEED, mean
from analysis.statistics.hypotheses import bootstrap_test
from analysis.words import interval, tally
from coartic.robot import Array

# Two-armed task 1: before learning


@decides("right-hand-better", "exact: reward of the corrective process alone")
def _right_hand_better(data: Data) -> Finding:
    known = data.sequences(ONE)
    right, left = (known.get(hands, math.nan) for hands in ("RRRR", "LLLL"))
    if math.isnan(right + left):
        raise MissingError("the corrective process alone has no reward with RRRR or LLLL")
    printed = published_initial(ONE)
    assert printed is not None
    return Finding(right > left, f"RRRR {right:.0f} (published {printed[1]}), LLLL {left:.0f}")


def _base_steps(start: Array, configurations: Array) -> Array:
    return np.diff(np.append(start[0], configurations[:, 0]))


@decides("initial-base-reverses", "exact: base positions at the goals")
def _initial_base_reverses(data: Data) -> Finding:
    steps = _base_steps(data.task(ONE).q0, data.initial(ONE).configurations)
    return Finding(
        bool(steps[0] < 0 and steps[2] < 0 < steps.sum()),
        f"base along x from goal to goal {', '.join(f'{step:+.2f}' for step in steps)}, in all "
        f"{steps.sum():+.2f}",
    )


# Two-armed task 1: exploration condition 2


@decides("ec2-sequences", f"{AS_OFTEN}; of RRLR")
def _ec2_sequences(data: Data) -> Finding:
    return as_often(data, ONE, "EC2", "RRLR")


@decides("ec2-rrlr-better", "one-tailed bootstrap test of two samples")
def _ec2_rrlr_better(data: Data) -> Finding:
    return better_hands(data, ONE, "EC2", "RRLR", "RRRR")


@decides(
    "no-reversal",
    "exact: base positions at the goals, runs under condition 2 that learned RRLR, initial "
    "solution",
)
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


@decides(
    "ec2-improves",
    "one-tailed bootstrap test of noiseless replays against the initial reward",
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


@decides(
    "ec2-unreliable",
    f"exact binomial test that fewer than {NEARLY_ALL:.0%} of all runs leave RRRR",
)
def _ec2_unreliable(data: Data) -> Finding:
    found = Counter(data.learned(ONE, "EC2").hands)
    seen = nearly_all(found.total() - found["RRRR"], found.total(), "less")
    return replace(seen, evidence=f"RRRR is left in {seen.evidence}; {tally(found)}")


# Two-armed task 1: exploration conditions 3 and 4


def _lrlr_in_all(data: Data, condition: str) -> Finding:
    found = Counter(data.learned(ONE, condition).hands)
    seen = nearly_all(found["LRLR"], found.total())
    others = f"; {tally(found)}" if len(found) > 1 else ""
    return replace(seen, evidence=f"LRLR in {seen.evidence}{others}")


@decides("ec3-alternates", MOST)
def _ec3_alternates(data: Data) -> Finding:
    return _lrlr_in_all(data, "EC3")


@decides("ec4-keeps-lrlr", MOST)
def _ec4_keeps_lrlr(data: Data) -> Finding:
    return _lrlr_in_all(data, "EC4")


@decides(
    "ec3-better-than-ec2",
    "one-tailed bootstrap test against the runs of condition 2 with its best hand sequence "
    f"(by mean reward, at least {FEWEST} runs)",
)
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


@decides("ec3-as-exhaustive", MOST)
def _ec3_as_exhaustive(data: Data) -> Finding:
    best, reward = data.best_sequences(ONE)
    found = Counter(data.learned(ONE, "EC3").hands)
    seen = nearly_all(sum(found[hands] for hands in best), found.total())
    text = f"exhaustive search finds {' and '.join(best)} ({reward:.0f}); EC3 the same in"
    return replace(seen, evidence=f"{text} {seen.evidence}")


@decides(
    "ec3-beats-exhaustive",
    "one-tailed bootstrap test against the best corrective-only reward",
)
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


# Two-armed task 2


@decides("best-is-rrrr", "exact: rewards of all hand sequences; a tie leaves it open")
def _best_is_rrrr(data: Data) -> Finding:
    best, reward = data.best_sequences(TWO)
    printed = published_exhaustive(TWO)
    assert printed is not None
    shown = f"{' and '.join(best)} {reward:.0f} (published {printed[0]} {printed[1]})"
    text = f"best of the corrective process alone: {shown}"
    if "RRRR" not in best:
        return Finding(False, text)
    return Finding(True, text) if len(best) == 1 else Finding(None, f"{text}: a tie")


@decides("half-choose-rlrr", f"{AS_OFTEN}; of RLRR")
def _half_choose_rlrr(data: Data) -> Finding:
    return as_often(data, TWO, "EC3", "RLRR")


@decides(
    "ec3-departs",
    "exact: runs with a hand sequence that is not among the best of the corrective process",
)
def _ec3_departs(data: Data) -> Finding:
    best, reward = data.best_sequences(TWO)
    found = Counter(data.learned(TWO, "EC3").hands)
    away = sum(count for hands, count in found.items() if hands not in best)
    text = (
        f"{tally(found)}; best of the corrective process alone {' and '.join(best)} "
        f"({reward:.0f}): {away} of {found.total()} runs depart from it"
    )
    if away:
        return Finding(True, text)
    if len(best) > 1:
        return Finding(None, f"{text}. With a tie, to choose among the best is no departure")
    return Finding(False, text)


@decides("rlrr-better", "one-tailed bootstrap test of two samples")
def _rlrr_better(data: Data) -> Finding:
    return better_hands(data, TWO, "EC3", "RLRR", "RRRR")


@decides("ec4-mixed", "exact: more than one hand sequence")
def _ec4_mixed(data: Data) -> Finding:
    found = Counter(data.learned(TWO, "EC4").hands)
    return Finding(len(found) > 1, f"{tally(found)} of {found.total()} runs")
