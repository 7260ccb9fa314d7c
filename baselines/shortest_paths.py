"""The shortest path over hand sequences, in whole control ticks.

The search for the optimum and the planner with a receding horizon share this code. IPOPT solves
from each start. For each hand sequence, the shortest plan is then rounded to whole ticks, unless
even its approximate lower bound is not below the best rounding so far. In some roundings a goal
takes no movement, because the hand is already inside the goal when its turn comes.
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
"""Information of a method that starts from posture graphs and rounds to whole ticks."""


class ShortestPlans(NamedTuple):
    """Shortest plans of the hand sequences, and the counts of the solves."""

    ranked: list[PathPlan]
    """Shortest plan of each hand sequence for which a solve converged, in the order of length."""
    solves: int
    """Number of solves, one for each start."""
    failed: int
    """Number of solves that did not converge."""


class PlanInTicks(NamedTuple):
    """A plan in whole ticks."""

    movements: tuple[Movement, ...]
    """A movement for each goal."""
    execution: Execution
    """Execution of these movements."""
    plan: PathPlan
    """The plan that was rounded."""


def shortest_plans(
    session: Session,
    task: Task,
    problem: TrajectoryProblem,
    starts: Iterable[Chain],
    *,
    still: bool,
) -> ShortestPlans:
    """Find the shortest path of each hand sequence, solving from a number of starts.

    Parameters
    ----------
    session : Session
        Session that counts the effort.
    task : Task
    problem : TrajectoryProblem
        Problem of cost ``path-length``.
    starts : iterable of tuple
        A tuple (hand sequence, configurations of shape ``(G, dof)``) for each start.
    still : bool
        True if, on the way to a goal, the arm whose hand is not chosen must not move.

    Returns
    -------
    ShortestPlans

    Raises
    ------
    MethodError
        No solve finds a path.
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

    Each rounding is executed; roundings that miss a goal are discarded. Of roundings with equal
    ticks, the rounding with the fewest corrections is returned. Two kinds of roundings are not
    tried:

    - all roundings of a plan except the 64 nearest to it (:meth:`.Rounding.iter_roundings`);
    - roundings whose estimated ticks (:meth:`.Rounding.estimated_ticks`), an approximate lower
      bound, are not below the ticks of the best rounding so far.

    Parameters
    ----------
    session : Session
        Session that counts the solver's effort and the evaluations of forward kinematics. The
        iterations and Jacobians of corrections are not counted.
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
