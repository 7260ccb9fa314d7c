"""The paper's claims about the two-armed tasks (exploration conditions 2 to 4)."""

from __future__ import annotations

import itertools
import math
from collections import Counter

import numpy as np
from scipy import stats

from analysis.claims.data import LEARNER, Data, MissingError, rewards_of
from analysis.claims.register import LEVEL, Claim, Finding
from analysis.published import published_cell, published_exhaustive, published_initial
from analysis.signatures.cell import Cell
from analysis.signatures.other_arm import preshaping
from analysis.signatures.recruitment import isolated_agreement
from analysis.statistics import (
    FEWEST,
    Inference,
    bootstrap_test,
    difference_of_means,
    mean,
    probability_of_improvement,
)
from analysis.study import SEED
from analysis.table import interval, tally
from coartic.robot import Array

ONE, TWO = "two-armed-1", "two-armed-2"
NEARLY_ALL = 0.8
"""Share of runs that "in all runs" and "reliably" must exceed, with 95 % confidence."""
MARGIN = 0.25
"""Shares of runs this near are "about as often"."""


# Before learning


def _right_hand_better(data: Data) -> Finding:
    known = data.sequences(ONE)
    right, left = known.get("RRRR", math.nan), known.get("LLLL", math.nan)
    if math.isnan(right + left):
        raise MissingError("the corrective process alone with RRRR and LLLL")
    printed = published_initial(ONE)
    assert printed is not None
    return Finding(right > left, f"RRRR {right:.0f} (published {printed[1]}), LLLL {left:.0f}")


def _best_is_rrrr(data: Data) -> Finding:
    best, reward = data.best_sequences(TWO)
    printed = published_exhaustive(TWO)
    assert printed is not None
    shown = f"{' and '.join(best)} {reward:.0f} (published {printed[0]} {printed[1]})"
    if "RRRR" not in best:
        return Finding(False, f"best of the corrective process alone: {shown}")
    tie = "" if len(best) == 1 else ": a tie"
    return Finding(
        True if not tie else None, f"best of the corrective process alone: {shown}{tie}"
    )


def _base_steps(start: Array, configurations: Array) -> Array:
    return np.diff(np.append(start[0], configurations[:, 0]))


def _initial_base_reverses(data: Data) -> Finding:
    steps = _base_steps(data.task(ONE).q0, data.initial(ONE).configurations)
    return Finding(
        bool(steps[0] < 0 and steps[2] < 0 < steps.sum()),
        f"base along x from goal to goal {', '.join(f'{step:+.2f}' for step in steps)}, in all "
        f"{steps.sum():+.2f}",
    )


# Exploration condition 2


def _as_often(data: Data, task: str, condition: str, hands: str) -> tuple[bool | None, str]:
    """Whether a hand sequence is found about as often as in the paper; what was seen.

    No where Fisher's exact test tells the shares apart; yes where it does not and Newcombe's
    interval of their difference is within the margin either way.
    """
    found = Counter(data.learned(task, condition).hands)
    printed = published_cell(task, condition)
    assert printed is not None
    known = {s.hands: s.runs or 0 for s in printed.sequences}
    ours, theirs = sum(found.values()), sum(known.values())
    table = [[found[hands], ours - found[hands]], [known[hands], theirs - known[hands]]]
    p = float(stats.fisher_exact(table).pvalue)
    wilson = [
        stats.binomtest(k, n).proportion_ci(method="wilson")
        for k, n in ((found[hands], ours), (known[hands], theirs))
    ]
    a, b = found[hands] / ours, known[hands] / theirs
    low = a - b - math.hypot(a - wilson[0].low, wilson[1].high - b)
    high = a - b + math.hypot(wilson[0].high - a, b - wilson[1].low)
    text = (
        f"{tally(found)} of {ours} runs, published {tally(known)}; share of {hands} "
        f"{a - b:+.0%} [{low:+.0%}, {high:+.0%}], Fisher's exact test p = {p:.2g}"
    )
    if p < LEVEL:
        return False, text
    return (True if max(-low, high) <= MARGIN else None), text


