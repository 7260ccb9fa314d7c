"""The paper's claims about exploration conditions beside each other, on both two-armed tasks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import stats

from analysis.claims.data import ONE, TWO, Data
from analysis.claims.evidence import all_hold, exceeds
from analysis.claims.register import Finding
from analysis.claims.statements import decides
from analysis.statistics.estimates import (
    SEED,
    Inference,
    difference_of_means,
    probability_of_improvement,
)
from analysis.words import interval, tally
from coartic.robot import Array


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
