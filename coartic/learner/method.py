"""The dual-process learner as a method, one per exploration condition and ablation.

Variants that use more information than the paper's learner are methods of their own, with the
parameter that makes the difference; the others do not have it, so that what a method
declares holds under all its parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from coartic.learner.conditions import (
    CONDITIONS,
    EVERY_CONDITION,
    METHOD_PREFIX,
    MOST_NOISE,
    Counted,
    Credit,
    Direction,
    Drifts,
    ExplorationCondition,
    HandExploration,
    Learned,
    Share,
)
from coartic.learner.learning import TRIALS, learn_many
from coartic.learner.learning_run import CORRECTIONS
from coartic.method import (
    Information,
    Meter,
    Method,
    MethodError,
    Outline,
    Parameters,
    Result,
    Session,
)
from coartic.motion.batch import SLOTS

_MOST_TRIALS = 4_000_000  # of runs that are performed together


class DualProcessParameters(Parameters):
    """Parameters of the learner; the defaults are the paper's."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Trials of a run."""
    epsilon: Annotated[float, Field(ge=0, le=1)] = 0.2
    """ε: probability, for each goal, of exploring the hand: a random hand or the closest one, by
    condition. EC1 has one hand."""
    noise_sd: Annotated[float, Field(ge=0, le=MOST_NOISE, allow_inf_nan=False)] = 0.05
    """SD of η, length unit (base) or rad (joints)."""


class SubtaskParameters(DualProcessParameters):
    """Parameters of the ablations that learn from the reward of each subtask."""

    discount: Annotated[float, Field(ge=0, le=1)] = 0.0
    """γ of a goal's return; 0 is the reward of its own subtask alone."""
    counted: Counted = "later"
    """Subtasks whose rewards the return counts: from the goal on, or all, which with γ = 1 is the
    total reward."""


class InformedParameters(DualProcessParameters):
    """Parameters of the informed learner; the defaults are those of its condition."""

    epsilon: Share = 0.4
    """ε: probability, for each goal, of exploring the hand. EC1 has one hand."""
    noise_sd: Annotated[float, Field(ge=0, le=MOST_NOISE, allow_inf_nan=False)] = 0.01
    """SD of η, length unit (base) or rad (joints)."""
    drift: Drifts = 1.0
    """κ: share of the way to the preferred posture by which the mean of exploration moves; of a
    list each trial draws one."""
    pull: Share = 0.0
    """β: the same share in each iteration of the corrective process."""
    direction: Direction = "next-goal"
    """The preferred posture: halfway to the stored target of the next goal, where the robot is, or
    where the trial began."""


class CustomParameters(Parameters):
    """Any exploration condition: one of the paper's, and the fields that are other than there."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Trials of a run."""
    base: Literal["EC1", "EC2", "EC3", "EC4"] = "EC4"
    """The paper's condition that is changed."""
    modify_chosen: bool | None = None
    """True if noise moves the targets of the base and of the arm that is to hit."""
    modify_other: bool | None = None
    """True if noise moves the targets of the other arm."""
    hand_exploration: HandExploration | None = None
    """Exploration of the hand for a goal."""
    epsilon: Share | None = None
    """ε: probability, for each goal, of exploring the hand."""
    noise_sd: Annotated[float, Field(ge=0, le=MOST_NOISE, allow_inf_nan=False)] | None = None
    """SD of η, length unit (base) or rad (joints)."""
    corrects: bool | None = None
    """True if the corrective process finishes what a stored target misses."""
    learned: Learned | None = None
    """Result of learning: the best trial, or the replay."""
    credit: Credit | None = None
    """Credit of a goal: the reward of the whole trial, or the return of its subtask."""
    discount: Share | None = None
    """γ of a goal's return."""
    counted: Counted | None = None
    """Subtasks whose rewards the return counts."""
    drift: Drifts | None = None
    """κ of informed exploration."""
    pull: Share | None = None
    """β of informed correction."""
    direction: Direction | None = None
    """The preferred posture."""

    @model_validator(mode="after")
    def check_condition(self) -> Self:
        """Raise ValueError for fields that contradict each other."""
        condition_of(CONDITIONS[self.base], self)
        return self


def condition_of(base: ExplorationCondition, parameters: Parameters) -> ExplorationCondition:
    """Return a condition with the fields that parameters set."""
    names = {field.name for field in fields(ExplorationCondition)}
    given = parameters.model_dump(include=names, exclude_none=True)
    return replace(base, **given)


