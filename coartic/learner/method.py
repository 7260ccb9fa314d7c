"""The dual-process learner as methods: one for each exploration condition, and a general one.

Each variant of the learner that uses more information is a separate method. So the information that
a method declares does not depend on the values of its parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, ClassVar, Literal, Self, get_type_hints

import numpy as np
from pydantic import Field, create_model, model_validator

from coartic.learner.conditions import (
    CONDITIONS,
    EVERY_CONDITION,
    METHOD_PREFIX,
    VARIANTS,
    ExplorationCondition,
)
from coartic.learner.learning import learn_many, runs_at_once
from coartic.method import (
    CORRECTIONS_BY_TENTH,
    TRIALS,
    Facts,
    Information,
    Meter,
    Method,
    MethodError,
    Outline,
    Parameters,
    Result,
    Session,
)
from coartic.method.as_method import REACHED, HandsOrMethod, TicksOrMethod
from coartic.model import WORLD
from coartic.motion.solution import Movement, corrective_movements

_FIELDS: dict[str, Any] = get_type_hints(ExplorationCondition, include_extras=True)
del _FIELDS["id"], _FIELDS["hands"]  # parameters cannot change these


class DualProcessParameters(Parameters):
    """Parameters of every learner."""

    trials: Annotated[int, Field(gt=0)] = TRIALS
    """Number of trials of a run; fewer if the budget has fewer left."""
    sequence: HandsOrMethod | None = None
    """Hand sequence of all trials, such as ``"RRLR"``, or ``"as METHOD"`` for the hands of the
    answer of another method, such as ``"as cma-es/bandit"``. The learner then explores no hands. By
    default it begins with the task's initial hands."""
    until: TicksOrMethod | None = None
    """The run ends with its first trial that takes at most so many ticks, or, with ``"as METHOD"``,
    as many as the answer of another method. If no trial does, all trials are made. By default they
    always are."""


class CustomParameters(DualProcessParameters):
    """Parameters of a custom condition: a condition of the paper with some fields changed."""

    base: Literal["EC1", "EC2", "EC3", "EC4"] = "EC4"
    """The condition of the paper that is changed."""

    @model_validator(mode="after")
    def check_condition(self) -> Self:
        """Check the condition that the parameters describe, and return the parameters.

        Raises ValueError if the condition contradicts itself.
        """
        _condition_of(CONDITIONS[self.base], self)
        return self


def _condition_of(base: ExplorationCondition, parameters: Parameters) -> ExplorationCondition:
    """Return a copy of condition ``base`` with the parameters that are not None.

    Raises ValueError if the values contradict each other.
    """
    values = parameters.model_dump(include={*_FIELDS}, exclude_none=True)
    given = parameters.model_dump(include={"sequence", "until"}, exclude_none=True)
    if "sequence" in given:
        values["hand_exploration"] = "none"
    condition = replace(base, **values)
    if "until" in given and condition.learned != "best":
        raise ValueError("until needs a learner whose solution is its best trial")
    return condition


class DualProcess(Method):
    """Trial and error on top of the corrective process (paper, Figure 3)."""

    condition: ClassVar[ExplorationCondition]
    facts = Facts(works=("shah2013",), algorithm="learner")
    adapts_to = frozenset(WORLD)
    tuned_on = "nothing: the paper's values"

    def rules(self) -> ExplorationCondition:
        """Return the method's exploration condition with the values of its parameters."""
        return _condition_of(self.condition, self.parameters)

    def inapplicable_reason(self, task: Outline) -> str | None:
        """Return why the exploration condition does not apply to a task; None if it applies."""
        return self.rules().inapplicable_reason(task)

    def solve(self, session: Session) -> Result:
        """Run the learner, and return the movements of its learned solution.

        The learned solution is the best trial or, if the condition has ``learned="replay"``, a
        greedy trial without exploration that is made after learning. With motor noise it is the
        learner's next action (:attr:`.LearningRun.next_action`).

        Raises MethodError if there is no learned solution (:attr:`.LearningRun.learned`) or the
        budget has no trial left, and NotApplicableError if no initial hands are found.
        """
        (result,) = self.solve_together([session])
        if isinstance(result, MethodError):
            raise result
        return result

    def max_batch(self) -> int:
        """Return the largest number of sessions for one call of :meth:`solve_together`.

        The number is from 1 to 72. If it is above 1, the sessions of a call together make at most
        4,000,000 trials.
        """
        return runs_at_once(self.parameters.trials)

    def solve_together(self, sessions: Sequence[Session]) -> list[Result | MethodError]:
        """Run the learner side by side in sessions that differ only in their seeds.

        Parameters
        ----------
        sessions : sequence of Session
            At most 72 sessions with the same task, model and budget.

        Returns
        -------
        list of Result or MethodError
            For each session, in order, the result of :meth:`solve`, or the MethodError that
            :meth:`solve` would raise.

        Raises
        ------
        NotApplicableError
            No initial hands are found.
        """
        parameters, condition = self.parameters, self.rules()
        tasks = [session.reveal(*self.information) for session in sessions]
        task, model = tasks[0], sessions[0].model
        start: Sequence[Movement] = ()
        if parameters.sequence is None:
            for session in sessions:
                session.find_initial_hands(condition.hands)  # so that its trials are counted
        else:
            sessions[0].hand_codes(parameters.sequence, 1)  # which checks them
            start = corrective_movements(parameters.sequence)
        left = sessions[0].trials_left
        trials = parameters.trials if left is None else min(parameters.trials, left)
        if trials < 1:
            reason = "the trial budget leaves no trial to make"
            return [MethodError("infeasible", reason) for _ in sessions]
        learn_some = partial(learn_many, task, condition, model=model, jobs=1, start=start)
        runs = learn_some(seeds=[session.seed for session in sessions], trials=trials)
        results: list[Result | MethodError] = []
        for session, run in zip(sessions, runs, strict=True):
            told = dict[str, Any]()
            if parameters.until is not None:
                good = np.ma.filled(run.rewards >= -parameters.until, fill_value=False)
                told = {REACHED: bool(good.any())}
                if good.any():  # a run of fewer trials has the same first trials
                    (run,) = learn_some(seeds=[run.seed], trials=int(good.argmax()) + 1)
            session.spend(**{name: getattr(run.counters, name) for name in Meter.COUNTS})
            session.record(run.rewards.tolist(), run.wall_s)  # None where a trial failed
            if not run.learned:
                results.append(MethodError("infeasible", run.reason))
                continue
            details = {CORRECTIONS_BY_TENTH: run.corrections.tolist(), **told}
            results.append(Result(run.learned, details, initial=run.initial, replay=run.replay))
        return results


