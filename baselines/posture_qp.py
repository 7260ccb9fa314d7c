"""Posture QP: a controller that goes straight in joint space to goal postures.

A goal posture is a configuration in which the hand is in its goal. Unlike null-space control
(:mod:`coartic.baselines.nullspace_qp`), this controller mainly plans postures. The priority of the
hand rarely binds, because the joints already go straight to a posture in which the hand is in its
goal. The ``details`` of a run count the control steps in which each level binds.

The controller stores a **posture** for the current goal and for each goal ahead. The cascade of two
quadratic programmes (:mod:`coartic.baselines.cascade`) computes both the changes of the postures
and the control steps: level 1 moves the hand into a disc, and level 2 moves the joints towards a
preferred configuration. A regular polygon inscribed in the disc takes the place of the disc, so
that the constraint is linear in the change x of the joints::

    n_i · (c - p(q) - J x) <= ρ  for all i,  that is  A = (n_i · J),  b = (n_i · (c - p(q)) - ρ)

Here p(q) is the position of the hand, J its Jacobian, c the centre of the disc, n_i are the normals
of the polygon's sides and ρ is the distance of the sides from c.

- *Postures.* The disc is that of the goal. The preferred configurations are chosen so that the path
  through the postures becomes shorter. Like the reward, the length of the path is Euclidean in
  joint space. The postures converge to a local minimum.
- *Control steps.* The disc is centred on the goal. Its radius is a little smaller than the present
  distance of the hand from the centre, so that the disc shrinks with each control step. The
  preferred configuration lies on the straight line to the posture. So the hand comes nearer to the
  goal with each control step, and otherwise the joints move as they prefer.

An iterative descent finds each posture once. When a goal becomes current, and goals ahead are
considered, all postures are then moved until the path through them no longer becomes shorter. In
each control step except the first one to a goal, the postures are improved by one further
iteration. The two methods differ in the objective of the posture for the current goal:

- ``current-goal``: the posture that is nearest to the robot's configuration;
- ``goals-ahead``: the posture that makes the path through the postures of this goal and the next
  two goals shortest. The postures of the next goals are variables of the same problem.

The controller was tuned only on thirty development instances (``d000`` to ``d009`` of families
one-armed, two-armed and aligned): 12 settings of the controller and, before that, some 50 settings
of a prototype. Three numbers were varied, one at a time:

- *Least speed.* Lower bound on the speed with which the hand comes nearer to the goal, as a
  fraction of a constant speed: that with which the hand would arrive after as many control steps as
  the joints need for the straight line to the posture.
- *Weight of the next segment.* Each posture minimises a weighted sum of the lengths of two path
  segments. The segment from the posture before (or from the robot's configuration) to the
  posture has weight 1, and the segment from the posture to the next posture has this weight.
- *Goals ahead.* Number of goals after the current goal whose postures are part of the path.

The table shows, for each value, the mean gap of ``goals-ahead`` to the best known path. A star
marks the value that is used. The second and the third number were varied with a least speed of 0.1:

==========================  ===================================================================
least speed                 0: 2.2 %, 0.03 ★: 2.2 %, 0.1: 2.3 %, 0.3: 2.6 %, 0.6: 3.4 %,
                            1: 6.9 %
weight of the next segment  0.5: 6.9 %, 0.7: 4.0 %, 0.85: 2.7 %, 1 ★: 2.3 %, 1.2: 2.6 %
goals ahead                 none: 20.1 %, 1: 5.6 %, 2 ★: 2.3 %, 3: 2.2 %; a prototype: 2.0 % for
                            all
==========================  ===================================================================

On the same instances the gap of the corrective process on its own, with its best hand sequence, is
24.8 %. The gap of ``current-goal`` is 20.1 %.

The remaining gap comes from local minima. The descent that finds a posture starts from the
configuration of the robot; the path to a posture of another branch of the inverse kinematics may be
far shorter (35 % on the worst of the thirty instances).
"""

from __future__ import annotations

import numpy as np

from coartic.baselines.cascade import Solution
from coartic.baselines.controllers import Aim, Control, Controller
from coartic.method import Facts, Information
from coartic.robot import Array, directions

FACES = 16
"""Number of sides of the polygon that is inscribed in a goal's disc. The distance between a side
and the rim of the disc is at most 2 % of the radius."""

_FACE_NORMALS = directions(2 * np.pi * np.arange(FACES) / FACES)
_INSET = float(directions(np.pi / FACES)[0])
_MARGIN = 1e-4  # in length units: the hand never reaches the polygon, but enters the disc
_CLOSING = 0.03  # least speed of the hand towards the goal, as a share of the constant speed
_POSTURE_STEPS = 400  # largest number of steps of a search for a posture
_POSTURE_STEP = 0.1  # longest of these steps, in length units and rad: longer steps end far away
_POSTURE_GAIN = 0.5  # share of the path to the preferred posture in a step: 1 may oscillate
_POSTURE_TOLERANCE = 1e-3  # length of a step at which a search ends, in length units and rad
_SHORTEST = 0.02  # shorter paths get the weight of this length, in length units and rad


