"""Controllers of a hand by prioritised quadratic programmes, and the search over hand sequences.

A controller takes control steps of ``period`` ticks until the hand is in its goal. Each step is the
answer of the cascade (:mod:`coartic.baselines.cascade`): level 1 is for the hand, level 2 for what
the joints prefer. Every hand sequence is simulated as far as it can still be the best.
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
from coartic.motion.initial_hands import changes_of_hand
from coartic.motion.movement import follow
from coartic.robot import HANDS, Array, Hand
from coartic.tasks.task import beyond_reach, letters_of

_HIT_MARGIN = 1e-9  # the scorer's interpolation along the path rounds
_STALL_STEPS = 50  # without coming nearer by a tenth of a control step
_BINDS = 1e-3  # least difference of joint changes by which a level binds, in control steps


CITATION_AHEAD = (
    " With the next goal as lower priority: K. Rohanimanesh, R. Platt, S. Mahadevan, R. Grupen "
    "(2004), Coarticulation in Markov decision processes, NIPS; B. Thibodeau, S. Hart, D. "
    "Karuppiah, J. Sweeney, O. Brock (2004), Cascaded filter approach to multi-objective "
    "control, ICRA."
)


class Aim(NamedTuple):
    """A goal and the hand that is to hit it."""

    hand: Hand
    goal: int  # 0-based


class Leg(NamedTuple):
    """A simulated path to a goal, from the start or from the goal before."""

    movement: Movement
    """Movement of kind ``path`` to the goal."""
    ticks: int
    """Control ticks of the movement."""
    q: Array
    """Configuration in which the goal is hit, shape ``(dof,)``."""
    memory: Any
    """Memory of the controller after the last control step, with which the next leg goes on."""
    steps: NDArray[np.int64]
    """Numbers of control steps, shape ``(3,)``: of all, of steps with changes other than preferred
    (level 1 binds), and of steps with other changes than level 1 alone makes (level 2 binds)."""


class _StuckError(Exception):
    """Error of a hand that does not reach its goal."""


@dataclass
class Controller(ABC):
    """Control loop on a task; the session counts evaluations and iterations. Changes ``(joints,)``
    are of all entries of a configuration that are not locked."""

    session: Session
    task: Task
    period: int
    """Most ticks of a control step."""
    solves: int = 0
    """Quadratic programmes solved so far."""

    def __post_init__(self) -> None:
        locked = ["xy".index(coordinate) for coordinate in self.task.locked_base]
        self.moving = np.delete(np.arange(self.task.robot.dof), locked)
        """Indices of the joints in a configuration, shape ``(joints,)``."""
        self.length = self.session.model.step * self.period
        """Largest joint-space length of a control step."""

    @abstractmethod
    def begin(self, q: Array, aims: tuple[Aim, ...], memory: Any) -> Any:
        """Return the memory (data that the controller keeps from step to step) with which it begins
        a leg, the movement from configuration ``q``, ``(dof,)``, to the goal of the first of
        ``aims`` (hand and goal); ``memory`` is the memory at the end of the leg before, None for
        the first leg."""

    @abstractmethod
    def step(
        self, q: Array, aims: tuple[Aim, ...], memory: Any, first: bool
    ) -> tuple[Solution, Array, Any]:
        """Return three things for a control step from ``q``, ``(dof,)``: the solution of the
        cascade; the changes that the joints prefer, ``(joints,)``; the memory after the step.
        Changes are of the joints that are not locked, in lengths of a control step. ``aims``: the
        goal of the leg with its hand, then goals ahead. ``first``: True for the first step of a
        leg."""

    def leg(self, before: Leg | None, aims: tuple[Aim, ...]) -> Leg:
        """Simulate control steps from the end of the leg ``before``, or, for None, from the task's
        start, until the hand of the first of ``aims`` (hand and goal) is in its goal; return this
        leg. Further aims are the goals ahead. Raises _StuckError if the hand does not reach its
        goal, and MethodError if the solver fails."""
        (hand, goal), name = aims[0], f"goal {aims[0].goal + 1}: the {aims[0].hand} hand"
        model, radius = self.session.model, self.task.radius
        _, tolerance = model.tolerances(radius)
        short = beyond_reach(self.task, hand, self.task.goals[goal], tolerance)
        if short > radius:
            raise _StuckError(
                f"{name} ends {short:.3g} short of it with the base "
                f"locked in {' and '.join(self.task.locked_base)}"
            )
        q = start = self.session.q0 if before is None else before.q
        waypoints: list[Array] = []
        memory = self.begin(q, aims, None if before is None else before.memory)
        nearest, since, steps = np.inf, 0, np.zeros(3, dtype=np.int64)
        while (distance := float(np.hypot(*self.error(q, aims[0])))) > radius - _HIT_MARGIN:
            if distance < nearest - 0.1 * self.length:
                nearest, since = distance, 0
            since += 1
            if since > _STALL_STEPS:
                raise _StuckError(
                    f"{name} is still {distance:.3g} from its centre "
                    f"after {len(waypoints)} control steps and comes no nearer"
                )
            solution, preferred, memory = self.step(q, aims, memory, not waypoints)
            rates = solution.changes
            binds = [np.abs(rates - other).max() > _BINDS for other in (preferred, solution.first)]
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
        """Return the joint changes of both levels of the cascade (:func:`solve_cascade`): changes x
        with A x >= b (``rows`` A, ``(m, joints)``; ``least`` b, ``(m,)``) as nearly as damping
        allows, and the changes nearest to ``preferred``, ``(joints,)``, that are as good. Count two
        programmes in ``solves``, and the iterations in the session. Raises MethodError if the
        solver fails."""
        solution = solve_cascade(rows, least, preferred)
        self.solves += 2
        self.session.spend(solver_iterations=solution.iterations)
        return solution

    def error(self, q: Array, aim: Aim) -> Array:
        """Return the vector from the hand of an aim (hand and goal) in configuration ``q`` to the
        goal's centre, shape ``(2,)``, length unit; the session counts an evaluation."""
        return np.asarray(
            self.task.goal_array[aim.goal] - self.session.forward_kinematics(q, aim.hand)
        )

    def add(self, q: Array, change: Array) -> Array:
        """Return a copy of configuration ``q``, ``(dof,)``, with ``change`` added to its entries
        that are not locked; ``change`` has a number for each of these alone, shape ``(joints,)``,
        length unit and rad."""
        result = q.copy()
        result[self.moving] += change
        return result


