"""The paper's claims on its own tasks, with their words and tests."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from operator import itemgetter
from statistics import mode

import numpy as np
import scipy

from coartic import Execution, Hand, Task
from coartic.analysis.claims import margins
from coartic.analysis.claims.claim import Claim, all_higher, all_positive, no_trial_fails
from coartic.analysis.claims.coarticulation import (
    CLAIMS_OF_COARTICULATION,
    ONE_ARMED,
    TASK_1,
    TASK_2,
    TEST_OF_MEANS,
    TWO_ARMED,
)
from coartic.analysis.claims.judging import Finding, all_of
from coartic.analysis.claims.reader import Higher, Measurement, MissingError, Reader, who_is
from coartic.analysis.methods import EC1, EC2, EC3, EC4
from coartic.analysis.published import published_cell
from coartic.analysis.signatures.two_contexts import movable
from coartic.analysis.statistics.hypotheses import bootstrap_test, share_test
from coartic.analysis.words import tally
from coartic.estimates import SEED, Estimate
from coartic.learner.kernel import TENTHS
from coartic.robot import Array
from coartic.tasks.task import hands_of

FREE_BASE = "two-armed-1.free-base"
CELLS_OF_ONE_ARM = tuple((task, EC1) for task in ONE_ARMED)
CELLS_OF_TWO_ARMS = (
    *((TASK_1, label) for label in (EC2, EC3, EC4)),
    *((TASK_2, label) for label in (EC3, EC4)),
)
"""The paper's conditions on its tasks."""
LEAST_DISPLACEMENT = "trajectory-optimisation/squared-displacement"
"""The plan with the least squared joint displacement, a smoothness cost of Jordan's."""
SMOOTH_PLANS = (
    LEAST_DISPLACEMENT,
    "trajectory-optimisation/acceleration",
    "trajectory-optimisation/jerk",
)
Cells = Sequence[tuple[str, str]]
"""Pairs of a task and the label of a method."""

# Claims on one-armed tasks, and claims on one-armed and two-armed tasks.


def corrective_ensures(read: Reader, cells: Cells) -> Finding:
    """Count trials that fail, and hand sequences that the corrective process cannot complete."""
    trials = no_trial_fails(read, cells)
    rewards = np.concatenate([read.alone(task) for task in dict(cells)])
    missed = int(np.isnan(rewards).sum())
    return Finding(
        trials.holds and not missed,
        f"{trials.evidence}. Without any experience, the corrective process completes "
        f"{len(rewards) - missed} of {len(rewards)} hand sequences",
    )


def corrective_near_shortest(read: Reader, tasks: Iterable[str]) -> Finding:
    """Compare each subtask of the initial solutions with its shortest path in joint space."""
    parts, most = [], 0.0
    for name in tasks:
        *excess, in_all = excess_over_shortest(read.task(name), read.initial_execution(name))
        most = max(most, *excess)
        each = ", ".join(f"{share:.1%}" for share in excess)
        parts.append(f"{read.title(name)} {each} (in all {in_all:.1%})")
    return Finding(
        most <= margins.CLOSE, f"Excess of each subtask over the shortest path: {'; '.join(parts)}"
    )


def excess_over_shortest(task: Task, initial: Execution) -> list[float]:
    """Return the shares by which subtasks, and last all together, exceed the shortest paths."""
    after = initial.configurations
    before = np.array([task.q0, *after[:-1]])
    reaches = zip(before, hands_of(initial.hands), itertools.count(1), after, strict=False)
    shortest = np.array([shortest_reach(task, *reach) for reach in reaches])
    ways = np.linalg.norm(after - before, axis=1)
    return [*(ways / shortest - 1).tolist(), float(ways.sum() / shortest.sum() - 1)]