class PostureController(Controller):
    """Go straight in joint space to a posture that hits the current goal.

    An aim is a pair of a hand and a goal. The memory of the controller is a dict that maps the aim
    for the current goal, and the aim for each goal ahead, to a posture of shape ``(dof,)``, in
    length units (base) and rad (joints).
    """

    def begin(
        self, q: Array, aims: tuple[Aim, ...], memory: dict[Aim, Array] | None
    ) -> dict[Aim, Array]:
        """Find a posture for each aim, and return them as the memory.

        1. If ``memory`` contains a posture for an aim, that posture is used. Otherwise an iterative
           descent finds one. The descent begins at the posture for the aim before, or at ``q`` for
           the first aim.
        2. If there is more than one aim, all postures are then moved to shorten the path from ``q``
           through the postures (:meth:`sweep`).

        Each descent ends after at most 400 steps, and the shortening of the path after at most 400
        calls of :meth:`sweep`. If one of them has not converged by then, a posture may miss its
        goal.

        Parameters
        ----------
        q : ndarray, shape (dof,)
            Configuration at the beginning of the movement.
        aims : tuple of Aim
            Hand and goal: the current goal, then the goals ahead.
        memory : dict or None
            Dict that maps each aim of the previous movement to its posture, shape ``(dof,)``; None
            for the first movement.

        Returns
        -------
        dict
            Dict that maps each aim to its posture, shape ``(dof,)``.
        """
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
        """Compute a control step towards the posture of the current goal.

        Before the control step, the postures in ``memory`` are improved by one iteration
        (:meth:`sweep`), except before the first control step of a movement. Parameters and returned
        values are those of :meth:`Controller.step`.
        """
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
        """Shorten the path from ``q`` through all postures, by one step of each posture.

        Each posture makes a step towards a preferred posture (:meth:`step_nearer`). The preferred
        posture is the weighted mean of the two neighbours of the posture on the path; the weight of
        a neighbour is the inverse of its distance from the posture, where distances below 0.02 are
        replaced by 0.02 (Weiszfeld's algorithm, 1937). The neighbour before the first posture is
        ``q``. The last posture has only one neighbour, which is its preferred posture.

        Parameters
        ----------
        q : ndarray, shape (dof,)
            Configuration at the beginning of the path.
        aims : tuple of Aim
            Hand and goal of each posture.
        postures : list of ndarray, shape (dof,)
            Postures, which are replaced in the list.

        Returns
        -------
        float
            Length of the longest step, before the steps were limited to 0.1, in a mix of length
            units and rad.
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
        """Make a Gauss-Newton step towards the goal posture that is nearest to ``preferred``.

        If the step hardly brings the hand nearer to the goal, because the arm is singular, the step
        also bends the joints of the arm.

        Parameters
        ----------
        posture : ndarray, shape (dof,)
            Posture before the step.
        preferred : ndarray, shape (dof,)
            Preferred posture.
        aim : Aim
            Hand and goal.

        Returns
        -------
        ndarray, shape (dof,)
            Posture after the step (a new array).
        float
            Length of the step before it was limited to 0.1, in a mix of length units and rad.
        """
        rows, outside = self.faces(posture, aim)
        wanted = _POSTURE_GAIN * (preferred - posture)[self.moving]
        change = self.solve(rows, outside, wanted).changes
        short = outside.max()
        if short > _MARGIN and (outside - rows @ change).max() > 0.9 * short:
            # The arm is singular in the direction of the goal, such as a straight arm whose goal is
            # behind the hand. Bending it lets the next step come nearer.
            arm = self.session.joints(aim.hand)
            bent = (self.moving >= arm.start) & (self.moving < arm.stop)
            change[bent] += np.resize([1.0, -1.0], bent.sum())
        length = float(np.linalg.norm(change))
        return self.add(posture, change * min(1.0, _POSTURE_STEP / max(length, 1e-12))), length

    def faces(self, q: Array, aim: Aim) -> tuple[Array, Array]:
        """Return the linearised constraint that a hand is in its goal's polygon.

        To first order, the constraint is A x >= b for the change x of the joints.

        Parameters
        ----------
        q : ndarray, shape (dof,)
            Configuration before the change x of the joints.
        aim : Aim
            Hand and goal.

        Returns
        -------
        ndarray, shape (16, joints)
            Matrix A, in length units per unit of change.
        ndarray, shape (16,)
            Vector b, in length units.
        """
        jacobian = self.session.jacobian(q, aim.hand)[:, self.moving]
        radius = (self.task.radius - _MARGIN) * _INSET
        return _FACE_NORMALS @ jacobian, _FACE_NORMALS @ self.error(q, aim) - radius


class CurrentGoal(Control):
    """Posture QP that considers only the current goal."""

    name = "posture-qp/current-goal"
    version = 2
    tuned_on = "30 development instances: some 60 settings"
    title = "posture QP, current goal"
    facts = Facts(
        works=("nakamura1987", "kanoun2011"),
        solvers=("arnstrom2022",),
        algorithm="posture QP",
        short="posture QP, current",
    )
    controller = PostureController


class GoalsAhead(CurrentGoal):
    """Posture QP that plans postures for the current goal and the next two goals together."""

    name = "posture-qp/goals-ahead"
    title = "posture QP, goals ahead"
    facts = Facts(
        works=("nakamura1987", "kanoun2011", "rohanimanesh2004", "thibodeau2004"),
        solvers=("arnstrom2022",),
        algorithm="posture QP",
        short="posture QP, ahead",
    )
    information = CurrentGoal.information | {Information.SECONDARY_OBJECTIVES}
    goals_ahead = 2


METHODS: tuple[type[Control], ...] = (CurrentGoal, GoalsAhead)
