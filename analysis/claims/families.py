"""The paper's claims on families of random tasks, each with its words and how it is judged."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from statistics import median

from coartic.analysis.claims import margins
from coartic.analysis.claims.claim import Claim, all_positive, no_trial_fails
from coartic.analysis.claims.judging import Finding, all_of, mean_beyond
from coartic.analysis.claims.reader import Higher, MissingError, Reader, who_is
from coartic.analysis.methods import (
    CONDITION_OF,
    EC1,
    EC2,
    EC3,
    EC4,
    LEARNERS,
    RANDOM_SEARCH,
    most_exploring,
)
from coartic.analysis.optima import BestKnown
from coartic.analysis.standings import best_of_instances
from coartic.analysis.words import estimate, listed, number
from coartic.estimates import FEWEST, mean

OF_ONE_ARM = ("one-armed/v1",)
OF_TWO_ARMS = ("two-armed/v1", "aligned/v1", "redundancy/v1", "long/v1")
EVERY_FAMILY = (*OF_ONE_ARM, *OF_TWO_ARMS)
JERK = "trajectory-optimisation/jerk"
Comparing = tuple[str, Callable[[Reader, str], Higher]]
"""Words that follow the name of a family, and a function that compares on a task."""


def in_every_family(
    families: Sequence[str], comparisons: Iterable[Comparing], read: Reader
) -> Finding:
    """Test comparisons in the mean over the instances of each family.

    Differences of rewards are in per cent of the best known reward. Where a comparison has too few
    instances in a family, the claim is not judged, and the evidence has the other comparisons.
    """
    findings, parts, few = [], [], []
    for name, compare in comparisons:
        for family in families:
            values = []
            for task, best in reported_instances(read, family).items():
                with suppress(MissingError):
                    first, second, margin = compare(read, task)
                    other = 0.0 if second is None else second.numbers.mean()
                    unit = 1.0 if first.quantity else 100 / abs(best.reward)
                    values.append(unit * float(first.numbers.mean() - other))
            if len(values) < FEWEST:
                few.append(f"{family}{name}")
                continue
            findings.append(mean_beyond("", values, margin))
            digits, unit_of = (2, "") if first.quantity else (1, " %")
            seen = estimate(mean(values), digits) + unit_of
            quantity = first.quantity or "gain as a share of the best known reward"
            many = f"{number(median(values), digits)}{unit_of} on the median one"
            parts.append((quantity, f"{family}{name}: {seen} on {len(values)} instances, {many}"))
    if not findings:
        raise MissingError(f"fewer than {FEWEST} instances of {listed(few)} can be judged")
    finding = all_of(*findings)
    evidence = all_positive(finding.tests, parts).evidence
    if few:
        seen = f"fewer than {FEWEST} instances can be judged of {listed(few)}. {evidence}"
        return Finding(None, seen)
    return replace(finding, evidence=evidence)


def reported_instances(read: Reader, family: str) -> dict[str, BestKnown]:
    """Return the best known rewards of a family's instances, without development instances."""
    reported = {
        name: best
        for name, best in best_of_instances(read.study).items()
        if read.task(name).family == family and read.task(name).split != "development"
    }
    if not reported:
        raise MissingError(f"this folder has no instances of {family} that can be judged")
    return reported


def earns_more(families: Sequence[str], *pairs: tuple[str, str]) -> Callable[[Reader], Finding]:
    """Return a function that tests that the first method of each pair earns more."""

    def comparing(first: str, second: str) -> Comparing:
        words = " > ".join(CONDITION_OF.get(label, label) for label in (first, second))
        return f" {words}", lambda read, task: Higher(
            read.reward(task, first), read.reward(task, second)
        )

    return partial(in_every_family, families, [comparing(*pair) for pair in pairs])


def shows(signature: str, *, by: float = 0.0, beyond: str = "") -> Comparing:
    """Compare a signature of the learner with 0, with another condition or with random search."""

    def compare(read: Reader, task: str) -> Higher:
        first = read.signature(signature, task, most_exploring(read.task(task)))
        if beyond == RANDOM_SEARCH:
            label = most_exploring(read.task(task))
            return Higher(read.excess_over_random_search(signature, task, label), None, by)
        return Higher(first, read.signature(signature, task, beyond) if beyond else None, by)

    return f", more than {who_is(beyond)}" if beyond else "", compare


def improvement(read: Reader, task: str) -> Higher:
    """Compare the reward of the replay with the reward of the initial solution."""
    return Higher(read.replay(task, most_exploring(read.task(task))), read.initial(task))


def every_trial_completes(read: Reader) -> Finding:
    """Count the failed trials of the learner in all families."""
    names = [name for family in EVERY_FAMILY for name in reported_instances(read, family)]
    cells = [(name, label) for name in names for label in LEARNERS]
    return no_trial_fails(read, [cell for cell in cells if cell in read.study.cells])


on_families = partial(
    Claim,
    test="one-tailed bootstrap tests over instances of the mean difference, as a share of the best "
    "known reward, in each family",
    group="families",
)

