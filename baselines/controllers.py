"""Controllers of a hand by prioritised quadratic programmes, and the search over hand sequences.

A controller makes control steps of at most ``period`` ticks until the hand is in its goal. The
cascade (:mod:`coartic.baselines.cascade`) computes each control step: level 1 moves the hand, and
level 2 chooses among the joint changes that move the hand in this way.

Best-first search over prefixes of hand sequences finds the hand sequence with the fewest ticks. The
key of the priority queue is the number of ticks of a prefix: the prefix with the fewest ticks is
extended next.
"""

from __future__ import annotations

import heapq
import itertools
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from coartic import Movement, Task
from coartic.baselines.cascade import Solution, solve_cascade
from coartic.baselines.posture_graph import KINEMATICS
from coartic.method import Information, Method, MethodError, Outline, Parameters, Result, Session
from coartic.motion.doors import follow
from coartic.motion.initial_hands import changes_of_hand
from coartic.robot import HANDS, Array, Hand
from coartic.tasks.task import beyond_reach, letters_of

_HIT_MARGIN = 1e-9  # in length units: the scorer interpolates along the path, and rounds
_STALL_STEPS = 50  # a hand that comes less than a tenth of a step nearer in so many steps is stuck
_BINDS = 1e-3  # difference of joint changes above which a level binds, in lengths of a control step


class Aim(NamedTuple):
    """A goal and the hand that is to hit it."""

    hand: Hand
    goal: int  # 0-based


class Leg(NamedTuple):
    """A simulated movement to a goal, which begins at the end of the previous leg.

    The first leg begins at the start of the task.
    """

    movement: Movement
    """Movement of kind ``path`` to the goal."""
    ticks: int
    """Control ticks of the movement."""
    q: Array
    """Configuration in which the hand hits the goal, shape ``(dof,)``."""
    memory: Any
    """Memory of the controller after the last control step (:meth:`Controller.begin`)."""
    steps: NDArray[np.int64]
    """Numbers of control steps, shape ``(3,)``:

    - all steps;
    - steps in which level 1 binds: the changes of level 2 differ from the preferred changes;
    - steps in which level 2 binds: the changes of level 2 differ from the changes of level 1.
    """


class _StuckError(Exception):
    """A hand cannot reach its goal, or no longer comes nearer to its goal."""


