"""What signatures between tasks are of: one goal in two contexts."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from coartic import Hand, Task, Trajectory
from coartic.analysis.signatures.context import (
    beyond_p,
    context_dependence,
    distance_of_means,
    permutation_p,
)
from coartic.analysis.signatures.manifold import jacobian_of, motor_equivalence
from coartic.analysis.statistics.estimates import SEED, Estimate
from coartic.analysis.trajectories import Trajectories, postures
from coartic.robot import Array
from coartic.runs.plan import label_of


class Place(NamedTuple):
    """Where in a solution, and between which tasks, a value belongs; None or empty: nowhere."""

    goal: int | None = None
    """Number of the goal, from 1."""
    hand: str = ""
    against: str = ""
    """Task that is the other context."""

    def __str__(self) -> str:
        """In words: ``goal 1, right hand, against descending``."""
        parts = [] if self.goal is None else [f"goal {self.goal}"]
        parts += [f"{self.hand} hand"] if self.hand else []
        parts += [f"against {self.against}"] if self.against else []
        return ", ".join(parts)


NOWHERE = Place()


class Value(NamedTuple):
    """A value of a signature."""

    place: Place = NOWHERE
    estimate: Estimate = Estimate(math.nan)
    n: int = 0
    """Runs that went into it."""
    unit: str | None = None
    """Where it is not that of the signature."""


def rng_of(signature: str, place: Place) -> np.random.Generator:
    """A generator for each value of a signature, the same in every folder."""
    return np.random.default_rng([SEED, zlib.crc32(f"{signature} {place}".encode())])


@dataclass(frozen=True)
class TwoContexts:
    """Runs of one method that hit the same goal with the same hand before other successors.

    Parameters
    ----------
    first, second : Trajectories
        Runs on two tasks that share the goal, as ``study.trajectories(task, method)`` gives them,
        or ``study.replays(task, method)`` without noise.
    goal : int
        Number of the goal, from 1.
    hand : {"left", "right"}
        Runs that hit the goal with the other hand do not count.

    Examples
    --------
    In the page *Use it from Python*.
    """

    first: Trajectories
    second: Trajectories
    goal: int
    """Number of the goal, from 1."""
    hand: Hand

    @property
    def tasks(self) -> tuple[Task, Task]:
        """The tasks of both contexts."""
        return self.first.task, self.second.task

    @property
    def method(self) -> str:
        """Label of the method."""
        return label_of(self.first.method, self.first.variant)

    @property
    def place(self) -> Place:
        """The goal, the hand and the other task."""
        return Place(self.goal, self.hand, self.second.task.name)

    @property
    def row(self) -> str:
        """Name of the contexts' row in table *contexts*."""
        return f"{self.first.task.name} {self.method} goal {self.goal} {self.hand}"

    @cached_property
    def runs(self) -> tuple[tuple[Trajectory, ...], tuple[Trajectory, ...]]:
        """Runs of either context that hit the goal with the hand."""
        hand, goal = self.hand, self.goal
        return self.first.with_hand(hand, goal), self.second.with_hand(hand, goal)

    @cached_property
    def postures(self) -> tuple[Array, Array]:
        """Configurations at the goal in either context, ``(runs, dof)``, length unit and rad."""
        first, second = self.runs
        return postures(first, self.goal), postures(second, self.goal)

    @property
    def n(self) -> int:
        """Runs of both."""
        return sum(map(len, self.runs))

    @property
    def apart(self) -> float:
        """Distance of the mean postures, length unit and rad."""
        return distance_of_means(*self.postures)

    @property
    def spreads(self) -> float:
        """Distance of the mean postures in pooled SDs of the runs; NaN without a spread."""
        return context_dependence(*self.postures)

    @property
    def hands_apart(self) -> float:
        """Distance of the hand in the mean postures, length unit."""
        robot = self.first.task.robot
        ends = [robot.forward_kinematics(q.mean(axis=0), self.hand) for q in self.postures]
        return float(np.linalg.norm(ends[0] - ends[1]))

    @cached_property
    def jacobian(self) -> tuple[Array, Array]:
        """Joints that can move the hand, and its Jacobian in these, at the mean posture."""
        return jacobian_of(self.first.task, self.hand, np.concatenate(self.postures))

    @cached_property
    def parts(self) -> tuple[float, float]:
        """Parts of the difference of mean postures: leaving the hand in place, and moving it."""
        joints, jacobian = self.jacobian
        first, second = (configurations.mean(axis=0) for configurations in self.postures)
        return motor_equivalence((first - second)[joints], jacobian)

    @cached_property
    def p(self) -> float:
        """P-value of the permutation test over runs; NaN where a context has one run."""
        return self.p_within("context dependence")

    def p_within(self, signature: str, basis: Array | None = None) -> float:
        """P-value of that test within the span of an orthonormal ``basis`` (dof, d).

        Each ``signature`` has draws of its own.
        """
        return permutation_p(*self.postures, rng_of(signature, self.place), basis=basis)

    def p_beyond(self, placebo: TwoContexts) -> float:
        """P-value of the test that these runs lie further apart than a placebo's; NaN where a
        context has one run."""
        rng = rng_of(f"beyond {placebo.method}", self.place)
        return beyond_p(self.postures, placebo.postures, rng)

    def value(self, value: float, p: float = math.nan) -> Value:
        """A value of these contexts with its test."""
        return Value(self.place, Estimate(value, p=p), self.n)
