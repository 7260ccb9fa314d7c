"""The paper's claims about exploration conditions beside each other, on both two-armed tasks."""

from __future__ import annotations

from collections import Counter

import numpy as np
from scipy import stats

from analysis.claims.data import ONE, TWO, Data
from analysis.claims.register import Finding
from analysis.claims.statements import decides
from analysis.statistics.estimates import (
    SEED,
    Inference,
    difference_of_means,
    probability_of_improvement,
)
from analysis.statistics.hypotheses import bootstrap_test
from analysis.words import interval, tally
from coartic.robot import Array


@decides("ec4-beats-ec3", "one-tailed bootstrap tests of two samples")
def _ec4_beats_ec3(data: Data) -> Finding:
    tests, parts = [], []
    for task in (ONE, TWO):
        a, b = data.rewards(task, "EC4"), data.rewards(task, "EC3")
        tests.append(bootstrap_test(a, b, seed=SEED))
        better = probability_of_improvement(a, b, seed=SEED)
        parts.append(
            f"{task}: EC4 − EC3 = {interval(difference_of_means(a, b, seed=SEED))}, "
            f"P(improvement) {interval(better, '.2f')}"
        )
    return Finding(all(test.estimate > 0 for test in tests), "; ".join(parts), tuple(tests))


@decides(
    "proficiency-rises",
    "one-tailed bootstrap tests of each condition against the next lower one and the initial "
    "solution",
)
def _proficiency_rises(data: Data) -> Finding:
    tests, parts = [], []
    for task, conditions in ((ONE, ("EC2", "EC3", "EC4")), (TWO, ("EC3", "EC4"))):
        initial = float(data.learned(task, conditions[0]).initial_reward.iloc[0])
        rewards = [data.rewards(task, condition) for condition in conditions]
        lower: list[Array | float] = [initial, *rewards[:-1]]
        tests += [
            bootstrap_test(more, less, seed=SEED)
            for more, less in zip(rewards, lower, strict=True)
        ]
        means = ", ".join(f"{c} {r.mean():.1f}" for c, r in zip(conditions, rewards, strict=True))
        parts.append(f"{task}: initial {initial:.0f}, {means}")
    return Finding(all(test.estimate > 0 for test in tests), "; ".join(parts), tuple(tests))


@decides(
    "sequences-change",
    "Fisher's tests of sequences: conditions 2 and 3 of task 1, 3 and 4 of task 2",
)
def _sequences_change(data: Data) -> Finding:
    tests, parts = [], []
    for task, pair in ((ONE, ("EC2", "EC3")), (TWO, ("EC3", "EC4"))):
        found = [Counter(data.learned(task, condition).hands) for condition in pair]
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
        parts.append(
            f"{task}: " + ", ".join(f"{c} {tally(n)}" for c, n in zip(pair, found, strict=True))
        )
    # Fisher's test has no contrary side: no difference leaves it open.
    changed = all(test.estimate > 0 for test in tests)
    return Finding(changed or None, "; ".join(parts), tuple(tests), ())
