"""Trajectory optimisation: informed search with the objective as a formula.

There is a method for each cost. The cost *path length* corresponds to the task's reward. The other
costs are smoothness objectives. They come from theories of coarticulation that assume an internal
model of the kinematics:

- the sum of squared joint displacements (Jordan 1986, 1992);
- acceleration of the joints;
- jerk of the joints;
- jerk of the hand (Flash & Hogan 1985).

For the last three costs, the durations of the movements are variables whose sum is constant.

For each hand sequence (at most 64 in each posture graph, by default), a method finds plans with
locally minimal cost by IPOPT, which starts from the cheapest chains of posture graphs. The method
returns the plan that is cheapest *by its own cost*.
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
    IPOPT,
    MODEL_BASED,
    Cost,
    Instance,
    PathPlan,
    TrajectoryProblem,
    spline,
    trajectory_problem,
)
from coartic.baselines.whole_ticks import Rounding, movements
from coartic.method import Facts, Information, Method, MethodError, Parameters, Result, Session
from coartic.motion.doors import follow, segment_lengths
from coartic.robot import Array
from coartic.tasks.task import letters_of

SAMPLES = 200  # points of a smooth path from goal to goal; with 800 no reward changed


class TrajectoryParameters(Parameters):
    """Parameters of trajectory optimisation: hand sequences to plan, and starts of IPOPT."""

    most_sequences: Count = BEAM_WIDTH
    """Largest number of hand sequences that are planned in a graph. If a task has more sequences, a
    beam search of this width over the goals selects them. With two hands and six goals there are 64
    sequences."""
    nodes: Nodes = 150
    """Number of postures that are sampled in a graph for each pair of goal and hand."""
    graphs: Count = 3
    """Smallest number of independent posture graphs. Each graph gives at most two starts for a hand
    sequence. With one graph the best path was missed on 3 of 23 small random tasks."""
    chains: Count = 30
    """Smallest number of chains, over all graphs and hand sequences. More graphs are made until
    there are this many chains."""
    noisy_starts: Annotated[int, Field(ge=0)] = 4
    """Number of further starts for each hand sequence. Each of them is the first start of the
    sequence plus Gaussian noise, whose standard deviation is drawn log-uniformly from 0.1 to 1, in
    length units and rad."""


class SmoothParameters(TrajectoryParameters):
    """Parameters for smoothness costs, with the option to stop at each goal."""

    stop: Literal[0, 1] = 0
    """1 if the plan has to stop at each goal: velocities at the goals are 0, and for jerk
    accelerations, too. 0 if the plan need not stop."""


class JerkParameters(SmoothParameters):
    """Parameters for jerk, by default without noisy starts.

    On the paper's tasks, noisy starts find cheaper plans for four of 34 hand sequences, but change
    neither the hands nor the ticks of the solutions.
    """

    noisy_starts: Annotated[int, Field(ge=0)] = 0
    """Number of further starts for each hand sequence, as in :class:`TrajectoryParameters`."""


class HandJerkParameters(JerkParameters):
    """Parameters for jerk of the hand, by default with one start for each hand sequence.

    A plan takes four times as long to compute as one for jerk of the joints. On the paper's tasks a
    second start did not find any other plan.
    """

    graphs: Count = 1
    """Smallest number of independent posture graphs. Each graph gives at most one start for a hand
    sequence."""
    chains: Count = 1
    """Smallest number of chains, over all graphs and hand sequences. More graphs are made until
    there are this many chains."""


def cheapest_plan(
    session: Session,
    problem: TrajectoryProblem,
    instance: Instance,
    starts: list[Array],
    *,
    stops: bool = False,
) -> PathPlan:
    """Solve a problem from several starts, and return the cheapest converged plan.

    Parameters
    ----------
    session : Session
        Session that counts the effort of the solver.
    problem : TrajectoryProblem
    instance : Instance
    starts : list of ndarray, shape (G, dof)
        Configurations from which the solver starts.
    stops : bool
        True to make velocities, and for jerk also accelerations, 0 at each goal.

    Returns
    -------
    PathPlan
        The cheapest converged plan. If no plan converged, the plan from the last start is returned.
    """
    plans = [problem.solve(instance, start, stops=stops) for start in starts]
    for plan in plans:
        session.spend(**plan.spent)
    converged = [plan for plan in plans if plan.converged]
    return min(converged, key=lambda plan: plan.cost) if converged else plans[-1]


class TrajectoryOptimisation(Method):
    """Base class of the methods that plan trajectories of minimal cost."""

    version = 2
    cost: ClassVar[Cost]
    stochastic = False
    tuned_on = "random tasks"
    Parameters = TrajectoryParameters
    quick = QUICK | {"most_sequences": 1}

    def solve(self, session: Session) -> Result:
        """Plan for each hand sequence, and return the movements of the cheapest plan.

        For the cost path length, the cheapest plan is rounded to whole control ticks
        (:meth:`.Rounding.nearest`). If that fails, the plan is solved again with targets well
        inside the discs of the goals.

        The details contain

        - ``cost``: cost of the cheapest plan before rounding;
        - ``path_length``: sum of the straight distances from goal to goal in this plan, in a mix of
          length units and rad (the path itself is longer if it is curved);
        - ``costs``: dict that maps each hand sequence with a converged plan to the cost of the
          plan;
        - ``failed``: dict that maps each other planned hand sequence to the status that IPOPT
          returned from its last start.

        Raises MethodError if IPOPT converges for no hand sequence, if a goal has no posture in a
        graph, or if both the rounding and the solve with targets inside the discs fail.
        """
        task = session.reveal(*self.information - {Information.SECONDARY_OBJECTIVES})
        with session.building():
            problem = trajectory_problem(
                task.robot, task.hands, len(task.goals), self.cost, session.model.base_weight
            )
        # A target this near to a goal's centre is sure to hit. A plan for path length is rounded to
        # whole control ticks instead, and goes through the rims.
        inside = task.radius - session.model.tolerances(task.radius)[0]
        radius = task.radius if self.cost == "path-length" else inside
        plans, failed = list[PathPlan](), dict[str, str]()
        stops = getattr(self.parameters, "stop", 0)
        with session.solving():
            for hands, starts in self.starts(session, task).items():
                instance = Instance.of(task, hands, still=False, radius=radius)
                plan = cheapest_plan(session, problem, instance, starts)
                if plan.converged and stops:
                    # The plan that passes the goals is another start for the plan that stops.
                    starts = [plan.configurations, *starts]
                    plan = cheapest_plan(session, problem, instance, starts, stops=True)
                if plan.converged:
                    plans.append(plan)
                else:
                    failed[letters_of(hands)] = plan.reason
            if not plans:
                raise MethodError(
                    "solver-failed", f"IPOPT converged for no hand sequence: {failed}"
                )
            best = plan = min(plans, key=lambda plan: plan.cost)
            aimed, configurations, steps = plan.instance, plan.configurations, None
            if self.cost == "path-length":
                rounded = Rounding(session, problem, aimed).nearest(plan)
                if rounded is not None:
                    configurations, steps = rounded.configurations, rounded.steps
                else:  # a plan with targets inside the discs hits the goals, too
                    aimed = replace(aimed, radius=inside)
                    plan = problem.solve(aimed, plan.configurations)
                    configurations = plan.configurations
                    session.spend(**plan.spent)
                    if not plan.converged:
                        reason = f"IPOPT failed with targets inside the discs: {plan.reason}"
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
        """Return the starts of each hand sequence to plan.

        The starts of a sequence are

        - the cheapest chain of the sequence in each random graph that contains a chain of the
          sequence;
        - with two hands (except for jerk of the hand), copies of these chains in which the idle arm
          moves in equal steps;
        - copies of the first start with noise.

        Parameters
        ----------
        session : Session
        task : Task

        Returns
        -------
        dict
            Dict that maps each hand sequence to its list of starts, each of shape ``(G, dof)``, in
            length units and rad.

        Raises
        ------
        MethodError
            A goal has no posture in a graph.
        """
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
            start = starts_of_hands[0]
            for _ in range(parameters.noisy_starts):
                sd = 0.1 * 10.0 ** rng.random()
                starts_of_hands.append(start + sd * rng.standard_normal(start.shape))
        return starts


class PathLength(TrajectoryOptimisation):
    """Shortest path in joint space, whose length determines the task's reward."""

    name = "trajectory-optimisation/path-length"
    title = "shortest-path plan"
    facts = Facts(
        works=("betts1998",),
        solvers=IPOPT,
        algorithm="trajectory planning",
        short="shortest path",
    )
    information = MODEL_BASED | {Information.REWARD_FORMULA}
    adapts_to = frozenset({"motor_noise", "base_weight"})
    cost = "path-length"


