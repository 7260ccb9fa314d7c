"""Rules of single claims, which compare or count nothing that :mod:`~.rules` has."""

from __future__ import annotations

import itertools
import math
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy import optimize, stats

from coartic import Hand, Task
from coartic.analysis.claims.data import Data, MissingError
from coartic.analysis.claims.register import MARGINS, Claim, Finding
from coartic.analysis.claims.rules import base_steps, count_runs, judged_instances
from coartic.analysis.methods import CONDITIONS, EC1, INITIAL, PLACEBO, name_of
from coartic.analysis.signatures.between import TwoContexts
from coartic.analysis.signatures.context import dependence_below
from coartic.analysis.signatures.manifold import movable
from coartic.analysis.signatures.subtasks import postures_before, ticks_slower
from coartic.analysis.statistics.estimates import SEED, Estimate, difference_of_means
from coartic.analysis.statistics.hypotheses import independence_test, share_test
from coartic.analysis.topics.paper.published import ENTRIES, Order, Solved, Summary, published_cell
from coartic.analysis.trajectories import Trajectories
from coartic.analysis.words import estimate, number, tally
from coartic.robot import Array
from coartic.tasks.task import hands_of

CONTROLS = ("posture-based/one-goal", INITIAL)
"""Methods that do not look beyond the current goal."""
STARTS = 8
"""Random starts of the search for the shortest reach, beside the given one."""
SPREAD = 0.3
"""SD of the random starts about the given one: length unit, rad."""


def context(data: Data, _: Claim) -> Finding:
    """Whether postures at goal 1 depend on the goal that follows, more than a placebo's."""
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
    for label in (PLACEBO, f"{EC1}-subtask"):
        placebo = contexts_of(data, label)
        more = contexts.apart - placebo.apart
        beyond = replace(test, value=more, n=(contexts.n, placebo.n))
        tests.append(replace(beyond, p=contexts.p_beyond(placebo)))
        against.append(replace(beyond, value=-more, p=placebo.p_beyond(contexts)))
        parts.append(f"{name_of(label)}: {number(placebo.apart, 2)} apart")
    for label in CONTROLS:
        with suppress(MissingError):
            apart = contexts_of(data, label).apart
            parts.append(f"{name_of(label)}: {number(apart, 2)} apart")
    holds = contexts.spreads > bound and all(each.value > 0 for each in tests)
    return Finding(holds, f"{'; '.join(parts)}.", tuple(tests), tuple(against))


def contexts_of(data: Data, label: str, *, replayed: bool = False) -> TwoContexts:
    """Runs of a method that hit goal 1 of both one-armed tasks; MissingError without them."""
    tasks = ("ascending", "descending")
    first, second = (data.cell(task, label) for task in tasks)
    if replayed:
        first, second = (data.study.replays(task, label) for task in tasks)
    contexts = TwoContexts(first, second, 1, "right")
    if not all(contexts.runs):
        raise MissingError(f"no run of {label} hits goal 1 of both tasks with the right hand")
    return contexts


def slower_hands_are_chosen(data: Data, claim: Claim) -> Finding:
    """Whether more runs than of the placebo choose a hand that is slower for its goal alone."""
    ((task, conditions),) = claim.cells.items()
    initial = data.initial(task).hands
    chosen = {who: chosen_slower(data.cell(task, who), initial) for who in (*conditions, PLACEBO)}
    of_placebo = chosen[PLACEBO] > 0
    tests, against, parts = [], [], []
    for who in conditions:
        does = chosen[who] > 0
        count, total = int(does.sum()), len(does)
        table = [[count, total - count], [int(of_placebo.sum()), int((~of_placebo).sum())]]
        p = float(stats.fisher_exact(table, alternative="greater").pvalue)
        more = min(does.mean() - of_placebo.mean(), does.mean() - MARGINS["few"])
        tests.append(Estimate(more, p=p, n=(total, len(of_placebo))))
        against.append(share_test(count, total, MARGINS["few"], "less"))
        seen = beside(data, task, who, chosen[who])
        parts.append(f"{task} {who}: {count} of {total} runs{seen}")
    parts.append(f"{name_of(PLACEBO)}: {of_placebo.sum()} of {len(of_placebo)} runs")
    best = min(tests, key=lambda test: (test.value <= 0, test.p))
    test = replace(best, p=min(1.0, best.p * len(tests)))
    contrary = max(against, key=lambda test: test.p)
    return Finding(test.value > 0, f"{'; '.join(parts)}.", (test,), (contrary,))


def chosen_slower(cell: Trajectories, initial: str) -> Array:
    """Ticks of the hands that are slower for their goal alone, in each run, shape ``(runs,)``.

    Of goals that others follow, hit with another hand than that of the initial solution.
    """
    ticks = []
    for run in cell.runs:
        other = np.array(list(run.execution.hands)) != np.array(list(initial))
        ticks.append(float(ticks_slower(run)[:-1][other[:-1]].sum()))
    return np.array(ticks)


def beside(data: Data, task: str, who: str, slower: Array) -> str:
    """By how many ticks such runs are slower, and how much better they end than the others."""
    rewards = np.array([run.execution.reward for run in data.cell(task, who).runs], dtype=float)
    with_it, without_it = rewards[slower > 0], rewards[slower == 0]
    if not len(with_it):
        return ""
    words = f", slower for these goals by {number(slower[slower > 0].mean(), 0)} ticks"
    if len(without_it):
        better = difference_of_means(with_it, without_it)
        words += f", which end with {estimate(better, 1)} ticks more reward than the others"
    return words


