"""A prioritised nullspace controller, in closed loop with the robot's kinematics.

At every control step the :mod:`baselines.cascade` moves the hand straight towards the
centre of its goal (level 1) and uses what redundancy that leaves for a secondary objective
(level 2): the rates of the step before, or a posture to come.

That posture hits a later goal and is the one nearest to the robot's own, as the cascade
finds it: level 1 takes the hand to that goal, level 2 back towards the robot. It is found
at the start of each goal and kept up by one step of the same kind at every control step.

The hand's rate is what a joint step of norm m can give it in that direction (the
manipulability ellipsoid, Yoshikawa 1985), so level 1 by itself never saturates a joint; the
sum of both levels is scaled back to m, which keeps its direction. Scoring counts length
along the path, so nothing is gained by steps shorter than m.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from baselines.cascade import DAMPING, Cascade
from coartic import Movement, Task
from coartic.method import Session
from coartic.movement import follow
from coartic.robot import HANDS, Array, Hand

_HIT_MARGIN = 1e-9  # the scorer's interpolation along the path rounds
_STALL_STEPS = 50  # without coming nearer by a tenth of a control step
_POSTURE_STEPS = 50  # at most, when a posture is first looked for
_POSTURE_STEP = 0.2  # longest of them, length unit and rad: longer ones end far off
_POSTURE_GAIN = 0.3  # of the way back to the robot in one of them: 1 goes on swinging
_POSTURE_TOLERANCE = 1e-3  # of such a step, length unit and rad


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


class UnfinishedError(StuckError):
    """It was still on its way when the control steps ran out."""


@dataclass
class Controller:
    """The control loop on one task; what it spends goes to the session."""

    session: Session
    task: Task
    cascade: Cascade
    period: int
    """Ticks from one control step to the next."""
    max_steps: int
    """Control steps for one goal after which it gives up."""
    gain: float = 0.0
    """Of the secondary objective."""
    keeps_velocity: bool = False
    """Whether that objective is the rates of the step before."""
    moving: Array = field(init=False)
    """Indices of the joints that are not locked."""

    def __post_init__(self) -> None:
        locked = [{"x": 0, "y": 1}[coordinate] for coordinate in self.task.locked_base]
        self.moving = np.delete(np.arange(self.task.robot.dof), locked)

    def leg(self, q: Array, rates: Array, hand: Hand, goal: int, aim: Aim | None) -> Leg:
        """From ``q`` until ``hand`` is in goal ``goal`` (0-based).

        Raises StuckError where it does not get there, CascadeError where a solver fails.
        """
        accuracy = self.session.model.correction_tolerance
        short = self.task.beyond_reach(hand, self.task.goals[goal], accuracy)
        if short > self.task.radius:
            raise StuckError(
                f"goal {goal + 1}: the {hand} hand ends {short:.3g} short of it with the base "
                f"locked in {' and '.join(self.task.locked_base)}"
            )
        length = self.session.model.step * self.period
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
            if len(waypoints) == self.max_steps:
                raise UnfinishedError(
                    f"goal {goal + 1}: the {hand} hand is still {distance:.3g} from its centre "
                    f"after all {self.max_steps} control steps (max_steps)"
                )
            if since > _STALL_STEPS:
                raise StuckError(
                    f"goal {goal + 1}: the {hand} hand is still {distance:.3g} from its centre "
                    f"after {len(waypoints)} control steps and comes no nearer"
                )
            preferred = None
            if self.keeps_velocity:
                preferred = self.gain * rates
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
        rates = self.gain * way / max(float(np.linalg.norm(way)), length)
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
