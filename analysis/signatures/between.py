"""Measures between tasks: the same goal in two contexts, or next to a goal that moves."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, product

import numpy as np

from coartic import Hand, Trajectory
from coartic.analysis.signatures.context import (
    context_dependence,
    distance,
    lead_time,
    permutation_p,
)
from coartic.analysis.signatures.locus import LEAST, ContextFamily, locus_slopes, slope_norm
from coartic.analysis.signatures.manifold import jacobian_of, motor_equivalence, subspaces
from coartic.analysis.signatures.rows import Place, Rows, Signature, SignatureRow, without
from coartic.analysis.statistics.estimates import SEED
from coartic.analysis.trajectories import Trajectories, last_ticks, postures
from coartic.robot import HANDS, Array

Runs = tuple[Trajectory, ...]
NO_SPREAD = "one run a context: no spread within contexts, no test"


@dataclass(frozen=True)
class TwoContexts:
    """Runs of one method that hit the same goal with the same hand before other successors."""

    first: Trajectories
    second: Trajectories
    goal: int
    hand: Hand

    @property
    def place(self) -> Place:
        """Of every value."""
        return Place(goal=self.goal, hand=self.hand, against=self.second.task.name)

    @cached_property
    def runs(self) -> tuple[Runs, Runs]:
        """Of either context."""
        hand, goal = self.hand, self.goal
        return self.first.with_hand(hand, goal), self.second.with_hand(hand, goal)

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

    def row(
        self, signature: Signature, value: float, why_not: str, basis: Array | None = None
    ) -> SignatureRow:
        """A value and its test (within a subspace); without one for a single run."""
        p = permutation_p(*self.postures, rng_of(signature, self.place), basis=basis)
        return signature.at(self.place, value=value, p=float(p), n=self.n, why_not=why_not)


def context_distance(contexts: TwoContexts, signature: Signature) -> Rows:
    """Distance of mean postures."""
    yield signature.at(contexts.place, value=distance(*contexts.postures), n=contexts.n)


def dependence(contexts: TwoContexts, signature: Signature) -> Rows:
    """The distance in pooled standard deviations, with its test."""
    value = context_dependence(*contexts.postures)
    why = "runs do not differ within contexts" if math.isnan(value) else ""
    yield contexts.row(signature, value, NO_SPREAD if contexts.single else why)


def parts(contexts: TwoContexts, equivalent: Signature, other: Signature) -> Rows:
    """The difference that leaves the hand in place, and the one that moves it."""
    first, second = contexts.postures
    task = contexts.first.task
    joints, jacobian = jacobian_of(task, contexts.hand, np.concatenate([first, second]))
    difference = first.mean(axis=0) - second.mean(axis=0)
    found = motor_equivalence(difference[joints], jacobian)
    why = "one run a context: no test" if contexts.single else ""
    signatures = equivalent, other
    for signature, value, basis in zip(signatures, found, subspaces(jacobian), strict=True):
        wide = np.zeros((task.robot.dof, basis.shape[1]))
        wide[joints] = basis
        yield contexts.row(signature, value, why, wide)


def lead(contexts: TwoContexts, signature: Signature) -> Rows:
    """How long before the hit contexts differ."""
    place, n = contexts.place, contexts.n
    if contexts.single:
        yield signature.at(place, n=n, why_not=NO_SPREAD)
        return
    count = min(int(run.hits[contexts.goal - 1]) for group in contexts.runs for run in group) + 1
    if count == 1:
        yield signature.at(place, n=n, why_not="a run hits it at the start")
        return
    first, second = (last_ticks(group, contexts.goal, count) for group in contexts.runs)
    found = lead_time(first, second, rng_of(signature, place))
    place = replace(place, longest=count - 1)
    why = "not distinguishable at the hit" if found is None else ""
    yield signature.at(place, value=math.nan if found is None else float(found), n=n, why_not=why)


@dataclass(frozen=True)
class Members:
    """What one method did on the tasks of a family."""

    family: ContextFamily
    of_task: Mapping[str, Trajectories]
    """Those that it did, in the order of the family."""


def slopes(members: Members, slope: Signature, norm: Signature) -> Rows:
    """Slopes at the goals before (anticipatory) and after (carry-over) the moving one."""
    family, task = members.family, next(iter(members.of_task.values())).task
    position = dict(zip(family.tasks, family.positions.tolist(), strict=True))
    beside = {family.moving - 1, family.moving + 1} & set(range(1, len(task.goals) + 1))
    for goal, hand in product(sorted(beside), HANDS):
        runs = {name: cell.with_hand(hand, goal) for name, cell in members.of_task.items()}
        places = [position[name] for name, own in runs.items() for _ in own]
        n, place = len(places), Place(goal=goal, moving=family.moving, hand=hand)
        if not n:
            continue
        if len(set(places)) < LEAST:
            why = f"runs with that hand in fewer than {LEAST} tasks of the family"
            yield from without((slope, norm), why, place, n)
            continue
        q = postures(tuple(chain.from_iterable(runs.values())), goal)
        for joint, found in zip(task.robot.joint_names, locus_slopes(q, places), strict=True):
            unit = "1" if joint.startswith("base") else slope.unit
            yield slope.estimated(replace(place, joint=joint), found, n, unit=unit)
        yield norm.estimated(place, slope_norm(q, places, rng_of(norm, place)), n)


def rng_of(signature: Signature, place: Place) -> np.random.Generator:
    """A generator of its own for each row, the same in every folder."""
    return np.random.default_rng([SEED, zlib.crc32(f"{signature.name} {place}".encode())])
