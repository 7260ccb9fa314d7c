"""The session through which a method works: what it may use, and what it has spent."""

from __future__ import annotations

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
from numpy.typing import NDArray

from coartic.errors import CoarticError, SolutionError
from coartic.internal.limits import brief_value, check_limits, real_array
from coartic.internal.text import counted
from coartic.model import PAPER, MotionModel
from coartic.motion.movement import Correction, correct
from coartic.motion.solution import Execution, Movement, check_targets, execute_many
from coartic.motion.trial import (
    NO_REWARD,
    Accounts,
    CompiledTask,
    HandSequences,
    Trials,
    compiled_task,
    count_trials,
    hand_codes,
    make_trials,
    search_initial_hands,
    trials_of,
)
from coartic.robot import Array, Configs, Hand, Hands, Robot
from coartic.tasks.task import Task


class Information(StrEnum):
    """Information that a method can use, beyond what a session shows to every method."""

    GOALS = "goals"
    """Centres of the goals, and their radius."""
    FORWARD_KINEMATICS = "forward kinematics"
    """Place of a hand in a configuration."""
    JACOBIAN = "Jacobian"
    """Derivative of a hand's place by the joints, in a configuration."""
    CORRECTIVE_PROCESS = "corrective process"
    """A configuration that hits a goal, found by **A**; **A** uses goal and Jacobian."""
    REWARD_BY_TRIAL = "reward by trial"
    """The total reward of a trial, after making it."""
    REWARD_BY_SUBTASK = "reward by subtask"
    """Reward of each goal of a trial, after the trial is made."""
    KINEMATIC_MODEL = "kinematic model"
    """The kinematics as formulas, with all derivatives."""
    REWARD_FORMULA = "reward as a formula"
    """Fact that reward is lost in proportion to the joint-space path."""
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
    }
)
"""Information whose use a session sees. For the rest there is only the declaration."""


class UndeclaredError(CoarticError):
    """A method used information that it does not declare, or a call that is not for it."""


class BudgetError(CoarticError):
    """More trials were asked for than a budget has."""


class MethodError(CoarticError):
    """No solution was found: ``outcome`` is ``"infeasible"`` or ``"solver-failed"``."""

    def __init__(
        self,
        outcome: Literal["infeasible", "solver-failed"],
        reason: str,
        details: dict[str, Any] | None = None,
    ) -> None:
        super().__init__(reason)
        if outcome not in ("infeasible", "solver-failed"):
            raise ValueError(f"outcome {outcome!r}: it is 'infeasible' or 'solver-failed'")
        self.outcome = outcome
        self.details = details or {}


@dataclass
class Meter:
    """Counts of the trials, evaluations and seconds that a method spent."""

    trials: int = 0
    """Physical trials, failed trials included."""
    initial_trials: int = 0
    """Trials of the search for the initial hands, where the task names a policy in their place.
    They are not among ``trials``; their ticks, corrections and evaluations are counted below."""
    movement_ticks: int = 0
    """Control ticks of all trials."""
    forward_kinematics: int = 0
    """Forward-kinematics evaluations, one per configuration. Compiled kernels skip steps that
    cannot end a movement."""
    jacobians: int = 0
    """Jacobian evaluations; the corrective process makes one per iteration."""
    corrective_iterations: int = 0
    """Iterations of the corrective process."""
    corrections: int = 0
    """Corrective movements made."""
    failed_trials: int = 0
    """Trials that did not hit every goal."""
    gradients: int = 0
    """Gradient evaluations of a solver."""
    hessians: int = 0
    """Hessian evaluations of a solver."""
    solver_iterations: int = 0
    """Iterations of a solver."""
    build_s: float = 0.0
    """Wall time of setting problems up, which is paid once."""
    solve_s: float = 0.0
    """Wall time of solving them."""

    COUNTS: ClassVar[tuple[str, ...]]
    """Names of all counters, without the times."""
    SOLVER: ClassVar[tuple[str, ...]] = (
        "forward_kinematics",
        "jacobians",
        "corrective_iterations",
        "gradients",
        "hessians",
        "solver_iterations",
    )
    """Counters to which a method adds: the evaluations of its solver, or of a corrective process
    that it runs itself, with one Jacobian per iteration."""

    def add(self, **counts: int) -> None:
        """Add each count to the counter of that name, in place. Signs, sums and budgets are not
        checked."""
        for name, count in counts.items():
            setattr(self, name, getattr(self, name) + int(count))


