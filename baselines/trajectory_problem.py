"""The trajectory problem: one configuration per goal, its hand inside the goal's disc.

With the changes Δ_g of the configurations from goal to goal, q_g = q_0 + Δ_1 + ... + Δ_g, and the
position p of the chosen hand h_g, the nonlinear programme is::

    min   f(Δ, ...)
    s.t.  |p_{h_g}(q_g) - c_g|² <= r²        the hand is in the disc of goal g
          Δ_gj = 0                           for joints j that are held on the way to goal g

where f is one of the costs

    path length        Σ_g l_g  with  |Δ_g|² <= l_g²
    squared displacement Σ_g |Δ_g|²
    acceleration       ∫ |d²q/dt²|² dt,  from rest to rest, the goals hit at times t_g
    jerk               ∫ |d³q/dt³|² dt,  t_g - t_(g-1) > 0 free at a constant sum
    hand jerk          ∫ |d³p/dt³|² + w |d³q/dt³|² dt,  of the hand that is on its way to a goal

The integrals over joints are written out in the rates at the goals (:func:`segment_cost`), which
are variables as Δ is. Jerk of the hand is a sum over Gauss-Legendre nodes; it leaves motion in the
null space of the hand undecided, which the small weight w = ``JOINT_WEIGHT`` settles.

One programme per robot, hands, number of goals and cost is compiled. The start, the goals and the
hand sequence are its parameters. A locked base or an arm that is held is a variable bound, so that
one solver serves every hand sequence of a task. Solved by IPOPT (Wächter & Biegler 2006) with exact
derivatives from CasADi (Andersson et al. 2019). IPOPT's linear solver is not thread-safe:
parallelise over processes.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from threading import RLock
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from coartic.baselines.posture_graph import KINEMATICS
from coartic.method import Information
from coartic.motion.movement import segment_lengths
from coartic.robot import HANDS, Array, Hand, Robot
from coartic.tasks.task import Task

MODEL_BASED = KINEMATICS | {Information.KINEMATIC_MODEL}
"""Information of a planner with a model of the kinematics, besides its cost."""

Cost = Literal["path-length", "squared-displacement", "acceleration", "jerk", "hand-jerk"]
JOINT_WEIGHT = 0.1
"""Weight of joint jerk relative to jerk of the hand, (length unit / rad)²."""

_ONE_AT_A_TIME = RLock()
"""Held while CasADi builds a programme and IPOPT solves it: two threads cannot do so at once."""
_RIM = 1e-7  # solutions stay this far inside the disc, length unit: IPOPT's tolerance
# Least duration of a segment, where the mean is 1. It binds where a smooth plan would hit two
# goals at once. With less, jerk fails to converge for many hand sequences of two-armed-2.
_SHORTEST: dict[Cost, float] = {"acceleration": 0.01, "jerk": 0.05, "hand-jerk": 0.2}
_RATES: dict[Cost, int] = {
    "acceleration": 1,
    "jerk": 2,
    "hand-jerk": 2,
}  # derivatives that are variables
# IPOPT's tolerance. A plan by jerk of the hand is then as near to the least cost, some 1e-6 of it,
# as the better plan of two starts with 1e-9.
_TOLERANCE: dict[Cost, float] = {"hand-jerk": 5e-10}
_SOLVED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
_OPTIONS: dict[str, Any] = {
    "print_time": False,
    "error_on_fail": False,
    "expand": True,
    "ipopt": {
        "print_level": 0,
        "sb": "yes",
        "constr_viol_tol": 1e-9,
        "bound_relax_factor": 0.0,
        "max_iter": 1000,
        "mu_strategy": "monotone",
    },
}


@dataclass(frozen=True)
class Instance:
    """Start, goals, hand of each goal and joints that cannot move: the parameters of one solve."""

    q0: Array
    """Starting configuration, shape ``(dof,)``, length unit and rad."""
    goals: Array
    """Goal centres, shape ``(G, 2)``, length unit."""
    hands: tuple[Hand, ...]
    """Hand of each goal."""
    held: NDArray[np.bool_]
    """Joints that cannot move on the way to each goal, bool, shape ``(G, dof)``."""
    radius: float
    """The hand ends within this distance of each goal's centre, length unit."""

    @classmethod
    def of(cls, task: Task, hands: tuple[Hand, ...], *, still: bool, radius: float) -> Instance:
        """Return the instance of a task with ``hands``, one for each goal; each hand is to end
        within ``radius``, length unit, of its goal's centre. With ``still`` the arm whose hand is
        not chosen for a goal cannot move on the way to it."""
        held = held_joints(task, hands, still=still)
        return cls(np.array(task.q0), np.array(task.goal_array), hands, held, radius)


