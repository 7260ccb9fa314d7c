"""Prioritised nullspace control by quadratic programs, one method a secondary objective.

The controller of :mod:`coartic.baselines.nullspace_control` has the hand come nearer to the disc
of the
current goal (level 1) and lets the joints go, as far as that leaves them free to, straight to a
posture that hits it (level 2). The objective decides which one:

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
from functools import cache
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from coartic import Task
from coartic.baselines.cascade import Cascade, CascadeError
from coartic.baselines.nullspace_control import (
    FACES,
    Aim,
    Controller,
    Leg,
    StuckError,
    UnfinishedError,
)
from coartic.method import Information, Method, MethodError, Parameters, Result, Session
from coartic.motion.initial import changes_of_hand, too_many_sequences
from coartic.robot import HANDS, Hand
from coartic.tasks.task import LETTERS, MOST_GOALS, hands_of, letters_of

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

    def cascade(self, joints: int) -> Cascade:
        """The solver of every control step."""
        return cascade_for(FACES, joints, self.parameters.modelling)

    def solve(self, session: Session) -> Result:
        """Simulate the candidate hand sequences and hand over the best one's paths."""
        task = session.hand_over(Information.GOALS, Information.FORWARD_KINEMATICS)
        try:
            with session.building():
                cascade = self.cascade(task.robot.dof - len(task.locked_base))
        except CascadeError as error:
            raise MethodError("solver-failed", str(error)) from None
        parameters = self.parameters
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
