"""Prioritised nullspace control by quadratic programs, one method a secondary objective.

A controller in closed loop with the robot's kinematics. At every control step the
:mod:`baselines.cascade` moves the hand straight towards the centre of the current goal
(level 1) and uses what redundancy that leaves for a secondary objective (level 2):

- none: the least joint rates;
- velocity: the joint rates of the step before, times the gain (smoothness);
- next goal: towards the posture in which the next goal is hit (coarticulation by
  concurrent subgoals of lower priority);
- preshaping: towards the posture in which the *other* hand hits the goal it is to hit
  next, which may lie several goals ahead.

The posture is the one nearest to the robot's own, as the cascade finds it: level 1 takes
the hand to that goal, level 2 back towards the robot. It is found at the start of each
goal and kept up by one step of the same kind at every control step. The robot is drawn to
it at ``gain`` times full speed.

The hand's rate is what a joint step of norm m can give it in that direction (the
manipulability ellipsoid, Yoshikawa 1985), so level 1 by itself never saturates a joint; the
sum of both levels is scaled back to m, which keeps its direction. Scoring counts length
along the path, so nothing is gained by steps shorter than m.

Gains tried, reward on ascending, descending, two-armed-1 (LRLR), two-armed-2 (RLRR):
GAINS_TABLE
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from baselines.cascade import DAMPING, Cascade, CascadeError, SolverName, cascade_for
from coartic import Movement, Task
from coartic.initial import changes_of_hand, too_many_sequences
from coartic.method import Information, Method, MethodError, Parameters, Result, Session
from coartic.movement import follow
from coartic.robot import HANDS, Array, Hand
from coartic.task import LETTERS, hands_of, letters_of

CITATION = (
    "Y. Nakamura, H. Hanafusa, T. Yoshikawa (1987). Task-priority based redundancy control of "
    "robot manipulators. International Journal of Robotics Research; as quadratic programs "
    "after O. Kanoun, F. Lamiraux, P.-B. Wieber (2011), IEEE Transactions on Robotics. "
)
CONCURRENT = (
    "K. Rohanimanesh, R. Platt, S. Mahadevan, R. Grupen (2004), Coarticulation in Markov "
    "decision processes, NIPS; B. Thibodeau, S. Hart, D. Karuppiah, J. Sweeney, O. Brock "
    "(2004), Cascaded filter approach to multi-objective control, ICRA."
)

_HIT_MARGIN = 1e-9  # the scorer's interpolation along the path rounds
_STALL_STEPS = 50  # without coming nearer by a tenth of a control step
_POSTURE_STEPS = 50  # at most, when a posture is first looked for
_POSTURE_STEP = 0.2  # longest of them, length unit and rad: longer ones end far off
_POSTURE_GAIN = 0.3  # of the way back to the robot in one of them: 1 goes on swinging
_POSTURE_TOLERANCE = 1e-3  # of such a step, length unit and rad


class NullspaceParameters(Parameters):
    """Parameters of the controller."""

    hands: Annotated[str, Field(pattern=r"^(every|nearest|[LR]+)$")] = "every"
    """``every``: all hand sequences are simulated and the shortest is kept; ``nearest``:
    at each goal the hand that is nearest when the last one is hit, without a secondary
    objective (the other one where it does not get there); or a sequence such as ``LRLR``."""
    solver: SolverName = "daqp"
    """Of both levels; ``python -m benchmarks.qp_solvers`` compares them."""
    period: Annotated[int, Field(ge=1, le=20)] = 1
    """Ticks from one control step to the next."""
    max_steps: Annotated[int, Field(ge=1)] = 5000
    """Control steps for one goal after which the controller gives up."""


class GainParameters(NullspaceParameters):
    """With the gain of the secondary objective."""

    gain: Annotated[float, Field(ge=0, le=10)] = 1.0


class Aim(NamedTuple):
    """What the secondary objective prepares: a hand, and the goal it is to hit."""

    hand: Hand
    goal: int  # 0-based
    arm_only: bool = False  # the hand's own joints, and not the base


@dataclass(frozen=True)
class Leg:
    """The way to one goal."""

    movement: Movement
    ticks: int
    q: Array
    """Where the scorer will stop, shape ``(dof,)``."""
    rates: Array
    """Of the last control step, shape ``(joints,)``."""


class StuckError(Exception):
    """The hand does not reach the goal."""


@dataclass
class Controller:
    """The control loop on one task; what it spends goes to the session."""

    session: Session
    task: Task
    cascade: Cascade
    parameters: Any
    keeps_velocity: bool = False
    moving: Array = field(init=False)
    """Indices of the joints that are not locked."""

    def __post_init__(self) -> None:
        locked = [{"x": 0, "y": 1}[coordinate] for coordinate in self.task.locked_base]
        self.moving = np.delete(np.arange(self.task.robot.dof), locked)

    def leg(self, q: Array, rates: Array, hand: Hand, goal: int, aim: Aim | None) -> Leg:
        """From ``q`` until ``hand`` is in goal ``goal`` (0-based).

        Raises StuckError where it does not get there, CascadeError where a solver fails.
        """
        length = self.session.model.step * self.parameters.period
        start = q
        waypoints: list[Array] = []
        posture = None if aim is None else self.posture(q, aim)
        nearest, since = np.inf, 0
        while True:
            error = self._error(q, hand, goal)
            distance = float(np.hypot(*error))
            if distance <= self.task.radius - _HIT_MARGIN:
                break
            if distance < nearest - 0.1 * length:
                nearest, since = distance, 0
            since += 1
            if since > _STALL_STEPS or len(waypoints) == self.parameters.max_steps:
                raise StuckError(
                    f"goal {goal + 1}: the {hand} hand comes no nearer than {distance:.3g} "
                    f"in {len(waypoints)} control steps"
                )
            preferred = None
            if self.keeps_velocity:
                preferred = self.parameters.gain * rates
            elif aim is not None and posture is not None:
                posture, _ = self._nearer_posture(posture, q, aim)
                preferred = self._towards(posture - q, aim, length)
            rates = self._rates(q, hand, error, distance / length, preferred)
            q = self._moved(q, length * rates)
            waypoints.append(q)
        path = np.array(waypoints or [start])
        found = follow(
            self.task.robot,
            start,
            path,
            hand,
            self.task.goals[goal],
            self.task.radius,
            model=self.session.model,
        )
        self.session.spend(forward_kinematics=found.evaluations)
        movement = Movement(goal + 1, hand, "path", path[-1], waypoints=path)
        return Leg(movement, found.ticks, found.q, rates)

    def posture(self, q: Array, aim: Aim) -> Array:
        """The posture near ``q`` in which a hand hits its goal, shape ``(dof,)``."""
        posture = q
        for _ in range(_POSTURE_STEPS):
            posture, change = self._nearer_posture(posture, q, aim)
            if change <= _POSTURE_TOLERANCE:
                break
        return posture

    def nearest_hands(self, q: Array, goal: int) -> list[Hand]:
        """The hands, the nearest to a goal first, the left one of equally near ones."""
        hands = [hand for hand in HANDS if hand in self.session.hands]
        return sorted(hands, key=lambda hand: float(np.hypot(*self._error(q, hand, goal))))

    def _rates(
        self, q: Array, hand: Hand, error: Array, most: float, preferred: Array | None
    ) -> Array:
        """Joint rates of one control step, of norm 1 at most.

        ``most`` is the rate at which the hand would be at the goal's centre.
        """
        jacobian = self._jacobian(q, hand)
        direction = error / np.hypot(*error)
        gram = jacobian @ jacobian.T + DAMPING**2 * np.eye(2)
        ellipsoid = float(direction @ np.linalg.solve(gram, direction)) ** -0.5
        rate = min(ellipsoid, most) * direction
        rates = self.cascade.solve(jacobian, rate, preferred)
        if np.hypot(*(jacobian @ rates - rate)) > 0.9 * np.hypot(*rate):
            # Singular in the very direction of the goal, such as a straight arm with its
            # goal behind: bend, and the next step finds a way.
            rates = np.zeros(len(self.moving))
            arm = self.session.joints(hand)
            bent = (self.moving >= arm.start) & (self.moving < arm.stop)
            rates[bent] = np.resize([1.0, -1.0], bent.sum()) / np.sqrt(bent.sum())
        rates /= max(1.0, float(np.linalg.norm(rates)))
        return rates

    def _nearer_posture(self, posture: Array, q: Array, aim: Aim) -> tuple[Array, float]:
        """One Gauss-Newton step to the posture nearest to ``q`` that hits a goal."""
        change = self.cascade.solve(
            self._jacobian(posture, aim.hand),
            self._error(posture, aim.hand, aim.goal),
            _POSTURE_GAIN * (q - posture)[self.moving],
        )
        length = float(np.linalg.norm(change))
        return self._moved(posture, change * min(1.0, _POSTURE_STEP / max(length, 1e-12))), length

    def _towards(self, way: Array, aim: Aim, length: float) -> Array:
        """Rates of norm ``gain`` along ``way``, of which an arm alone makes its share."""
        rates = self.parameters.gain * way / max(float(np.linalg.norm(way)), length)
        if aim.arm_only:
            arm = self.session.joints(aim.hand)
            share = np.zeros_like(rates)
            share[arm] = rates[arm]
            rates = share
        moving: Array = rates[self.moving]
        return moving

    def _moved(self, q: Array, change: Array) -> Array:
        moved = q.copy()
        moved[self.moving] += change
        return moved

    def _jacobian(self, q: Array, hand: Hand) -> Array:
        return self.session.jacobian(q, hand)[:, self.moving]

    def _error(self, q: Array, hand: Hand, goal: int) -> Array:
        error: Array = self.task.goal_array[goal] - self.session.forward_kinematics(q, hand)
        return error


class NullspaceQP(Method):
    """The controller without a secondary objective; base of those with one."""

    name = "nullspace-qp/none"
    title = "Prioritised nullspace QP"
    citation = CITATION
    told = frozenset(
        {
            Information.GOALS,
            Information.FORWARD_KINEMATICS,
            Information.JACOBIAN,
            Information.REWARD_FORMULA,
        }
    )
    stochastic = False
    Parameters = NullspaceParameters
    quick: ClassVar[dict[str, Any]] = {"hands": "nearest", "period": 20}
    keeps_velocity: ClassVar[bool] = False

    def why_not(self, task: Task) -> str | None:
        """Too many sequences to simulate, or a given one that does not fit."""
        hands = self.parameters.hands
        if hands == "every":
            return too_many_sequences(task, len(task.hands))
        if hands == "nearest":
            return None
        if len(hands) != len(task.goals):
            return f"hands {hands!r} names {len(hands)} hands for {len(task.goals)} goals"
        absent = sorted({LETTERS[letter] for letter in hands} - set(task.hands))
        return f"hands {hands!r}: the robot has no {absent[0]} hand" if absent else None

    def aim(self, hands: tuple[Hand, ...], goal: int) -> Aim | None:
        """What the secondary objective prepares on the way to ``goal`` (0-based)."""
        return None

    def cascade(self, joints: int) -> Cascade:
        """The solver of every control step."""
        return cascade_for(joints, self.parameters.solver)

    def solve(self, session: Session) -> Result:
        """Simulate the candidate hand sequences and hand over the best one's paths."""
        task = session.hand_over(Information.GOALS, Information.FORWARD_KINEMATICS)
        with session.building():
            cascade = self.cascade(task.robot.dof - len(task.locked_base))
        controller = Controller(session, task, cascade, self.parameters, self.keeps_velocity)
        iterations = cascade.iterations
        try:
            with session.solving():
                return self._solve(controller)
        except CascadeError as error:
            raise MethodError("solver-failed", str(error)) from None
        finally:
            session.spend(solver_iterations=cascade.iterations - iterations)

    def _solve(self, controller: Controller) -> Result:
        """Extend the sequence with the fewest ticks so far until one is complete.

        No other can be better then, since ticks only add up. Of equal ones the one with
        the fewest changes of hand is kept, then the first.
        """
        candidates = self._candidates(controller)
        heap: list[tuple[int, int, int, tuple[Leg, ...]]] = [
            (0, changes_of_hand(letters_of(hands)), index, ())
            for index, hands in enumerate(candidates)
        ]
        heapq.heapify(heap)
        solves = controller.cascade.solves
        legs: dict[Any, Leg | StuckError] = {}  # sequences share their beginnings
        stuck: list[str] = []
        while heap:
            ticks, changes, index, way = heapq.heappop(heap)
            hands, goal = candidates[index], len(way)
            if goal == len(hands):
                details = {
                    "sequences": len(candidates),
                    "stuck_sequences": len(stuck),
                    "simulated_movements": len(legs),
                    "solves": controller.cascade.solves - solves,
                }
                return Result(tuple(leg.movement for leg in way), details)
            plan = tuple((hands[g], self.aim(hands, g)) for g in range(goal + 1))
            if plan not in legs:
                legs[plan] = self._leg(controller, way, *plan[-1])
            leg = legs[plan]
            if isinstance(leg, StuckError):
                stuck.append(f"hands {letters_of(hands)}: {leg}")
            else:
                heapq.heappush(heap, (ticks + leg.ticks, changes, index, (*way, leg)))
        raise MethodError("infeasible", stuck[0])

    def _leg(
        self, controller: Controller, way: tuple[Leg, ...], hand: Hand, aim: Aim | None
    ) -> Leg | StuckError:
        q = way[-1].q if way else controller.session.q0
        rates = way[-1].rates if way else np.zeros(len(controller.moving))
        try:
            return controller.leg(q, rates, hand, len(way), aim)
        except StuckError as error:
            return error

    def _candidates(self, controller: Controller) -> list[tuple[Hand, ...]]:
        session, choice = controller.session, self.parameters.hands
        if choice == "every":
            ordered = [hand for hand in HANDS if hand in session.hands]
            return list(itertools.product(ordered, repeat=session.goals_count))
        if choice != "nearest":
            return [hands_of(choice)]
        way: tuple[Leg, ...] = ()
        for goal in range(session.goals_count):
            nearest = controller.nearest_hands(way[-1].q if way else session.q0, goal)
            legs = [self._leg(controller, way, nearest[0], None)]
            if isinstance(legs[0], StuckError):  # only then is it another hand's turn
                legs += [self._leg(controller, way, hand, None) for hand in nearest[1:]]
            reached = [leg for leg in legs if isinstance(leg, Leg)]
            if not reached:
                raise MethodError("infeasible", "; ".join(map(str, legs)))
            way = (*way, reached[0])
        return [tuple(leg.movement.hand for leg in way)]


