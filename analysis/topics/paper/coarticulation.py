"""The paper's claims on its own tasks that it is coarticulation which is learned."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from scipy import stats

from coartic.analysis import methods
from coartic.analysis.claims import rules
from coartic.analysis.claims.data import Data, MissingError, judges, who_is
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.claims.rules import TEST_OF_MEANS, all_of, higher
from coartic.analysis.methods import EC1, EC2, EC3, EC4, PLACEBO
from coartic.analysis.signatures.between import TwoContexts
from coartic.analysis.signatures.context import dependence_below
from coartic.analysis.signatures.subtasks import hand_numbers, ticks_slower
from coartic.analysis.statistics.estimates import SEED, Estimate, difference_of_means
from coartic.analysis.statistics.hypotheses import (
    share_test,
)
from coartic.analysis.topics.paper.claims import ONE_ARMED, TASK_1, TWO_ARMED
from coartic.analysis.trajectories import Trajectories
from coartic.analysis.words import estimate, number
from coartic.robot import HANDS, Array
from coartic.tasks.task import hands_of

EC1_BY_SUBTASK, EC4_BY_SUBTASK = f"{EC1}-subtask", f"{EC4}-subtask"
"""The learner that is rewarded for each subtask by itself."""
CONTROLS = ("posture-based/one-goal", methods.INITIAL)
"""Methods that do not look beyond the current goal."""


@judges(
    "first-movement-sacrificed",
    test="one-tailed bootstrap tests: the first movement takes more than {ticks:g} tick longer "
    "than in the initial solution, it takes longer than in either placebo (the best of random "
    "guesses, the learner rewarded by subtask), and the whole task is faster",
)
def first_movement_sacrificed(data: Data) -> Finding:
    """The first movement is slower, the whole faster."""
    comparisons = []
    for task in ONE_ARMED:
        first = data.sign("first", task, EC1)
        comparisons += [
            higher(first, by=MARGINS["ticks"]),
            higher(first, data.sign("first", task, PLACEBO)),
            higher(first, data.sign("first", task, EC1_BY_SUBTASK)),
            higher(data.sign("whole", task, EC1)),
        ]
    replayed = [partial(data.replayed_sign, "first", t, EC1) for t in ONE_ARMED]
    return all_of(comparisons, rules.there(replayed))


@judges(
    "context",
    test="permutation tests: postures at goal 1 lie more than {spread:g} pooled SD apart, and "
    "further apart than those of either placebo (the best of random guesses, the learner rewarded "
    "by subtask). For the opposite: fewer than 5 % of bootstrap samples are, or a placebo's lie "
    "further apart",
)
def posture_depends_on_context(data: Data) -> Finding:
    """Postures at goal 1 depend on the goal that follows, more than a placebo's."""
    contexts, replayed = contexts_of(data, EC1), contexts_of(data, EC1, replayed=True)
    equivalent, other = contexts.parts
    parts = [
        f"postures at goal 1 lie {number(contexts.apart, 2)} apart, {number(contexts.spreads, 1)} "
        f"pooled SD; per dimension {number(equivalent, 3)} of that leaves the hand in place and "
        f"{number(other, 3)} moves it",
        f"in noiseless replays {number(replayed.apart, 2)} apart",
    ]
    bound = MARGINS["spread"]
    test = Estimate(contexts.spreads, p=contexts.p, n=(contexts.n,))
    less_p = dependence_below(*contexts.postures, bound, np.random.default_rng(SEED))
    tests = [test]
    against = [replace(test, value=bound - test.value, p=less_p)]
    for label in (PLACEBO, EC1_BY_SUBTASK):
        placebo = contexts_of(data, label)
        more = contexts.apart - placebo.apart
        beyond = replace(test, value=more, n=(contexts.n, placebo.n))
        tests.append(replace(beyond, p=contexts.p_beyond(placebo)))
        against.append(replace(beyond, value=-more, p=placebo.p_beyond(contexts)))
        parts.append(f"{methods.name_of(label)}: {number(placebo.apart, 2)} apart")
    for label in CONTROLS:
        with suppress(MissingError):
            apart = contexts_of(data, label).apart
            parts.append(f"{methods.name_of(label)}: {number(apart, 2)} apart")
    holds = contexts.spreads > bound and all(each.value > 0 for each in tests)
    return Finding(holds, f"{'; '.join(parts)}.", tuple(tests), tuple(against))


def contexts_of(data: Data, label: str, *, replayed: bool = False) -> TwoContexts:
    """Runs of a method that hit goal 1 of both one-armed tasks; MissingError without them."""
    first, second = (data.cell(task, label) for task in ONE_ARMED)
    if replayed:
        first, second = (data.study.replays(task, label) for task in ONE_ARMED)
    contexts = TwoContexts(first, second, 1, "right")
    if not all(contexts.runs):
        raise MissingError(f"no run of {label} hits goal 1 of both tasks with the right hand")
    return contexts


@judges(
    "overall-reward",
    test="one-tailed bootstrap tests on both tasks, EC1 against the same learner with a "
    "reward for each subtask, both by what they learned (noiseless replay): it earns more, and its "
    "first movement takes more than {ticks:g} tick longer",
)
def overall_reward(data: Data) -> Finding:
    """Without a reward for the whole, the first movement is not sacrificed and less is earned."""
    comparisons = []
    for task in ONE_ARMED:
        comparisons += [
            higher(data.replay(task, EC1), data.replay(task, EC1_BY_SUBTASK)),
            higher(
                data.replayed_sign("first", task, EC1),
                data.sign("first", task, EC1_BY_SUBTASK),
                by=MARGINS["ticks"],
            ),
        ]
    return all_of(comparisons)


