"""What is printed of a task, as what a search has to meet and what scores it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from coartic import Task, hand_sequences
from coartic.analysis import printed
from coartic.analysis.published import RUNS
from coartic.analysis.reconstruction.constraints import Above, BaseMoves, Constraint, RewardIs
from coartic.analysis.reconstruction.scoring import Figure, Order, Test

_Cell = tuple[str | None, str | None]  # condition and hands


def constraints_of(task: Task) -> tuple[Constraint, ...]:
    """What the corrective process alone has to give, of what may select; the rewards first."""
    found = [made for entry in printed.constraints(task.name) for made in _constraints(entry, task)]
    return tuple(sorted(found, key=lambda each: not isinstance(each, RewardIs)))


def _constraints(entry: printed.Entry, task: Task) -> Iterator[Constraint]:
    match entry:
        case printed.Reward(condition=None, hands=str(hands)):
            yield RewardIs(hands, float(entry.value), entry.rounding if entry.derived else 0.0)
        case printed.Best():
            yield Above(entry.hands, tuple(s for s in hand_sequences(task) if s != entry.hands))
        case printed.Order(condition=None, hands=str(hands)) if entry.than.hands is not None:
            yield Above(hands, (entry.than.hands,))
        case printed.Base(condition=None, hands=str(hands)):
            for goal in entry.left:
                yield BaseMoves(hands, goal - 1, goal, "left")
            for goal in entry.right:
                yield BaseMoves(hands, goal - 1, goal, "right")
            yield BaseMoves(hands, 0, len(task.goals), entry.net)


def tests_of(task: str) -> tuple[Test, ...]:
    """What learning runs are compared with: means, SDs, shares of hand sequences, orders."""
    entries = printed.tests(task)
    counts: dict[_Cell, int] = {
        (entry.condition, entry.hands): int(entry.value)
        for entry in entries
        if isinstance(entry, printed.Count)
    }
    spreads: dict[_Cell, float] = {
        (entry.condition, entry.hands): float(entry.value)
        for entry in entries
        if isinstance(entry, printed.Sd)
    }
    found = [made for entry in entries for made in _tests(entry, counts, spreads)]
    return tuple(_implied(test, counts) for test in dict.fromkeys(found))


def _implied(test: Test, counts: Mapping[_Cell, int]) -> Test:
    """Marked where it follows from others: of all runs, beside parts that make up all runs."""
    parts = [n for (condition, hands), n in counts.items() if condition == test.condition and hands]
    if isinstance(test, Figure) and test.hands is None and sum(parts) == RUNS:
        return replace(test, implied=True)
    return test


def _tests(
    entry: printed.Entry,
    counts: Mapping[_Cell, int],
    spreads: Mapping[_Cell, float],
) -> Iterator[Test]:
    runs = counts.get((getattr(entry, "condition", None), getattr(entry, "hands", None)), RUNS)
    match entry:
        case printed.Reward(condition=str(condition)):
            sd = spreads.get((condition, entry.hands))
            yield Figure(condition, "mean", float(entry.value), runs, entry.hands, sd, entry.digits)
        case printed.Sd(condition=str(condition)):
            yield Figure(condition, "sd", float(entry.value), runs, entry.hands, None, entry.digits)
        case printed.Count(condition=str(condition)):
            yield Figure(condition, "share", int(entry.value) / RUNS, RUNS, entry.hands)
        case printed.Sequences(condition=condition, found=(only,)):
            yield Figure(condition, "share", 1.0, RUNS, only)
        case printed.Order(condition=str(condition), than=than) if not entry.sample:
            if than.condition is not None and entry.goal is None:
                both = runs, counts.get((than.condition, than.hands), RUNS)
                below = None if entry.p_below is None else float(entry.p_below)
                hands = entry.hands, than.hands
                yield Order(condition, than.condition, both, *hands, p_below=below)


def conditions_of(task: str) -> tuple[str, ...]:
    """Exploration conditions that something is printed of, in the paper's order."""
    found = {getattr(entry, "condition", None) for entry in printed.tests(task)}
    return tuple(sorted(filter(None, found)))
