"""The session of a method: access to the task, and counts of trials and evaluations."""

from __future__ import annotations

import os
import time
from array import array
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from threading import RLock
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from coartic.errors import CoarticError, SolutionError
from coartic.internal.limits import brief_value, check_limits, real_array
from coartic.internal.text import pluralize
from coartic.model import PAPER, MotionModel
from coartic.motion.doors import Correction, correct
from coartic.motion.execution import Execution, execute_many
from coartic.motion.initial_hands import search_initial_hands
from coartic.motion.solution import Movement, check_targets
from coartic.motion.trials import (
    NO_NOISE,
    NO_REWARD,
    CompiledTask,
    HandSequences,
    TrialRecords,
    Trials,
    compiled_task,
    count_trials,
    hand_codes,
    make_trials,
    noise_draws,
    noise_seed,
    trials_of,
)
from coartic.robot import Array, Configs, Hand, Hands, Robot
from coartic.tasks.task import Task, in_world


class Information(StrEnum):
    """Information that a method can use beyond what a session shows to every method."""

    GOALS = "goals"
    """Centres of the goals, and their radius."""
    FORWARD_KINEMATICS = "forward kinematics"
    """Position of a hand in a configuration."""
    JACOBIAN = "Jacobian"
    """Derivative of a hand's position with respect to the entries of a configuration."""
    CORRECTIVE_PROCESS = "corrective process"
    """A configuration that hits a goal, which the corrective process **A** finds from the goal and
    the Jacobian."""
    REWARD_BY_TRIAL = "reward by trial"
    """The total reward of a trial, after the trial is made."""
    REWARD_BY_SUBTASK = "reward by subtask"
    """The reward for each goal of a trial, after the trial is made."""
    KINEMATIC_MODEL = "kinematic model"
    """The kinematics as formulas, with all derivatives."""
    NOISE_DRAWS = "draws of the noise"
    """The choice of the noise draw of each trial. By default trial k has draw k."""
    REWARD_FORMULA = "reward as a formula"
    """The rule that a movement costs reward in proportion to the length of its path in joint
    space."""
    SECONDARY_OBJECTIVES = "secondary objectives"
    """Objectives beyond hitting the goals, such as smoothness."""


METERED = frozenset(
    {
        Information.GOALS,
        Information.FORWARD_KINEMATICS,
        Information.JACOBIAN,
        Information.CORRECTIVE_PROCESS,
        Information.REWARD_BY_TRIAL,
        Information.KINEMATIC_MODEL,
        Information.NOISE_DRAWS,
    }
)
"""Information whose use a session can detect. Methods declare other information as well, but the
session does not check its use."""


class UndeclaredError(CoarticError):
    """A method made a call, or used information, that its declaration does not cover."""


class BudgetError(CoarticError):
    """More trials were requested than are left in the budget."""


class MethodError(CoarticError):
    """A method found no solution.

    ``outcome`` is ``"infeasible"`` or ``"solver-failed"``.
    """

    def __init__(
        self,
        outcome: Literal["infeasible", "solver-failed"],
        reason: str,
        details: dict[str, Any] | None = None,
    ) -> None:
        super().__init__(reason)
        if outcome not in ("infeasible", "solver-failed"):
            raise ValueError(f"outcome is {outcome!r}; it must be 'infeasible' or 'solver-failed'")
        self.outcome = outcome
        self.details = details or {}

    def __reduce__(self) -> Any:  # for pools, which would wait for ever for an error like this
        return type(self), (self.outcome, str(self), self.details)