def shortest_reach(task: Task, q: Array, hand: Hand, goal: int, near: Array) -> float:
    """Return the least joint-space distance from ``q`` to a configuration that hits a goal.

    ``goal`` counts from 1; ``near``, shape ``(dof,)``, is a configuration close to a hit.
    Sequential quadratic programming (Kraft 1988, scipy's SLSQP) on the joints that can move the
    hand, from ``near`` and eight random starts about it. The distance, length unit and rad mixed,
    is the best local minimum, at least as long as the global minimum; infinite without a minimum.
    """
    joints, centre = movable(task, hand), np.array(task.goals[goal - 1])

    def moved(change: Array) -> Array:
        result = q.copy()
        result[joints] += change
        return result

    def miss(change: Array) -> Array:
        return np.asarray(task.robot.forward_kinematics(moved(change), hand) - centre)

    def inside(change: Array) -> float:
        off = miss(change)
        return float(task.radius**2 - off @ off)

    def inside_gradient(change: Array) -> Array:
        jacobian = task.robot.jacobian(moved(change), hand)[:, joints]
        return np.asarray(-2 * miss(change) @ jacobian)

    first = (near - q)[joints]
    rng = np.random.default_rng(SEED)
    best = math.inf
    for start in (first, *(first + rng.normal(0, 0.3, (8, len(joints))))):
        reach = scipy.optimize.minimize(
            lambda change: (change @ change, 2 * change),
            start,
            jac=True,
            method="SLSQP",
            constraints=[{"type": "ineq", "fun": inside, "jac": inside_gradient}],
            options={"ftol": 1e-12, "maxiter": 300},
        )
        if inside(reach.x) >= -1e-8:
            best = min(best, float(np.linalg.norm(reach.x)))
    return best


def corrected_less_later(read: Reader, cells: Cells) -> Finding:
    """Test that runs make fewer corrective movements in the last trials than in the first.

    Trial 0 does not count: all its movements are corrective by construction.
    """
    words = "share of movements that are corrected, in the"
    tests, parts, learned = [], [], []
    for task, label in cells:
        runs, goals = read.runs(task, label), len(read.task(task).goals)
        movements = (runs.trials - 1) * goals / TENTHS
        early, late, last = (
            Measurement(
                read.title(task), who_is(label), shares.to_numpy(np.float64), f"{words} {when}"
            )
            for shares, when in (
                (runs.early_corrections / movements, "first tenth of the trials"),
                (runs.late_corrections / movements, "last tenth of the trials"),
                (runs.solution_corrections / goals, "learned solution"),
            )
        )
        tests.append(bootstrap_test(early.numbers - late.numbers, 0.0))
        parts.append((early.quantity, f"{early.name}: {early}, late {late}"))
        learned.append((last.quantity, f"{last.name}: {last}"))
    return all_positive(tests, parts + learned)


def resemblance(read: Reader, task: str) -> Measurement:
    """Return the share of the initial solution's distance to the plan that each run covers."""
    learned = read.cell(task, EC1).runs
    (plan,) = read.cell(task, LEAST_DISPLACEMENT).runs
    planned = plan.configurations

    def distance(execution: Execution) -> float:
        """Return the mean distance of postures at the goals, length unit and rad mixed."""
        return float(np.linalg.norm(execution.configurations - planned, axis=-1).mean())

    before = distance(read.initial_execution(task))
    shares = np.array([1 - distance(run) / before for run in learned])
    return Measurement(
        read.title(task), who_is(EC1), shares,
        "share of the distance of the initial solution to the plan of minimum squared joint "
        "displacement that learning has covered (postures at the goals)",
    )  # fmt: skip


def beats_smooth_plans(read: Reader, tasks: Iterable[str], label: str) -> Finding:
    """Test that the learner earns more than some plan for smoothness on some task."""
    comparisons = []
    for task in tasks:
        learned = read.reward(task, label)
        comparisons += [Higher(learned, read.reward(task, plan)) for plan in SMOOTH_PLANS]
    return some_of(all_higher(comparisons))


def some_of(every: Finding) -> Finding:
    """Return the finding that some test is as claimed, with the smallest p times their number."""
    best = min(every.tests, key=lambda test: math.inf if math.isnan(test.p) else test.p)
    holds = any(test.value > 0 for test in every.tests)
    if holds:
        best = replace(best, p=min(1.0, best.p * len(every.tests)))
    return Finding(holds, every.evidence, (best,))


