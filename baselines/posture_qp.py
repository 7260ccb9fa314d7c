"""Posture QP: prioritised quadratic programmes that lead to postures for the current goal, or with
goals ahead in view.

The controller keeps a **posture** for the current goal and for each goal that it looks ahead to.
Both the postures and the control steps are answers of one cascade (:mod:`coartic.baselines.
cascade`): level 1 asks for a hand in a disc, level 2 for what the joints prefer. With p(q) the
hand, J its Jacobian, c and r the centre and radius of the disc, and n_i the normals of a regular
polygon in the unit circle, the disc is

    n_i · (c - p(q) - J x) <= ρ  for all i,  that is  A = (n_i · J),  b = (n_i · (c - p(q)) - ρ),

linear in the change x of the joints, where ρ is the distance of the polygon's sides from c.

- A posture has its hand in its goal's disc. Of all such postures it is the one that makes the path
  from posture to posture shortest in the metric of the reward, which is Euclidean in joint space.
- A control step has the hand in a disc about the goal that shrinks from where the hand is towards
  the goal's own; the joints prefer to go straight to the posture. So the hand comes nearer all the
  time, on whatever path suits the joints.

Postures are found once for each goal to come and kept up by a step of the same kind at every
control step. The objective decides which posture hits the current goal:

- current goal: the nearest to where the robot stands when the last goal is hit;
- goals ahead: the posture from which the path on to the next goal's posture is shortest, too
  (coarticulation by concurrent subgoals of lower priority). The next goal's posture is itself
  chosen with a view to the goal after it.

Tuned on thirty development instances (``d000`` to ``d009`` of families one-armed, two-armed and
aligned), and on nothing else: 12 settings of the controller as it is, tabled here, and before
that some 50 of a prototype (other first postures, 8 to 24 faces, control steps of 1 to 10 ticks,
posture steps of 0.05 to 0.2 and gains of 0.1 to 0.7 for them, horizons, weights). Mean gap to
the best path known of ``goals-ahead``, one setting changed at a time, * the value used:

=========================  ====================================================================
hand comes nearer, at      0: 2.2 %, 0.03*: 2.2 %, 0.1: 2.3 %, 0.3: 2.6 %, 0.6: 3.4 %,
this share of even pace    1: 6.9 %
weight of paths to come    0.5: 6.9 %, 0.7: 4.0 %, 0.85: 2.7 %, 1*: 2.3 %, 1.2: 2.6 %
(share at 0.1)
goals ahead (same)         none: 20.1 %, 1: 5.6 %, 2*: 2.3 %, 3: 2.2 %; a prototype: 2.0 % for all
=========================  ====================================================================

On the same instances the corrective process alone with its best hand sequence has 24.8 %; half of
the joint rates of the step before, kept (smoothness is no part of the reward), 20.5 % where
``current-goal`` has 20.1 %. A controller whose level 1 moves the hand straight to the goal's
centre, with the least rates at every step, had 43.6 % with the next goal as level 2 and 60 %
without one.

The remaining gap is local: postures are found by descent from where the robot is, and another
branch of the inverse kinematics may be far shorter (35 % on the worst of the thirty). First
postures sought from a straight arm, too, mended one instance and spoiled others as often.
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from coartic import Movement, Task
from coartic.baselines.cascade import solve_cascade
from coartic.baselines.posture_graph import HandSequence
from coartic.method import Information, Method, MethodError, Outline, Parameters, Result, Session
from coartic.motion.initial import changes_of_hand
from coartic.motion.movement import follow
from coartic.robot import HANDS, Array, Hand, directions
from coartic.tasks.task import beyond_reach, letters_of

FACES = 16
"""Sides of the polygon that stands for a goal's disc; it leaves out 2 % of the radius at most."""
GOALS_AHEAD = 2
"""Goals after the current one that have a posture under ``goals-ahead``."""

