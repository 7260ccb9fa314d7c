"""The paper's claims on its own tasks: one function each, which says how it is judged."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from functools import partial

import numpy as np

from coartic.analysis.claims import rules
from coartic.analysis.claims.data import Data, Measurement, MissingError, judges
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.claims.rules import TEST_OF_MEANS, all_of, higher
from coartic.analysis.methods import EC1, EC2, EC3, EC4
from coartic.analysis.signatures.subtasks import postures_before
from coartic.analysis.statistics.hypotheses import (
    bootstrap_test,
)
from coartic.analysis.topics.paper.shortest import shortest_reach
from coartic.robot import Array
from coartic.tasks.task import hands_of

ONE_ARMED = ASCENDING, DESCENDING = "ascending", "descending"
TWO_ARMED = TASK_1, TASK_2 = "two-armed-1", "two-armed-2"
FREE_BASE = "two-armed-1.free-base"
CELLS_OF_ONE_ARM = tuple((task, EC1) for task in ONE_ARMED)
CELLS_OF_TWO_ARMS = (
    *((TASK_1, label) for label in (EC2, EC3, EC4)),
    *((TASK_2, label) for label in (EC3, EC4)),
)
"""The paper's conditions on its tasks."""
SMOOTH_PLANS = tuple(
    f"trajectory-optimisation/{cost}" for cost in ("squared-changes", "acceleration", "jerk")
)
Cells = Sequence[tuple[str, str]]
"""Tasks, each with the label of a method."""

# One-armed tasks, and what is judged on both kinds alike.


ENSURES = (
    "exact: failed trials of the learner, and hand sequences that the corrective process cannot "
    "complete"
)


@judges("corrective-ensures-one-armed", test=ENSURES, cells=CELLS_OF_ONE_ARM)
@judges("corrective-ensures-two-armed", test=ENSURES, cells=CELLS_OF_TWO_ARMS)
def corrective_ensures(data: Data, cells: Cells) -> Finding:
    """Whether the corrective process completes every trial, and every hand sequence by itself."""
    no_trial_fails = rules.no_trial_fails(data, cells)
    rewards = [reward for task in dict(cells) for reward in data.sequences(task).values()]
    missed = sum(map(math.isnan, rewards))
    return Finding(
        no_trial_fails.holds and not missed,
        f"{no_trial_fails.evidence} Without any experience, the corrective process completes "
        f"{len(rewards) - missed} of {len(rewards)} hand sequences.",
    )


NEAR_SHORTEST = (
    "exact: no subtask of the initial solution is more than {close:.0%} longer than the shortest "
    "path from the same posture (the shortest that a search finds)"
)


@judges("corrective-near-shortest-one-armed", test=NEAR_SHORTEST, tasks=ONE_ARMED)
@judges("corrective-near-shortest-two-armed", test=NEAR_SHORTEST, tasks=TWO_ARMED)
def corrective_near_shortest(data: Data, tasks: Iterable[str]) -> Finding:
    """Whether each subtask of initial solutions is nearly the shortest path by itself."""
    parts, most = [], 0.0
    for name in tasks:
        task, initial = data.task(name), data.initial_execution(name)
        before, after = np.array(postures_before(initial, task)), initial.configurations
        reaches = zip(before, hands_of(initial.hands), itertools.count(1), after, strict=False)
        shortest = np.array([shortest_reach(task, *reach) for reach in reaches])
        ways = np.linalg.norm(after - before, axis=1)
        excess = ways / shortest - 1
        most = max(most, float(excess.max()))
        each = ", ".join(f"{share:.1%}" for share in excess)
        parts.append(f"{name} {each} (in all {ways.sum() / shortest.sum() - 1:.1%})")
    return Finding(
        most <= MARGINS["close"],
        f"By so much each subtask is longer than the shortest path: {'; '.join(parts)}.",
    )


FEWER_CORRECTIONS = (
    "one-tailed paired bootstrap tests in each cell: more corrective movements in the first tenth "
    "of the trials than in the last. Trial 0 does not count, as it has no others by construction"
)


@judges("corrections-one-armed", test=FEWER_CORRECTIONS, cells=CELLS_OF_ONE_ARM)
@judges("corrections-two-armed", test=FEWER_CORRECTIONS, cells=CELLS_OF_TWO_ARMS)
def corrected_less_later(data: Data, cells: Cells) -> Finding:
    """Whether the runs of each cell make fewer corrective movements in the end."""
    tests, parts = [], []
    last: list[partial[Measurement]] = []
    for task, label in cells:
        early, late = (data.corrections(task, label, tenth) for tenth in ("early", "late"))
        tests.append(bootstrap_test(early.numbers - late.numbers, 0.0))
        parts.append((early.quantity, f"{early.name}: {early}, late {late}"))
        last.append(partial(data.last_corrections, task, label))
    parts += [(values.quantity, f"{values.name}: {values}") for values in rules.there(last)]
    return rules.all_positive(tests, parts)