# Claims on two-armed tasks.


def most_do(words: str, does: Sequence[bool], *, claimed: bool = True) -> Finding:
    """Test that more than three quarters of the runs do something; or fewer, if not ``claimed``."""
    count, total = sum(does), len(does)
    more = share_test(count, total, margins.MOST, "greater")
    fewer = share_test(count, total, margins.MOST, "less")
    side = "greater" if claimed else "less"
    limits = scipy.stats.binomtest(count, total, alternative=side).proportion_ci()
    limit = f"at least {limits.low:.0%}" if claimed else f"at most {limits.high:.0%}"
    if limits.low > 0 or limits.high < 1:
        words += f", {limit} of all (95 %)"
    if claimed:
        return Finding(more.value > 0, words, (more,), (fewer,))
    return Finding(fewer.value < 0, words, (fewer,), (more,))


def runs_that(read: Reader, task: str, label: str, what: str, does: Sequence[bool]) -> str:
    """Say how many runs do something, with the hand sequences of all runs."""
    each, who = tally(Counter(read.hands(task, label))), f"{read.title(task)} {who_is(label)}"
    return f"{who} {what}: {sum(does)} of {len(does)} runs ({each})"


def half_find(read: Reader, task: str, label: str, hands: str) -> Finding:
    """Test that neither few nor most runs learn these hands, against the published share."""
    does = [each == hands for each in read.hands(task, label)]
    count, total = sum(does), len(does)
    share = count / total
    low, high = scipy.stats.binomtest(count, total).proportion_ci()
    cell = published_cell(task, who_is(label))
    assert cell is not None
    published, of_published = cell[hands], sum(s.runs for of, s in cell.items() if of)
    more = share_test(count, total, margins.FEW, "greater")
    fewer = share_test(count, total, margins.MOST, "less")
    inside = min(share - margins.FEW, margins.MOST - share)
    within = Estimate(inside, n=(total,), p=max(more.p, fewer.p))
    table = [[count, total - count], [published.runs, of_published - published.runs]]
    unlike = Estimate(
        share - published.runs / of_published,
        n=(total, of_published),
        p=float(scipy.stats.fisher_exact(table).pvalue),
    )
    words = runs_that(read, task, label, hands, does)
    return Finding(
        margins.FEW < share < margins.MOST,
        f"{words}, {low:.0%} to {high:.0%} of all (95 %); "
        f"published {published.runs} of {of_published}{' (derived)' * published.derived_runs}",
        (within,),
        (unlike,),
    )


def no_reversal(read: Reader) -> Finding:
    """Test that the base only moves right in most runs that learn RRLR."""
    q0 = read.task(TASK_1).q0
    runs = [run for run in read.cell(TASK_1, EC2).runs if run.hands == "RRLR"]
    if not runs:
        raise MissingError(f"no run of EC2 on {read.title(TASK_1)} learned RRLR")
    along = [np.append(q0[0], run.configurations[:, 0]) for run in runs]  # the base, length unit
    rightward = [bool((np.diff(x) > 0).all()) for x in along]
    return most_do(runs_that(read, TASK_1, EC2, "RRLR rightward", rightward), rightward)


def ec4_mixed(read: Reader) -> Finding:
    """Count the runs on two-armed task 2 without the commonest hand sequence; the claim, that
    there are some, is not tested. Raises MissingError without runs."""
    learned = read.hands(TASK_2, EC4)
    others = [hands != mode(learned) for hands in learned]
    return Finding(any(others), runs_that(read, TASK_2, EC4, "not commonest", others))


def proficiency_rises(read: Reader) -> Finding:
    """Test that each condition beats the one before, and the first beats the initial solution."""
    comparisons: list[Higher] = []
    for task, cells in itertools.groupby(CELLS_OF_TWO_ARMS, itemgetter(0)):
        rewards = [read.initial(task), *(read.reward(*cell) for cell in cells)]
        comparisons += [Higher(higher, lower) for lower, higher in itertools.pairwise(rewards)]
    return all_higher(comparisons)