def _method_for(condition: ExplorationCondition) -> type[DualProcess]:
    """Make the class of the learner under an exploration condition.

    The class is a subclass of :class:`DualProcess`. The parameters are ``trials``, ``noise_sd`` and
    ``epsilon``; for an informed condition ``drift``, too.
    """
    names = ["epsilon", "noise_sd"]
    base, _, change = condition.id.partition("-")
    title, facts = f"learner {base}", DualProcess.facts
    if change in VARIANTS:
        words, _ = VARIANTS[change]
        title, of = f"{title}, {words}", f"{METHOD_PREFIX}{base}"
        facts = replace(facts, short=f"{base}, {words}", headline=False, ablation_of=of)
    information = {Information.CORRECTIVE_PROCESS, Information.REWARD_BY_TRIAL}
    if condition.is_informed:  # null-space motion, towards postures on short paths
        information |= {Information.JACOBIAN, Information.REWARD_FORMULA}
        names += ["drift"]
        title = f"informed learner {base}"
        facts = replace(facts, algorithm="informed learner", short=f"informed {base}")
    if condition.hand_exploration == "closest":  # to find the closest hand
        information |= {Information.GOALS, Information.FORWARD_KINEMATICS}
    if condition.credit == "subtask":
        information |= {Information.REWARD_BY_SUBTASK}
        facts = replace(facts, works=(*facts.works, "dietterich2000"))
    fields: Any = {name: (_FIELDS[name], getattr(condition, name)) for name in names}

    def check(parameters: Parameters) -> Parameters:
        _condition_of(condition, parameters)
        return parameters

    checks: Any = {"check": model_validator(mode="after")(check)}
    return type(
        f"DualProcess{condition.id.replace('-', '')}",
        (DualProcess,),
        {
            "__doc__": DualProcess.__doc__,
            "__module__": __name__,
            "name": f"{METHOD_PREFIX}{condition.id}",
            "title": title,
            "facts": facts,
            "information": frozenset(information),
            "Parameters": create_model(
                "DualProcessParameters",
                __base__=DualProcessParameters,
                __validators__=checks,
                **fields,
            ),
            "condition": condition,
            "tuned_on": _DRIFT_TUNED_ON if condition.drift else DualProcess.tuned_on,
        },
    )


_DRIFT_TUNED_ON = (
    "50 development instances: a drift among 0.1, 0.3 and 1 (mean gaps 6.8, 4.2 and 4.0 %; 0.3 is "
    "ahead in three of five families); else the paper's values"
)
_LEARNERS = tuple(map(_method_for, EVERY_CONDITION.values()))
_optional: Any = {name: (kind | None, None) for name, kind in _FIELDS.items()}


class CustomDualProcess(DualProcess):
    """The learner under an exploration condition that the parameters define.

    The parameters are ``trials``, ``base`` (a condition of the paper), and all fields of a
    condition except ``id`` and ``hands``, which change ``base``. The method declares all
    information that any condition uses.
    """

    name = f"{METHOD_PREFIX}custom"
    title = "learner, own condition"
    facts = Facts(works=("shah2013",), headline=False)
    information = frozenset[Information]().union(*(learner.information for learner in _LEARNERS))
    Parameters: ClassVar[type[Parameters]] = create_model(
        "CustomParameters", __base__=CustomParameters, **_optional
    )

    def rules(self) -> ExplorationCondition:
        """Return a copy of condition ``base`` with the fields that the parameters set.

        If a parameter is None, its field is that of ``base``. The id of the copy is, for example,
        ``EC4, changed,``.
        """
        base = replace(CONDITIONS[self.parameters.base], id=f"{self.parameters.base}, changed,")
        return _condition_of(base, self.parameters)


METHODS: tuple[type[DualProcess], ...] = (*_LEARNERS, CustomDualProcess)
