"""Measures between tasks: the same goal in two contexts, or next to a goal that moves."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from analysis.signatures.context import (
    context_dependence,
    distance,
    lead_time,
    permutation_p,
)
from analysis.signatures.locus import LEAST, Family, locus_slopes, slope_norm
from analysis.signatures.manifold import motor_equivalence, movable, subspaces
from analysis.signatures.rows import Place, Signature, Value
from analysis.signatures.trajectories import Trajectories, last_ticks, postures
from analysis.statistics import spread
from analysis.statistics.estimates import SEED
from coartic import Hand, Trajectory
from coartic.robot import HANDS, Array

Runs = tuple[Trajectory, ...]


@dataclass(frozen=True)
class Contexts:
    """Runs of one method that hit the same goal with the same hand before other successors."""

    first: Trajectories
    second: Trajectories
    goal: int
    hand: Hand | None
    """None where no hand hit the goal in both contexts."""

    @property
    def place(self) -> Place:
        """Of every value."""
        return Place(goal=self.goal, hand=self.hand or "", against=self.second.task.name)

    @cached_property
    def runs(self) -> tuple[Runs, Runs]:
        """Of either context."""
        if self.hand is None:
            return (), ()
        return (
            self.first.with_hand(self.hand, self.goal),
            self.second.with_hand(self.hand, self.goal),
        )

    @cached_property
    def postures(self) -> tuple[Array, Array]:
        """Of either context at the goal, ``(runs, dof)``."""
        first, second = self.runs
        return postures(first, self.goal), postures(second, self.goal)

    @property
    def n(self) -> int:
        """Runs of both."""
        return sum(map(len, self.runs))

    @property
    def single(self) -> bool:
        """Whether a context has one run only, and so no spread."""
        return min(map(len, self.runs)) < 2

    def p(self, signature: Signature, basis: Array | None = None) -> float:
        """Of no difference (within a subspace); NaN for a single run."""
        first, second = self.postures
        return permutation_p(first, second, rng_of(signature, self.place), basis=basis)


def contexts_of(first: Trajectories, second: Trajectories, shared: int) -> Iterator[Contexts]:
    """Every shared goal with every hand that hit it in both contexts."""
    for goal in range(1, shared + 1):
        found: list[Hand | None] = [
            hand for hand in HANDS if first.with_hand(hand, goal) and second.with_hand(hand, goal)
        ]
        for hand in found or [None]:
            yield Contexts(first, second, goal, hand)


def context_distance(contexts: Contexts, signature: Signature) -> Iterator[Value]:
    """Distance of mean postures."""
    yield signature.at(contexts.place, value=distance(*contexts.postures), n=contexts.n)


def dependence(contexts: Contexts, signature: Signature) -> Iterator[Value]:
    """The distance in pooled standard deviations, with its test."""
    why = "one run a context: no spread within contexts, no test" if contexts.single else ""
    value = context_dependence(*contexts.postures)
    if not why and math.isnan(value):
        why = "runs do not differ within contexts"
    p = contexts.p(signature)
    yield signature.at(contexts.place, value=value, p=p, n=contexts.n, why_not=why)


def parts(contexts: Contexts, equivalent: Signature, other: Signature) -> Iterator[Value]:
    """The difference that leaves the hand in place, and the one that moves it."""
    first, second = contexts.postures
    task, hand = contexts.first.task, contexts.hand
    assert hand is not None
    joints = movable(task, hand)
    pooled = np.concatenate([first, second])
    jacobian = task.robot.jacobian(spread.mean(pooled), hand)[:, joints]
    difference = spread.mean(first) - spread.mean(second)
    found = motor_equivalence(difference[joints], jacobian)
    why = "one run a context: no test" if contexts.single else ""
    for signature, value, basis in zip(
        (equivalent, other), found, subspaces(jacobian), strict=True
    ):
        wide = np.zeros((task.robot.dof, basis.shape[1]))
        wide[joints] = basis
        p = contexts.p(signature, wide)
        yield signature.at(contexts.place, value=value, p=p, n=contexts.n, why_not=why)


def lead(contexts: Contexts, signature: Signature) -> Iterator[Value]:
    """How long before the hit contexts differ."""
    place, n = contexts.place, contexts.n
    if contexts.single:
        why = "one run a context: no spread within contexts, no test"
        yield signature.at(place, n=n, why_not=why)
        return
    count = min(int(run.hits[contexts.goal - 1]) for group in contexts.runs for run in group) + 1
    if count == 1:
        yield signature.at(place, n=n, why_not="a run hits it at the start")
        return
    first, second = (last_ticks(group, contexts.goal, count) for group in contexts.runs)
    found = lead_time(first, second, rng_of(signature, place))
    place = replace(place, longest=count - 1)
    if found is None:
        yield signature.at(place, n=n, why_not="not distinguishable at the hit")
    else:
        yield signature.at(place, value=float(found), n=n)


@dataclass(frozen=True)
class Members:
    """What one method did on the tasks of a family."""

    family: Family
    of_task: Mapping[str, Trajectories]
    """Those that it did, in the order of the family."""

    @property
    def first(self) -> Trajectories:
        """Those of its first task."""
        return next(iter(self.of_task.values()))


def slopes(members: Members, slope: Signature, norm: Signature) -> Iterator[Value]:
    """Slopes at the goals before (anticipatory) and after (carry-over) the moving one."""
    moving = members.family.moving
    goals = len(members.first.task.goals)
    for goal in (moving - 1, moving + 1):
        if 1 <= goal <= goals:
            for hand in HANDS:
                place = Place(goal=goal, moving=moving, hand=hand)
                yield from _slopes_at(members, goal, hand, place, slope, norm)


def _slopes_at(
    members: Members, goal: int, hand: Hand, place: Place, slope: Signature, norm: Signature
) -> Iterator[Value]:
    positions = dict(zip(members.family.tasks, members.family.positions.tolist(), strict=True))
    runs = [
        (run, positions[name])
        for name, cell in members.of_task.items()
        for run in cell.with_hand(hand, goal)
    ]
    if not runs:
        return
    places = [place for _, place in runs]
    n = len(runs)
    if len(set(places)) < LEAST:
        why = f"runs with that hand in fewer than {LEAST} tasks of the family"
        yield from (signature.without(why, place, n) for signature in (slope, norm))
        return
    q = postures(tuple(run for run, _ in runs), goal)
    joints = members.first.task.robot.joint_names
    for joint, found in zip(joints, locus_slopes(q, places), strict=True):
        unit = "1" if joint.startswith("base") else slope.unit
        yield slope.at(replace(place, joint=joint), **found._asdict(), n=n, unit=unit)
    whole = slope_norm(q, places, rng_of(norm, place))
    yield norm.at(place, **whole._asdict(), n=n)


def rng_of(signature: Signature, place: Place) -> np.random.Generator:
    """A generator of its own for each row, the same in every folder."""
    return np.random.default_rng([SEED, zlib.crc32(f"{signature.name} {place}".encode())])
