"""Prioritised nullspace control by quadratic programs, one method a secondary objective.

It keeps a **posture** for the current goal and for each of those that it looks ahead to, and
both what they are and how the robot gets there are answers of one cascade
(:mod:`coartic.baselines.cascade`): level 1 is a disc that a hand has to be in, level 2 what the
joints would rather do.

- A posture has its hand in its goal's disc, anywhere in it; of all such postures it is the one
  that makes the way from posture to posture shortest in the metric of the reward, which is
  Euclidean in joint space.
- A control step has the hand in a disc about the goal that shrinks from where the hand is
  towards the goal's own; the joints would rather go straight to the posture. So the hand comes
  nearer all the time, on whatever path suits the joints.

A disc is taken as the regular polygon within it, so that it is linear in the hand's position,
and the hand's position as linear in the change of the joints. Postures are found once for each
goal to come and kept up by a step of the same kind at every control step.

Of all postures that hit the current goal the objective decides which one it is:

- none: the nearest to where the robot stands when the last goal is hit;
- velocity: the same, and a share of the joint rates of the step before (smoothness);
- next goal: the one from which the way on to the next goal's posture is shortest, too
  (coarticulation by concurrent subgoals of lower priority). The next goal's posture is itself
  chosen with a view to the goals after it, as far as the ``horizon`` reaches;
- preshaping: the nearest, but for the other arm, which heeds the posture in which it hits the
  goal it is to hit next; that may lie several goals ahead.

Ways are measured as the reward measures them, Euclidean in joint space, and those to come have
the weight ``gain`` relative to the one before them.

Tuned on thirty development instances (``d000`` to ``d009`` of families one-armed, two-armed and
aligned), and on nothing else: 12 settings of the controller as it is, tabled here, and before
that some 50 of a prototype (other first postures, 8 to 24 faces, control steps of 1 to 10 ticks,
posture steps of 0.05 to 0.2 and gains of 0.1 to 0.7 for them, horizons, weights). Mean gap to
``optimum/dynamic-programming`` of ``next-goal``, one setting changed at a time, * the default:

=========================  ====================================================================
hand comes nearer, at      0: 2.2 %, 0.03*: 2.2 %, 0.1: 2.3 %, 0.3: 2.6 %, 0.6: 3.4 %,
this share of even pace    1: 6.9 %
``gain`` (share at 0.1)    0.5: 6.9 %, 0.7: 4.0 %, 0.85: 2.7 %, 1*: 2.3 %, 1.2: 2.6 %
``horizon`` (same)         none: 20.1 %, 1: 5.6 %, 2*: 2.3 %, 3: 2.2 %; a prototype: 2.0 % for all
=========================  ====================================================================

On the same instances velocity (inertia 0.5) has 20.5 %, preshaping, of those with two hands,
13.4 %, and the corrective process alone with its best hand sequence 24.8 %. A controller whose
level 1 moves the hand straight to the goal's centre, with the least rates at every step, had
43.6 % with the next goal as level 2 and 60 % without one.

What remains is local: postures are found by descent from where the robot is, and another branch
of the inverse kinematics may be far shorter (35 % on the worst of the thirty). First postures
sought from a straight arm, too, mended one instance and spoiled others as often. Smoothness is
no part of the reward: keeping velocity does not gain any.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from coartic import Movement, Task
from coartic.baselines.cascade import Cascade, CascadeError
from coartic.method import Information, Method, MethodError, Parameters, Result, Session
from coartic.motion.initial import changes_of_hand, too_many_sequences
from coartic.motion.movement import follow
from coartic.robot import HANDS, Array, Hand, directions
from coartic.tasks.task import LETTERS, MOST_GOALS, beyond_reach, hands_of, letters_of

FACES = 16
"""Sides of the polygon that stands for a goal's disc; it leaves out 2 % of the radius at most."""

