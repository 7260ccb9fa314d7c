"""The benchmark for optimisers: the cost of a trial as a function that is to be minimised.

:func:`objective` makes the function of a task, for scipy and the like. An :class:`Optimiser` is a
method of the benchmark that consists of such a function and of what minimises it.
"""

from __future__ import annotations

import itertools
from abc import abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from coartic.inputs import WIDTHS, check_limits, real_array
from coartic.learner.learning import TRIALS
from coartic.method import (
    BudgetError,
    Information,
    Method,
    MethodError,
    Parameters,
    Result,
    Session,
)
from coartic.model import PAPER, MotionModel
from coartic.motion.initial import too_many_sequences
from coartic.motion.solution import Movement
from coartic.motion.trials import movements_of
from coartic.robot import HANDS, Array
from coartic.tasks.task import Task, as_task, hands_of, letters_of
from coartic.text import counted

TOLD = frozenset({Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL})
"""What a method that minimises an :class:`Objective` is told."""
FAILED = 1_000_000
"""Cost of a trial that fails, ticks. One that takes so long has failed, too."""
HALF_WIDTH = 1.0


def explored_joints(
    session: Session, hands: str, other_arm: Literal["free", "still"] = "free"
) -> NDArray[np.bool_]:
    """Joints that are worth exploring with a hand sequence, shape ``(G, dof)``.

    Never a locked base coordinate, nor an arm that hits neither this goal nor a later one: moving
    it can only cost. With ``"still"``, only the arm that hits the goal.
    """
    names = hands_of(hands)
    mask = np.zeros((len(names), session.dof), dtype=np.bool_)
    mask[:, :2] = [coordinate not in session.locked_base for coordinate in "xy"]
    for goal, chosen in enumerate(names):
        useful = names[goal:] if other_arm == "free" else (chosen,)
        for hand in HANDS:
            mask[goal, session.joints(hand)] = hand in useful
    return mask


def sequences_of(session: Session) -> list[str]:
    """All hand sequences, the task's own first: a small budget may not reach the others.

    The task's own alone, where there are too many to try one by one.
    """
    if too_many_sequences(session.task_name, session.goals_count, len(session.hands)):
        return [session.find_initial_hands()]
    letters = letters_of(sorted(session.hands))
    sequences = map("".join, itertools.product(letters, repeat=session.goals_count))
    return sorted(sequences, key=lambda hands: hands != session.initial_hands)


class Objective:
    """The cost of a trial, ticks and penalty, a function of its target configurations.

    A point holds the targets of all joints that are worth moving (:func:`explored_joints`), goal
    by goal, length unit (base) and rad (joints). Its cost is minus the reward of the trial, or
    ``FAILED`` where the trial fails. Goals that a movement misses are corrected, and paid for.

    Where all entries of a goal are NaN, no movement is made to a target: the corrective process
    acts alone at this goal, which costs nothing if the hand is inside already. A movement to a
    target is always made and takes a tick at least.

    The first trials are made at once: the corrective process alone, with ``hands`` or with every
    hand sequence, of which the best is kept. No point has other hands than these, so that the
    lowest cost is that of the best solution with these hands, which other hands may better.
    Raises MethodError where the corrective process completes no sequence.
    """

    def __init__(
        self,
        session: Session,
        hands: str | None = None,
        *,
        half_width: float = HALF_WIDTH,
        trials: int | None = None,
    ) -> None:
        check_limits("half_width", half_width, *WIDTHS)
        self._session = session
        self._end = None if trials is None else session.meter.trials + trials
        sequences = sequences_of(session) if hands is None else [hands]
        sequences = sequences[: self._trials_left(len(sequences))]
        shape = (len(sequences), session.goals_count, session.dof)
        alone = session.trials(sequences, np.full(shape, np.nan))
        best = int(alone.rewards.argmax())
        if not alone.completed[best]:
            raise MethodError("infeasible", "the corrective process completes no hand sequence")
        self.hands = sequences[best]
        """The hand sequence."""
        self.joints = explored_joints(session, self.hands)
        """Joints that have a target in a point, shape ``(G, dof)``."""
        self.postures: Array = alone.reached[best].copy()
        """Configurations in which the corrective process alone hits the goals, ``(G, dof)``."""
        self.dim = int(self.joints.sum())
        """Number of parameters."""
        self.bounds: Array = self.x0[:, None] + np.array([-half_width, half_width])
        """A box to search in, shape ``(dim, 2)``; points outside of it are evaluated as well."""
        self.evaluations = 0
        """Points evaluated; the first trials are not among them."""
        self.best_cost = float(-alone.rewards[best])
        """Cost of the best trial so far; at the start that of the corrective process alone."""
        self._best_x = np.full(self.dim, np.nan)
        self._best_targets = alone.targets[best].copy()

    def __repr__(self) -> str:
        return (
            f"Objective({self._session.task_name}, hands {self.hands}, {self.dim} parameters, "
            f"{counted(self.evaluations, 'evaluation')}, best cost {self.best_cost:g})"
        )

    @property
    def x0(self) -> Array:
        """A point to begin with, shape ``(dim,)``: the postures in which the corrective process
        alone hits the goals. Moving straight to them can cost more or less than it does."""
        return self.postures[self.joints]

    @property
    def best_x(self) -> Array:
        """The point of the best trial so far, shape ``(dim,)``, whose cost is ``best_cost``; all
        NaN, the corrective process alone, until a point is better."""
        return self._best_x.copy()

    @property
    def solution(self) -> tuple[Movement, ...]:
        """The movements of the best trial, for :func:`coartic.execute`."""
        return movements_of(self.hands, self._best_targets)

    def __call__(self, x: ArrayLike) -> Any:
        """The cost of a point ``(dim,)``, or costs ``(N,)`` of points ``(dim, N)`` as scipy has
        them; see :meth:`many`, which takes rows, for as many points as they have entries."""
        points = real_array("x", x)
        if points.ndim not in (1, 2) or len(points) != self.dim:
            raise ValueError(
                f"x has shape {points.shape}; needed is ({self.dim},) or ({self.dim}, N)"
            )
        return float(self.many(points[None])[0]) if points.ndim == 1 else self.many(points.T)

    def many(self, points: ArrayLike) -> Array:
        """Costs ``(N,)`` of points ``(N, dim)``, which are evaluated side by side.

        Entries are finite, or NaN for all joints of a goal (the corrective process alone). Raises
        BudgetError where trials are not left for all of them, after those that are left are made.
        Raises ValueError for another shape, for infinite entries and for goals that are NaN in
        part.
        """
        array = real_array("points", points)
        if array.ndim != 2 or array.shape[1] != self.dim:
            raise ValueError(f"points of shape {array.shape}: needed is (N, {self.dim})")
        targets = self._targets(array)
        left = self._trials_left(len(array))
        targets = targets[:left]
        trials = self._session.trials(self.hands, targets)
        costs = np.minimum(-trials.rewards, FAILED)
        self.evaluations += len(costs)
        if len(costs) and costs.min() < self.best_cost:
            best = int(costs.argmin())
            self.best_cost, self._best_x = float(costs[best]), array[best].copy()
            self._best_targets = trials.targets[best].copy()
        if len(costs) < len(array):
            raise BudgetError("all trials of the budget are made")
        return costs

    def _targets(self, points: Array) -> Array:
        """Targets ``(N, G, dof)`` of points; NaN for joints that have none."""
        targets = np.full((len(points), *self.joints.shape), np.nan)
        targets[:, self.joints] = points
        missing = (np.isnan(targets) & self.joints).sum(axis=2)
        in_part = (missing > 0) & (missing < self.joints.sum(axis=1))
        if in_part.any():
            point, goal = np.argwhere(in_part)[0]
            raise ValueError(
                f"point {point}: of goal {goal + 1} some entries are NaN; needed are all of them "
                "(the corrective process alone) or none"
            )
        if np.isinf(targets).any():
            raise ValueError("points have infinite entries; needed are finite ones")
        return targets

    def _trials_left(self, wanted: int) -> int:
        """How many of so many trials are left."""
        left = wanted if self._end is None else self._end - self._session.meter.trials
        if left <= 0 < wanted:
            raise BudgetError("all trials of the budget are made")
        return min(wanted, left)


