"""Prioritised null-space control by quadratic programmes: the hand first, then the joints.

At each control step, level 1 of the cascade (:mod:`coartic.baselines.cascade`) moves the hand
straight towards the centre of its goal. Many joint changes x move the hand in this way; they differ
by motion in the null space of the hand's Jacobian J. Level 2 chooses one of these joint changes.
The task of level 1 is::

    J x = v J J⁺ u,  that is  A = (J; -J),  b = A v J⁺ u,      v = min(1 / |J⁺ u|, d)

Here u is the unit vector from the hand to the centre, d is the distance from the hand to the
centre, and v is the speed of the hand (its way in one control step). The unit of lengths is the
largest joint-space length of a control step. The speed v is the way that the hand makes in the
direction u by a minimum-norm change of length 1, but at most d. If the change that level 2 chooses
is longer than 1, it is scaled down to length 1: the hand still goes straight, but slower.

Level 2 chooses the joint change x that is nearest to a preferred change:

- ``least-motion``: the preferred change is 0, so that x is almost the minimum-norm change v J⁺ u.
- ``next-goal-posture``: the preferred change is a step towards a posture of the next goal. The step
  is the difference between that posture and the present configuration, divided by the number of
  control steps to the current goal, but no longer than a control step. When a goal becomes current,
  the corrective process finds the posture of the next goal, starting from the configuration of the
  robot. If it finds none, or if there is no next goal, the configuration in which the goal became
  current takes the place of the posture.

Where neither the limits of the joint changes nor damping matter, x = v J⁺ u + (I − J⁺ J) z: the
preferred change z is projected onto the null space of J.

Sources: Y. Nakamura, H. Hanafusa, T. Yoshikawa (1987), Task-priority based redundancy control of
robot manipulators; O. Kanoun, F. Lamiraux, P.-B. Wieber (2011). In K. Rohanimanesh et al. (2004)
and B. Thibodeau et al. (2004), the next goal is the objective of lower priority.
"""

from __future__ import annotations

import numpy as np

from coartic.baselines.cascade import Solution
from coartic.baselines.controllers import Aim, Control, Controller
from coartic.method import Facts, Information
from coartic.robot import Array


class HandController(Controller):
    """Move the hand straight towards its goal with the least joint changes.

    Controllers that prefer other joint changes are subclasses, which override :meth:`preferred`.
    The memory is a configuration, shape ``(dof,)``.
    """

    def begin(self, q: Array, aims: tuple[Aim, ...], memory: Array | None) -> Array:
        """Return ``q`` as the memory. This class does not use the memory."""
        return q

    def step(
        self, q: Array, aims: tuple[Aim, ...], memory: Array, first: bool
    ) -> tuple[Solution, Array, Array]:
        """Compute a control step that moves the hand straight towards its goal, to first order.

        Parameters and returned values are those of :meth:`Controller.step`. The memory does not
        change.
        """
        jacobian = self.session.jacobian(q, aims[0].hand)[:, self.moving]
        error = self.error(q, aims[0])
        direction = error / np.linalg.norm(error)
        speed = 1.0 / max(float(np.linalg.norm(np.linalg.pinv(jacobian) @ direction)), 1e-9)
        distance = float(np.linalg.norm(error)) / self.length
        steps, speed = max(1.0, distance / speed), min(speed, distance)
        preferred = self.preferred(q, memory, steps)
        rows = np.vstack([jacobian, -jacobian])
        solution = self.solve(rows, rows @ np.linalg.pinv(jacobian) @ direction * speed, preferred)
        return solution, preferred, memory

    def preferred(self, q: Array, memory: Array, steps: float) -> Array:
        """Return the preferred joint changes of a control step: 0 in this class.

        Parameters
        ----------
        q : ndarray, shape (dof,)
            Configuration before the step.
        memory : ndarray, shape (dof,)
            Memory of the controller.
        steps : float
            Estimated number of control steps to the goal, at least 1.

        Returns
        -------
        ndarray, shape (joints,)
            Preferred changes. The unit is the largest joint-space length of a control step.
        """
        return np.zeros(len(self.moving))


class NextGoalController(HandController):
    """Move the hand straight towards its goal, and the joints towards the next goal's posture.

    The direction of the hand has priority: the change towards the posture does not bend the path of
    the hand, but can slow the hand. The memory is what :meth:`begin` returns, shape ``(dof,)``.
    """

    def begin(self, q: Array, aims: tuple[Aim, ...], memory: Array | None) -> Array:
        """Find a posture of the next goal, shape ``(dof,)``, and return it as the memory.

        The corrective process tries the goals ahead in order, and starts from ``q`` for each of
        them. The memory is the posture of the first goal for which the process converges. If it
        converges for none of the goals, or if there are no goals ahead, the memory is ``q``.
        """
        for hand, goal in aims[1:]:
            correction = self.session.correct(q, hand, goal + 1)
            if correction.converged:
                return correction.q
        return q

    def preferred(self, q: Array, memory: Array, steps: float) -> Array:
        """Return the change towards the posture that is due in one control step.

        The result is the change from ``q`` to the posture ``memory``, divided by ``steps``. If its
        norm exceeds 1, the result is scaled to norm 1. Parameters, shapes and units are those of
        :meth:`HandController.preferred`.
        """
        path = (memory - q)[self.moving] / self.length
        return np.asarray(path / max(steps, float(np.linalg.norm(path)), 1.0))


class LeastMotion(Control):
    """Null-space control in which the joints change as little as possible."""

    name = "nullspace-qp/least-motion"
    version = 2
    tuned_on = "nothing"
    title = "null-space QP, least motion"
    facts = Facts(
        works=("nakamura1987", "kanoun2011"),
        solvers=("arnstrom2022",),
        algorithm="null-space QP",
        short="QP, least motion",
    )
    controller = HandController


class NextGoalPosture(LeastMotion):
    """Null-space control towards a posture of the next goal."""

    name = "nullspace-qp/next-goal-posture"
    title = "null-space QP, posture of the next goal"
    facts = Facts(
        works=("nakamura1987", "kanoun2011", "rohanimanesh2004", "thibodeau2004"),
        solvers=("arnstrom2022",),
        algorithm="null-space QP",
        short="QP, next posture",
    )
    information = LeastMotion.information | {
        Information.SECONDARY_OBJECTIVES,
        Information.CORRECTIVE_PROCESS,
    }
    controller = NextGoalController
    goals_ahead = 1


METHODS: tuple[type[Control], ...] = (LeastMotion, NextGoalPosture)
