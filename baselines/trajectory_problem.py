"""The trajectory problem: a configuration for each goal, with the hand inside the goal's disc.

The nonlinear programme is::

    min   f(Δ, ...)
    s.t.  |p_{h_g}(q_g) - c_g|² <= r²        the hand is in the disc of goal g
          Δ_gj = 0                           for joints j that are held on the way to goal g

Here Δ_g is the change of the configuration on the way to goal g, q_g = q_0 + Δ_1 + ... + Δ_g is the
configuration at goal g, h_g is the hand chosen for goal g, p_h is the position of hand h, c_g is
the centre of goal g, and r is the radius of the goals. The cost f is one of::

    path length          Σ_g l_g  with  |W Δ_g|² <= l_g²
    squared displacement Σ_g |Δ_g|²
    acceleration         ∫ |d²q/dt²|² dt
    jerk                 ∫ |d³q/dt³|² dt
    hand jerk            ∫ |d³p/dt³|² + w |d³q/dt³|² dt

The variables l_g are upper bounds of the lengths of the segments, which replace the norm of Δ_g in
the cost by a smooth constraint. W multiplies the base coordinates by their weight in the motion
model, and w is ``JOINT_WEIGHT``. The last three costs are integrals over a movement from rest to
rest. The durations of the segments are variables whose sum is constant.

The integrals over the joints have closed formulas in the rates (velocities and accelerations of the
joints) at the goals (:func:`segment_cost`). These rates are variables, too. The integral of the
jerk of the hand that moves to the goal is computed by Gauss-Legendre quadrature. The jerk of the
hand does not determine the motion in the null space of its Jacobian; the joint jerk, with its small
weight w, determines this motion.

A nonlinear programme is compiled for each combination of a robot, a set of hands, a number of
goals, a cost and a weight of the base. The start, the goals and the hand sequence are parameters of
the programme. Locked base coordinates and held arms are expressed by bounds of the variables. So
one compiled programme serves all hand sequences of a task. The solver is IPOPT (Wächter & Biegler
2006) with exact derivatives from CasADi (Andersson et al. 2019). IPOPT's linear solver is not
thread-safe: to solve in parallel, use processes.
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
from coartic.model import MotionModel
from coartic.motion.doors import scale_base, segment_lengths
from coartic.robot import BASE_DOF, HANDS, Array, Hand, Robot
from coartic.tasks.task import Task

MODEL_BASED = KINEMATICS | {Information.KINEMATIC_MODEL}
"""Information that a planner with a model of the kinematics uses, besides that on its cost."""

Cost = Literal["path-length", "squared-displacement", "acceleration", "jerk", "hand-jerk"]
JOINT_WEIGHT = 0.1
"""Weight of joint jerk relative to jerk of the hand, in (length unit / rad)²."""

_ONE_AT_A_TIME = RLock()
"""Lock that a thread holds while CasADi builds a programme or IPOPT solves it, because two threads
must not do so at the same time."""
IPOPT = "wachter2006", "andersson2019"
"""Keys in ``references.bib`` of the works on the solver."""
_RIM = 1e-7  # solutions stay this far inside the disc (in length units), for IPOPT's tolerance
# Least duration of a segment; the mean is 1. It binds where a smooth plan would hit two goals at
# once. With a smaller value, jerk does not converge for many hand sequences of two-armed-2.
_SHORTEST: dict[Cost, float] = {"acceleration": 0.01, "jerk": 0.05, "hand-jerk": 0.2}
_RATES: dict[Cost, int] = {
    "acceleration": 1,
    "jerk": 2,
    "hand-jerk": 2,
}  # derivatives that are variables
# IPOPT's tolerance, where it is not 1e-9. With this value, a plan by jerk of the hand is within
# about 1e-6 of the least cost, as is the better plan of two starts with 1e-9.
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
    """Data of one problem: start, goals, radius, hands and held joints."""

    q0: Array
    """Starting configuration, shape ``(dof,)``, in length units and rad."""
    goals: Array
    """Goal centres, shape ``(G, 2)``, in length units."""
    hands: tuple[Hand, ...]
    """Hand of each goal."""
    held: NDArray[np.bool_]
    """True for entries of a configuration that cannot change on the way to a goal, shape ``(G,
    dof)``."""
    radius: float
    """Largest distance of a hand from the centre of its goal (in length units)."""

    @classmethod
    def of(cls, task: Task, hands: tuple[Hand, ...], *, still: bool, radius: float) -> Instance:
        """Return the instance of a task with a hand sequence.

        Parameters
        ----------
        task : Task
        hands : tuple of str
            Hand of each goal.
        still : bool
            True if the idle arm (the arm whose hand is not chosen for a goal) cannot move on the
            way to that goal.
        radius : float
            Largest distance of a hand from the centre of its goal (in length units).

        Returns
        -------
        Instance
        """
        held = held_joints(task, hands, still=still)
        return cls(np.array(task.q0), np.array(task.goal_array), hands, held, radius)


def held_joints(task: Task, hands: Sequence[Hand], *, still: bool) -> NDArray[np.bool_]:
    """Return a mask of the joints that cannot move on the way to each goal.

    These joints are the locked base coordinates and the arms of hands that the task does not use.

    Parameters
    ----------
    task : Task
    hands : sequence of str
        Hand of each goal.
    still : bool
        True to add, for each goal, the idle arm (the arm whose hand is not chosen).

    Returns
    -------
    ndarray of bool, shape (G, dof)
        True for joints that cannot move.
    """
    held = np.zeros((len(hands), task.robot.dof), dtype=np.bool_)
    held[:, ["xy".index(axis) for axis in task.locked_base]] = True
    for goal, hand in enumerate(hands):
        for arm in HANDS:
            if arm not in task.hands or (still and hand != arm):
                held[goal, task.robot.joints(arm)] = True
    return held


@dataclass(frozen=True)
class PathPlan:
    """Plan that the solver returned, whether it has converged or not."""

    instance: Instance
    """The instance that was solved."""
    converged: bool
    """True if IPOPT reports success and the constraints hold (:meth:`TrajectoryProblem.solve`)."""
    reason: str
    """Return status of IPOPT, such as ``Solve_Succeeded``."""
    configurations: Array
    """Configuration at each goal, shape ``(G, dof)``."""
    cost: float
    """Cost of the plan. If the solver maximised the depth of the hands in the discs (argument
    ``deep`` of :meth:`TrajectoryProblem.solve`), the cost is minus the smallest depth (in length
    units)."""
    durations: Array
    """Durations of the segments, shape ``(G,)``, with mean 1; all 1 for costs without rates."""
    rates: Array
    """Velocities of the joints and, for both kinds of jerk, their accelerations, at the start and
    at the goals, shape ``(derivatives, G + 1, dof)``. For costs without rates ``derivatives``
    is 0."""
    spent: dict[str, int] = field(default_factory=dict)
    """Counts of the solver's effort, as keyword arguments of :meth:`.Session.spend`."""
    base_weight: float = 1.0
    """Weight of the base in the length of a movement (:class:`.MotionModel`)."""

    def lengths(self) -> Array:
        """Return the straight joint-space distance of each segment of the plan.

        Segment 1 goes from the start to goal 1, segment g from goal g - 1 to goal g.

        Returns
        -------
        ndarray, shape (G,)
            Euclidean distances with the weight of the base, in a mix of length units and rad. They
            are straight distances even for a plan with a curved path.
        """
        model = MotionModel(base_weight=self.base_weight)
        return segment_lengths(np.vstack([self.instance.q0, self.configurations]), model)


