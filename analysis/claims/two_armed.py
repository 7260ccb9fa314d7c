"""The paper's claims about two-armed tasks 1 and 2."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy import stats

from analysis.claims.data import ONE, TWO, Data, MissingError, rewards_of
from analysis.claims.evidence import all_hold, exceeds, shown
from analysis.claims.register import Finding
from analysis.claims.statements import decides
from analysis.methods import LEARNER
from analysis.published import published_exhaustive, published_initial
from analysis.statistics.estimates import (
    FEWEST,
    SEED,
    Inference,
    difference_of_means,
    probability_of_improvement,
)
from analysis.words import interval, tally
from coartic.robot import Array

# Two-armed task 1: before learning


@decides("right-hand-better")
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


@decides("initial-base-reverses")
def _initial_base_reverses(data: Data) -> Finding:
    steps = _base_steps(data.task(ONE).q0, data.initial(ONE).configurations)
    return Finding(
        bool(steps[0] < 0 and steps[2] < 0 < steps.sum()),
        f"base along x from goal to goal {', '.join(f'{step:+.2f}' for step in steps)}, in all "
        f"{steps.sum():+.2f}",
    )


# Two-armed task 1: exploration condition 2


@decides("no-reversal")
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


@decides("ec2-improves")
def _ec2_improves(data: Data) -> Finding:
    replays = data.replays(ONE, "EC2", "RRRR")
    if len(replays) < FEWEST:
        raise MissingError(f"fewer than {FEWEST} runs of EC2 on {ONE} keep RRRR")
    initial = data.initial_reward(ONE, "EC2", "RRRR")
    text = f"noiseless replay of the {len(replays)} runs with RRRR: {initial:.0f} to"
    return all_hold([exceeds(replays, initial)], [f"{text} {shown(replays)}"])


# Two-armed task 1: exploration conditions 3 and 4


@decides("ec3-better-than-ec2")
def _ec3_better_than_ec2(data: Data) -> Finding:
    runs = data.learned(ONE, "EC2")
    groups = {str(h): rewards_of(g) for h, g in runs.groupby("hands") if len(g) >= FEWEST}
    if not groups:
        raise MissingError(f"no hand sequence that {FEWEST} runs of EC2 on {ONE} learned")
    hands = max(groups, key=lambda name: float(groups[name].mean()))
    rewards = data.rewards(ONE, "EC3")
    best = groups[hands]
    under_ec2 = f"best under EC2 {hands} {shown(best)} in {len(best)} of {len(runs)} runs"
    return all_hold([exceeds(rewards, best)], [f"EC3 {shown(rewards)}", under_ec2])


@decides("ec3-beats-exhaustive")
def _ec3_beats_exhaustive(data: Data) -> Finding:
    rewards = data.rewards(ONE, "EC3")
    _, best = data.best_sequences(ONE)
    published = published_exhaustive(ONE)
    assert published is not None
    text = f"{shown(rewards)} against {best:.0f} (published {published[1]})"
    return all_hold([exceeds(rewards, best)], [text])


# Two-armed task 2


@decides("best-is-rrrr")
def _best_is_rrrr(data: Data) -> Finding:
    best, reward = data.best_sequences(TWO)
    printed = published_exhaustive(TWO)
    assert printed is not None
    text = (
        f"best of the corrective process alone: {' and '.join(best)} {reward:.0f} (published "
        f"{printed[0]} {printed[1]})"
    )
    if "RRRR" not in best:
        return Finding(False, text)
    return Finding(True, text) if len(best) == 1 else Finding(None, f"{text}: a tie")


@decides("ec3-departs")
def _ec3_departs(data: Data) -> Finding:
    best, reward = data.best_sequences(TWO)
    found = data.hands(TWO, "EC3")
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


@decides("ec4-mixed")
def _ec4_mixed(data: Data) -> Finding:
    found = data.hands(TWO, "EC4")
    return Finding(len(found) > 1, f"{tally(found)} of {found.total()} runs")


# Exploration conditions beside each other, on both tasks


@decides("ec4-beats-ec3")
def _ec4_beats_ec3(data: Data) -> Finding:
    tests, parts = [], []
    for task in (ONE, TWO):
        a, b = data.rewards(task, "EC4"), data.rewards(task, "EC3")
        tests.append(exceeds(a, b))
        better = probability_of_improvement(a, b, seed=SEED)
        parts.append(
            f"{task}: EC4 − EC3 = {interval(difference_of_means(a, b, seed=SEED))}, "
            f"P(improvement) {interval(better, '.2f')}"
        )
    return all_hold(tests, parts)


@decides("proficiency-rises")
def _proficiency_rises(data: Data) -> Finding:
    tests, parts = [], []
    for task, conditions in ((ONE, ("EC2", "EC3", "EC4")), (TWO, ("EC3", "EC4"))):
        initial = data.initial_reward(task, conditions[0])
        rewards = [data.rewards(task, condition) for condition in conditions]
        lower: list[Array | float] = [initial, *rewards[:-1]]
        tests += list(map(exceeds, rewards, lower))
        means = ", ".join(f"{c} {r.mean():.1f}" for c, r in zip(conditions, rewards, strict=True))
        parts.append(f"{task}: initial {initial:.0f}, {means}")
    return all_hold(tests, parts)


@decides("sequences-change")
def _sequences_change(data: Data) -> Finding:
    tests, parts = [], []
    for task, pair in ((ONE, ("EC2", "EC3")), (TWO, ("EC3", "EC4"))):
        found = [data.hands(task, condition) for condition in pair]
        hands = sorted(set(found[0]) | set(found[1]))
        table = np.array([[count[h] for h in hands] for count in found])
        method = stats.MonteCarloMethod(rng=np.random.default_rng(SEED))
        p = float(stats.fisher_exact(table, method=method).pvalue) if len(hands) > 1 else 1.0
        tests.append(
            Inference(
                float(np.abs(np.diff(table / table.sum(axis=1, keepdims=True), axis=0)).sum() / 2),
                tuple(int(n) for n in table.sum(axis=1)),
                "Fisher's test of hand sequences by condition, Monte Carlo",
                p=p,
            )
        )
        tallies = ", ".join(f"{c} {tally(n)}" for c, n in zip(pair, found, strict=True))
        parts.append(f"{task}: {tallies}")
    seen = all_hold(tests, parts)
    # Fisher's test has no contrary side: no difference leaves it open.
    return replace(seen, holds=seen.holds or None, against=())
