"""A planner that looks a fixed number of goals ahead.

From where the robot stands it finds the shortest movements through the next goals, ``horizon``
beyond the one to be hit, over all hand sequences. It makes the first of them, stands where that
one ended, and plans again (model predictive control: Garcia, Prett & Morari 1989; Mayne, Rawlings,
Rao & Scokaert 2000). With ``horizon`` 0 it goes to each goal the shortest way. A window that
reaches the last goal is followed to its end, since planning again would find the rest of it. With
a horizon of all goals it is the search for the optimum itself, so that its gap to the optimum is
what the search alone costs.

A window is planned as ``optimum/dynamic-programming`` plans a task (:mod:`coartic.baselines.
shortest_paths`): chains of posture graphs, IPOPT, whole ticks. Two things differ, for speed: the
graphs are fewer and smaller, and only the shortest ``starts`` of them are polished. Without whole
ticks in every window each goal would lose half a tick for a reason that has nothing to do with
the horizon. With them a window loses half a tick at its last goal alone: that is once in all, but
at every goal with a horizon of 0. ``path_length`` in the details has no such loss: it adds up the
plans as they were before the rounding, from where the robot stood.

The horizon limits choice of hand and posture alike. With ``hands`` ``optimal`` it limits postures
alone: the hands are those of the plan with all goals. What the hands alone lose, followed by the
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
    TOLD,
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
    """How far it looks ahead, what it minimises, and how long it searches."""

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
    most_sequences: Annotated[int, Field(ge=1)] = 64
    """Hand sequences that are planned for each graph: all where there are no more, with two
    hands up to six goals; else those that a beam of this width over the goals ends with."""
    sampling_seed: Annotated[int, Field(ge=0)] = 0


class RecedingHorizon(Method):
    """The shortest movements through the next goals, of which it makes the first."""

    name = "receding-horizon"
    title = "Receding-horizon planning of the shortest path"
    citation = (
        "D. Q. Mayne, J. B. Rawlings, C. V. Rao, P. O. M. Scokaert (2000). Constrained model "
        "predictive control: stability and optimality. Automatica; C. E. Garcia, D. M. Prett, "
        "M. Morari (1989). Model predictive control: theory and practice. Automatica."
    )
    told = TOLD
    stochastic = False
    Parameters = RecedingHorizonParameters
    quick: ClassVar[dict[str, Any]] = {"nodes": 40, "graphs": 1, "chains": 1}

    def solve(self, session: Session) -> Result:
        """Plan, make a movement, and plan again, until the last goal is in view."""
        check_ticks(session.model)
        return Planner(session, session.hand_over(*self.told), self.parameters).solve()


METHODS = (RecedingHorizon,)


class Planner:
    """The planner at work on one task."""

    def __init__(self, session: Session, task: Task, parameters: RecedingHorizonParameters) -> None:
        self.session, self.task, self.parameters = session, task, parameters
        self.costs = joint_costs(task.robot, parameters.costs, parameters.cost_factor)
        self.rng = np.random.default_rng(parameters.sampling_seed)
        self.windows = self.solves = self.failed = 0

    def solve(self) -> Result:
        """A window after another, until one reaches the last goal."""
        goals, ahead = len(self.task.goals), self.parameters.horizon + 1
        hands: HandSequence | None = None
        if self.parameters.hands == "optimal":
            hands = hands_of(self.plan(self.task, None).execution.hands)
        solution: list[Movement] = []
        length, q = 0.0, np.array(self.task.q0)
        while (goal := len(solution)) < goals:
            end = min(goal + ahead, goals)
            window = self.plan(
                remaining(self.task, q, goal, end), None if hands is None else hands[goal:end]
            )
            followed = 1 if end < goals else end - goal
            solution += [
                replace(movement, goal=goal + movement.goal)
                for movement in window.movements[:followed]
            ]
            planned = np.vstack([q, window.plan.configurations[:followed]])
            length += float(segment_lengths(planned, self.costs).sum())
            q = window.execution.configurations[followed - 1]
        details = {
            "path_length": length,
            "windows": self.windows,
            "solves": self.solves,
            "failed_solves": self.failed,
        }
        return Result(tuple(solution), details)

    def plan(self, task: Task, only: HandSequence | None) -> PlanInTicks:
        """The shortest movements through all goals of a task, or of what remains of one."""
        weighted = self.parameters.costs != "none"
        costs = tuple(self.costs.tolist()) if weighted else None
        with self.session.building():
            problem = trajectory_problem(
                task.robot, task.hands, len(task.goals), "path-length", costs
            )
        with self.session.solving():
            plans = shortest_plans(
                self.session,
                task,
                problem,
                self.shortest_starts(task, only),
                still=False,
                radius=task.radius - (self.session.model.arrival_tolerance if weighted else 0.0),
            )
            self.windows += 1
            self.solves += plans.solves
            self.failed += plans.failed
            if weighted:
                return shortest_as_it_is(self.session, task, plans)
            return fewest_ticks(self.session, task, problem, plans)

    def shortest_starts(self, task: Task, only: HandSequence | None) -> list[Chain]:
        """The starts that are polished."""
        starts = cheapest_chains(
            self.session,
            task,
            self.rng,
            nodes=self.parameters.nodes // len(task.hands),
            graphs=self.parameters.graphs,
            chains=self.parameters.chains,
            most=self.parameters.most_sequences,
            spread=len(task.goals) > 1,  # with one goal it is the chain itself
            only=only,
            costs=self.costs,
        )
        ranked = sorted(starts, key=lambda start: self.length_from(task, start))
        return ranked[: self.parameters.starts]

    def length_from(self, task: Task, start: Chain) -> float:
        """Weighted path length of a start as it is."""
        _, configurations = start
        return float(segment_lengths(np.vstack([task.q0, configurations]), self.costs).sum())


def remaining(task: Task, q: Array, first: int, end: int) -> Task:
    """The goals from ``first`` (0-based) up to ``end``, from a configuration ``q``, ``(dof,)``."""
    angles = {hand: tuple(q[task.robot.joints(hand)].tolist()) for hand in HANDS}
    start = Start(base=tuple(q[:BASE_DOF].tolist()), **angles)
    goals = task.goals[first:end]
    return task.model_copy(update={"goals": goals, "start": start})


def shortest_as_it_is(session: Session, task: Task, plans: ShortestPlans) -> PlanInTicks:
    """The shortest plan without rounding; its movements end with the first step inside a disc."""
    instance, plan = plans.ranked[0]
    planned = movements(session, task, instance, plan.configurations)
    execution = execute(task, planned, model=session.model)
    session.spend(forward_kinematics=execution.evaluations)
    if not execution.completed:
        raise MethodError("solver-failed", f"a movement missed its goal: {execution.reason}")
    return PlanInTicks(planned, execution, plan)
