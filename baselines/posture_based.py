"""Posture-based planning: find a goal posture from stored postures, then move to it.

The theory is that of Rosenbaum, Meulenbroek, Vaughan & Jansen (2001). For each goal the planner
first finds a posture in which the hand is at the goal. Then the robot moves straight in joint space
to that posture:

1. *Instance retrieval.* Each stored posture is corrected so that the hand comes to the goal. Among
   the corrected postures whose hand is at the goal, the planner retrieves the one with the lowest
   travel cost.
2. *Instance generation.* Until a deadline, the planner generates random postures near the retrieved
   one (*diffusion*). These postures are corrected by the same kind of steps as stored postures, and
   evaluated by the same travel cost. The feedforward correction improves the accuracy of the
   postures (Rosenbaum, Loukopoulos, Meulenbroek, Vaughan & Engelbrecht 1995).
3. *Simulation.* An internal simulation computes where the movement will end. The planned postures
   are added to the stored postures.

With a horizon of two goals, the travel cost includes the path from the posture at the current goal
to a posture at the next goal. Only the movement to the current goal is made. When this goal is hit,
the posture at the next goal is planned again. The authors name anticipation as an extension (1995);
this form of anticipation is ours.

The method differs from the theory in these points:

- The travel cost is the joint-space distance, on which the reward of the tasks depends. In the
  theory each joint has its own expense factor.
- The constraint hierarchy has two levels (accuracy, then travel cost), because there are no
  obstacles.
- At first the stored postures are random postures of the arms around the start. For each goal, the
  base is moved so that the hand is at the goal.
- The generated postures are drawn around a weighted mean of the better postures (the rule of 1995),
  with a standard deviation that falls until the deadline. So the search converges.
- The hand is chosen together with the posture.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from coartic import Movement
from coartic.baselines.posture_graph import KINEMATICS, HandSequence, Layers
from coartic.method import Facts, Information, Method, MethodError, Parameters, Result, Session
from coartic.method.optimisers import explored_joints
from coartic.motion.kernels.compile import chain_by, entry, joint_lever
from coartic.robot import BASE_DOF, Array, Hand

Mask = NDArray[np.bool_]

PER_ROUND = 60
"""Number of postures that a round generates for each hand sequence."""
# Feedforward correction: damped Gauss-Newton steps on the hand's error.
_DAMPING = 1e-3  # in squared length units: the Jacobian of a straight arm is singular
_MAX_STEP = 0.5  # in length units: largest part of the error that one step corrects
_RETRIEVED = 40  # steps for a stored posture, which may be far from the goal
_GENERATED = 3  # steps for a generated posture, which is near the goal
_INSIDE = 0.999  # a step aims at this part of the tolerated error
_SPREAD = 1.0  # largest SD of stored postures around the starting posture, in rad
_FIRST_SD = 0.3  # first SD of the diffusion, in length units (base) or rad (joints)
_LAST_SD = 0.01  # last SD of the diffusion, as a part of the first


class PostureBasedParameters(Parameters):
    """Parameters of posture-based planning.

    These settings were tried by hand:

    - 50, 300 and 1000 stored postures, over 5 seeds on each shipped task: mean rewards are within 3
      of each other;
    - 60 and 100 rounds of 60 postures, 40 rounds of 100, first SDs of 0.1 and 0.3, and last SDs of
      0.001 and 0.01 of the first, over 6 seeds on the first two goals of three tasks: within 3
      ticks;
    - equal weights, and diffusion at all widths in each round, on the same goals: differences of up
      to 4 ticks.
    """

    stored: Annotated[int, Field(ge=0, le=2000)] = 300
    """Number of random postures that the planner stores at first, besides the starting posture."""
    rounds: Annotated[int, Field(ge=0)] = 60
    """Number of rounds of generation for each goal. The end of the last round is the deadline."""


class PostureBased(Method):
    """Base class of posture-based planning over a horizon of ``horizon`` goals (1 or 2)."""

    version = 2
    horizon: ClassVar[Literal[1, 2]]
    tuned_on = "the paper's tasks, by hand"
    information = KINEMATICS | {Information.REWARD_FORMULA}
    Parameters = PostureBasedParameters
    quick: ClassVar[Mapping[str, Any]] = {"stored": 50, "rounds": 15}

    def solve(self, session: Session) -> Result:
        """Plan the movements to the goals one after the other, and return them.

        The details contain a list with the expected ticks of each movement (``expected_ticks``).
        Raises MethodError if for some goal no stored posture can be corrected so that a hand is at
        the goal.
        """
        with session.building():
            planner = PosturePlanner(session, self.parameters, self.horizon)
        with session.solving():
            movements, ticks = planner.plan()
        return Result(movements, {"expected_ticks": ticks})


class OneGoal(PostureBased):
    """Posture-based planning that chooses each posture only for its own goal."""

    name = "posture-based/one-goal"
    title = "posture planning, one goal"
    facts = Facts(
        works=("rosenbaum2001",),
        algorithm="posture planning",
        short="postures, one goal",
    )
    horizon = 1


class TwoGoals(PostureBased):
    """Posture-based planning that chooses each posture together with one for the next goal."""

    name = "posture-based/two-goals"
    title = "posture planning, two goals"
    facts = Facts(
        works=("rosenbaum2001",),
        algorithm="posture planning",
        short="postures, two goals",
    )
    horizon = 2


METHODS: tuple[type[Method], ...] = (OneGoal, TwoGoals)


class PosturePlanner:
    """Plan the movements of a task from stored postures.

    Attribute ``store`` contains the stored postures, shape ``(n, dof)``. Attribute ``q`` is the
    configuration in which the movements planned so far are expected to end, shape ``(dof,)``. Both
    are in length units (base) and rad (joints).
    """

    def __init__(
        self, session: Session, parameters: PostureBasedParameters, horizon: Literal[1, 2]
    ) -> None:
        self.session = session
        self.rounds = parameters.rounds
        self.horizon = horizon
        self.robot = session.reveal(Information.FORWARD_KINEMATICS, Information.JACOBIAN).robot
        self.goals = session.goals
        # If the target brings the hand within the radius minus the arrival tolerance of the goal's
        # centre, the movement hits the goal before it arrives.
        arrival, _ = session.model.tolerances(session.radius)
        self.tolerance = session.radius - arrival
        self.base_and_arm = {hand: np.zeros(session.dof, bool) for hand in session.hands}
        for hand, mask in self.base_and_arm.items():
            mask[:BASE_DOF] = mask[session.joints(hand)] = True
        self.movable: Mask = explored_joints(session)
        self.free = {hand: self.movable & mask for hand, mask in self.base_and_arm.items()}
        """Dict that maps each hand to a mask, shape ``(dof,)``: True for the free base coordinates
        and the joints of the arm of this hand."""
        # SDs are uniform from zero: postures are dense near the start and sparse far from it.
        sds = _SPREAD * session.rng.uniform(size=(parameters.stored, 1))
        noise = session.rng.standard_normal((parameters.stored, session.dof))
        self.q = session.q0
        self.store = np.vstack([session.q0, session.q0 + sds * noise * self.movable])
        # Weights of the better postures, best first: logarithmic in the rank.
        better = math.ceil(PER_ROUND / 4)
        self.weights = np.log(better + 0.5) - np.log(np.arange(1, better + 1))

    def plan(self) -> tuple[tuple[Movement, ...], list[int]]:
        """Plan the movements to all goals.

        Call this method only once, because it changes ``self.q`` and ``self.store``.

        Returns
        -------
        tuple of Movement
            The movement to each goal.
        list of int
            Ticks that each movement is expected to take.

        Raises
        ------
        MethodError
            For some goal, no stored posture can be corrected so that a hand is at the goal.
        """
        movements, ticks, step = [], [], self.session.model.step
        for goal in range(len(self.goals)):
            ahead = range(goal, min(goal + self.horizon, len(self.goals)))
            retrieved = self.retrieve(ahead)
            promising, noise = dict[HandSequence, Array](), list[Array]()
            for hands in itertools.product(self.session.hands, repeat=len(ahead)):
                layers = [retrieved[key] for key in zip(ahead, hands, strict=True)]
                if all(len(layer) for layer in layers):
                    shape = self.rounds, PER_ROUND, len(ahead), self.session.dof
                    noise.append(self.session.rng.standard_normal(shape))
                    promising[hands] = self.most_promising(hands, layers)
            if not promising:
                able = {goal for (goal, _), postures in retrieved.items() if len(postures)}
                raise MethodError(
                    "infeasible",
                    f"goal {min({*ahead} - able) + 1}: correction brings none of "
                    f"{len(self.store)} stored postures to it, with the "
                    f"{' or '.join(self.session.hands)} hand within {self.tolerance:g} length "
                    "units of its centre",
                )
            chains = self.generate(promising, np.stack(noise), ahead)
            _, (hand, *_), postures = min(chains, key=lambda chain: chain[0])
            self.store = np.vstack([self.store, postures])
            movements.append(Movement(goal + 1, hand, "planned", postures[0]))
            # Internal simulation of the movement until it hits the goal.
            distance = float(np.linalg.norm(postures[0] - self.q))
            along = np.arange(math.ceil(distance / step))[:, None] * step
            line = self.q + along / max(distance, step) * (postures[0] - self.q)
            line = np.vstack([line, postures[0]])
            miss = self.session.forward_kinematics(line, hand) - self.goals[goal]
            hit = int(np.argmax(np.hypot(miss[:, 0], miss[:, 1]) <= self.session.radius))
            self.q = line[hit]
            ticks.append(hit + 1)
        return tuple(movements), ticks

    def retrieve(self, goals: range) -> Layers:
        """Correct the stored postures towards goals, and return those that hit the goals.

        For each goal and hand, each stored posture is corrected in three steps:

        1. The angles of the hand's arm are copied from the stored posture, and all other entries
           from ``self.q``, the configuration in which the movements planned so far end.
        2. The free base coordinates move by the displacement from the hand to the goal.
        3. Base and arm are corrected (:meth:`correct`). A posture is left out if its hand is still
           not at the goal.

        Parameters
        ----------
        goals : range
            Numbers of the goals, from 0.

        Returns
        -------
        dict
            Dict that maps each pair (goal, hand) to the postures in which this hand is at this
            goal, shape ``(n, dof)``.
        """
        retrieved: Layers = {}
        for goal, hand in itertools.product(goals, self.session.hands):
            postures = np.tile(self.q, (len(self.store), 1))
            arm = self.session.joints(hand)
            postures[:, arm] = self.store[:, arm]
            miss = self.goals[goal] - self.session.forward_kinematics(postures, hand)
            postures[:, :BASE_DOF] += miss * self.movable[:BASE_DOF]
            retrieved[goal, hand] = postures[self.correct(postures, goal, hand, _RETRIEVED)]
        return retrieved

    def most_promising(self, hands: HandSequence, layers: list[Array]) -> Array:
        """Return the retrieved postures with the shortest joint-space path from ``self.q``.

        On the way to the second of two postures only the base and the arm of the second hand move.

        Parameters
        ----------
        hands : tuple of str
            Hand of each goal.
        layers : list of ndarray, shape (n, dof)
            Retrieved postures of each goal: one array for a horizon of 1, two arrays for 2.

        Returns
        -------
        ndarray, shape (goals, dof)
            A posture for each goal.
        """
        postures = layers[0]
        cost = np.linalg.norm(postures - self.q, axis=1)
        if len(layers) == 1:
            return postures[[np.argmin(cost)]]
        next_postures = layers[1]
        used = self.base_and_arm[hands[1]]
        # A posture that costs more than some pair cannot begin the best pair.
        onward = np.linalg.norm(postures[np.argmin(cost)][used] - next_postures[:, used], axis=1)
        near = np.flatnonzero(cost <= cost.min() + onward.min())
        onward = np.linalg.norm(
            postures[near][:, None, used] - next_postures[None][:, :, used], axis=2
        )
        i, j = np.unravel_index(np.argmin(cost[near][:, None] + onward), onward.shape)
        i = near[i]
        return np.stack([postures[i], np.where(used, next_postures[j], postures[i])])

    def generate(
        self, promising: dict[HandSequence, Array], noises: Array, goals: range
    ) -> list[tuple[float, HandSequence, Array]]:
        """Improve the retrieved postures of each hand sequence by random search.

        Parameters
        ----------
        promising : dict
            Dict that maps each hand sequence to its retrieved postures, shape ``(goals, dof)``.
        noises : ndarray, shape (hand sequences, rounds, PER_ROUND, goals, dof)
            Standard normal noise.
        goals : range
            Numbers of the goals, from 0.

        Returns
        -------
        list of tuple
            For each hand sequence a tuple (cost, hand sequence, postures). The postures, shape
            ``(goals, dof)``, are the cheapest postures that were found. The cost is the joint-space
            length of the path from ``self.q`` through these postures.
        """
        sequences = [*promising]
        centre = best = np.stack([*promising.values()])
        costs = _path_length(self.q, best)
        for number, sd in enumerate(_FIRST_SD * np.geomspace(1.0, _LAST_SD, self.rounds)):
            noise = sd * noises[:, number]
            noise[:, 0] = 0.0  # the weighted mean itself is evaluated, too
            postures = centre[:, None] + noise
            # Postures are corrected goal by goal. The arm that is not chosen does not move.
            accurate = np.ones(postures.shape[:2], bool)
            before = np.broadcast_to(self.q, (*postures.shape[:2], postures.shape[-1])).copy()
            for k, goal in enumerate(goals):
                for hand in self.session.hands:
                    chosen = [i for i, hands in enumerate(sequences) if hands[k] == hand]
                    if chosen:
                        posture = np.where(self.free[hand], postures[chosen, :, k], before[chosen])
                        accurate[chosen] &= self.correct(posture, goal, hand, _GENERATED)
                        postures[chosen, :, k] = before[chosen] = posture
            lengths = np.where(accurate, _path_length(self.q, postures), np.inf)
            order = np.argsort(lengths, axis=1, kind="stable")
            centre, best = centre.copy(), best.copy()
            for k, count in enumerate(accurate.sum(axis=1)):
                better = order[k, : min(len(self.weights), count)]
                if not len(better):
                    continue
                weights = self.weights[: len(better)]
                centre[k] = np.tensordot(weights / weights.sum(), postures[k, better], axes=1)
                if lengths[k, better[0]] < costs[k]:
                    best[k], costs[k] = postures[k, better[0]], lengths[k, better[0]]
        return list(zip(costs.tolist(), sequences, best, strict=True))

    def correct(self, postures: Array, goal: int, hand: Hand, steps: int) -> Mask:
        """Correct postures by damped Gauss-Newton steps, so that a hand comes to a goal.

        The free base coordinates and the joints of the hand's arm change, in place. The session
        counts the evaluations of the forward kinematics and the Jacobians.

        Parameters
        ----------
        postures : ndarray, shape (..., dof)
            Postures, a contiguous array that is changed in place.
        goal : int
            Number of the goal, from 0.
        hand : {"left", "right"}
        steps : int
            Largest number of steps for a posture.

        Returns
        -------
        ndarray of bool, shape (...)
            True for each posture in which the hand is now within ``self.tolerance`` of the goal's
            centre.
        """
        flat = postures.reshape(-1, postures.shape[-1])
        arm = self.robot.arm(hand)
        far = np.arange(len(flat))
        wanted = np.empty((len(far), 2, 1))
        jacobian = np.zeros((len(far), 2, flat.shape[-1]))
        jacobian[:, [0, 1], [0, 1]] = self.movable[:BASE_DOF]
        joints = np.empty((2, len(arm.links) + 1))
        x, y = self.goals[goal]
        for step in range(steps + 1):
            left = _linearise_far(flat, far, arm, x, y, self.tolerance, wanted, jacobian, *joints)
            self.session.spend(forward_kinematics=len(far))
            far = far[:left]
            if step == steps or not left:
                break
            across = jacobian[:left]
            transpose = across.transpose(0, 2, 1)
            gram = across @ transpose + _DAMPING * np.eye(2)
            flat[far] += (transpose @ np.linalg.solve(gram, wanted[:left]))[..., 0]
        at_goal = np.ones(len(flat), bool)
        at_goal[far] = False
        return at_goal.reshape(postures.shape[:-1])


@entry
def _linearise_far(
    postures: Any,
    far: Any,
    arm: Any,
    x: float,
    y: float,
    tolerance: float,
    wanted: Any,
    jacobian: Any,
    xs: Any,
    ys: Any,
) -> int:
    """Find postures in which a hand is far from (x, y), and linearise its position.

    Parameters
    ----------
    postures : ndarray, shape (N, dof)
        Postures, in length units and rad.
    far : ndarray of int, shape (F,)
        Indices of the postures to look at. The indices of the postures in which the hand is farther
        than ``tolerance`` from (x, y) are written to the beginning of this array, in order.
    arm : Arm
        Arm of the hand, with n links.
    x, y : float
        Centre of the goal, in length units.
    tolerance : float
        Distance above which a hand is far from (x, y), in length units.
    wanted : ndarray, shape (F, 2, 1)
        Entry k is set to the step that the hand is to make towards (x, y) in the k-th of these
        postures, at most 0.5 length units long.
    jacobian : ndarray, shape (F, 2, dof)
        In entry k, the columns of the joints of the arm are set to the derivatives of the hand's
        position in the k-th of these postures. Other columns do not change.
    xs, ys : ndarray, shape (n + 1,)
        Work space.

    Returns
    -------
    int
        Number of postures in which the hand is far from (x, y).
    """
    tip = len(arm.links)
    left = 0
    for row in far:  # with the C library's cosine and sine, as in the robot's own kinematics
        chain_by(postures[row], arm, xs, ys, math.cos, math.sin)
        miss_x = x - xs[tip]
        miss_y = y - ys[tip]
        distance = math.hypot(miss_x, miss_y)
        if distance > tolerance:
            share = min(distance - _INSIDE * tolerance, _MAX_STEP) / distance
            wanted[left, 0, 0] = miss_x * share
            wanted[left, 1, 0] = miss_y * share
            for k in range(tip):
                dx, dy = joint_lever(xs, ys, k, tip)
                jacobian[left, 0, arm.first_joint + k] = dx
                jacobian[left, 1, arm.first_joint + k] = dy
            far[left] = row
            left += 1
    return left


def _path_length(q: Array, postures: Array) -> Array:
    """Return the joint-space lengths of paths from a configuration through k postures.

    ``q`` has shape ``(dof,)`` and ``postures`` shape ``(..., k, dof)``. The result has shape
    ``(...)``, in a mix of length units and rad.
    """
    start = np.broadcast_to(q, (*postures.shape[:-2], 1, postures.shape[-1]))
    legs = np.diff(np.concatenate([start, postures], axis=-2), axis=-2)
    length: Array = np.linalg.norm(legs, axis=-1).sum(axis=-1)
    return length
