"""The shortest path over hand sequences, in whole control ticks.

Shared by the search for the optimum and the planner with a receding horizon: each start is
polished by IPOPT, the shortest plan of each hand sequence is kept, and plans that may be best are
rounded to whole ticks, with and without goals that are hit as their turn comes because the hand is
already there.
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
    """The plans found from many starts."""

    ranked: list[PathPlan]
    """The shortest plan of each hand sequence for which a solve converged, the shortest first."""
    solves: int  # one for each start
    failed: int  # solves that did not converge


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
    """Solve the ``problem`` of the shortest path on a task from each of ``starts``, a hand sequence
    and configurations ``(G, dof)``; return the shortest plan found for each hand sequence, and the
    numbers of solves and failures. With ``still`` the arm whose hand is not chosen for a goal does
    not move on the way to it. The session counts the effort. Raises MethodError if no solve finds a
    path."""
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
            "infeasible", f"none of {solves} solves found a path that hits every goal"
        )
    ranked = sorted(best.values(), key=lambda plan: plan.cost)
    return ShortestPlans(ranked, solves, failed)


def fewest_ticks(
    session: Session, task: Task, problem: TrajectoryProblem, plans: ShortestPlans
) -> PlanInTicks:
    """Round plans of a task to whole ticks, with and without goals that are hit without a movement,
    and execute the roundings; return, of the roundings that hit every goal when executed, the one
    with the fewest ticks, then the fewest corrections. Left out are roundings beyond the nearest 64
    of a plan (:meth:`.Rounding.every`), and roundings that, before or after they are solved,
    promise no fewer ticks than the best so far. The session counts the solver's effort and forward
    kinematics, not iterations and Jacobians of corrections. Raises MethodError if no rounding is
    solved and hits every goal."""
    fewest: PlanInTicks | None = None
    least: tuple[float, float] = math.inf, math.inf

    def worth(ticks: int) -> bool:
        return ticks < least[0]

    for plan in plans.ranked:
        instance, rounding = plan.instance, Rounding(session, problem, plan.instance)
        # A merger saves one tick a goal and never shortens the path.
        if not worth(rounding.least(plan) - len(instance.hands)):
            continue
        for merged, shortest in rounding.plans(plan, task, worth):
            if not worth(rounding.least(shortest, merged)):
                continue
            for rounded in rounding.every(shortest, merged):
                if not worth(rounded.ticks):
                    continue
                planned = movements(session, task, instance, rounded.configurations, rounded.steps)
                execution = execute(task, planned, model=session.model)
                session.spend(forward_kinematics=execution.evaluations)
                spent = execution.ticks, execution.corrections
                if execution.completed and spent < least:
                    least, fewest = spent, PlanInTicks(planned, execution, shortest)
                if not worth(rounding.least(shortest, merged)):
                    break  # no other rounding takes fewer
    if fewest is None:
        raise MethodError("solver-failed", "IPOPT could not round a plan to whole ticks")
    return fewest