def _ec2_sequences(data: Data) -> Finding:
    return Finding(*_as_often(data, ONE, "EC2", "RRLR"))


def _ec2_improves(data: Data) -> Finding:
    initial = float(data.learned(ONE, "EC2").initial_reward.iloc[0])
    replays = data.replays(ONE, "EC2", "RRRR")
    if len(replays) < FEWEST:
        raise MissingError(f"at least {FEWEST} runs of EC2 on {ONE} that keep RRRR")
    test = bootstrap_test(replays, initial, seed=SEED)
    return Finding(
        test.estimate > 0,
        f"noiseless replay of the {len(replays)} runs with RRRR: {initial:.0f} to "
        f"{interval(mean(replays, seed=SEED))}",
        (test,),
    )


def _ec2_unreliable(data: Data) -> Finding:
    found = Counter(data.learned(ONE, "EC2").hands)
    total = sum(found.values())
    left = total - found["RRRR"]
    high = float(stats.binomtest(left, total, alternative="less").proportion_ci().high)
    return Finding(
        True if high <= NEARLY_ALL else False if _in_nearly_all(left, total)[0] else None,
        f"{left} of {total} runs leave RRRR ({tally(found)}): at most {high:.0%} of all (95 %, "
        "exact)",
    )


def _in_nearly_all(count: int, total: int) -> tuple[bool | None, str]:
    """Whether something happens in nearly all runs, by the exact lower bound; what was seen."""
    low = stats.binomtest(count, total, alternative="greater").proportion_ci().low
    seen = True if low >= NEARLY_ALL else False if count < NEARLY_ALL * total else None
    return seen, f"{count} of {total} runs, at least {low:.0%} of all (95 %, exact)"


def _better_hands(data: Data, task: str, condition: str, better: str, worse: str) -> Finding:
    """Whether runs with one hand sequence get more than those with another."""
    a, b = data.group(task, condition, better), data.group(task, condition, worse)
    test = bootstrap_test(a, b, seed=SEED)
    printed = published_cell(task, condition)
    assert printed is not None
    known = {s.hands: s.summary.mean for s in printed.sequences if s.summary is not None}
    parts = [
        f"{hands} {interval(mean(values, seed=SEED))} in {len(values)} runs (published "
        f"{known[hands]:g})"
        for hands, values in ((better, a), (worse, b))
    ]
    apart = interval(difference_of_means(a, b, seed=SEED))
    return Finding(test.estimate > 0, f"{', '.join(parts)}: {apart}", (test,))


def _ec2_rrlr_better(data: Data) -> Finding:
    return _better_hands(data, ONE, "EC2", "RRLR", "RRRR")


def _no_reversal(data: Data) -> Finding:
    cell = data.cell(ONE, f"{LEARNER}EC2")
    runs = [run for run in cell.runs if run.execution.hands == "RRLR"]
    if not runs:
        raise MissingError(f"a run of EC2 on {ONE} that learned RRLR, as in the figure")
    q0 = data.task(ONE).q0
    right = sum(bool((_base_steps(q0, r.execution.configurations) > 0).all()) for r in runs)
    initial = _base_steps(q0, data.initial(ONE).configurations)
    return Finding(
        bool(right == len(runs) and (initial < 0).any()),
        f"from goal to goal the base goes right only in {right} of {len(runs)} runs with RRLR; in "
        f"the initial solution by {', '.join(f'{step:+.2f}' for step in initial)}",
    )


# Exploration condition 3


def _lrlr_in_all(data: Data, condition: str) -> Finding:
    found = Counter(data.learned(ONE, condition).hands)
    seen, text = _in_nearly_all(found["LRLR"], sum(found.values()))
    return Finding(seen, f"LRLR in {text}" + (f"; {tally(found)}" if len(found) > 1 else ""))


def _ec3_alternates(data: Data) -> Finding:
    return _lrlr_in_all(data, "EC3")