class SquaredDisplacement(TrajectoryOptimisation):
    """Minimum squared joint displacement, summed over the movements from goal to goal."""

    name = "trajectory-optimisation/squared-displacement"
    title = "minimum squared joint displacement"
    facts = Facts(
        works=("jordan1992", "jordan1986"),
        solvers=IPOPT,
        algorithm="trajectory planning",
        short="min. displacement",
    )
    information = MODEL_BASED | {Information.SECONDARY_OBJECTIVES}
    cost = "squared-displacement"


class Acceleration(TrajectoryOptimisation):
    """Minimum acceleration of the joints: a cubic spline through the goals' discs."""

    name = "trajectory-optimisation/acceleration"
    title = "minimum-acceleration plan"
    facts = Facts(
        works=("flash1985",),
        solvers=IPOPT,
        algorithm="trajectory planning",
        short="min. acceleration",
    )
    information = MODEL_BASED | {Information.SECONDARY_OBJECTIVES}
    cost: ClassVar[Cost] = "acceleration"
    Parameters = SmoothParameters


class Jerk(Acceleration):
    """Minimum jerk of the joints: a quintic spline through the goals' discs."""

    name = "trajectory-optimisation/jerk"
    title = "minimum-jerk plan"
    facts = Facts(
        works=("flash1985",),
        solvers=IPOPT,
        algorithm="trajectory planning",
        short="min. jerk",
    )
    cost: ClassVar[Cost] = "jerk"
    Parameters = JerkParameters