def rail(read: Reader) -> Finding:
    """Test that most runs have the commonest hands if the base is on its rail, and only then."""
    findings = []
    for task, consistent in ((TASK_1, True), (FREE_BASE, False)):
        learned = read.hands(task, EC3)
        does = [hands == mode(learned) for hands in learned]
        words = runs_that(read, task, EC3, "commonest", does)
        findings.append(most_do(words, does, claimed=consistent))
    return all_of(*findings)


def on_either_kind(which: str, cells: Cells, best: str) -> list[Claim]:
    """Return the claims that have the same test on tasks for one arm and on tasks for two.

    ``best`` is the condition that explores most.
    """
    tasks, fitted = list(dict(cells)), which == "two"
    return [
        Claim(
            id=f"corrective-ensures-{which}-armed",
            text=f"On the {which}-armed tasks, the corrective process completes every trial, and "
            "needs no experience to do so.",
            place="Method, The Corrective Process; Discussion, Multiple Controller Schemes",
            quote="to ensure that the overall task is accomplished",
            test="exact: failed trials of the learner, and hand sequences that the corrective "
            "process cannot complete",
            judge=partial(corrective_ensures, cells=cells),
            group="exact",
            fitted=fitted,
            sets="242 of 242 (Two-armed 1); 240 of 240 (Two-armed 2)" * fitted,
        ),
        Claim(
            id=f"corrective-near-shortest-{which}-armed",
            text=f"On the {which}-armed tasks, the corrective process takes nearly the shortest "
            "path in joint space for each subtask by itself.",
            place="Method, The Corrective Process",
            quote="close to the shortest distance in joint space for each subtask",
            test="exact: no subtask of the initial solution is more than 10% longer than the "
            "shortest path from the same posture (the shortest that a search finds)",
            judge=partial(corrective_near_shortest, tasks=tasks),
            group="exact",
            fitted=fitted,
        ),
        Claim(
            id=f"corrections-{which}-armed",
            text=f"On the {which}-armed tasks, the corrective process is needed early in learning, "
            "and less later.",
            place="Discussion, Multiple Controller Schemes",
            quote="The general controller is useful for generating behavior early in learning",
            test="one-tailed paired bootstrap tests in each experiment: more corrective "
            "movements in the first tenth of the trials than in the last. Trial 0 does not count, "
            "as it has no others by construction",
            judge=partial(corrected_less_later, cells=cells),
            group="paper",
            fitted=fitted,
            sets="0 of 242 (Two-armed 1, refuted in 242); 0 of 240 (Two-armed 2, refuted in 231)"
            * fitted,
            depends=fitted,
        ),
        Claim(
            id=f"beats-inaccurate-{which}-armed",
            text=f"On the {which}-armed tasks, the learner finds better movements than at least "
            "one planner whose objective is not the reward.",
            place="Discussion, Implications of Using a Simple Learning Process",
            quote="movements can be found (if they exist) that deliver better consequences",
            test="one-tailed bootstrap tests against plans for smoothness (free times); at least "
            "one of them holds, the smallest p times their number (Bonferroni)",
            judge=partial(beats_smooth_plans, tasks=tasks, label=best),
            fitted=fitted,
        ),
    ]


HALF = (
    "exact binomial tests that more than 25% and fewer than 75% of all runs do; for the opposite: "
    "the share lies outside, and Fisher's exact test tells the counts from the published ones. 20 "
    "runs are too few to pass it after Holm's correction"
)

