"""Define the rules of claims on the corrective process, and on what learning gains."""

import itertools
import math
from dataclasses import replace
from functools import partial
from operator import itemgetter

import numpy as np
import scipy
from comparisons import Higher, Measurement, all_higher, all_positive
from judging import Finding
from reader import CELLS_OF_ONE_ARM, CELLS_OF_TWO_ARMS, EC1, EC3, EC4, MARGINS, ONE_ARMED, TWO_ARMED

from coartic.analysis import number
from coartic.analysis.signatures import movable
from coartic.estimates import SEED, Estimate

LEAST_DISPLACEMENT = "trajectory-optimisation/squared-displacement"
"""Plan with the smallest squared joint displacement, a smoothness cost of Jordan's."""
SMOOTH_PLANS = (
    LEAST_DISPLACEMENT,
    "trajectory-optimisation/acceleration",
    "trajectory-optimisation/jerk",
)
TENTHS = 10
"""Number of parts into which the trials are divided. Corrections are counted in the first part and
in the last part."""


def no_trial_fails(read, cells):
    """Count the trials of the learner that miss a goal; the claim is that no trial does."""
    trials = failed = 0
    for task, label in cells:
        runs = read.runs(task, label)
        trials += int(runs.trials.sum())
        failed += int(runs.failed_trials.sum())
    words = f"{failed} of {number(trials)} trials of the learner fail to hit every goal"
    return Finding(not failed, words)


def corrective_ensures(read, cells):
    """Count trials that fail, and hand sequences that the corrective process cannot complete."""
    trials = no_trial_fails(read, cells)
    rewards = np.concatenate([read.alone(task) for task in dict(cells)])
    missed = int(np.isnan(rewards).sum())
    return Finding(
        trials.holds and not missed,
        f"{trials.evidence}. Without any experience, the corrective process completes "
        f"{len(rewards) - missed} of {len(rewards)} hand sequences",
    )


def corrective_near_shortest(read, tasks):
    """Compare each subtask of the initial solutions with its shortest path in joint space."""
    parts, most = [], 0.0
    for name in tasks:
        *excess, in_all = excess_over_shortest(read.task(name), read.initial_execution(name))
        most = max(most, *excess)
        each = ", ".join(f"{share:.1%}" for share in excess)
        parts.append(f"{read.title(name)} {each} (in all {in_all:.1%})")
    return Finding(
        most <= MARGINS.close, f"Excess of each subtask over the shortest path: {'; '.join(parts)}"
    )


def excess_over_shortest(task, initial):
    """Return the shares by which subtasks exceed the shortest paths.

    The last share is that of all subtasks together.
    """
    after = initial.configurations
    before = np.array([task.q0, *after[:-1]])
    shortest = np.array([
        shortest_reach(task, q, {"L": "left", "R": "right"}[letter], goal, near)
        for goal, (q, letter, near) in enumerate(zip(before, initial.hands, after, strict=True), 1)
    ])  # fmt: skip
    ways = np.linalg.norm(after - before, axis=1)
    return [*(ways / shortest - 1).tolist(), float(ways.sum() / shortest.sum() - 1)]


def shortest_reach(task, q, hand, goal, near):
    """Return the smallest joint-space distance from ``q`` to a configuration that hits a goal.

    ``goal`` counts from 1. ``near``, shape ``(dof,)``, is a configuration close to a hit. The
    minimum is searched by sequential quadratic programming (Kraft 1988, scipy's SLSQP) over the
    joints that can move the hand, from ``near`` and from eight random starts around it. The
    distance mixes length units and rad. It is that of the best local minimum, which can be longer
    than the global minimum, and infinite if no minimum is found.
    """
    joints, centre = movable(task, hand), np.array(task.goals[goal - 1])

    def inside(change):
        reached = q.copy()
        reached[joints] += change
        off = np.asarray(task.robot.forward_kinematics(reached, hand) - centre)
        return float(task.radius**2 - off @ off)

    def slope(change):
        reached = q.copy()
        reached[joints] += change
        at, jacobian = task.robot.linearised(reached, hand)
        return -2 * (at - centre) @ jacobian[:, joints]

    first = (near - q)[joints]
    rng = np.random.default_rng(SEED)
    best = math.inf
    for start in (first, *(first + rng.normal(0, 0.3, (8, len(joints))))):
        reach = scipy.optimize.minimize(
            lambda change: (change @ change, 2 * change),
            start,
            jac=True,
            method="SLSQP",
            constraints=[{"type": "ineq", "fun": inside, "jac": slope}],
            options={"ftol": 1e-12, "maxiter": 300},
        )
        if inside(reach.x) >= -1e-8:
            best = min(best, float(np.linalg.norm(reach.x)))
    return best


