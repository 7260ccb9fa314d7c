"""The search for the optimum, the best reward that a global search finds.

A trial loses reward in proportion to the length of its path in joint space. So this method
searches, over hand sequences, for the shortest path that touches the discs of all goals in turn. It
starts from the chains of posture graphs (layered dynamic programming). It then rounds the plans
that may be best to whole control ticks. In some roundings a goal takes no movement, because the
hand is already inside the goal when its turn comes.

The method is the reference for the gaps of all other methods, not a competitor. The study
``studies/optima`` proves bounds on the optima.

``trajectory-optimisation/path-length`` searches for the same paths from other graphs and starts.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from coartic import Task, TaskError, parse_task
from coartic.baselines.posture_graph import QUICK, Count, Nodes, cheapest_chains
from coartic.baselines.shortest_paths import REWARD_INFORMATION, fewest_ticks, shortest_plans
from coartic.baselines.trajectory_problem import IPOPT, trajectory_problem
from coartic.method import Facts, Method, MethodError, Parameters, Result, Session
from coartic.tasks.task import letters_of

MOST_KEPT = 64  # hand sequences whose shortest paths are stored with the solution


class OptimumParameters(Parameters):
    """Restriction of the movements, and effort of the search."""

    other_arm: Literal["free", "still"] = "free"
    """``"still"`` if the arm whose hand is not chosen for a goal must not move on the way to the
    goal; otherwise ``"free"``."""
    base: Literal["task", "y", "xy"] = "task"
    """Base coordinates to lock in addition to the task's own locks: ``"y"``, ``"xy"``, or
    ``"task"`` for none."""
    nodes: Nodes = 200
    """Largest number of postures for a goal and hand in a graph."""
    graphs: Count = 3
    """Least number of independent graphs. More graphs are made until there are enough chains."""
    chains: Count = 100
    """Least number of chains, over all graphs and hand sequences. With three chains the search
    missed the best known path on 9 of 40 random tasks for one arm."""


class OptimumSearch(Method):
    """The shortest path found over hand sequences, in whole ticks."""

    name = "optimum/search"
    version = 2
    tuned_on = "random tasks"
    title = "optimum search"
    facts = Facts(works=("betts1998",), solvers=IPOPT, algorithm="optimum")
    information = REWARD_INFORMATION
    adapts_to = frozenset({"motor_noise", "base_weight"})
    stochastic = False
    Parameters = OptimumParameters
    quick = QUICK

    def solve(self, session: Session) -> Result:
        """Search for the movements with the fewest ticks.

        At most 64 hand sequences are searched in each graph.

        Raises MethodError if no movements that hit every goal are found, or the locks of the base
        make the task invalid.
        """
        parameters: OptimumParameters = self.parameters
        still = parameters.other_arm == "still"
        task = with_locks(session.reveal(*self.information), parameters.base)
        with session.building():
            problem = trajectory_problem(
                task.robot,
                task.hands,
                len(task.goals),
                "path-length",
                session.model.base_weight,
            )
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
    """Return a task with further base coordinates locked.

    Parameters
    ----------
    task : Task
    base : {"task", "y", "xy"}
        Coordinates to lock; ``"task"`` for none.

    Raises
    ------
    MethodError
        The task with these locks is not valid.
    """
    if base == "task":
        return task
    locked = sorted({*task.locked_base, *base})
    content = {**task.model_dump(mode="json"), "locked_base": locked}
    try:
        return parse_task(content, f"task {task.name!r} with base {' and '.join(locked)} locked")
    except TaskError as error:
        raise MethodError("infeasible", str(error)) from None


METHODS: tuple[type[Method], ...] = (OptimumSearch,)
