"""Trajectory optimisation: informed search with the whole objective written down.

One method per cost. Path length is the task's own reward as a formula; the others are
the smoothness objectives that informed accounts of coarticulation use: the sum of squared joint
displacements (Jordan 1986, 1992), minimum acceleration and minimum jerk of the joints, and minimum
jerk of the hand (Flash & Hogan 1985), the last three over times that are free at a constant total.
Hand sequences are planned from the cheapest chains of posture graphs; the plan that is cheapest
*by the method's own cost* is returned.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from coartic import Movement, Task
from coartic.baselines.posture_graph import (
    BEAM_WIDTH,
    QUICK,
    Count,
    HandSequence,
    Nodes,
    cheapest_chains,
)
from coartic.baselines.trajectory_problem import (
    MODEL_BASED,
    Cost,
    Instance,
    PathPlan,
    TrajectoryProblem,
    spline,
    trajectory_problem,
)
from coartic.baselines.whole_ticks import Rounding, movements
from coartic.method import Information, Method, MethodError, Parameters, Result, Session
from coartic.motion.movement import follow, segment_lengths
from coartic.robot import Array
from coartic.tasks.task import letters_of

SAMPLES = 200  # points of a smooth path between goals; four times as many changed no reward


class TrajectoryParameters(Parameters):
    """Hand sequences that are planned, and the starts of each."""

    most_sequences: Count = BEAM_WIDTH
    """Most hand sequences that are planned in a graph, 64 for all of two hands and six goals; of
    more sequences those with which a beam search of this width over the goals ends."""
    nodes: Nodes = 150
    """Most postures per goal and hand in a graph."""
    graphs: Count = 3
    """Independent graphs, at most two starts for a hand sequence from each. With one graph, the
    best path was missed on 3 of 23 small random tasks."""
    chains: Count = 30
    """Least number of chains of all hand sequences, from as many further graphs as are needed."""
    noisy_starts: Annotated[int, Field(ge=0)] = 4
    """Further starts per hand sequence, Gaussian noise of SD 0.1 to 1 on the first."""


class SmoothParameters(TrajectoryParameters):
    """Hand sequences and starts, and whether plans stop at goals."""

    stop: Literal[0, 1] = 0
    """1: the plan comes to a full stop at each goal, where velocities, for jerk accelerations too,
    are 0."""


class JerkParameters(SmoothParameters):
    """Parameters, by default without noisy starts: these find cheaper plans for four of 34 hand
    sequences of the paper's tasks, and change neither hands nor ticks."""

    noisy_starts: Annotated[int, Field(ge=0)] = 0
    """Further starts per hand sequence, Gaussian noise of SD 0.1 to 1 on the first."""


class HandJerkParameters(JerkParameters):
    """Parameters, by default with one start for a hand sequence: a plan by jerk of the hand takes
    four times as long, and on the paper's tasks a second start found no other plan."""

    graphs: Count = 1
    """Independent graphs, one start for a hand sequence from each."""
    chains: Count = 1
    """Least number of chains of all hand sequences, from as many further graphs as are needed."""


def cheapest_plan(
    session: Session,
    problem: TrajectoryProblem,
    instance: Instance,
    starts: list[Array],
    *,
    stops: bool = False,
) -> PathPlan:
    """Solve ``problem`` for an instance from each of ``starts``, configurations ``(G, dof)``;
    return the cheapest converged plan, or, if none converged, the plan of the last start. With
    ``stops`` velocities (for jerk also accelerations) are 0 at each goal. The session counts the
    effort."""
    plans = [problem.solve(instance, start, stops=stops) for start in starts]
    for plan in plans:
        session.spend(**plan.spent)
    converged = [plan for plan in plans if plan.converged]
    return min(converged, key=lambda plan: plan.cost) if converged else plans[-1]


