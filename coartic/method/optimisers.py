"""The benchmark for optimisers: the cost of a trial as a function that is to be minimised.

:func:`objective` makes the function of a task, for scipy and the like. An :class:`Optimiser` is a
method of the benchmark that consists of such a function and of what minimises it.
"""

from __future__ import annotations

import math
import os
from abc import abstractmethod
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from coartic.errors import CoarticError
from coartic.internal.limits import MOST_TRIALS, WIDTHS, brief_value, check_limits, real_array
from coartic.internal.text import counted
from coartic.learner.learning import TRIALS
from coartic.method import (
    MOST_COUNT,
    BudgetError,
    Information,
    Method,
    MethodError,
    Parameters,
    Result,
    Session,
    UndeclaredError,
)
from coartic.model import PAPER, MotionModel
from coartic.motion.movement import LARGEST_ENTRY
from coartic.motion.solution import (
    Movement,
    movements_of,
)
from coartic.motion.trial import (
    Accounts,
    HandSequences,
    compiled_task,
    make_trials,
    sequences_with,
    too_many_sequences,
)
from coartic.robot import HANDS, Array, Configs, Hands
from coartic.tasks.catalogue import TaskLike, as_task
from coartic.tasks.optima import KnownOptimum, best_shipped
from coartic.tasks.task import Task, letters_of

if TYPE_CHECKING:  # workers do without pandas
    import pandas as pd

OPTIMISER_INFORMATION = frozenset({Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL})
"""Information that a method which minimises an :class:`Objective` uses."""
FAILED = 1_000_000
"""Cost of a trial that fails, ticks, and of a trial that takes longer."""
HALF_WIDTH = 1.0
CHUNK = 8192
"""Points that are evaluated at a time, so that many take no more memory."""
NO_COPIES = (
    "an objective is neither copied nor sent to another process, where its trials would not be "
    "counted: in place of workers use vectorized=True or objective.many(points)"
)


def explored_joints(session: Session) -> NDArray[np.bool_]:
    """Return True for the entries of a configuration that optimisers explore on the session's task,
    bool, shape ``(dof,)``.

    These are the coordinates of the base that are not locked and the joints of the arms of all
    hands of the task.
    """
    mask = np.zeros(session.dof, dtype=np.bool_)
    mask[:2] = [coordinate not in session.locked_base for coordinate in "xy"]
    for hand in session.hands:
        mask[session.joints(hand)] = True
    return mask


def sequences_of(session: Session) -> list[str]:
    """List all hand sequences of the session's task, such as ``"RRLR"``, in alphabetical order; if
    the task names a sequence, that sequence comes first.

    If there are more than 4096 sequences, list the initial hand sequence alone
    (:meth:`Session.find_initial_hands`, whose errors are raised).
    """
    if too_many_sequences(session.task_name, session.goals_count, len(session.hands)):
        return [session.find_initial_hands()]
    sequences = sequences_with(session.hands, session.goals_count, session.task_name)
    return sorted(sequences, key=lambda hands: hands != session.initial_hands)


def _entries_of(name: str, points: ArrayLike) -> Array:
    """Return points as an array (:func:`real_array`), also of objects with ``to_numpy``, whose
    labels do not count. Raises ValueError, which calls them ``name``, for other values."""
    return real_array(name, points.to_numpy() if hasattr(points, "to_numpy") else points)


