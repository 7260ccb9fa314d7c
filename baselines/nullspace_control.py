"""A prioritised nullspace controller, in closed loop with the robot's kinematics.

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
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from coartic import Movement, Task
from coartic.baselines.cascade import Cascade
from coartic.method import Session
from coartic.motion.movement import follow
from coartic.robot import HANDS, Array, Hand, directions

FACES = 16
"""Of a disc's polygon: it leaves out 2 % of the radius at the most."""

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
    """Of what is looked ahead to: postures before it heed it with this hand's arm alone."""


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
        short = self.task.beyond_reach(hand, self.task.goals[goal], accuracy)
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
