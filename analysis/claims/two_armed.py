"""Judges of the paper's claims about the two-armed tasks."""

from __future__ import annotations

import math
from collections import Counter
from contextlib import suppress
from dataclasses import replace

import numpy as np

from coartic.analysis.claims.data import FREE, ONE, TWO, Data, MissingError
from coartic.analysis.claims.register import MARGINS, Claim, Finding
from coartic.analysis.claims.rules import all_hold, exceeds, nearly_all, shown
from coartic.analysis.methods import LEARNER, name_of
from coartic.analysis.published import published_exhaustive, published_initial
from coartic.analysis.signatures.other_arm import preshaping, readiness
from coartic.analysis.signatures.subtasks import isolated_agreement, served
from coartic.analysis.statistics.estimates import FEWEST, Inference
from coartic.analysis.statistics.hypotheses import independence_test, share_test
from coartic.analysis.trajectories import Trajectories
from coartic.analysis.words import listed, number, tally
from coartic.robot import Array

_CONTROLS = ("corrective-alone/every", "posture-based/one-goal hands=every, other_arm=free")
"""Methods that do not look beyond the current goal."""


def right_hand_better(data: Data, _: Claim) -> Finding:
    """Whether the right hand alone does better than the left hand alone."""
    known = data.sequences(ONE)
    right, left = (known.get(hands, math.nan) for hands in ("RRRR", "LLLL"))
    if math.isnan(right + left):
        raise MissingError("the corrective process alone has no reward with RRRR or LLLL")
    printed = published_initial(ONE)
    assert printed is not None
    text = f"RRRR {number(right)} (published {number(printed.reward)}), LLLL {number(left)}."
    return Finding(right > left, text)


def initial_base_reverses(data: Data, _: Claim) -> Finding:
    """Whether the base moves left to goals 1 and 3 and right in all."""
    steps = _base_steps(data.task(ONE).q0, data.initial(ONE).configurations)
    each = ", ".join(number(step, 2) for step in steps)
    return Finding(
        bool(steps[0] < 0 and steps[2] < 0 < steps.sum()),
        f"The base moves along x by {each} from goal to goal, {number(steps.sum(), 2)} in all.",
    )


def _base_steps(start: Array, configurations: Array) -> Array:
    return np.diff(np.append(start[0], configurations[:, 0]))


def no_reversal(data: Data, _: Claim) -> Finding:
    """Whether the base only moves right in runs that learned RRLR."""
    cell = data.cell(ONE, f"{LEARNER}EC2")
    runs = [run for run in cell.runs if run.execution.hands == "RRLR"]
    if not runs:
        raise MissingError(f"no run of EC2 on {ONE} learned RRLR, as in the figure")
    q0 = data.task(ONE).q0
    right = sum(bool((_base_steps(q0, run.execution.configurations) > 0).all()) for run in runs)
    return nearly_all("With RRLR the base moves right only", right, len(runs))


def ec3_as_exhaustive(data: Data, _: Claim) -> Finding:
    """Whether most runs of condition 3 find the corrective process's best hands."""
    best, reward = data.best_sequences(ONE)
    found = data.hands(ONE, "EC3")
    most, count = found.most_common(1)[0]
    text = f"The best of all sequences is {listed(best)} ({number(reward)}); EC3: {tally(found)}."
    return Finding(most in best and 2 * count > found.total(), text)


def best_is_rrrr(data: Data, _: Claim) -> Finding:
    """Whether RRRR alone is best with the corrective process."""
    best, reward = data.best_sequences(TWO)
    printed = published_exhaustive(TWO)
    assert printed is not None
    text = (
        f"The best of all sequences is {listed(best)} ({number(reward)}; published {printed[0]} "
        f"{number(printed[1])})."
    )
    if "RRRR" not in best:
        return Finding(False, text)
    return Finding(True, text) if len(best) == 1 else Finding(None, f"{text} That is a tie.")


def ec3_departs(data: Data, _: Claim) -> Finding:
    """Whether a run of condition 3 ends with hands that are not the corrective process's best."""
    best, reward = data.best_sequences(TWO)
    found = data.hands(TWO, "EC3")
    away = sum(count for hands, count in found.items() if hands not in best)
    text = (
        f"{tally(found)}; best with the corrective process alone: {listed(best)} "
        f"({number(reward)}). {away} of {found.total()} runs depart from it."
    )
    if not away and len(best) > 1:
        return Finding(None, f"{text} With a tie, a choice among the best is no departure.")
    return Finding(away > 0, text)


def ec4_mixed(data: Data, _: Claim) -> Finding:
    """Whether runs of condition 4 end with more than one hand sequence."""
    found = data.hands(TWO, "EC4")
    return Finding(len(found) > 1, f"{tally(found)} of {found.total()} runs.")


def sequences_change(data: Data, _: Claim) -> Finding:
    """Whether hands change from condition 2 to 3, and from the initial solution to condition 3."""
    before, after, second = data.hands(ONE, "EC2"), data.hands(ONE, "EC3"), data.hands(TWO, "EC3")
    initial = data.task(TWO).initial_hands
    names = sorted(set(before) | set(after))
    test = independence_test(*([count[name] for name in names] for count in (before, after)))
    left = second.total() - second[initial]
    against = [_both_keep(name, before, after) for name in names]
    against.append(nearly_all("", second[initial], second.total()).tests[0])
    return Finding(
        test.estimate > 0 and left > 0,
        f"{ONE}: EC2 {tally(before)}, EC3 {tally(after)}; {TWO}: initially {initial}, EC3 "
        f"{tally(second)}, other hands in {left} of {second.total()} runs.",
        (test,),
        tuple(against),
    )