_ANGLES = 2 * np.pi * np.arange(FACES) / FACES
_NORMALS = directions(_ANGLES)
_INSET = float(directions(np.pi / FACES)[0])
_MARGIN = 1e-4  # length unit: the polygon is approached without end, the disc is entered
_HIT_MARGIN = 1e-9  # the scorer's interpolation along the path rounds
_STALL_STEPS = 50  # without coming nearer by a tenth of a control step
_CLOSING = 0.03  # of the even pace at which the hand has to come nearer
_POSTURE_STEPS = 400  # at most, when a posture is first looked for
_POSTURE_STEP = 0.1  # longest of them, length unit and rad: longer ones end far off
_POSTURE_GAIN = 0.5  # of the way to the preferred one in one of them: 1 may swing
_POSTURE_TOLERANCE = 1e-3  # of such a step, length unit and rad
_SHORTEST = 0.02  # way whose share still counts, length unit and rad


class Aim(NamedTuple):
    """A goal and the hand that is to hit it."""

    hand: Hand
    goal: int  # 0-based
    arm_only: bool = False
    """Whether postures for the goals before this one heed it with this hand's arm alone."""


@dataclass(frozen=True)
class Leg:
    """The way to one goal."""

    movement: Movement
    ticks: int
    q: Array
    """Where the scorer will stop, shape ``(dof,)``."""
    rates: Array
    """Of the last control step, shape ``(joints,)``."""
    postures: dict[Aim, Array]
    """What is kept of the goals looked ahead to."""


class StuckError(Exception):
    """The hand does not reach the goal."""


class UnfinishedError(StuckError):
    """It was still on its way when the control steps ran out."""