def objective(
    task: Task | str | Path,
    hands: str | None = None,
    *,
    half_width: float = HALF_WIDTH,
    model: MotionModel = PAPER,
) -> Objective:
    """The cost of a trial of a task, as a function that scipy and others can minimise.

    ``task`` is a task, the name of one or a file; ``hands`` a hand sequence (``"RRLR"``), by
    default the one with which the corrective process alone does best; ``half_width`` that of the
    bounds around ``x0``, length unit (base) and rad (joints). The default hands need not be those
    of the optimum: in ``two-armed-2`` they are others, and no point is known to come within 14 %
    of it.

    Raises TaskError for a task that cannot be used, ValueError for hands that do not fit and for
    a half width that is not from 1e-9 to 100, TypeError for a model that is none, MethodError where
    the corrective process completes no sequence, or where there are too many to try.
    """
    chosen = as_task(task)
    goals = len(chosen.goals)
    reason = too_many_sequences(chosen.name, goals, len(chosen.hands))
    if hands is None and reason:
        raise MethodError("infeasible", f"{reason}; say which hands")
    session = Session(chosen, 0, TOLD, model=model)
    return Objective(session, hands, half_width=half_width)


class OptimiserParameters(Parameters):
    """Parameters of every :class:`Optimiser`."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    hands: str | None = None
    """Hand sequence; by default the one with which the corrective process alone does best, or the
    task's own where there are too many to try."""
    half_width: Annotated[float, Field(ge=WIDTHS[0], le=WIDTHS[1])] = HALF_WIDTH
    """Of the bounds, length unit (base) and rad (joints)."""


class Optimiser(Method):
    """A method of the benchmark that minimises the cost of a trial.

    A subclass has a name, a title, a citation and :meth:`optimise`.
    """

    told = TOLD
    Parameters = OptimiserParameters

    def solve(self, session: Session) -> Result:
        """Optimise until the trials are used up; the solution is the best trial's."""
        parameters: OptimiserParameters = self.parameters
        try:
            cost = Objective(
                session,
                parameters.hands,
                half_width=parameters.half_width,
                trials=parameters.trials,
            )
        except BudgetError:
            raise MethodError("infeasible", "the trial budget leaves no trial to make") from None
        with session.solving(), suppress(BudgetError):
            self.optimise(cost, session.rng)
        return Result(cost.solution, {"evaluations": cost.evaluations})

    @abstractmethod
    def optimise(self, objective: Objective, rng: np.random.Generator) -> None:
        """Minimise; the objective keeps the best point, and ends this when no trial is left."""