@judges(
    "arm-coarticulation",
    test="one-tailed bootstrap tests: from the learned posture of base and chosen arm the "
    "corrective process reaches the next goal more than {ticks:g} tick sooner than from the "
    "posture in which it would itself have hit the goal, and by more than in the placebos (the "
    "best of random guesses; of EC4 also the learner rewarded by subtask). The waiting arm "
    "is where it was before the movement. Mean over the goals of a run that others follow",
)
def arm_coarticulation(data: Data) -> Finding:
    """Postures of base and chosen arm leave the next goal nearer."""
    comparisons, replayed = [], []
    for task in TWO_ARMED:
        for label in (EC3, EC4):
            arm = data.sign("arm", task, label)
            comparisons += [
                higher(arm, by=MARGINS["ticks"]),
                higher(arm, data.sign("arm", task, PLACEBO)),
            ]
            if label == EC4:
                comparisons.append(higher(arm, data.sign("arm", task, EC4_BY_SUBTASK)))
            replayed.append(partial(data.replayed_sign, "arm", task, label))
    return all_of(comparisons, rules.there(replayed))


@judges(
    "other-arm-coarticulation",
    test="one-tailed bootstrap tests that what the arm does since its own last hit brings its hand "
    "nearer (0 where it keeps still), as a share of the initial distance, and nearer than in the "
    "placebos (the best of random guesses, the learner rewarded by subtask); mean over the goals "
    "of a run",
)
def other_arm_coarticulation(data: Data) -> Finding:
    """The waiting arm brings its hand nearer to its next goal."""
    arm = data.sign("other arm", TASK_1, EC4)
    comparisons = [
        higher(arm),
        higher(arm, data.sign("other arm", TASK_1, PLACEBO)),
        higher(arm, data.sign("other arm", TASK_1, EC4_BY_SUBTASK)),
    ]
    shown = [
        partial(data.replayed_sign, "other arm", TASK_1, EC4),
        partial(data.sign, "other arm", TASK_1, EC3),
    ]
    return all_of(comparisons, rules.there(shown))


@judges("overall-reward-two-armed", test=TEST_OF_MEANS)
def overall_reward_two_armed(data: Data) -> Finding:
    """Without a reward for the whole less is earned."""
    return all_of(
        higher(data.replay(task, EC4), data.replay(task, EC4_BY_SUBTASK)) for task in TWO_ARMED
    )


@judges(
    "hand-coarticulation-task-1",
    test="one-tailed Fisher's exact tests: in one of the cells more than {few:.0%} of the runs, "
    "and more than of the placebo's, hit a goal that others follow with a hand that is slower for "
    "that goal alone and is not the initial solution's (smallest p times their number). For the "
    "opposite: in each cell fewer than {few:.0%} of the runs do (exact binomial tests)",
)
def slower_hands_are_chosen(data: Data) -> Finding:
    """Whether more runs than of the placebo choose a hand that is slower for its goal alone."""
    task, labels = TASK_1, (EC2, EC3)
    initial = data.initial_execution(task).hands
    chosen = {label: chosen_slower(data.cell(task, label), initial) for label in (*labels, PLACEBO)}
    of_placebo = chosen[PLACEBO] > 0
    tests, against, parts = [], [], []
    for label in labels:
        does = chosen[label] > 0
        count, total = int(does.sum()), len(does)
        table = [[count, total - count], [int(of_placebo.sum()), int((~of_placebo).sum())]]
        p = float(stats.fisher_exact(table, alternative="greater").pvalue)
        more = min(does.mean() - of_placebo.mean(), does.mean() - MARGINS["few"])
        tests.append(Estimate(more, p=p, n=(total, len(of_placebo))))
        against.append(share_test(count, total, MARGINS["few"], "less"))
        seen = gained_by_slower(data.cell(task, label), chosen[label])
        parts.append(f"{task} {who_is(label)}: {count} of {total} runs{seen}")
    parts.append(f"{methods.name_of(PLACEBO)}: {of_placebo.sum()} of {len(of_placebo)} runs")
    best = min(tests, key=lambda test: (test.value <= 0, test.p))
    test = replace(best, p=min(1.0, best.p * len(tests)))
    contrary = max(against, key=lambda test: test.p)
    return Finding(test.value > 0, f"{'; '.join(parts)}.", (test,), (contrary,))


def chosen_slower(cell: Trajectories, initial: str) -> Array:
    """Ticks of the hands that are slower for their goal alone, in each run, shape ``(runs,)``.

    Of goals that others follow, hit with another hand than that of the initial solution.
    """
    first = [HANDS.index(hand) for hand in hands_of(initial)]
    others = hand_numbers(cell.task, cell.runs) != first
    slower = np.where(others, ticks_slower(cell.task, cell.runs), 0.0)
    return np.asarray(slower[:, :-1].sum(axis=1))


def gained_by_slower(cell: Trajectories, slower: Array) -> str:
    """By how many ticks such runs are slower, and how much better they end than the others."""
    rewards = np.array([run.execution.reward for run in cell.runs], dtype=float)
    with_it, without_it = rewards[slower > 0], rewards[slower == 0]
    if not len(with_it):
        return ""
    words = f", slower for these goals by {number(slower[slower > 0].mean(), 0)} ticks"
    if len(without_it):
        better = difference_of_means(with_it, without_it)
        words += f", which end with {estimate(better, 1)} ticks more reward than the others"
    return words