class TrajectoryOptimisation(Method):
    """Base of the methods that return the cheapest plan by one cost."""

    version = 2
    cost: ClassVar[Cost]
    stochastic = False
    tuned_on = "random tasks"
    Parameters = TrajectoryParameters
    quick = QUICK | {"most_sequences": 1}

    def solve(self, session: Session) -> Result:
        """Plan for each hand sequence of :meth:`starts`, and return the movements of the plan with
        the least cost by the method's own cost, for path length after solving it again in whole
        ticks or, failing that, inside the discs. Raises MethodError if the solver finds no plan."""
        task = session.reveal(*self.information - {Information.SECONDARY_OBJECTIVES})
        with session.building():
            problem = trajectory_problem(task.robot, task.hands, len(task.goals), self.cost)
        # A target so near to a goal's centre is sure to hit; rounded to whole control ticks, a plan
        # goes through the rims.
        inside = task.radius - session.model.tolerances(task.radius)[0]
        radius = task.radius if self.cost == "path-length" else inside
        plans, failed = list[PathPlan](), dict[str, str]()
        stops = getattr(self.parameters, "stop", 0)
        with session.solving():
            for hands, starts in self.starts(session, task).items():
                instance = Instance.of(task, hands, still=False, radius=radius)
                plan = cheapest_plan(session, problem, instance, starts)
                if plan.converged and stops:
                    # A plan that stops starts from the one that passes the goals as well.
                    starts = [plan.configurations, *starts]
                    plan = cheapest_plan(session, problem, instance, starts, stops=True)
                if plan.converged:
                    plans.append(plan)
                else:
                    failed[letters_of(hands)] = plan.reason
            if not plans:
                raise MethodError(
                    "solver-failed", f"IPOPT converged for none of the hand sequences: {failed}"
                )
            best = plan = min(plans, key=lambda plan: plan.cost)
            aimed, configurations, steps = plan.instance, plan.configurations, None
            if self.cost == "path-length":
                rounded = Rounding(session, problem, aimed).nearest(plan)
                if rounded is not None:
                    configurations, steps = rounded.configurations, rounded.steps
                else:  # aimed inside the discs it is a plan all the same
                    aimed = replace(aimed, radius=inside)
                    plan = problem.solve(aimed, plan.configurations)
                    configurations = plan.configurations
                    session.spend(**plan.spent)
                    if not plan.converged:
                        reason = f"IPOPT, aimed inside the discs: {plan.reason}"
                        raise MethodError("solver-failed", reason)
            if len(plan.rates):
                solution = path_movements(session, task, aimed, spline(plan, SAMPLES))
            else:
                solution = movements(session, task, aimed, configurations, steps)
        details = {
            "cost": best.cost,
            "path_length": float(best.lengths().sum()),
            "costs": {letters_of(p.instance.hands): p.cost for p in plans},
            "failed": failed,
        }
        return Result(solution, details)

    def starts(self, session: Session, task: Task) -> dict[HandSequence, list[Array]]:
        """Return, by hand sequence planned, a list of starts, each ``(G, dof)``: the cheapest chain
        (a posture for each goal) of each random graph that has one; with two hands, except for jerk
        of the hand, each chain also with the idle arm moving in equal steps; and copies of the
        first start with noise. Raises MethodError if a goal has no posture in a graph."""
        parameters: TrajectoryParameters = self.parameters
        rng = np.random.default_rng(0)  # the same starts for all seeds
        chains = cheapest_chains(
            session,
            task,
            rng,
            nodes=parameters.nodes,
            graphs=parameters.graphs,
            chains=parameters.chains,
            most=parameters.most_sequences,
            spread=self.cost != "hand-jerk",
        )
        starts: dict[HandSequence, list[Array]] = {}
        for hands, configurations in chains:
            starts.setdefault(hands, []).append(configurations)
        for starts_of_hands in starts.values():
            first = starts_of_hands[0]
            for _ in range(parameters.noisy_starts):
                spread = 0.1 * 10.0 ** rng.random()
                starts_of_hands.append(first + spread * rng.standard_normal(first.shape))
        return starts