class VelocityParameters(GainParameters):
    """The same, with a gain that forgets: with 1 no velocity is ever given up."""

    gain: Annotated[float, Field(ge=0, le=10)] = 0.5


class KeepVelocity(NullspaceQP):
    """Level 2 keeps the joint rates of the step before."""

    name = "nullspace-qp/velocity"
    title = "Prioritised nullspace QP, keeping velocity"
    told = NullspaceQP.told | {Information.SECONDARY_OBJECTIVES}
    secondary = ("smoothness: joint velocity is kept",)
    Parameters = VelocityParameters
    keeps_velocity = True


class NextGoal(NullspaceQP):
    """Level 2 approaches the posture in which the next goal is hit."""

    name = "nullspace-qp/next-goal"
    title = "Prioritised nullspace QP, next goal as lower priority"
    citation = CITATION + CONCURRENT
    told = NullspaceQP.told | {Information.SECONDARY_OBJECTIVES}
    secondary = ("posture at the next goal",)
    Parameters = GainParameters

    def aim(self, hands: tuple[Hand, ...], goal: int) -> Aim | None:
        """The next goal and its hand."""
        return Aim(hands[goal + 1], goal + 1) if goal + 1 < len(hands) else None


class Preshaping(NullspaceQP):
    """Level 2 prepares the other hand for the goal it hits next."""

    name = "nullspace-qp/preshaping"
    title = "Prioritised nullspace QP, preshaping of the other arm"
    citation = CITATION + CONCURRENT
    told = NullspaceQP.told | {Information.SECONDARY_OBJECTIVES}
    secondary = ("posture in which the other hand hits its next goal",)
    Parameters = GainParameters

    def aim(self, hands: tuple[Hand, ...], goal: int) -> Aim | None:
        """The first goal to come that the other hand hits."""
        later = range(goal + 1, len(hands))
        return next((Aim(hands[g], g, True) for g in later if hands[g] != hands[goal]), None)


METHODS: tuple[type[NullspaceQP], ...] = (NullspaceQP, KeepVelocity, NextGoal, Preshaping)