class Objective:
    """Cost of a trial, its ticks, as a function of its target configurations.

    A point holds, goal by goal, the targets of the entries of a configuration that are explored
    (:func:`explored_joints`), length unit (base) and rad (joints). Its cost is minus the reward of
    the trial, or ``FAILED`` where the trial fails or takes longer. The corrective process acts at
    goals that a movement misses, and is paid for. A point with an entry beyond 100,000 is a trial
    that fails.

    Where all entries of a goal are NaN, no movement is made to a target: the corrective process
    acts alone at this goal, which costs nothing if the hand is inside already. A movement to a
    target is made even then, and takes a tick at least.

    The first trials are made at once: the corrective process alone, with ``hands`` or with those of
    :func:`sequences_of` that the budget allows; the best sequence is kept. A point has its hands,
    unless others are given with the point.

    Threads can share an objective, which answers their calls one after the other. Copies, and
    trials in a forked process, raise CoarticError: they would not count for the budget.

    Raises MethodError where the corrective process completes none of these sequences.
    """

    __slots__ = (
        *("joints", "configurations", "dim", "bounds", "_best_cost", "_best_hands"),
        *("_best_targets", "_best_x", "_better", "_codes", "_end", "_entries", "_evaluations"),
        *("_hands", "_process", "_session", "_targets", "_task"),
    )  # no others are set by mistake, such as a budget

    def __init__(
        self,
        session: Session,
        hands: str | None = None,
        *,
        half_width: float = HALF_WIDTH,
        trials: int | None = None,
        task: Task | None = None,
    ) -> None:
        check_limits("half_width", half_width, *WIDTHS)
        self._session, self._task, self._process = session, task, os.getpid()
        limits = [limit for limit in (trials, session.trials_left) if limit is not None]
        self._end = session.trials_made + min(limits, default=MOST_COUNT)
        sequences = sequences_of(session) if hands is None else [hands]
        sequences = sequences[: self._trials_left(len(sequences))]
        shape = (len(sequences), session.goals_count, session.dof)
        alone = session.trials(sequences, np.full(shape, np.nan))
        best = int(alone.rewards.argmax())
        if not alone.completed[best]:
            raise MethodError("infeasible", "the corrective process completes no hand sequence")
        self._hands = sequences[best]
        self.joints = np.tile(explored_joints(session), (session.goals_count, 1))
        """True for entries that have a target in a point, shape ``(G, dof)``."""
        self.configurations: Array = alone.reached[best].copy()
        """Configurations in which the corrective process alone hits the goals, ``(G, dof)``."""
        self._codes = session.hand_codes(self.hands, 1)
        self._targets = np.full((1, *self.joints.shape), np.nan)
        self._entries = np.flatnonzero(self.joints)
        self.dim = len(self._entries)
        """Number of entries of a point."""
        self.bounds: Array = self.x0[:, None] + np.array([-half_width, half_width])
        """A box to search in, shape ``(dim, 2)``; points outside of it are evaluated as well."""
        self._evaluations = 0
        self._best_cost = float(min(-alone.rewards[best], FAILED))
        self._best_hands = self.hands
        self._best_x: Array = np.full(self.dim, np.nan)
        self._best_targets = alone.targets[best].copy()
        self._better = [(0, self._best_cost)]

    def __reduce__(self) -> Any:
        raise CoarticError(NO_COPIES)

    @property
    def hands(self) -> str:
        """Hand sequence of a point for which none is given, such as ``"RRLR"``."""
        return self._hands

    # What is known of the task; nothing of this is for a method.

    @property
    def task(self) -> Task:
        """The task. Raises UndeclaredError if the objective was made without ``task``, as it is in
        a method: a method cannot see its task."""
        if self._task is None:
            raise UndeclaredError("a method cannot see its task, nor what is known of the task")
        return self._task

    @property
    def _known(self) -> KnownOptimum | None:
        task = self.task
        return best_shipped(task) if self._session.model == PAPER else None

    @property
    def best_known(self) -> int | None:
        """Lowest cost known of the task, ticks, of any solution: with any hand sequence, also with
        goals that are hit without a movement. Raises UndeclaredError in a method, as :attr:`task`
        does.

        None where no cost is shipped, as for most tasks of your own, for instances of families
        except the first 40 test instances of shipped ones, and for another model than the paper's.
        """
        known = self._known
        return None if known is None else -known.reward

    @property
    def proven(self) -> bool:
        """True if it is proven that no solution costs less than ``best_known``; False without such
        a proof. Raises UndeclaredError in a method, as :attr:`task` does."""
        known = self._known
        return known is not None and known.proven

    @property
    def hand_sequences(self) -> list[str]:
        """All hand sequences of the task, such as ``"LLLR"``, a list in alphabetical order. Raises
        NotApplicableError if there are more than 4096."""
        session = self._session
        return sequences_with(session.hands, session.goals_count, session.task_name)

    # What was found so far.

    @property
    def evaluations(self) -> int:
        """Number of points evaluated. The first trials, by the corrective process alone with each
        hand sequence tried (one if ``hands`` was given), are not among them."""
        return self._evaluations

    @property
    def best_cost(self) -> float:
        """Cost of the best trial so far, ticks; at first the cost of the corrective process
        alone."""
        return self._best_cost

    @property
    def best_hands(self) -> str:
        """Hand sequence of the best trial so far."""
        return self._best_hands

    @property
    def lower(self) -> Array:
        """Lower ends of ``bounds``, a box to search in, ``(dim,)``, length unit and rad, a copy."""
        return self.bounds[:, 0].copy()

    @property
    def upper(self) -> Array:
        """Upper ends of ``bounds``, a box to search in, ``(dim,)``, length unit and rad, a copy."""
        return self.bounds[:, 1].copy()

    @property
    def history(self) -> pd.DataFrame:
        """Table of the best costs so far: a row for the corrective process alone, and a row each
        time the best cost fell. Columns: ``evaluations``, the number made until then, 0 in the
        first row, and ``cost``, ticks."""
        import pandas as pd  # which a worker does without

        return pd.DataFrame(self._better, columns=["evaluations", "cost"])

    def evaluations_to(self, targets: ArrayLike) -> Any:
        """Return the number of evaluations after which the best cost was at or below each of
        ``targets``, ticks: a float for a number, else an array of the same shape; infinite
        for a target not reached so far. Raises ValueError for a target that is not from 0 to
        ``FAILED``."""
        wanted = real_array("targets", targets)
        if not ((wanted >= 0) & (wanted <= FAILED)).all():
            raise ValueError(
                f"targets are {brief_value(wanted.tolist())}; each must be a cost, the ticks of a "
                f"trial, from 0 to {FAILED:,}"
            )
        evaluations, costs = np.array([*self._better, (np.inf, -np.inf)]).T
        found = evaluations[np.searchsorted(-costs, -wanted)]
        return float(found) if wanted.ndim == 0 else found

    @property
    def x0(self) -> Array:
        """A point to begin with, shape ``(dim,)``, length unit and rad, a copy: the postures in
        which the corrective process alone hits the goals."""
        return self.configurations[self.joints].copy()

    @property
    def best_x(self) -> Array:
        """The point of the best trial so far, shape ``(dim,)``, a copy: with the hands
        ``best_hands`` it costs ``best_cost``. All entries are NaN until a point is better than the
        corrective process alone."""
        return self._best_x.copy()

    @property
    def solution(self) -> tuple[Movement, ...]:
        """Movements that make the best trial so far in :func:`coartic.execute`, which corrects
        missed goals; at first corrective movements without targets."""
        return movements_of(self.best_hands, self._best_targets)

    def movements(self, x: ArrayLike, hands: str | None = None) -> tuple[Movement, ...]:
        """Return the movements of the trial of a point, for :func:`coartic.execute`, which then
        takes as many ticks as the point costs, if less than ``FAILED``. No evaluation is counted.

        ``x`` is the point, shape ``(dim,)``; ``hands`` is the hand sequence of the trial, by
        default :attr:`hands` of this objective. A movement has a target of all joints (a joint that
        has no entry in the point keeps its value, or, after a goal missed for good, has its value
        at the start), or none where the entries of its goal are NaN. Raises UndeclaredError in a
        method, which can use :attr:`solution`, and ValueError if point or hands do not fit.
        """
        task, point = self.task, _entries_of("x", x)
        if point.shape != (self.dim,):
            raise ValueError(f"x has shape {point.shape}; needed is ({self.dim},)")
        self._check(point[None])
        chosen = self.hands if hands is None else hands
        codes, targets = self._session.hand_codes(chosen, 1), self._targets_of(point[None])
        made = make_trials(compiled_task(task, self._session.model), codes, targets[:, :, None])
        given = ~np.isnan(targets[0]).all(axis=1, keepdims=True)
        targets = self._targets_in(made, 0)
        after = np.isnan(targets) & given  # goals after one where the trial failed
        return movements_of(chosen, np.where(after, task.q0, targets))

    # Evaluation.

    def __call__(self, x: ArrayLike, hands: str | None = None) -> Any:
        """Return the cost, ticks, of a point ``(dim,)``, or costs ``(N,)`` of points ``(dim, N)``,
        columns as scipy has them. Raises ValueError for shape ``(dim, dim)``, in which points may
        be rows: :meth:`many` takes rows. ``hands`` and other errors are as in :meth:`many`."""
        point = _entries_of("x", x)
        if point.ndim == 2 and len(point) == self.dim:
            if point.shape[1] == self.dim:
                raise ValueError(
                    f"x has shape {point.shape}, in which points can be rows or columns: use "
                    "many(x) for rows, many(x.T) for columns"
                )
            return self.many(point.T, hands)
        if point.shape != (self.dim,):
            raise ValueError(
                f"x has shape {point.shape}; needed is ({self.dim},) or ({self.dim}, N)"
            )
        # NaN, or far: to be looked at.
        if hands is not None or not math.hypot(*point.tolist()) < LARGEST_ENTRY:
            return float(self.many(point[None], hands)[0])
        with self._session.lock:
            self._trials_left(1)
            self._targets.put(self._entries, point)
            made = self._session._make_trials(self._codes, self._targets)
            cost = float(min(-made.rewards.item(), FAILED))
            self._evaluations += 1
            if cost < self._best_cost:
                self._keep(cost, self._evaluations, point, self._codes[0], made, 0)
        return cost

    def many(self, points: ArrayLike, hands: HandSequences | None = None) -> Array:
        """Make a trial for each of ``points``, shape ``(N, dim)``, side by side; return the costs,
        ticks, shape ``(N,)``.

        Entries are finite, or all NaN for a goal (the corrective process alone); an entry
        beyond 100,000 makes the trial fail. Joints that have no entry in a point keep still.
        ``hands`` is one hand sequence for all points (``"RRLR"``), or a sequence for each point; by
        default :attr:`hands` of this objective.

        Raises BudgetError if fewer trials are left than there are points: the trials that are left
        are made, for the first points. Raises ValueError for another shape, for infinite entries,
        for a goal that is NaN in part, and for hands that do not fit the task.
        """
        array = _entries_of("points", points)
        if array.ndim != 2 or array.shape[1] != self.dim:
            raise ValueError(f"points of shape {array.shape}: needed is (N, {self.dim})")
        self._check(array)
        codes = self._session.hand_codes(self.hands if hands is None else hands, len(array))
        costs = np.empty(len(array))
        with self._session.lock:
            left = self._trials_left(len(array))
            for first in range(0, left, CHUNK):
                part = slice(first, min(first + CHUNK, left))
                some, hand_codes, points = costs[part], codes[part], array[part]
                made = self._session._make_trials(hand_codes, self._targets_of(points))
                np.minimum(-made.rewards, FAILED, out=some)
                if some.min() < self._best_cost:
                    before = np.minimum.accumulate(np.append(self._best_cost, some))[:-1]
                    for n in np.flatnonzero(some < before).tolist():
                        at = self._evaluations + n + 1
                        self._keep(float(some[n]), at, points[n], hand_codes[n], made, n)
                self._evaluations += len(points)
        if left < len(array):
            raise BudgetError("all trials of the budget are made")
        return costs

    def _keep(
        self, cost: float, evaluations: int, point: Array, codes: Hands, made: Accounts, trial: int
    ) -> None:
        """Note a point, its ``cost``, ticks, and its hands ``codes``, ``(G,)``, as the best so far,
        evaluated as number ``evaluations`` (from 1), in trial ``trial`` (from 0) of ``made``."""
        self._best_cost, self._best_x = cost, point.copy()
        self._best_targets = self._targets_in(made, trial)
        self._best_hands = letters_of([HANDS[code] for code in codes])
        self._better.append((evaluations, cost))

    def _targets_in(self, made: Accounts, trial: int) -> Configs:
        """Return a copy of the targets of trial ``trial`` (from 0) of ``made``, shape ``(G, dof)``,
        length unit and rad."""
        return made.goals["target"][trial, :, 0, : self._session.dof].copy()

    def _targets_of(self, points: Array) -> Configs:
        """Return the targets ``(N, G, dof)``, length unit and rad, of points ``(N, dim)``; NaN for
        joints that have no entry in a point."""
        targets = np.repeat(self._targets, len(points), axis=0)
        targets.reshape(len(points), -1)[:, self._entries] = points
        return targets

    def _check(self, points: Array) -> None:
        """Raise ValueError if points ``(N, dim)`` have an infinite entry, or a goal that has NaN
        for some of its entries but not for all."""
        if points.min(initial=0.0) >= -LARGEST_ENTRY and points.max(initial=0.0) <= LARGEST_ENTRY:
            return
        missing = (np.isnan(self._targets_of(points)) & self.joints).sum(axis=2)
        in_part = (missing > 0) & (missing < self.joints.sum(axis=1))
        if in_part.any():
            point, goal = np.argwhere(in_part)[0]
            raise ValueError(
                f"point {point}: of goal {goal + 1} some entries are NaN; needed are all of them "
                "(the corrective process alone) or none"
            )
        if np.isinf(points).any():
            raise ValueError("points have infinite entries; needed are finite ones")

    @property
    def trials_left(self) -> int:
        """Number of trials left in the budget; above 10^18 without a budget."""
        return self._end - self._session.trials_made

    def _trials_left(self, wanted: int) -> int:
        """Return how many of ``wanted`` trials the budget allows: ``wanted``, or the number left if
        that is less. Raises BudgetError if ``wanted`` is above 0 and none is left, and CoarticError
        in another process."""
        if os.getpid() != self._process:
            raise CoarticError(NO_COPIES)
        left = self.trials_left
        if left <= 0 < wanted:
            raise BudgetError("all trials of the budget are made")
        return min(wanted, left)