def _ec3_better_than_ec2(data: Data) -> Finding:
    runs = data.learned(ONE, "EC2")
    groups = {str(h): rewards_of(g) for h, g in runs.groupby("hands") if len(g) >= FEWEST}
    if not groups:
        raise MissingError(f"a hand sequence that {FEWEST} runs of EC2 on {ONE} learned")
    hands = max(groups, key=lambda name: float(groups[name].mean()))
    rewards = data.rewards(ONE, "EC3")
    test = bootstrap_test(rewards, groups[hands], seed=SEED)
    return Finding(
        test.estimate > 0,
        f"EC3 {interval(mean(rewards, seed=SEED))}; best under EC2 {hands} "
        f"{interval(mean(groups[hands], seed=SEED))} in {len(groups[hands])} of {len(runs)} runs",
        (test,),
    )


def _ec3_as_exhaustive(data: Data) -> Finding:
    best, reward = data.best_sequences(ONE)
    found = Counter(data.learned(ONE, "EC3").hands)
    same = sum(found[hands] for hands in best)
    seen, text = _in_nearly_all(same, sum(found.values()))
    return Finding(
        seen,
        f"exhaustive search finds {' and '.join(best)} ({reward:.0f}); EC3 the same in {text}",
    )


def _ec3_beats_exhaustive(data: Data) -> Finding:
    rewards = data.rewards(ONE, "EC3")
    _, best = data.best_sequences(ONE)
    published = published_exhaustive(ONE)
    assert published is not None
    test = bootstrap_test(rewards, best, seed=SEED)
    return Finding(
        test.estimate > 0,
        f"{interval(mean(rewards, seed=SEED))} against {best:.0f} (published {published[1]})",
        (test,),
    )


def _half_choose_rlrr(data: Data) -> Finding:
    return Finding(*_as_often(data, TWO, "EC3", "RLRR"))


def _rlrr_better(data: Data) -> Finding:
    return _better_hands(data, TWO, "EC3", "RLRR", "RRRR")


def _ec3_departs(data: Data) -> Finding:
    best, reward = data.best_sequences(TWO)
    found = Counter(data.learned(TWO, "EC3").hands)
    away = sum(count for hands, count in found.items() if hands not in best)
    text = (
        f"{tally(found)}; best of the corrective process alone {' and '.join(best)} "
        f"({reward:.0f}): {away} of {sum(found.values())} runs depart from it"
    )
    if away:
        return Finding(True, text)
    if len(best) > 1:
        return Finding(None, f"{text}. With a tie, to choose among the best is no departure")
    return Finding(False, text)


# Exploration condition 4, and all conditions


def _ec4_keeps_lrlr(data: Data) -> Finding:
    return _lrlr_in_all(data, "EC4")


def _ec4_mixed(data: Data) -> Finding:
    found = Counter(data.learned(TWO, "EC4").hands)
    return Finding(len(found) > 1, f"{tally(found)} of {sum(found.values())} runs")


def _higher(data: Data, task: str, higher: str, lower: str) -> tuple[Inference, str]:
    """Test that one condition's mean reward is higher, and what was seen."""
    a, b = data.rewards(task, higher), data.rewards(task, lower)
    test = bootstrap_test(a, b, seed=SEED)
    apart = difference_of_means(a, b, seed=SEED)
    better = probability_of_improvement(a, b, seed=SEED)
    return test, (
        f"{task}: {higher} − {lower} = {interval(apart)}, P(improvement) {interval(better, '.2f')}"
    )


def _ec4_beats_ec3(data: Data) -> Finding:
    tests, parts = [], []
    for task in (ONE, TWO):
        test, text = _higher(data, task, "EC4", "EC3")
        tests.append(test)
        parts.append(text)
    return Finding(all(test.estimate > 0 for test in tests), "; ".join(parts), tuple(tests))


