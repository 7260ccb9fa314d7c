"""Black-box optimisation: the cost of a trial as a function to minimise.

:func:`objective` makes the function of a task for scipy and similar libraries.
:class:`Optimiser` is the base class of methods of the benchmark that minimise such a function.
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
from coartic.internal.limits import (
    MAX_RUN_SEED,
    MAX_TRIALS,
    WIDTHS,
    brief_value,
    check_limits,
    real_array,
)
from coartic.internal.text import pluralize
from coartic.method import (
    MAX_COUNT,
    TRIALS,
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
from coartic.motion.initial_hands import sequences_with, too_many_sequences
from coartic.motion.solution import Movement, movements_of
from coartic.motion.trials import HandSequences, TrialRecords, compiled_task, make_trials
from coartic.robot import HANDS, MAX_ENTRY, Array, Configs, Hands
from coartic.tasks.catalogue import TaskLike, as_task
from coartic.tasks.optima import KnownOptimum, best_shipped
from coartic.tasks.task import Task, letters_of

if TYPE_CHECKING:  # workers do not import pandas
    import pandas as pd

OPTIMISER_INFORMATION = frozenset({Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL})
"""Information that a method uses if it minimises an :class:`Objective`."""
FAILED = 1_000_000
"""Cost, in ticks, of a trial that fails or takes longer than this."""
HALF_WIDTH = 1.0
CHUNK = 8192
"""Largest number of points that are evaluated at a time, which limits the memory."""
NO_COPIES = (
    "an objective cannot be copied or sent to another process, because its trials would not be "
    "counted there: use vectorized=True or objective.many(points) instead of workers"
)


def explored_joints(session: Session) -> NDArray[np.bool_]:
    """Return a mask of the entries of a configuration that optimisers explore.

    The mask is a bool array, shape ``(dof,)``. It is True for the base coordinates that are not
    locked, and for the joints of the arms whose hands may hit goals.
    """
    mask = np.zeros(session.dof, dtype=np.bool_)
    mask[:2] = [coordinate not in session.locked_base for coordinate in "xy"]
    for hand in session.hands:
        mask[session.joints(hand)] = True
    return mask


def sequences_of(session: Session) -> list[str]:
    """List all hand sequences of the session's task, such as ``"RRLR"``.

    The order is alphabetical, except that the initial hand sequence comes first if the task names
    one. If there are more than 4096 sequences, the list contains only the result of
    :meth:`.Session.find_initial_hands`; the errors of that function are raised.
    """
    if too_many_sequences(session.task_name, session.goals_count, len(session.hands)):
        return [session.find_initial_hands()]
    sequences = sequences_with(session.hands, session.goals_count, session.task_name)
    return sorted(sequences, key=lambda hands: hands != session.initial_hands)


def _entries_of(name: str, points: ArrayLike) -> Array:
    """Convert points to an array of float64 (:func:`real_array`).

    Objects with a method ``to_numpy``, such as data frames, are accepted; their labels are ignored.
    Raises ValueError for values that are not real numbers. The error message begins with ``name``.
    """
    return real_array(name, points.to_numpy() if hasattr(points, "to_numpy") else points)


class Objective:
    """The cost of a trial (its ticks) as a function of its target configurations.

    A point is a vector of ``dim`` numbers, in length units (base) and rad (joints). It consists of
    one part for each goal, in the order of the goals. A part contains the target of each explored
    entry of a configuration (:func:`.explored_joints`).

    - The cost of a point is minus the reward of its trial, or ``FAILED`` if the trial fails or
      takes more than ``FAILED`` ticks.
    - If a movement misses its goal, the corrective process acts. The ticks of the corrective
      movement are part of the cost.
    - A point with an entry that is NaN or infinite is refused: no trial is made. A trial fails if
      its point has an entry beyond ±100,000.
    - With motor noise the cost of a point differs from trial to trial. :attr:`best_cost` is the
      lowest of many noisy costs, and therefore partly luck. To compare points fairly, evaluate them
      with the same noise draws (:meth:`many`).

    The constructor makes the first trials, in which only the corrective process acts: one trial
    with ``hands``, or one trial with each sequence of :func:`.sequences_of` until the budget is
    used up. The sequence with the highest reward becomes :attr:`hands`, the default hand sequence
    of all points.

    Threads can share an objective; their trials are made one after the other. Copying an objective,
    or evaluating it in a forked process, raises CoarticError, because trials of a copy or of
    another process would not be subtracted from the budget.

    Parameters
    ----------
    session : Session
        Session in which the trials are made and counted.
    hands : str, optional
        Hand sequence of the first trial and of points, such as ``"RRLR"``. By default the sequences
        of :func:`.sequences_of` are tried, and the one with the highest reward is used.
    half_width : float
        Half the width of the bounds around ``x0``, in length units (base) and rad (joints).
    trials : int, optional
        Largest number of trials, including the first ones. By default only the session limits them.
    task : Task, optional
        The task. A method does not pass it, because a method cannot see its task.

    Raises
    ------
    MethodError
        The corrective process completes none of the sequences tried.
    BudgetError
        No trial is left.
    NotApplicableError
        There are more than 4096 hand sequences, and no initial one is found.
    UndeclaredError
        The session's information does not include :data:`.OPTIMISER_INFORMATION`.
    ValueError
        ``hands`` do not fit the task, or ``half_width`` is not from 1e-9 to 100.
    """

    __slots__ = (
        *("joints", "configurations", "dim", "bounds", "_best_cost", "_best_hands"),
        *("_best_targets", "_improvements", "_codes", "_end", "_entries", "_evaluations"),
        *("_hands", "_process", "_session", "_targets", "_task"),
    )  # a misspelt attribute cannot be set by mistake

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
        self._end = session.trials_made + min(limits, default=MAX_COUNT)
        sequences = sequences_of(session) if hands is None else [hands]
        sequences = sequences[: self._trials_left(len(sequences))]
        shape = (len(sequences), session.goals_count, session.dof)
        outcomes = session.trials(sequences, np.full(shape, np.nan))
        best = int(outcomes.rewards.argmax())
        if not outcomes.completed[best]:
            raise MethodError("infeasible", "the corrective process completes no hand sequence")
        self._hands = sequences[best]
        self.joints = np.tile(explored_joints(session), (session.goals_count, 1))
        """True for entries that have a target in a point, shape ``(G, dof)`` (read-only)."""
        self.configurations: Array = outcomes.reached[best].copy()
        """Configurations in which the corrective process on its own hits the goals, shape ``(G,
        dof)`` (read-only)."""
        self.joints.flags.writeable = self.configurations.flags.writeable = False
        self._codes = session.hand_codes(self.hands, 1)
        self._targets = np.full((1, *self.joints.shape), np.nan)
        self._entries = np.flatnonzero(self.joints)
        self.dim = len(self._entries)
        """Number of entries of a point."""
        self.bounds: Array = self.x0[:, None] + np.array([-half_width, half_width])
        """Lower and upper ends of a box to search in, shape ``(dim, 2)``, in length units and rad.
        Points outside the box can be evaluated as well."""
        self._evaluations = 0
        self._best_cost = float(min(-outcomes.rewards[best], FAILED))
        self._best_hands = self.hands
        self._best_targets = outcomes.targets[best].copy()
        self._improvements = [(0, self._best_cost)]

    def __reduce__(self) -> Any:
        raise CoarticError(NO_COPIES)

    @property
    def hands(self) -> str:
        """Default hand sequence of points, such as ``"RRLR"``."""
        return self._hands

    # What is known about the task. Methods cannot use this.

    @property
    def task(self) -> Task:
        """The task.

        Raises UndeclaredError in a method, because a method cannot see its task: there the
        objective is made without ``task``.
        """
        if self._task is None:
            raise UndeclaredError("a method cannot see its task or what is known about the task")
        return self._task

    @property
    def _optimum(self) -> KnownOptimum | None:
        return best_shipped(self.task, self._session.model)

    @property
    def best_known(self) -> int | float | None:
        """Lowest known cost of a solution of the task (in ticks), or None.

        The solution may have any hand sequence, and may hit goals without a movement. With motor
        noise the cost is a mean over executions. The result is None if no such cost is shipped with
        coartic, as for

        - most tasks of your own;
        - instances of families, except the first 40 test instances of shipped families (with motor
          noise, only of families with up to eight goals);
        - motion models other than the paper's model and the paper's model with motor noise 0.01.

        Raises UndeclaredError in a method, as :attr:`task` does.
        """
        optimum = self._optimum
        return None if optimum is None else -optimum.reward

    @property
    def proven(self) -> bool:
        """True if a proof shows that no solution costs less than ``best_known``.

        Raises UndeclaredError in a method, as :attr:`task` does.
        """
        optimum = self._optimum
        return optimum is not None and optimum.proven

    @property
    def hand_sequences(self) -> list[str]:
        """All hand sequences of the task, such as ``"LLLR"``, in alphabetical order.

        Raises NotApplicableError if there are more than 4096.
        """
        session = self._session
        return sequences_with(session.hands, session.goals_count, session.task_name)

    # The results so far.

    @property
    def evaluations(self) -> int:
        """Number of points evaluated so far.

        The first trials, in which only the corrective process acts, are not counted.
        """
        return self._evaluations

    @property
    def best_cost(self) -> float:
        """Cost of the best trial so far (in ticks).

        Before the first evaluation it is the cost of the best trial in which only the corrective
        process acts.
        """
        return self._best_cost

    @property
    def best_hands(self) -> str:
        """Hand sequence of the best trial so far."""
        return self._best_hands

    @property
    def lower(self) -> Array:
        """A copy of the lower ends of ``bounds``, shape ``(dim,)``, in length units and rad."""
        return self.bounds[:, 0].copy()

    @property
    def upper(self) -> Array:
        """A copy of the upper ends of ``bounds``, shape ``(dim,)``, in length units and rad."""
        return self.bounds[:, 1].copy()

    @property
    def history(self) -> pd.DataFrame:
        """Table with a row for each improvement of the best cost.

        Column ``cost`` is the new best cost (in ticks). Column ``evaluations`` is the number of the
        evaluation that had this cost, from 1. The first row is the best of the first trials, in
        which only the corrective process acts; its number is 0.
        """
        import pandas as pd  # workers do not import pandas

        return pd.DataFrame(self._improvements, columns=["evaluations", "cost"])

    @property
    def x0(self) -> Array:
        """A starting point for a search, shape ``(dim,)``, in length units and rad.

        The starting point consists of the explored entries of :attr:`configurations`, in which the
        corrective process on its own hits the goals with :attr:`hands`. Each access returns a new
        array.
        """
        return self.configurations[self.joints].copy()

    @property
    def solution(self) -> tuple[Movement, ...]:
        """Movements of the best trial so far, for :func:`coartic.execute`.

        Until a point is better than the corrective process on its own, the solution consists of
        corrective movements without targets.
        """
        return movements_of(self.best_hands, self._best_targets)

    def movements(self, x: ArrayLike, hands: str | None = None) -> tuple[Movement, ...]:
        """Return the movements of the trial of a point, for :func:`coartic.execute`.

        Without motor noise the execution takes as many ticks as the point costs, if the cost is
        below ``FAILED``. No evaluation is counted.

        Parameters
        ----------
        x : array_like, shape (dim,)
            The point.
        hands : str, optional
            Hand sequence of the trial, by default :attr:`hands`.

        Returns
        -------
        tuple of Movement
            A movement for each goal. Its target has an entry for each entry of a configuration.
            For entries that are not in the point, it is

            - without motor noise, the value of the coordinate when the movement begins;
            - without motor noise, for goals after a goal at which the trial fails, the value of the
              coordinate at the start of the trial;
            - with motor noise, NaN (a coordinate whose target is NaN does not move).

        Raises
        ------
        UndeclaredError
            The model has no motor noise, and the objective is that of a method, which cannot see
            its task. The method can use :attr:`solution` instead.
        ValueError
            ``x`` or ``hands`` does not fit, or an entry of ``x`` is NaN or infinite.
        """
        point = _entries_of("x", x)
        if point.shape != (self.dim,):
            raise ValueError(f"x has shape {point.shape}; it must be ({self.dim},)")
        self._check(point[None])
        chosen = self.hands if hands is None else hands
        codes, targets = self._session.hand_codes(chosen, 1), self._targets_of(point[None])
        if self._session.model.motor_noise > 0.0:
            return movements_of(chosen, targets[0])
        task = self.task
        records = make_trials(compiled_task(task, self._session.model), codes, targets[:, :, None])
        targets = self._targets_in(records, 0)  # NaN at goals after the failure of the trial
        return movements_of(chosen, np.where(np.isnan(targets), task.q0, targets))

    # Evaluation.

    def __call__(self, x: ArrayLike, hands: str | None = None) -> Any:
        """Return the cost of a point, or of each point in columns (in ticks).

        Parameters
        ----------
        x : array_like, shape (dim,) or (dim, N)
            A point, or points as columns, as scipy passes them. Shape ``(dim, dim)`` is refused,
            because its points could be rows as well: pass rows to :meth:`many`.
        hands : str or sequence of str, optional
            As in :meth:`many`.

        Returns
        -------
        float or ndarray, shape (N,)
            The costs.

        Raises
        ------
        BudgetError, ValueError
            As in :meth:`many`, and for shape ``(dim, dim)``.
        """
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
                f"x has shape {point.shape}; it must be ({self.dim},) or ({self.dim}, N); "
                "many(x) takes points as rows"
            )
        # Points with NaN or large entries need a closer check.
        if hands is not None or not math.hypot(*point.tolist()) < MAX_ENTRY:
            return float(self.many(point[None], hands)[0])
        with self._session.lock:
            self._trials_left(1)
            self._targets.put(self._entries, point)
            records = self._session._make_trials(self._codes, self._targets)
            cost = float(min(-records.rewards.item(), FAILED))
            self._evaluations += 1
            if cost < self._best_cost:
                self._note_best(cost, self._evaluations, point, self._codes[0], records, 0)
        return cost

    def many(
        self,
        points: ArrayLike,
        hands: HandSequences | None = None,
        *,
        draws: ArrayLike | None = None,
    ) -> Array:
        """Make a trial for each of many points, and return the costs (in ticks).

        Parameters
        ----------
        points : array_like, shape (N, dim)
            Points as rows, with finite entries. Coordinates that are not in a point do not move. A
            trial with an entry beyond ±100,000 fails.
        hands : str or sequence of str, optional
            One hand sequence for all points (``"RRLR"``), or a sequence for each; by default
            :attr:`hands`.
        draws : array_like of int, shape (N,), optional
            Number of the noise draw for each point (:meth:`.Session.trials`). Points with the same
            draw are evaluated with the same noise. To choose draws, a method has to declare
            ``Information.NOISE_DRAWS``.

        Returns
        -------
        ndarray, shape (N,)
            The costs.

        Raises
        ------
        UndeclaredError
            A method chooses draws without declaring ``Information.NOISE_DRAWS``.
        BudgetError
            Fewer trials are left than there are points. Before the error is raised, the first
            points are evaluated until no trial is left.
        ValueError
            An argument cannot be used:

            - ``points`` has the wrong shape;
            - an entry is NaN or infinite;
            - ``hands`` do not fit the task, or their number is not N;
            - ``draws`` are not N integers from 0 to 2^53.
        """
        array = _entries_of("points", points)
        if array.ndim != 2 or array.shape[1] != self.dim:
            raise ValueError(f"points has shape {array.shape}; it must be (N, {self.dim})")
        self._check(array)
        codes = self._session.hand_codes(self.hands if hands is None else hands, len(array))
        chosen = self._session.chosen_draws(draws, len(array))
        costs = np.empty(len(array))
        with self._session.lock:
            left = self._trials_left(len(array))
            for start in range(0, left, CHUNK):
                part = slice(start, min(start + CHUNK, left))
                part_costs, hand_codes, points = costs[part], codes[part], array[part]
                records = self._session._make_trials(
                    hand_codes,
                    self._targets_of(points),
                    draws=None if chosen is None else chosen[part],
                )
                np.minimum(-records.rewards, FAILED, out=part_costs)
                if part_costs.min() < self._best_cost:
                    best_costs = np.minimum.accumulate(np.append(self._best_cost, part_costs))[:-1]
                    for n in np.flatnonzero(part_costs < best_costs).tolist():
                        cost, evaluations = float(part_costs[n]), self._evaluations + n + 1
                        self._note_best(cost, evaluations, points[n], hand_codes[n], records, n)
                self._evaluations += len(points)
        if left < len(array):
            raise BudgetError("the budget has no trial left")
        return costs

    def _note_best(
        self,
        cost: float,
        evaluations: int,
        point: Array,
        codes: Hands,
        records: TrialRecords,
        trial: int,
    ) -> None:
        """Store a point as the best so far.

        ``cost`` is in ticks, and ``codes``, shape ``(G,)``, are the hands of the point (0 left, 1
        right). The number of its evaluation is ``evaluations``, from 1. The number of its trial in
        ``records`` is ``trial``, from 0.
        """
        self._best_cost = cost
        if self._session.model.motor_noise > 0.0:  # a joint that keeps still has no noise
            self._best_targets = self._targets_of(point[None])[0]
        else:
            self._best_targets = self._targets_in(records, trial)
        self._best_hands = letters_of([HANDS[code] for code in codes])
        self._improvements.append((evaluations, cost))

    def _targets_in(self, records: TrialRecords, trial: int) -> Configs:
        """Return a copy of a trial's targets, shape ``(G, dof)``, in length units and rad.

        ``trial`` is the index of the trial in ``records``.
        """
        return records.goals["target"][trial, :, 0, : self._session.dof].copy()

    def _targets_of(self, points: Array) -> Configs:
        """Convert points, shape ``(N, dim)``, to targets, shape ``(N, G, dof)``.

        Targets are in length units and rad, and NaN for coordinates that are not in a point.
        """
        targets = np.repeat(self._targets, len(points), axis=0)
        targets.reshape(len(points), -1)[:, self._entries] = points
        return targets

    def _check(self, points: Array) -> None:
        """Raise ValueError if an entry of points, shape ``(N, dim)``, is NaN or infinite."""
        is_wrong = ~np.isfinite(points)
        if is_wrong.any():
            point, entry = np.argwhere(is_wrong)[0]
            raise ValueError(
                f"entry {entry} of point {point} is {points[point, entry]}; each entry must be "
                "finite. Has the search diverged?"
            )

    @property
    def trials_left(self) -> int:
        """Number of trials left in the budget; above 10^18 if there is no budget."""
        return self._end - self._session.trials_made

    def _trials_left(self, count: int) -> int:
        """Return how many of ``count`` trials the budget allows.

        Raises BudgetError if ``count`` is above 0 and no trial is left, and CoarticError if the
        objective was made in another process.
        """
        if os.getpid() != self._process:
            raise CoarticError(NO_COPIES)
        left = self.trials_left
        if left <= 0 < count:
            raise BudgetError("the budget has no trial left")
        return min(count, left)


def objective(
    task: TaskLike,
    hands: str | None = None,
    *,
    half_width: float = HALF_WIDTH,
    model: MotionModel = PAPER,
    budget: int | None = None,
    seed: int = 0,
) -> Objective:
    """Make an objective function for scipy and similar libraries: the cost of a trial.

    Parameters
    ----------
    task : Task, str or pathlib.Path
    hands : str, optional
        A hand sequence (``"RRLR"``), by default the sequence for which the corrective process on
        its own gets the highest reward. The optimum can have another hand sequence, as in task
        ``two-armed-2``.
    half_width : float
        Half the width of the bounds around ``x0``, in length units (base) and rad (joints).
    model : MotionModel
        The motion model, such as ``MotionModel(motor_noise=0.01)``.
    budget : int, optional
        Largest number of trials, including the trials that choose the hand sequence. When the
        budget is used up, a further trial raises BudgetError.
    seed : int
        Seed of the motor noise, from 0 to 2^128 - 1.

    Returns
    -------
    Objective
        The function, which stores its best point.

    Raises
    ------
    TaskError
        The task cannot be used.
    ValueError
        An argument cannot be used:

        - ``hands`` do not fit the task;
        - ``half_width`` is not from 1e-9 to 100;
        - a constant of the model is out of bounds;
        - ``seed`` is out of bounds;
        - ``budget`` is not from 1 to 10,000,000, or is smaller than the number of hand sequences to
          try.
    TypeError
        The task is not a Task, a string or a path.
    MethodError
        The corrective process completes none of the sequences tried, or there are more than 4096
        sequences to try.
    """
    chosen = as_task(task)
    if budget is not None:
        check_limits("budget", budget, 1, MAX_TRIALS)
    goals = len(chosen.goals)
    reason = too_many_sequences(chosen.name, goals, len(chosen.hands))
    if hands is None and reason:
        raise MethodError("infeasible", f"{reason}; pass the hands to use")
    if hands is None and budget is not None and budget < (count := len(chosen.hands) ** goals):
        raise ValueError(
            f"budget is {budget}; it takes {pluralize(count, 'trial')} to choose among the hand "
            f"sequences of task {chosen.name!r}: raise the budget, or pass the hands to use"
        )
    check_limits("seed", seed, 0, MAX_RUN_SEED)
    information = OPTIMISER_INFORMATION | {Information.NOISE_DRAWS}
    session = Session(chosen, int(seed), information, model=model)
    return Objective(session, hands, half_width=half_width, trials=budget, task=chosen)


class OptimiserParameters(Parameters):
    """Parameters of all optimisers."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Largest number of trials of a run, including the first trials, in which only the corrective
    process acts."""
    hands: str | None = None
    """Hand sequence, such as ``"RRLR"``. By default it is the sequence for which the corrective
    process on its own gets the highest reward, or the task's initial sequence if there are more
    than 4096 sequences."""
    half_width: Annotated[float, Field(ge=WIDTHS[0], le=WIDTHS[1])] = HALF_WIDTH
    """Half the width of the bounds, in length units (base) and rad (joints)."""


class Optimiser(Method):
    """Base class of methods that minimise the cost of a trial.

    A subclass sets ``name`` and ``title``, names its works in ``facts`` or ``citation``, and
    implements :meth:`optimise`.
    """

    information = OPTIMISER_INFORMATION
    Parameters = OptimiserParameters

    def solve(self, session: Session) -> Result:
        """Minimise the cost by :meth:`optimise`, and return the movements of the best trial.

        :meth:`optimise` is called once. It ends when it returns, or when it asks for a trial and
        none is left. With motor noise, the movements of the point that it recommends are returned
        instead, if it recommends one.

        Raises
        ------
        MethodError
            The budget has no trial, the corrective process completes no hand sequence tried, or
            :meth:`optimise` evaluates no point although trials are left.
        NotApplicableError
            There are more than 4096 hand sequences, and no initial one is found.
        ValueError
            Parameter ``hands`` does not fit the task. With motor noise: :meth:`optimise` returned
            anything else than a point, a tuple of a point and its hands, or None.
        """
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
        recommended = None
        with session.solving(), suppress(BudgetError):
            recommended = self.optimise(cost, session.rng)
        if cost.evaluations == 0 and cost.trials_left > 0:
            raise MethodError("solver-failed", "optimise ended without evaluating a point")
        solution = cost.solution
        if session.model.motor_noise > 0.0 and recommended is not None:
            try:
                match recommended:
                    case (point, str(hands)):
                        solution = cost.movements(point, hands)
                    case point:
                        solution = cost.movements(point)
            except ValueError as error:
                raise ValueError(
                    f"optimise returned {brief_value(recommended)}; it must return a point of "
                    f"{cost.dim} numbers, a tuple of a point and its hands, or None ({error})"
                ) from None
        return Result(solution, {"evaluations": cost.evaluations})

    @abstractmethod
    def optimise(self, objective: Objective, rng: np.random.Generator) -> Any:
        """Minimise ``objective``, and return the recommended point.

        Parameters
        ----------
        objective : Objective
            The cost function, which stores its best trial. When no trial is left, an evaluation
            raises BudgetError, which ends the run.
        rng : numpy.random.Generator
            The session's random generator.

        Returns
        -------
        array_like, shape (dim,), or tuple, or None
            The point that the method recommends, such as the mean of an evolution strategy; or a
            tuple of the point and its hand sequence, if the sequence is not
            :attr:`Objective.hands`. With motor noise the returned point is the solution, because
            the reward of the best trial is partly luck. Without motor noise, or if None is
            returned, the best trial is the solution.

        Notes
        -----
        A search that goes on until BudgetError is raised returns nothing. To recommend a point
        nevertheless, write ``with contextlib.suppress(BudgetError):`` around the search, and
        ``return`` after it.

        Examples
        --------
        >>> from contextlib import suppress
        >>> from coartic import MotionModel
        >>> from coartic.method import run_method
        >>> class Average(Optimiser):
        ...     name, title = "average", "Average of good points"
        ...
        ...     def optimise(self, objective, rng):
        ...         x = objective.x0
        ...         with suppress(BudgetError):
        ...             while True:
        ...                 points = x + 0.03 * rng.standard_normal((20, objective.dim))
        ...                 x = points[objective.many(points).argsort()[:5]].mean(axis=0)
        ...         return x
        >>> average = Average(Average.Parameters(trials=200))
        >>> result, _ = run_method(average, "ascending", model=MotionModel(motor_noise=0.01))
        >>> [movement.kind for movement in result.solution]
        ['learned', 'learned', 'learned']
        """