def objective(
    task: TaskLike,
    hands: str | None = None,
    *,
    half_width: float = HALF_WIDTH,
    model: MotionModel = PAPER,
    budget: int | None = None,
) -> Objective:
    """Return the cost of a task's trial as a function that scipy and others can minimise.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    hands : str, optional
        A hand sequence (``"RRLR"``), by default the sequence with which the corrective process
        alone gets the highest reward. The optimum can have other hands, as in ``two-armed-2``.
    half_width : float
        Half the width of the bounds around ``x0``, length unit (base) and rad (joints).
    model : MotionModel
    budget : int, optional
        Most trials, with the trials by which hands are chosen; then BudgetError is raised.

    Returns
    -------
    Objective
        The function, which keeps its best point.

    Raises
    ------
    TaskError
        The task cannot be used.
    ValueError
        Hands do not fit, the half width is not from 1e-9 to 100, a constant of the model is out of
        bounds, or the budget is not from 1 to 10,000,000, or less than the hand sequences to choose
        among.
    TypeError
        The model is no MotionModel, or the task is neither a Task nor a text nor a path.
    MethodError
        The corrective process completes no sequence tried, or there are more than 4096 to try.
    """
    chosen = as_task(task)
    if budget is not None:
        check_limits("budget", budget, 1, MOST_TRIALS)
    goals = len(chosen.goals)
    reason = too_many_sequences(chosen.name, goals, len(chosen.hands))
    if hands is None and reason:
        raise MethodError("infeasible", f"{reason}; say which hands")
    if hands is None and budget is not None and budget < (first := len(chosen.hands) ** goals):
        raise ValueError(
            f"budget is {budget}; to choose among the hand sequences of task {chosen.name!r} takes "
            f"{counted(first, 'trial')}: give more, or say which hands"
        )
    session = Session(chosen, 0, OPTIMISER_INFORMATION, model=model)
    return Objective(session, hands, half_width=half_width, trials=budget, task=chosen)