Meter.COUNTS = tuple(name for name, value in vars(Meter()).items() if isinstance(value, int))
MOST_COUNT = 2**63 - 1
"""Largest count that can be stored."""


def _pack_rewards(rewards: Iterable[int | None]) -> array[int]:
    """Return rewards of trials as an array of integers of 8 bytes, :data:`NO_REWARD` for None."""
    return array("q", [NO_REWARD if reward is None else reward for reward in rewards])


class Session:
    """The task, the seed and the meter with which a method works.

    The declaration is enforced: a call that uses information of :data:`METERED` which
    ``information`` lacks raises UndeclaredError. Trials and evaluations are counted. This is no
    sandbox. ``trusted`` methods, this project's own, may also take the task to their compiled
    kernels and state the counts themselves. ``of_run`` marks the session of a run: trials that a
    process makes outside such sessions are counted apart
    (:func:`coartic.motion.trial.trials_outside`). ``trial_budget`` is the most trials, None for any
    number. Threads can share a session: they make trials one after the other, of one budget.
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
        self._task = task
        self._information = frozenset(information)
        self._used: set[Information] = set()
        self.seed = seed
        self.rng = np.random.default_rng(seed)
        self.model = model
        self._trusted = trusted
        self._of_run = of_run
        self._trial_budget = trial_budget
        self._meter = Meter()
        self._rewards = array("q")
        self.lock = RLock()
        """Held from the look at the budget until trials are counted."""

    # Open to every method: the robot, not the goals.

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
        """Hands that may hit goals, of ``"left"`` and ``"right"``."""
        return self._task.hands

    @property
    def initial_hands(self) -> str:
        """Hand sequence of trial 0, such as ``"RRRR"``, or name of a policy that finds one."""
        return self._task.initial_hands

    @property
    def locked_base(self) -> tuple[str, ...]:
        """Base coordinates that cannot move: ``"x"``, ``"y"``, both or none."""
        return self._task.locked_base

    @property
    def q0(self) -> Array:
        """Starting configuration, shape ``(dof,)``, length unit and rad, a copy."""
        return np.array(self._task.q0)

    @property
    def dof(self) -> int:
        """Number of degrees of freedom, the length of a configuration."""
        return self._task.robot.dof

    def joints(self, hand: Hand) -> slice:
        """Return the slice of a configuration that holds the joint angles, rad, of a hand's arm."""
        return self._task.robot.joints(hand)

    # These need a declaration.

    @property
    def goals(self) -> Array:
        """Goal centres, shape ``(G, 2)``, length unit, a copy. Raises UndeclaredError without
        ``Information.GOALS``."""
        self._use(Information.GOALS)
        return np.array(self._task.goal_array)

    @property
    def radius(self) -> float:
        """θ^g: radius of every goal, length unit. Raises UndeclaredError without
        ``Information.GOALS``."""
        self._use(Information.GOALS)
        return self._task.radius

    @property
    def robot(self) -> Robot:
        """The robot, with lengths of links and places of shoulders. Raises UndeclaredError without
        ``Information.KINEMATIC_MODEL``. The method itself counts evaluations (:meth:`spend`)."""
        self._use(Information.KINEMATIC_MODEL)
        return self._task.robot

    def symbolic_hand(self, q: Any, hand: Hand) -> Any:
        """Return the position of a hand, x and y, as a CasADi expression, 2 x 1, length unit, for a
        CasADi ``q``, dof x 1. Raises UndeclaredError without ``Information.KINEMATIC_MODEL``, and
        ValueError for another size or hand. The method itself counts evaluations (:meth:`spend`).
        """
        self._use(Information.KINEMATIC_MODEL)
        return self._task.robot.symbolic_hand(q, hand)

    @property
    def used(self) -> frozenset[Information]:
        """Set of the declared information that the session has seen used so far."""
        return frozenset(self._used)

    def check_solution(self, solution: Sequence[Movement]) -> None:
        """Note a use of the corrective process if a corrective movement of a solution has no
        target, for which that process is to look. Raises UndeclaredError if the method does not
        declare such a use, and SolutionError if the solution is no sequence."""
        if not isinstance(solution, Sequence):
            raise SolutionError(f"the solution is {brief_value(solution)}; needed is a list")
        for m in solution:
            if getattr(m, "kind", "") == "corrective" and m.target is None:
                self._use(Information.CORRECTIVE_PROCESS)

    def _use(self, *information: Information) -> None:
        for item in information:
            if item not in self._information:
                declared = ", ".join(sorted(self._information)) or "nothing"
                raise UndeclaredError(
                    f"the method used {item.value!r}, which it does not declare (declared: "
                    f"{declared})"
                )
        self._used.update(information)

    # Calls that are counted.

    def forward_kinematics(self, q: Any, hand: Hand) -> Array:
        """Return hand positions, ``(..., 2)``, length unit, for configurations ``(..., dof)``;
        count an evaluation for each. Raises UndeclaredError without
        ``Information.FORWARD_KINEMATICS``, and ValueError if ``q`` or ``hand`` does not fit."""
        self._use(Information.FORWARD_KINEMATICS)
        positions = self._task.robot.forward_kinematics(q, hand)
        self._meter.add(forward_kinematics=positions[..., 0].size)
        return positions

    def jacobian(self, q: Any, hand: Hand) -> Array:
        """Return derivatives of a hand's x and y by each entry of ``q``, ``(..., 2, dof)``, length
        unit per length unit (base) or rad, for configurations ``(..., dof)``; count a Jacobian for
        each. Raises UndeclaredError without ``Information.JACOBIAN``, and ValueError if ``q`` or
        ``hand`` does not fit the robot."""
        self._use(Information.JACOBIAN)
        jacobians = self._task.robot.jacobian(q, hand)
        self._meter.add(jacobians=jacobians[..., 0, 0].size)
        return jacobians

    def correct(self, q: Any, hand: Hand, goal: int) -> Correction:
        """Run the corrective process from ``q``, ``(dof,)``, with a hand for a goal (from 1); count
        its iterations, Jacobians and evaluations. Return the configuration found, or, without an
        error, the last iterate if the result is not ``converged``. No movement is made.

        Raises UndeclaredError without ``Information.CORRECTIVE_PROCESS``, and ValueError for a goal
        that the task lacks, and a ``q`` or hand that does not fit the robot."""
        self._use(Information.CORRECTIVE_PROCESS)
        check_limits("goal", goal, 1, self.goals_count)
        correction = correct(
            self._task.robot,
            q,
            hand,
            self._task.goals[goal - 1],
            locked_base=self._task.locked_base,
            model=self.model.for_radius(self._task.radius),
        )
        self._meter.add(
            corrective_iterations=correction.iterations,
            jacobians=correction.iterations,
            forward_kinematics=correction.iterations + 1,
        )
        return correction

    def trial(self, solution: Sequence[Movement]) -> Execution:
        """Make one physical trial of a solution; count the trial, its ticks, evaluations,
        iterations and corrections; return the execution.

        The corrective process acts where a goal is missed; its ticks count. Where this process is
        not declared, the execution has the movements as given and no configurations. Raises
        UndeclaredError without ``Information.REWARD_BY_TRIAL``, and without
        ``Information.CORRECTIVE_PROCESS`` for a corrective movement without a target; BudgetError
        if no trial is left; SolutionError for a solution that breaks the task's rules.
        """
        self._use(Information.REWARD_BY_TRIAL)
        self.check_solution(solution)
        with self.lock:
            self._affordable(1)
            (execution,) = execute_many(self._compiled, [solution])
            if isinstance(execution, Exception):
                raise execution
            count_trials(-self._of_run)
            self._count(
                _pack_rewards([execution.reward]),
                execution.ticks,
                execution.evaluations,
                execution.iterations,
                execution.corrections,
                not execution.completed,
            )
        if Information.CORRECTIVE_PROCESS in self._information:
            return execution
        return replace(
            execution, movements=tuple(solution), configurations=execution.configurations[:0]
        )

    def trials(self, hands: HandSequences, targets: Any, *, until: Any = None) -> Trials:
        """Make N physical trials at once.

        ``hands`` is one hand sequence for all (``"RRLR"``), or a sequence each. ``targets`` has
        shape ``(N, G, dof)``, length unit (base) and rad (joints): a joint whose target is NaN
        keeps its value, and for a goal without any target the corrective process acts alone, which
        has to be declared. It acts where a goal is missed, too; its ticks count. A trial with a
        joint's target beyond 100,000, which :meth:`trial` refuses, fails without a movement.

        Where the budget has fewer trials left, the first are made: results have a row for each
        trial made. With ``until``, rewards of shape ``(N,)``, trials end after the first whose
        reward exceeds its entry of ``until``; no later trial is counted or returned.

        Ticks and counts are the same as with :meth:`trial`, except that :meth:`trial` spends one or
        two more evaluations of forward kinematics per goal tried. Where the corrective process is
        not declared, ``corrections``, ``iterations``, ``targets`` and ``reached`` come back empty.
        Raises UndeclaredError without ``Information.REWARD_BY_TRIAL``, BudgetError for N > 0
        where no trial is left, ValueError for hands or arrays that do not fit.
        """
        self._use(Information.REWARD_BY_TRIAL)
        given = check_targets(self._task, targets)
        if np.isnan(given.min(initial=0.0)) and np.isnan(given).all(axis=2).any():
            self._use(Information.CORRECTIVE_PROCESS)
        codes = hand_codes(self._task, hands, len(given))
        until = None if until is None else real_array("until", until)
        if until is not None and until.shape != given.shape[:1]:
            raise ValueError(f"until has shape {until.shape}; needed is {given.shape[:1]}")
        with self.lock:
            left = self._affordable(len(given))
            accounts = self._make_trials(codes[:left], given[:left], until)
        trials = trials_of(accounts, self.dof)
        if Information.CORRECTIVE_PROCESS in self._information:
            return trials
        return trials._replace(
            corrections=trials.corrections[:0],
            iterations=trials.iterations[:0],
            targets=trials.targets[:0],
            reached=trials.reached[:0],
        )

    def _affordable(self, count: int) -> int:
        """Return how many of ``count`` trials the budget allows: ``count``, or the number left if
        that is less. Raises BudgetError if none is left and ``count`` is above 0."""
        left = self.trials_left
        if left is None:
            return count
        if left <= 0 < count:
            raise BudgetError(f"the budget of {counted(self._trial_budget or 0, 'trial')} is spent")
        return min(count, left)

    # The same for an objective, which returns what fits the task and the budget.

    @cached_property
    def _compiled(self) -> CompiledTask:
        return compiled_task(self._task, self.model)

    def hand_codes(self, hands: HandSequences, count: int) -> Hands:
        """Return the hands of ``count`` trials, 0 left or 1 right, shape ``(count, G)``, from one
        hand sequence for all or a sequence for each. Raises ValueError for hand sequences that do
        not fit the task or ``count``."""
        return hand_codes(self._task, hands, count)

    def _make_trials(self, codes: Hands, targets: Configs, until: Array | None = None) -> Accounts:
        """Make and count N trials, or fewer by the first N entries of ``until`` (:meth:`trials`),
        with hands 0 (left) or 1 (right), ``(N, G)``; return their accounts. The caller checks
        arguments and budget, and holds ``lock``."""
        accounts = make_trials(self._compiled, codes, targets[:, :, None])
        count_trials(-len(targets) * self._of_run)
        if until is not None:
            better = trials_of(accounts, self.dof).rewards > until[: len(targets)]
            if better.any():
                made = int(better.argmax()) + 1
                accounts = Accounts._make(each[:made] for each in accounts)
        self._count(accounts.rewards, *np.add.reduce(accounts.counts).tolist())
        return accounts

    def find_initial_hands(self, hands: tuple[Hand, ...] | None = None) -> str:
        """Return the hand sequence of the first trial, such as ``"RRRR"``: the sequence that the
        task names, or, if the task names a policy, the sequence of ``hands`` (by default the
        task's) with which the corrective process alone gets the highest reward, among sequences of
        one hand (``"best-single-hand"``) or all (``"best-of-all"``).

        Trials of this search are counted as ``initial_trials``, not among the method's trials or in
        its budget; their ticks and other counts are added to the method's. Raises
        NotApplicableError if a policy finds no such sequence that completes the task, or has more
        than 4096 to try; UndeclaredError unless ``Information.CORRECTIVE_PROCESS`` and
        ``REWARD_BY_TRIAL`` are both declared; ValueError for ``hands`` that are empty or not the
        task's.
        """
        self._use(Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL)
        chosen, spent = search_initial_hands(self._task, hands, model=self.model)
        count_trials(-spent.get("initial_trials", 0) * self._of_run)
        self._meter.add(**spent)
        return chosen

    def _count(
        self,
        rewards: array[int] | NDArray[np.int64],
        ticks: int,
        evaluations: int,
        iterations: int,
        corrections: int,
        failed: int,
    ) -> None:
        """Add trials with these rewards (:data:`NO_REWARD` where a trial failed) to
        :attr:`rewards`, and to the meter their number and their sums of ticks, evaluations,
        iterations, corrections and failures; an iteration is a Jacobian, too."""
        before, meter = len(self._rewards), self._meter
        self._rewards.frombytes(rewards.tobytes())
        meter.trials += len(self._rewards) - before
        meter.movement_ticks += ticks
        meter.forward_kinematics += evaluations
        meter.corrective_iterations += iterations
        meter.jacobians += iterations
        meter.corrections += corrections
        meter.failed_trials += failed

    @property
    def trials_made(self) -> int:
        """Number of trials made so far, without trials of the search for the initial hands."""
        return self._meter.trials

    @property
    def trials_left(self) -> int | None:
        """Number of trials left in the budget; None without a budget."""
        return None if self._trial_budget is None else self._trial_budget - self._meter.trials

    # Copies of the counts so far.

    @property
    def meter(self) -> Meter:
        """The counts so far, a copy."""
        return replace(self._meter)

    @property
    def rewards(self) -> list[int | None]:
        """Total reward of each trial made, without trials of the search for the initial hands, in
        order, a new list; None where a trial failed."""
        return [None if reward == NO_REWARD else reward for reward in self._rewards]

    # Counts that the method adds itself.

    def spend(self, **counts: int) -> None:
        """Add counts to the counters of these names. A method may name counters of
        :attr:`Meter.SOLVER`, a trusted method all of :attr:`Meter.COUNTS`.

        Raises ValueError for another counter, for a count that is no whole number from 0, and for a
        sum beyond 2^63 - 1.
        """
        allowed = Meter.COUNTS if self._trusted else Meter.SOLVER
        for name, count in counts.items():
            if name not in allowed:
                raise ValueError(f"a method cannot set counter {name!r}, only {', '.join(allowed)}")
            left = MOST_COUNT - getattr(self._meter, name)
            check_limits(f"counter {name!r}", count, 0, left)
        self._meter.add(**counts)

    def building(self) -> AbstractContextManager[None]:
        """Return a context that adds the wall time of its block, s, to counter ``build_s``."""
        return self._timing("build_s")

    def solving(self) -> AbstractContextManager[None]:
        """Return a context that adds the wall time of its block, s, to counter ``solve_s``."""
        return self._timing("solve_s")

    @contextmanager
    def _timing(self, counter: str) -> Iterator[None]:
        clock = time.perf_counter()
        try:
            yield
        finally:
            spent = getattr(self._meter, counter) + time.perf_counter() - clock
            setattr(self._meter, counter, spent)

    # The back door of this project's compiled methods.

    def reveal(self, *information: Information) -> Task:
        """Return the task itself, for methods of this project that count by themselves, with
        :meth:`spend`. Note ``information``, at least one item, as used. Raises UndeclaredError
        for any other method, without an item, and for an item that the method does not declare.
        """
        self._needs_trust("reveal")
        if not information:
            raise UndeclaredError("reveal without saying what is used of the task")
        self._use(*information)
        return self._task

    def record(self, rewards: Iterable[int | None], solve_s: float) -> None:
        """Add rewards of trials that a compiled method of this project made (None for a failed
        trial) to :attr:`rewards`, and ``solve_s``, the time that the method took, s, to the counter
        of this name; no other count is changed. Raises UndeclaredError for any other method."""
        self._needs_trust("record")
        self._rewards.extend(_pack_rewards(rewards))
        self._meter.solve_s += solve_s

    def _needs_trust(self, name: str) -> None:
        if not self._trusted:
            raise UndeclaredError(f"{name} is for this project's own compiled methods")
