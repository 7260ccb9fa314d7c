"""Define the rules of claims on coarticulation, also in comparison with mere selection."""

from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np
from comparisons import Higher, all_higher
from judging import Finding
from published import TRIALS
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

from coartic.analysis import TwoContexts, contexts_of_control, number
from coartic.analysis.signatures import posture_difference_below
from coartic.estimates import SEED, Estimate

ONE_GOAL = "posture-based/one-goal", "corrective-alone/given"
"""Methods that consider only the current goal."""


def first_movement_slower(read):
    """Test that the first movement is slower and the whole task faster."""
    comparisons = []
    for task in ONE_ARMED:
        comparisons += [
            Higher(read.signature("first", task, EC1), by=MARGINS.rounding_ticks),
            Higher(read.signature("whole", task, EC1)),
        ]
    shown = [
        partial(read.signature, "first", task, label, replay=label == EC1)
        for task in ONE_ARMED
        for label in (EC1, EC1_BY_SUBTASK)
    ]
    return all_higher(comparisons, there(shown))


def posture_depends_on_context(read):
    """Test that the posture at goal 1 depends on the next goal."""
    contexts, replayed = contexts_of(read, EC1), contexts_of(read, EC1, replay=True)
    (equivalent, other), titles = contexts.parts, read.study.methods.title
    parts = [
        f"posture difference at goal 1 {number(contexts.posture_difference, 2)}, standardised "
        f"{number(contexts.standardised_posture_difference, 1)} pooled SD; per dimension "
        f"{number(equivalent, 3)} of it leaves the hand in place and {number(other, 3)} moves it",
        f"in noiseless replays {number(replayed.posture_difference, 2)}",
    ]
    for label in (EC1_BY_SUBTASK, *ONE_GOAL):
        with suppress(MissingError):
            posture_difference = contexts_of(read, label).posture_difference
            parts.append(f"{titles[label]}: {number(posture_difference, 2)}")
    test = Estimate(contexts.standardised_posture_difference, p=contexts.p, n=(contexts.n,))
    less_p = posture_difference_below(
        *contexts.configurations, MARGINS.spread, np.random.default_rng(SEED)
    )
    against = replace(test, value=MARGINS.spread - test.value, p=less_p)
    return Finding(test.value > MARGINS.spread, "; ".join(parts), (test,), (against,))


def posture_beyond_random_search(read):
    """Test that the posture difference at goal 1 exceeds the difference of random search."""
    contexts = contexts_of(read, EC1)
    control = contexts_of_control(read.study, contexts)
    if control is None:
        raise MissingError(f"no {RANDOM_SEARCH} with {TRIALS} trials ran on both tasks")
    more = contexts.posture_difference - control.posture_difference
    test = Estimate(more, p=contexts.p_beyond(control), n=(contexts.n, control.n))
    against = replace(test, value=-more, p=control.p_beyond(contexts))
    words = (
        f"posture difference at goal 1 {number(contexts.posture_difference, 2)} against "
        f"{number(control.posture_difference, 2)} (random search)"
    )
    return Finding(more > 0, words, (test,), (against,))


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
    """Test that a learner rewarded by subtask earns less and has a faster first movement."""
    comparisons = []
    for task in ONE_ARMED:
        first = read.signature("first", task, EC1, replay=True)
        comparisons += [
            Higher(read.replay(task, EC1), read.replay(task, EC1_BY_SUBTASK)),
            Higher(first, read.signature("first", task, EC1_BY_SUBTASK), by=MARGINS.rounding_ticks),
        ]
    return all_higher(comparisons)


def arm_coarticulation(read):
    """Test that postures of base and chosen arm shorten the path to the next goal."""
    cells = [(task, label) for task in TWO_ARMED for label in (EC3, EC4)]
    shown = [partial(read.signature, "arm", *cell, replay=True) for cell in cells]
    shown += [partial(read.signature, "arm", task, EC4_BY_SUBTASK) for task in TWO_ARMED]
    comparisons = [
        Higher(read.signature("arm", *cell), by=MARGINS.rounding_ticks) for cell in cells
    ]
    return all_higher(comparisons, there(shown))


def other_arm_coarticulation(read):
    """Test that the idle arm brings its hand nearer to the next goal of this hand."""
    shown = [
        partial(read.signature, "other arm", TASK_1, EC4, replay=True),
        partial(read.signature, "other arm", TASK_1, EC3),
        partial(read.signature, "other arm", TASK_1, EC4_BY_SUBTASK),
    ]
    return all_higher([Higher(read.signature("other arm", TASK_1, EC4))], there(shown))


def beyond_random_search(signature, cells):
    """Return a rule that tests that learners show more of a signature than random search."""
    return lambda read: all_higher(
        pair for cell in cells for pair in read.beyond_random_search(signature, *cell)
    )


RULES = {
    "first-movement-sacrificed": first_movement_slower,
    "context": posture_depends_on_context,
    "overall-reward": overall_reward,
    "arm-coarticulation": arm_coarticulation,
    "other-arm-coarticulation": other_arm_coarticulation,
    "overall-reward-two-armed": lambda read: all_higher(
        Higher(read.replay(task, EC4), read.replay(task, EC4_BY_SUBTASK)) for task in TWO_ARMED
    ),
}
"""Rules by the ids of their claims."""
BEYOND = {
    "first-movement-sacrificed": beyond_random_search("first", [(task, EC1) for task in ONE_ARMED]),
    "context": posture_beyond_random_search,
    "arm-coarticulation": beyond_random_search(
        "arm", [(task, label) for task in TWO_ARMED for label in (EC3, EC4)]
    ),
    "other-arm-coarticulation": beyond_random_search("other arm", [(TASK_1, EC4)]),
}
"""Rules that say whether learners show more than random search, by the ids of their claims."""