def held_joints(task: Task, hands: Sequence[Hand], *, still: bool) -> NDArray[np.bool_]:
    """Return True for the entries of a configuration that cannot move on the way to each goal,
    shape ``(G, dof)``: locked base coordinates and arms of hands that the task does not use; with
    ``still`` also the arm whose hand is not chosen for the goal."""
    held = np.zeros((len(hands), task.robot.dof), dtype=np.bool_)
    held[:, ["xy".index(axis) for axis in task.locked_base]] = True
    for goal, hand in enumerate(hands):
        for arm in HANDS:
            if arm not in task.hands or (still and hand != arm):
                held[goal, task.robot.joints(arm)] = True
    return held


@dataclass(frozen=True)
class PathPlan:
    """A plan, the outcome of a solve, converged or not."""

    instance: Instance
    """The instance that was solved."""
    converged: bool
    reason: str
    """IPOPT's return status."""
    configurations: Array
    """Configuration at each goal, shape ``(G, dof)``."""
    cost: float  # of the problem; minus the depth in the discs if the solve asked for depth
    durations: Array
    """Durations of the segments, shape ``(G,)``, with mean 1; all 1 for costs without rates."""
    rates: Array
    """Velocities, for jerk also accelerations, at start and goals, shape
    ``(derivatives, G + 1, dof)``; ``derivatives`` is 0 for path length and squared displacement."""
    spent: dict[str, int] = field(default_factory=dict)
    """Counters of the solver, ready for ``Session.spend``."""

    def lengths(self) -> Array:
        """Return the straight joint-space distances from the start to goal 1 and from goal to goal,
        shape ``(G,)``, length unit and rad together, also where the plan is curved."""
        return segment_lengths(np.vstack([self.instance.q0, self.configurations]))


