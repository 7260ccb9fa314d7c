"""Signatures between tasks: the same goal in two contexts, or next to a goal that moves."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, product

import numpy as np

from coartic import Hand, Task, Trajectory
from coartic.analysis.signatures.context import (
    beyond_p,
    context_dependence,
    distance,
    lead_time,
    permutation_p,
)
from coartic.analysis.signatures.locus import LEAST, ContextFamily, locus_slopes, slope_norm
from coartic.analysis.signatures.manifold import jacobian_of, motor_equivalence, subspaces
from coartic.analysis.signatures.rows import (
    FAMILIES,
    REGISTER,
    Row,
    Rows,
    estimated,
    row,
    where,
    without,
)
from coartic.analysis.statistics.estimates import SEED
from coartic.analysis.trajectories import Trajectories, last_ticks, postures
from coartic.robot import HANDS, Array
from coartic.runs.plan import label_of

NO_SPREAD = "one run a context: no spread within contexts, no test"


@dataclass(frozen=True)
class TwoContexts:
    """Runs of one method that hit the same goal with the same hand before other successors."""

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
    def place(self) -> Row:
        """Where every value belongs: the goal, the hand and the other task."""
        return {"goal": self.goal, "hand": self.hand, "against": self.second.task.name}

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
        return distance(*self.postures)

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

    @property
    def parts(self) -> tuple[float, float]:
        """Parts of the difference of mean postures: leaving the hand in place, and moving it."""
        joints, jacobian = self.jacobian
        first, second = (configurations.mean(axis=0) for configurations in self.postures)
        return motor_equivalence((first - second)[joints], jacobian)

    @cached_property
    def p(self) -> float:
        """P-value of the permutation test over runs; NaN where a context has one run."""
        return self.p_within("context dependence")

    def p_beyond(self, placebo: TwoContexts) -> float:
        """P-value of the test that these runs lie further apart than a placebo's; NaN where a
        context has one run."""
        rng = rng_of(f"beyond {placebo.method}", self.place)
        return beyond_p(self.postures, placebo.postures, rng)

    def p_within(self, signature: str, basis: Array | None = None) -> float:
        """P-value of that test within the span of an orthonormal ``basis`` (dof, d).

        Each ``signature`` has draws of its own.
        """
        return float(permutation_p(*self.postures, rng_of(signature, self.place), basis=basis))


def between_contexts(contexts: TwoContexts) -> Rows:
    """Rows of all signatures of two contexts, in the order of the register."""
    place, n, few = contexts.place, contexts.n, min(map(len, contexts.runs)) < 2
    yield row("context distance", place, value=contexts.apart, n=n)
    spreads = contexts.spreads
    why = "runs do not differ within contexts" if math.isnan(spreads) else ""
    why = NO_SPREAD if few else why
    yield row("context dependence", place, value=spreads, p=contexts.p, n=n, why_not=why)
    joints, jacobian = contexts.jacobian
    names = "motor-equivalent part", "non-motor-equivalent part"
    why = "one run a context: no test" if few else ""
    for name, value, basis in zip(names, contexts.parts, subspaces(jacobian), strict=True):
        of_all_joints = np.zeros((contexts.first.task.robot.dof, basis.shape[1]))
        of_all_joints[joints] = basis
        p = contexts.p_within(name, of_all_joints)
        yield row(name, place, value=value, p=p, n=n, why_not=why)
    count = min(int(run.hits[contexts.goal - 1]) for group in contexts.runs for run in group) + 1
    if few or count == 1:
        why = NO_SPREAD if few else "a run hits it at the start"
        yield row("lead time", place, n=n, why_not=why)
        return
    first, second = (last_ticks(group, contexts.goal, count) for group in contexts.runs)
    ticks = lead_time(first, second, rng_of("lead time", place))
    place["longest"] = count - 1
    why = "not distinguishable at the hit" if ticks is None else ""
    yield row("lead time", place, value=math.nan if ticks is None else ticks, n=n, why_not=why)


def slopes(family: ContextFamily, cells: Mapping[str, Trajectories]) -> Rows:
    """Slopes at the goals before (anticipatory) and after (carry-over) the moving one.

    ``cells``: what one method did on tasks of the family, in their order.
    """
    task = next(iter(cells.values())).task
    moving, position = family
    beside = {moving - 1, moving + 1} & set(range(1, len(task.goals) + 1))
    for goal, hand in product(sorted(beside), HANDS):
        runs = {name: cell.with_hand(hand, goal) for name, cell in cells.items()}
        places = [position[name] for name, of_task in runs.items() for _ in of_task]
        n, place = len(places), {"goal": goal, "hand": hand, "moving": moving}
        if not n:
            continue
        if len(set(places)) < LEAST:
            why = f"runs with that hand in fewer than {LEAST} tasks of the family"
            yield from without(FAMILIES, why, place, n)
            continue
        q = postures(tuple(chain.from_iterable(runs.values())), goal)
        for joint, slope in zip(task.robot.joint_names, locus_slopes(q, places), strict=True):
            unit = "1" if joint.startswith("base") else REGISTER["locus slope"].unit
            yield estimated("locus slope", {**place, "joint": joint}, slope, n, unit=unit)
        norm = slope_norm(q, places, rng_of("locus slope norm", place))
        yield estimated("locus slope norm", place, norm, n)


def rng_of(signature: str, place: Row) -> np.random.Generator:
    """A generator for each row of a signature, the same in every folder."""
    return np.random.default_rng([SEED, zlib.crc32(f"{signature} {where(place)}".encode())])