def _both_keep(name: str, before: Counter[str], after: Counter[str]) -> Inference:
    """Test that most runs have the sequence under both conditions: the larger p."""
    tests = [nearly_all("", count[name], count.total()).tests[0] for count in (before, after)]
    return max(tests, key=lambda test: test.p)


def rail(data: Data, _: Claim) -> Finding:
    """Whether condition 3 finds one sequence with the base on its rail, and none with it free."""
    locked, free = data.hands(ONE, "EC3"), data.hands(FREE, "EC3")
    (hands, held), (other, kept) = locked.most_common(1)[0], free.most_common(1)[0]
    on_rail = nearly_all(f"On the rail {hands}", held, locked.total())
    without = nearly_all(f"with the base free {other}", kept, free.total(), "few")
    return Finding(
        bool(on_rail.holds and without.holds),
        f"{on_rail.evidence}; {without.evidence} ({tally(free)}).",
        (*on_rail.tests, *without.tests),
        (*(on_rail.against or ()), *(without.against or ())),
    )


def hand_coarticulation(data: Data, _: Claim) -> Finding:
    """Whether most runs hit a goal that another follows with the slower hand for it alone."""
    tests, against, parts = [], [], []
    for condition in ("EC3", "EC4"):
        cell = data.cell(ONE, LEARNER + condition)
        # The last goal has no successor to be prepared for.
        agrees = np.array([isolated_agreement(run)[:-1] for run in cell.runs])
        away, total = int((~agrees.all(axis=1)).sum()), len(agrees)
        tests.append(share_test(away, total, MARGINS["majority"], "greater"))
        against.append(share_test(away, total, MARGINS["majority"], "less"))
        parts.append(f"{condition}: {away} of {total} runs use a slower hand")
    return replace(all_hold(tests, parts), against=tuple(against))


def arm_coarticulation(data: Data, _: Claim) -> Finding:
    """Whether learned postures of base and chosen arm leave the next goal nearer."""
    tests, parts = [], []
    for task in (ONE, TWO):
        for condition in ("EC3", "EC4"):
            cost, gain = _served(data.cell(task, LEARNER + condition))
            tests.append(exceeds(gain, 0.0))
            parts.append(f"{task} {condition} {shown(gain)} ticks, for {shown(cost)}")
        for label in _CONTROLS:
            with suppress(MissingError):
                cost, gain = _served(data.cell(task, label))
                parts.append(
                    f"{task} {name_of(label)} {number(gain.mean(), 1)}, for "
                    f"{number(cost.mean(), 1)}"
                )
    before = (
        "Ticks gained on the way to the next goal, and what the way to this goal costs more, "
        "against the posture in which the corrective process would have hit it (mean over goals): "
    )
    return all_hold(tests, parts, before)


def _served(cell: Trajectories) -> Array:
    """Means over goals of :func:`~.subtasks.served`, shape ``(2, runs)``."""
    gains = np.array([served(run) for run in cell.runs])
    if not np.isfinite(gains).all():
        raise MissingError(f"the corrective process alone misses a goal of {cell.task.name}")
    return np.asarray(gains.mean(axis=1).T)


def other_arm_coarticulation(data: Data, _: Claim) -> Finding:
    """Whether the waiting arm brings its hand nearer to its next goal under condition 4."""
    moving, still = (data.cell(ONE, LEARNER + condition) for condition in ("EC4", "EC3"))
    nearer = prepared_by_waiting(moving)
    if len(nearer) < FEWEST:
        raise MissingError(f"fewer than {FEWEST} runs of EC4 on {ONE} use both hands")
    parts = [
        f"The waiting arm under EC4 brings its hand nearer by {shown(nearer, 2)} of the initial "
        f"distance ({_by_goal_in_words(_by_goal(moving, since_hit=True))})",
        "with what base and posture add, "
        f"{_by_goal_in_words(_by_goal(moving, since_hit=False))}, and under EC3, where that arm "
        f"cannot move, {_by_goal_in_words(_by_goal(still, since_hit=False))}",
    ]
    for label in _CONTROLS:
        with suppress(MissingError):
            control = prepared_by_waiting(data.cell(ONE, label))
            if len(control):
                parts.append(f"{name_of(label)}: {number(control.mean(), 2)}")
    return all_hold([exceeds(nearer, 0.0)], parts)


def prepared_by_waiting(cell: Trajectories) -> Array:
    """How much nearer the waiting arm has brought its hand to its next goal, mean over goals.

    :func:`~.other_arm.preshaping` of each run, shape ``(runs,)``: 0 where the arm keeps still.
    Runs that use one hand only are left out. Raises MissingError where the corrective process
    alone does not complete the task.
    """
    values = _by_goal(cell, since_hit=True)
    known = ~np.isnan(values)
    return np.asarray(np.nanmean(values[known.any(axis=1)], axis=1))


def _by_goal(cell: Trajectories, *, since_hit: bool) -> Array:
    """Preshaping of each run by goal, shape ``(runs, G)``."""
    initial = cell.initial
    if initial is None:
        raise MissingError(f"the corrective process alone does not complete {cell.task.name}")
    measure = preshaping if since_hit else readiness
    return np.array([measure(run, initial) for run in cell.runs])


def _by_goal_in_words(values: Array) -> str:
    """Means by goal, of the goals that have one."""
    known = [(k, row[~np.isnan(row)]) for k, row in enumerate(values.T, 1)]
    return ", ".join(f"{number(row.mean(), 2)} at goal {k}" for k, row in known if len(row))