class TrajectoryProblem:
    """The compiled programme of one cost, for every task of a robot with these ``hands`` and this
    number of ``goals``."""

    def __init__(self, robot: Robot, hands: tuple[Hand, ...], goals: int, cost: Cost) -> None:
        import casadi  # which few commands need

        self._dof, self._goals, self._cost = robot.dof, goals, cost
        self._order = _RATES.get(cost, 0)
        dof, order = robot.dof, self._order
        steps = casadi.SX.sym("steps", dof, goals)  # configuration changes, goal by goal
        lengths = casadi.SX.sym("lengths", goals)  # bounds on the path lengths of the segments
        # Time derivatives of the configuration at start and goals.
        rates = [casadi.SX.sym(f"rates{d}", dof, goals + 1) for d in range(order)]
        durations = casadi.SX.sym("durations", goals)
        depth = casadi.SX.sym("depth")  # inside the rim, for the goals that are deep
        rim = casadi.SX.sym("rim")
        deep = casadi.SX.sym("deep", goals)
        q0 = casadi.SX.sym("q0", dof)
        centres = casadi.SX.sym("centres", 2, goals)
        right = casadi.SX.sym("right", goals)  # 1 where the right hand is chosen
        weights = casadi.SX.sym("weights", 2)  # of path length and of depth

        limits, q = [], q0
        for g in range(goals):
            q = q + steps[:, g]
            place = {hand: robot.symbolic_hand(q, hand) for hand in hands}
            hand = place[hands[0]]
            if len(hands) > 1:
                hand = right[g] * place["right"] + (1 - right[g]) * place["left"]
            limits.append(casadi.sumsqr(hand - centres[:, g]) - (rim - deep[g] * depth) ** 2)
        if cost == "path-length":
            # min Σ t subject to |Δq|² <= t²: smooth where a norm is not.
            limits += [casadi.sumsqr(steps[:, g]) - lengths[g] ** 2 for g in range(goals)]
            objective = weights[0] * casadi.sum1(lengths) - weights[1] * depth
        else:
            ends = [[(r[:, g], r[:, g + 1]) for r in rates] for g in range(goals)]
            costs = [segment_cost(cost, steps[:, g], durations[g], ends[g]) for g in range(goals)]
            objective = sum(costs, casadi.SX(0))
            if cost == "hand-jerk":
                objective = JOINT_WEIGHT * objective
                for each in hands:
                    chosen = right if each == "right" else 1 - right
                    jerks = _hand_jerks(robot, each, q0, steps, durations, rates)
                    objective += casadi.dot(chosen, jerks)
        self._lower = np.array([-np.inf] * len(limits) + [0.0] * bool(order))
        self._upper = np.zeros(len(self._lower))
        if order:
            limits.append(casadi.sum1(durations) - goals)
        self._evaluations = goals * len(hands)  # forward kinematics in one evaluation of the limits
        variables = {"steps": steps, "lengths": lengths, "durations": durations, "depth": depth,
                     "rates": casadi.veccat(*rates)}  # fmt: skip
        sizes = [variable.numel() for variable in variables.values()]
        places = itertools.starmap(slice, pairwise(itertools.accumulate(sizes, initial=0)))
        self._at = dict(zip(variables, places, strict=True))  # in the vector of all variables
        self._solver = casadi.nlpsol(
            "trajectory",
            "ipopt",
            {
                "x": casadi.veccat(*variables.values()),
                "p": casadi.veccat(q0, centres, right, rim, deep, weights),
                "f": objective,
                "g": casadi.vertcat(*limits),
            },
            {**_OPTIONS, "ipopt": {**_OPTIONS["ipopt"], "tol": _TOLERANCE.get(cost, 1e-9)}},
        )

    def solve(
        self,
        instance: Instance,
        start: Array,
        *,
        lengths: Array | None = None,
        stops: bool = False,
        deep: Sequence[int] = (),
    ) -> PathPlan:
        """Return a locally cheapest plan for an instance (start, goals, hands), sought from one
        configuration per goal, ``start`` ``(G, dof)``. A plan has converged if IPOPT says so and
        every constraint holds (to 1e-8); a plan that has not converged is returned, too.

        Only for path length: ``lengths`` ``(G,)`` are upper bounds of the joint-space lengths of
        the segments, NaN for a free length; None frees all. With ``deep`` (goals, from 0) the path
        is not made short; the least depth of the hands inside the discs of these goals is made as
        large as ``lengths`` allow. Only for costs with rates (velocities, accelerations): ``stops``
        holds the rates at all goals at 0.
        """
        goals, at = self._goals, self._at
        steps = np.diff(np.vstack([instance.q0, start]), axis=0)
        steps[instance.held] = 0.0
        free = np.where(instance.held, 0.0, np.inf).ravel()
        distances = np.sqrt((steps**2).sum(axis=1))
        # A start, a least and a most value of each variable.
        first, least, most = bounds = np.zeros((3, at["rates"].stop))
        bounds[:, at["steps"]] = steps.ravel(), -free, free
        if self._cost == "path-length":
            first[at["lengths"]], most[at["lengths"]] = distances, np.inf
            if lengths is not None:
                given = ~np.isnan(lengths)
                bounds[:, at["lengths"]][:, given] = lengths[given]
        bounds[:, at["durations"]] = 1.0
        if self._order:  # durations vary at a constant total
            times = np.maximum(distances, 1e-3)
            times = np.maximum(times * (goals / times.sum()), 0.1)
            first[at["durations"]] = times * (goals / times.sum())
            least[at["durations"]], most[at["durations"]] = _SHORTEST[self._cost], goals
        # Rates are 0 at rest (start and end, with stops each goal) and for joints held on either
        # side.
        still = np.vstack([instance.held[:1] | True, instance.held])
        still[:-1] |= instance.held
        still[-1] = True
        rates = np.tile(np.where(still | stops, 0.0, np.inf).ravel(), self._order)
        rim = instance.radius - _RIM
        least[at["rates"]], most[at["rates"]] = -rates, rates
        most[at["depth"]] = rim if deep else 0.0
        chosen = np.zeros(goals)
        chosen[list(deep)] = 1.0
        right = [float(hand == "right") for hand in instance.hands]
        weights = [0.0, 1.0] if deep else [1.0, 0.0]
        with _ONE_AT_A_TIME:
            solution = self._solver(
                x0=first,
                lbx=least,
                ubx=most,
                lbg=self._lower,
                ubg=self._upper,
                p=np.concatenate(
                    [instance.q0, instance.goals.ravel(), right, [rim], chosen, weights]
                ),
            )
            statistics = self._solver.stats()
        x, limits = (np.asarray(solution[name]).ravel() for name in "xg")
        violation = float(max((limits - self._upper).max(), (self._lower - limits).max()))
        return PathPlan(
            instance=instance,
            converged=statistics["return_status"] in _SOLVED
            and bool(np.isfinite(x).all() and violation < 1e-8),
            reason=statistics["return_status"],
            configurations=instance.q0 + np.cumsum(x[at["steps"]].reshape(start.shape), axis=0),
            cost=float(solution["f"]),
            durations=x[at["durations"]],
            rates=x[at["rates"]].reshape(self._order, goals + 1, self._dof),
            spent={
                "forward_kinematics": self._evaluations * statistics.get("n_call_nlp_g", 0),
                "jacobians": self._evaluations * statistics.get("n_call_nlp_jac_g", 0),
                "gradients": statistics.get("n_call_nlp_grad_f", 0),
                "hessians": statistics.get("n_call_nlp_hess_l", 0),
                "solver_iterations": statistics["iter_count"],
            },
        )