@dataclass
class Controller:
    """The control loop on one task; what it spends goes to the session."""

    session: Session
    task: Task
    cascade: Cascade
    """Of ``FACES`` rows."""
    period: int
    """Ticks from one control step to the next."""
    max_steps: int
    """Control steps for one goal after which it gives up."""
    gain: float = 0.0
    """Weight of each way to come relative to the one before it."""
    inertia: float = 0.0
    """Share of the rates of the step before in those preferred now."""
    moving: Array = field(init=False)
    """Indices of the joints that are not locked."""

    def __post_init__(self) -> None:
        locked = [{"x": 0, "y": 1}[coordinate] for coordinate in self.task.locked_base]
        self.moving = np.delete(np.arange(self.task.robot.dof), locked)

    def leg(self, before: Leg | None, aims: tuple[Aim, ...]) -> Leg:
        """From where the leg before ended, or the start, until the first aim's goal is hit.

        Raises StuckError where it does not get there, CascadeError where a solver fails.
        """
        (hand, goal, _), name = aims[0], f"goal {aims[0].goal + 1}: the {aims[0].hand} hand"
        accuracy = self.session.model.correction_tolerance
        short = beyond_reach(self.task, hand, self.task.goals[goal], accuracy)
        if short > self.task.radius:
            raise StuckError(
                f"{name} ends {short:.3g} short of it with the base "
                f"locked in {' and '.join(self.task.locked_base)}"
            )
        length = self.session.model.step * self.period
        q = start = self.session.q0 if before is None else before.q
        rates = np.zeros(len(self.moving)) if before is None else before.rates
        waypoints: list[Array] = []
        postures = self.postures(q, aims, {} if before is None else before.postures)
        nearest, since = np.inf, 0
        while True:
            distance = float(np.hypot(*self.error_of(q, aims[0])))
            if distance <= self.task.radius - _HIT_MARGIN:
                break
            if distance < nearest - 0.1 * length:
                nearest, since = distance, 0
            since += 1
            if len(waypoints) == self.max_steps:
                raise UnfinishedError(
                    f"{name} is still {distance:.3g} from its centre "
                    f"after all {self.max_steps} control steps (max_steps)"
                )
            if since > _STALL_STEPS:
                raise StuckError(
                    f"{name} is still {distance:.3g} from its centre "
                    f"after {len(waypoints)} control steps and comes no nearer"
                )
            if waypoints:
                self.sweep(q, aims, postures)
            rates = self.next_rates(q, aims[0], postures[0], rates, length)
            q = self.moved(q, length * rates)
            waypoints.append(q)
        path = np.array(waypoints or [start])
        followed = follow(
            self.task.robot,
            start,
            path,
            hand,
            self.task.goals[goal],
            self.task.radius,
            model=self.session.model,
        )
        self.session.spend(forward_kinematics=followed.evaluations)
        movement = Movement(goal + 1, hand, "path", path[-1], waypoints=path)
        kept = dict(zip(aims[1:], postures[1:], strict=True))
        return Leg(movement, followed.ticks, followed.q, rates, kept)

    def postures(self, q: Array, aims: tuple[Aim, ...], earlier: dict[Aim, Array]) -> list[Array]:
        """The posture of each aim, those first that the way from ``q`` passes first.

        Of what is not known yet each is looked for from the one before it, as the nearest.
        """
        postures: list[Array] = []
        for aim in aims:
            before = postures[-1] if postures else q
            posture, change = earlier.get(aim, before), np.inf
            for _ in range(_POSTURE_STEPS if aim not in earlier else 0):
                posture, change = self.step_nearer(posture, before, aim)
                if change <= _POSTURE_TOLERANCE:
                    break
            postures.append(posture)
        for _ in range(_POSTURE_STEPS if len(aims) > 1 else 0):
            if self.sweep(q, aims, postures) <= _POSTURE_TOLERANCE:
                break
        return postures

    def nearest_hands(self, q: Array, goal: int) -> list[Hand]:
        """The hands, the nearest to a goal first, the left one of equally near ones."""
        hands = [hand for hand in HANDS if hand in self.session.hands]
        return sorted(hands, key=lambda hand: float(np.hypot(*self.error_of(q, Aim(hand, goal)))))

    def sweep(self, q: Array, aims: tuple[Aim, ...], postures: list[Array]) -> float:
        """Move each posture, in place, towards where the ways to and from it are shortest.

        The sum of two distances is least where their ends, each weighted by the inverse of its
        distance, have their mean (Weiszfeld 1937). Returns the largest change's norm.
        """
        largest = 0.0
        for k, aim in enumerate(aims):
            before = q if k == 0 else postures[k - 1]
            preferred = before.copy()
            if k + 1 < len(aims):
                after = postures[k + 1]
                to = 1.0 / max(float(np.linalg.norm(postures[k] - before)), _SHORTEST)
                on = self.gain / max(float(np.linalg.norm(after - postures[k])), _SHORTEST)
                heeding = (
                    self.session.joints(aims[k + 1].hand) if aims[k + 1].arm_only else slice(None)
                )
                preferred[heeding] += on / (to + on) * (after - before)[heeding]
            postures[k], change = self.step_nearer(postures[k], preferred, aim)
            largest = max(largest, change)
        return largest

    def step_nearer(self, posture: Array, preferred: Array, aim: Aim) -> tuple[Array, float]:
        """One Gauss-Newton step to the posture nearest to a preferred one that hits a goal."""
        rows, outside = self.faces(posture, aim)
        way = _POSTURE_GAIN * (preferred - posture)[self.moving]
        change = self.cascade.solve(rows, outside, way)
        short = outside.max()
        if short > _MARGIN and (outside - rows @ change).max() > 0.9 * short:
            # Singular in the very direction of the goal, such as a straight arm with its goal
            # behind: bend, and the next step finds a way.
            arm = self.session.joints(aim.hand)
            bent = (self.moving >= arm.start) & (self.moving < arm.stop)
            change[bent] += np.resize([1.0, -1.0], bent.sum())
        length = float(np.linalg.norm(change))
        return self.moved(posture, change * min(1.0, _POSTURE_STEP / max(length, 1e-12))), length

    def next_rates(self, q: Array, aim: Aim, posture: Array, last: Array, length: float) -> Array:
        """Joint rates of one control step of a ``length``, of norm 1 at most."""
        way = (posture - q)[self.moving]
        steps = max(1.0, float(np.linalg.norm(way)) / length)
        rows, outside = self.faces(q, aim)
        shrunk = outside.max() * (1.0 - _CLOSING / steps)
        preferred = (1.0 - self.inertia) * way / (steps * length) + self.inertia * last
        rates = self.cascade.solve(length * rows, outside - shrunk, preferred)
        rates /= max(1.0, float(np.linalg.norm(rates)))
        return rates

    def faces(self, q: Array, aim: Aim) -> tuple[Array, Array]:
        """How changes of the joints bring a hand within each face of a goal, ``(FACES, joints)``.

        And how far it is outside of each, ``(FACES,)``, length unit.
        """
        jacobian = self.session.jacobian(q, aim.hand)[:, self.moving]
        radius = (self.task.radius - _MARGIN) * _INSET
        return _NORMALS @ jacobian, _NORMALS @ self.error_of(q, aim) - radius

    def moved(self, q: Array, change: Array) -> Array:
        """A configuration with the joints that are not locked changed."""
        moved = q.copy()
        moved[self.moving] += change
        return moved

    def error_of(self, q: Array, aim: Aim) -> Array:
        """From a hand to its goal's centre, shape ``(2,)``, length unit."""
        error: Array = self.task.goal_array[aim.goal] - self.session.forward_kinematics(q, aim.hand)
        return error


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