@judges(
    "resembles-squared-changes",
    test="one-tailed bootstrap tests on both one-armed tasks that the ratio of mean distances to "
    "the plan, learned over initial, is below {halfway:g}",
)
def resembles_squared_changes(data: Data) -> Finding:
    """Learned postures are nearer to the plan than halfway from the initial ones."""
    return all_of(higher(data.resemblance(task, EC1), by=MARGINS["halfway"]) for task in ONE_ARMED)


INACCURATE = (
    "one-tailed bootstrap tests against plans for smoothness (free times); at least one of them "
    "holds, the smallest p times their number (Bonferroni)"
)


@judges("beats-inaccurate-one-armed", test=INACCURATE, tasks=ONE_ARMED, label=EC1)
@judges("beats-inaccurate-two-armed", test=INACCURATE, tasks=TWO_ARMED, label=EC4)
def beats_smooth_plans(data: Data, tasks: Iterable[str], label: str) -> Finding:
    """Whether a plan for smoothness is worse than what is learned, on some task."""
    comparisons = []
    for task in tasks:
        learned = data.reward(task, label)
        comparisons += [higher(learned, data.reward(task, plan)) for plan in SMOOTH_PLANS]
    return rules.some_of(comparisons)


# Two-armed tasks.


def base_steps(start: Array, configurations: Array) -> Array:
    """How far the base moves along x from goal to goal, length unit, shape ``(G,)``."""
    return np.diff(np.append(start[0], configurations[:, 0]))


@judges("ec2-sequences", test=rules.TEST_OF_HALF, task=TASK_1, label=EC2, hands="RRLR")
@judges("half-choose-rlrr", test=rules.TEST_OF_HALF, task=TASK_2, label=EC3, hands="RLRR")
def half_find(data: Data, task: str, label: str, hands: str) -> Finding:
    """Whether about half of the runs learn a sequence."""
    return rules.about_half(data.hands(task, label), hands)


@judges("multilevel-search", TEST_OF_MEANS)
def multilevel_search(data: Data) -> Finding:
    """Exploring hands as well earns more than the right hand alone."""
    return all_of(higher(data.reward(task, EC3), data.reward(task, EC1)) for task in TWO_ARMED)


@judges(
    "no-reversal",
    test="exact binomial test that more than {most:.0%} of the runs that learned RRLR do so (the "
    "paper shows one)",
)
def no_reversal(data: Data) -> Finding:
    """With RRLR the base only moves right."""
    learned, q0 = data.hands(TASK_1, EC2), data.task(TASK_1).q0
    runs = [run.execution for run in data.cell(TASK_1, EC2).runs if run.execution.hands == "RRLR"]
    if not runs:
        raise MissingError(f"no run of EC2 on {TASK_1} learned RRLR")
    rightward = [bool((base_steps(q0, run.configurations) > 0).all()) for run in runs]
    return rules.most(learned.count("RRLR rightward", rightward))


@judges(
    "ec4-mixed",
    test="exact: at least one run does not have the commonest hand sequence (the paper names none)",
)
def ec4_mixed(data: Data) -> Finding:
    """Runs learn different hands."""
    learned = data.hands(TASK_2, EC4)
    others = learned.count("not commonest", [h != learned.commonest for h in learned.sequences])
    return Finding(others.number > 0, others.words)


@judges("proficiency-rises", test=TEST_OF_MEANS)
def proficiency_rises(data: Data) -> Finding:
    """Each condition is better than the one before, the first than the initial solution."""
    comparisons: list[rules.Comparison] = []
    for task, label in CELLS_OF_TWO_ARMS:
        learned = data.reward(task, label)
        first = not comparisons or comparisons[-1].first.task != task
        before = data.initial(task) if first else comparisons[-1].first
        comparisons.append(higher(learned, before))
    return all_of(comparisons)


@judges(
    "rail",
    test="exact binomial tests under EC3: with the base on its rail more than {most:.0%} "
    "of the runs have the commonest sequence, and with the base free fewer do",
)
def rail(data: Data) -> Finding:
    """Most runs have the commonest hands with the base on its rail, and not most without."""
    on_rail = data.hands(TASK_1, EC3)
    consistent = rules.most(on_rail.are(on_rail.commonest, name="commonest"))
    free = data.hands(FREE_BASE, EC3)
    mixed = rules.not_most(free.are(free.commonest, name="commonest"))
    return Finding(
        bool(consistent.holds and mixed.holds),
        f"{consistent.evidence}; {mixed.evidence}",
        consistent.tests + mixed.tests,
        (consistent.against or ()) + (mixed.against or ()),
    )