_FACE_NORMALS = directions(2 * np.pi * np.arange(FACES) / FACES)
_INSET = float(directions(np.pi / FACES)[0])
_MARGIN = 1e-4  # length unit: the polygon is approached without end, the disc is entered
_HIT_MARGIN = 1e-9  # the scorer's interpolation along the path rounds
_STALL_STEPS = 50  # without coming nearer by a tenth of a control step
_CLOSING = 0.03  # of the even pace at which the hand has to come nearer
_POSTURE_STEPS = 400  # at most, when a posture is first looked for
_POSTURE_STEP = 0.1  # longest of them, length unit and rad: longer ones end far off
_POSTURE_GAIN = 0.5  # of the path to the preferred one in one of them: 1 may swing
_POSTURE_TOLERANCE = 1e-3  # of such a step, length unit and rad
_SHORTEST = 0.02  # path whose share still counts, length unit and rad


class Aim(NamedTuple):
    """A goal and the hand that is to hit it."""

    hand: Hand
    goal: int  # 0-based


class Leg(NamedTuple):
    """The path to one goal."""

    movement: Movement
    ticks: int
    q: Array
    """Configuration in which the goal is hit, shape ``(dof,)``."""
    postures: dict[Aim, Array]
    """Postures of the goals looked ahead to."""


class StuckError(Exception):
    """The hand does not reach the goal."""


