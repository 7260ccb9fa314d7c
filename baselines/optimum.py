"""The search for the optimum: the best reward that a global search finds.

Reward is lost in proportion to the joint-space path, so the shortest path that touches every disc
in turn is sought over hand sequences, from the chains of posture graphs (layered dynamic
programming). Plans that may be best are then rounded to whole control ticks, with and without goals
that are hit as their turn comes because the hand is already there. A reference for the gaps of all
other methods, not a competitor. Bounds on the optima are proven in ``studies/optima``.

Another search for the same paths is ``trajectory-optimisation/path-length``, from graphs and starts
of its own.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from coartic import Task, TaskError, parse_task
from coartic.baselines.posture_graph import QUICK, Count, Nodes, cheapest_chains
from coartic.baselines.shortest_paths import REWARD_INFORMATION, fewest_ticks, shortest_plans
from coartic.baselines.trajectory_problem import trajectory_problem
from coartic.method import Method, MethodError, Parameters, Result, Session
from coartic.tasks.task import letters_of

MOST_KEPT = 64  # hand sequences whose shortest paths are kept with the solution


class OptimumParameters(Parameters):
    """Restriction of the movements, and effort of the search."""

    other_arm: Literal["free", "still"] = "free"
    """``still``: the arm whose hand is not chosen for a goal does not move on the way to it."""
    base: Literal["task", "y", "xy"] = "task"
    """Base coordinates that are locked in addition to the task's own locks: ``y``, ``xy``, or none
    for ``task``."""
    nodes: Nodes = 200
    """Most postures per goal and hand in a graph."""
    graphs: Count = 3
    """Independent graphs; more are made while chains are too few."""
    chains: Count = 100
    """Least number of chains, over all graphs and hand sequences. With three, the best path known
    was missed on 9 of 40 random tasks for one arm."""


class OptimumSearch(Method):
    """The shortest path found over hand sequences, in whole ticks."""

    name = "optimum/search"
    version = 2
    tuned_on = "random tasks"
    title = "Optimum: dynamic programming over postures"
    citation = (
        "J. T. Betts (1998). Survey of numerical methods for trajectory optimization. "
        "Journal of Guidance, Control, and Dynamics."
    )
    information = REWARD_INFORMATION
    stochastic = False
    Parameters = OptimumParameters
    quick = QUICK

    def solve(self, session: Session) -> Result:
        """Search for the shortest path over hand sequences (at most 64 a graph), round plans to
        whole ticks, and return the movements with the fewest ticks found. Raises MethodError if no
        movements that hit every goal are found, and if locks of the base make the task invalid."""
        parameters: OptimumParameters = self.parameters
        still = parameters.other_arm == "still"
        task = with_locks(session.reveal(*self.information), parameters.base)
        with session.building():
            problem = trajectory_problem(task.robot, task.hands, len(task.goals), "path-length")
        with session.solving():
            starts = cheapest_chains(
                session,
                task,
                np.random.default_rng(0),
                nodes=parameters.nodes,
                graphs=parameters.graphs,
                chains=parameters.chains,
                spread=not still,
            )
            plans = shortest_plans(session, task, problem, starts, still=still)
            best = fewest_ticks(session, task, problem, plans)
        details = {
            "path_length": plans.ranked[0].cost,
            "path_lengths": {
                letters_of(plan.instance.hands): plan.cost for plan in plans.ranked[:MOST_KEPT]
            },
            "solves": plans.solves,
            "failed_solves": plans.failed,
            "sequences_planned": len(plans.ranked),
        }
        return Result(best.movements, details)


def with_locks(task: Task, base: str) -> Task:
    """Return a task with base coordinates locked in addition to its own: ``base`` is ``"y"``,
    ``"xy"``, or ``"task"`` for none, which returns the task itself. Raises MethodError if the task
    with these locks is not valid."""
    if base == "task":
        return task
    locked = sorted({*task.locked_base, *base})
    content = {**task.model_dump(mode="json"), "locked_base": locked}
    try:
        return parse_task(content, f"task {task.name!r} with base {' and '.join(locked)} locked")
    except TaskError as error:
        raise MethodError("infeasible", str(error)) from None


METHODS: tuple[type[Method], ...] = (OptimumSearch,)