class TrajectoryProblem:
    """Compiled nonlinear programme, which is solved for many instances (:class:`Instance`).

    The programme is compiled for one robot, set of hands, number of goals, cost and weight of the
    base.
    """

    def __init__(
        self,
        robot: Robot,
        hands: tuple[Hand, ...],
        goals: int,
        cost: Cost,
        base_weight: float = 1.0,
    ) -> None:
        import casadi  # slow to import, and most commands do not need it

        self._model = MotionModel(base_weight=base_weight)
        self._dof, self._goals, self._cost = robot.dof, goals, cost
        self._order = _RATES.get(cost, 0)
        dof, order = robot.dof, self._order
        steps = casadi.SX.sym("steps", dof, goals)  # configuration changes, goal by goal
        lengths = casadi.SX.sym("lengths", goals)  # bounds on the path lengths of the segments
        # Time derivatives of the configuration at start and goals.
        rates = [casadi.SX.sym(f"rates{d}", dof, goals + 1) for d in range(order)]
        durations = casadi.SX.sym("durations", goals)
        depth = casadi.SX.sym("depth")  # least distance of the hand from the rim at deep goals
        rim = casadi.SX.sym("rim")
        deep = casadi.SX.sym("deep", goals)  # 1 for goals at which depth counts
        q0 = casadi.SX.sym("q0", dof)
        centres = casadi.SX.sym("centres", 2, goals)
        right = casadi.SX.sym("right", goals)  # 1 where the right hand is chosen
        weights = casadi.SX.sym("weights", 2)  # of path length and of depth

        limits, q = [], q0
        for g in range(goals):
            q = q + steps[:, g]
            positions = {hand: robot.symbolic_hand(q, hand) for hand in hands}
            position = positions[hands[0]]
            if len(hands) > 1:
                position = right[g] * positions["right"] + (1 - right[g]) * positions["left"]
            limits.append(casadi.sumsqr(position - centres[:, g]) - (rim - deep[g] * depth) ** 2)
        if cost == "path-length":
            # min Σ l subject to |Δ|² <= l², which is smooth where the norm of Δ is not.
            weighted = steps
            if base_weight != 1.0:
                weights_of = [base_weight] * BASE_DOF + [1.0] * (dof - BASE_DOF)
                weighted = casadi.diag(casadi.DM(weights_of)) @ steps
            limits += [casadi.sumsqr(weighted[:, g]) - lengths[g] ** 2 for g in range(goals)]
            objective = weights[0] * casadi.sum1(lengths) - weights[1] * depth
        else:
            ends = [[(r[:, g], r[:, g + 1]) for r in rates] for g in range(goals)]
            costs = [segment_cost(cost, steps[:, g], durations[g], ends[g]) for g in range(goals)]
            objective = sum(costs, casadi.SX(0))
            if cost == "hand-jerk":
                objective = JOINT_WEIGHT * objective
                for hand in hands:
                    chosen = right if hand == "right" else 1 - right
                    jerks = _hand_jerks(robot, hand, q0, steps, durations, rates)
                    objective += casadi.dot(chosen, jerks)
        self._lower = np.array([-np.inf] * len(limits) + ([0.0] if order else []))
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
        """Find a plan with locally minimal cost for an instance.

        Parameters
        ----------
        instance : Instance
            Start, goals, hands and held joints.
        start : ndarray, shape (G, dof)
            Initial guess of the solver: a configuration at each goal.
        lengths : ndarray, shape (G,), optional
            Largest joint-space length of each segment; NaN for a segment of any length. By default
            segments may have any length. Only for cost ``path-length``.
        stops : bool
            True to make all rates at all goals 0. Only for costs with rates.
        deep : sequence of int
            Numbers of goals, from 0. If there are any, the solver does not minimise the path
            length. Instead it maximises the smallest depth of the hands in the discs of these
            goals, subject to ``lengths``. (The depth is the distance of a hand from the rim.) Only
            for cost ``path-length``.

        Returns
        -------
        PathPlan
            The plan. Attribute ``converged`` is True if IPOPT reports success (also to an
            acceptable level) and all constraints hold to within 1e-8. A plan that has not converged
            is returned as well.
        """
        goals, at = self._goals, self._at
        steps = np.diff(np.vstack([instance.q0, start]), axis=0)
        steps[instance.held] = 0.0
        free = np.where(instance.held, 0.0, np.inf).ravel()
        distances = np.sqrt((scale_base(steps, self._model) ** 2).sum(axis=1))
        # Start, lower bound and upper bound of each variable.
        initial, lower, upper = bounds = np.zeros((3, at["rates"].stop))
        bounds[:, at["steps"]] = steps.ravel(), -free, free
        if self._cost == "path-length":
            initial[at["lengths"]], upper[at["lengths"]] = distances, np.inf
            if lengths is not None:
                fixed = ~np.isnan(lengths)
                bounds[:, at["lengths"]][:, fixed] = lengths[fixed]
        bounds[:, at["durations"]] = 1.0
        if self._order:  # durations vary at a constant total
            times = np.maximum(distances, 1e-3)
            times = np.maximum(times * (goals / times.sum()), 0.1)
            initial[at["durations"]] = times * (goals / times.sum())
            lower[at["durations"]], upper[at["durations"]] = _SHORTEST[self._cost], goals
        # Rates are 0 at the start and at the last goal, with ``stops`` at each goal, and for joints
        # that are held before or after a goal.
        still = np.vstack([instance.held[:1] | True, instance.held])
        still[:-1] |= instance.held
        still[-1] = True
        rates = np.tile(np.where(still | stops, 0.0, np.inf).ravel(), self._order)
        rim = instance.radius - _RIM
        lower[at["rates"]], upper[at["rates"]] = -rates, rates
        upper[at["depth"]] = rim if deep else 0.0
        chosen = np.zeros(goals)
        chosen[list(deep)] = 1.0
        right = [float(hand == "right") for hand in instance.hands]
        weights = [0.0, 1.0] if deep else [1.0, 0.0]
        with _ONE_AT_A_TIME:
            solution = self._solver(
                x0=initial,
                lbx=lower,
                ubx=upper,
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
                "gradients": statistics.get("n_call_nlp_grad_f", 0),
                "solver_iterations": statistics["iter_count"],
            },
            base_weight=self._model.base_weight,
        )