@dataclass
class Controller(ABC):
    """Base class of controllers, which move a simulated robot to goals.

    In this class *joints* are all entries of a configuration that are not locked: base coordinates
    and joint angles. The session counts the evaluations of the kinematics and the iterations of the
    solver.
    """

    session: Session
    task: Task
    period: int
    """Largest number of ticks of a control step."""
    solves: int = 0
    """Number of quadratic programmes solved so far."""

    def __post_init__(self) -> None:
        locked = ["xy".index(coordinate) for coordinate in self.task.locked_base]
        self.moving = np.delete(np.arange(self.task.robot.dof), locked)
        """Indices of the joints in a configuration, shape ``(joints,)``."""
        self.length = self.session.model.step * self.period
        """Largest joint-space length of a control step."""

    @abstractmethod
    def begin(self, q: Array, aims: tuple[Aim, ...], memory: Any) -> Any:
        """Return the memory with which the controller begins a leg.

        The memory is any data that the controller passes from one control step to the next, such as
        postures that it has found.

        Parameters
        ----------
        q : ndarray, shape (dof,)
            Configuration at the beginning of the leg.
        aims : tuple of Aim
            Goal and hand of the leg, then the goals ahead with their hands.
        memory : object
            Memory at the end of the previous leg; None for the first leg.
        """

    @abstractmethod
    def step(
        self, q: Array, aims: tuple[Aim, ...], memory: Any, first: bool
    ) -> tuple[Solution, Array, Any]:
        """Compute a control step.

        Parameters
        ----------
        q : ndarray, shape (dof,)
            Configuration before the step.
        aims : tuple of Aim
            Goal and hand of the leg, then the goals ahead with their hands.
        memory : object
            Memory before the step.
        first : bool
            True for the first step of a leg.

        Returns
        -------
        Solution
            Solution of the cascade. The unit of its changes is ``self.length``, the largest
            joint-space length of a control step.
        ndarray, shape (joints,)
            Preferred changes of the joints, in the same unit.
        object
            Memory after the step.
        """

    def leg(self, before: Leg | None, aims: tuple[Aim, ...]) -> Leg:
        """Simulate control steps until the hand is in its goal.

        Parameters
        ----------
        before : Leg or None
            The previous leg. The simulation begins at the end of that leg; for None it begins at
            the start of the task.
        aims : tuple of Aim
            Goal and hand of the leg, then the goals ahead with their hands.

        Returns
        -------
        Leg
            The movement to the goal, its ticks, and where it ends.

        Raises
        ------
        _StuckError
            The goal is out of reach, or in 50 control steps the hand comes less than a tenth of the
            length of a control step nearer to the goal.
        MethodError
            The solver fails.
        """
        (hand, goal), name = aims[0], f"goal {aims[0].goal + 1}: the {aims[0].hand} hand"
        model, radius = self.session.model.without_noise(), self.task.radius
        _, tolerance = model.tolerances(radius)
        short = beyond_reach(self.task, hand, self.task.goals[goal], tolerance)
        if short > radius:
            raise _StuckError(
                f"{name} ends {short:.3g} length units short of the goal with the base locked in "
                f"{' and '.join(self.task.locked_base)}"
            )
        q = start = self.session.q0 if before is None else before.q
        waypoints: list[Array] = []
        memory = self.begin(q, aims, None if before is None else before.memory)
        nearest, stalled_steps, steps = np.inf, 0, np.zeros(3, dtype=np.int64)
        while (distance := float(np.hypot(*self.error(q, aims[0])))) > radius - _HIT_MARGIN:
            if distance < nearest - 0.1 * self.length:
                nearest, stalled_steps = distance, 0
            stalled_steps += 1
            if stalled_steps > _STALL_STEPS:
                raise _StuckError(
                    f"{name} is stuck {distance:.3g} length units from the goal's centre after "
                    f"{len(waypoints)} control steps"
                )
            solution, preferred, memory = self.step(q, aims, memory, not waypoints)
            rates = solution.changes
            alternatives = preferred, solution.level_1
            binds = [np.abs(rates - changes).max() > _BINDS for changes in alternatives]
            steps += 1, *binds
            q = self.add(q, self.length * rates / max(1.0, float(np.linalg.norm(rates))))
            waypoints.append(q)
        path = np.array(waypoints or [start])
        followed = follow(
            self.task.robot, start, path, hand, self.task.goals[goal], radius, model=model
        )
        self.session.spend(forward_kinematics=followed.evaluations)
        movement = Movement(goal + 1, hand, "path", path[-1], waypoints=path)
        return Leg(movement, followed.ticks, followed.q, memory, steps)

    def solve(self, rows: Array, least: Array, preferred: Array) -> Solution:
        """Solve the cascade, and count the programmes and the iterations of the solver.

        Parameters, returned values and errors are those of :func:`.solve_cascade`.
        """
        solution = solve_cascade(rows, least, preferred)
        self.solves += 2
        self.session.spend(solver_iterations=solution.iterations)
        return solution

    def error(self, q: Array, aim: Aim) -> Array:
        """Return the vector from a hand to the centre of its goal.

        The session counts one evaluation of the forward kinematics.

        Parameters
        ----------
        q : ndarray, shape (dof,)
            Configuration of the robot.
        aim : Aim
            Hand and goal.

        Returns
        -------
        ndarray, shape (2,)
            Vector, in length units.
        """
        return np.asarray(
            self.task.goal_array[aim.goal] - self.session.forward_kinematics(q, aim.hand)
        )

    def add(self, q: Array, change: Array) -> Array:
        """Return a copy of a configuration with a change of its joints added.

        ``q`` and the result have shape ``(dof,)``, ``change`` has shape ``(joints,)``; all are in
        length units (base) and rad (angles).
        """
        result = q.copy()
        result[self.moving] += change
        return result


