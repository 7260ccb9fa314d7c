"""The paper's claims about two-armed tasks 1 and 2 that have tests of their own."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from coartic.analysis.claims.data import FREE, ONE, TWO, Data, MissingError
from coartic.analysis.claims.register import Finding
from coartic.analysis.claims.rules import nearly_all
from coartic.analysis.claims.statements import decides
from coartic.analysis.methods import LEARNER
from coartic.analysis.published import published_exhaustive, published_initial
from coartic.analysis.statistics.estimates import Inference
from coartic.analysis.statistics.hypotheses import independence_test
from coartic.analysis.words import tally
from coartic.robot import Array


@decides("right-hand-better")
def _right_hand_better(data: Data) -> Finding:
    known = data.sequences(ONE)
    right, left = (known.get(hands, math.nan) for hands in ("RRRR", "LLLL"))
    if math.isnan(right + left):
        raise MissingError("the corrective process alone has no reward with RRRR or LLLL")
    printed = published_initial(ONE)
    assert printed is not None
    return Finding(right > left, f"RRRR {right:.0f} (published {printed.reward}), LLLL {left:.0f}")


def _base_steps(start: Array, configurations: Array) -> Array:
    return np.diff(np.append(start[0], configurations[:, 0]))


@decides("initial-base-reverses")
def _initial_base_reverses(data: Data) -> Finding:
    steps = _base_steps(data.task(ONE).q0, data.initial(ONE).configurations)
    return Finding(
        bool(steps[0] < 0 and steps[2] < 0 < steps.sum()),
        f"base along x from goal to goal {', '.join(f'{step:+.2f}' for step in steps)}, in all "
        f"{steps.sum():+.2f}",
    )


@decides("no-reversal")
def _no_reversal(data: Data) -> Finding:
    cell = data.cell(ONE, f"{LEARNER}EC2")
    runs = [run for run in cell.runs if run.execution.hands == "RRLR"]
    if not runs:
        raise MissingError(f"no run of EC2 on {ONE} learned RRLR, as in the figure")
    q0 = data.task(ONE).q0
    right = sum(bool((_base_steps(q0, r.execution.configurations) > 0).all()) for r in runs)
    return nearly_all("with RRLR the base goes right only", right, len(runs))


@decides("ec3-as-exhaustive")
def _ec3_as_exhaustive(data: Data) -> Finding:
    best, reward = data.best_sequences(ONE)
    found = data.hands(ONE, "EC3")
    most, count = found.most_common(1)[0]
    text = f"exhaustive search finds {' and '.join(best)} ({reward:.0f}); EC3 {tally(found)}"
    return Finding(most in best and 2 * count > found.total(), text)


@decides("best-is-rrrr")
def _best_is_rrrr(data: Data) -> Finding:
    best, reward = data.best_sequences(TWO)
    printed = published_exhaustive(TWO)
    assert printed is not None
    text = (
        f"best of the corrective process alone: {' and '.join(best)} {reward:.0f} (published "
        f"{printed[0]} {printed[1]})"
    )
    if "RRRR" not in best:
        return Finding(False, text)
    return Finding(True, text) if len(best) == 1 else Finding(None, f"{text}: a tie")


@decides("ec3-departs")
def _ec3_departs(data: Data) -> Finding:
    best, reward = data.best_sequences(TWO)
    found = data.hands(TWO, "EC3")
    away = sum(count for hands, count in found.items() if hands not in best)
    text = (
        f"{tally(found)}; best of the corrective process alone {' and '.join(best)} "
        f"({reward:.0f}): {away} of {found.total()} runs depart from it"
    )
    if away:
        return Finding(True, text)
    if len(best) > 1:
        return Finding(None, f"{text}. With a tie, to choose among the best is no departure")
    return Finding(False, text)


@decides("ec4-mixed")
def _ec4_mixed(data: Data) -> Finding:
    found = data.hands(TWO, "EC4")
    return Finding(len(found) > 1, f"{tally(found)} of {found.total()} runs")


@decides("sequences-change")
def _sequences_change(data: Data) -> Finding:
    before, after, second = data.hands(ONE, "EC2"), data.hands(ONE, "EC3"), data.hands(TWO, "EC3")
    initial = data.task(TWO).initial_hands
    names = sorted(set(before) | set(after))
    table = [[count[name] for name in names] for count in (before, after)]
    test = independence_test(*table)
    left = second.total() - second[initial]
    against = [_both_keep(name, before, after) for name in names]
    against.append(nearly_all("", second[initial], second.total()).tests[0])
    return Finding(
        test.estimate > 0 and left > 0,
        f"{ONE}: EC2 {tally(before)}, EC3 {tally(after)}; {TWO}: initial {initial}, EC3 "
        f"{tally(second)}, other hands in {left} of {second.total()} runs",
        (test,),
        tuple(against),
    )


def _both_keep(name: str, before: Counter[str], after: Counter[str]) -> Inference:
    """Test that most runs have the sequence under both conditions: the larger p."""
    tests = [nearly_all("", count[name], count.total()).tests[0] for count in (before, after)]
    return max(tests, key=lambda test: test.p)


@decides("rail")
def _rail(data: Data) -> Finding:
    """Whether the lock of the base is behind the one sequence of condition 3."""
    locked, free = data.hands(ONE, "EC3"), data.hands(FREE, "EC3")
    (hands, held), (other, kept) = locked.most_common(1)[0], free.most_common(1)[0]
    on_rail = nearly_all(f"on the rail {hands}", held, locked.total())
    without = nearly_all(f"with the base free {other}", kept, free.total(), "few")
    before = ", ".join(f"{of} {tally(data.hands(of, 'EC2'))}" for of in (ONE, FREE))
    return Finding(
        bool(on_rail.holds and without.holds),
        f"EC3: {on_rail.evidence}; {without.evidence} ({tally(free)}); EC2: {before}",
        (*on_rail.tests, *without.tests),
        (*(on_rail.against or ()), *(without.against or ())),
    )
