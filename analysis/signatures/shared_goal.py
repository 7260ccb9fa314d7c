"""The plainest sight of coarticulation: one goal, hit in another posture before another goal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coartic import Hand, Task
from coartic.analysis.methods import CONDITIONS, main_methods
from coartic.analysis.signatures.between import TwoContexts, rng_of
from coartic.analysis.signatures.context import (
    context_dependence,
    context_pairs,
    distance,
    permutation_p,
)
from coartic.analysis.signatures.locus import families, variants
from coartic.analysis.signatures.register import REGISTER
from coartic.analysis.study import Study, cached
from coartic.robot import HANDS, Array


@dataclass(frozen=True)
class SharedGoal:
    """A method's runs that hit one goal before either of two others."""

    method: str
    """Label."""
    goal: int
    """Number of the goal that both tasks have, from 1; the next one differs."""
    tasks: tuple[Task, Task]
    postures: tuple[Array, Array]
    """Where each run hits it, ``(runs, dof)``."""
    hand: Hand
    apart: float
    """Distance of the mean postures, length unit and rad."""
    hands_apart: float
    """Distance of the hand in these two postures, length unit."""
    spreads: float
    """The distance of postures in pooled SDs of the runs; NaN where there is none."""
    p: float
    """Of the permutation test over runs; NaN where there is none."""


@cached
def shared_goal(study: Study) -> SharedGoal | None:
    """The first goal that two tasks share before they differ, by the paper's learner if it ran.

    None where no method has solved runs on two such tasks. Tasks that differ in one moved goal
    only are left out: their slopes say how postures follow it.
    """
    moved = variants(families(study.tasks))
    pairs = [
        (first, second, shared)
        for first, second, shared in context_pairs(study.tasks)
        if not any({first, second} <= names for names in moved)
    ]
    labels = [label for _, label in study.cells]
    for label in dict.fromkeys([*CONDITIONS, *main_methods(labels), *labels]):
        for first, second, _ in pairs:
            keys = (first, label), (second, label)
            if all(key in study.cells and len(study.cells[key].good) for key in keys):
                for hand in HANDS:
                    first_runs, second_runs = (study.trajectories(*key) for key in keys)
                    own = TwoContexts(first_runs, second_runs, 1, hand)
                    if all(own.runs):
                        return _described(study, label, own)
    return None


def _described(study: Study, label: str, own: TwoContexts) -> SharedGoal:
    tasks = own.first.task, own.second.task
    robot, place = tasks[0].robot, own.place
    ends = [robot.forward_kinematics(q.mean(axis=0), own.hand) for q in own.postures]
    rng = rng_of(REGISTER["context dependence"], place)
    return SharedGoal(
        *(label, own.goal, tasks, own.postures, own.hand),
        apart=distance(*own.postures),
        hands_apart=float(np.linalg.norm(ends[0] - ends[1])),
        spreads=context_dependence(*own.postures),
        p=float(permutation_p(*own.postures, rng)),
    )