CLAIMS_OF_THE_PAPER = [
    *CLAIMS_OF_COARTICULATION,
    *on_either_kind("one", CELLS_OF_ONE_ARM, best=EC1),
    Claim(
        id="resembles-squared-displacement",
        text="Learned movements are similar to movements planned for smoothness (least squared "
        "configuration changes). We judge whether the postures at the goals lie less than half as "
        "far from the plan's as those of the initial solution do.",
        place="Method, The Learning Process",
        quote="These movements are similar to movements that would be found through",
        test="one-tailed bootstrap tests on both one-armed tasks that the ratio of mean distances "
        "to the plan, learned over initial, is below 0.5",
        judge=lambda read: all_higher(
            Higher(resemblance(read, task), by=margins.HALFWAY) for task in ONE_ARMED
        ),
    ),
    Claim(
        id="ec2-sequences",
        text="On Two-armed 1, about half of the runs under EC2 find RRLR; the others (9 of 20) "
        "keep RRRR.",
        place="Results, Exploration Condition 2, Figure 6",
        quote="in nine of the 20 runs, the learned solution continued to use",
        test=HALF,
        judge=partial(half_find, task=TASK_1, label=EC2, hands="RRLR"),
        group="paper",
        fitted=True,
        sets="9 of 242 (Two-armed 1, refuted in 192)",
        depends=True,
    ),
    Claim(
        id="no-reversal",
        text="On Two-armed 1, once RRLR is learned under EC2, the base moves right on the way to "
        "every goal.",
        place="Results, Exploration Condition 2, Figure 6",
        quote="in contrast to the initial solution, the base always moves",
        test="exact binomial test that more than 75% of the runs that learned RRLR do so (the "
        "paper shows one)",
        judge=no_reversal,
        group="paper",
        fitted=True,
        sets="2 of 242 (Two-armed 1, refuted in 84)",
        depends=True,
    ),
    Claim(
        id="half-choose-rlrr",
        text="On Two-armed 2, about half of the runs under EC3 choose RLRR instead of RRRR (9 of "
        "20).",
        place="Results, Exploration Condition 3, Figure 7",
        quote="in about half the runs of two-armed task 2",
        test=HALF,
        judge=partial(half_find, task=TASK_2, label=EC3, hands="RLRR"),
        group="paper",
        fitted=True,
        sets="0 of 240 (Two-armed 2, refuted in 237)",
        depends=True,
    ),
    Claim(
        id="ec4-mixed",
        text="On Two-armed 2, runs under EC4 differ in the hands that they find.",
        place="Results, Summary of Two-Armed Task Results, Figure 8",
        quote="(mixed)",
        test="exact: at least one run does not have the commonest hand sequence (the paper names "
        "none)",
        judge=ec4_mixed,
        group="exact",
        fitted=True,
        sets="70 of 240 (Two-armed 2, refuted in 170)",
        depends=True,
    ),
    Claim(
        id="proficiency-rises",
        text="On both two-armed tasks each condition is better than the one before it, and the "
        "first is better than the initial solution.",
        place="Results, Summary of Two-Armed Task Results, Figure 8",
        quote="each bar is significantly higher than the bar to its left",
        test=TEST_OF_MEANS,
        judge=proficiency_rises,
        group="paper",
        fitted=True,
        sets="130 of 242 (Two-armed 1, refuted in 50); 7 of 240 (Two-armed 2, refuted in 201)",
        depends=True,
    ),
    Claim(
        id="rail",
        text="On Two-armed 1 EC3 finds one hand sequence because the base moves only horizontally; "
        "with the base free it finds none consistently.",
        place="Method, Two-Armed Task 1",
        quote="This restriction led to the development of a consistent sequence",
        test="exact binomial tests under EC3: with the base on its rail more than 75% of the runs "
        "have the commonest sequence, and with the base free fewer do",
        judge=rail,
        fitted=True,
    ),
    Claim(
        id="multilevel-search",
        text="Exploring two levels finds more than exploring one in as many trials: EC3, which "
        "also explores hands, beats EC1, which uses the right hand alone, on both two-armed tasks.",
        place="Introduction",
        quote="A multilevel exploration scheme facilitates search over an objective function",
        test=TEST_OF_MEANS,
        judge=lambda read: all_higher(
            Higher(read.reward(task, EC3), read.reward(task, EC1)) for task in TWO_ARMED
        ),
        fitted=True,
    ),
    *on_either_kind("two", CELLS_OF_TWO_ARMS, best=EC4),
]