def corrected_less_later(read, cells):
    """Test that corrective movements become rarer in learning.

    Runs must make fewer corrective movements in the last trials, and in the learned solution, than
    in the first trials. Trial 0 does not count, because all its movements are corrective by
    construction. For the opposite, both counts must be higher than in the first trials, because the
    targets of the last trials have noise.
    """
    words = "share of movements that are corrected, in the"
    pairs, parts, learned = [], [], []
    for task, label in cells:
        runs, goals = read.runs(task, label), len(read.task(task).goals)
        movements = (runs.trials - 1) * goals / TENTHS
        early, late, last = (
            Measurement(
                read.title(task), read.who(label), shares.to_numpy(np.float64), f"{words} {when}"
            )
            for shares, when in (
                (runs.early_corrections / movements, "first tenth of the trials"),
                (runs.late_corrections / movements, "last tenth of the trials"),
                (runs.solution_corrections / goals, "learned solution"),
            )
        )
        pairs += [(early.numbers - after.numbers, 0.0) for after in (late, last)]
        parts.append((early.quantity, f"{early.name}: {early}, late {late}"))
        learned.append((last.quantity, f"{last.name}: {last}"))
    finding = all_positive(pairs, parts + learned)
    by_both = zip(finding.against[::2], finding.against[1::2], strict=True)
    return replace(finding, against=tuple(max(counts, key=p_of) for counts in by_both))


def resemblance(read, task):
    """Return which share of the initial solution's distance to the plan each run covers."""
    learned = read.cell(task, EC1).runs
    (plan,) = read.cell(task, LEAST_DISPLACEMENT).runs
    planned = plan.configurations

    def distance(execution):
        """Return the mean distance of postures at the goals. It mixes length units and rad."""
        return float(np.linalg.norm(execution.configurations - planned, axis=-1).mean())

    before = distance(read.initial_execution(task))
    shares = np.array([1 - distance(run) / before for run in learned])
    return Measurement(
        read.title(task), read.who(EC1), shares,
        "share of the distance of the initial solution to the plan of minimum squared joint "
        "displacement that learning has covered (postures at the goals)",
    )  # fmt: skip


def beats_smooth_plans(read, tasks, label):
    """Test that the learner earns more than two of three plans for smoothness, on all tasks."""
    findings = [
        all_higher(Higher(read.reward(task, label), read.reward(task, plan)) for task in tasks)
        for plan in SMOOTH_PLANS
    ]
    return two_of_three(findings)


def p_of(test):
    """Return the p-value of a test, 1 without one."""
    return 1.0 if math.isnan(test.p) else test.p


def two_of_three(findings):
    """Return the finding that at least two of three findings hold.

    p is twice the second smallest p (a partial conjunction: Benjamini & Heller 2008, Biometrics
    64).
    """
    tests = [max(finding.tests, key=p_of) for finding in findings]
    against = [
        Estimate(-test.value, n=test.n, p=finding.opposite_p)
        for test, finding in zip(tests, findings, strict=True)
    ]
    second, opposite = (
        replace(middle, p=min(1.0, 2 * middle.p))
        for middle in (sorted(side, key=p_of)[1] for side in (tests, against))
    )
    evidence = ". ".join(
        f"{finding.evidence}: {'' if finding.holds else 'not '}beaten" for finding in findings
    )
    return Finding(sum(finding.holds for finding in findings) > 1, evidence, (second,), (opposite,))


def proficiency_rises(read):
    """Test that each condition beats the previous one, and the first beats the initial solution."""
    comparisons = []
    for task, cells in itertools.groupby(CELLS_OF_TWO_ARMS, itemgetter(0)):
        rewards = [read.initial(task), *(read.reward(*cell) for cell in cells)]
        comparisons += [Higher(higher, lower) for lower, higher in itertools.pairwise(rewards)]
    return all_higher(comparisons)


def rules_of(which, cells, best):
    """Return the rules that are the same for tasks with one arm and with two arms.

    ``best`` is the condition that explores most.
    """
    tasks = [*dict(cells)]
    return {
        f"corrective-ensures-{which}-armed": partial(corrective_ensures, cells=cells),
        f"corrective-near-shortest-{which}-armed": partial(corrective_near_shortest, tasks=tasks),
        f"corrections-{which}-armed": partial(corrected_less_later, cells=cells),
        f"beats-inaccurate-{which}-armed": partial(beats_smooth_plans, tasks=tasks, label=best),
    }


RULES = {
    **rules_of("one", CELLS_OF_ONE_ARM, EC1),
    **rules_of("two", CELLS_OF_TWO_ARMS, EC4),
    "resembles-squared-displacement": lambda read: all_higher(
        Higher(resemblance(read, task), by=MARGINS.halfway) for task in ONE_ARMED
    ),
    "proficiency-rises": proficiency_rises,
    "multilevel-search": lambda read: all_higher(
        Higher(read.reward(task, EC3), read.reward(task, EC1)) for task in TWO_ARMED
    ),
}
"""Rules by the ids of their claims."""