class HandJerk(Jerk):
    """Minimum jerk of the hand (Flash & Hogan 1985), plus a little joint jerk."""

    name = "trajectory-optimisation/hand-jerk"
    title = "minimum-hand-jerk plan"
    facts = Facts(
        works=("flash1985",),
        solvers=IPOPT,
        algorithm="trajectory planning",
        short="min. hand jerk",
    )
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
    """Divide a path into movements of kind ``path``, one for each goal.

    A movement ends where the hand enters the goal, usually before the piece of the path to this
    goal ends. The next movement therefore begins with the remaining waypoints of that piece. At all
    waypoints of a movement, the joints that ``instance`` holds during this movement have the values
    of the start of the movement. A movement that misses its goal is returned, too.

    Parameters
    ----------
    session : Session
        Session that counts the evaluations.
    task : Task
    instance : Instance
        Hands and held joints.
    path : list of ndarray, shape (k, dof)
        A piece of the path for each goal, in length units and rad. A piece does not include the
        last configuration of the previous piece.

    Returns
    -------
    tuple of Movement
        A movement for each goal.
    """
    paths: list[Movement] = []
    q, rest = np.array(task.q0), np.empty((0, task.robot.dof))
    exact = session.model.without_noise()
    for goal, (hand, piece) in enumerate(zip(instance.hands, path, strict=True)):
        waypoints = np.where(instance.held[goal], q, np.vstack([rest, piece]))
        followed = follow(
            task.robot, q, waypoints, hand, task.goals[goal], task.radius, model=exact
        )
        session.spend(forward_kinematics=followed.evaluations)
        paths.append(Movement(goal + 1, hand, "path", waypoints[-1], waypoints=waypoints))
        ends = np.cumsum(segment_lengths(np.vstack([q, waypoints])))
        steps_made = followed.ticks - 1
        q, rest = followed.q, waypoints[ends > steps_made * exact.step]
    return tuple(paths)
