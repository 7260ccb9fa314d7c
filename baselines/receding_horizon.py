"""A planner that looks a fixed number of goals ahead (model predictive control).

The window of the planner is the current goal and ``horizon`` goals after it. The planner searches,
over hand sequences, for the shortest path through the window, makes the first movement, and plans
again from the end of that movement.

- With ``horizon`` 0 the planner takes the shortest path to each goal.
- In a window that contains the last goal, all movements are made, because planning again would find
  the same movements.
- With a horizon of all goals the planner plans the whole task at once. The gap to the optimum is
  then due only to the smaller search.

A window is planned as ``optimum/search`` plans a task (:mod:`.shortest_paths`): chains of posture
graphs, IPOPT, whole ticks. To save time, there are fewer chains, the graphs for two hands are
smaller, and IPOPT starts only from the shortest ``starts`` chains.

Movements are rounded to whole ticks in each window. Otherwise each goal would lose half a tick on
average, at any horizon. With rounding, half a tick is lost only at the last goal of a window of
which all movements are made: once in the whole task, or at each goal if the horizon is 0.
``path_length`` in the details is summed before rounding, and does not have this loss.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from coartic import Movement
from coartic.baselines.posture_graph import QUICK, Count, Nodes, cheapest_chains
from coartic.baselines.shortest_paths import (
    REWARD_INFORMATION,
    ShortestPlans,
    fewest_ticks,
    shortest_plans,
)
from coartic.baselines.trajectory_problem import IPOPT, trajectory_problem
from coartic.method import Facts, Method, Parameters, Result, Session
from coartic.motion.doors import segment_lengths
from coartic.robot import BASE_DOF, HANDS
from coartic.tasks.task import MAX_GOALS, Start


class RecedingHorizonParameters(Parameters):
    """Parameters: the horizon, and the effort of the search."""

    horizon: Annotated[int, Field(ge=0, lt=MAX_GOALS)] = 1
    """Number of goals in a window after the current goal. At the end of a task the window has fewer
    goals."""
    nodes: Nodes = 200
    """Largest number of postures in a posture graph for each goal. With two hands, each hand has at
    most half of this number."""
    graphs: Count = 3
    """Least number of independent graphs for each window. More graphs are made until there are
    enough chains."""
    chains: Count = 24
    """Least number of chains of each window, over all graphs and hand sequences."""
    starts: Count = 24
    """Largest number of starts of each window from which IPOPT solves. The starts are the shortest
    chains. With two hands and more than one goal, they may also be copies of chains in which the
    idle arm moves in equal steps."""


class RecedingHorizon(Method):
    """Planner that plans through the next goals, makes the first movement, and plans again."""

    name = "receding-horizon"
    version = 2
    tuned_on = "random tasks"
    title = "receding-horizon plan"
    facts = Facts(
        works=("mayne2000", "garcia1989"),
        solvers=IPOPT,
        algorithm="receding-horizon planning",
        short="receding horizon",
    )
    information = REWARD_INFORMATION
    adapts_to = frozenset({"motor_noise", "base_weight"})
    stochastic = False
    Parameters = RecedingHorizonParameters
    quick = QUICK

    def solve(self, session: Session) -> Result:
        """Plan and move window by window, and return the movements that were made.

        Raises MethodError if no path is found.
        """
        task, parameters = session.reveal(*self.information), self.parameters
        exact = session.model.without_noise()
        rng = np.random.default_rng(0)  # the same graphs for all seeds
        windows: list[ShortestPlans] = []
        solution: list[Movement] = []
        length, q = 0.0, np.array(task.q0)
        while (goal := len(solution)) < len(task.goals):
            ahead = task.goals[goal : goal + parameters.horizon + 1]
            angles = {hand: tuple(q[task.robot.joints(hand)].tolist()) for hand in HANDS}
            start = Start(base=tuple(q[:BASE_DOF].tolist()), **angles)
            window = task.model_copy(update={"goals": ahead, "start": start})
            with session.building():
                problem = trajectory_problem(
                    task.robot, task.hands, len(ahead), "path-length", exact.base_weight
                )
            with session.solving():
                chains = cheapest_chains(
                    session,
                    window,
                    rng,
                    nodes=parameters.nodes // len(task.hands),
                    graphs=parameters.graphs,
                    chains=parameters.chains,
                    spread=len(ahead) > 1,  # with one goal it is the chain itself
                )
                ranked = sorted(
                    chains,
                    key=lambda chain: segment_lengths(np.vstack([q, chain[1]]), exact).sum(),
                )
                starts = ranked[: parameters.starts]
                plans = shortest_plans(session, window, problem, starts, still=False)
                best = fewest_ticks(session, window, problem, plans)
            windows.append(plans)
            followed = 1 if goal + len(ahead) < len(task.goals) else len(ahead)
            solution += [
                replace(movement, goal=goal + movement.goal)
                for movement in best.movements[:followed]
            ]
            length += float(best.plan.lengths()[:followed].sum())
            q = best.execution.configurations[followed - 1]
        details = {
            "path_length": length,
            "windows": len(windows),
            "solves": sum(plans.solves for plans in windows),
            "failed_solves": sum(plans.failed for plans in windows),
        }
        return Result(tuple(solution), details)


METHODS = (RecedingHorizon,)
