"""Posture QP: a controller that goes straight in joint space to postures that hit the goals.

It plans postures more than it controls in the null space (:mod:`coartic.baselines.nullspace_qp`):
the priority of the hand hardly ever binds (``details`` of a run count how often), because the
joints prefer to go straight to a posture that hits the goal.

The controller keeps a **posture** for the current goal and for each goal that it looks ahead to.
Both the postures and the control steps are answers of one cascade (:mod:`coartic.baselines.
cascade`): level 1 asks for a hand in a disc, level 2 for what the joints prefer. With p(q) the
hand, J its Jacobian, c and r the centre and radius of the disc, and n_i the normals of a regular
polygon in the unit circle, in place of the disc stands

    n_i · (c - p(q) - J x) <= ρ  for all i,  that is  A = (n_i · J),  b = (n_i · (c - p(q)) - ρ),

linear in the change x of the joints, where ρ is the distance of the polygon's sides from c.

- A posture has its hand in its goal's disc. Of such postures it makes, locally, the path from one
  to the next shortest in the metric of the reward, which is Euclidean in joint space.
- A control step has the hand in a disc about the goal that shrinks from where the hand is towards
  the goal's own; the joints prefer to go straight to the posture. So the hand comes nearer step
  by step, on whatever path suits the joints.

Postures are found once for each goal to come and kept up by a step of the same kind at every
control step except the first to a goal. The objective decides which posture hits the current goal:

- current goal: the nearest to where the robot stands;
- goals ahead: the posture from which the path on to the next goal's posture is shortest, too. The
  next goal's posture is itself chosen with a view to the goal after it.

Tuned on thirty development instances (``d000`` to ``d009`` of families one-armed, two-armed and
aligned), and on nothing else: 12 settings of the controller as it is, tabled here, and before that
some 50 of a prototype. Mean gap to the best path known of ``goals-ahead``, one setting changed at a
time, * the value used:

=========================  ====================================================================
hand comes nearer, at      0: 2.2 %, 0.03*: 2.2 %, 0.1: 2.3 %, 0.3: 2.6 %, 0.6: 3.4 %,
this share of even pace    1: 6.9 %
weight of paths to come    0.5: 6.9 %, 0.7: 4.0 %, 0.85: 2.7 %, 1*: 2.3 %, 1.2: 2.6 %
(share at 0.1)
goals ahead (same)         none: 20.1 %, 1: 5.6 %, 2*: 2.3 %, 3: 2.2 %; a prototype: 2.0 % for all
=========================  ====================================================================

On the same instances the corrective process alone with its best hand sequence has 24.8 %, and
``current-goal`` 20.1 %.

The remaining gap is local: postures are found by descent from where the robot is, and another
branch of the inverse kinematics may be far shorter (35 % on the worst of the thirty).
"""

from __future__ import annotations

import numpy as np

from coartic.baselines.cascade import Solution
from coartic.baselines.controllers import CITATION_AHEAD, Aim, Control, Controller
from coartic.method import Information
from coartic.robot import Array, directions

FACES = 16
"""Sides of the polygon that stands for a goal's disc; it leaves out 2 % of the radius at most."""

_FACE_NORMALS = directions(2 * np.pi * np.arange(FACES) / FACES)
_INSET = float(directions(np.pi / FACES)[0])
_MARGIN = 1e-4  # length unit: the polygon is approached without end, the disc is entered
_CLOSING = 0.03  # of the even pace at which the hand has to come nearer
_POSTURE_STEPS = 400  # at most, when a posture is first looked for
_POSTURE_STEP = 0.1  # longest of them, length unit and rad: longer ones end far off
_POSTURE_GAIN = 0.5  # of the path to the preferred one in one of them: 1 may swing
_POSTURE_TOLERANCE = 1e-3  # of such a step, length unit and rad
_SHORTEST = 0.02  # path whose share still counts, length unit and rad


