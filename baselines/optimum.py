"""The optimum: the best reward that two independent global searches find.

Reward is lost in proportion to the joint-space path, so the shortest path that touches
every disc is sought over all hand sequences: once from the chains of a posture graph
(layered dynamic programming), once from many random starts around the configurations of the
corrective process. Either way every plan is then rounded to whole control ticks in every way,
with and without goals that are hit as their turn comes because the other hand is already
there. A reference for the gaps of all other methods, not a competitor.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from coartic import Task, TaskError, parse_task
from coartic.baselines.certificate import certify
from coartic.baselines.posture_graph import Chain, HandSequence, cheapest_chains
from coartic.baselines.shortest_paths import KNOWS_REWARD, check_ticks, fewest_ticks, shortest_plans
from coartic.baselines.trajectory_problem import trajectory_problem
from coartic.method import Information, Method, MethodError, Outline, Parameters, Result, Session
from coartic.motion.corrective import correct
from coartic.motion.initial import hand_sequences
from coartic.robot import Array
from coartic.tasks.task import hands_of, letters_of

MOST_KEPT = 64  # hand sequences whose shortest paths are kept beside the solution


class OptimumParameters(Parameters):
    """The restriction, and how long to search."""

    other_arm: Literal["free", "still"] = "free"
    """Whether the arm that is not chosen may move."""
    base: Literal["task", "y", "xy"] = "task"
    """Base coordinates that are locked: those of the task, or these in addition."""


class GraphParameters(OptimumParameters):
    """The restriction, and how many postures, starts and hand sequences to plan with."""

    nodes: Annotated[int, Field(ge=10, le=1000)] = 200
    """Postures per goal and hand."""
    graphs: Annotated[int, Field(ge=1)] = 3
    """Independent graphs, or more, until there are as many ``chains``."""
    chains: Annotated[int, Field(ge=1)] = 100
    """Starts, over all graphs and hand sequences, each with the other arm spread out, too. With
    three, the best path known was missed on 9 of 40 random tasks for one arm."""


class BoundParameters(GraphParameters):
    """Parameters of the posture graph, and the budget of the proof."""

    most_nodes: Annotated[int, Field(ge=1)] = 20_000
    """Cone programmes that may be solved for it, some 500 a second with five goals. The search
    ends with the bound that it has then, and says how many ticks that leaves."""


class MultistartParameters(OptimumParameters):
    """The restriction, and how many random starts to plan from."""

    starts: Annotated[int, Field(ge=1)] = 60
    """Starts per hand sequence. The first is the corrective process's own solution."""


class Optimum(Method):
    """The shortest path over all hand sequences, in whole ticks."""

    citation = "This package; docs/model.md derives the bound on reward."
    stochastic = False

    @abstractmethod
    def starts(self, session: Session, task: Task) -> Iterator[Chain]:
        """Hand sequences with a configuration per goal to start from."""

    def solve(self, session: Session) -> Result:
        """Search; the solution has the fewest ticks found."""
        parameters: OptimumParameters = self.parameters
        check_ticks(session.model)
        task = with_locks(session.hand_over(*self.told), parameters.base)
        with session.building():
            problem = trajectory_problem(task.robot, task.hands, len(task.goals), "path-length")
        with session.solving():
            plans = shortest_plans(
                session,
                task,
                problem,
                self.starts(session, task),
                still=parameters.other_arm == "still",
                radius=task.radius,
            )
            best = fewest_ticks(session, task, problem, plans)
        bound, proof = self.proof(session, task, best.execution.ticks)
        details = {
            "path_length": plans.ranked[0][1].cost,
            "path_lengths": {
                letters_of(instance.hands): plan.cost for instance, plan in plans.ranked[:MOST_KEPT]
            },
            "solves": plans.solves,
            "failed_solves": plans.failed,
            "sequences_planned": len(plans.by_hands),
            **proof,
        }
        return Result(best.movements, details, bound=bound)

    def proof(self, session: Session, task: Task, ticks: int) -> tuple[int | None, dict[str, Any]]:
        """Reward that is proven never to be exceeded, and how hard that was."""
        return None, {}