@dataclass
class Controller:
    """The control loop on one task; the session counts what it spends."""

    session: Session
    task: Task
    period: int
    """Ticks from one control step to the next."""
    solves: int = 0
    """Quadratic programmes solved so far."""

    def __post_init__(self) -> None:
        locked = ["xy".index(coordinate) for coordinate in self.task.locked_base]
        self.moving = np.delete(np.arange(self.task.robot.dof), locked)
        """Indices of the joints that are not locked."""

    def leg(self, before: Leg | None, aims: tuple[Aim, ...]) -> Leg:
        """The path to the first aim's goal, from where the leg before ended or from the start.

        Raises StuckError if the hand does not get there, MethodError if the solver fails.
        """
        (hand, goal), name = aims[0], f"goal {aims[0].goal + 1}: the {aims[0].hand} hand"
        model, radius = self.session.model, self.task.radius
        short = beyond_reach(self.task, hand, self.task.goals[goal], model.correction_tolerance)
        if short > radius:
            raise StuckError(
                f"{name} ends {short:.3g} short of it with the base "
                f"locked in {' and '.join(self.task.locked_base)}"
            )
        length = model.step * self.period
        q = start = self.session.q0 if before is None else before.q
        waypoints: list[Array] = []
        postures = self.find_postures(q, aims, {} if before is None else before.postures)
        nearest, since = np.inf, 0
        while (distance := self.distance(q, aims[0])) > radius - _HIT_MARGIN:
            if distance < nearest - 0.1 * length:
                nearest, since = distance, 0
            since += 1
            if since > _STALL_STEPS:
                raise StuckError(
                    f"{name} is still {distance:.3g} from its centre "
                    f"after {len(waypoints)} control steps and comes no nearer"
                )
            if waypoints:
                self.sweep(q, aims, postures)
            displacement = (postures[0] - q)[self.moving]
            steps = max(1.0, float(np.linalg.norm(displacement)) / length)
            rows, outside = self.faces(q, aims[0])
            shrunk = outside.max() * (1.0 - _CLOSING / steps)
            rates = self.solve(length * rows, outside - shrunk, displacement / (steps * length))
            rates /= max(1.0, float(np.linalg.norm(rates)))
            q = self.add(q, length * rates)
            waypoints.append(q)
        path = np.array(waypoints or [start])
        followed = follow(
            self.task.robot, start, path, hand, self.task.goals[goal], radius, model=model
        )
        self.session.spend(forward_kinematics=followed.evaluations)
        movement = Movement(goal + 1, hand, "path", path[-1], waypoints=path)
        ahead = dict(zip(aims[1:], postures[1:], strict=True))
        return Leg(movement, followed.ticks, followed.q, ahead)

    def find_postures(
        self, q: Array, aims: tuple[Aim, ...], earlier: dict[Aim, Array]
    ) -> list[Array]:
        """The posture of each aim, in the order of the goals.

        A posture that is not known ``earlier`` is searched from the one before it, as the nearest.
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

    def sweep(self, q: Array, aims: tuple[Aim, ...], postures: list[Array]) -> float:
        """Move each posture, in place, towards where the paths to and from it are shortest.

        The sum of two distances is least where their ends, each weighted by the inverse of its
        distance, have their mean (Weiszfeld 1937). Returns the largest change's norm.
        """
        largest = 0.0
        for k, aim in enumerate(aims):
            before = q if k == 0 else postures[k - 1]
            preferred = before
            if k + 1 < len(aims):
                after = postures[k + 1]
                to = 1.0 / max(float(np.linalg.norm(postures[k] - before)), _SHORTEST)
                on = 1.0 / max(float(np.linalg.norm(after - postures[k])), _SHORTEST)
                preferred = before + on / (to + on) * (after - before)
            postures[k], change = self.step_nearer(postures[k], preferred, aim)
            largest = max(largest, change)
        return largest

    def step_nearer(self, posture: Array, preferred: Array, aim: Aim) -> tuple[Array, float]:
        """Make a Gauss-Newton step to the posture that hits a goal nearest to a preferred posture.

        Returns the posture and the norm of the change.
        """
        rows, outside = self.faces(posture, aim)
        change = self.solve(rows, outside, _POSTURE_GAIN * (preferred - posture)[self.moving])
        short = outside.max()
        if short > _MARGIN and (outside - rows @ change).max() > 0.9 * short:
            # Singular in the very direction of the goal, such as a straight arm with its goal
            # behind: bend, and the next step finds a way.
            arm = self.session.joints(aim.hand)
            bent = (self.moving >= arm.start) & (self.moving < arm.stop)
            change[bent] += np.resize([1.0, -1.0], bent.sum())
        length = float(np.linalg.norm(change))
        return self.add(posture, change * min(1.0, _POSTURE_STEP / max(length, 1e-12))), length

    def solve(self, rows: Array, least: Array, preferred: Array) -> Array:
        """The cascade's changes of the joints; the session counts the iterations."""
        changes, iterations = solve_cascade(rows, least, preferred)
        self.solves += 2
        self.session.spend(solver_iterations=iterations)
        return changes

    def faces(self, q: Array, aim: Aim) -> tuple[Array, Array]:
        """A, ``(FACES, joints)``, and b, ``(FACES,)``, of the module's docstring, length unit."""
        jacobian = self.session.jacobian(q, aim.hand)[:, self.moving]
        radius = (self.task.radius - _MARGIN) * _INSET
        error = self.task.goal_array[aim.goal] - self.session.forward_kinematics(q, aim.hand)
        return _FACE_NORMALS @ jacobian, _FACE_NORMALS @ error - radius

    def add(self, q: Array, change: Array) -> Array:
        """The configuration ``q`` with the joints that are not locked changed."""
        result = q.copy()
        result[self.moving] += change
        return result

    def distance(self, q: Array, aim: Aim) -> float:
        """Distance of a hand from its goal's centre, length unit."""
        error = self.task.goal_array[aim.goal] - self.session.forward_kinematics(q, aim.hand)
        return float(np.hypot(*error))


class PostureQPParameters(Parameters):
    """Parameters of the controller."""

    period: Annotated[int, Field(ge=1, le=20)] = 5
    """Ticks from one control step to the next."""


