"""Comparison of postures at a goal in two contexts, which differ in the goals that follow.

Anticipatory coarticulation is a difference between contexts that share everything up to this goal
(Shah, Barto & Fagg 2013, tasks ascending and descending, which share goal 1).
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, takewhile

import numpy as np
import scipy

from coartic import Hand, Task
from coartic.analysis.signatures.context_tests import (
    beyond_p,
    distance_of_means,
    permutation_p,
    posture_difference_below,
    standardised_posture_difference,
)
from coartic.analysis.solutions import Solutions
from coartic.estimates import SEED
from coartic.robot import HANDS, Array
from coartic.tasks.optima import KEPT

SAME = 0.01
"""Posture difference, length unit and rad mixed, below which postures are the same: the robot's
step."""


def context_pairs(tasks: Mapping[str, Task]) -> list[tuple[str, str, int]]:
    """Return ``(name, name, n)`` for each pair of tasks that differ only after their first goals: n
    is the number of shared first goals that a further goal follows in both tasks. Pairs with n = 0,
    with equal goals, and with different robots, starts, radii, hands or locked bases are left out.
    """
    pairs = []
    for (a, first), (b, second) in combinations(tasks.items(), 2):
        others_differ = any(getattr(first, key) != getattr(second, key) for key in KEPT)
        if not others_differ and first.goals != second.goals:
            same = (one == other for one, other in zip(first.goals, second.goals, strict=False))
            shared = len(list(takewhile(bool, same)))
            pairs.append((a, b, min(shared, len(first.goals) - 1, len(second.goals) - 1)))
    return [pair for pair in pairs if pair[2]]


def movable(task: Task, hand: Hand) -> Array:
    """Return the indices of the entries of a configuration that move a hand, shape ``(k,)``: base
    coordinates that are not locked, and joints of its arm."""
    base = [k for k, name in enumerate("xy") if name not in task.locked_base]
    return np.array([*base, *np.arange(task.robot.dof)[task.robot.joints(hand)]])


def motor_equivalence(difference: Array, jacobian: Array) -> tuple[float, float]:
    """Return the motor-equivalent part and the other part of a difference of configurations Δq.

    ‖Nᵀ Δq‖ / √dim N and ‖Rᵀ Δq‖ / √dim R, for orthonormal bases N of the null space of the Jacobian
    J and R of the row space. ``difference`` Δq has shape ``(k,)``, length unit and rad mixed,
    ``jacobian`` J shape ``(2, k)``, for the k joints that can move. In a random direction the
    squares of the parts have equal expectations. A difference between contexts is motor-equivalent
    if the first part exceeds the second: another posture with the same position of the hand.
    Caveat: for small differences the radius of the goal bounds the second part; nothing bounds
    the first. NaN for a
    space of dimension 0. Raises ValueError for other shapes.
    Source: Mattos, Latash and colleagues, Experimental Brain Research
    (doi:10.1007/s00221-015-4327-4, 10.1007/s00221-018-5215-5).
    """
    if np.ndim(difference) != 1 or np.shape(jacobian) != (2, len(difference)):
        raise ValueError(
            f"difference has shape {np.shape(difference)} and jacobian {np.shape(jacobian)}; "
            "needed are (k,) and (2, k)"
        )
    equivalent, other = (
        float(np.linalg.norm(basis.T @ difference)) / math.sqrt(basis.shape[1] or math.nan)
        for basis in (scipy.linalg.null_space(jacobian), scipy.linalg.orth(np.transpose(jacobian)))
    )
    return equivalent, other


@dataclass(frozen=True)
class TwoContexts:
    """Runs of a method that hit the same goal with the same hand, on tasks with different later
    goals.

    Parameters
    ----------
    first, second : Solutions
        Runs on two tasks that share the goal, as ``study.executed(task, method)`` returns them.
    goal : int
        Number of the goal, from 1.
    hand : {"left", "right"}
        Hand that hits the goal; runs with the other hand do not count.
    """

    first: Solutions
    second: Solutions
    goal: int
    hand: Hand

    @property
    def tasks(self) -> tuple[Task, Task]:
        """Tasks of the two contexts."""
        return self.first.task, self.second.task

    @property
    def method(self) -> str:
        """Label of the method."""
        return self.first.label

    @cached_property
    def configurations(self) -> tuple[Array, Array]:
        """Configurations of the runs with this hand at the goal in each context, ``(runs, dof)``,
        length unit and rad."""
        goal, hand = self.goal - 1, HANDS.index(self.hand)
        first, second = (
            runs.configurations[runs.hands[:, goal] == hand, goal]
            for runs in (self.first, self.second)
        )
        return first, second

    @property
    def in_both(self) -> bool:
        """True if each context has a run that hits ``goal`` with ``hand``; if False, posture
        differences and p raise ValueError."""
        return all(map(len, self.configurations))

    @property
    def n(self) -> int:
        """Number of runs with this hand in the two contexts together."""
        return sum(map(len, self.configurations))

    @property
    def posture_difference(self) -> float:
        """Distance between the mean postures of the two contexts, length unit and rad mixed."""
        return distance_of_means(*self.configurations)

    @property
    def standardised_posture_difference(self) -> float:
        """Posture difference in pooled SDs within contexts; NaN if runs within contexts do not
        differ, and if each context has a single run."""
        return standardised_posture_difference(*self.configurations)

    @cached_property
    def parts(self) -> tuple[float, float]:
        """Motor-equivalent part of the posture difference, which leaves the hand where it is, and
        the other part, each per dimension (:func:`motor_equivalence`)."""
        task, joints = self.first.task, movable(self.first.task, self.hand)
        posture = np.concatenate(self.configurations).mean(axis=0)
        first, second = (configurations.mean(axis=0) for configurations in self.configurations)
        jacobian = task.robot.jacobian(posture, self.hand)[:, joints]
        return motor_equivalence((first - second)[joints], jacobian)

    @cached_property
    def p(self) -> float:
        """P-value of the one-tailed permutation test that the posture difference exceeds chance
        (:func:`.permutation_p`); NaN if a context has a single run."""
        return permutation_p(*self.configurations, self._rng("context dependence"))

    @cached_property
    def p_same(self) -> float:
        """P-value of the bootstrap test that the posture difference is below :data:`SAME`
        (:func:`.posture_difference_below`); NaN if a context has a single run."""
        rng = self._rng("sameness")
        return posture_difference_below(*self.configurations, SAME, rng, standardised=False)

    def p_beyond(self, other: TwoContexts) -> float:
        """Return the p-value of the permutation test that the posture difference exceeds the
        posture difference of ``other``, another method at the same goal: twice the upper tail
        (:func:`.beyond_p`); NaN if a context has a single run."""
        return beyond_p(self.configurations, other.configurations, self._rng("beyond"))

    def _rng(self, test: str) -> np.random.Generator:
        """Return a new random generator for a test, seeded by the test, the goal, the hand and the
        second task: the same in every folder and for every method."""
        where = f"goal {self.goal}, {self.hand} hand, against {self.second.task.name}"
        return np.random.default_rng([SEED, zlib.crc32(f"{test} {where}".encode())])
