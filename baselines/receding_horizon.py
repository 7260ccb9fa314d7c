"""A planner that looks a fixed number of goals ahead.

From where the robot stands it finds the shortest movements through the next goals, ``horizon``
beyond the one to be hit, over all hand sequences. It makes the first of them, stands where that
one ended, and plans again (model predictive control: Garcia, Prett & Morari 1989; Mayne, Rawlings,
Rao & Scokaert 2000). With ``horizon`` 0 it goes to each goal the shortest way. A window that
reaches the last goal is followed to its end, since planning again would find the rest of it. With
a horizon of all goals it is the search for the optimum itself, so that its gap to the optimum is
what the search alone costs.

A window is planned as ``optimum/branch-and-bound`` plans a task (:mod:`coartic.baselines.
shortest_paths`): chains of posture graphs, IPOPT, whole ticks. Two things differ, for speed: the
graphs are fewer and smaller, and only the shortest ``starts`` of them are polished. Without whole
ticks in every window each goal would lose half a tick for a reason that has nothing to do with
the horizon. With them a window loses half a tick at its last goal alone: that is once in all, but
at every goal with a horizon of 0. ``path_length`` in the details has no such loss: it adds up the
plans as they were before the rounding, from where the robot stood.

The horizon limits choice of hand and posture alike. With ``hands`` ``optimal`` it limits postures
alone: the hands are those of the plan with all goals. The loss by the hands alone, with the
best postures, is in the details of the searches for the optimum, ``path_lengths`` by hand
sequence.

``costs`` makes some joints cost ``cost_factor`` times as much as the others: windows are then
shortest by the weighted path length (:func:`coartic.motion.costs.segment_lengths`). The score
remains ticks; the weighted path length of a stored solution follows from its
:func:`~coartic.motion.ticks.trajectory`. Ticks are not weighted, so that such a window is not
rounded: it aims a little inside the discs, and each movement ends with the first step inside.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from coartic import Movement, Task, execute
from coartic.baselines.posture_graph import Chain, HandSequence, cheapest_chains
from coartic.baselines.shortest_paths import (
    KNOWS_REWARD,
    PlanInTicks,
    ShortestPlans,
    check_ticks,
    fewest_ticks,
    shortest_plans,
)
from coartic.baselines.trajectory_problem import trajectory_problem
from coartic.baselines.whole_ticks import movements
from coartic.method import Method, MethodError, Parameters, Result, Session
from coartic.motion.costs import CostlyJoints, joint_costs, segment_lengths
from coartic.robot import BASE_DOF, HANDS, Array
from coartic.tasks.task import MOST_GOALS, Start, hands_of


class RecedingHorizonParameters(Parameters):
    """The horizon, the cost, and the effort of the search."""

    horizon: Annotated[int, Field(ge=0, lt=MOST_GOALS)] = 1
    """Goals in view beyond the one to be hit; all where there are no more."""
    hands: Literal["planned", "optimal"] = "planned"
    """``planned``: every window chooses its hands; ``optimal``: they are those of the plan with all
    goals, and a window chooses postures only."""
    costs: CostlyJoints = "none"
    """Joints whose movement costs more than that of the others."""
    cost_factor: Annotated[float, Field(ge=0.01, le=100)] = 3.0
    """How many times as much, where there are such joints."""
    nodes: Annotated[int, Field(ge=10, le=1000)] = 200
    """Postures per goal of a posture graph, shared by the hands: with two, half as many each."""
    graphs: Annotated[int, Field(ge=1)] = 3
    """Independent graphs for each window, or more, until there are as many ``chains``."""
    chains: Annotated[int, Field(ge=1)] = 24
    """Chains of each window, over all graphs and hand sequences."""
    starts: Annotated[int, Field(ge=1)] = 24
    """Starts of each window that are polished, the shortest: all chains, and all of them with the
    other arm spread out, are ranked by length."""


class RecedingHorizon(Method):
    """The shortest movements through the next goals, of which it makes the first."""

    name = "receding-horizon"
    title = "Receding-horizon planning of the shortest path"
    citation = (
        "D. Q. Mayne, J. B. Rawlings, C. V. Rao, P. O. M. Scokaert (2000). Constrained model "
        "predictive control: stability and optimality. Automatica; C. E. Garcia, D. M. Prett, "
        "M. Morari (1989). Model predictive control: theory and practice. Automatica."
    )
    told = KNOWS_REWARD
    stochastic = False
    Parameters = RecedingHorizonParameters
    quick: ClassVar[dict[str, Any]] = {"nodes": 40, "graphs": 1, "chains": 1}

    def solve(self, session: Session) -> Result:
        """Plan, make a movement, and plan again, until the last goal is in view."""
        check_ticks(session.model)
        task, parameters = session.hand_over(*self.told), self.parameters
        costs = joint_costs(task.robot, parameters.costs, parameters.cost_factor)
        rng = np.random.default_rng(0)  # the same graphs for all seeds
        windows: list[PlanInTicks] = []

        def plan(window: Task, hands: HandSequence | None) -> PlanInTicks:
            windows.append(plan_window(session, window, hands, parameters, costs, rng))
            return windows[-1]

        hands = None
        if parameters.hands == "optimal":
            hands = hands_of(plan(task, None).execution.hands)
        solution: list[Movement] = []
        length, q = 0.0, np.array(task.q0)
        while (goal := len(solution)) < len(task.goals):
            end = min(goal + parameters.horizon + 1, len(task.goals))
            window = plan(remaining(task, q, goal, end), hands and hands[goal:end])
            followed = 1 if end < len(task.goals) else end - goal
            solution += [
                replace(movement, goal=goal + movement.goal)
                for movement in window.movements[:followed]
            ]
            planned = np.vstack([q, window.plan.configurations[:followed]])
            length += float(segment_lengths(planned, costs).sum())
            q = window.execution.configurations[followed - 1]
        details = {
            "path_length": length,
            "windows": len(windows),
            "solves": sum(window.solves for window in windows),
            "failed_solves": sum(window.failed for window in windows),
        }
        return Result(tuple(solution), details)


METHODS = (RecedingHorizon,)


def plan_window(
    session: Session,
    task: Task,
    only: HandSequence | None,
    parameters: RecedingHorizonParameters,
    costs: Array,
    rng: np.random.Generator,
) -> PlanInTicks:
    """The shortest movements through all goals of a task, or through those that remain of one."""
    weighted = parameters.costs != "none"
    with session.building():
        problem = trajectory_problem(
            task.robot,
            task.hands,
            len(task.goals),
            "path-length",
            tuple(costs.tolist()) if weighted else None,
        )
    with session.solving():
        starts = cheapest_chains(
            session,
            task,
            rng,
            nodes=parameters.nodes // len(task.hands),
            graphs=parameters.graphs,
            chains=parameters.chains,
            spread=len(task.goals) > 1,  # with one goal it is the chain itself
            only=only,
            costs=costs,
        )

        def weighted_length(start: Chain) -> float:
            return float(segment_lengths(np.vstack([task.q0, start[1]]), costs).sum())

        plans = shortest_plans(
            session,
            task,
            problem,
            sorted(starts, key=weighted_length)[: parameters.starts],
            still=False,
            radius=task.radius - (session.model.arrival_tolerance if weighted else 0.0),
        )
        if weighted:
            return without_rounding(session, task, plans)
        return fewest_ticks(session, task, problem, plans)


def remaining(task: Task, q: Array, first: int, end: int) -> Task:
    """The goals from ``first`` (0-based) up to ``end``, from a configuration ``q``, ``(dof,)``."""
    angles = {hand: tuple(q[task.robot.joints(hand)].tolist()) for hand in HANDS}
    start = Start(base=tuple(q[:BASE_DOF].tolist()), **angles)
    goals = task.goals[first:end]
    return task.model_copy(update={"goals": goals, "start": start})


def without_rounding(session: Session, task: Task, plans: ShortestPlans) -> PlanInTicks:
    """The shortest plan as it is; its movements end with the first step inside a disc."""
    instance, plan = plans.ranked[0]
    planned = movements(session, task, instance, plan.configurations)
    execution = execute(task, planned, model=session.model)
    session.spend(forward_kinematics=execution.evaluations)
    if not execution.completed:
        raise MethodError("solver-failed", f"a movement missed its goal: {execution.reason}")
    return PlanInTicks(planned, execution, plan, plans.solves, plans.failed)
