"""A planner that believes in some part of the true reward, and the learner started from its plan.

The reward of a task may lose a penalty beside 1 a tick (:class:`coartic.tasks.task.Penalty`). The
planner maximises what it believes to be the reward: minus the ticks, minus ``belief`` times the
penalty. With 1 it is told the truth, with 0 that only ticks count, as the searches for the optimum
and all planners of shortest paths believe; on a task without a penalty nothing is to be believed.
It plans as they do: the cheapest chains of posture graphs, polished by IPOPT, with the penalty in
both. It starts from the shortest paths as well, so that who is told more does not plan worse. The
plan of each hand sequence aims through the rims of the goals, and of these plans the one that is
best by the believed reward, as executed, is handed over.

``believed-reward/EC1`` and ``EC4`` are the dual-process learner under that exploration condition,
whose trial 0 makes the movements of such a plan in place of the corrective process. Beyond that it
is told what the learner is told.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from coartic import Execution, Movement, Task, execute
from coartic.baselines.posture_graph import Chain, cheapest_chains
from coartic.baselines.shortest_paths import KNOWS_REWARD, ShortestPlans, shortest_plans
from coartic.baselines.trajectory_problem import trajectory_problem
from coartic.baselines.whole_ticks import movements
from coartic.learner.conditions import CONDITIONS
from coartic.learner.method import DualProcess, DualProcessParameters
from coartic.method import Information, Meter, Method, MethodError, Parameters, Result, Session
from coartic.model import PAPER, MotionModel
from coartic.motion.penalty import penalties
from coartic.tasks.task import WITHOUT_REACH, Penalty

_PLANS_EXECUTED = 8  # one for each hand sequence, in the planner's mind


class BeliefParameters(Parameters):
    """The belief, and the effort of the search."""

    belief: Annotated[float, Field(ge=0, le=10)] = 1.0
    """Share of the penalty that the planner takes into account."""
    nodes: Annotated[int, Field(ge=10, le=1000)] = 200
    """Postures per goal of a posture graph, shared by the hands."""
    graphs: Annotated[int, Field(ge=1)] = 3
    """Independent graphs, or more, until there are as many chains as ``starts``."""
    starts: Annotated[int, Field(ge=1)] = 12
    """Chains that are polished, the cheapest of all graphs and hand sequences."""


class LearnerParameters(BeliefParameters, DualProcessParameters):
    """Parameters of the plan and of the learner."""

    belief: Annotated[float, Field(ge=0, le=10)] = 0.0


def best_plan(
    session: Session, task: Task, parameters: BeliefParameters
) -> tuple[tuple[Movement, ...], dict[str, Any]]:
    """The plan that is best by the believed reward, and details of it."""
    believed = with_belief(task, parameters.belief)
    with session.solving():
        plain = believed.model_copy(update={"penalty": None})
        how_long = parameters.model_dump(include={"nodes", "graphs", "starts"})
        search = BeliefParameters(**how_long)  # the same for every belief
        plans, spent = shortest(plain.model_dump_json(), search, session.model)
        session.spend(**spent)
        if believed.penalty is not None:
            known = [(i.hands, plan.configurations) for i, plan in plans.ranked[:_PLANS_EXECUTED]]
            plans = cheapest(session, believed, search, known)
        best: Execution | None = None
        for instance, plan in plans.ranked[:_PLANS_EXECUTED]:
            steps = np.ceil(plan.lengths(task.q0) / session.model.step).astype(int)
            solution = movements(
                session, task, instance, plan.configurations, tuple(steps.tolist())
            )
            execution = execute(believed, solution, model=session.model)
            session.spend(forward_kinematics=execution.evaluations)
            if execution.reward is not None and (
                best is None or best.reward is None or execution.reward > best.reward
            ):
                best = execution
    if best is None:
        raise MethodError("solver-failed", "the movements of no plan hit every goal")
    details = {
        "believed_reward": best.reward,
        "solves": plans.solves,
        "failed_solves": plans.failed,
    }
    return best.movements, details


@lru_cache(maxsize=64)
def shortest(
    task_json: str, search: BeliefParameters, model: MotionModel
) -> tuple[ShortestPlans, dict[str, int]]:
    """The shortest plans of a task without a penalty, given as JSON, and the solver's counters.

    Every belief starts from them, and all variants of a task have the same: they are found once.
    """
    task = Task.model_validate_json(task_json, context=WITHOUT_REACH)
    session = Session(task, 0, KNOWS_REWARD, model=model, trusted=True)
    plans = cheapest(session, task, search, [])
    return plans, {name: getattr(session.meter, name) for name in Meter.SOLVER}


def cheapest(
    session: Session, believed: Task, search: BeliefParameters, known: Sequence[Chain]
) -> ShortestPlans:
    """The plans of least path length and penalty, from ``known`` starts and from chains."""
    penalty = believed.penalty
    problem = trajectory_problem(
        believed.robot,
        believed.hands,
        len(believed.goals),
        "path-length",
        penalised=penalty is not None,
    )
    chains = cheapest_chains(
        session,
        believed,
        np.random.default_rng(0),
        nodes=search.nodes // len(believed.hands),
        graphs=search.graphs,
        chains=search.starts,
        spread=len(believed.goals) > 1,
        penalty=penalty,
    )
    ranked = sorted(chains, key=lambda start: cost_of(believed, start))
    return shortest_plans(
        session,
        believed,
        problem,
        [*known, *ranked[: search.starts]],
        still=False,
        radius=believed.radius,
        penalty=penalty,
    )


def with_belief(task: Task, belief: float) -> Task:
    """The task as it is believed to be: a share of its penalty counts."""
    penalty = task.penalty
    if penalty is not None:
        terms = ("joints", "region", "distinct")
        weights = {name: belief * getattr(penalty, name) for name in terms}
        penalty = Penalty(**{**penalty.model_dump(), **weights}) if belief else None
    return task.model_copy(update={"penalty": penalty})


def cost_of(believed: Task, start: Chain) -> float:
    """Cost of a start by the believed reward, without polishing, ticks."""
    hands, configurations = start
    steps = np.diff(np.vstack([believed.q0, configurations]), axis=0)
    lost = penalties(believed, [hands], configurations[None]).sum()
    return float(np.sqrt((steps**2).sum(axis=1)).sum() / PAPER.step + lost)


class BelievedReward(Method):
    """The plan that is best by the believed reward."""

    name = "believed-reward/plan"
    title = "Planning by a believed reward"
    citation = "This package; docs/methods.md describes it."
    told = KNOWS_REWARD
    stochastic = False
    Parameters = BeliefParameters
    quick: ClassVar[dict[str, Any]] = {"nodes": 40, "graphs": 1, "starts": 2}

    def solve(self, session: Session) -> Result:
        """Plan, and hand over the best plan."""
        return Result(*best_plan(session, session.hand_over(*self.told), self.parameters))


class FromPlanEC1(DualProcess):
    """The learner whose trial 0 is a plan, under exploration condition 1."""

    name = "believed-reward/EC1"
    title = "Dual-process learner from a plan, exploration condition 1"
    told = KNOWS_REWARD | {Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL}
    condition = CONDITIONS["EC1"]
    Parameters = LearnerParameters
    quick: ClassVar[dict[str, Any]] = BelievedReward.quick

    def first_trial(self, sessions: Sequence[Session], task: Task) -> tuple[Movement, ...]:
        """The plan: one for all sessions, since each would find the same."""
        plan, _ = best_plan(sessions[0], task, self.parameters)
        spent = {name: getattr(sessions[0].meter, name) for name in Meter.SOLVER}
        for session in sessions[1:]:
            session.spend(**spent)
        return plan


class FromPlanEC4(FromPlanEC1):
    """The same under exploration condition 4."""

    name = "believed-reward/EC4"
    title = "Dual-process learner from a plan, exploration condition 4"
    condition = CONDITIONS["EC4"]


METHODS: tuple[type[Method], ...] = (BelievedReward, FromPlanEC1, FromPlanEC4)