CLAIMS_ON_FAMILIES = [
    on_families(
        id="learning-improves-in-general",
        text="In every family of random tasks learning improves on the initial solution.",
        place="Results, Summary of Two-Armed Task Results",
        quote="each bar is significantly higher than the bar to its left",
        judge=partial(in_every_family, EVERY_FAMILY, [(" replay EC > initial", improvement)]),
    ),
    on_families(
        id="proficiency-rises-in-general",
        text="In every family with two arms reward rises when more is explored: EC3 is better than "
        "EC2, and EC4 better than EC3.",
        place="Method, Experiments",
        quote="proficiency would increase as the number of levels",
        judge=earns_more(OF_TWO_ARMS, (EC3, EC2), (EC4, EC3)),
    ),
    on_families(
        id="random-hands-pay-in-general",
        text="In every family with two arms it is better to try hands at random than to try the "
        "closest one: EC4 is better than EC2.",
        place="Results, Exploration Condition 2",
        quote="did not produce enough exploration to reliably find a better",
        judge=earns_more(OF_TWO_ARMS, (EC4, EC2)),
    ),
    on_families(
        id="other-arm-pays-in-general",
        text="In every family with two arms moving the other arm as well is better: EC4 beats EC3.",
        place="Results, Exploration Condition 4",
        quote="but performance increased",
        judge=earns_more(OF_TWO_ARMS, (EC4, EC3)),
    ),
    on_families(
        id="beats-exhaustive-in-general",
        text="In every family with two arms EC3 is better than trying every hand sequence with the "
        "corrective process alone.",
        place="Results, Exploration Condition 3",
        quote="the overall performance with exploration at AModChosen and DASel was better",
        judge=partial(
            in_every_family,
            OF_TWO_ARMS,
            [(" EC3 > best", lambda read, task: Higher(read.reward(task, EC3), read.best(task)))],
        ),
    ),
    on_families(
        id="beats-inaccurate-in-general",
        text="On random tasks for one arm the learner finds better movements than a planner whose "
        "objective is not the reward (minimum jerk).",
        place="Discussion, Implications of Using a Simple Learning Process",
        quote="movements can be found (if they exist) that deliver better consequences",
        judge=earns_more(OF_ONE_ARM, (EC1, JERK)),
    ),
    on_families(
        id="first-movement-sacrificed-in-general",
        text="On random tasks for one arm the first movement gets slower than in the initial "
        "solution while the whole task gets faster.",
        place="Results, Exploration Condition 1",
        quote="the reward incurred after making the first movement is more negative",
        test="one-tailed bootstrap tests over instances, against the corrective process with the "
        "same hands: the first movement takes more than 1 tick longer, and longer than in "
        "random search (runs that improved); the whole task is faster",
        judge=partial(
            in_every_family,
            OF_ONE_ARM,
            [
                shows("first", by=margins.ROUNDING_TICKS),
                shows("first", beyond=RANDOM_SEARCH),
                shows("whole"),
            ],
        ),
    ),
    on_families(
        id="hand-coarticulation-in-general",
        text="In every family with two arms coarticulation shows in the choice of hand: goals that "
        "others follow are hit with the slower hand for that goal alone more often where hands are "
        "learned (EC4) than where the closest is tried (EC2).",
        place="Discussion",
        quote="Coarticulation was seen in terms of which arm was used",
        test="one-tailed bootstrap tests over instances, in each family, of the difference of the "
        "shares of such goals, and of that to random search",
        judge=partial(
            in_every_family,
            OF_TWO_ARMS,
            [shows("hand", beyond=EC2), shows("hand", beyond=RANDOM_SEARCH)],
        ),
    ),
    on_families(
        id="arm-coarticulation-in-general",
        text="In every family learned postures of base and chosen arm leave the next goal nearer "
        "(the idle arm is left out).",
        place="Abstract; Discussion",
        quote="how the corresponding arm was used",
        test="one-tailed bootstrap tests over instances, in each family: from the learned posture "
        "of base and chosen arm the corrective process reaches the next goal more than 1 tick "
        "sooner than from the posture in which it would itself have hit the goal, and by more "
        "ticks than in random search with the same hands (runs that improved). On both sides the "
        "idle arm is where it was before the movement. EC1 on one arm, EC4 on two; mean over goals",
        judge=partial(
            in_every_family,
            EVERY_FAMILY,
            [shows("arm", by=margins.ROUNDING_TICKS), shows("arm", beyond=RANDOM_SEARCH)],
        ),
    ),
    on_families(
        id="other-arm-coarticulation-in-general",
        text="In every family with two arms the idle arm brings its hand nearer to its own next "
        "goal under EC4.",
        place="Method, The Learning Process; Discussion",
        quote="possibly in way so that the robot would be able to hit",
        test="one-tailed bootstrap tests over instances, in each family, that the hand of the "
        "idle arm gets nearer (0 where it keeps still; runs with both hands), and nearer than "
        "in random search with the same hands (runs that improved)",
        judge=partial(
            in_every_family,
            OF_TWO_ARMS,
            [shows("other arm"), shows("other arm", beyond=RANDOM_SEARCH)],
        ),
    ),
    on_families(
        id="corrective-ensures-in-general",
        text="In every family the corrective process completes every trial of the learner.",
        place="Method, The Corrective Process; Discussion, Multiple Controller Schemes",
        quote="to ensure that the overall task is accomplished",
        test="exact: failed trials of the learner",
        judge=every_trial_completes,
        group="exact",
    ),
]