class DynamicProgramming(Optimum):
    """From the cheapest chains of posture graphs."""

    name = "optimum/dynamic-programming"
    title = "Optimum: dynamic programming over postures and hands, polished"
    told = KNOWS_REWARD
    Parameters = GraphParameters
    quick: ClassVar[dict[str, Any]] = {"nodes": 40, "graphs": 1, "chains": 1}

    def starts(self, session: Session, task: Task) -> Iterator[Chain]:
        """The chain of every sequence; with a free other arm also with that arm spread out."""
        parameters: GraphParameters = self.parameters
        return cheapest_chains(
            session,
            task,
            np.random.default_rng(0),
            nodes=parameters.nodes,
            graphs=parameters.graphs,
            chains=parameters.chains,
            spread=parameters.other_arm == "free",
        )


class BranchAndBound(DynamicProgramming):
    """The same search, and a proof of how good its outcome is."""

    name = "optimum/branch-and-bound"
    title = "Optimum: dynamic programming, with a proven bound"
    citation = (
        "G. P. McCormick (1976). Computability of global solutions to factorable nonconvex "
        "programs. Mathematical Programming; P. J. Goulart, Y. Chen (2024). Clarabel: an "
        "interior-point solver for conic programs with quadratic objectives."
    )
    Parameters = BoundParameters
    quick: ClassVar[dict[str, Any]] = {"nodes": 40, "graphs": 1, "chains": 1, "most_nodes": 100}

    def proof(self, session: Session, task: Task, ticks: int) -> tuple[int, dict[str, Any]]:
        """Reward that is proven never to be exceeded, and how hard that was."""
        with session.solving():
            certificate = certify(
                task,
                ticks,
                still=self.parameters.other_arm == "still",
                model=session.model,
                most_nodes=self.parameters.most_nodes,
            )
        session.spend(solver_iterations=certificate.iterations)
        return -certificate.ticks, {
            "proven_optimal": certificate.ticks == ticks,
            "nodes": certificate.nodes,
            "open_nodes": certificate.open_nodes,
            "ticks_left": ticks - certificate.ticks,
        }


class Multistart(Optimum):
    """From random starts around the configurations of the corrective process."""

    name = "optimum/multistart"
    title = "Optimum: random starts for every hand sequence"
    told = frozenset(
        {
            Information.GOALS,
            Information.CORRECTIVE_PROCESS,
            Information.KINEMATIC_MODEL,
            Information.REWARD_FORMULA,
        }
    )
    Parameters = MultistartParameters
    quick: ClassVar[dict[str, Any]] = {"starts": 2}

    def why_not(self, task: Outline) -> str | None:
        """The reason why there are too many hand sequences to plan one by one, if there are."""
        return task.too_many_sequences

    def starts(self, session: Session, task: Task) -> Iterator[Chain]:
        """The corrective process's configurations, and Gaussian noise of many sizes on them."""
        rng = np.random.default_rng(0)
        for letters in hand_sequences(task):
            hands = hands_of(letters)
            start = correct_each_goal(session, task, hands)
            for number in range(self.parameters.starts):
                spread = 0.0 if number == 0 else 0.05 * 30.0 ** rng.random()
                yield hands, start + spread * rng.standard_normal(start.shape)


def correct_each_goal(session: Session, task: Task, hands: HandSequence) -> Array:
    """A configuration per goal, each from **A**; the last iterate where it does not converge."""
    q, configurations = np.array(task.q0), []
    for hand, goal in zip(hands, task.goals, strict=True):
        correction = correct(
            task.robot, q, hand, goal, locked_base=task.locked_base, model=session.model
        )
        session.spend(
            corrective_iterations=correction.iterations,
            jacobians=correction.iterations,
            forward_kinematics=correction.iterations + 1,
        )
        q = correction.q
        configurations.append(q)
    return np.array(configurations)


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


METHODS: tuple[type[Optimum], ...] = (DynamicProgramming, Multistart, BranchAndBound)