def _proficiency_rises(data: Data) -> Finding:
    tests, parts = [], []
    for task, conditions in ((ONE, ("EC2", "EC3", "EC4")), (TWO, ("EC3", "EC4"))):
        rewards = data.rewards(task, conditions[0])
        initial = float(data.learned(task, conditions[0]).initial_reward.iloc[0])
        tests.append(bootstrap_test(rewards, initial, seed=SEED))
        for lower, higher in itertools.pairwise(conditions):
            tests.append(_higher(data, task, higher, lower)[0])
        means = ", ".join(f"{c} {data.rewards(task, c).mean():.1f}" for c in conditions)
        parts.append(f"{task}: initial {initial:.0f}, {means}")
    return Finding(all(test.estimate > 0 for test in tests), "; ".join(parts), tuple(tests))


def _sequences_change(data: Data) -> Finding:
    tests, parts = [], []
    for task, pair in ((ONE, ("EC2", "EC3")), (TWO, ("EC3", "EC4"))):
        found = [Counter(data.learned(task, condition).hands) for condition in pair]
        hands = sorted(set(found[0]) | set(found[1]))
        table = np.array([[count[h] for h in hands] for count in found])
        method = stats.MonteCarloMethod(rng=np.random.default_rng(SEED))
        p = float(stats.fisher_exact(table, method=method).pvalue) if len(hands) > 1 else 1.0
        tests.append(
            Inference(
                float(np.abs(np.diff(table / table.sum(axis=1, keepdims=True), axis=0)).sum() / 2),
                tuple(int(n) for n in table.sum(axis=1)),
                "Fisher's test of hand sequences by condition, Monte Carlo",
                p=p,
            )
        )
        parts.append(
            f"{task}: " + ", ".join(f"{c} {tally(n)}" for c, n in zip(pair, found, strict=True))
        )
    # Fisher's test has no contrary side: no difference leaves it open.
    changed = all(test.estimate > 0 for test in tests)
    return Finding(changed or None, "; ".join(parts), tuple(tests))


def _hand_coarticulation(data: Data) -> Finding:
    tests, parts = [], []
    for condition in ("EC3", "EC4"):
        cell = data.cell(ONE, LEARNER + condition)
        # The last goal has no successor to be prepared for.
        agrees = np.array([isolated_agreement(run)[:-1] for run in cell.runs])
        away, total = int((~agrees.all(axis=1)).sum()), len(agrees)
        tests.append(
            Inference(
                away / total - 0.5,
                (total,),
                "exact binomial test that more than half the runs do",
                p=float(stats.binomtest(away, total, alternative="greater").pvalue),
            )
        )
        goals = ", ".join(f"goal {k} {n}" for k, n in enumerate((~agrees).sum(axis=0), 1) if n)
        parts.append(f"{condition}: {away} of {total} runs ({goals or 'no goal'})")
    return Finding(all(test.estimate > 0 for test in tests), "; ".join(parts), tuple(tests))


def preshaping_by_run(cell: Cell) -> Array:
    """Preshaping of the other arm by run, mean over the goals that have it.

    Shape ``(runs,)``; runs that use one hand only are left out. Raises MissingError where
    the corrective process alone does not complete the task.
    """
    if cell.initial is None:
        raise MissingError(f"the corrective process alone does not complete {cell.task.name}")
    values = np.array([preshaping(run, cell.initial) for run in cell.runs])
    known = ~np.isnan(values)
    both = known.any(axis=1)
    return np.asarray(np.nanmean(values[both], axis=1))


def _other_arm_prepares(data: Data) -> Finding:
    moving = preshaping_by_run(data.cell(ONE, f"{LEARNER}EC4"))
    still = preshaping_by_run(data.cell(ONE, f"{LEARNER}EC3"))
    if min(len(moving), len(still)) < FEWEST:
        raise MissingError(f"at least {FEWEST} runs on {ONE} that use both hands")
    test = bootstrap_test(moving, still, seed=SEED)
    text = (
        f"EC4 {interval(mean(moving, seed=SEED), '.2f')}, EC3 "
        f"{interval(mean(still, seed=SEED), '.2f')}: "
        f"{interval(difference_of_means(moving, still, seed=SEED), '.2f')}"
    )
    for label in ("corrective-alone/every", "posture-based/one-goal hands=every, other_arm=free"):
        try:
            control = preshaping_by_run(data.cell(ONE, label))
        except MissingError:
            continue
        if len(control):
            text += f"; {label} {control.mean():.2f}"
    return Finding(test.estimate > 0, text, (test,))


