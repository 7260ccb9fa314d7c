"""The paper's claims on its own tasks: one function each, which says how it is judged."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from functools import partial

import numpy as np
from scipy import stats

from coartic.analysis.claims import rules
from coartic.analysis.claims.data import Data, Measurement, MissingError, judges
from coartic.analysis.claims.register import MARGINS, Finding
from coartic.analysis.claims.rules import TEST_OF_MEANS, all_of, higher
from coartic.analysis.methods import EC1, EC2, EC3, EC4
from coartic.analysis.signatures.subtasks import postures_before
from coartic.analysis.statistics.hypotheses import (
    bootstrap_test,
    independence_test,
)
from coartic.analysis.topics.paper import published
from coartic.analysis.topics.paper.shortest import shortest_reach
from coartic.analysis.words import number, tally
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


@judges("learning-improves-one-armed", test=TEST_OF_MEANS, cells=CELLS_OF_ONE_ARM)
@judges("learning-improves-two-armed", test=TEST_OF_MEANS, cells=CELLS_OF_TWO_ARMS)
@judges("ec2-improves", test=TEST_OF_MEANS, cells=((TASK_1, EC2),), hands="RRRR")
def learning_improves(data: Data, cells: Cells, hands: str = "") -> Finding:
    """Whether replays are better than the initial solution, of all runs or those with hands."""
    return all_of(
        higher(data.replay(task, label, hands), data.initial(task)) for task, label in cells
    )


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


@judges(
    "right-hand-better",
    test="exact: reward of the corrective process alone",
    task=TASK_1,
    second="LLLL",
)
@judges(
    "best-is-rrrr",
    test="exact: rewards of all hand sequences; a tie leaves it undecided",
    task=TASK_2,
)
def right_hand_is_better(data: Data, task: str, second: str = "others") -> Finding:
    """Whether RRRR is better than other hands with the corrective process alone."""
    first = "RRRR"
    solved = {name: r for name, r in data.sequences(task).items() if not math.isnan(r)}
    others = set(solved) - {first} if second == "others" else {second} & set(solved)
    rivals = [solved[name] for name in others]
    if first not in solved or not rivals:
        raise MissingError(f"the corrective process alone has no reward with {first} or {second}")
    printed = published.published_initial(task) or published.published_exhaustive(task)
    return Finding(
        None if solved[first] == max(rivals) else solved[first] > max(rivals),
        f"{task}: {first} {number(solved[first])} (published "
        f"{number(printed.number if printed else math.nan)}), {second} {number(max(rivals))}.",
    )


@judges("initial-base-reverses", test="exact: positions of the base at the goals")
def initial_base_reverses(data: Data) -> Finding:
    """The base moves left to goals 1 and 3 and right in all."""
    steps = base_steps(data.task(TASK_1).q0, data.initial_execution(TASK_1).configurations)
    each = ", ".join(number(step, 2) for step in steps)
    return Finding(
        bool(steps[0] < 0 and steps[2] < 0 < steps.sum()),
        f"The base moves along x by {each} from goal to goal, {number(steps.sum(), 2)} in all.",
    )


def base_steps(start: Array, configurations: Array) -> Array:
    """How far the base moves along x from goal to goal, length unit, shape ``(G,)``."""
    return np.diff(np.append(start[0], configurations[:, 0]))


@judges("ec2-sequences", test=rules.TEST_OF_HALF, task=TASK_1, label=EC2, hands="RRLR")
@judges("half-choose-rlrr", test=rules.TEST_OF_HALF, task=TASK_2, label=EC3, hands="RLRR")
def half_find(data: Data, task: str, label: str, hands: str) -> Finding:
    """Whether about half of the runs learn a sequence."""
    return rules.about_half(data.hands(task, label), hands)


@judges("ec2-rrlr-better", TEST_OF_MEANS, first=(EC2, "RRLR"), second=(EC2, "RRRR"))
@judges("ec3-better-than-ec2", TEST_OF_MEANS, first=(EC3, "LRLR"), second=(EC2, "RRLR"))
@judges("rlrr-better", TEST_OF_MEANS, first=(EC3, "RLRR"), second=(EC3, "RRRR"), tasks=(TASK_2,))
@judges("ec4-beats-ec3", TEST_OF_MEANS, first=(EC4,), second=(EC3,))
@judges("multilevel-search", TEST_OF_MEANS, first=(EC3,), second=(EC1,), tasks=TWO_ARMED)
def earn_more(
    data: Data, first: Sequence[str], second: Sequence[str], tasks: Sequence[str] = (TASK_1,)
) -> Finding:
    """Whether runs of a condition earn more than others; with hands, those that learned them."""
    return all_of(higher(data.reward(task, *first), data.reward(task, *second)) for task in tasks)


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


@judges("ec2-unreliable", test=rules.TEST_OF_NOT_MOST)
def ec2_unreliable(data: Data) -> Finding:
    """Not most runs find other hands than RRRR."""
    return rules.not_most(data.hands(TASK_1, EC2).are_not("RRRR", name="RRRR"))


@judges("ec3-alternates", test=rules.TEST_OF_MOST, label=EC3)
@judges("ec4-keeps-lrlr", test=rules.TEST_OF_MOST, label=EC4)
def most_alternate(data: Data, label: str) -> Finding:
    """Whether most runs learn LRLR."""
    return rules.most(data.hands(TASK_1, label).are("LRLR", name="LRLR"))


@judges(
    "ec3-as-exhaustive",
    test="exact: more than {majority:.0%} of the runs of EC3 learn hands that are best "
    "with the corrective process alone",
)
def ec3_as_exhaustive(data: Data) -> Finding:
    """Most runs learn hands that are best with the corrective process alone."""
    learned = data.hands(TASK_1, EC3)
    return rules.majority(learned.are(*data.best_sequences(TASK_1)[0], name="best"))


@judges("ec3-beats-exhaustive", test=TEST_OF_MEANS)
def ec3_beats_exhaustive(data: Data) -> Finding:
    """Learning is better than trying all hands with the corrective process alone."""
    return all_of([higher(data.reward(TASK_1, EC3), data.best(TASK_1))])


@judges(
    "ec3-departs",
    test="exact: at least one run (the paper has 9 of 20) learns hands that are not among the best "
    "of the corrective process",
)
def ec3_departs(data: Data) -> Finding:
    """A run learns hands that are not the best with the corrective process alone."""
    learned = data.hands(TASK_2, EC3)
    return rules.some(learned.are_not(*data.best_sequences(TASK_2)[0], name="best"))


@judges(
    "ec4-mixed",
    test="exact: at least one run does not have the commonest hand sequence (the paper names none)",
)
def ec4_mixed(data: Data) -> Finding:
    """Runs learn different hands."""
    learned = data.hands(TASK_2, EC4)
    return rules.some(learned.are_not(learned.commonest, name="commonest"))


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
    "sequences-change",
    test="task 1: Fisher's exact test of hand sequences by condition; task 2: exact, a run leaves "
    "the initial hands. For the opposite: in either task more than {most:.0%} of the runs on both "
    "sides keep one sequence (exact binomial tests)",
)
def sequences_change(data: Data) -> Finding:
    """Hands change between conditions 2 and 3 of task 1, and in a run of task 2."""
    pair = data.hands(TASK_1, EC2), data.hands(TASK_1, EC3)
    names = sorted({hands for learned in pair for hands in learned.sequences})
    test = independence_test(*([learned.tally[name] for name in names] for learned in pair))
    other, initial = data.hands(TASK_2, EC3), data.task(TASK_2).initial_hands
    left = rules.some(other.are_not(initial, name="initial"))
    # Against it: on one of the tasks most runs keep a sequence, under both conditions.
    against = [
        max(
            (rules.most(learned.are(name, name=name)).tests[0] for learned in pair),
            key=lambda test: test.p,
        )
        for name in names
    ]
    against.append(rules.most(other.are(initial, name="initial")).tests[0])
    seen = ", ".join(f"{learned.condition} {tally(learned.tally)}" for learned in pair)
    return Finding(
        bool(test.value > 0 and left.holds),
        f"{TASK_1}: {seen}; {left.evidence}.",
        (test,),
        tuple(against),
    )


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
    return rules.both_of(consistent, rules.not_most(free.are(free.commonest, name="commonest")))


# The paper's own statistics.


@judges(
    "printed-p-values",
    test="exact, from the printed numbers alone: one-tailed Welch's p of every comparison that is "
    "printed with p < .01 and with the numbers of both sides, at the most favourable rounding of "
    "the means",
)
def printed_p_values(_: Data) -> Finding:
    """Welch's test on what is printed of both sides, as far apart as rounding lets them be."""
    parts, holds = [], []
    for entry in published.ENTRIES.values():
        if not isinstance(entry, published.PrintedOrder) or entry.p_below is None:
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


def printed_summary(task: str | None, solved: published.Solved) -> published.Summary | None:
    """What is printed of one side of an order; None without its SD."""
    cell = published.published_cell(task or "", solved.condition or "")
    if cell is None:
        return None
    by_hands = cell.sequences
    summary = by_hands.get(solved.hands) if solved.hands and len(by_hands) > 1 else cell.summary
    return None if summary is None or summary.sd is None else summary