def initial_base_reverses(data: Data, claim: Claim) -> Finding:
    """Whether the base moves left to goals 1 and 3 and right in all."""
    (name,) = claim.cells
    steps = base_steps(data.task(name).q0, data.initial(name).configurations)
    each = ", ".join(number(step, 2) for step in steps)
    return Finding(
        bool(steps[0] < 0 and steps[2] < 0 < steps.sum()),
        f"The base moves along x by {each} from goal to goal, {number(steps.sum(), 2)} in all.",
    )


def sequences_change(data: Data, claim: Claim) -> Finding:
    """Whether hands change between two conditions on one task, and in some run of another."""
    ((one, conditions),) = claim.cells.items()
    before, after = (data.hands(one, condition) for condition in conditions)
    names = sorted(set(before) | set(after))
    test = independence_test(*([count[name] for name in names] for count in (before, after)))
    ((two, (counted,)),) = claim.runs.items()
    _, condition, what = counted.split(" ", 2)
    left = count_runs(data, two, "some", condition, what)
    # Against it: on one of the tasks most runs keep a sequence, under both conditions.
    against = [
        max(
            (count_runs(data, one, "most", label, name).tests[0] for label in conditions),
            key=lambda test: test.p,
        )
        for name in names
    ]
    against.append(count_runs(data, two, "most", condition, what.removeprefix("not ")).tests[0])
    seen = ", ".join(f"{c} {tally(n)}" for c, n in zip(conditions, (before, after), strict=True))
    return Finding(
        bool(test.value > 0 and left.holds),
        f"{one}: {seen}; {left.evidence}.",
        (test,),
        tuple(against),
    )


def corrective_ensures(data: Data, claim: Claim) -> Finding:
    """exact: failed trials of the learner, and hand sequences that the corrective process cannot \
complete"""
    cells = [(task, name) for task, names in claim.cells.items() for name in names]
    for name in (name for family in claim.families for name in judged_instances(data, family)):
        cells += [(name, label) for label in CONDITIONS if (name, label) in data.study.cells]
    trials = failed = 0
    for task, who in cells:
        runs = data.runs(task, who)
        trials += int(runs.trials.sum())
        failed += int(runs.failed_trials.sum())
    text = f"{failed} of {number(trials)} trials of the learner fail to hit every goal."
    rewards = [reward for task in claim.cells for reward in data.sequences(task).values()]
    missed = sum(map(math.isnan, rewards))
    if rewards:
        text += (
            f" Without any experience, the corrective process completes {len(rewards) - missed} of "
            f"{len(rewards)} hand sequences."
        )
    return Finding(not failed and not missed, text)


def corrective_near_shortest(data: Data, claim: Claim) -> Finding:
    """exact: no subtask of the initial solution is more than {close:.0%} longer than the shortest \
path from the same posture (the shortest that a search finds)"""
    parts, most = [], 0.0
    for name in claim.cells:
        task, initial = data.task(name), data.initial(name)
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


def shortest_reach(task: Task, q: Array, hand: Hand, goal: int, guess: Array) -> float:
    """Least joint-space distance from ``q`` to a configuration that hits a goal.

    ``goal`` counts from 1; ``guess`` is a configuration near one that hits it, shape
    ``(dof,)``. Sequential quadratic programming (Kraft 1988, scipy's SLSQP) on the joints
    that can move the hand, from ``guess`` and random starts about it: the best local minimum,
    so at least as long as the global one. Infinite where none is found. Length unit and rad
    mixed.
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

    first = (guess - q)[joints]
    rng = np.random.default_rng(SEED)
    best = math.inf
    for start in (first, *(first + rng.normal(0, SPREAD, (STARTS, len(joints))))):
        reach = optimize.minimize(
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


def printed_p_values(_: Data, claim: Claim) -> Finding:
    """Welch's test on what is printed of both sides, as far apart as rounding lets them be."""
    parts, holds = [], []
    for entry in ENTRIES.values():
        if not isinstance(entry, Order) or entry.p_below is None:
            continue
        first, second = (printed_summary(entry.task, side) for side in (entry, entry.than))
        if first is None or second is None:
            continue
        rounding = sum(0.5 * 10.0**-s.digits for s in (first, second))
        p, best = (
            float(
                stats.ttest_ind_from_stats(
                    *(first.mean + off, first.sd, first.runs),
                    *(second.mean, second.sd, second.runs),
                    equal_var=False,
                    alternative="greater",
                ).pvalue
            )
            for off in (0.0, rounding)
        )
        holds.append(best < entry.p_below)
        parts.append(f"{entry.id} p = {p:.2g} ({best:.2g} at best, printed < {entry.p_below})")
    return Finding(all(holds), f"{'; '.join(parts)}.")


def printed_summary(task: str | None, solved: Solved) -> Summary | None:
    """What is printed of one side of an order; None without its SD."""
    cell = published_cell(task or "", solved.condition or "")
    if cell is None:
        return None
    by_hands = cell.sequences
    summary = by_hands.get(solved.hands) if solved.hands and len(by_hands) > 1 else cell.summary
    return None if summary is None or summary.sd is None else summary