def segment_cost(cost: Cost, step: Any, time: Any, rates: list[tuple[Any, Any]]) -> Any:
    """Return the smallest cost of a segment with given joint states at its ends.

    Among all movements between two states of the joints (position, velocity and, for jerk,
    acceleration), a cubic minimises ∫|q̈|² and a quintic minimises ∫|q⃛|² (Flash & Hogan 1985).
    Both minima have exact formulas in the two states. For the cost ``hand-jerk``, this function
    returns only the integral of the joint jerk, without the weight ``JOINT_WEIGHT``. The cost
    ``path-length`` is not allowed.

    Parameters
    ----------
    cost : str
        The cost; squared displacement ignores ``time`` and ``rates``.
    step : casadi.SX, shape (dof,)
        Change of the joints.
    time : casadi.SX
        Duration, above 0.
    rates : list of tuple
        A tuple with the velocities at both ends and, for both kinds of jerk, a second tuple with
        the accelerations at both ends; each entry has shape ``(dof,)``.

    Returns
    -------
    casadi.SX
        The cost, a scalar.
    """
    import casadi

    if cost == "squared-displacement":
        return casadi.sumsqr(step)
    v0, v1 = rates[0]
    # Velocities relative to a straight movement at constant speed, whose cost is 0.
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
    """Return the integral of a hand's squared jerk over each of G segments.

    In each segment, the joints move along a quintic polynomial in time. Gauss-Legendre quadrature
    with 6 nodes approximates the integral.

    Parameters
    ----------
    robot : Robot
    hand : {"left", "right"}
    q0 : casadi.SX, shape (dof,)
        Starting configuration.
    steps : casadi.SX, shape (dof, G)
        Change of the joints in each segment.
    durations : casadi.SX, shape (G,)
        Duration of each segment.
    rates : list of casadi.SX, shapes (dof, G + 1)
        Velocities and accelerations at the start and at the goals.

    Returns
    -------
    casadi.SX, shape (G,)
    """
    import casadi

    powers, integrals, q = np.arange(6), [], q0
    nodes, weights = np.polynomial.legendre.leggauss(6)  # on [-1, 1], of each segment
    for g in range(steps.shape[1]):
        step, time = steps[:, g], durations[g]
        (v0, v1), (a0, a1) = ((r[:, g], r[:, g + 1]) for r in rates)
        v0, v1, a0, a1 = v0 * time, v1 * time, a0 * time**2, a1 * time**2
        coefficients = [
            q, v0, a0 / 2,
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
        q = q + step
    return casadi.vertcat(*integrals)


@lru_cache(maxsize=32)
def trajectory_problem(
    robot: Robot, hands: tuple[Hand, ...], goals: int, cost: Cost, base_weight: float = 1.0
) -> TrajectoryProblem:
    """Return a compiled trajectory problem.

    The last 32 problems are cached (LRU). The arguments are those of :class:`TrajectoryProblem`;
    ``base_weight`` is the weight of the base in the path length (:class:`.MotionModel`).
    """
    with _ONE_AT_A_TIME:
        return TrajectoryProblem(robot, hands, goals, cost, base_weight)


def spline(plan: PathPlan, samples: int) -> list[Array]:
    """Sample the path of a plan with rates, at equal time steps between goals.

    The path is a Hermite spline: it consists of cubics if the plan has only velocities, and of
    quintics if the plan has accelerations, too.

    Parameters
    ----------
    plan : PathPlan
    samples : int
        Number of configurations for each goal.

    Returns
    -------
    list of ndarray, shape (samples, dof)
        A piece of the path for each goal. The last row of a piece is the configuration at the goal;
        the start is not included.
    """
    from scipy.interpolate import BPoly  # slow to import, and most commands do not need it

    corners = np.vstack([plan.instance.q0, plan.configurations])
    times = np.concatenate([[0.0], np.cumsum(plan.durations)])
    curve = BPoly.from_derivatives(times, np.stack([corners, *plan.rates], axis=1))
    share = np.linspace(0.0, 1.0, samples + 1)[1:]
    return [curve(begin + share * (end - begin)) for begin, end in pairwise(times)]