class PostureQP(Method):
    """Posture QP for the current goal; base of the controller with goals ahead."""

    name = "posture-qp/current-goal"
    title = "Posture QP, current goal"
    citation = (
        "Y. Nakamura, H. Hanafusa, T. Yoshikawa (1987). Task-priority based redundancy control of "
        "robot manipulators. International Journal of Robotics Research; as quadratic programs "
        "after O. Kanoun, F. Lamiraux, P.-B. Wieber (2011), IEEE Transactions on Robotics. "
    )
    information = frozenset(
        {
            Information.GOALS,
            Information.FORWARD_KINEMATICS,
            Information.JACOBIAN,
            Information.REWARD_FORMULA,
        }
    )
    stochastic = False
    Parameters = PostureQPParameters
    quick: ClassVar[dict[str, Any]] = {"period": 20}

    def why_not(self, task: Outline) -> str | None:
        """The reason why there are too many sequences to simulate, if there are."""
        return task.too_many_sequences

    def aims(self, hands: HandSequence, goal: int) -> tuple[Aim, ...]:
        """``goal`` (0-based), and the goals that are prepared for on the way there."""
        return (Aim(hands[goal], goal),)

    def solve(self, session: Session) -> Result:
        """Simulate the hand sequences and return the best one's paths."""
        task = session.reveal(Information.GOALS, Information.FORWARD_KINEMATICS)
        controller = Controller(session, task, self.parameters.period)
        ordered = [hand for hand in HANDS if hand in task.hands]
        with session.solving():
            candidates = list(itertools.product(ordered, repeat=len(task.goals)))
            return self.search(controller, candidates)

    def search(self, controller: Controller, candidates: list[HandSequence]) -> Result:
        """Extend the sequence with the fewest ticks so far until one is complete.

        No other can be better then, since ticks only add up. Of equal ones the one with
        the fewest changes of hand is kept, then the first.
        """
        heap: list[tuple[int, int, int, tuple[Leg, ...]]] = [
            (0, changes_of_hand(letters_of(hands)), index, ())
            for index, hands in enumerate(candidates)
        ]
        heapq.heapify(heap)
        legs: dict[Any, Leg | StuckError] = {}  # sequences share their beginnings
        stuck: list[StuckError] = []
        while heap:
            ticks, changes, index, path = heapq.heappop(heap)
            hands, goal = candidates[index], len(path)
            if goal == len(hands):
                details = {
                    "sequences": len(candidates),
                    "stuck_sequences": len(stuck),
                    "simulated_movements": len(legs),
                    "solves": controller.solves,
                }
                return Result(tuple(leg.movement for leg in path), details)
            plan = tuple(self.aims(hands, g) for g in range(goal + 1))
            if plan not in legs:
                try:
                    legs[plan] = controller.leg(path[-1] if path else None, plan[-1])
                except StuckError as error:
                    legs[plan] = error
            leg = legs[plan]
            if isinstance(leg, StuckError):
                stuck.append(leg)
            else:
                heapq.heappush(heap, (ticks + leg.ticks, changes, index, (*path, leg)))
        raise MethodError("infeasible", str(stuck[0]))


class GoalsAhead(PostureQP):
    """Level 2 approaches a posture chosen with a view to the two goals that follow."""

    name = "posture-qp/goals-ahead"
    title = "Posture QP, goals ahead"
    citation = PostureQP.citation + (
        "K. Rohanimanesh, R. Platt, S. Mahadevan, R. Grupen (2004), Coarticulation in Markov "
        "decision processes, NIPS; B. Thibodeau, S. Hart, D. Karuppiah, J. Sweeney, O. Brock "
        "(2004), Cascaded filter approach to multi-objective control, ICRA."
    )
    information = PostureQP.information | {Information.SECONDARY_OBJECTIVES}
    secondary = ("coarticulation: posture at the next goal",)

    def aims(self, hands: HandSequence, goal: int) -> tuple[Aim, ...]:
        """As many goals as the horizon has, with their hands."""
        return tuple(Aim(hand, g) for g, hand in enumerate(hands))[goal : goal + 1 + GOALS_AHEAD]


METHODS: tuple[type[PostureQP], ...] = (PostureQP, GoalsAhead)
