"""Find the shortest path over all hand sequences, and round it to whole control ticks.

The search for the optimum and the receding-horizon planner share this code:

1. IPOPT finds a locally shortest path from each start (:func:`shortest_plans`).
2. The shortest path of each hand sequence is rounded to whole ticks (:func:`fewest_ticks`). A path
   is skipped if an approximate lower bound on its ticks is not below the ticks of the best rounding
   so far. In some roundings there is no movement to a goal, because the hand is already inside the
   goal when the goal becomes current.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from coartic import Execution, Movement, Task, execute
from coartic.baselines.posture_graph import Chain, HandSequence
from coartic.baselines.trajectory_problem import MODEL_BASED, Instance, PathPlan, TrajectoryProblem
from coartic.baselines.whole_ticks import Rounding, movements
from coartic.method import Information, MethodError, Session

REWARD_INFORMATION = MODEL_BASED | {Information.REWARD_FORMULA}
"""Information that a method uses if it calls the functions of this module."""


class ShortestPlans(NamedTuple):
    """Shortest plan of each hand sequence, and how often IPOPT was called."""

    ranked: list[PathPlan]
    """Shortest plan of each hand sequence for which IPOPT converged, in the order of length, the
    shortest first."""
    solves: int
    """Number of calls of IPOPT, one for each start."""
    failed: int
    """Number of calls in which IPOPT did not converge."""


class PlanInTicks(NamedTuple):
    """A plan that was rounded to whole ticks, as movements."""

    movements: tuple[Movement, ...]
    """A movement for each goal."""
    execution: Execution
    """Execution of these movements without motor noise."""
    plan: PathPlan
    """The plan before rounding."""


def shortest_plans(
    session: Session,
    task: Task,
    problem: TrajectoryProblem,
    starts: Iterable[Chain],
    *,
    still: bool,
) -> ShortestPlans:
    """Find the shortest path of each hand sequence, by IPOPT from many starts.

    Parameters
    ----------
    session : Session
        Session that counts the effort of the solver.
    task : Task
    problem : TrajectoryProblem
        Problem of cost ``path-length``.
    starts : iterable of tuple
        Tuple (hand sequence, configurations of shape ``(G, dof)``) for each start.
    still : bool
        True if the idle arm (the arm whose hand is not chosen for a goal) must not move on the way
        to that goal.

    Returns
    -------
    ShortestPlans

    Raises
    ------
    MethodError
        IPOPT converges from no start.
    """
    best: dict[HandSequence, PathPlan] = {}
    solves = failed = 0
    for hands, start in starts:
        instance = Instance.of(task, hands, still=still, radius=task.radius)
        plan = problem.solve(instance, start)
        session.spend(**plan.spent)
        solves += 1
        failed += not plan.converged
        if plan.converged and (hands not in best or plan.cost < best[hands].cost):
            best[hands] = plan
    if not best:
        raise MethodError(
            "infeasible",
            f"task {task.name!r}: IPOPT converged in none of {solves} solves, so there is no path",
        )
    ranked = sorted(best.values(), key=lambda plan: plan.cost)
    return ShortestPlans(ranked, solves, failed)


def fewest_ticks(
    session: Session, task: Task, problem: TrajectoryProblem, plans: ShortestPlans
) -> PlanInTicks:
    """Round plans to whole ticks, and return the rounding with the fewest ticks.

    Roundings are executed without motor noise; if a movement misses its goal, the corrective
    process acts. A rounding is discarded if its execution does not hit every goal. Among executed
    roundings with equal ticks, the one with the fewest corrective movements is returned. Three
    kinds of roundings are not executed:

    - all roundings of a plan except the 64 nearest to it (:meth:`.Rounding.iter_roundings`);
    - roundings of a plan whose estimated ticks (:meth:`.Rounding.estimated_ticks`), an approximate
      lower bound, are not below the ticks of the best rounding so far;
    - roundings whose own ticks are not below the ticks of the best rounding so far.

    Parameters
    ----------
    session : Session
        Session that counts the solver's effort and the evaluations of forward kinematics.
        Iterations of the corrective process, and Jacobians that it evaluates, are not counted.
    task : Task
    problem : TrajectoryProblem
        Problem of cost ``path-length``.
    plans : ShortestPlans
        Plans to round.

    Returns
    -------
    PlanInTicks

    Raises
    ------
    MethodError
        No rounding that could be solved hits every goal.
    """
    best: PlanInTicks | None = None
    fewest: tuple[float, float] = math.inf, math.inf  # ticks and corrections of the best
    exact = session.model.without_noise()

    def worth(ticks: int) -> bool:
        return ticks < fewest[0]

    for plan in plans.ranked:
        instance, rounding = plan.instance, Rounding(session, problem, plan.instance)
        # Without a movement to a goal one tick is saved, and the path is not shorter.
        if not worth(rounding.estimated_ticks(plan) - len(instance.hands)):
            continue
        for merged, shortest in rounding.iter_plans(plan, task, worth):
            if not worth(rounding.estimated_ticks(shortest, merged)):
                continue
            for rounded in rounding.iter_roundings(shortest, merged):
                if not worth(rounded.ticks):
                    continue
                planned = movements(session, task, instance, rounded.configurations, rounded.steps)
                execution = execute(task, planned, model=exact)
                session.spend(forward_kinematics=execution.evaluations)
                spent = execution.ticks, execution.corrections
                if execution.completed and spent < fewest:
                    fewest, best = spent, PlanInTicks(planned, execution, shortest)
                if not worth(rounding.estimated_ticks(shortest, merged)):
                    break  # no other rounding takes fewer ticks
    if best is None:
        raise MethodError("solver-failed", "IPOPT could not round any plan to whole ticks")
    return best
