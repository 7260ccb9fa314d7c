"""Coordinates that give everything printed about the corrective process alone.

First a round grid, then the continuum: points of the grid that come near the printed rewards
are moved, by the shortest way, to where these come out as printed; what is found is spread by
random steps that are corrected in the same way. Learned rewards play no part.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from coartic import MotionModel, Task, hand_sequences
from coartic.analysis.reconstruction.constraints import (
    Constraint,
    RewardIs,
    Tried,
    sequences_of,
    try_sequences,
)
from coartic.analysis.reconstruction.layout import Layout
from coartic.robot import Array
from coartic.tasks.readings import ChosenReading, model_under

_DIFFERENCE = 0.1  # of the finite differences: rewards are whole ticks, some 100 a length unit
_STEPS = 12
_LONGEST = 0.5  # of a step, length unit
_BLOCK = 100_000  # points of the grid at once


@dataclass
class Search:
    """A search through a layout, and what it has tried."""

    task: Task
    layout: Layout
    constraints: tuple[Constraint, ...]
    readings: tuple[ChosenReading, ...] = ()
    """Of the model and of the exploration conditions; the task is as they have it."""
    jobs: int = 2
    near: float = 12.0
    """Ticks by which the rewards of a point of the grid may miss the printed ones."""
    tried: Counter[str] = field(default_factory=Counter)
    """How many points each stage tried, and how many passed each constraint, by words."""

    @property
    def model(self) -> MotionModel:
        """As the readings have it."""
        return model_under(self.readings)

    def attempt(self, points: Array, sequences: Sequence[str]) -> Tried:
        """Corrective trials at points ``(N, P)``."""
        goals = self.layout.places(points)
        return try_sequences(self.task, sequences, goals, model=self.model, jobs=self.jobs)

    def task_with(self, goals: Array) -> Task:
        """The task with other goals, ``(G, 2)``."""
        return self.task.model_copy(update={"goals": tuple(map(tuple, goals.tolist()))})

    @property
    def printed(self) -> tuple[RewardIs, ...]:
        """The rewards that have to come out."""
        return tuple(c for c in self.constraints if isinstance(c, RewardIs))

    def grid(
        self, progress: Callable[[int, int], None] = lambda done, size: None
    ) -> tuple[Array, Array]:
        """The round points that meet every constraint, and those that come near."""
        exact, near, done = [], [], 0
        for points in self.layout.blocks(_BLOCK):
            done += _BLOCK
            progress(min(done, self.layout.size), self.layout.size)
            self.tried["round sets of goals"] += len(points)
            for printed in self.printed:
                reward = self.attempt(points, [printed.hands]).reward(printed.hands)
                points = points[np.abs(reward - printed.value) <= self.near]
            near.append(points)
            exact.append(self.admitted(points, "round"))
        return np.concatenate(exact), np.concatenate(near)

    def admitted(self, points: Array, stage: str) -> Array:
        """The points that meet every constraint, counted by the first that they miss."""
        for constraint in sorted(self.constraints, key=lambda each: len(each.sequences)):
            tried = self.attempt(points, sorted(constraint.sequences))
            points = points[constraint.holds(tried)]
            self.tried[f"{stage}, and {constraint}"] += len(points)
        return points

    def solve(self, points: Array) -> Array:
        """Move points to where the printed rewards come out; those for which that succeeds.

        Steps are the shortest that would do if rewards were linear (Gauss-Newton with the
        pseudoinverse); gradients are finite differences.
        """
        hands = sequences_of(self.printed)
        wanted = np.array([c.value for c in sorted(self.printed, key=lambda c: c.hands)])
        width = points.shape[1]
        solved = []
        for _ in range(_STEPS):
            if not len(points):
                break
            shifts = np.vstack([np.zeros(width), _DIFFERENCE * np.eye(width)])
            around = (points[:, None] + shifts).reshape(-1, width)
            rewards = self.attempt(around, hands).trials.rewards
            rewards = rewards.reshape(len(points), width + 1, len(hands))
            missing = wanted - rewards[:, 0]
            done = (missing == 0.0).all(axis=1)
            solved.append(points[done])
            gradient = (rewards[:, 1:] - rewards[:, :1]) / _DIFFERENCE
            going = ~done & np.isfinite(gradient).all(axis=(1, 2))
            step = np.einsum(
                "nwh,nh->nw", np.linalg.pinv(gradient[going].transpose(0, 2, 1)), missing[going]
            )
            length = np.linalg.norm(step, axis=1, keepdims=True)
            points = points[going] + step * np.minimum(1.0, _LONGEST / np.maximum(length, 1e-12))
            points = points[self.layout.allowed(points)]
        return np.concatenate(solved) if solved else points[:0]

    def spread(self, members: Array, count: int, rng: np.random.Generator, size: float) -> Array:
        """Admissible points near members drawn at random, ``size`` away in SD, length unit."""
        chosen = members[rng.integers(len(members), size=count)]
        points = chosen + size * rng.standard_normal(chosen.shape)
        points = points[self.layout.allowed(points)]
        self.tried["random steps"] += len(points)
        return self.admitted(self.solve(points), "after steps")

    def every_sequence(self, points: Array) -> Tried:
        """Trials with all hand sequences."""
        return self.attempt(points, hand_sequences(self.task))
