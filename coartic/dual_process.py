"""The dual-process learner as a method, one per exploration condition."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Annotated, Any, ClassVar

from pydantic import Field

from coartic.exploration import CONDITIONS, ExplorationCondition
from coartic.initial import InitialSearch, search_initial_hands
from coartic.learner import METHOD_PREFIX, TRIALS, LearningRun, learn
from coartic.method import Information, Method, MethodError, Parameters, Result, Session
from coartic.task import Task


class DualProcessParameters(Parameters):
    """Parameters of the learner; the defaults are the paper's."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    epsilon: Annotated[float, Field(ge=0, le=1)] = 0.2
    """ε"""
    noise_sd: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.05
    """SD of η, length unit (base) or rad (joints)."""


class DualProcess(Method):
    """Trial and error over the corrective process (paper, Figure 3)."""

    condition: ClassVar[ExplorationCondition]
    citation = (
        "A. Shah, A. G. Barto, A. H. Fagg (2013). A dual process account of coarticulation "
        "in motor skill acquisition. Journal of Motor Behavior."
    )
    Parameters = DualProcessParameters

    def why_not(self, task: Task) -> str | None:
        """Why the condition does not apply to a task, or None where it does."""
        return self.condition.why_not(task)

    def solve(self, session: Session) -> Result:
        """Learn; the solution is the best trial's."""
        parameters: DualProcessParameters = self.parameters
        condition = replace(
            self.condition, epsilon=parameters.epsilon, noise_sd=parameters.noise_sd
        )
        task = session.hand_over(*self.told)
        spend_search(session, search_initial_hands(task, condition.hands, model=session.model))
        trials = parameters.trials
        if session.trials_left is not None:
            trials = min(trials, session.trials_left)
        if trials < 1:
            raise MethodError(
                "infeasible", "the trial budget ends with the search for initial hands"
            )
        with session.solving():
            run = learn(
                task,
                condition,
                seed=session.seed,
                trials=trials,
                model=session.model,
            )
        session.spend(**asdict(run.counters))
        session.record_rewards(run.rewards.tolist())  # None where a trial failed
        if run.best_trial is None:
            raise MethodError("infeasible", run.reason, _details(run))
        return Result(run.solution, _details(run))


def spend_search(session: Session, search: InitialSearch) -> None:
    """Charge what a policy spent on finding the initial hands."""
    spent = search._asdict()
    del spent["hands"]
    session.spend(**spent, jacobians=search.corrective_iterations)


def _details(run: LearningRun) -> dict[str, Any]:
    return {
        "initial_reward": run.initial_reward,
        "initial_hands": run.first_hands,
        "replay_reward": run.replay_reward,
        "replay_hands": run.replay_hands,
        "best_trial": run.best_trial,
    }


def _told(condition: ExplorationCondition) -> frozenset[Information]:
    """**A** and the total reward; the closest hand also needs to know where things are."""
    told = {Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL}
    if condition.hand_exploration == "closest":
        told |= {Information.GOALS, Information.FORWARD_KINEMATICS}
    return frozenset(told)


def _variant(condition: ExplorationCondition) -> type[DualProcess]:
    return type(
        f"DualProcess{condition.id}",
        (DualProcess,),
        {
            "__doc__": DualProcess.__doc__,
            "__module__": __name__,
            "name": f"{METHOD_PREFIX}{condition.id}",
            "title": f"Dual-process learner, exploration condition {condition.id[2:]}",
            "told": _told(condition),
            "condition": condition,
        },
    )


DUAL_PROCESS: tuple[type[DualProcess], ...] = tuple(_variant(c) for c in CONDITIONS.values())