_EC2 = "Results, Exploration Condition 2"
_EC3 = "Results, Exploration Condition 3"
_EC4 = "Results, Exploration Condition 4"
_SUMMARY = "Results, Summary of Two-Armed Task Results"
_SHARES = (
    "Fisher's exact test of the shares, ours and published; as often where Newcombe's interval "
    f"of their difference is within ± {MARGIN:.0%}"
)
_BOUND = f"exact lower bound of the share is at least {NEARLY_ALL:.0%}"

TWO_ARMED: tuple[Claim, ...] = (
    Claim(
        "right-hand-better",
        "In two-armed task 1 the right hand alone does better than the left hand alone, which is "
        "why the initial solution uses it.",
        "Two-armed tasks",
        "exact: reward of the corrective process alone",
        _right_hand_better,
        _EC2,
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "initial-base-reverses",
        "In the initial solution of two-armed task 1 the base moves left to hit goals 1 and 3 "
        "while its net movement is to the right.",
        "Two-armed tasks",
        "exact: base positions at the goals",
        _initial_base_reverses,
        _EC2,
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "ec2-sequences",
        "In two-armed task 1, about half the runs under condition 2 find RRLR (11 of 20).",
        "Two-armed tasks",
        _SHARES,
        _ec2_sequences,
        _EC2,
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "ec2-rrlr-better",
        "In two-armed task 1, runs under condition 2 that find RRLR get more than those that keep "
        "RRRR.",
        "Two-armed tasks",
        "one-tailed bootstrap test of two samples",
        _ec2_rrlr_better,
        _EC2,
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "no-reversal",
        "In two-armed task 1 the base goes right only once RRLR is learned; before, it reverses.",
        "Two-armed tasks",
        "exact: base positions at the goals, runs under condition 2 that learned RRLR, initial "
        "solution",
        _no_reversal,
        _EC2,
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "ec2-improves",
        "In two-armed task 1, runs under condition 2 that keep the hands of the initial solution "
        "(RRRR) still improve on it.",
        "Two-armed tasks",
        "one-tailed bootstrap test of noiseless replays against the initial reward",
        _ec2_improves,
        _EC2,
        fitted=True,
    ),
    Claim(
        "ec2-unreliable",
        "In two-armed task 1, condition 2 does not reliably find better hands than RRRR within "
        "10 000 trials (nine of 20 runs do not).",
        "Two-armed tasks",
        f"exact upper bound of the share of runs that leave RRRR is at most {NEARLY_ALL:.0%}",
        _ec2_unreliable,
        _EC2,
        fitted=True,
    ),
    Claim(
        "ec3-alternates",
        "In two-armed task 1, condition 3 alternates hands (LRLR) in every run.",
        "Two-armed tasks",
        _BOUND,
        _ec3_alternates,
        _EC3,
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "ec3-better-than-ec2",
        "In two-armed task 1, the hands found under condition 3 are better than those found under "
        "condition 2.",
        "Two-armed tasks",
        "one-tailed bootstrap test against the runs of condition 2 with its best hand sequence "
        f"(by mean reward, at least {FEWEST} runs)",
        _ec3_better_than_ec2,
        _EC3,
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "ec3-as-exhaustive",
        "In two-armed task 1, condition 3 finds the hands that are best among all sequences with "
        "the corrective process alone.",
        "Two-armed tasks",
        _BOUND,
        _ec3_as_exhaustive,
        _EC3,
        fitted=True,
    ),
    Claim(
        "ec3-beats-exhaustive",
        "In two-armed task 1, condition 3 is better than trying every hand sequence with the "
        "corrective process alone.",
        "Two-armed tasks",
        "one-tailed bootstrap test against the best corrective-only reward",
        _ec3_beats_exhaustive,
        _EC3,
        fitted=True,
    ),
    Claim(
        "best-is-rrrr",
        "In two-armed task 2, the corrective process alone does best with RRRR.",
        "Two-armed tasks",
        "exact: rewards of all hand sequences; a tie leaves it open",
        _best_is_rrrr,
        _EC3,
        "Figure 7",
        fitted=True,
    ),
    Claim(
        "half-choose-rlrr",
        "In two-armed task 2, about half the runs under condition 3 choose RLRR, not RRRR (9 of "
        "20).",
        "Two-armed tasks",
        _SHARES,
        _half_choose_rlrr,
        _EC3,
        "Figure 7",
        fitted=True,
    ),
    Claim(
        "ec3-departs",
        "In two-armed task 2, condition 3 finds other hands than those that are best with the "
        "corrective process alone.",
        "Two-armed tasks",
        "exact: runs with a hand sequence that is not among the best of the corrective process",
        _ec3_departs,
        _EC3,
        "Figure 7",
        fitted=True,
    ),
    Claim(
        "rlrr-better",
        "In two-armed task 2, runs under condition 3 that learn RLRR get more than those that "
        "learn RRRR.",
        "Two-armed tasks",
        "one-tailed bootstrap test of two samples",
        _rlrr_better,
        _EC3,
        "Figure 7",
        fitted=True,
    ),
    Claim(
        "ec4-keeps-lrlr",
        "In two-armed task 1, condition 4 keeps the hands of condition 3 (LRLR).",
        "Two-armed tasks",
        _BOUND,
        _ec4_keeps_lrlr,
        _EC4,
        "Figure 8",
        fitted=True,
    ),
    Claim(
        "ec4-mixed",
        "In two-armed task 2, runs under condition 4 differ in the hands that they find.",
        "Two-armed tasks",
        "exact: more than one hand sequence",
        _ec4_mixed,
        _SUMMARY,
        "Figure 8",
    ),
    Claim(
        "ec4-beats-ec3",
        "Moving the other arm as well is better: condition 4 beats condition 3 on both tasks.",
        "Two-armed tasks",
        "one-tailed bootstrap tests of two samples",
        _ec4_beats_ec3,
        _EC4,
        "Figure 8",
        fitted=True,
    ),
    Claim(
        "proficiency-rises",
        "Reward rises with the number of levels and joints that are explored.",
        "Two-armed tasks",
        "one-tailed bootstrap tests of each condition against the next lower one and the initial "
        "solution",
        _proficiency_rises,
        _SUMMARY,
        "Figure 8",
        fitted=True,
    ),
    Claim(
        "sequences-change",
        "The hand sequence changes as more is explored.",
        "Two-armed tasks",
        "Fisher's tests of sequences: conditions 2 and 3 of task 1, 3 and 4 of task 2",
        _sequences_change,
        _SUMMARY,
        "Figure 8",
        fitted=True,
    ),
    Claim(
        "hand-coarticulation",
        "Coarticulation shows in which hand is chosen: a goal that others follow is hit with a "
        "hand that is not the quicker one for it alone (two-armed task 1, conditions 3 and 4).",
        "Two-armed tasks",
        "exact binomial tests that more than half the runs do so; the quicker hand is that of the "
        "corrective process from the same posture",
        _hand_coarticulation,
        "Discussion",
        "Figure 6",
        fitted=True,
    ),
    Claim(
        "other-arm-coarticulation",
        "Coarticulation shows in the other arm: while one hand hits, the waiting hand gets nearer "
        "to its own next goal under condition 4 than under condition 3, where only the base can "
        "bring it there (two-armed task 1).",
        "Two-armed tasks",
        "one-tailed bootstrap test of preshaping of the other arm, mean over the goals of a run; "
        "controls that do not look beyond the current goal stand beside it",
        _other_arm_prepares,
        "Methods, The Learning Process; Discussion",
    ),
)