class PostureController(Controller):
    """Go straight in joint space to the posture of the current goal. The memory has a posture,
    shape ``(dof,)``, by aim: for the current goal and the goals ahead."""

    def begin(
        self, q: Array, aims: tuple[Aim, ...], memory: dict[Aim, Array] | None
    ) -> dict[Aim, Array]:
        """Return, by aim, a posture ``(dof,)`` that hits the goal of each of ``aims`` (hand and
        goal), for the movement from configuration ``q``. A posture that ``memory`` has for an aim
        is taken over; any other is sought by descent from the posture of the aim before, the first
        from ``q``. With several aims all are then moved to shorten the path from ``q`` through
        them. A search that does not converge ends after 400 steps, perhaps outside of the goal."""
        earlier, postures = memory or {}, list[Array]()
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
        return dict(zip(aims, postures, strict=True))

    def step(
        self, q: Array, aims: tuple[Aim, ...], memory: dict[Aim, Array], first: bool
    ) -> tuple[Solution, Array, dict[Aim, Array]]:
        """Move the postures of ``memory`` a step on, except at the ``first`` step of a movement,
        and solve for a control step from ``q`` towards the posture of the current goal. Return
        solution, preferred changes ``(joints,)`` in lengths of a control step, and the postures by
        aim in a new dictionary."""
        postures = [memory[aim] for aim in aims]
        if not first:
            self.sweep(q, aims, postures)
        path = (postures[0] - q)[self.moving]
        steps = max(1.0, float(np.linalg.norm(path)) / self.length)
        rows, outside = self.faces(q, aims[0])
        shrunk = outside.max() * (1.0 - _CLOSING / steps)
        preferred = path / (steps * self.length)
        solution = self.solve(self.length * rows, outside - shrunk, preferred)
        return solution, preferred, dict(zip(aims, postures, strict=True))

    def sweep(self, q: Array, aims: tuple[Aim, ...], postures: list[Array]) -> float:
        """Move each of ``postures``, one for each aim (hand and goal), in place, by a step of
        :meth:`step_nearer`, so that the path from ``q`` through all of them gets shorter; return
        the largest length of these steps before they were limited, length unit and rad mixed. As
        preferred a step gets the mean of the postures before and after, weighted by inverse
        distances (Weiszfeld 1937), and the last step the posture before."""
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
        """Return the posture ``(dof,)`` after a Gauss-Newton step from ``posture``, a new array,
        and the length of the step before it was limited to 0.1, length unit and rad mixed. The
        steps lead to the posture that hits the goal of an aim (hand and goal) and is nearest to
        ``preferred``, ``(dof,)``; joints have no limits. Where a step brings the hand hardly
        nearer, the arm is bent besides."""
        rows, outside = self.faces(posture, aim)
        wanted = _POSTURE_GAIN * (preferred - posture)[self.moving]
        change = self.solve(rows, outside, wanted).changes
        short = outside.max()
        if short > _MARGIN and (outside - rows @ change).max() > 0.9 * short:
            # Singular in the very direction of the goal, such as a straight arm with its goal
            # behind: bend, and the next step finds a way.
            arm = self.session.joints(aim.hand)
            bent = (self.moving >= arm.start) & (self.moving < arm.stop)
            change[bent] += np.resize([1.0, -1.0], bent.sum())
        length = float(np.linalg.norm(change))
        return self.add(posture, change * min(1.0, _POSTURE_STEP / max(length, 1e-12))), length

    def faces(self, q: Array, aim: Aim) -> tuple[Array, Array]:
        """Return A, ``(16, joints)``, and b, ``(16,)``, length unit: to first order a change x of
        the joints that are not locked brings the hand of an aim (hand and goal) from configuration
        ``q`` into a polygon within its goal's disc if A x >= b."""
        jacobian = self.session.jacobian(q, aim.hand)[:, self.moving]
        radius = (self.task.radius - _MARGIN) * _INSET
        return _FACE_NORMALS @ jacobian, _FACE_NORMALS @ self.error(q, aim) - radius


class CurrentGoal(Control):
    """Posture QP that looks at the current goal alone."""

    name = "posture-qp/current-goal"
    version = 2
    tuned_on = "30 development instances: some 60 settings"
    title = "Posture QP, current goal"
    controller = PostureController


class GoalsAhead(CurrentGoal):
    """Posture QP whose posture for the current goal is chosen with a view to the next two goals."""

    name = "posture-qp/goals-ahead"
    title = "Posture QP, goals ahead"
    citation = Control.citation + CITATION_AHEAD
    information = CurrentGoal.information | {Information.SECONDARY_OBJECTIVES}
    goals_ahead = 2


METHODS: tuple[type[Control], ...] = (CurrentGoal, GoalsAhead)
