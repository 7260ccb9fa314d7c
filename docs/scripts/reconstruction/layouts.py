"""Where goals may be (``layouts.toml``), and what they must give with the corrective process."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from coartic import MotionModel, Task, hand_sequences
from coartic.analysis.topics.paper.published import entries_of
from coartic.analysis.words import read_beside
from coartic.motion.sequences import CorrectiveTrials, corrective_trials
from coartic.robot import Array
from coartic.threads import threads_for

Flags = NDArray[np.bool_]
GOALS_A_THREAD = 500  # sets of goals that a thread is given at once


@dataclass(frozen=True)
class Layout:
    """A task's goals as functions of P parameters, and where these may lie."""

    goals: tuple[tuple[str, str], ...]
    """Parameters that are x and y of each goal."""
    grid: dict[str, tuple[float, float, float]]
    """Lowest, highest and step of each parameter, length unit."""
    less: tuple[tuple[str, str, float], ...]
    """a, b, gap: a + gap <= b."""
    apart: float = 0.0
    """Least distance of two goals' centres, length unit."""
    earlier: dict[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    """Sets of goals from before, by name."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The parameters, in the order in which the grid goes through them, the last fastest."""
        return tuple(self.grid)

    @cached_property
    def values(self) -> tuple[Array, ...]:
        """Values of each parameter on the grid."""
        return tuple(
            np.linspace(low, high, round((high - low) / step) + 1)
            for low, high, step in self.grid.values()
        )

    @property
    def size(self) -> int:
        """Points of the grid, those that the layout does not allow included."""
        return int(np.prod([len(values) for values in self.values]))

    def blocks(self, length: int) -> Iterator[Array]:
        """The allowed points of the grid, shape ``(<= length, P)``, in order."""
        shape = tuple(len(values) for values in self.values)
        for first in range(0, self.size, length):
            index = np.unravel_index(np.arange(first, min(first + length, self.size)), shape)
            points = np.stack([v[i] for v, i in zip(self.values, index, strict=True)], axis=1)
            yield points[self.allowed(points)]

    def places(self, points: Array) -> Array:
        """Goals, shape ``(N, G, 2)``, of ``points`` (N, P)."""
        columns = [[self.names.index(name) for name in goal] for goal in self.goals]
        return np.asarray(points[:, np.array(columns)])

    def points(self, places: Array) -> Array:
        """The points ``(N, P)`` of goals (N, G, 2); what :meth:`places` undoes."""
        columns = {
            name: places[:, number, axis]
            for number, goal in enumerate(self.goals)
            for axis, name in enumerate(goal)
        }
        return np.stack([columns[name] for name in self.names], axis=1)

    def allowed(self, points: Array) -> Flags:
        """Whether points lie within the ranges and are arranged as the layout says, ``(N,)``."""
        low, high, _ = np.array(list(self.grid.values())).T
        allowed = ((points >= low) & (points <= high)).all(axis=1)
        column = dict(zip(self.names, points.T, strict=True))
        for a, b, gap in self.less:
            allowed &= column[a] + gap <= column[b] + 1e-9
        places = self.places(points)
        for first, second in itertools.combinations(range(len(self.goals)), 2):
            distances = np.linalg.norm(places[:, first] - places[:, second], axis=1)
            allowed &= distances >= self.apart - 1e-9
        return np.asarray(allowed)


def layouts() -> dict[str, Layout]:
    """The layouts by task."""
    return TypeAdapter(dict[str, Layout]).validate_python(read_beside(__file__, "layouts"))


class Constraint(NamedTuple):
    """Something that goals have to give under the corrective process alone."""

    says: str
    sequences: tuple[str, ...]
    """Hand sequences that it is about."""
    holds: Callable[[CorrectiveTrials], Flags]
    """Whether it holds, ``(N,)``, given trials with these sequences in this order."""
    reward: float | None = None
    """Reward that has to come out with the one sequence, where it is about that."""


def reward_is(hands: str, value: float, within: float = 0.0) -> Constraint:
    """The reward of a hand sequence is a printed integer, ``within`` so many ticks if derived."""

    def holds(trials: CorrectiveTrials) -> Flags:
        return np.asarray(np.abs(trials.rewards[:, 0] - value) <= within)

    return Constraint(f"{hands} gives {value:g}", (hands,), holds, value)


def earns_more(hands: str, others: Sequence[str]) -> Constraint:
    """A hand sequence earns more than each of some others; one that fails earns nothing."""

    def holds(trials: CorrectiveTrials) -> Flags:
        reward, rest = trials.rewards[:, :1], trials.rewards[:, 1:]
        return np.asarray((~(rest >= reward)).all(axis=1) & np.isfinite(reward[:, 0]))

    than = others[0] if len(others) == 1 else f"all {len(others)} others"
    return Constraint(f"{hands} earns more than {than}", (hands, *others), holds)


def base_moves(hands: str, first: int, last: int, side: str, start_x: float) -> Constraint:
    """The base moves to one side between two goals; goal 0 is the start, at ``start_x``."""

    def holds(trials: CorrectiveTrials) -> Flags:
        x = np.insert(trials.reached[:, 0, :, 0], 0, start_x, axis=1)
        moved = x[:, last] - x[:, first]
        return np.asarray(moved < 0.0 if side == "left" else moved > 0.0)

    begin = f"goal {first}" if first else "the start"
    says = f"{hands}: the base moves {side} from {begin} to goal {last}"
    return Constraint(says, (hands,), holds)


def constraints_of(task: Task) -> tuple[Constraint, ...]:
    """What is printed of a task's corrective process alone and may select; rewards first."""
    constraints = []
    for entry in entries_of(task.name, "constraint"):
        if entry.condition is not None or entry.hands is None:
            continue
        hands = entry.hands
        if entry.kind == "reward":
            within = entry.rounding if entry.difference_of else 0.0
            constraints.append(reward_is(hands, float(entry.value), within))
        elif entry.kind == "best of all sequences":
            others = [sequence for sequence in hand_sequences(task) if sequence != hands]
            constraints.append(earns_more(hands, others))
        elif entry.kind == "order" and entry.than.hands is not None:
            constraints.append(earns_more(hands, [entry.than.hands]))
        elif entry.kind == "base" and entry.net is not None:
            moves = [(goal - 1, goal, "left") for goal in entry.left]
            moves += [(goal - 1, goal, "right") for goal in entry.right]
            moves += [(0, len(task.goals), entry.net)]
            constraints += [base_moves(hands, *move, start_x=task.q0[0]) for move in moves]
    return tuple(sorted(constraints, key=lambda constraint: constraint.reward is None))


def try_sequences(
    task: Task, sequences: Sequence[str], goals: Array, *, model: MotionModel, jobs: int
) -> CorrectiveTrials:
    """Corrective trials at sets of goals (N, G, 2), on threads; the result is the same."""
    perform = partial(corrective_trials, task, tuple(sequences), model=model)
    starts = range(0, max(len(goals), 1), GOALS_A_THREAD)
    with ThreadPoolExecutor(threads_for(jobs)) as pool:
        parts = pool.map(perform, [goals[first : first + GOALS_A_THREAD] for first in starts])
        rewards, reached = zip(*parts, strict=True)
    return CorrectiveTrials(np.concatenate(rewards), np.concatenate(reached))