class ControlParameters(Parameters):
    """Parameters of a controller."""

    period: Annotated[int, Field(ge=1, le=20)] = 5
    """Most ticks of a control step."""


class Control(Method):
    """A controller under every hand sequence; base of the methods that control a hand."""

    citation = (
        "Y. Nakamura, H. Hanafusa, T. Yoshikawa (1987). Task-priority based redundancy control of "
        "robot manipulators. International Journal of Robotics Research; as quadratic programs "
        "after O. Kanoun, F. Lamiraux, P.-B. Wieber (2011), IEEE Transactions on Robotics."
    )
    information = KINEMATICS | {Information.REWARD_FORMULA}
    stochastic = False
    Parameters = ControlParameters
    quick: ClassVar[dict[str, Any]] = {"period": 20}
    controller: ClassVar[type[Controller]]
    goals_ahead: ClassVar[int] = 0
    """Goals after the current one that the controller takes into account."""

    def why_not(self, task: Outline) -> str | None:
        """Return a sentence that a task has more than 4096 hand sequences; else None."""
        return task.too_many_sequences

    def solve(self, session: Session) -> Result:
        """Simulate the control of all hand sequences as far as they can be best; return the paths,
        a movement for each goal, of the sequence that hits every goal in the fewest ticks, with
        counts of the search as details; of equal sequences the sequence with the fewest changes of
        hand, then the first. The sequence with the fewest ticks so far is extended by the path to
        its next goal until such a sequence is complete. Raises MethodError if the hand gets stuck
        in all sequences, or the solver fails."""
        task = session.reveal(Information.GOALS, Information.FORWARD_KINEMATICS)
        controller = self.controller(session, task, self.parameters.period)
        ordered = [hand for hand in HANDS if hand in task.hands]
        candidates = list(itertools.product(ordered, repeat=len(task.goals)))
        heap: list[tuple[int, int, int, tuple[Leg, ...]]] = [
            (0, changes_of_hand(letters_of(hands)), index, ())
            for index, hands in enumerate(candidates)
        ]
        heapq.heapify(heap)
        legs: dict[Any, Leg | _StuckError] = {}  # sequences share their beginnings
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
