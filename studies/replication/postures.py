"""Claims on coarticulation: what movements and postures show, more than selection alone shows."""

from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from comparisons import Higher, all_higher
from reader import (
    EC1,
    EC1_BY_SUBTASK,
    EC3,
    EC4,
    EC4_BY_SUBTASK,
    MARGINS,
    ONE_ARMED,
    RANDOM_SEARCH,
    TASK_1,
    TWO_ARMED,
    MissingError,
    there,
)

from coartic.analysis import TwoContexts, number
from coartic.analysis.judging import Finding
from coartic.analysis.random_search import random_search_for
from coartic.analysis.signatures.context_tests import posture_difference_below
from coartic.estimates import FEWEST, SEED, Estimate

ONE_GOAL = "posture-based/one-goal", "corrective-alone/given"
"""Methods that look at the current goal alone."""


def first_movement_sacrificed(read):
    """Test that the first movement is slower and the whole task faster."""
    comparisons = []
    for task in ONE_ARMED:
        first = read.signature("first", task, EC1)
        comparisons += [
            Higher(first, by=MARGINS.rounding_ticks),
            *read.beside_random_search("first", task, EC1),
            Higher(first, read.signature("first", task, EC1_BY_SUBTASK)),
            Higher(read.signature("whole", task, EC1)),
        ]
    replayed = [partial(read.signature, "first", task, EC1, replay=True) for task in ONE_ARMED]
    return all_higher(comparisons, there(replayed))


def posture_depends_on_context(read):
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
        *contexts.configurations, MARGINS.spread, np.random.default_rng(SEED)
    )
    tests = [test]
    against = [replace(test, value=MARGINS.spread - test.value, p=less_p)]
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
    for label in ONE_GOAL:
        with suppress(MissingError):
            posture_difference = contexts_of(read, label).posture_difference
            parts.append(f"{titles[label]}: {number(posture_difference, 2)}")
    holds = contexts.standardised_posture_difference > MARGINS.spread and all(
        each.value > 0 for each in tests
    )
    return Finding(holds, "; ".join(parts), tuple(tests), tuple(against))


def contexts_of(read, label, *, replay=False):
    """Return the runs of a method that hit goal 1 of both one-armed tasks.

    Raises MissingError if one of the tasks has no such run.
    """
    first, second = (read.cell(task, label, replay=replay) for task in ONE_ARMED)
    contexts = TwoContexts(first, second, 1, "right")
    if not contexts.in_both:
        raise MissingError(f"no run of {label} hits goal 1 of both tasks with the right hand")
    return contexts


def overall_reward(read):
    """Test that the learner rewarded by subtask earns less and has a faster first movement."""
    comparisons = []
    for task in ONE_ARMED:
        first = read.signature("first", task, EC1, replay=True)
        comparisons += [
            Higher(read.replay(task, EC1), read.replay(task, EC1_BY_SUBTASK)),
            Higher(first, read.signature("first", task, EC1_BY_SUBTASK), by=MARGINS.rounding_ticks),
        ]
    return all_higher(comparisons)


def arm_coarticulation(read):
    """Test that postures of base and chosen arm shorten the way to the next goal."""
    comparisons, replayed = [], []
    for task in TWO_ARMED:
        for label in (EC3, EC4):
            arm = read.signature("arm", task, label)
            comparisons += [
                Higher(arm, by=MARGINS.rounding_ticks),
                *read.beside_random_search("arm", task, label),
            ]
            if label == EC4:
                comparisons.append(Higher(arm, read.signature("arm", task, EC4_BY_SUBTASK)))
            replayed.append(partial(read.signature, "arm", task, label, replay=True))
    return all_higher(comparisons, there(replayed))


def other_arm_coarticulation(read):
    """Test that the idle arm brings its hand nearer to the next goal of this hand."""
    arm = read.signature("other arm", TASK_1, EC4)
    by_subtask = read.signature("other arm", TASK_1, EC4_BY_SUBTASK)
    beyond = read.beside_random_search("other arm", TASK_1, EC4)
    shown = [
        partial(read.signature, "other arm", TASK_1, EC4, replay=True),
        partial(read.signature, "other arm", TASK_1, EC3),
    ]
    return all_higher([Higher(arm), *beyond, Higher(arm, by_subtask)], there(shown))


def overall_reward_two_armed(read):
    """Test that the learner rewarded by subtask earns less on the two-armed tasks as well."""
    return all_higher(
        Higher(read.replay(task, EC4), read.replay(task, EC4_BY_SUBTASK)) for task in TWO_ARMED
    )


RULES = {
    "first-movement-sacrificed": first_movement_sacrificed,
    "context": posture_depends_on_context,
    "overall-reward": overall_reward,
    "arm-coarticulation": arm_coarticulation,
    "other-arm-coarticulation": other_arm_coarticulation,
    "overall-reward-two-armed": overall_reward_two_armed,
}
"""Rules by the ids of their claims."""
