"""A planner that looks a fixed number of goals ahead (model predictive control).

The window of the planner consists of the current goal and the next ``horizon`` goals. The planner
searches over hand sequences (at most 64 in each posture graph) for the shortest path through the
goals of the window. It makes the first movement of this path, and then plans again from the
configuration in which the movement ends.

- With ``horizon`` 0 the planner takes the shortest path to each goal.
- If the window contains the last goal, all movements of the window are made, because no further
  goal comes into view.
- If the horizon covers all goals, the planner plans the whole task at once. The gap to the optimum
  is then due only to the limited search.

A window is planned as ``optimum/search`` plans a task (:mod:`.shortest_paths`): by chains of
posture graphs, IPOPT, and rounding to whole ticks. To save time, there are fewer chains, the graphs
for two hands have fewer postures, and IPOPT starts only from the shortest ``starts`` chains.

The movements of each window are rounded to whole ticks together. If each movement were rounded up
separately, each movement would lose half a tick on average. If they are rounded together, only the
last movement of a window loses half a tick on average. The last movement is made only if all
movements of the window are made: once in a task, or at each goal if the horizon is 0. The
``path_length`` in the details is the length before rounding, and does not contain this loss.
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
    """Parameters of the receding-horizon planner: the horizon, and the effort of the search."""

    horizon: Annotated[int, Field(ge=0, lt=MAX_GOALS)] = 1
    """Number of goals after the current goal that belong to a window. At the end of a task fewer
    goals are left."""
    nodes: Nodes = 200
    """Number of postures that are sampled in a posture graph for each goal. With two hands, half of
    this number is sampled for each hand."""
    graphs: Count = 3
    """Smallest number of independent posture graphs for each window. More graphs are made until
    there are ``chains`` chains."""
    chains: Count = 24
    """Smallest number of chains for each window, over all graphs and hand sequences."""
    starts: Count = 24
    """Largest number of starts from which IPOPT solves in each window. The starts are the shortest
    of the chains. With two hands and more than one goal in the window, copies of chains in which
    the idle arm moves in equal steps can be starts as well."""


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
        """Plan window by window, and return the movements that were made.

        The details contain the length of the path before rounding (``path_length``, in a mix of
        length units and rad), the number of windows (``windows``), the number of starts of IPOPT
        (``solves``), and how many of them did not converge (``failed_solves``). Raises MethodError
        if no path through a window is found, or if none can be rounded to whole ticks.
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