@dataclass
class Meter:
    """Counts of the trials, evaluations and seconds that a method has used."""

    trials: int = 0
    """Physical trials, including failed trials."""
    initial_trials: int = 0
    """Trials of the search for the initial hands, if the task names a policy. These trials are not
    counted in ``trials`` and ``failed_trials``, but their ticks, corrections and evaluations are
    included in the counts below."""
    movement_ticks: int = 0
    """Control ticks of all trials, including ``initial_trials``."""
    forward_kinematics: int = 0
    """Forward-kinematics evaluations, one for each configuration and hand. Compiled kernels skip
    steps that cannot end a movement; these steps are not counted."""
    corrections: int = 0
    """Corrective movements made."""
    failed_trials: int = 0
    """Number of ``trials`` that did not hit every goal."""
    gradients: int = 0
    """Gradient evaluations of a solver."""
    solver_iterations: int = 0
    """Iterations of a solver."""
    build_s: float = 0.0
    """Wall time of setting up problems (in s)."""
    solve_s: float = 0.0
    """Wall time of solving problems, or of learning (in s)."""

    COUNTS: ClassVar[tuple[str, ...]]
    """Names of all counters except the times."""
    SOLVER: ClassVar[tuple[str, ...]] = ("forward_kinematics", "gradients", "solver_iterations")
    """Counters to which a method may add (:meth:`Session.spend`): the evaluations and iterations of
    its own solver or of its own corrective process."""

    def add(self, **counts: int) -> None:
        """Add counts to the counters with the names of the keyword arguments, in place.

        Signs, sums and budgets are not checked.
        """
        for name, count in counts.items():
            setattr(self, name, getattr(self, name) + int(count))


Meter.COUNTS = tuple(name for name, value in vars(Meter()).items() if isinstance(value, int))
MAX_COUNT = 2**63 - 1
"""Largest count that can be stored."""


_OTHER_PROCESS = (
    "a session cannot be used in another process, because trials and evaluations would not be "
    "counted there: make many trials at once by session.trials(hands, targets)"
)


def _pack_rewards(rewards: Iterable[int | None]) -> array[int]:
    """Convert rewards to an array of 8-byte integers; :data:`NO_REWARD` stands for None."""
    return array("q", [NO_REWARD if reward is None else reward for reward in rewards])