Modelling = Literal["cvxpy", "none"]


class NullspaceParameters(Parameters):
    """Parameters of the controller."""

    hands: Annotated[str, Field(pattern=r"^(every|nearest|[LR]+)$")] = "every"
    """``every``: all hand sequences are simulated and the shortest is kept; ``nearest``:
    at each goal the hand that is nearest when the last one is hit, without a secondary
    objective (the other one where it does not get there); or a sequence such as ``LRLR``."""
    modelling: Modelling = "none"
    """``cvxpy`` states the programs in its language, ``none`` fills in their numbers; the same
    programs, and the same rates to the last bit."""
    period: Annotated[int, Field(ge=1, le=20)] = 5
    """Ticks from one control step to the next."""
    max_steps: Annotated[int, Field(ge=1)] = 5000
    """Control steps for one goal after which the controller gives up."""


class GainParameters(NullspaceParameters):
    """With the gain of the secondary objective."""

    gain: Annotated[float, Field(ge=0, le=10)] = 1.0
    """Weight of the way from a goal to the next, relative to the way before it."""


class NextGoalParameters(GainParameters):
    """With how far it looks ahead."""

    horizon: Annotated[int, Field(ge=1, le=MOST_GOALS)] = 2
    """Goals after the current one that have a posture; the first of these is the next goal's."""


class VelocityParameters(NullspaceParameters):
    """The same, with an inertia."""

    inertia: Annotated[float, Field(ge=0, lt=1)] = 0.5
    """Share of the rates of the step before in the preferred ones."""


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

    def aims(self, hands: tuple[Hand, ...], goal: int) -> tuple[Aim, ...]:
        """``goal`` (0-based), and what is prepared for on the way there."""
        return (Aim(hands[goal], goal),)

    def solve(self, session: Session) -> Result:
        """Simulate the candidate hand sequences and hand over the best one's paths."""
        task = session.hand_over(Information.GOALS, Information.FORWARD_KINEMATICS)
        parameters, joints = self.parameters, task.robot.dof - len(task.locked_base)
        try:
            with session.building():
                cascade = cascade_for(FACES, joints, parameters.modelling)
        except CascadeError as error:
            raise MethodError("solver-failed", str(error)) from None
        controller = Controller(
            session,
            task,
            cascade,
            parameters.period,
            parameters.max_steps,
            parameters.gain if isinstance(parameters, GainParameters) else 0.0,
            parameters.inertia if isinstance(parameters, VelocityParameters) else 0.0,
        )
        iterations = cascade.iterations
        try:
            with session.solving():
                return self.search(controller)
        except CascadeError as error:
            raise MethodError("solver-failed", str(error)) from None
        finally:
            session.spend(solver_iterations=cascade.iterations - iterations)

    def search(self, controller: Controller) -> Result:
        """Extend the sequence with the fewest ticks so far until one is complete.

        No other can be better then, since ticks only add up. Of equal ones the one with
        the fewest changes of hand is kept, then the first.
        """
        candidates = self.candidates(controller)
        heap: list[tuple[int, int, int, tuple[Leg, ...]]] = [
            (0, changes_of_hand(letters_of(hands)), index, ())
            for index, hands in enumerate(candidates)
        ]
        heapq.heapify(heap)
        solves = controller.cascade.solves
        legs: dict[Any, Leg | StuckError] = {}  # sequences share their beginnings
        stuck: list[StuckError] = []
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
            plan = tuple(self.aims(hands, g) for g in range(goal + 1))
            if plan not in legs:
                legs[plan] = self.leg_or_failure(controller, way, plan[-1])
            leg = legs[plan]
            if isinstance(leg, StuckError):
                stuck.append(leg)
            else:
                heapq.heappush(heap, (ticks + leg.ticks, changes, index, (*way, leg)))
        raise failure(str(stuck[0]), stuck)

    def leg_or_failure(
        self, controller: Controller, way: tuple[Leg, ...], aims: tuple[Aim, ...]
    ) -> Leg | StuckError:
        """The next leg of a way, or why there is none."""
        try:
            return controller.leg(way[-1] if way else None, aims)
        except StuckError as error:
            return error

    def candidates(self, controller: Controller) -> list[tuple[Hand, ...]]:
        """The hand sequences that are simulated."""
        session, choice = controller.session, self.parameters.hands
        if choice == "every":
            ordered = [hand for hand in HANDS if hand in session.hands]
            return list(itertools.product(ordered, repeat=session.goals_count))
        if choice != "nearest":
            return [hands_of(choice)]
        way: tuple[Leg, ...] = ()
        for goal in range(session.goals_count):
            nearest = controller.nearest_hands(way[-1].q if way else session.q0, goal)
            legs = [self.leg_or_failure(controller, way, (Aim(nearest[0], goal),))]
            if isinstance(legs[0], StuckError):  # only then is it another hand's turn
                legs += [
                    self.leg_or_failure(controller, way, (Aim(hand, goal),)) for hand in nearest[1:]
                ]
            reached = [leg for leg in legs if isinstance(leg, Leg)]
            if not reached:
                raise failure("; ".join(map(str, legs)), legs)
            way = (*way, reached[0])
        return [tuple(leg.movement.hand for leg in way)]


