"""What the reward of a trial loses beside 1 a tick: the penalties of a task, goal by goal.

A task may have a :class:`~coartic.tasks.task.Penalty`. What a goal costs by it follows from the
configuration in which the goal is hit, the one in which the goal before it was hit (or the start)
and the hand: what is stored of a run is enough. It is rounded to whole ticks, so that rewards stay
whole numbers, and no bit of a joint decides between two of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coartic.motion.compiled import entry, inner
from coartic.motion.costs import joint_costs
from coartic.motion.trigonometry import joint_chain
from coartic.robot import HANDS, Array
from coartic.tasks.task import Penalty, Point, Task


class Terms(NamedTuple):
    """A penalty as kernels read it."""

    exist: bool
    joints: float
    costly: Any  # (dof,) whether a joint is costly
    region: float
    x: float
    y: float
    radius: float
    distinct: float
    apart: float


def terms_of(task: Task) -> Terms:
    """A task's penalty for kernels; that of a task without one is never read."""
    given = task.penalty or Penalty()
    centre = disc_centre(task.goals, given)
    return Terms(
        exist=task.penalty is not None,
        joints=float(given.joints),
        costly=joint_costs(task.robot, given.costly, 2.0) > 1.0,
        region=float(given.region),
        x=float(centre[0]),
        y=float(centre[1]),
        radius=float(given.radius),
        distinct=float(given.distinct),
        apart=float(given.apart),
    )


def disc_centre(goals: Sequence[Point], penalty: Penalty) -> Point:
    """The centre of the disc of a penalty, length unit: the mean of the goals if it names none."""
    if penalty.centre is not None:
        return penalty.centre
    xs, ys = zip(*goals, strict=True)
    return math.fsum(xs) / len(xs), math.fsum(ys) / len(ys)


@inner
def penalty_at(before: Any, q: Any, arm: Any, first: bool, terms: Any, xs: Any, ys: Any) -> int:
    """The penalty of hitting a goal in ``q`` with an arm, in ticks.

    ``before`` is the configuration in which the goal before was hit, or the start if it is the
    ``first``. ``xs`` and ``ys`` are overwritten.
    """
    ticks = 0.0
    if terms.joints > 0.0:
        square = 0.0
        for j in range(len(terms.costly)):
            if terms.costly[j]:
                square += (q[j] - before[j]) * (q[j] - before[j])
        ticks += terms.joints * math.sqrt(square)
    if terms.region > 0.0:
        joint_chain(q, arm, xs, ys)
        deepest = 0.0
        for k in range(1, len(arm.links)):
            dx, dy = xs[k] - terms.x, ys[k] - terms.y
            deepest = max(deepest, 1.0 - math.sqrt(dx * dx + dy * dy) / terms.radius)
        ticks += terms.region * deepest
    if terms.distinct > 0.0 and not first:
        square = 0.0
        for j in range(arm.first, arm.first + len(arm.links)):
            square += (q[j] - before[j]) * (q[j] - before[j])
        ticks += terms.distinct * max(0.0, 1.0 - math.sqrt(square) / terms.apart)
    return math.floor(ticks + 0.5)


@entry
def penalties_kernel(
    before: Any, after: Any, hands: Any, first: Any, arms: Any, terms: Any, chain: Any, ticks: Any
) -> None:
    """The penalty of each of N movements; 0 of one that hit no goal."""
    for n in range(len(after)):
        if not math.isnan(after[n, 0]):
            arm = arms[0] if hands[n] == 0 else arms[1]
            ticks[n] = penalty_at(before[n], after[n], arm, first[n], terms, chain[0], chain[1])


def penalties_of_movements(
    task: Task,
    before: Array,
    after: Array,
    hands: NDArray[np.int64],
    first: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """The penalty of each of N movements that hit a goal, ticks, shape ``(N,)``.

    ``before`` and ``after`` have shape ``(N, dof)``, length unit (base) and rad (joints): where the
    goal before was hit, and this one; NaN for one that was not. ``hands`` ``(N,)`` are indices into
    HANDS; ``first`` ``(N,)`` says for whom it was the first goal.
    """
    ticks = np.zeros(len(after), dtype=np.int64)
    if task.penalty is not None:
        penalties_kernel(
            np.ascontiguousarray(before),
            np.ascontiguousarray(after),
            hands,
            first,
            (task.robot.arm("left"), task.robot.arm("right")),
            terms_of(task),
            np.empty((2, task.robot.most_links + 1)),
            ticks,
        )
    return ticks


def penalties(task: Task, hands: Any, hits: Array) -> NDArray[np.int64]:
    """The penalty of each goal of N trials, ticks, shape ``(N, G)``.

    ``hits`` has shape ``(N, G, dof)``, the configurations in which goals were hit, NaN for those
    that were not; ``hands`` ``(N, G)``, the hands that hit them, by name or as indices into HANDS.
    """
    count, goals, dof = hits.shape
    if task.penalty is None:
        return np.zeros((count, goals), dtype=np.int64)
    codes = np.asarray(hands)
    if codes.dtype.kind not in "iu":
        codes = (codes == HANDS[1]).astype(np.int64)
    before = np.concatenate([np.broadcast_to(task.q0, (count, 1, dof)), hits[:, :-1]], axis=1)
    return penalties_of_movements(
        task,
        before.reshape(-1, dof),
        hits.reshape(-1, dof),
        np.ascontiguousarray(codes, dtype=np.int64).ravel(),
        np.tile(np.arange(goals) == 0, count),
    ).reshape(count, goals)
