"""Define the rules of claims on hands: which hand sequences runs learn, and how often."""

from collections import Counter
from dataclasses import replace
from functools import partial
from statistics import mode

import numpy as np
import scipy
from comparisons import written
from judging import Finding, all_of
from reader import EC2, EC3, MARGINS, TASK_1, MissingError

from coartic.analysis.statistics import share_test
from coartic.estimates import Estimate, difference_of_means

FREE_BASE = "two-armed-1.free-base"
RANDOM_HANDS = "random-search/hands"
"""Random search with every hand sequence: EC3 without its memory."""


def hands_change(read, *, beyond=False):
    """Test that many runs change hands, under at least one of two conditions.

    A run changes hands if it hits a goal before the last with another hand than the initial
    solution. Many are more than a quarter of the runs or, with ``beyond``, a larger share than in
    random search with every hand sequence. p is the smallest p times the number of conditions. The
    opposite is that no condition has many such runs.
    """
    control = changed_hands(read, RANDOM_HANDS) if beyond else []
    tests, against, parts = [], [], []
    for label in (EC2, EC3):
        does = changed_hands(read, label)
        count, total = int(does.sum()), len(does)
        parts.append(f"{read.title(TASK_1)} {read.who(label)}: {count} of {total} runs")
        if beyond:
            counts = count, total, sum(control), len(control)
            less = fisher_test(*counts, "less")
            tests.append(fisher_test(*counts, "greater"))
            against.append(replace(less, value=-less.value))
            continue
        tests.append(share_test(count, total, MARGINS.few, "greater"))
        against.append(share_test(count, total, MARGINS.few, "less"))
        if 0 < count < total:
            rewards = read.reward(TASK_1, label).numbers
            better = written(difference_of_means(rewards[does], rewards[~does]), 1)
            parts[-1] += f", which end with {better} ticks more reward than the others"
    if beyond:
        parts.append(f"{read.who(RANDOM_HANDS)}: {sum(control)} of {len(control)} runs")
    best = min(tests, key=lambda test: (test.value <= 0, test.p))
    test = replace(best, p=min(1.0, best.p * len(tests)))
    contrary = max(against, key=lambda test: test.p)
    return Finding(test.value > 0, "; ".join(parts), (test,), (contrary,))


def fisher_test(count, total, other, of_other, side="two-sided"):
    """Compare two shares of runs by Fisher's exact test.

    The shares are ``count`` of ``total`` and ``other`` of ``of_other``. The value of the estimate
    is the first share less the second.
    """
    table = [[count, total - count], [other, of_other - other]]
    p = float(scipy.stats.fisher_exact(table, alternative=side).pvalue)
    return Estimate(count / total - other / of_other, n=(total, of_other), p=p)


def changed_hands(read, label):
    """Return for each run on two-armed task 1 whether it changes hands, shape ``(runs,)``.

    A run changes hands if it hits a goal before the last with another hand than the initial
    solution.
    """
    initial = read.initial_execution(TASK_1).hands[:-1]
    return np.array([hands[:-1] != initial for hands in read.hands(TASK_1, label)])


def most_do(words, does, *, claimed=True):
    """Test that more than three quarters of the runs do something (fewer, if not ``claimed``).

    ``does`` has a truth value for each run. The evidence begins with ``words``.
    """
    count, total = sum(does), len(does)
    side, other = ("greater", "less") if claimed else ("less", "greater")
    test, contrary = (share_test(count, total, MARGINS.most, which) for which in (side, other))
    limits = scipy.stats.binomtest(count, total, alternative=side).proportion_ci()
    limit = f"at least {limits.low:.0%}" if claimed else f"at most {limits.high:.0%}"
    if limits.low > 0 or limits.high < 1:
        words += f", {limit} of all (95 %)"
    holds = test.value > 0 if claimed else test.value < 0
    return Finding(holds, words, (test,), (contrary,))


def runs_that(read, task, label, what, does):
    """Return a phrase on how many runs do something, with the hand sequences of all runs.

    ``what`` says in words what they do. ``does`` has a truth value for each run.
    """
    counts = sorted(Counter(read.hands(task, label)).items(), key=lambda item: (-item[1], item[0]))
    each = ", ".join(f"{hands} {count}" for hands, count in counts)
    who = f"{read.title(task)} {read.who(label)}"
    return f"{who} {what}: {sum(does)} of {len(does)} runs ({each})"


def no_reversal(read):
    """Test that the base only moves right in most runs that learn RRLR."""
    q0 = read.task(TASK_1).q0
    runs = [run for run in read.cell(TASK_1, EC2).runs if run.hands == "RRLR"]
    if not runs:
        raise MissingError(f"no run of EC2 on {read.title(TASK_1)} learned RRLR")
    along = [np.append(q0[0], run.configurations[:, 0]) for run in runs]  # x of the base
    rightward = [bool((np.diff(x) > 0).all()) for x in along]
    return most_do(runs_that(read, TASK_1, EC2, "RRLR rightward", rightward), rightward)


def rail(read):
    """Test that most runs have the most common hands if, and only if, the base is on its rail."""
    findings = []
    for task, consistent in ((TASK_1, True), (FREE_BASE, False)):
        learned = read.hands(task, EC3)
        does = [hands == mode(learned) for hands in learned]
        words = runs_that(read, task, EC3, "commonest", does)
        findings.append(most_do(words, does, claimed=consistent))
    return all_of(*findings)


RULES = {
    "hand-coarticulation-task-1": hands_change,
    "no-reversal": no_reversal,
    "rail": rail,
}
"""Rules by the ids of their claims."""
BEYOND = {"hand-coarticulation-task-1": partial(hands_change, beyond=True)}
"""Rules that say whether learners show more than random search, by the ids of their claims."""
