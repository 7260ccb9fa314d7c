"""The optimum: the best reward that a global search finds, and a proof of how good it is.

Reward is lost in proportion to the joint-space path, so the shortest path that touches every disc
is sought over all hand sequences, from the chains of posture graphs (layered dynamic programming).
Every plan is then rounded to whole control ticks in every way, with and without goals that are hit
as their turn comes because the other hand is already there. Branch and bound
(:mod:`coartic.baselines.certificate`) proves a reward that nothing exceeds. A reference for the
gaps of all other methods, not a competitor.

Another search for the same paths is ``trajectory-optimisation/path-length``, from graphs and starts
of its own. When the shipped optima (``optima.json``) were made there was a third, from random
starts around the configurations of the corrective process. It found the same rewards but for
two-armed-1: one tick more, and three fewer with the other arm still.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from coartic import Task, TaskError, parse_task
from coartic.baselines.certificate import certify
from coartic.baselines.posture_graph import cheapest_chains
from coartic.baselines.shortest_paths import REWARD_INFORMATION, fewest_ticks, shortest_plans
from coartic.baselines.trajectory_problem import trajectory_problem
from coartic.method import Method, MethodError, Parameters, Result, Session
from coartic.tasks.task import letters_of

MOST_KEPT = 64  # hand sequences whose shortest paths are kept beside the solution


class OptimumParameters(Parameters):
    """The restriction, how long to search, and the budget of the proof."""

    other_arm: Literal["free", "still"] = "free"
    """``still``: the arm that is not chosen does not move."""
    base: Literal["task", "y", "xy"] = "task"
    """Base coordinates that are locked: those of the task, or these in addition."""
    nodes: Annotated[int, Field(ge=10, le=1000)] = 200
    """Postures per goal and hand."""
    graphs: Annotated[int, Field(ge=1)] = 3
    """Independent graphs, or more, until there are as many ``chains``."""
    chains: Annotated[int, Field(ge=1)] = 100
    """Starts, over all graphs and hand sequences, each with the other arm spread out, too. With
    three, the best path known was missed on 9 of 40 random tasks for one arm."""
    most_nodes: Annotated[int, Field(ge=0)] = 20_000
    """Cone programmes that may be solved for the proof, some 300 a second with five goals. It ends
    with the bound that it has then, and says how many ticks that leaves. 0: no proof."""


class Optimum(Method):
    """The shortest path over all hand sequences, in whole ticks, with a bound."""

    name = "optimum/branch-and-bound"
    title = "Optimum: dynamic programming, with a proven bound"
    citation = (
        "G. P. McCormick (1976). Computability of global solutions to factorable nonconvex "
        "programs. Mathematical Programming; P. J. Goulart, Y. Chen (2024). Clarabel: an "
        "interior-point solver for conic programs with quadratic objectives."
    )
    information = REWARD_INFORMATION
    stochastic = False
    Parameters = OptimumParameters
    quick: ClassVar[dict[str, Any]] = {"nodes": 40, "graphs": 1, "chains": 1, "most_nodes": 100}

    def solve(self, session: Session) -> Result:
        """Search and prove; the solution has the fewest ticks found."""
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
            "sequences_planned": len(plans.by_hands),
        }
        if not parameters.most_nodes:
            return Result(best.movements, details)
        ticks = best.execution.ticks
        with session.solving():
            certificate = certify(
                task, ticks, still=still, model=session.model, most_nodes=parameters.most_nodes
            )
        session.spend(solver_iterations=certificate.iterations)
        details |= {
            "proven_optimal": certificate.ticks == ticks,
            "nodes": certificate.nodes,
            "open_nodes": certificate.open_nodes,
            "ticks_left": ticks - certificate.ticks,
        }
        return Result(best.movements, details, bound=-certificate.ticks)


def with_locks(task: Task, base: str) -> Task:
    """The task with further base coordinates locked."""
    if base == "task":
        return task
    locked = sorted({*task.locked_base, *base})
    content = {**task.model_dump(mode="json"), "locked_base": locked}
    try:
        return parse_task(content, f"task {task.name!r} with base {' and '.join(locked)} locked")
    except TaskError as error:
        raise MethodError("infeasible", str(error)) from None


METHODS: tuple[type[Method], ...] = (Optimum,)