class Session:
    """The task, the seed and the meter with which a method works.

    - A call raises UndeclaredError if it uses information that is in :data:`METERED` but not in
      ``information``. A session is not a sandbox: it cannot keep a method from reading the task
      by other means.
    - Trials and evaluations are counted.
    - Threads can share a session: they make trials one after the other, from the same budget. Other
      counts, such as those of :meth:`spend`, can be lost if threads add to them at the same time.
    - In a forked process, a call that needs declared information raises CoarticError.

    Parameters
    ----------
    task : Task
    seed : int
    information : iterable of Information
        The information that the method declares.
    model : MotionModel
        The motion model of the trials. The seed of its motor noise is derived from ``seed``. The
        random numbers of the attribute ``rng``, a NumPy generator with seed ``seed``, are
        independent of the noise.
    trial_budget : int, optional
        Largest number of trials; None for no limit.
    trusted : bool
        True for methods of this project. They may also get the task for their compiled kernels
        (:meth:`reveal`), and add to all counters (:meth:`spend`).
    of_run : bool
        True for the session of a run. Trials outside such sessions are counted in each process
        (:func:`coartic.motion.trials.trials_outside`).
    """

    def __init__(
        self,
        task: Task,
        seed: int,
        information: Iterable[Information],
        *,
        model: MotionModel = PAPER,
        trial_budget: int | None = None,
        trusted: bool = False,
        of_run: bool = False,
    ) -> None:
        self._task = in_world(task, model)
        self._information = frozenset(information)
        self._used: set[Information] = set()
        self._process = os.getpid()
        self.seed = seed
        self.rng = np.random.default_rng(seed)
        self.model = model
        self._trusted = trusted
        self._of_run = of_run
        self._trial_budget = trial_budget
        self._meter = Meter()
        self._rewards = array("q")
        self.lock = RLock()
        """Held from the check of the budget until the trials are counted."""

    # Every method can use these. They do not tell where the goals are.

    @property
    def task_name(self) -> str:
        """Name of the task, such as ``"ascending"``."""
        return self._task.name

    @property
    def goals_count(self) -> int:
        """Number of goals of the task, G."""
        return len(self._task.goals)

    @property
    def hands(self) -> tuple[Hand, ...]:
        """Hands that may hit goals: ``"left"``, ``"right"`` or both."""
        return self._task.hands

    @property
    def initial_hands(self) -> str:
        """Hand sequence of trial 0, such as ``"RRRR"``, or the policy that finds one."""
        return self._task.initial_hands

    @property
    def locked_base(self) -> tuple[str, ...]:
        """Base coordinates that cannot move: ``"x"``, ``"y"``, both or none."""
        return self._task.locked_base

    @property
    def q0(self) -> Array:
        """Starting configuration, shape ``(dof,)``, in length units and rad (a copy)."""
        return np.array(self._task.q0)

    @property
    def dof(self) -> int:
        """Number of degrees of freedom, the length of a configuration."""
        return self._task.robot.dof

    def joints(self, hand: Hand) -> slice:
        """Return the slice of a configuration with the joint angles of a hand's arm.

        The angles are in rad. Raises ValueError for an unknown hand.
        """
        return self._task.robot.joints(hand)

    # These have to be declared.

    @property
    def goals(self) -> Array:
        """Goal centres, shape ``(G, 2)``, in length units (a copy).

        Raises UndeclaredError without ``Information.GOALS``.
        """
        self._use(Information.GOALS)
        return np.array(self._task.goal_array)

    @property
    def radius(self) -> float:
        """θ^g: radius of every goal (in length units).

        Raises UndeclaredError without ``Information.GOALS``.
        """
        self._use(Information.GOALS)
        return self._task.radius

    @property
    def robot(self) -> Robot:
        """The robot with the lengths of its links and the positions of its shoulders.

        The session does not count evaluations that the method makes with this object: add them by
        :meth:`spend`. Raises UndeclaredError without ``Information.KINEMATIC_MODEL``.
        """
        self._use(Information.KINEMATIC_MODEL)
        return self._task.robot

    def symbolic_hand(self, q: Any, hand: Hand) -> Any:
        """Return the position of a hand as a CasADi expression.

        The session does not count evaluations of the expression: add them by :meth:`spend`.

        Parameters
        ----------
        q : CasADi matrix, dof x 1
        hand : {"left", "right"}

        Returns
        -------
        CasADi matrix, 2 x 1
            x and y in length units.

        Raises
        ------
        UndeclaredError
            ``Information.KINEMATIC_MODEL`` is not declared.
        ValueError
            ``q`` is not a CasADi matrix with ``dof`` entries, or the hand is unknown.
        """
        self._use(Information.KINEMATIC_MODEL)
        return self._task.robot.symbolic_hand(q, hand)

    @property
    def used(self) -> frozenset[Information]:
        """Declared information that the method has used so far.

        It contains the information that was needed for calls of the session, and the information
        that was passed to :meth:`reveal`. Any other use is not detected.
        """
        return frozenset(self._used)

    def check_solution(self, solution: Sequence[Movement]) -> None:
        """Check whether a solution uses the corrective process without declaring it.

        A corrective movement without a target uses the corrective process. If there is such a
        movement, ``Information.CORRECTIVE_PROCESS`` is added to :attr:`used`. Raises
        UndeclaredError if the method does not declare it, and SolutionError if the solution is not
        a sequence.
        """
        if not isinstance(solution, Sequence):
            raise SolutionError(f"the solution is {brief_value(solution)}; it must be a list")
        for movement in solution:
            if getattr(movement, "kind", "") == "corrective" and movement.target is None:
                self._use(Information.CORRECTIVE_PROCESS)

    def _use(self, *information: Information) -> None:
        if os.getpid() != self._process:
            raise CoarticError(_OTHER_PROCESS)
        for item in information:
            if item not in self._information:
                declared = ", ".join(sorted(self._information)) or "nothing"
                raise UndeclaredError(
                    f"the method used {item.value!r}, which it does not declare (declared: "
                    f"{declared})"
                )
        self._used.update(information)

    # Calls that the session counts.

    def forward_kinematics(self, q: Any, hand: Hand) -> Array:
        """Return positions of a hand, and count one evaluation for each of them.

        Parameters
        ----------
        q : array_like, shape (..., dof)
        hand : {"left", "right"}

        Returns
        -------
        ndarray, shape (..., 2)
            x and y in length units.

        Raises
        ------
        UndeclaredError
            ``Information.FORWARD_KINEMATICS`` is not declared.
        ValueError
            ``q`` or ``hand`` does not fit the robot.
        """
        self._use(Information.FORWARD_KINEMATICS)
        positions = self._task.robot.forward_kinematics(q, hand)
        self._meter.add(forward_kinematics=positions[..., 0].size)
        return positions

    def jacobian(self, q: Any, hand: Hand) -> Array:
        """Return Jacobians of a hand's position, and count one evaluation for each of them.

        Parameters
        ----------
        q : array_like, shape (..., dof)
        hand : {"left", "right"}

        Returns
        -------
        ndarray, shape (..., 2, dof)
            Derivatives of x and y with respect to each entry of ``q``, in length units per length
            unit (base) and per rad (joints).

        Raises
        ------
        UndeclaredError
            ``Information.JACOBIAN`` is not declared.
        ValueError
            ``q`` or ``hand`` does not fit the robot.
        """
        self._use(Information.JACOBIAN)
        return self._task.robot.jacobian(q, hand)

    def correct(self, q: Any, hand: Hand, goal: int) -> Correction:
        """Run the corrective process for a goal, and count its evaluations.

        The robot does not move. Forward-kinematics evaluations are counted.

        Parameters
        ----------
        q : array_like, shape (dof,)
            Configuration in which the process begins.
        hand : {"left", "right"}
        goal : int
            Number of the goal, from 1.

        Returns
        -------
        Correction
            The configuration found, or the last iterate if it is not ``converged``.

        Raises
        ------
        UndeclaredError
            ``Information.CORRECTIVE_PROCESS`` is not declared.
        ValueError
            The task does not have the goal, ``q`` or ``hand`` does not fit the robot, or a constant
            of the session's model is out of bounds.
        """
        self._use(Information.CORRECTIVE_PROCESS)
        check_limits("goal", goal, 1, self.goals_count)
        correction = correct(
            self._task.robot,
            q,
            hand,
            self._task.goals[goal - 1],
            locked_base=self._task.locked_base,
            model=self.model.without_noise().for_radius(self._task.radius),
        )
        self._meter.add(forward_kinematics=correction.iterations + 1)
        return correction

    def trial(self, solution: Sequence[Movement]) -> Execution:
        """Make one physical trial of a solution, and count it.

        The ticks, evaluations and corrections of the trial are counted as well. If a goal is
        missed, the corrective process acts, and the ticks of its movement are part of the reward.
        With motor noise, trial k of the session (from 0) is made with draw k of the noise.

        Parameters
        ----------
        solution : sequence of Movement

        Returns
        -------
        Execution
            The execution. If ``Information.CORRECTIVE_PROCESS`` is not declared, the movements of
            the execution are those of ``solution``, and the execution contains no configurations.

        Raises
        ------
        UndeclaredError
            ``Information.REWARD_BY_TRIAL`` is not declared, or a corrective movement has no target
            and ``Information.CORRECTIVE_PROCESS`` is not declared.
        BudgetError
            The budget has no trial left.
        SolutionError
            The solution breaks the task's rules.
        """
        self._use(Information.REWARD_BY_TRIAL)
        self.check_solution(solution)
        with self.lock:
            self._affordable(1)
            (execution,) = execute_many(self._compiled, [solution], self._worlds(1))
            if isinstance(execution, Exception):
                raise execution
            count_trials(-self._of_run)
            self._count(
                _pack_rewards([execution.reward]),
                execution.ticks,
                execution.evaluations,
                execution.corrections,
                not execution.completed,
            )
        if Information.CORRECTIVE_PROCESS in self._information:
            return execution
        return replace(
            execution, movements=tuple(solution), configurations=execution.configurations[:0]
        )

    def trials(
        self, hands: HandSequences, targets: Any, *, until: Any = None, draws: Any = None
    ) -> Trials:
        """Make N physical trials at once.

        If a goal is missed, the corrective process acts, and the ticks of its movement are part of
        the reward. The counts are the same as for N calls of :meth:`trial`, except that
        :meth:`trial` makes one or two more evaluations of forward kinematics for each goal that is
        tried.

        Parameters
        ----------
        hands : str or sequence of str
            One hand sequence for all trials (``"RRLR"``), or a sequence for each.
        targets : array_like, shape (N, G, dof)
            Targets, in length units (base) and rad (joints). A coordinate whose entry is NaN does
            not move. If all entries of a goal are NaN, there is no movement to a target: only the
            corrective process acts, and the method has to declare it. A trial with an entry beyond
            ±100,000 fails without a movement (:meth:`trial` raises an error instead).
        until : array_like, shape (N,), optional
            A threshold for the reward of each trial. The first trial whose reward exceeds its
            threshold is the last trial that is counted and returned.
        draws : array_like of int, shape (N,), optional
            Number of the noise draw for each trial, from 0 to 2^53. Trials with the same draw are
            made with the same noise (*common random numbers*). By default trial k of the session
            (from 0) is made with draw k. Without motor noise the draws have no effect.

        Returns
        -------
        Trials
            The results, with a row for each trial that is counted. If only n < N trials are left in
            the budget, only the first n trials are made. If ``Information.CORRECTIVE_PROCESS`` is
            not declared, ``corrections``, ``iterations``, ``targets`` and ``reached`` are empty.

        Raises
        ------
        UndeclaredError
            Needed information is not declared:

            - ``Information.REWARD_BY_TRIAL`` in any case;
            - ``Information.CORRECTIVE_PROCESS`` if a goal has no targets;
            - ``Information.NOISE_DRAWS`` if draws are chosen.
        BudgetError
            N is above 0, and the budget has no trial left.
        ValueError
            Hands or arrays do not fit the task or N, or a target moves a locked base coordinate by
            more than 1e-6.
        """
        self._use(Information.REWARD_BY_TRIAL)
        configurations = check_targets(self._task, targets)
        count = len(configurations)
        has_nan = np.isnan(configurations.min(initial=0.0))
        if has_nan and np.isnan(configurations).all(axis=2).any():
            self._use(Information.CORRECTIVE_PROCESS)
        codes = hand_codes(self._task, hands, count)
        until = None if until is None else real_array("until", until)
        if until is not None and until.shape != (count,):
            raise ValueError(f"until has shape {until.shape}; it must be ({count},)")
        chosen = self.chosen_draws(draws, count)
        with self.lock:
            left = self._affordable(count)
            drawn = None if chosen is None else chosen[:left]
            records = self._make_trials(codes[:left], configurations[:left], until, drawn)
        trials = trials_of(records, self.dof)
        if Information.CORRECTIVE_PROCESS in self._information:
            return trials
        return trials._replace(
            corrections=trials.corrections[:0],
            iterations=trials.iterations[:0],
            targets=trials.targets[:0],
            reached=trials.reached[:0],
        )

    def _affordable(self, count: int) -> int:
        """Return how many of ``count`` trials the budget allows.

        Raises BudgetError if ``count`` is above 0 and no trial is left.
        """
        left = self.trials_left
        if left is None:
            return count
        if left <= 0 < count:
            raise BudgetError(
                f"the budget of {pluralize(self._trial_budget or 0, 'trial')} is spent"
            )
        return min(count, left)

    # Parts of these calls. An objective uses them as well, and checks points and budget itself.

    @cached_property
    def _compiled(self) -> CompiledTask:
        return compiled_task(self._task, self.model)

    def hand_codes(self, hands: HandSequences, count: int) -> Hands:
        """Return hand sequences as integer codes (0 left, 1 right), shape ``(count, G)``.

        ``hands`` is one hand sequence for all trials, or one sequence for each trial. Raises
        ValueError if a sequence does not fit the task, or if the number of sequences in a list is
        not ``count``.
        """
        return hand_codes(self._task, hands, count)

    def _worlds(self, count: int, draws: ArrayLike | None = None) -> NDArray[np.uint64]:
        """Return the noise seed and noise draw of the next ``count`` trials (:func:`noise_draws`).

        Without motor noise the result is :data:`NO_NOISE`. By default trial k has draw k.
        """
        if self.model.motor_noise == 0.0:
            return NO_NOISE
        numbers = self.trials_made + np.arange(count) if draws is None else draws
        return noise_draws(noise_seed(self.seed), numbers)

    def chosen_draws(self, draws: Any, count: int) -> NDArray[np.int64] | None:
        """Return chosen draws as an array, shape ``(count,)``; return None if none are chosen.

        Raises UndeclaredError if ``Information.NOISE_DRAWS`` is not declared, and ValueError if
        ``draws`` is not an array of ``count`` integers from 0 to 2^53.
        """
        if draws is None:
            return None
        self._use(Information.NOISE_DRAWS)
        numbers = real_array("draws", draws)
        if numbers.shape != (count,):
            raise ValueError(f"draws has shape {numbers.shape}; it must be ({count},)")
        if not ((numbers >= 0) & (numbers <= 2**53) & (numbers == np.floor(numbers))).all():
            raise ValueError(
                f"draws is {brief_value(numbers.tolist())}; each entry must be an integer from 0 "
                "to 2^53"
            )
        return np.asarray(draws, np.int64)

    def _make_trials(
        self,
        codes: Hands,
        targets: Configs,
        until: Array | None = None,
        draws: NDArray[np.int64] | None = None,
    ) -> TrialRecords:
        """Make and count N trials, and return their records.

        If ``until`` is passed, fewer than N trials may be counted and returned (:meth:`trials`).
        ``codes`` are the hands, 0 (left) or 1 (right), shape ``(N, G)``. The caller checks
        arguments and budget, and holds ``lock``.
        """
        worlds = self._worlds(len(targets), draws)
        records = make_trials(self._compiled, codes, targets[:, :, None], worlds=worlds)
        count_trials(-len(targets) * self._of_run)
        if until is not None:
            better = trials_of(records, self.dof).rewards > until[: len(targets)]
            if better.any():
                count = int(better.argmax()) + 1
                records = TrialRecords._make(array[:count] for array in records)
        ticks, evaluations, _, corrections, failed = np.add.reduce(records.counts).tolist()
        self._count(records.rewards, ticks, evaluations, corrections, failed)
        return records

    def find_initial_hands(self, hands: tuple[Hand, ...] | None = None) -> str:
        """Find the hand sequence of the first trial, such as ``"RRRR"``.

        If the task names a sequence, that sequence is returned. If the task names a policy, the
        session makes a trial with only the corrective process, without motor noise, with each
        candidate sequence, and returns the sequence with the highest reward. The candidates are

        - ``"best-single-hand"``: the sequences of one hand;
        - ``"best-of-all"``: all sequences.

        The trials of this search are counted as ``initial_trials``. They are not included in the
        number of trials, and do not use up the budget. Their ticks and other counts are added to
        the counts of the method.

        Parameters
        ----------
        hands : tuple of {"left", "right"}, optional
            Hands among which a policy chooses; the task's by default.

        Raises
        ------
        NotApplicableError
            No sequence tried completes the task, or there are more than 4096 sequences to try.
        UndeclaredError
            ``Information.CORRECTIVE_PROCESS`` and ``REWARD_BY_TRIAL`` are not both declared.
        ValueError
            ``hands`` is empty, or names a hand that the task does not have.
        """
        self._use(Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL)
        sequence, counts = search_initial_hands(self._task, hands, model=self.model)
        count_trials(-counts.get("initial_trials", 0) * self._of_run)
        self._meter.add(**counts)
        return sequence

    def _count(
        self,
        rewards: array[int] | NDArray[np.int64],
        ticks: int,
        evaluations: int,
        corrections: int,
        failed: int,
    ) -> None:
        """Add trials to :attr:`rewards` and to the meter.

        ``rewards`` contains :data:`NO_REWARD` for each failed trial; all other arguments are sums
        over the trials.
        """
        made, meter = len(self._rewards), self._meter
        self._rewards.frombytes(rewards.tobytes())
        meter.trials += len(self._rewards) - made
        meter.movement_ticks += ticks
        meter.forward_kinematics += evaluations
        meter.corrections += corrections
        meter.failed_trials += failed

    @property
    def trials_made(self) -> int:
        """Number of trials made so far, without the search for the initial hands."""
        return self._meter.trials

    @property
    def trials_left(self) -> int | None:
        """Number of trials left in the budget; None without a budget."""
        return None if self._trial_budget is None else self._trial_budget - self._meter.trials

    # Copies of the counts so far.

    @property
    def meter(self) -> Meter:
        """A copy of the counts so far."""
        return replace(self._meter)

    @property
    def rewards(self) -> list[int | None]:
        """Total reward of each trial made, as a new list with None for failed trials.

        Trials of the search for the initial hands are not included.
        """
        return [None if reward == NO_REWARD else reward for reward in self._rewards]

    # Counts that the method adds itself.

    def spend(self, **counts: int) -> None:
        """Add counts, which are passed as keyword arguments, to counters of the meter.

        A method may add to the counters in :attr:`Meter.SOLVER`, and a method of this project to
        all counters in :attr:`Meter.COUNTS`. Raises ValueError for any other counter, for a count
        that is not an integer from 0 on, and for a sum above 2^63 - 1.
        """
        allowed = Meter.COUNTS if self._trusted else Meter.SOLVER
        for name, count in counts.items():
            if name not in allowed:
                raise ValueError(
                    f"counter {name!r} cannot be added to by this method; it may add to "
                    f"{', '.join(allowed)}"
                )
            left = MAX_COUNT - getattr(self._meter, name)
            check_limits(f"counter {name!r}", count, 0, left)
        self._meter.add(**counts)

    def building(self) -> AbstractContextManager[None]:
        """Return a context manager that adds the wall time of its block to ``build_s``."""
        return self._timing("build_s")

    def solving(self) -> AbstractContextManager[None]:
        """Return a context manager that adds the wall time of its block to ``solve_s``."""
        return self._timing("solve_s")

    @contextmanager
    def _timing(self, counter: str) -> Iterator[None]:
        clock = time.perf_counter()
        try:
            yield
        finally:
            total = getattr(self._meter, counter) + time.perf_counter() - clock
            setattr(self._meter, counter, total)

    # Only for this project's compiled methods.

    def reveal(self, *information: Information) -> Task:
        """Return the task itself to a method of this project.

        The method has to count its evaluations by :meth:`spend`. ``information`` contains each kind
        of information that the method uses; all of them are added to :attr:`used`. Raises
        UndeclaredError if the method does not belong to this project, if no information is passed,
        or if the method does not declare one of the kinds.
        """
        self._needs_trust("reveal")
        if not information:
            raise UndeclaredError(
                "information is empty; reveal needs each kind of information that the method uses"
            )
        self._use(*information)
        return self._task

    def beside(self, information: Iterable[Information]) -> Session:
        """Return a new session of the same run for another method of this project.

        Task, seed, model and budget are those of this session; trials are counted anew. Raises
        UndeclaredError if the method does not belong to this project.
        """
        self._needs_trust("beside")
        return Session(
            self._task,
            self.seed,
            information,
            model=self.model,
            trial_budget=self._trial_budget,
            trusted=True,
            of_run=self._of_run,
        )

    def record(self, rewards: Iterable[int | None], solve_s: float) -> None:
        """Record trials that a compiled method of this project made outside the session's calls.

        ``rewards`` contains an entry for each trial, None for a failed trial. The entries are added
        to :attr:`rewards`, and ``solve_s`` (in s) is added to the counter ``solve_s``. No other
        counter changes. Raises UndeclaredError if the method does not belong to this project.
        """
        self._needs_trust("record")
        self._rewards.extend(_pack_rewards(rewards))
        self._meter.solve_s += solve_s

    def _needs_trust(self, name: str) -> None:
        if not self._trusted:
            raise UndeclaredError(f"{name} is for this project's own compiled methods")
