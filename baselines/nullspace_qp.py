"""Prioritised null-space control by quadratic programmes: the hand first, then the joints.

At every control step level 1 of the cascade (:mod:`coartic.baselines.cascade`) moves the hand
straight towards the centre of its goal, and level 2 chooses among the joint changes x that do so,
which differ by motion in the null space of the hand's Jacobian J. With the unit vector u from the
hand to the centre, and lengths in lengths of a control step::

    J x = v J J⁺ u,  that is  A = (J; -J),  b = A v J⁺ u,      v = min(1 / |J⁺ u|, d)

The pace v is the speed of the hand in the minimum-norm solution, and never more than its distance d
from the centre. If what level 2 adds makes the joint step longer than a control step may be, all of
the step is shortened, and the hand goes straight and slower. Level 2 takes the x nearest to

- ``least-motion``: 0, so that x is v J⁺ u, nearly;
- ``next-goal-posture``: an even step towards a posture of the next goal, which would be there when
  the hand is at its goal, and no longer than a control step. The corrective process finds the
  posture from where the robot stands when the goal becomes current.

Sources: Y. Nakamura, H. Hanafusa, T. Yoshikawa (1987), Task-priority based redundancy control of
robot manipulators; O. Kanoun, F. Lamiraux, P.-B. Wieber (2011); the next goal as the objective of
lower priority: K. Rohanimanesh et al. (2004), B. Thibodeau et al. (2004).
"""

from __future__ import annotations

import numpy as np

from coartic.baselines.cascade import Solution
from coartic.baselines.controllers import CITATION_AHEAD, Aim, Control, Controller
from coartic.method import Information
from coartic.robot import Array


class HandController(Controller):
    """Move the hand straight towards its goal with the least joint changes; base of the controllers
    that prefer other changes. The memory is a configuration, shape ``(dof,)``."""

    def begin(self, q: Array, aims: tuple[Aim, ...], memory: Array | None) -> Array:
        """Return ``q`` itself as the memory (kept from step to step), which is not used here."""
        return q

    def step(
        self, q: Array, aims: tuple[Aim, ...], memory: Array, first: bool
    ) -> tuple[Solution, Array, Array]:
        """Return three things for a control step from configuration ``q``: the solution, which
        moves the hand of the first aim straight towards its goal, to first order and if the joints
        can, with changes as near to the preferred ones as that allows; the preferred changes,
        ``(joints,)``, in lengths of a control step; and ``memory`` itself. ``first`` is not used.
        """
        jacobian = self.session.jacobian(q, aims[0].hand)[:, self.moving]
        error = self.error(q, aims[0])
        direction = error / np.linalg.norm(error)
        pace = 1.0 / max(float(np.linalg.norm(np.linalg.pinv(jacobian) @ direction)), 1e-9)
        distance = float(np.linalg.norm(error)) / self.length
        steps, pace = max(1.0, distance / pace), min(pace, distance)
        preferred = self.preferred(q, memory, steps)
        rows = np.vstack([jacobian, -jacobian])
        solution = self.solve(rows, rows @ np.linalg.pinv(jacobian) @ direction * pace, preferred)
        return solution, preferred, memory

    def preferred(self, q: Array, memory: Array, steps: float) -> Array:
        """Return the changes that are preferred in a control step, ``(joints,)``, in lengths of a
        control step, for the coordinates that are not locked (``self.moving``): here zeros. A
        subclass can use the configuration ``q``, ``(dof,)``, the ``memory`` of :meth:`begin`, and
        the number of control ``steps`` to the goal."""
        return np.zeros(len(self.moving))


class NextGoalController(HandController):
    """Move the hand straight towards its goal, and the joints, as far as that allows, towards a
    posture of the next goal. The memory is this posture, shape ``(dof,)``."""

    def begin(self, q: Array, aims: tuple[Aim, ...], memory: Array | None) -> Array:
        """Return, as the memory, the posture ``(dof,)`` in which the corrective process from ``q``
        hits a goal ahead: the first of ``aims`` (hand and goal) after the current one for which it
        converges. Return ``q`` itself if there is none."""
        for hand, goal in aims[1:]:
            correction = self.session.correct(q, hand, goal + 1)
            if correction.converged:
                return correction.q
        return q

    def preferred(self, q: Array, memory: Array, steps: float) -> Array:
        """Return the joint changes from ``q`` to the posture ``memory`` divided by ``steps`` (below
        1 as 1), for the joints that are not locked, shape ``(joints,)``, in lengths of a control
        step; all shortened in proportion where they are longer than 1 together."""
        path = (memory - q)[self.moving] / self.length
        return np.asarray(path / max(steps, float(np.linalg.norm(path)), 1.0))


class LeastMotion(Control):
    """Null-space control with the least joint changes."""

    name = "nullspace-qp/least-motion"
    version = 2
    tuned_on = "nothing"
    title = "Prioritised null-space QP, least motion"
    controller = HandController


class NextGoalPosture(LeastMotion):
    """Null-space control towards a posture of the next goal."""

    name = "nullspace-qp/next-goal-posture"
    title = "Prioritised null-space QP, posture of the next goal"
    citation = Control.citation + CITATION_AHEAD
    information = LeastMotion.information | {
        Information.SECONDARY_OBJECTIVES,
        Information.CORRECTIVE_PROCESS,
    }
    controller = NextGoalController
    goals_ahead = 1


METHODS: tuple[type[Control], ...] = (LeastMotion, NextGoalPosture)
