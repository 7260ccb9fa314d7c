"""Define the rules of claims on families of random tasks, which compare means over instances."""

from contextlib import suppress
from dataclasses import replace
from itertools import product
from statistics import median

from comparisons import Higher, describe_parts, written
from judging import Finding, all_of, mean_beyond
from performance import no_trial_fails
from reader import CONDITIONS, EC1, EC2, EC3, EC4, LEARNER, MARGINS, MissingError

from coartic.analysis import mean, number
from coartic.estimates import MIN_TASKS

OF_ONE_ARM = ("one-armed/v1",)
OF_TWO_ARMS = ("two-armed/v1", "aligned/v1", "redundancy/v1", "long/v1")
EVERY_FAMILY = (*OF_ONE_ARM, *OF_TWO_ARMS)
JERK = "trajectory-optimisation/jerk"


def in_families(families, *comparisons):
    """Return a rule that tests comparisons of means over the instances of each family.

    ``comparisons`` are pairs of words that follow the name of a family, and a function that
    compares on a task. Differences of rewards are in per cent of the best known reward. If a
    comparison has too few instances in a family, the claim is not judged, and the evidence has the
    other comparisons.
    """

    def rule(read):
        findings, parts, few = [], [], []
        for (name, compare), family in product(comparisons, families):
            values = []
            for task, best in reported_instances(read, family).items():
                with suppress(MissingError):
                    first, second, margin = compare(read, task)
                    other = 0.0 if second is None else second.numbers.mean()
                    unit = 1.0 if first.quantity else 100 / abs(best.reward)
                    values.append(unit * float(first.numbers.mean() - other))
            if len(values) < MIN_TASKS:
                few.append(f"{family}{name}")
                continue
            findings.append(mean_beyond("{}", values, margin))
            digits, unit_of = (2, "") if first.quantity else (1, " %")
            seen = written(mean(values), digits) + unit_of
            quantity = first.quantity or "gain as a share of the best known reward"
            many = f"{number(median(values), digits)}{unit_of} on the median one"
            parts.append((quantity, f"{family}{name}: {seen} on {len(values)} instances, {many}"))
        if not findings:
            raise MissingError(f"fewer than {MIN_TASKS} instances of {listed(few)} can be judged")
        finding = all_of(*findings)
        evidence = describe_parts(parts)
        if few:
            seen = f"fewer than {MIN_TASKS} instances can be judged of {listed(few)}. {evidence}"
            return Finding(None, seen)
        return replace(finding, evidence=evidence)

    return rule


def listed(words):
    """Write a list: ``a, b and c``."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def reported_instances(read, family):
    """Return the best known rewards of a family's instances by name.

    Development instances are left out. Raises MissingError if the folder has no instances.
    """
    tasks = read.study.tasks
    reported = {
        name: best
        for name, best in read.study.optima.items()
        if tasks[name].family == family and tasks[name].split != "development"
    }
    if not reported:
        raise MissingError(f"this folder has no instances of {family} that can be judged")
    return reported


def most_exploring(read, task):
    """Return the learner's condition that explores most on a task."""
    return EC4 if len(read.task(task).hands) > 1 else EC1


def earns(first, second):
    """Return a comparison of the rewards of two methods for :func:`in_families`."""
    words = " > ".join(label.removeprefix(LEARNER) for label in (first, second))
    return f" {words}", lambda read, task: Higher(
        read.reward(task, first), read.reward(task, second)
    )


def shows(signature, *, by=0.0):
    """Return a comparison of a signature of the learner with the margin ``by``."""
    return "", lambda read, task: Higher(
        read.signature(signature, task, most_exploring(read, task)), None, by
    )


def shows_beyond_random_search(signature):
    """Return a comparison of a signature of the learner with that of random search."""

    def compare(read, task):
        label = most_exploring(read, task)
        read.signature(signature, task, label)
        return Higher(read.excess_over_random_search(signature, task, label))

    return ", more than random search", compare


def every_trial_completes(read):
    """Count the failed trials of the learner in all families."""
    names = [name for family in EVERY_FAMILY for name in reported_instances(read, family)]
    cells = [(name, label) for name in names for label in CONDITIONS]
    return no_trial_fails(read, [cell for cell in cells if cell in read.study.cells])


RULES = {
    "learning-improves-in-general": in_families(
        EVERY_FAMILY,
        (
            " replay EC > initial",
            lambda read, task: Higher(
                read.replay(task, most_exploring(read, task)), read.initial(task)
            ),
        ),
    ),
    "proficiency-rises-in-general": in_families(OF_TWO_ARMS, earns(EC3, EC2), earns(EC4, EC3)),
    "random-hands-pay-in-general": in_families(OF_TWO_ARMS, earns(EC4, EC2)),
    "other-arm-pays-in-general": in_families(OF_TWO_ARMS, earns(EC4, EC3)),
    "beats-exhaustive-in-general": in_families(
        OF_TWO_ARMS,
        (" EC3 > best", lambda read, task: Higher(read.reward(task, EC3), read.best(task))),
    ),
    "beats-inaccurate-in-general": in_families(OF_ONE_ARM, earns(EC1, JERK)),
    "first-movement-sacrificed-in-general": in_families(
        OF_ONE_ARM,
        shows("first", by=MARGINS.rounding_ticks),
        shows("whole"),
    ),
    "hand-coarticulation-in-general": in_families(
        OF_TWO_ARMS,
        (  # EC2 tries the closest hand
            ", more than EC2",
            lambda read, task: Higher(*(read.signature("hand", task, each) for each in (EC4, EC2))),
        ),
    ),
    "arm-coarticulation-in-general": in_families(
        EVERY_FAMILY, shows("arm", by=MARGINS.rounding_ticks)
    ),
    "other-arm-coarticulation-in-general": in_families(OF_TWO_ARMS, shows("other arm")),
    "corrective-ensures-in-general": every_trial_completes,
}
"""Rules by the ids of their claims."""
BEYOND = {
    f"{name}-in-general": in_families(families, shows_beyond_random_search(signature))
    for name, families, signature in (
        ("first-movement-sacrificed", OF_ONE_ARM, "first"),
        ("hand-coarticulation", OF_TWO_ARMS, "hand"),
        ("arm-coarticulation", EVERY_FAMILY, "arm"),
        ("other-arm-coarticulation", OF_TWO_ARMS, "other arm"),
    )
}
"""Rules that say whether learners show more than random search, by the ids of their claims."""