class PathLength(TrajectoryOptimisation):
    """The reward itself: the shortest path in joint space."""

    name = "trajectory-optimisation/path-length"
    title = "Trajectory optimisation, path length"
    citation = (
        "J. T. Betts (1998). Survey of numerical methods for trajectory optimization. "
        "Journal of Guidance, Control, and Dynamics."
    )
    information = MODEL_BASED | {Information.REWARD_FORMULA}
    cost = "path-length"


class SquaredDisplacement(TrajectoryOptimisation):
    """Minimum squared joint displacement: the sum over the movements from goal to goal."""

    name = "trajectory-optimisation/squared-displacement"
    title = "Trajectory optimisation, minimum squared joint displacement"
    citation = (
        "M. I. Jordan (1992). Constrained supervised learning. Journal of Mathematical "
        "Psychology; M. I. Jordan (1986). Serial order: a parallel distributed processing "
        "approach."
    )
    information = MODEL_BASED | {Information.SECONDARY_OBJECTIVES}
    cost = "squared-displacement"


class Acceleration(TrajectoryOptimisation):
    """Minimum acceleration of the joints: a cubic spline through the goals' discs."""

    name = "trajectory-optimisation/acceleration"
    title = "Trajectory optimisation, minimum acceleration"
    citation = (
        "T. Flash, N. Hogan (1985). The coordination of arm movements: an experimentally "
        "confirmed mathematical model. Journal of Neuroscience (there: jerk)."
    )
    information = MODEL_BASED | {Information.SECONDARY_OBJECTIVES}
    cost: ClassVar[Cost] = "acceleration"
    Parameters = SmoothParameters


class Jerk(Acceleration):
    """Minimum jerk of the joints: a quintic spline through the goals' discs."""

    name = "trajectory-optimisation/jerk"
    title = "Trajectory optimisation, minimum jerk"
    citation = (
        "T. Flash, N. Hogan (1985). The coordination of arm movements: an experimentally "
        "confirmed mathematical model. Journal of Neuroscience."
    )
    cost: ClassVar[Cost] = "jerk"
    Parameters = JerkParameters


class HandJerk(Jerk):
    """Minimum jerk of the hand, after Flash & Hogan (1985), with a small weight on joint jerk."""

    name = "trajectory-optimisation/hand-jerk"
    title = "Trajectory optimisation, minimum hand jerk"
    tuned_on = (
        "two-armed-2: least time between goals, and weight of joint jerk, where weights from 0.001 "
        "to 10 end at -349 to -399 (shipped: -393); else random tasks"
    )
    cost = "hand-jerk"
    Parameters = HandJerkParameters


METHODS: tuple[type[Method], ...] = (PathLength, SquaredDisplacement, Acceleration, Jerk, HandJerk)


def path_movements(
    session: Session, task: Task, instance: Instance, path: list[Array]
) -> tuple[Movement, ...]:
    """Return movements of kind path, one per goal, along ``path``: for each goal a piece, the
    configurations ``(k, dof)`` after the present one.

    A movement ends where the hand enters its goal, and a piece may go on from there: what is left
    of it begins the next movement, in which joints that ``instance`` holds on the way to the next
    goal stay where they are. After the last goal nothing follows. A movement that misses its goal
    is returned like others. The session counts the evaluations.
    """
    paths: list[Movement] = []
    here, rest = np.array(task.q0), np.empty((0, task.robot.dof))
    for goal, (hand, piece) in enumerate(zip(instance.hands, path, strict=True)):
        ahead = np.where(instance.held[goal], here, np.vstack([rest, piece]))
        followed = follow(
            task.robot, here, ahead, hand, task.goals[goal], task.radius, model=session.model
        )
        session.spend(forward_kinematics=followed.evaluations)
        paths.append(Movement(goal + 1, hand, "path", ahead[-1], waypoints=ahead))
        ends = np.cumsum(segment_lengths(np.vstack([here, ahead])))
        steps_made = followed.ticks - 1
        here, rest = followed.q, ahead[ends > steps_made * session.model.step]
    return tuple(paths)
