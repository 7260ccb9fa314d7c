"""The paper's claims on families of random tasks."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from coartic.analysis.claims.data import Data, judges
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.claims.rules import (
    TEST_OF_FAMILIES,
    Comparison,
    higher,
    in_every_family,
    no_trial_fails,
    reported_instances,
)
from coartic.analysis.methods import EC1, EC2, EC3, EC4, LEARNERS, PLACEBO, most_exploring

OF_ONE_ARM = ("one-armed/v1",)
OF_TWO_ARMS = ("two-armed/v1", "aligned/v1", "redundancy/v1", "long/v1")
EVERY_FAMILY = (*OF_ONE_ARM, *OF_TWO_ARMS)
JERK = "trajectory-optimisation/jerk"


@judges("learning-improves-in-general", test=TEST_OF_FAMILIES)
def learning_improves_in_general(data: Data) -> Finding:
    """Replays of the learner that explores most are better than the initial solution."""

    def compare(task: str) -> Comparison:
        label = most_exploring(data.task(task))
        return higher(data.replay(task, label), data.initial(task))

    return in_every_family(data, EVERY_FAMILY, (" replay EC > initial", compare))


@judges(
    "proficiency-rises-in-general",
    test=TEST_OF_FAMILIES,
    pairs={"EC3 > EC2": (EC3, EC2), "EC4 > EC3": (EC4, EC3)},
)
@judges("random-hands-pay-in-general", test=TEST_OF_FAMILIES, pairs={"EC4 > EC2": (EC4, EC2)})
@judges("other-arm-pays-in-general", test=TEST_OF_FAMILIES, pairs={"EC4 > EC3": (EC4, EC3)})
@judges(
    "beats-inaccurate-in-general",
    test=TEST_OF_FAMILIES,
    pairs={f"EC1 > {JERK}": (EC1, JERK)},
    families=OF_ONE_ARM,
)
def earns_more_in_general(
    data: Data, pairs: dict[str, tuple[str, str]], families: Sequence[str] = OF_TWO_ARMS
) -> Finding:
    """Whether the first of each pair of methods earns more."""

    def comparing(first: str, second: str) -> Callable[[str], Comparison]:
        return lambda task: higher(data.reward(task, first), data.reward(task, second))

    pairs_by_name = ((f" {name}", comparing(*pair)) for name, pair in pairs.items())
    return in_every_family(data, families, *pairs_by_name)


@judges("beats-exhaustive-in-general", test=TEST_OF_FAMILIES)
def beats_exhaustive_in_general(data: Data) -> Finding:
    """Learning is better than trying all hands with the corrective process alone."""
    best = (" EC3 > best", lambda task: higher(data.reward(task, EC3), data.best(task)))
    return in_every_family(data, OF_TWO_ARMS, best)


@judges(
    "first-movement-sacrificed-in-general",
    test="one-tailed bootstrap tests over instances, against the corrective process with the same "
    "hands: the first movement takes more than {ticks:g} tick longer, and longer than in the best "
    "of random guesses (placebo); the whole task is faster",
)
def first_movement_sacrificed_in_general(data: Data) -> Finding:
    """The first movement is slower, the whole faster."""
    return in_every_family(
        data,
        OF_ONE_ARM,
        ("", lambda task: higher(data.sign("first", task, EC1), by=MARGINS["ticks"])),
        more_than_placebo(data, "first"),
        ("", lambda task: higher(data.sign("whole", task, EC1))),
    )


def more_than_placebo(data: Data, sign: str) -> tuple[str, Callable[[str], Comparison]]:
    """A sign of the learner that explores most beside that of the placebo."""

    def compare(task: str) -> Comparison:
        first = data.sign(sign, task, most_exploring(data.task(task)))
        return higher(first, data.sign(sign, task, PLACEBO))

    return ", more than random guesses", compare


@judges(
    "hand-coarticulation-in-general",
    test="one-tailed bootstrap tests over instances, in each family, of the difference of the "
    "shares of such goals, and of that to the best of random guesses (placebo)",
)
def hand_coarticulation_in_general(data: Data) -> Finding:
    """Slower hands are chosen more often than where the closest is tried."""
    return in_every_family(
        data,
        OF_TWO_ARMS,
        (
            ", more than EC2",
            lambda task: higher(data.sign("hand", task, EC4), data.sign("hand", task, EC2)),
        ),
        more_than_placebo(data, "hand"),
    )


@judges(
    "arm-coarticulation-in-general",
    test="one-tailed bootstrap tests over instances, in each family: from the learned posture of "
    "base and chosen arm the corrective process reaches the next goal more than {ticks:g} tick "
    "sooner than from the posture in which it would itself have hit the goal, and by more ticks "
    "than in the best of random guesses (placebo). On both sides the waiting arm is where it was "
    "before the movement. EC1 on one arm, EC4 on two; mean over goals",
)
def arm_coarticulation_in_general(data: Data) -> Finding:
    """Postures of base and chosen arm leave the next goal nearer."""

    def compare(task: str) -> Comparison:
        arm = data.sign("arm", task, most_exploring(data.task(task)))
        return higher(arm, by=MARGINS["ticks"])

    return in_every_family(data, EVERY_FAMILY, ("", compare), more_than_placebo(data, "arm"))


@judges(
    "other-arm-coarticulation-in-general",
    test="one-tailed bootstrap tests over instances, in each family, that the hand of the waiting "
    "arm gets nearer (0 where it keeps still; runs with both hands), and nearer than in the best "
    "of random guesses (placebo)",
)
def other_arm_coarticulation_in_general(data: Data) -> Finding:
    """The waiting arm brings its hand nearer to its next goal."""
    return in_every_family(
        data,
        OF_TWO_ARMS,
        ("", lambda task: higher(data.sign("other arm", task, EC4))),
        more_than_placebo(data, "other arm"),
    )


@judges("corrective-ensures-in-general", test="exact: failed trials of the learner")
def corrective_ensures_in_general(data: Data) -> Finding:
    """No trial fails."""
    names = [name for family in EVERY_FAMILY for name in reported_instances(data, family)]
    cells = [(name, label) for name in names for label in LEARNERS]
    return no_trial_fails(data, [cell for cell in cells if cell in data.study.cells])
