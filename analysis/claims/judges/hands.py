"""Whether runs with one hand sequence get more than those with another."""

from __future__ import annotations

from analysis.claims.data import Data
from analysis.claims.register import Finding
from analysis.published import published_cell
from analysis.statistics.estimates import SEED, difference_of_means, mean
from analysis.statistics.hypotheses import bootstrap_test
from analysis.words import interval


def better_hands(data: Data, task: str, condition: str, better: str, worse: str) -> Finding:
    """Test of the learned rewards of the runs that learned the one and the other."""
    a, b = data.group(task, condition, better), data.group(task, condition, worse)
    test = bootstrap_test(a, b, seed=SEED)
    printed = published_cell(task, condition)
    assert printed is not None
    known = {s.hands: s.summary.mean for s in printed.sequences if s.summary is not None}
    parts = [
        f"{hands} {interval(mean(values, seed=SEED))} in {len(values)} runs (published "
        f"{known[hands]:g})"
        for hands, values in ((better, a), (worse, b))
    ]
    apart = interval(difference_of_means(a, b, seed=SEED))
    return Finding(test.estimate > 0, f"{', '.join(parts)}: {apart}", (test,))