def segment_cost(cost: Cost, step: Any, time: Any, rates: list[tuple[Any, Any]]) -> Any:
    """Return the least cost of a segment between given end states, as a CasADi expression; of jerk
    of the hand only the part of the joints, without its weight; not for path length.

    ∫|q̈|² is least for a cubic, ∫|q⃛|² for a quintic (Flash & Hogan 1985); both integrals are
    written out in the end states, so that nothing is discretised. ``step``: change of the joints,
    ``(dof,)``; ``time``: duration above 0; ``rates``: pair of the velocities at both ends, and for
    both kinds of jerk pair of the accelerations, ``(dof,)`` each. Squared displacement ignores time
    and rates.
    """
    import casadi

    if cost == "squared-displacement":
        return casadi.sumsqr(step)
    v0, v1 = rates[0]
    # End states relative to the straight line at constant speed, which costs nothing.
    a, b = v0 - step / time, v1 - step / time
    if cost == "acceleration":
        return 4 * (casadi.sumsqr(a) + casadi.dot(a, b) + casadi.sumsqr(b)) / time
    a0, a1 = rates[1]
    quadratic = 192 * (casadi.sumsqr(a) + casadi.sumsqr(b)) + 336 * casadi.dot(a, b)
    mixed = 72 * (casadi.dot(a, a0) - casadi.dot(b, a1)) + 48 * (
        casadi.dot(b, a0) - casadi.dot(a, a1)
    )
    bending = 9 * (casadi.sumsqr(a0) + casadi.sumsqr(a1)) - 6 * casadi.dot(a0, a1)
    return quadratic / time**3 + mixed / time**2 + bending / time


def _hand_jerks(
    robot: Robot, hand: Hand, q0: Any, steps: Any, durations: Any, rates: list[Any]
) -> Any:
    """Return the integral (Gauss-Legendre, 6 nodes) of the squared jerk of a hand over each of G
    segments, a CasADi column, along quintics between the end states: start ``q0``, changes
    ``steps``, ``(dof, G)``, ``durations``, ``(G,)``, and ``rates``, velocities and accelerations at
    start and goals, ``(dof, G + 1)`` each."""
    import casadi

    powers, integrals, here = np.arange(6), [], q0
    nodes, weights = np.polynomial.legendre.leggauss(6)  # on [-1, 1], of each segment
    for g in range(steps.shape[1]):
        step, time = steps[:, g], durations[g]
        (v0, v1), (a0, a1) = ((r[:, g], r[:, g + 1]) for r in rates)
        v0, v1, a0, a1 = v0 * time, v1 * time, a0 * time**2, a1 * time**2
        coefficients = [
            here, v0, a0 / 2,
            10 * step - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1,
            -15 * step + 8 * v0 + 7 * v1 + 1.5 * a0 - a1,
            6 * step - 3 * (v0 + v1) - 0.5 * (a0 - a1),
        ]  # fmt: skip
        total = casadi.SX(0)
        for node, weight in zip((1 + nodes) / 2, weights / 2, strict=True):
            derivatives = []
            for d in range(4):
                falling = np.prod([powers - k for k in range(d)], axis=0) * np.ones(6)
                scale = falling * node ** np.maximum(powers - d, 0)
                derivatives.append(sum(c * w for c, w in zip(coefficients, scale, strict=True)))
            total += weight * casadi.sumsqr(robot.symbolic_hand_jerk(derivatives, hand))
        integrals.append(total / time**5)
        here = here + step
    return casadi.vertcat(*integrals)


@lru_cache(maxsize=32)
def trajectory_problem(
    robot: Robot, hands: tuple[Hand, ...], goals: int, cost: Cost
) -> TrajectoryProblem:
    """Return the compiled problem for a robot, hands to choose from, a number of goals and a cost;
    a process keeps the 32 problems used last."""
    with _ONE_AT_A_TIME:
        return TrajectoryProblem(robot, hands, goals, cost)


def spline(plan: PathPlan, samples: int) -> list[Array]:
    """Return configurations along a plan with rates, a list of pieces ``(samples, dof)``, one per
    goal, each at equal steps in time and ending at the goal; the start is left out. Between goals:
    Hermite cubics (plans with velocities) or quintics (accelerations too)."""
    from scipy.interpolate import BPoly  # slow, and a command that names methods needs none

    corners = np.vstack([plan.instance.q0, plan.configurations])
    times = np.concatenate([[0.0], np.cumsum(plan.durations)])
    curve = BPoly.from_derivatives(times, np.stack([corners, *plan.rates], axis=1))
    share = np.linspace(0.0, 1.0, samples + 1)[1:]
    return [curve(begin + share * (end - begin)) for begin, end in pairwise(times)]
