"""Goals that give everything printed about the corrective process alone.

First a round grid, then the continuum: points of the grid that come near the printed rewards
are moved, by the shortest way, to where these come out as printed; what is found is spread by
random steps that are corrected in the same way. Learned rewards play no part.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from coartic import CoarticError, MotionModel, Task, load_task
from coartic.motion.sequences import CorrectiveTrials
from coartic.robot import Array
from coartic.tasks.readings import ChosenReading, load_readings, model_under
from coartic.text import did_you_mean
from reconstruction.layouts import (
    Constraint,
    Flags,
    Layout,
    constraints_of,
    layouts,
    try_sequences,
)

GRID_BLOCK = 100_000  # points of the grid that are tried at once
DIFFERENCE = 0.1
"""Step of the finite differences, length unit: rewards are whole ticks, some 100 a length unit."""
SOLVER_STEPS = 12
LONGEST_STEP = 0.5  # of the solver, length unit
QUICK_STEP = 0.2  # of the grid of a quick search, length unit


@dataclass
class Search:
    """A search through a layout, and what it has tried."""

    task: Task
    layout: Layout
    constraints: tuple[Constraint, ...]
    readings: tuple[ChosenReading, ...] = ()
    """Readings of the model and of the exploration conditions; the task is as they have it."""
    jobs: int = 2
    near: float = 12.0
    """Ticks by which the rewards of a point of the grid may miss the printed ones."""
    tried: Counter[str] = field(default_factory=Counter)
    """How many points each stage tried, and how many passed each constraint, by words."""

    @property
    def model(self) -> MotionModel:
        """The motion model under the readings."""
        return model_under(self.readings)

    @property
    def rewards(self) -> dict[str, float]:
        """The rewards that have to come out, by hand sequence in alphabetical order."""
        rewards = {c.sequences[0]: c.reward for c in self.constraints if c.reward is not None}
        return dict(sorted(rewards.items()))

    def task_with(self, goals: Array) -> Task:
        """The task with other goals, ``(G, 2)``."""
        return self.task.model_copy(update={"goals": tuple(map(tuple, goals.tolist()))})

    def attempt(self, points: Array, sequences: Sequence[str]) -> CorrectiveTrials:
        """Corrective trials at points ``(N, P)``."""
        goals = self.layout.places(points)
        return try_sequences(self.task, sequences, goals, model=self.model, jobs=self.jobs)

    def grid(self, report: Callable[[str], None] = lambda text: None) -> tuple[Array, Array]:
        """The round points that meet every constraint, and those that come near."""
        exact, near, tenths = [], [], 0
        for number, points in enumerate(self.layout.blocks(GRID_BLOCK), 1):
            if (tenth := min(10, 10 * number * GRID_BLOCK // self.layout.size)) > tenths:
                report(f"{10 * tenth} % of the grid")
                tenths = tenth
            self.tried["round sets of goals"] += len(points)
            for hands, reward in self.rewards.items():
                missing = self.attempt(points, [hands]).rewards[:, 0] - reward
                points = points[np.abs(missing) <= self.near]
            near.append(points)
            exact.append(self.admitted(points, "round"))
        return np.concatenate(exact), np.concatenate(near)

    def admitted(self, points: Array, stage: str) -> Array:
        """The points that meet every constraint, counted by the first that they miss."""
        for constraint in sorted(self.constraints, key=lambda each: len(each.sequences)):
            points = points[constraint.holds(self.attempt(points, constraint.sequences))]
            self.tried[f"{stage}, and {constraint.says}"] += len(points)
        return points

    def meets_all(self, goals: Array) -> Flags:
        """Whether sets of goals (N, G, 2) meet every constraint, ``(N,)``."""
        perform = partial(try_sequences, self.task, goals=goals, model=self.model, jobs=self.jobs)
        holds = [constraint.holds(perform(constraint.sequences)) for constraint in self.constraints]
        return np.asarray(np.all(holds, axis=0))

    def solve(self, points: Array) -> Array:
        """Move points to where the printed rewards come out; those for which that succeeds.

        Steps are the shortest that would do if rewards were linear (Gauss-Newton with the
        pseudoinverse); gradients are finite differences.
        """
        printed = np.array(list(self.rewards.values()))
        width = points.shape[1]
        solved = [points[:0]]
        for _ in range(SOLVER_STEPS):
            if not len(points):
                break
            shifts = np.vstack([np.zeros(width), DIFFERENCE * np.eye(width)])
            around = (points[:, None] + shifts).reshape(-1, width)
            rewards = self.attempt(around, list(self.rewards)).rewards
            rewards = rewards.reshape(len(points), width + 1, len(printed))
            missing = printed - rewards[:, 0]
            exact = (missing == 0.0).all(axis=1)
            solved.append(points[exact])
            gradient = (rewards[:, 1:] - rewards[:, :1]) / DIFFERENCE
            going = ~exact & np.isfinite(gradient).all(axis=(1, 2))
            step = np.einsum(
                "nwh,nh->nw", np.linalg.pinv(gradient[going].transpose(0, 2, 1)), missing[going]
            )
            length = np.linalg.norm(step, axis=1, keepdims=True)
            step *= np.minimum(1.0, LONGEST_STEP / np.maximum(length, 1e-12))
            points = points[going] + step
            points = points[self.layout.allowed(points)]
        return np.concatenate(solved)

    def spread(self, members: Array, count: int, rng: np.random.Generator, size: float) -> Array:
        """Admissible points near members drawn at random, ``size`` away in SD, length unit."""
        chosen = members[rng.integers(len(members), size=count)]
        points = chosen + size * rng.standard_normal(chosen.shape)
        points = points[self.layout.allowed(points)]
        self.tried["random steps"] += len(points)
        return self.admitted(self.solve(points), "after steps")


def search_for(
    task: str, *, readings: Sequence[str] = (), jobs: int = 2, quick: bool = False
) -> Search:
    """A search for the goals of a task under readings, as ``ties=right``.

    A ``quick`` one has a grid of three values a parameter, around the goals that stand. Raises
    CoarticError for a task whose goals are printed, and for readings that are none.
    """
    searched = layouts()
    if task not in searched:
        raise CoarticError(
            f"the paper prints the goals of task {task!r}; tasks with goals that are not "
            f"printed: {', '.join(searched)}{did_you_mean(task, searched)}"
        )
    chosen = load_readings(readings)
    plain, layout = load_task(task), searched[task]
    search = Search(plain, layout, constraints_of(plain), chosen, jobs)
    if quick:
        standing = layout.points(plain.goal_array[None])[0]
        grid = {
            name: (value - QUICK_STEP, value + QUICK_STEP, QUICK_STEP)
            for name, value in zip(layout.names, standing.tolist(), strict=True)
        }
        search.layout, search.near = replace(layout, grid=grid), 45.0
    return search