class ControlParameters(Parameters):
    """Parameters of a controller."""

    period: Annotated[int, Field(ge=1, le=20)] = 5
    """Largest number of ticks of a control step."""


class Control(Method):
    """Base class of methods that simulate a controller, and search for the best hand sequence."""

    information = KINEMATICS | {Information.REWARD_FORMULA}
    stochastic = False
    Parameters = ControlParameters
    quick: ClassVar[dict[str, Any]] = {"period": 20}
    controller: ClassVar[type[Controller]]
    goals_ahead: ClassVar[int] = 0
    """Number of goals after the current goal that the controller takes into account."""

    def inapplicable_reason(self, task: Outline) -> str | None:
        """Return a sentence if a task has more than 4096 hand sequences; else None."""
        return task.too_many_sequences

    def solve(self, session: Session) -> Result:
        """Find the hand sequence with which the controller takes the fewest ticks.

        The search is best-first over prefixes of hand sequences, with a priority queue. The prefix
        with the fewest ticks is extended by the movement to the next goal, until the prefix with
        the fewest ticks is a complete sequence. At a tie, the hand sequence with fewer changes of
        hand comes first, then the first one in alphabetical order. The movement to a goal is
        simulated once for all sequences that have the same hands up to this goal and at the next
        :attr:`goals_ahead` goals.

        The result contains a movement for each goal. The details contain

        - ``sequences``: number of hand sequences;
        - ``stuck_sequences``: number of sequences in which a hand got stuck during the search;
        - ``simulated_movements``: number of movements that were simulated, or found to be out of
          reach;
        - ``solves``: number of quadratic programmes solved;
        - ``control_steps``: number of control steps of the solution;
        - ``level_1_binds``, ``level_2_binds``: numbers of these control steps in which level 1 and
          level 2 bind (:attr:`Leg.steps`).

        Raises MethodError if a hand gets stuck in all sequences, or if the solver fails.
        """
        task = session.reveal(Information.GOALS, Information.FORWARD_KINEMATICS)
        controller = self.controller(session, task, self.parameters.period)
        ordered = [hand for hand in HANDS if hand in task.hands]
        candidates = list(itertools.product(ordered, repeat=len(task.goals)))
        heap: list[tuple[int, int, int, tuple[Leg, ...]]] = [
            (0, changes_of_hand(letters_of(hands)), index, ())
            for index, hands in enumerate(candidates)
        ]
        heapq.heapify(heap)
        legs: dict[Any, Leg | _StuckError] = {}  # sequences with a common beginning share legs
        stuck: list[_StuckError] = []
        with session.solving():
            while heap:
                ticks, changes, index, path = heapq.heappop(heap)
                hands, goal = candidates[index], len(path)
                if goal == len(hands):
                    steps, level_1, level_2 = np.sum([leg.steps for leg in path], axis=0).tolist()
                    details = {
                        "sequences": len(candidates),
                        "stuck_sequences": len(stuck),
                        "simulated_movements": len(legs),
                        "solves": controller.solves,
                        "control_steps": steps,
                        "level_1_binds": level_1,
                        "level_2_binds": level_2,
                    }
                    return Result(tuple(leg.movement for leg in path), details)
                aims = tuple(Aim(hand, g) for g, hand in enumerate(hands))
                plan = tuple(aims[g : g + 1 + self.goals_ahead] for g in range(goal + 1))
                if plan not in legs:
                    try:
                        legs[plan] = controller.leg(path[-1] if path else None, plan[-1])
                    except _StuckError as error:
                        legs[plan] = error
                leg = legs[plan]
                if isinstance(leg, _StuckError):
                    stuck.append(leg)
                else:
                    heapq.heappush(heap, (ticks + leg.ticks, changes, index, (*path, leg)))
        raise MethodError("infeasible", str(stuck[0]))
