"""Posture-based planning: stored postures, a constraint hierarchy, diffusion.

For every goal a posture is planned first, then the straight joint-space movement to it
(Rosenbaum, Meulenbroek, Vaughan & Jansen 2001):

1. *Instance retrieval.* Of the stored postures first those survive whose hand is at the goal, then
   the one with the least cost of travel.
2. *Instance generation.* Postures that resemble it are generated and evaluated in the same way
   until a deadline. What a generated posture lacks in accuracy, feedforward correction makes up for
   (Rosenbaum, Loukopoulos, Meulenbroek, Vaughan & Engelbrecht 1995).
3. An internal simulation says where the movement ends; the posture joins the store.

With a horizon of two goals the cost of travel includes the way on to a posture for the next goal.
Only the first movement is made; the second posture is planned anew from there. The authors name
anticipation as an extension (1995); this form of it is ours.

Where this differs from the theory: the cost of travel is the joint-space distance, which the tasks
charge, not each joint's expense. The hierarchy has two levels, as there are no obstacles. The store
is filled with random postures of the arms about the start, with the base wherever that takes the
hand to the goal. Diffusion gets narrower until the deadline, about a weighted sum of the better
postures (the rule of 1995), so that it converges. The hand is planned with the posture.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from coartic import Movement, Task
from coartic.method import Information, Method, MethodError, Parameters, Result, Session
from coartic.motion.compiled import chain_by, entry, joint_lever
from coartic.motion.initial import too_many_sequences
from coartic.robot import BASE_DOF, Array, Hand
from coartic.tasks.task import hands_of

Mask = NDArray[np.bool_]
Hands = tuple[Hand, ...]
Layers = dict[tuple[int, Hand], Array]

# Feedforward correction: damped Gauss-Newton steps on the hand's error.
_DAMPING = 1e-3  # length unit squared: the Jacobian of a straight arm is singular
_LONGEST = 0.5  # length unit: what one step takes on of the error
_RETRIEVED = 40  # steps for a stored posture, which may be far off
_GENERATED = 3  # steps for a generated one, which is close by
_INSIDE = 0.999  # part of the tolerated error that is aimed at
_FINEST = 0.01  # last SD of the diffusion, as a part of the first
_TOGETHER = 16  # plans that are made side by side: more take memory, and no less time


class PostureBasedParameters(Parameters):
    """Parameters of posture-based planning.

    Tried by hand. Over 5 seeds on each shipped task, 50, 300 and 1000 stored postures (mean rewards
    within 3 of each other). Over 6 seeds on the first two goals of three tasks, 60 and 100 rounds
    of 60, 40 of 100, first SDs of 0.1 and 0.3, last ones of 0.001 and 0.01 of these (within 3
    ticks); equal weights, and diffusion at all widths in each round (up to 4 ticks).
    ``hands="every"`` matters where a goal's cheapest hand is the wrong one for the next:
    two-armed-1 with one goal gets -520 so, -624 with hands chosen goal by goal.
    """

    stored: Annotated[int, Field(ge=0, le=2000)] = 300
    """Random postures in the store, beside the starting posture."""
    spread: Annotated[float, Field(gt=0, le=10)] = 1.0
    """Largest SD of their joint angles about the starting posture, rad."""
    rounds: Annotated[int, Field(ge=0)] = 60
    """Rounds of generation until the deadline."""
    batch: Annotated[int, Field(ge=1)] = 60
    """Postures generated in a round."""
    diffusion: Annotated[float, Field(gt=0, le=10)] = 0.3
    """First SD of the generated postures, length unit (base) or rad (joints)."""
    hands: Literal["chosen", "given", "every"] = "chosen"
    """By cost of travel, goal by goal; the sequence that the task names; or every
    sequence, of which the one with the best reward expected is kept."""
    other_arm: Literal["still", "free"] = "still"
    """Whether the arm that is not to hit the goal may move as well."""


class PostureBased(Method):
    """Posture-based planning over a horizon of goals."""

    horizon: ClassVar[Literal[1, 2]]
    citation = (
        "D. A. Rosenbaum, R. J. Meulenbroek, J. Vaughan, C. Jansen (2001). Posture-based "
        "motion planning: applications to grasping. Psychological Review 108(4), 709-734, "
        "doi:10.1037/0033-295X.108.4.709."
    )
    told = frozenset(
        {
            Information.GOALS,
            Information.FORWARD_KINEMATICS,
            Information.JACOBIAN,
            Information.REWARD_FORMULA,
        }
    )
    Parameters = PostureBasedParameters
    quick: ClassVar[Mapping[str, Any]] = {"stored": 50, "rounds": 15}

    def why_not(self, task: Task) -> str | None:
        """A policy names no hands; or more sequences than can be planned one by one."""
        if self.parameters.hands == "given" and task.initial_is_policy:
            return f"task {task.name!r} names no hand sequence but {task.initial_hands!r}"
        if self.parameters.hands == "every":
            return too_many_sequences(task, len(task.hands))
        return None

    def solve(self, session: Session) -> Result:
        """Plan goal by goal, each from where the movement before it will have ended."""
        options: list[list[Hands]] = [[session.hands] * session.goals_count]
        if self.parameters.hands == "given":
            options = [[(hand,) for hand in hands_of(session.initial_hands)]]
        elif self.parameters.hands == "every":
            sequences = itertools.product(sorted(session.hands), repeat=session.goals_count)
            options = [[(hand,) for hand in hands] for hands in sequences]
        with session.building():
            planner = Planner(session, self.parameters, self.horizon)
        with session.solving():
            plans = planner.plans(options)
        best = min(plans, key=lambda plan: sum(plan.ticks))
        return Result(tuple(best.movements), {"expected_ticks": best.ticks})


class OneGoal(PostureBased):
    """Each posture is planned for its own goal."""

    name = "posture-based/one-goal"
    title = "Posture-based planning, one goal at a time"
    secondary = ("least cost of travel to the posture",)
    horizon = 1


class TwoGoals(PostureBased):
    """Each posture is planned together with the next one."""

    name = "posture-based/two-goals"
    title = "Posture-based planning, one goal ahead"
    secondary = ("least cost of travel to the posture and on to the next one",)
    horizon = 2


@entry
def reach_kernel(
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
    """Keep in ``far`` the postures with the hand away from (x, y); how many those are.

    For each of them, in their order, ``wanted`` has the step that the hand is to make, and
    ``jacobian`` the columns of the arm's joints.
    """
    tip = len(arm.links)
    left = 0
    for row in far:  # with the C library's cosine and sine, as in the robot's own kinematics
        chain_by(postures[row], arm, xs, ys, math.cos, math.sin)
        miss_x = x - xs[tip]
        miss_y = y - ys[tip]
        distance = math.hypot(miss_x, miss_y)
        if distance > tolerance:
            share = min(distance - _INSIDE * tolerance, _LONGEST) / distance
            wanted[left, 0, 0] = miss_x * share
            wanted[left, 1, 0] = miss_y * share
            for k in range(tip):
                dx, dy = joint_lever(xs, ys, k, tip)
                jacobian[left, 0, arm.first + k] = dx
                jacobian[left, 1, arm.first + k] = dy
            far[left] = row
            left += 1
    return left


@dataclass
class GrowingPlan:
    """A plan in the making, with hands to choose from for each goal."""

    options: list[Hands]
    noise: list[Array]
    """Of the goals to come, where it was drawn beforehand."""
    store: Array
    """Shape ``(stored, dof)``."""
    q: Array
    """Where the movements so far will have ended."""
    movements: list[Movement] = field(default_factory=list)
    ticks: list[int] = field(default_factory=list)
    """What each is expected to take."""


class Search(NamedTuple):
    """What postures for successive goals are generated from."""

    q: Array
    hands: Hands
    promising: Array
    """Shape ``(goals, dof)``."""
    noise: Array
    """Shape ``(rounds, batch, goals, dof)``."""


PostureChain = tuple[float, Hands, Array]
"""Postures for successive goals ``(goals, dof)`` after what they cost, the joint-space distance
through all of them, and their hands."""


class Planner:
    """Plans side by side, from one store of postures."""

    def __init__(
        self, session: Session, parameters: PostureBasedParameters, horizon: Literal[1, 2]
    ) -> None:
        self.session = session
        self.parameters = parameters
        self.horizon = horizon
        task = session.hand_over(Information.FORWARD_KINEMATICS, Information.JACOBIAN)
        self.robot = task.robot
        self.goals = session.goals
        # ‖F(q) − x_g‖ of a target at most θ^g − θ^a: the movement hits before it arrives.
        self.tolerance = session.radius - session.model.arrival_tolerance
        self.movable: Mask = np.zeros(session.dof, bool)
        self.movable[:BASE_DOF] = [c not in session.locked_base for c in ("x", "y")]
        for hand in session.hands:
            self.movable[session.joints(hand)] = True
        # SDs from zero up: dense near the start, sparse far from it.
        sds = parameters.spread * session.rng.uniform(size=(parameters.stored, 1))
        noise = session.rng.standard_normal((parameters.stored, session.dof))
        self.store = np.vstack([session.q0, session.q0 + sds * noise * self.movable])
        better = math.ceil(parameters.batch / 4)
        # Of the better postures, best first: logarithmic in the rank.
        self.weights = np.log(better + 0.5) - np.log(np.arange(1, better + 1))

    def plans(self, options: list[list[Hands]]) -> list[GrowingPlan]:
        """The plans that hit every goal; ``options``: hands per goal, of each plan.

        Raises MethodError where there is none, for a goal that no posture hits.
        """
        plans = []
        failure: MethodError | None = None
        for first in range(0, len(options), _TOGETHER):
            try:
                plans += self.plan_together(options[first : first + _TOGETHER], len(options) > 1)
            except MethodError as error:
                failure = error
        if failure is not None and not plans:
            raise failure
        return plans

    def plan_together(self, options: list[list[Hands]], beforehand: bool) -> list[GrowingPlan]:
        """Plans side by side; noise is drawn ``beforehand``, plan after plan, or as needed."""
        goals = range(len(self.goals))
        plans = [
            GrowingPlan(
                hands,
                [self.draw_noise(self.goals_ahead(goal)) for goal in goals if beforehand],
                self.store,
                self.session.q0,
            )
            for hands in options
        ]
        for goal in goals:
            ahead = self.goals_ahead(goal)
            retrieved = self.retrieve(plans, ahead)
            searches = [
                self.searches_of(*entry, ahead) for entry in zip(plans, retrieved, strict=True)
            ]
            possible = [bool(choices) for choices in searches]
            if not any(possible):
                raise self.out_of_reach(plans[-1], retrieved[-1])
            plans = list(itertools.compress(plans, possible))
            chains = iter(
                self.generate([search for choices in searches for search in choices], ahead)
            )
            for plan, choices in zip(plans, filter(None, searches), strict=True):
                cheapest = min(itertools.islice(chains, len(choices)), key=lambda chain: chain[0])
                _, (hand, *_), postures = cheapest
                plan.store = np.vstack([plan.store, postures])
                plan.movements.append(Movement(goal + 1, hand, "planned", postures[0]))
                plan.q, spent = self.simulate(plan.q, postures[0], hand, goal)
                plan.ticks.append(spent)
        return plans

    def goals_ahead(self, goal: int) -> range:
        """A goal, and as many after it as the horizon has."""
        return range(goal, min(goal + self.horizon, len(self.goals)))

    def draw_noise(self, goals: range) -> Array:
        """Standard noise for ``goals``, ``(rounds, batch, goals, dof)``."""
        parameters, session = self.parameters, self.session
        shape = parameters.rounds, parameters.batch, len(goals), session.dof
        return session.rng.standard_normal(shape)

    def retrieve(self, plans: list[GrowingPlan], goals: range) -> list[Layers]:
        """First aspect: stored postures of the arm with the hand at the goal, ``(k, dof)``.

        Of each plan, by goal and hand.
        """
        retrieved: list[Layers] = [{} for _ in plans]
        for goal, hand in itertools.product(goals, self.session.hands):
            asking = [i for i, plan in enumerate(plans) if hand in plan.options[goal]]
            if not asking:
                continue
            stores = np.stack([plans[i].store for i in asking])
            postures = np.empty_like(stores)
            postures[:] = np.stack([plans[i].q for i in asking])[:, None]
            arm = self.session.joints(hand)
            postures[..., arm] = stores[..., arm]
            miss = self.goals[goal] - self.session.forward_kinematics(postures, hand)
            postures[..., :BASE_DOF] += miss * self.movable[:BASE_DOF]
            there = self.correct(postures, goal, hand, _RETRIEVED)
            for i, candidates, reached in zip(asking, postures, there, strict=True):
                retrieved[i][goal, hand] = candidates[reached]
        return retrieved

    def searches_of(self, plan: GrowingPlan, retrieved: Layers, goals: range) -> list[Search]:
        """A search for each choice of hands that all have a posture."""
        searches = []
        for hands in itertools.product(*(plan.options[goal] for goal in goals)):
            layers = [retrieved[key] for key in zip(goals, hands, strict=True)]
            if all(len(layer) for layer in layers):
                promising = self.most_promising(plan.q, hands, layers)
                noise = plan.noise.pop(0) if plan.noise else self.draw_noise(goals)
                searches.append(Search(plan.q, hands, promising, noise))
        return searches

    def out_of_reach(self, plan: GrowingPlan, retrieved: Layers) -> MethodError:
        """Why a plan cannot go on."""
        for goal in sorted({goal for goal, _ in retrieved}):
            hands = plan.options[goal]
            if not any(len(retrieved[goal, hand]) for hand in hands):
                break
        return MethodError(
            "infeasible",
            f"goal {goal + 1}: no correction of any of {len(plan.store)} stored postures "
            f"puts the {' or '.join(hands)} hand within {self.tolerance:g} of it",
        )

    def most_promising(self, q: Array, hands: Hands, layers: list[Array]) -> Array:
        """Second aspect: of the retrieved postures those that are cheapest, one a goal."""
        first = layers[0]
        cost = np.linalg.norm(first - q, axis=1)
        if len(layers) == 1:
            return first[[np.argmin(cost)]]
        second = layers[1]
        used = self.base_and_arm(hands[1])
        # No posture that alone costs more than some pair can be the first of the best pair.
        onward = np.linalg.norm(first[np.argmin(cost)][used] - second[:, used], axis=1)
        near = np.flatnonzero(cost <= cost.min() + onward.min())
        onward = np.linalg.norm(first[near][:, None, used] - second[None][:, :, used], axis=2)
        i, j = np.unravel_index(np.argmin(cost[near][:, None] + onward), onward.shape)
        i = near[i]
        return np.stack([first[i], np.where(used, second[j], first[i])])

    def generate(self, searches: list[Search], goals: range) -> list[PostureChain]:
        """The cheapest postures found around the most promising ones by the deadline."""
        parameters = self.parameters
        start = np.stack([search.q for search in searches])[:, None]
        centre = best = np.stack([search.promising for search in searches])
        costs = travel(start[:, 0], best)
        sds = parameters.diffusion * np.geomspace(1.0, _FINEST, parameters.rounds)
        for number, sd in enumerate(sds):
            noise = sd * np.stack([search.noise[number] for search in searches])
            noise[:, 0] = 0.0  # the weighted sum itself is evaluated, too
            postures = centre[:, None] + noise
            accurate = self.correct_generated(
                start, postures, [search.hands for search in searches], goals
            )
            lengths = np.where(accurate, travel(start, postures), np.inf)
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
        return [
            (cost, search.hands, postures_of_search)
            for search, postures_of_search, cost in zip(searches, best, costs.tolist(), strict=True)
        ]

    def correct_generated(
        self, start: Array, postures: Array, hands: list[Hands], goals: range
    ) -> Mask:
        """Correct generated postures in place; which have all hands there.

        ``start`` (n, 1, dof), ``postures`` (n, batch, goals, dof), ``hands`` of each of n.
        """
        accurate = np.ones(postures.shape[:2], bool)
        before = np.broadcast_to(start, (*postures.shape[:2], postures.shape[-1])).copy()
        for k, goal in enumerate(goals):
            for hand in self.session.hands:
                with_hand = [i for i, chosen in enumerate(hands) if chosen[k] == hand]
                if with_hand:
                    posture = np.where(
                        self.free_joints(hand), postures[with_hand, :, k], before[with_hand]
                    )
                    accurate[with_hand] &= self.correct(posture, goal, hand, _GENERATED)
                    postures[with_hand, :, k] = before[with_hand] = posture
        return accurate

    def correct(self, postures: Array, goal: int, hand: Hand, steps: int) -> Mask:
        """Feedforward correction of ``(..., dof)`` in place; which have the hand there."""
        shape, postures = postures.shape[:-1], postures.reshape(-1, postures.shape[-1])
        arm = self.robot.arm(hand)
        far = np.arange(len(postures))
        wanted = np.empty((len(far), 2, 1))
        jacobian = np.zeros((len(far), 2, postures.shape[-1]))
        jacobian[:, [0, 1], [0, 1]] = self.movable[:BASE_DOF]
        joints = np.empty((2, len(arm.links) + 1))
        x, y = self.goals[goal]
        for step in range(steps + 1):
            left = reach_kernel(postures, far, arm, x, y, self.tolerance, wanted, jacobian, *joints)
            self.session.spend(forward_kinematics=len(far))
            far = far[:left]
            if step == steps or not left:
                break
            self.session.spend(jacobians=left)
            across = jacobian[:left]
            transpose = across.transpose(0, 2, 1)
            gram = across @ transpose + _DAMPING * np.eye(2)
            postures[far] += (transpose @ np.linalg.solve(gram, wanted[:left]))[..., 0]
        there = np.ones(len(postures), bool)
        there[far] = False
        return there.reshape(shape)

    def simulate(self, q: Array, target: Array, hand: Hand, goal: int) -> tuple[Array, int]:
        """Where a movement hits its goal, and the ticks that takes."""
        distance = float(np.linalg.norm(target - q))
        step = self.session.model.step
        along = np.arange(math.ceil(distance / step))[:, None] * step
        line = np.vstack([q + along / max(distance, step) * (target - q), target])
        miss = self.session.forward_kinematics(line, hand) - self.goals[goal]
        k = int(np.argmax(np.hypot(miss[:, 0], miss[:, 1]) <= self.session.radius))
        return line[k], k + 1

    def free_joints(self, hand: Hand) -> Mask:
        """What may move towards a posture for ``hand``."""
        if self.parameters.other_arm == "free":
            return self.movable
        return self.movable & self.base_and_arm(hand)

    def base_and_arm(self, hand: Hand) -> Mask:
        """The joints of the base and of one arm."""
        mask = np.zeros_like(self.movable)
        mask[:BASE_DOF] = True
        mask[self.session.joints(hand)] = True
        return mask


def travel(q: Array, postures: Array) -> Array:
    """Joint-space distance from ``q`` (..., dof) through postures ``(..., k, dof)``."""
    start = np.broadcast_to(q[..., None, :], (*postures.shape[:-2], 1, postures.shape[-1]))
    legs = np.diff(np.concatenate([start, postures], axis=-2), axis=-2)
    length: Array = np.linalg.norm(legs, axis=-1).sum(axis=-1)
    return length


METHODS: tuple[type[Method], ...] = (OneGoal, TwoGoals)