class DualProcess(Method):
    """Trial and error over the corrective process (paper, Figure 3)."""

    condition: ClassVar[ExplorationCondition]
    citation = (
        "A. Shah, A. G. Barto, A. H. Fagg (2013). A dual process account of coarticulation "
        "in motor skill acquisition. Journal of Motor Behavior."
    )
    Parameters: ClassVar[type[Parameters]] = DualProcessParameters

    def rules(self) -> ExplorationCondition:
        """Return the exploration condition with the parameters."""
        return condition_of(self.condition, self.parameters)

    def why_not(self, task: Outline) -> str | None:
        """Return why the condition does not apply to a task, None where it does."""
        return self.rules().why_not(task)

    def solve(self, session: Session) -> Result:
        """Learn; the solution is the best trial's, or the replay's if that is learned."""
        (result,) = self.solve_together([session])
        if isinstance(result, MethodError):
            raise result
        return result

    def most_together(self) -> int:
        """As many as there are slots, if their rewards fit into one answer."""
        trials: int = self.parameters.trials
        return max(1, min(SLOTS, _MOST_TRIALS // trials))

    def solve_together(self, sessions: Sequence[Session]) -> list[Result | MethodError]:
        """Learn in each session; a solution is the best trial's, or the replay's."""
        parameters, condition = self.parameters, self.rules()
        tasks = [session.reveal(*self.information) for session in sessions]
        task, model = tasks[0], sessions[0].model
        for session in sessions:
            session.find_initial_hands(condition.hands)  # counts what that takes
        left = sessions[0].trials_left
        trials = parameters.trials if left is None else min(parameters.trials, left)
        runs = learn_many(
            task,
            condition,
            seeds=[session.seed for session in sessions],
            trials=trials,
            model=model,
            jobs=1,
        )
        results: list[Result | MethodError] = []
        for session, run in zip(sessions, runs, strict=True):
            session.spend(**{name: getattr(run.counters, name) for name in Meter.COUNTS})
            session.record(run.rewards.tolist(), run.wall_s)  # None where a trial failed
            if not run.learned:
                results.append(MethodError("infeasible", run.reason))
                continue
            details = {CORRECTIONS: run.corrections.tolist()}
            results.append(Result(run.learned, details, initial=run.initial, replay=run.replay))
        return results


def method_for(condition: ExplorationCondition) -> type[DualProcess]:
    """The learner under a condition as a method."""
    parameters: type[DualProcessParameters] = DualProcessParameters
    citation = DualProcess.citation
    information = {Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL}
    if condition.is_informed:  # to move in the null space of a hand
        information |= {Information.JACOBIAN}
        parameters = InformedParameters
    if condition.hand_exploration == "closest":  # to find the closest hand
        information |= {Information.GOALS, Information.FORWARD_KINEMATICS}
    if condition.credit == "subtask":
        information |= {Information.REWARD_BY_SUBTASK}
        parameters = SubtaskParameters
        citation += (
            " Reward of subtasks, after T. G. Dietterich (2000). Hierarchical reinforcement "
            "learning with the MAXQ value function decomposition. Journal of Artificial "
            "Intelligence Research."
        )
    number, _, ablation = condition.id[2:].partition("-")
    return type(
        f"DualProcess{condition.id.replace('-', '')}",
        (DualProcess,),
        {
            "__doc__": DualProcess.__doc__,
            "__module__": __name__,
            "name": f"{METHOD_PREFIX}{condition.id}",
            "title": f"Dual-process learner, exploration condition {number}"
            + (f", {ablation}" if ablation else ""),
            "information": frozenset(information),
            "citation": citation,
            "Parameters": parameters,
            "condition": condition,
        },
    )


class CustomDualProcess(DualProcess):
    """The learner under any exploration condition, with all information that a condition may use.

    Its parameters are the fields of a condition, so that a suite can change one assumption.
    """

    name = f"{METHOD_PREFIX}custom"
    title = "Dual-process learner, any exploration condition"
    information = frozenset(
        {
            Information.CORRECTIVE_PROCESS,
            Information.REWARD_BY_TRIAL,
            Information.REWARD_BY_SUBTASK,
            Information.GOALS,
            Information.FORWARD_KINEMATICS,
            Information.JACOBIAN,
        }
    )
    Parameters = CustomParameters

    def rules(self) -> ExplorationCondition:
        """Return the base condition with the fields that the parameters change."""
        base = replace(CONDITIONS[self.parameters.base], id=f"{self.parameters.base}, changed,")
        return condition_of(base, self.parameters)


METHODS: tuple[type[DualProcess], ...] = (
    *map(method_for, EVERY_CONDITION.values()),
    CustomDualProcess,
)