class OptimiserParameters(Parameters):
    """Parameters of every :class:`Optimiser`."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Most trials of a run, with trials of the corrective process alone."""
    hands: str | None = None
    """Hand sequence, such as ``"RRLR"``; by default the sequence with which the corrective process
    alone gets the highest reward, or the task's initial one where more than 4096 exist."""
    half_width: Annotated[float, Field(ge=WIDTHS[0], le=WIDTHS[1])] = HALF_WIDTH
    """Half the width of the bounds, length unit (base) and rad (joints)."""


class Optimiser(Method):
    """A method of the benchmark that minimises the cost of a trial.

    A subclass has a name, a title, a citation and :meth:`optimise`.
    """

    information = OPTIMISER_INFORMATION
    Parameters = OptimiserParameters

    def solve(self, session: Session) -> Result:
        """Call :meth:`optimise` until it returns or the trials are used up; return the movements of
        the best trial. Raises MethodError if there is no trial to make, if the corrective process
        completes no hand sequence tried, or if no point is evaluated although trials are left;
        NotApplicableError if of more than 4096 sequences no initial one is found; ValueError for
        ``hands`` that do not fit."""
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
        if cost.evaluations == 0 and cost.trials_left > 0:
            raise MethodError("solver-failed", "optimise ended without evaluating a point")
        return Result(cost.solution, {"evaluations": cost.evaluations})

    @abstractmethod
    def optimise(self, objective: Objective, rng: np.random.Generator) -> None:
        """Minimise ``objective``, which keeps the best point, so that nothing is returned. Do not
        catch its BudgetError: it ends the run when no trial is left. ``rng``: the session's
        generator of random numbers."""