def failure(reason: str, legs: Sequence[object]) -> MethodError:
    """No way to a goal; one that was only not finished says nothing of the task."""
    if any(isinstance(leg, UnfinishedError) for leg in legs):
        return MethodError("solver-failed", reason)
    return MethodError("infeasible", reason)


class KeepVelocity(NullspaceQP):
    """Level 2 keeps the joint rates of the step before."""

    name = "nullspace-qp/velocity"
    title = "Prioritised nullspace QP, keeping velocity"
    told = NullspaceQP.told | {Information.SECONDARY_OBJECTIVES}
    secondary = ("smoothness: joint velocity is kept",)
    Parameters = VelocityParameters


class NextGoal(NullspaceQP):
    """Level 2 approaches the posture in which the next goal is hit."""

    name = "nullspace-qp/next-goal"
    title = "Prioritised nullspace QP, next goal as lower priority"
    citation = CITATION + CONCURRENT
    told = NullspaceQP.told | {Information.SECONDARY_OBJECTIVES}
    secondary = ("coarticulation: posture at the next goal",)
    Parameters = NextGoalParameters

    def aims(self, hands: tuple[Hand, ...], goal: int) -> tuple[Aim, ...]:
        """As many goals as the horizon has, with their hands."""
        end = min(goal + 1 + self.parameters.horizon, len(hands))
        return tuple(Aim(hands[g], g) for g in range(goal, end))


class Preshaping(NullspaceQP):
    """Level 2 prepares the other hand for the goal it hits next."""

    name = "nullspace-qp/preshaping"
    title = "Prioritised nullspace QP, preshaping of the other arm"
    citation = CITATION + CONCURRENT
    told = NullspaceQP.told | {Information.SECONDARY_OBJECTIVES}
    secondary = ("preshaping: the other arm's posture at the goal it hits next",)
    Parameters = GainParameters

    def why_not(self, task: Task) -> str | None:
        """Nothing to preshape, or the reasons of the others."""
        if len(task.hands) < 2:
            return f"task {task.name!r} has one hand; there is no other arm to preshape"
        return super().why_not(task)

    def aims(self, hands: tuple[Hand, ...], goal: int) -> tuple[Aim, ...]:
        """``goal``, and the first to come that the other hand hits."""
        later = range(goal + 1, len(hands))
        others = (Aim(hands[g], g, True) for g in later if hands[g] != hands[goal])
        return (Aim(hands[goal], goal), *itertools.islice(others, 1))


METHODS: tuple[type[NullspaceQP], ...] = (NullspaceQP, KeepVelocity, NextGoal, Preshaping)


@cache
def cascade_for(rows: int, joints: int, modelling: Modelling = "none") -> Cascade:
    """The one cascade of this process for such a task and statement."""
    if modelling == "none":
        return Cascade(rows, joints)
    from coartic.baselines.modelled_cascade import ModelledCascade  # cvxpy is slow to import

    return ModelledCascade(rows, joints)
