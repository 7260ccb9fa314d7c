"""The paper's claims, on its own tasks, that the learner learns coarticulation."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
import scipy

from coartic.analysis.claims import margins
from coartic.analysis.claims.claim import Claim, all_higher
from coartic.analysis.claims.judging import Finding
from coartic.analysis.claims.reader import Higher, MissingError, Reader, there, who_is
from coartic.analysis.methods import EC1, EC2, EC3, EC4, INITIAL, RANDOM_SEARCH
from coartic.analysis.random_search import random_search_for
from coartic.analysis.signatures.context_tests import posture_difference_below
from coartic.analysis.signatures.measures import ticks_slower
from coartic.analysis.signatures.two_contexts import TwoContexts
from coartic.analysis.solutions import Solutions
from coartic.analysis.statistics.hypotheses import share_test
from coartic.analysis.words import estimate, number
from coartic.estimates import FEWEST, SEED, Estimate, difference_of_means
from coartic.robot import HANDS, Array
from coartic.tasks.task import hands_of

ONE_ARMED = "ascending", "descending"
TWO_ARMED = TASK_1, TASK_2 = "two-armed-1", "two-armed-2"
EC1_BY_SUBTASK, EC4_BY_SUBTASK = f"{EC1}-subtask", f"{EC4}-subtask"
"""The learner with a reward for each subtask by itself."""
TEST_OF_MEANS = "one-tailed bootstrap test of the mean reward for each comparison"


def first_movement_sacrificed(read: Reader) -> Finding:
    """Test that the first movement is slower and the whole task faster."""
    comparisons = []
    for task in ONE_ARMED:
        first = read.signature("first", task, EC1)
        comparisons += [
            Higher(first, by=margins.ROUNDING_TICKS),
            *read.beside_random_search("first", task, EC1),
            Higher(first, read.signature("first", task, EC1_BY_SUBTASK)),
            Higher(read.signature("whole", task, EC1)),
        ]
    replayed = [partial(read.signature, "first", task, EC1, replay=True) for task in ONE_ARMED]
    return all_higher(comparisons, there(replayed))


def posture_depends_on_context(read: Reader) -> Finding:
    """Test that the posture at goal 1 depends on the next goal, more than in random search."""
    contexts, replayed = contexts_of(read, EC1), contexts_of(read, EC1, replay=True)
    (equivalent, other), titles = contexts.parts, read.study.methods.title
    parts = [
        f"posture difference at goal 1 {number(contexts.posture_difference, 2)}, standardised "
        f"{number(contexts.standardised_posture_difference, 1)} pooled SD; per dimension "
        f"{number(equivalent, 3)} of it leaves the hand in place and {number(other, 3)} moves it",
        f"in noiseless replays {number(replayed.posture_difference, 2)}",
    ]
    test = Estimate(contexts.standardised_posture_difference, p=contexts.p, n=(contexts.n,))
    less_p = posture_difference_below(
        *contexts.configurations, margins.SPREAD, np.random.default_rng(SEED)
    )
    tests = [test]
    against = [replace(test, value=margins.SPREAD - test.value, p=less_p)]
    for label in read.random_search(ONE_ARMED[0]):
        contexts_of(read, label)
    farthest = random_search_for(read.study, contexts)
    if farthest is None:
        raise MissingError(
            f"fewer than {FEWEST} runs of {RANDOM_SEARCH} improved on the corrective process alone"
        )
    for compared in (farthest, contexts_of(read, EC1_BY_SUBTASK)):
        more = contexts.posture_difference - compared.posture_difference
        beyond = replace(test, value=more, n=(contexts.n, compared.n))
        tests.append(replace(beyond, p=contexts.p_beyond(compared)))
        against.append(replace(beyond, value=-more, p=compared.p_beyond(contexts)))
        parts.append(f"{titles[compared.method]}: {number(compared.posture_difference, 2)}")
    for label in ("posture-based/one-goal", INITIAL):  # which look at the current goal
        with suppress(MissingError):
            posture_difference = contexts_of(read, label).posture_difference
            parts.append(f"{titles[label]}: {number(posture_difference, 2)}")
    holds = contexts.standardised_posture_difference > margins.SPREAD and all(
        each.value > 0 for each in tests
    )
    return Finding(holds, "; ".join(parts), tuple(tests), tuple(against))


def contexts_of(read: Reader, label: str, *, replay: bool = False) -> TwoContexts:
    """Return the runs of a method that hit goal 1 of both one-armed tasks.

    Raises MissingError if one of the tasks has no such run.
    """
    first, second = (read.cell(task, label, replay=replay) for task in ONE_ARMED)
    contexts = TwoContexts(first, second, 1, "right")
    if not contexts.in_both:
        raise MissingError(f"no run of {label} hits goal 1 of both tasks with the right hand")
    return contexts


def overall_reward(read: Reader) -> Finding:
    """Test that the learner rewarded by subtask earns less and has a faster first movement."""
    comparisons = []
    for task in ONE_ARMED:
        first = read.signature("first", task, EC1, replay=True)
        comparisons += [
            Higher(read.replay(task, EC1), read.replay(task, EC1_BY_SUBTASK)),
            Higher(first, read.signature("first", task, EC1_BY_SUBTASK), by=margins.ROUNDING_TICKS),
        ]
    return all_higher(comparisons)


def arm_coarticulation(read: Reader) -> Finding:
    """Test that postures of base and chosen arm shorten the way to the next goal."""
    comparisons, replayed = [], []
    for task in TWO_ARMED:
        for label in (EC3, EC4):
            arm = read.signature("arm", task, label)
            comparisons += [
                Higher(arm, by=margins.ROUNDING_TICKS),
                *read.beside_random_search("arm", task, label),
            ]
            if label == EC4:
                comparisons.append(Higher(arm, read.signature("arm", task, EC4_BY_SUBTASK)))
            replayed.append(partial(read.signature, "arm", task, label, replay=True))
    return all_higher(comparisons, there(replayed))


def other_arm_coarticulation(read: Reader) -> Finding:
    """Test that the idle arm brings its hand nearer to the next goal of this hand."""
    arm = read.signature("other arm", TASK_1, EC4)
    by_subtask = read.signature("other arm", TASK_1, EC4_BY_SUBTASK)
    beyond = read.beside_random_search("other arm", TASK_1, EC4)
    shown = [
        partial(read.signature, "other arm", TASK_1, EC4, replay=True),
        partial(read.signature, "other arm", TASK_1, EC3),
    ]
    return all_higher([Higher(arm), *beyond, Higher(arm, by_subtask)], there(shown))


def slower_hands_are_chosen(read: Reader) -> Finding:
    """Test that more runs than in random search choose a hand that is slower for its goal alone."""
    task, labels = TASK_1, (EC2, EC3)
    initial = read.initial_execution(task).hands
    chosen = {label: chosen_slower(read.cell(task, label), initial) for label in labels}
    random_search = {
        label: chosen_slower(read.cell(task, label), initial) > 0
        for label in read.random_search(task)
    }
    label_of_random_search, of_random_search = max(
        random_search.items(), key=lambda item: item[1].mean()
    )
    tests, against, parts = [], [], []
    for label in labels:
        does = chosen[label] > 0
        count, total = int(does.sum()), len(does)
        table = [
            [count, total - count],
            [int(of_random_search.sum()), int((~of_random_search).sum())],
        ]
        p = float(scipy.stats.fisher_exact(table, alternative="greater").pvalue)
        more = min(does.mean() - of_random_search.mean(), does.mean() - margins.FEW)
        tests.append(Estimate(more, p=p, n=(total, len(of_random_search))))
        against.append(share_test(count, total, margins.FEW, "less"))
        parts.append(f"{read.title(task)} {who_is(label)}: {count} of {total} runs")
        if count:
            ticks = number(chosen[label][does].mean(), 0)
            parts[-1] += f", slower for these goals by {ticks} ticks"
        if 0 < count < total:
            rewards = np.array([run.reward for run in read.cell(task, label).runs], dtype=float)
            better = estimate(difference_of_means(rewards[does], rewards[~does]), 1)
            parts[-1] += f", which end with {better} ticks more reward than the others"
    parts.append(
        f"{read.study.methods.title[label_of_random_search]}: {of_random_search.sum()} of "
        f"{len(of_random_search)} runs"
    )
    best = min(tests, key=lambda test: (test.value <= 0, test.p))
    test = replace(best, p=min(1.0, best.p * len(tests)))
    contrary = max(against, key=lambda test: test.p)
    return Finding(test.value > 0, "; ".join(parts), (test,), (contrary,))


def chosen_slower(cell: Solutions, initial: str) -> Array:
    """Return the ticks by which chosen hands are slower for their goals alone, shape ``(runs,)``.

    The sum over the goals, without the last, that are hit with another hand than in the initial
    solution.
    """
    first = [HANDS.index(hand) for hand in hands_of(initial)]
    slower = np.where(cell.hands != first, ticks_slower(cell), 0.0)
    return np.asarray(slower[:, :-1].sum(axis=1))


CLAIMS_OF_COARTICULATION = [
    # Those first that make the paper's point and rest on little that we chose.
    Claim(
        id="first-movement-sacrificed",
        text="The first movement gets slower than in the initial solution while the whole task "
        "gets faster.",
        place="Results, Exploration Condition 1, Figure 5",
        quote="the reward incurred after making the first movement is more negative",
        test="one-tailed bootstrap tests: the first movement takes more than 1 tick longer than in "
        "the initial solution, it takes longer than in random search (runs that improved on the "
        "corrective process alone, as many trials) and in the learner rewarded by subtask, and the "
        "whole task is faster",
        judge=first_movement_sacrificed,
        short="the first movement is sacrificed",
    ),
    Claim(
        id="context",
        text="The first goal is hit in another posture when another goal follows (ascending "
        "against descending).",
        place="Results, Exploration Condition 1, Figure 5",
        quote="the joint configuration the robot used to hit the first goal differed",
        test="permutation tests: the standardised posture difference at goal 1 exceeds 1 pooled "
        "SD, and the posture difference exceeds that of random search (runs that improved on the "
        "corrective process alone, as many trials) and of the learner rewarded by subtask. For the "
        "opposite: it exceeds 1 in fewer than 5 % of bootstrap samples, or one of the others has a "
        "larger difference",
        judge=posture_depends_on_context,
        short="the posture depends on the next goal",
    ),
    Claim(
        id="overall-reward",
        text="The reward for the whole task makes the difference: a learner that is rewarded for "
        "each subtask by itself does not sacrifice the first movement and ends with less.",
        place="Discussion",
        quote="Crucial to our results was the use of hierarchical optimization",
        test="one-tailed bootstrap tests on both tasks, EC1 against the same learner with a reward "
        "for each subtask, both by what they learned (noiseless replay): it earns more, and its "
        "first movement takes more than 1 tick longer",
        judge=overall_reward,
        short="the reward for the whole task makes the difference",
    ),
    Claim(
        id="arm-coarticulation",
        text="Coarticulation shows in the chosen arm: base and arm hit a goal in a posture that "
        "leaves the next goal nearer (both two-armed tasks, EC3 and EC4; the idle arm is left "
        "out).",
        place="Abstract; Discussion",
        quote="how the corresponding arm was used",
        test="one-tailed bootstrap tests: from the learned posture of base and chosen arm the "
        "corrective process reaches the next goal more than 1 tick sooner than from the posture in "
        "which it would itself have hit the goal, and by more than in random search with the same "
        "hands (runs that improved on the corrective process alone with them, as many trials; each "
        "hand sequence of a tenth of the runs) and, under EC4, in the learner rewarded by subtask. "
        "The idle arm is where it was before the movement. Mean over the goals of a run that "
        "others follow",
        judge=arm_coarticulation,
        fitted=True,
        sets="224 of 242 (Two-armed 1, refuted in 6); 131 of 240 (Two-armed 2, refuted in 44)",
    ),
    Claim(
        id="other-arm-coarticulation",
        text="Coarticulation shows in the idle arm: under EC4 it brings its hand nearer to the "
        "goal that it will hit next (Two-armed 1).",
        place="Method, The Learning Process; Discussion",
        quote="possibly in way so that the robot would be able to hit",
        test="one-tailed bootstrap tests that what the arm does since its own last hit brings its "
        "hand nearer (0 where it keeps still), as a share of the initial distance, and nearer than "
        "in random search with the same hands (runs that improved, as many trials) and in the "
        "learner rewarded by subtask; mean over the goals of a run",
        judge=other_arm_coarticulation,
        fitted=True,
        sets="240 of 242 (Two-armed 1)",
    ),
    Claim(
        id="overall-reward-two-armed",
        text="On the two-armed tasks as well, EC4 ends with less where each subtask is rewarded by "
        "itself.",
        place="Discussion",
        quote="the reward signal was based on performance across the overall task",
        test=TEST_OF_MEANS,
        judge=lambda read: all_higher(
            Higher(read.replay(task, EC4), read.replay(task, EC4_BY_SUBTASK)) for task in TWO_ARMED
        ),
        fitted=True,
    ),
    Claim(
        id="hand-coarticulation-task-1",
        text="On Two-armed 1 coarticulation shows in the choice of hand, under EC2 or EC3: goals "
        "that others follow are hit with a hand that is slower for that goal alone.",
        place="Method, Two-Armed Task 1; Discussion, Figure 6",
        quote="Coarticulation was seen in terms of which arm was used",
        test="one-tailed Fisher's exact tests: under one of the conditions more than 25% of the "
        "runs, and more than of random search, hit a goal that others follow with a hand that is "
        "slower for that goal alone and is not the initial solution's (smallest p times their "
        "number). For the opposite: under each condition fewer than 25% of the runs do (exact "
        "binomial tests)",
        judge=slower_hands_are_chosen,
        fitted=True,
    ),
]
